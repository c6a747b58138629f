//! Plants whose state jumps: `when` clauses, from the study to the answer.

mod rows;
mod suites;

use crate::{Ended, Folder};

const BALL: &str = "model Ball
  Real h(start = 1);
  Real v(start = 0);
  discrete Integer n(start = 0);
  output Real y = h;
equation
  der(h) = v;
  der(v) = -9.81;
  when h <= 0 then
    reinit(v, -0.8*pre(v));
    n = pre(n) + 1;
  end when;
end Ball;
";

/// A heater with a hysteresis, of a power that has to be found.
pub(crate) const THERMOSTAT: &str = "model Thermostat
  Real T(start = 18);
  Real heat(start = 8);
  Boolean on(start = true);
  output Real y = T;
equation
  der(T) = (if on then heat else 0) - 0.5*(T - 12);
  der(heat) = 0;
  when T >= 21 then
    on = false;
  elsewhen T <= 19 then
    on = true;
  end when;
end Thermostat;
";

const BATCH: &str = "model Batch
  Real h(start = 0.5);
  Real feed(start = 1);
  Integer batches(start = 0);
  output Real y = h;
equation
  der(h) = feed - 0.2*h;
  der(feed) = 0;
  when h >= 2 then
    reinit(h, 0.1*h);
    batches = pre(batches) + 1;
  end when;
end Batch;
";

/// t, reading, and what 100,000 particles make of them in NumPy, in short steps, with an exact bounce in
/// each: mean and deviation of h and of the other state. A row in which more than one particle in a thousand has had
/// another event than the mean is left to the next ones.
type Row = (f64, f64, f64, f64, f64, f64);

const OF_BALL: [Row; 25] = [
    (0.00, 1.0473, 1.0376, 0.0446, 0.0002, 0.3993),
    (0.05, 1.0194, 1.0224, 0.0349, -0.4998, 0.3841),
    (0.10, 1.0374, 1.0084, 0.0334, -0.8564, 0.3447),
    (0.15, 0.9427, 0.9485, 0.0336, -1.3754, 0.2938),
    (0.20, 0.9311, 0.8960, 0.0334, -1.7100, 0.2446),
    (0.25, 0.7497, 0.7773, 0.0329, -2.3022, 0.2051),
    (0.30, 0.5794, 0.6212, 0.0317, -2.9163, 0.1730),
    (0.35, 0.4377, 0.4534, 0.0306, -3.4447, 0.1496),
    (0.40, 0.2580, 0.2649, 0.0297, -3.9493, 0.1325),
    (0.45, 0.1244, 0.0, 0.0, 0.0, 0.0),
    (0.50, 0.0516, 0.1015, 0.0214, 3.3303, 0.0743),
    (0.55, 0.2608, 0.2565, 0.0185, 2.8389, 0.0805),
    (0.60, 0.3502, 0.3820, 0.0168, 2.3486, 0.0864),
    (0.65, 0.3737, 0.4753, 0.0161, 1.8448, 0.0920),
    (0.70, 0.5709, 0.5569, 0.0166, 1.3581, 0.0964),
    (0.75, 0.6607, 0.6187, 0.0179, 0.8870, 0.0991),
    (0.80, 0.7030, 0.6587, 0.0194, 0.4235, 0.1002),
    (0.85, 0.7227, 0.6772, 0.0209, -0.0343, 0.0998),
    (0.90, 0.6438, 0.6594, 0.0222, -0.5372, 0.0985),
    (0.95, 0.6256, 0.6214, 0.0230, -1.0243, 0.0962),
    (1.00, 0.6031, 0.5681, 0.0236, -1.4846, 0.0938),
    (1.05, 0.4932, 0.4843, 0.0239, -1.9675, 0.0917),
    (1.10, 0.3947, 0.3786, 0.0241, -2.4443, 0.0900),
    (1.15, 0.2445, 0.2442, 0.0242, -2.9344, 0.0885),
    (1.20, 0.0222, 0.0, 0.0, 0.0, 0.0),
];

const OF_BATCH: [Row; 17] = [
    (0.00, 0.702, 0.6905, 0.0485, 0.9995, 0.1983),
    (0.25, 0.779, 0.8219, 0.0405, 0.8344, 0.1626),
    (0.50, 1.021, 1.0081, 0.0403, 0.8803, 0.1157),
    (0.75, 1.173, 1.1727, 0.0391, 0.8789, 0.0836),
    (1.00, 1.380, 1.3577, 0.0372, 0.9162, 0.0630),
    (1.25, 1.647, 1.5798, 0.0349, 0.9884, 0.0494),
    (1.50, 1.788, 1.7632, 0.0331, 1.0069, 0.0404),
    (1.75, 2.029, 0.0, 0.0, 0.0, 0.0),
    (2.00, 0.478, 0.0, 0.0, 0.0, 0.0),
    (2.25, 0.671, 0.6604, 0.0245, 1.0594, 0.0215),
    (2.50, 0.924, 0.8962, 0.0236, 1.0642, 0.0199),
    (2.75, 1.184, 1.1286, 0.0233, 1.0723, 0.0185),
    (3.00, 1.248, 1.3153, 0.0242, 1.0631, 0.0177),
    (3.25, 1.516, 1.5120, 0.0242, 1.0637, 0.0167),
    (3.50, 1.636, 1.6833, 0.0243, 1.0578, 0.0159),
    (3.75, 1.860, 1.8595, 0.0241, 1.0579, 0.0151),
    (4.00, 0.209, 0.0, 0.0, 0.0, 0.0),
];

const OF_THERMOSTAT: [Row; 45] = [
    (0.00, 17.959, 17.9702, 0.2568, 8.0027, 0.8034),
    (0.10, 18.377, 18.4243, 0.1968, 7.9690, 0.7913),
    (0.20, 18.775, 18.8480, 0.1795, 7.8905, 0.7517),
    (0.30, 19.175, 19.2454, 0.1773, 7.7990, 0.6897),
    (0.40, 20.041, 19.7895, 0.1781, 8.1293, 0.6166),
    (0.50, 20.212, 20.2059, 0.1773, 8.1369, 0.5451),
    (0.60, 20.243, 0.0, 0.0, 0.0, 0.0),
    (0.70, 20.305, 0.0, 0.0, 0.0, 0.0),
    (0.80, 20.744, 0.0, 0.0, 0.0, 0.0),
    (0.90, 20.252, 0.0, 0.0, 0.0, 0.0),
    (1.00, 19.969, 19.9920, 0.1682, 7.8451, 0.3799),
    (1.10, 19.371, 19.5494, 0.1435, 7.9142, 0.3774),
    (1.20, 19.116, 0.0, 0.0, 0.0, 0.0),
    (1.30, 19.363, 0.0, 0.0, 0.0, 0.0),
    (1.40, 19.150, 19.5305, 0.1555, 7.7778, 0.3509),
    (1.50, 20.300, 20.0156, 0.1481, 7.8976, 0.3435),
    (1.60, 20.386, 20.3926, 0.1463, 7.8921, 0.3303),
    (1.70, 20.639, 0.0, 0.0, 0.0, 0.0),
    (1.80, 21.074, 0.0, 0.0, 0.0, 0.0),
    (1.90, 19.986, 20.3946, 0.1464, 7.9610, 0.2956),
    (2.00, 19.546, 19.9016, 0.1323, 8.0457, 0.3029),
    (2.10, 20.116, 19.6135, 0.1200, 7.9525, 0.3008),
    (2.20, 18.735, 0.0, 0.0, 0.0, 0.0),
    (2.30, 19.146, 0.0, 0.0, 0.0, 0.0),
    (2.40, 19.540, 19.6096, 0.1341, 7.9740, 0.3106),
    (2.50, 19.997, 20.0122, 0.1340, 7.9679, 0.3076),
    (2.60, 20.278, 20.3739, 0.1351, 7.9354, 0.3020),
    (2.70, 21.120, 0.0, 0.0, 0.0, 0.0),
    (2.80, 21.091, 0.0, 0.0, 0.0, 0.0),
    (2.90, 19.865, 20.3207, 0.1324, 8.0887, 0.2840),
    (3.00, 20.748, 20.0573, 0.1268, 7.9529, 0.2862),
    (3.10, 19.564, 19.6484, 0.1171, 7.9680, 0.2919),
    (3.20, 19.272, 0.0, 0.0, 0.0, 0.0),
    (3.30, 18.799, 0.0, 0.0, 0.0, 0.0),
    (3.40, 19.656, 19.5119, 0.1231, 7.9655, 0.3044),
    (3.50, 19.618, 19.8686, 0.1238, 7.8992, 0.3035),
    (3.60, 20.739, 20.3446, 0.1308, 8.0192, 0.3018),
    (3.70, 21.029, 0.0, 0.0, 0.0, 0.0),
    (3.80, 20.560, 0.0, 0.0, 0.0, 0.0),
    (3.90, 20.274, 20.3341, 0.1447, 8.1898, 0.2931),
    (4.00, 19.703, 19.8844, 0.1231, 8.2333, 0.2912),
    (4.10, 19.705, 19.5294, 0.1168, 8.2080, 0.2966),
    (4.20, 19.008, 0.0, 0.0, 0.0, 0.0),
    (4.30, 19.096, 0.0, 0.0, 0.0, 0.0),
    (4.40, 19.699, 19.6820, 0.1350, 8.1984, 0.3057),
];

fn folder(plant: &str, rest: &str, rows: &[Row]) -> Folder {
    let folder = Folder::empty();
    folder.write("plant.mo", plant);
    let study = format!(
        "plant = \"plant.mo\"\n[sensors]\nnoise = {{ y = 0.05 }}\n[observer]\nfamily = \"ekf\"\n{rest}"
    );
    folder.write("study.toml", &study);
    let rows = rows.iter().map(|row| format!("{},{}\n", row.0, row.1));
    folder.write("log.csv", &("t,y\n".to_owned() + &rows.collect::<String>()));
    folder
}

fn ball(rest: &str) -> Folder {
    let estimate = "initial_variance = { h = 0.01, v = 0.16 }\n[process_noise]\nv = 0.02\n[estimate]\nsd = true\n";
    folder(BALL, &format!("{estimate}{rest}"), &OF_BALL)
}

fn column(table: &str, header: &str) -> Vec<f64> {
    let mut rows = table.lines();
    let place = rows.next().unwrap().split(',').position(|h| h == header);
    let place = place.unwrap_or_else(|| panic!("no {header} in {table:.200}"));
    rows.map(|row| row.split(',').nth(place).unwrap().parse().unwrap())
        .collect()
}

fn estimate(folder: &Folder) -> String {
    let ended = folder.run(&["estimate", "study.toml", "log.csv", "-o", "out.csv", "-q"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    folder.read("out.csv")
}

/// How far means are apart in deviations, and how deviations differ, at most.
fn apart(table: &str, rows: &[Row], [one, other]: [&str; 2]) -> [f64; 2] {
    let of = |name: &str| ["hat", "sd"].map(|part| column(table, &format!("{name}_{part}")));
    let ([h, h_sd], [x, x_sd]) = (of(one), of(other));
    let (mut means, mut deviations) = (0.0_f64, 0.0_f64);
    for (k, row) in rows.iter().enumerate().filter(|(_, row)| row.3 > 0.0) {
        for (own, sd, mean, deviation) in
            [(h[k], h_sd[k], row.2, row.3), (x[k], x_sd[k], row.4, row.5)]
        {
            means = means.max((own - mean).abs() / deviation);
            deviations = deviations.max((sd / deviation - 1.0).abs());
        }
    }
    [means, deviations]
}

#[test]
fn a_bouncing_ball_is_estimated_as_by_particles() {
    let folder = ball("");
    for family in ["ekf", "ukf"] {
        folder.change("study.toml", "\"ekf\"", &format!("\"{family}\""));
        let table = estimate(&folder);
        let [means, deviations] = apart(&table, &OF_BALL, ["h", "v"]);
        assert!(means < 0.06 && deviations < 0.04, "{means} {deviations}");
        let n = column(&table, "n_hat");
        assert!(n[..=9].iter().all(|n| *n == 0.0) && n[10..].iter().all(|n| *n == 1.0));
        assert!(column(&table, "n_sd").iter().all(|sd| *sd == 0.0));
    }
}

#[test]
fn a_vessel_that_is_emptied_is_estimated_as_by_particles() {
    let rest = "initial_variance = { h = 0.04, feed = 0.04 }\n[process_noise]\nh = 0.0004\n[estimate]\nsd = true\n";
    let folder = folder(BATCH, rest, &OF_BATCH);
    let table = estimate(&folder);
    let [means, deviations] = apart(&table, &OF_BATCH, ["h", "feed"]);
    let before: Vec<Row> = OF_BATCH[..7].to_vec();
    let [exact, alike] = apart(&table, &before, ["h", "feed"]);
    assert!(exact < 0.06 && alike < 0.03, "{exact} {alike}");
    // that it is not emptied yet tells particles what no linear correction says
    assert!(means < 0.7 && deviations < 0.35, "{means} {deviations}");
    assert_eq!(column(&table, "batches_hat").last(), Some(&2.0));
}

/// Eight switchings: that a threshold was not met yet tells particles what no linear correction says.
#[test]
fn a_thermostat_is_estimated_as_by_particles() {
    let rest = "initial_variance = { T = 0.25, heat = 0.64 }\n[process_noise]\nT = 0.02\nheat = 0.05\n[estimate]\nsd = true\n";
    let folder = folder(THERMOSTAT, rest, &OF_THERMOSTAT);
    folder.change("study.toml", "y = 0.05", "y = 0.3");
    for family in ["ekf", "ukf"] {
        folder.change("study.toml", "\"ekf\"", &format!("\"{family}\""));
        let table = estimate(&folder);
        let [means, deviations] = apart(&table, &OF_THERMOSTAT, ["T", "heat"]);
        let before = &OF_THERMOSTAT[..6];
        let [exact, alike] = apart(&table, before, ["T", "heat"]);
        assert!(exact < 0.03 && alike < 0.03, "{family}: {exact} {alike}");
        assert!(
            means < 0.5 && deviations < 0.2,
            "{family}: {means} {deviations}"
        );
    }
}

/// What a Gaussian filter loses is what readings say of whether the heater has switched: without those that come while
/// that is open, it goes through the first switching as particles do. The jump of the covariance is not what it lacks.
#[test]
fn a_thermostat_is_lost_sight_of_by_readings_beside_its_switching() {
    let rest = "initial_variance = { T = 0.25, heat = 0.64 }\n[process_noise]\nT = 0.02\nheat = 0.05\n[estimate]\nsd = true\n";
    let rows = &OF_THERMOSTAT[..10];
    let folder = folder(THERMOSTAT, rest, rows);
    folder.change("study.toml", "y = 0.05", "y = 0.3");
    let open = [6, 7, 8, 9];
    let heat = |is_told: bool| {
        let row = |(k, row): (usize, &Row)| match !is_told && open.contains(&k) {
            true => format!("{},\n", row.0),
            false => format!("{},{}\n", row.0, row.1),
        };
        let rows: String = rows.iter().enumerate().map(row).collect();
        folder.write("log.csv", &format!("t,y\n{rows}"));
        let of = |drawn: &str| {
            folder.change("study.toml", "family = \"ekf\"", drawn);
            let table = estimate(&folder);
            folder.change("study.toml", drawn, "family = \"ekf\"");
            ["heat_hat", "heat_sd"].map(|name| *column(&table, name).last().unwrap())
        };
        let [own, own_sd] = of("family = \"ekf\"");
        let [mean, deviation] = of("family = \"particle\"\nparticles = 20000");
        [(own - mean) / deviation, own_sd / deviation - 1.0]
    };
    let [mean, deviation] = heat(false);
    assert!(
        mean.abs() < 0.03 && deviation.abs() < 0.03,
        "{mean} {deviation}"
    );
    let [mean, deviation] = heat(true);
    assert!(mean < -0.3 && deviation < -0.15, "{mean} {deviation}");
}

/// Particles of this program are those of the other one, whatever the event.
#[test]
fn particles_go_through_events_each_by_itself() {
    let rest = "initial_variance = { h = 0.04, feed = 0.04 }\n[process_noise]\nh = 0.0004\n[estimate]\nsd = true\n";
    let vessel = folder(BATCH, rest, &OF_BATCH);
    let cases: [(Folder, &[Row], &str); 2] =
        [(ball(""), &OF_BALL, "v"), (vessel, &OF_BATCH, "feed")];
    for (folder, rows, other) in cases {
        let drawn = "family = \"particle\"\nparticles = 20000";
        folder.change("study.toml", "family = \"ekf\"", drawn);
        let [means, deviations] = apart(&estimate(&folder), rows, ["h", other]);
        // a constant feed has fewer and fewer values among either's particles
        assert!(
            means < 0.1 && deviations < 0.1,
            "{other}: {means} {deviations}"
        );
    }
}

/// The smoother at the first row knows the start from all readings: nearer, and surer, than the filter.
#[test]
fn the_smoother_goes_back_through_a_bounce() {
    let table = estimate(&ball("smooth = true\n"));
    let [filtered, smoothed] = ["v_sd", "v_smooth_sd"].map(|name| column(&table, name));
    assert!(
        filtered[0] > 0.39 && smoothed[0] < 0.15,
        "{} {}",
        filtered[0],
        smoothed[0]
    );
    let start = column(&table, "v_smooth")[0];
    // the log was made from 0.2
    assert!((start - 0.2).abs() < 3.0 * smoothed[0], "{start}");
}

fn refused(folder: &Folder, arguments: &[&str], told: &str) {
    let Ended { code, err, .. } = folder.run(arguments);
    assert!(
        code != 0 && err.contains(told),
        "{arguments:?}: {code} {err}"
    );
}

#[test]
fn what_does_not_follow_events_says_so_with_the_line() {
    let line = "the state of 'Ball' jumps at events (`when` of line 9)";
    let folder = ball("");
    let observer = [
        "export",
        "study.toml",
        "--system",
        "observer",
        "--to",
        "fmu",
    ];
    refused(&folder, &[&observer[..], &["-o", "out"]].concat(), line);
    folder.change("study.toml", "\"ekf\"", "\"mhe\"");
    let told = format!("family = \"mhe\": {line}");
    refused(&folder, &["estimate", "study.toml", "log.csv"], &told);
    folder.change(
        "study.toml",
        "\"mhe\"",
        "\"particle\"\nproposal = \"ensemble\"",
    );
    let told = "proposal = \"ensemble\": the state of 'Ball' jumps at events (`when` of line 9)";
    refused(&folder, &["estimate", "study.toml", "log.csv"], told);
    folder.change(
        "study.toml",
        "\"particle\"\nproposal = \"ensemble\"",
        "\"ekf\"",
    );
    let ended = folder.run(&["compare", "study.toml", "log.csv", "--json"]);
    let rows = &ended.json()["families"];
    let families: Vec<&str> = rows
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|r| r["family"].as_str())
        .collect();
    assert_eq!(families, ["ekf", "ukf"], "{}", ended.err);
    let ended = folder.run(&["certify", "study.toml"]);
    assert!(
        ended
            .out
            .contains("the state jumps at events (`when` of line 9)"),
        "{}",
        ended.out
    );
}

/// The bounces add up to t = 4.06; a run that goes on has no solution.
#[test]
fn a_zeno_point_ends_the_run_with_the_line_and_the_time() {
    for method in ["adaptive", "rk4"] {
        let simulate =
            format!("[simulate]\nuntil = 6\noutput_step = 0.25\nmethod = \"{method}\"\n");
        let folder = ball(&simulate);
        let Ended { code, err, .. } =
            folder.run(&["simulate", "study.toml", "-q", "-o", "out.csv"]);
        let told = "study.toml: the `when` of line 9 does not come to an end at t = 4.";
        assert!(code == 2 && err.contains(told), "{code} {err}");
    }
}

/// An open run has the plant's own events.
#[test]
fn an_open_run_bounces() {
    let folder = ball("");
    let arguments = [
        "simulate",
        "study.toml",
        "--inputs",
        "log.csv",
        "-q",
        "-o",
        "out.csv",
    ];
    let ended = folder.run(&arguments);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let table = folder.read("out.csv");
    let last = |name: &str| *column(&table, name).last().unwrap();
    // from h = 1 at rest: bounces at √(2/g) and, with 0.8 of the speed √(2g), 1.6 times as much later
    let first = (2.0_f64 / 9.81).sqrt();
    let since = 1.2 - first - 1.6 * first;
    let height = since * (0.64 * 9.81 * first - 0.5 * 9.81 * since);
    let found = last("h");
    assert!((found - height).abs() < 1e-6 && last("n") == 2.0, "{found}");
}
