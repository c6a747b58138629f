//! Tubes contain what they say: random and corner starts, constants, and inputs that jump between
//! their ends, integrated to tight tolerance.

use std::ops::ControlFlow;

use lynkeus_expr::{Budget, Expr, Graph, Interval, Node, Tape};
use lynkeus_proof::tube::{End, Problem, Segment, reach};

/// Numbers in [0, 1), the same in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() * n as f64) as usize
    }

    /// Often an end, else something between.
    fn within(&mut self, range: Interval) -> f64 {
        match self.below(3) {
            0 => range.lo(),
            1 => range.hi(),
            _ => {
                (range.lo() + self.next() * (range.hi() - range.lo())).clamp(range.lo(), range.hi())
            }
        }
    }
}

/// A plant: x, t, constants and inputs as one list of symbols.
type Right = dyn for<'g> Fn(&'g Graph, &[Expr<'g>]) -> Vec<Expr<'g>>;

fn problem(
    right: &Right,
    start: &[(f64, f64)],
    constants: &[(f64, f64)],
    inputs: &[(f64, f64)],
) -> Problem {
    let g = Graph::new();
    let count = start.len() + 1 + constants.len() + inputs.len();
    let symbols: Vec<Expr<'_>> = (0..count).map(|i| g.symbol(&format!("v{i}"))).collect();
    let nodes = |of: &[Expr<'_>]| of.iter().map(|e| e.node()).collect::<Vec<Node>>();
    let ranges = |of: &[(f64, f64)]| {
        of.iter()
            .map(|&(a, b)| Interval::new(a, b).unwrap())
            .collect()
    };
    Problem {
        right: Tape::new(&g, &nodes(&symbols), &nodes(&right(&g, &symbols))).unwrap(),
        from: 0.0,
        start: ranges(start),
        constants: ranges(constants),
        inputs: ranges(inputs),
    }
}

/// What is kept of a segment.
struct Kept {
    from: f64,
    to: f64,
    range: Vec<Interval>,
    end: Vec<Interval>,
    /// where the solutions from some points end, of which there are as many as runs
    from_point: Vec<Vec<Interval>>,
}

/// A start, constants, and the symbols that stand for them.
struct Run {
    x: Vec<f64>,
    constants: Vec<f64>,
    symbols: Vec<f64>,
}

fn run(problem: &Problem, random: &mut Random) -> Run {
    let x: Vec<f64> = problem.start.iter().map(|&r| random.within(r)).collect();
    let constants: Vec<f64> = problem
        .constants
        .iter()
        .map(|&r| random.within(r))
        .collect();
    let ranges = problem.start.iter().chain(&problem.constants);
    let values = ranges.zip(x.iter().chain(&constants));
    let symbol = |(range, value): (&Interval, &f64)| {
        let radius = 0.5 * (range.hi() - range.lo());
        (radius > 0.0).then(|| ((value - range.midpoint()) / radius).clamp(-1.0, 1.0))
    };
    let symbols = values.filter_map(symbol).collect();
    Run {
        x,
        constants,
        symbols,
    }
}

/// Steps of Runge and Kutta per segment.
const STEPS: usize = 40;

/// How far a run may be off for reasons of its own.
const SLACK: f64 = 2e-9;

fn outside(x: &[f64], ranges: &[Interval]) -> Option<String> {
    let off = |(x, range): (&f64, &Interval)| {
        let slack = SLACK * (1.0 + x.abs());
        *x < range.lo() - slack || *x > range.hi() + slack || !range.is_bounded()
    };
    let all = x.iter().zip(ranges);
    all.clone()
        .any(off)
        .then(|| format!("{x:?} is not in {ranges:?}"))
}

/// Attacks a tube; how far it came and how wide it is there.
fn attack(name: &str, problem: &Problem, until: f64, runs: usize) -> (End, f64, Vec<Interval>) {
    let mut random = Random(name.len() as u64 + 7);
    let runs: Vec<Run> = (0..runs).map(|_| run(problem, &mut random)).collect();
    let mut tube: Vec<Kept> = vec![];
    let (end, time) = reach(
        problem,
        until,
        &Budget::default(),
        &mut |segment: &Segment| {
            tube.push(Kept {
                from: segment.from(),
                to: segment.to(),
                range: segment.range(),
                end: segment.end(),
                from_point: runs
                    .iter()
                    .map(|run| segment.end_from(&run.symbols))
                    .collect(),
            });
            match tube.len() < 3000 {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(()),
            }
        },
    );
    let mut right = problem.right.evaluator();
    for (number, run) in runs.iter().enumerate() {
        let mut x = run.x.clone();
        let hold = 1 + random.below(60);
        let mut u: Vec<f64> = problem.inputs.iter().map(|&r| random.within(r)).collect();
        let mut count = 0;
        for kept in &tube {
            let h = (kept.to - kept.from) / STEPS as f64;
            for step in 0..STEPS {
                let t = kept.from + step as f64 * h;
                count += 1;
                if count % hold == 0 {
                    u = problem.inputs.iter().map(|&r| random.within(r)).collect();
                }
                let mut f = |t: f64, x: &[f64]| {
                    let arguments = [x, &[t], &run.constants, &u].concat();
                    let mut out = vec![0.0; x.len()];
                    right.eval(&arguments, &mut out);
                    out
                };
                let along = |x: &[f64], k: &[f64], h: f64| -> Vec<f64> {
                    x.iter().zip(k).map(|(x, k)| x + h * k).collect()
                };
                let a = f(t, &x);
                let b = f(t + 0.5 * h, &along(&x, &a, 0.5 * h));
                let c = f(t + 0.5 * h, &along(&x, &b, 0.5 * h));
                let d = f(t + h, &along(&x, &c, h));
                for (i, x) in x.iter_mut().enumerate() {
                    *x += h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]);
                }
                if let Some(why) = outside(&x, &kept.range) {
                    panic!("{name}, run {number}, at {}: {why}", t + h);
                }
            }
            if let Some(why) = outside(&x, &kept.end) {
                panic!("{name}, run {number}, at the end {}: {why}", kept.to);
            }
            if let Some(why) = outside(&x, &kept.from_point[number]) {
                panic!(
                    "{name}, run {number}, from its own start, at {}: {why}",
                    kept.to
                );
            }
        }
    }
    (
        end,
        time,
        tube.pop().map(|kept| kept.end).unwrap_or_default(),
    )
}

fn widths(ranges: &[Interval]) -> Vec<f64> {
    ranges.iter().map(|r| r.width()).collect()
}

#[test]
fn van_der_pol() {
    let right: &Right = &|_, x| vec![x[1], (1.0 - x[0] * x[0]) * x[1] - x[0]];
    let problem = problem(right, &[(1.25, 1.55), (2.35, 2.45)], &[], &[]);
    let (end, time, last) = attack("van der Pol", &problem, 7.0, 60);
    assert_eq!((end, time), (End::Reached, 7.0));
    let found = widths(&last);
    assert!(found[0] < 0.14 && found[1] < 0.55, "{found:?}");
}

#[test]
fn laub_loomis() {
    let right: &Right = &|_, x| {
        vec![
            1.4 * x[2] - 0.9 * x[0],
            2.5 * x[4] - 1.5 * x[1],
            0.6 * x[6] - 0.8 * x[1] * x[2],
            2.0 - 1.3 * x[2] * x[3],
            0.7 * x[0] - x[3] * x[4],
            0.3 * x[0] - 3.1 * x[5],
            1.8 * x[5] - 1.5 * x[6] * x[1],
        ]
    };
    let middle = [1.2, 1.05, 1.5, 2.4, 1.0, 0.1, 0.45];
    let start = middle.map(|x| (x - 0.05, x + 0.05));
    let (end, _, last) = attack("Laub-Loomis", &problem(right, &start, &[], &[]), 20.0, 20);
    assert_eq!(end, End::Reached);
    assert!(last[3].width() < 0.016, "{last:?}");
}

#[test]
fn lotka_volterra() {
    let right: &Right = &|_, x| {
        let eaten = x[0] * x[1];
        vec![3.0 * x[0] - 3.0 * eaten, eaten - x[1]]
    };
    let problem = problem(right, &[(1.292, 1.308), (1.0, 1.0)], &[], &[]);
    let (end, _, last) = attack("Lotka-Volterra", &problem, 3.64, 60);
    assert_eq!(end, End::Reached);
    assert!(
        last[0].width() < 0.017 && last[1].width() < 6e-4,
        "{last:?}"
    );
}

#[test]
fn robertson() {
    let right: &Right = &|_, x| {
        let [a, b, c] = [0.4 * x[0], 1e2 * x[1] * x[2], 1e3 * x[1] * x[1]];
        vec![b - a, a - b - c, c]
    };
    let problem = problem(right, &[(1.0, 1.0), (0.0, 0.0), (0.0, 0.0)], &[], &[]);
    let (end, _, last) = attack("Robertson", &problem, 10.0, 2);
    assert_eq!(end, End::Reached);
    // mass is conserved
    let total = last.iter().fold(Interval::ZERO, |sum, x| sum + *x);
    assert!(total.contains(1.0) && total.width() < 1e-9, "{total}");
}

/// An input that jumps, a constant nobody knows, and time itself.
#[test]
fn inputs_and_constants() {
    let right: &Right = &|_, v| {
        let [angle, speed, time, friction, torque] = [v[0], v[1], v[2], v[3], v[4]];
        vec![
            speed,
            torque + 0.3 * time.cos() - angle.sin() - friction * speed,
        ]
    };
    let problem = problem(
        right,
        &[(0.4, 0.5), (0.0, 0.0)],
        &[(0.2, 0.4)],
        &[(-0.02, 0.03)],
    );
    let (end, _, last) = attack("pendulum", &problem, 8.0, 60);
    assert_eq!(end, End::Reached);
    assert!(last[0].width() < 0.7, "{last:?}");
}

/// A constant that is unknown is known to stay the same: x' = p·x with p in [−1, 1] reaches no further
/// than e, while an input that may turn back keeps to the same bounds, and x' = p − p is nothing.
#[test]
fn a_constant_is_the_same_for_all_times() {
    let right: &Right = &|_, v| vec![v[2] - v[2] * v[0] / v[0]];
    let still = problem(right, &[(1.0, 1.0)], &[(-1.0, 1.0)], &[]);
    let (_, _, last) = attack("constant", &still, 1.0, 10);
    assert!(last[0].width() < 1e-6, "{last:?}");
    let free = problem(right, &[(1.0, 1.0)], &[], &[(-1.0, 1.0)]);
    let (_, _, last) = attack("input", &free, 0.2, 10);
    assert!(last[0].width() > 0.1, "{last:?}");
}

#[test]
fn functions_that_are_no_polynomials() {
    let right: &Right = &|_, x| {
        vec![
            x[1] / (1.0 + x[0] * x[0]) - x[0].tanh(),
            0.3 - x[1].sqrt() + 0.1 * (x[0] * x[2]).sin() - 0.2 * (-x[0]).exp(),
            x[0].atan2(x[1]) - x[2] + x[1].ln() * x[1].pow(x[0].graph().constant(1.3)),
        ]
    };
    let problem = problem(right, &[(0.4, 0.5), (1.0, 1.1), (-0.1, 0.1)], &[], &[]);
    let (_, time, last) = attack("functions", &problem, 1.5, 40);
    assert!(time == 1.5 && last[0].width() < 0.3, "{time} {last:?}");
}

/// What bends or jumps is enclosed.
#[test]
fn what_bends() {
    let right: &Right = &|g, x| {
        let free = x[1].abs().max(g.constant(0.1));
        vec![x[1], -x[0] - 0.5 * x[1] * free + 0.1 * x[0].min(x[1])]
    };
    let bends = problem(right, &[(0.9, 1.0), (0.0, 0.1)], &[], &[]);
    let (end, _, last) = attack("bends", &bends, 3.0, 40);
    assert_eq!(end, End::Reached);
    assert!(last[0].width() < 0.5, "{last:?}");
}

/// Nothing is proved beyond a singularity, where a solution ends or has no value.
#[test]
fn where_solutions_end() {
    let blows_up: &Right = &|_, x| vec![x[0] * x[0]];
    let (end, time, _) = attack(
        "x' = x²",
        &problem(blows_up, &[(0.9, 1.0)], &[], &[]),
        2.0,
        0,
    );
    assert!(
        end == End::Stuck && time < 1.0 && time > 0.7,
        "{end:?} {time}"
    );
    let empties: &Right = &|_, x| vec![-x[0].sqrt()];
    let (end, time, _) = attack("tank", &problem(empties, &[(0.9, 1.0)], &[], &[]), 3.0, 20);
    assert!(
        end == End::Stuck && time < 1.9 && time > 1.0,
        "{end:?} {time}"
    );
    let singular: &Right = &|_, x| vec![1.0 / x[0]];
    let (end, time, _) = attack("1/x", &problem(singular, &[(-0.1, 0.1)], &[], &[]), 1.0, 0);
    assert_eq!((end, time), (End::Stuck, 0.0));
}

/// A random expression of some depth.
fn grown<'g>(random: &mut Random, v: &[Expr<'g>], depth: usize) -> Expr<'g> {
    let g = v[0].graph();
    if depth == 0 {
        return match random.below(4) {
            0 => g.constant((random.next() - 0.5) * 2.0),
            _ => v[random.below(v.len())],
        };
    }
    let a = grown(random, v, depth - 1);
    let b = |random: &mut Random| grown(random, v, depth - 1);
    match random.below(16) {
        0..=2 => a + b(random),
        3 => a - b(random),
        4..=6 => a * b(random),
        7 => a / (1.5 + b(random).sin()),
        8 => a.sin(),
        9 => a.tanh(),
        10 => (0.3 * a).exp(),
        11 => (1.2 + a * a).sqrt(),
        12 => (1.0 + a * a).ln(),
        13 => a.abs().min(b(random)),
        14 => a.powi(3) * 0.1,
        _ => a.atan(),
    }
}

#[test]
fn random_plants() {
    let mut proved = 0;
    for seed in 0..60 {
        let n = 1 + seed as usize % 3;
        let g = Graph::new();
        let symbols: Vec<Expr<'_>> = (0..n + 3).map(|i| g.symbol(&format!("v{i}"))).collect();
        let mut random = Random(seed * 7919 + 1);
        let right: Vec<Node> = (0..n)
            .map(|i| (grown(&mut random, &symbols, 3) - 0.5 * symbols[i]).node())
            .collect();
        let nodes: Vec<Node> = symbols.iter().map(|e| e.node()).collect();
        let mut range = |width: f64| {
            let middle = random.next() * 2.0 - 1.0;
            let radius = width * random.next();
            Interval::new(middle - radius, middle + radius).unwrap()
        };
        let problem = Problem {
            right: Tape::new(&g, &nodes, &right).unwrap(),
            from: 0.0,
            start: (0..n).map(|_| range(0.2)).collect(),
            constants: vec![range(0.2)],
            inputs: vec![range(0.1)],
        };
        let (end, ..) = attack(&format!("random plant {seed}"), &problem, 1.5, 12);
        proved += usize::from(end == End::Reached);
    }
    assert!(proved > 40, "{proved}");
}
