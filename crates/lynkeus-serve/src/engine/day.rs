//! The change of a day, with a kill anywhere around it: nothing is lost, nothing is there twice.

use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::record::Field;
use lynkeus::Study;
use lynkeus::table::Instant;

use super::*;

const SECOND: i128 = 1_000_000_000;
const DAY: i128 = 86_400 * SECOND;

/// How a service ends, after so many batches.
#[derive(Clone, Copy, Debug)]
enum Kill {
    /// what came last was answered
    Answered(usize),
    /// it was written down, and no more
    WrittenDown(usize),
    Never,
}

/// When it was sampled, its estimate to the bit, how many times it was told before.
type Told = (i128, u64, i64);

fn stream(folder: &Path) -> Arc<Stream> {
    let plant = "model Tank\n  Real x(start = 1);\n  output Real y = x;\nequation\n  der(x) = -0.1*x;\nend Tank;\n";
    std::fs::write(folder.join("tank.mo"), plant).unwrap();
    let study = "plant = \"tank.mo\"\nprocess_noise = { x = 0.1 }\n[sensors]\nnoise = { y = 0.1 }\n[observer]\nfamily = \"ekf\"\ninitial_variance = { default = 1 }\n[serve]\nwait = 5\n";
    std::fs::write(folder.join("study.toml"), study).unwrap();
    let study = Study::load(folder.join("study.toml")).unwrap();
    Arc::new(Stream::new(&study).unwrap())
}

/// Batches of rows around midnight, each with the time at which it came; one of the day before comes after it.
fn batches(midnight: i128) -> Vec<(i128, Vec<Arrival>)> {
    let row = |tenths: i128| Arrival {
        asset: 0,
        stamp: Stamp::Date(Instant::at(midnight + tenths * SECOND / 10, true)),
        values: vec![1.0 + 0.01 * tenths as f64],
    };
    let alone = [-20, -10, 0, 10, -25, 20];
    let came = [-18, -8, 2, 12, 13, 22];
    let alone = alone
        .iter()
        .zip(came)
        .map(|(t, came)| (came, vec![row(*t)]));
    let mut all = vec![(-28, (-8..-2).map(|k| row(10 * k)).collect())];
    all.extend(alone);
    all.push((90, (3..9).map(|k| row(10 * k)).collect()));
    let at = |(came, rows)| (midnight + came * SECOND / 10, rows);
    all.into_iter().map(at).collect()
}

fn begun(folder: &Path, stream: &Arc<Stream>, ending: &str) -> Engine {
    let mut engine = Engine::new(vec![(String::new(), Arc::clone(stream))]);
    engine.write_history(&folder.join(format!("h-%Y-%m-%d.{ending}")), Some(30));
    engine.keep(&folder.join("tank.state")).unwrap();
    engine
}

/// Ends without a word; threads would go on in this program, and not after a kill.
fn killed(mut engine: Engine) {
    if let Some(state) = engine.state.take() {
        state.kill();
    }
    if let Some(history) = &mut engine.history {
        history.kill();
    }
}

/// Everything in the files of the history, by file.
fn history(folder: &Path) -> Vec<(String, Vec<Told>)> {
    let names = std::fs::read_dir(folder).unwrap();
    let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.filter(|name| name.starts_with("h-")).collect();
    names.sort();
    let told = |name: String| {
        let path = folder.join(&name);
        let lines = match name.ends_with(".parquet") {
            true => SerializedFileReader::new(std::fs::File::open(path).unwrap())
                .unwrap()
                .get_row_iter(None)
                .unwrap()
                .map(|row| {
                    let fields: Vec<Field> = row
                        .unwrap()
                        .into_columns()
                        .into_iter()
                        .map(|f| f.1)
                        .collect();
                    let [Field::Long(t), Field::Double(x), .., Field::Long(revision)] = &fields[..]
                    else {
                        panic!("{fields:?}");
                    };
                    (i128::from(*t), x.to_bits(), *revision)
                })
                .collect(),
            false => csv::Reader::from_path(path)
                .unwrap()
                .records()
                .map(|record| {
                    let record = record.unwrap();
                    let t = Instant::read(&record[0]).unwrap().nanoseconds();
                    let x: f64 = record[1].parse().unwrap();
                    (t, x.to_bits(), record[record.len() - 1].parse().unwrap())
                })
                .collect(),
        };
        (name, lines)
    };
    names.into_iter().map(told).collect()
}

/// What a service through midnight leaves: its history, and what it answered.
fn run(ending: &str, kill: Kill) -> (Vec<(String, Vec<Told>)>, Vec<Told>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let stream = stream(path);
    // the files of today are opened by today's name
    let midnight = (now().div_euclid(DAY) + 1) * DAY;
    let batches = batches(midnight);
    let mut engine = begun(path, &stream, ending);
    let mut answers = vec![];
    for (k, (came, rows)) in batches.iter().enumerate() {
        if matches!(kill, Kill::WrittenDown(at) if at == k) {
            engine.write_down(rows, *came).unwrap();
            killed(engine);
            engine = begun(path, &stream, ending);
        }
        // who had no answer sends again
        for answer in engine.take_at(rows, *came) {
            for line in answer.unwrap().iter().filter(|line| !line.is_repeated) {
                let Stamp::Date(t) = line.stamp else {
                    panic!("{line:?}")
                };
                answers.push((
                    t.nanoseconds(),
                    line.estimate[0].to_bits(),
                    line.revision as i64,
                ));
            }
        }
        if matches!(kill, Kill::Answered(at) if at == k) {
            killed(engine);
            engine = begun(path, &stream, ending);
        }
    }
    engine.close();
    // a day later both are over
    engine.take_at(&[], midnight);
    let day = (midnight + DAY).div_euclid(DAY);
    let mut left = engine.history.take().unwrap();
    engine.state.take().unwrap().kill();
    left.kill();
    left.is_over(day);
    left.kill();
    (history(path), answers)
}

#[test]
fn nothing_is_lost_or_twice_over_midnight() {
    for ending in ["csv", "parquet"] {
        let (expected, answers) = run(ending, Kill::Never);
        assert_eq!(expected.len(), 2, "{expected:?}");
        assert!(
            expected.iter().all(|(name, _)| name.ends_with(ending)),
            "{expected:?}"
        );
        let all: Vec<Told> = expected
            .iter()
            .flat_map(|(_, lines)| lines.clone())
            .collect();
        assert_eq!(all, answers);
        // six, two, then four alone with four corrections after the late one, then six
        assert_eq!(expected[0].1.len(), 8);
        assert_eq!(expected[1].1.len(), 4 + 4 + 6);
        assert_eq!(
            all.iter().filter(|(.., revision)| *revision == 1).count(),
            4
        );
        let late = all
            .iter()
            .filter(|(t, ..)| t.rem_euclid(DAY) == DAY - 25 * SECOND / 10);
        assert_eq!(late.count(), 1);
        for at in 0..8 {
            for kill in [Kill::Answered(at), Kill::WrittenDown(at)] {
                let (found, _) = run(ending, kill);
                assert_eq!(found, expected, "{ending} {kill:?}");
            }
        }
    }
}
