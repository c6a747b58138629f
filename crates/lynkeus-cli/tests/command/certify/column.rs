//! The distillation column with `gain = "lmi"`: the certificate against trajectories.

use lynkeus::Study;
use lynkeus::expr::Node;
use lynkeus::model::Plant;
use lynkeus::observers::{Certificate, Design};
use lynkeus::prepare::{self, Prepared};
use lynkeus::run::{Role, Simulation, System};
use lynkeus::structure::Standing;

use super::column;

const RATE: f64 = 0.1;
const PAIRS: usize = 200;
/// Minutes: three time constants of the certified decay.
const UNTIL: f64 = 30.0;
const ROWS: f64 = 0.25;
/// What the integration may add to V from row to row, relative; its tolerance is 1e-9.
const INTEGRATION: f64 = 1e-6;

/// Numbers in [0, 1), the same in every run (SplitMix64).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, (low, high): (f64, f64)) -> f64 {
        low + self.next() * (high - low)
    }

    fn many(&mut self, count: usize) -> Vec<f64> {
        (0..count).map(|_| self.next()).collect()
    }
}

fn side(certificate: &Certificate, name: &str) -> (f64, f64) {
    let mut sides = certificate.region.iter();
    let found = sides.find(|s| s.name == name).unwrap();
    (found.min, found.max)
}

/// Plant and observer from their starts under constant inputs; rows of the plant's
/// augmented state and of the estimate.
fn pairs(
    plant: &Plant,
    design: &Design,
    x: &[f64],
    estimate: &[f64],
    [L, V]: [f64; 2],
) -> Vec<(Vec<f64>, Vec<f64>)> {
    let (zf, trays) = x.split_last().unwrap();
    let graph = &plant.graph;
    let states = plant.states.iter().zip(trays);
    let states: Vec<(String, Node, f64)> =
        states.map(|(s, x)| (s.name.clone(), s.node, *x)).collect();
    let named = |v: &lynkeus::model::Variable| (v.name.clone(), v.node);
    let inputs: Vec<(String, Node)> = plant.inputs.iter().map(named).collect();
    let outputs: Vec<(String, Node)> = plant.outputs.iter().map(named).collect();
    let derivatives = &plant.derivatives;
    let system = System::new(graph, plant.time, &states, &inputs, derivatives, &outputs).unwrap();
    let values = [("L", L), ("V", V), ("Zf", *zf)];
    let values = values.map(|(name, value)| (name.to_owned(), graph.constant(value).node()));
    let constant = System::new(graph, plant.time, &[], &[], &[], &values).unwrap();
    let observer = lynkeus::observer_system(plant, &design.observer).unwrap();
    let mut simulation = Simulation::new(system, constant, UNTIL, ROWS);
    simulation.observer = Some(observer.with_start(estimate.to_vec()).unwrap());
    let table = simulation.run().unwrap();
    // the augmented state, in the order of the estimates
    let states = (0..plant.states.len()).map(|i| Role::State.at(i));
    let zf = plant.inputs.iter().position(|i| i.name == "Zf").unwrap();
    let augmented = states.chain([Role::Input.at(zf)]).enumerate();
    let columns: Vec<(&[f64], &[f64])> = augmented
        .map(|(i, column)| {
            let estimate = table.column(Role::Estimate.at(i)).unwrap();
            (table.column(column).unwrap(), estimate)
        })
        .collect();
    let row = |k: usize| columns.iter().map(|(x, hat)| (x[k], hat[k])).unzip();
    (0..table.len()).map(row).collect()
}

/// V = eᵀPe of a row; none outside the box, where nothing is promised.
fn lyapunov(certificate: &Certificate, (x, estimate): &(Vec<f64>, Vec<f64>)) -> Option<f64> {
    let P = certificate.lyapunov.as_ref().unwrap();
    if !x.iter().chain(estimate).all(|x| (0.0..=1.0).contains(x)) {
        return None;
    }
    let e: Vec<f64> = estimate.iter().zip(x).map(|(a, b)| a - b).collect();
    let n = e.len();
    let terms = (0..n * n).map(|k| e[k / n] * P[(k / n, k % n)] * e[k % n]);
    Some(terms.sum())
}

/// The certificate holds on the whole declared box, without narrowed inputs; from
/// random starts in it V decays from row to row at least as promised.
#[test]
fn the_certified_decay_is_seen_from_random_starts() {
    let folder = column();
    folder.write(
        "lmi.toml",
        &format!(
            "plant = \"column.mo\"\n[sensors]\nunknown = [\"Zf\"]\n[observer]\nfamily = \"triangular\"\ngain = \"lmi\"\nrate = {RATE}\n"
        ),
    );
    let study = Study::load(folder.path.path().join("lmi.toml")).unwrap();
    let report = lynkeus::design(&study).unwrap().certified;
    let certificate = &report.certificate;
    assert_eq!(certificate.verdict(), Standing::Proved);
    let rate = certificate.rate.unwrap();
    assert!(rate >= RATE, "{rate}");
    assert_eq!(side(certificate, "L"), (3.0, 6.0));
    assert_eq!(side(certificate, "V"), (4.0, 8.0));
    assert_eq!(side(certificate, "x[7]"), (0.0, 1.0));
    // the same gain over a graph of our own
    let plant = prepare::plant(&study).unwrap();
    let design = Prepared::new(&study, &plant).unwrap().design().unwrap();
    assert_eq!(design.gains, report.design.gains);
    let mut numbers = Numbers(13);
    let (mut compared, mut informative) = (0, 0);
    for pair in 0..PAIRS {
        let n = certificate.lyapunov.as_ref().unwrap().nrows();
        let (x, estimate) = (numbers.many(n), numbers.many(n));
        let inputs = ["L", "V"].map(|name| numbers.between(side(certificate, name)));
        let rows = pairs(&plant, &design, &x, &estimate, inputs);
        let values: Vec<Option<f64>> = rows.iter().map(|row| lyapunov(certificate, row)).collect();
        let mut within = 0;
        for (k, values) in values.windows(2).enumerate() {
            let [Some(before), Some(after)] = *values else {
                continue;
            };
            let allowed = before * (-2.0 * rate * ROWS).exp() * (1.0 + INTEGRATION);
            assert!(
                after <= allowed,
                "pair {pair} at t = {}: V from {before} to {after}, allowed {allowed}; x = {x:?}, estimate = {estimate:?}, inputs {inputs:?}",
                k as f64 * ROWS,
            );
            within += 1;
        }
        compared += within;
        informative += usize::from(within as f64 * ROWS > 10.0);
    }
    assert!(
        informative > PAIRS / 2,
        "{informative} pairs, {compared} rows"
    );
}
