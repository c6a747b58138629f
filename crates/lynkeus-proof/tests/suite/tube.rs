//! Tubes contain what they say: random and corner starts, constants, and inputs that jump between
//! their ends, integrated to tight tolerance.

use std::ops::ControlFlow;

use lynkeus_expr::{Budget, Evaluator, Expr, Graph, Interval, Node, Tape};
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

/// How hard a tube is attacked.
struct Effort {
    runs: usize,
    /// of which so many are compared with where their own starts end as well
    sharp: usize,
    /// steps of Runge and Kutta per segment
    steps: usize,
    /// how far a run may be off for reasons of its own
    slack: f64,
}

/// One step of Runge and Kutta's method, without new memory.
struct Integrator<'p> {
    right: Evaluator,
    arguments: Vec<f64>,
    stages: [Vec<f64>; 4],
    problem: &'p Problem,
}

impl<'p> Integrator<'p> {
    fn new(problem: &'p Problem) -> Self {
        let n = problem.start.len();
        Self {
            right: problem.right.evaluator(),
            arguments: vec![0.0; problem.right.inputs()],
            stages: [(); 4].map(|()| vec![0.0; n]),
            problem,
        }
    }

    /// What is the same until it is set again: constants and inputs.
    fn set(&mut self, constants: &[f64], inputs: &[f64]) {
        let n = self.problem.start.len() + 1;
        self.arguments[n..n + constants.len()].copy_from_slice(constants);
        self.arguments[n + constants.len()..].copy_from_slice(inputs);
    }

    fn step(&mut self, t: f64, x: &mut [f64], h: f64) {
        let n = x.len();
        for (stage, share) in [0.0, 0.5, 0.5, 1.0].into_iter().enumerate() {
            for (i, x) in x.iter().enumerate() {
                let before = match stage {
                    0 => 0.0,
                    _ => self.stages[stage - 1][i],
                };
                self.arguments[i] = x + share * h * before;
            }
            self.arguments[n] = t + share * h;
            self.right.eval(&self.arguments, &mut self.stages[stage]);
        }
        let [a, b, c, d] = &self.stages;
        for (i, x) in x.iter_mut().enumerate() {
            *x += h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]);
        }
    }
}

fn outside(x: &[f64], ranges: &[Interval], slack: f64) -> bool {
    let off = |(x, range): (&f64, &Interval)| {
        let slack = slack * (1.0 + x.abs());
        // not written with ≤: a run that is no number is outside
        !(range.is_bounded() && *x >= range.lo() - slack && *x <= range.hi() + slack)
    };
    x.iter().zip(ranges).any(off)
}

/// Attacks a tube with so many runs; how it ended, when, and where it is there.
fn attack(name: &str, problem: &Problem, until: f64, runs: usize) -> (End, f64, Vec<Interval>) {
    let effort = Effort {
        runs,
        sharp: runs,
        steps: 40,
        slack: 2e-9,
    };
    attacked(name, problem, until, &effort)
}

fn attacked(
    name: &str,
    problem: &Problem,
    until: f64,
    effort: &Effort,
) -> (End, f64, Vec<Interval>) {
    let mut random = Random(name.len() as u64 + 7);
    let runs: Vec<Run> = (0..effort.runs)
        .map(|_| run(problem, &mut random))
        .collect();
    let mut tube: Vec<Kept> = vec![];
    let (end, time) = reach(
        problem,
        until,
        &Budget::default(),
        &mut |segment: &Segment| {
            let sharp = runs[..effort.sharp].iter();
            tube.push(Kept {
                from: segment.from(),
                to: segment.to(),
                range: segment.range(),
                end: segment.end(),
                from_point: sharp.map(|run| segment.end_from(&run.symbols)).collect(),
            });
            ControlFlow::Continue(())
        },
    );
    let mut integrator = Integrator::new(problem);
    for (number, run) in runs.iter().enumerate() {
        let mut x = run.x.clone();
        let hold = 1 + random.below(60);
        let mut count = 0;
        for kept in &tube {
            let h = (kept.to - kept.from) / effort.steps as f64;
            for step in 0..effort.steps {
                if count % hold == 0 {
                    let inputs = problem.inputs.iter();
                    let u: Vec<f64> = inputs.map(|&r| random.within(r)).collect();
                    integrator.set(&run.constants, &u);
                }
                count += 1;
                let t = kept.from + step as f64 * h;
                integrator.step(t, &mut x, h);
                let off = outside(&x, &kept.range, effort.slack);
                assert!(
                    !off,
                    "{name}, run {number}, at {}: {x:?} is not in {:?}",
                    t + h,
                    kept.range
                );
            }
            let ends = std::iter::once(&kept.end).chain(kept.from_point.get(number));
            for end in ends {
                let off = outside(&x, end, effort.slack);
                assert!(
                    !off,
                    "{name}, run {number}, at {}: {x:?} is not in {end:?}",
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

fn van_der_pol() -> Problem {
    let right: &Right = &|_, x| vec![x[1], (1.0 - x[0] * x[0]) * x[1] - x[0]];
    problem(right, &[(1.25, 1.55), (2.35, 2.45)], &[], &[])
}

/// Two of them, coupled by a spring.
fn coupled() -> Problem {
    let right: &Right = &|_, v| {
        let [x1, y1, x2, y2] = [v[0], v[1], v[2], v[3]];
        let slope = |x, y, other| (1.0 - x * x) * y - 2.0 * x + other;
        vec![y1, slope(x1, y1, x2), y2, slope(x2, y2, x1)]
    };
    let start = [(1.25, 1.55), (2.35, 2.45)].repeat(2);
    problem(right, &start, &[], &[])
}

fn laub_loomis(width: f64) -> Problem {
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
    problem(right, &middle.map(|x| (x - width, x + width)), &[], &[])
}

fn lotka_volterra() -> Problem {
    let right: &Right = &|_, x| {
        let eaten = x[0] * x[1];
        vec![3.0 * x[0] - 3.0 * eaten, eaten - x[1]]
    };
    problem(right, &[(1.292, 1.308), (1.0, 1.0)], &[], &[])
}

fn robertson(beta: f64, gamma: f64) -> Problem {
    let right: Box<Right> = Box::new(move |_, x| {
        let [a, b, c] = [0.4 * x[0], beta * x[1] * x[2], gamma * x[1] * x[1]];
        vec![b - a, a - b - c, c]
    });
    problem(&*right, &[(1.0, 1.0), (0.0, 0.0), (0.0, 0.0)], &[], &[])
}

#[test]
fn published_plants() {
    let (end, time, last) = attack("van der Pol", &van_der_pol(), 7.0, 60);
    assert_eq!((end, time), (End::Reached, 7.0));
    assert!(last[0].width() < 0.14 && last[1].width() < 0.55, "{last:?}");

    let (end, _, last) = attack("Laub-Loomis", &laub_loomis(0.05), 20.0, 12);
    assert_eq!(end, End::Reached);
    assert!(last[3].width() < 0.016, "{last:?}");

    let (end, _, last) = attack("Lotka-Volterra", &lotka_volterra(), 3.64, 60);
    assert_eq!(end, End::Reached);
    assert!(
        last[0].width() < 0.017 && last[1].width() < 6e-4,
        "{last:?}"
    );

    let (end, _, last) = attack("Robertson", &robertson(1e2, 1e3), 10.0, 2);
    assert_eq!(end, End::Reached);
    // mass is conserved
    let total = last.iter().fold(Interval::ZERO, |sum, x| sum + *x);
    assert!(total.contains(1.0) && total.width() < 1e-9, "{total}");
}

/// The table of docs/certificates.md.
#[test]
#[ignore = "takes minutes, and is meant for a release build: a hundred thousand runs per plant"]
fn published_plants_with_many_runs() {
    let mut plants = vec![
        ("van der Pol", van_der_pol(), 7.0, 100_000),
        ("coupled van der Pol", coupled(), 7.0, 100_000),
    ];
    plants.extend([0.01, 0.05, 0.1].map(|w| ("Laub-Loomis", laub_loomis(w), 20.0, 100_000)));
    plants.push(("Lotka-Volterra", lotka_volterra(), 3.64, 100_000));
    let rates = [(1e2, 1e3), (1e3, 1e5), (1e3, 1e7)];
    // every run starts at the one point
    plants.extend(rates.map(|(b, c)| ("Robertson", robertson(b, c), 40.0, 1)));
    for (name, problem, until, runs) in plants {
        let clock = std::time::Instant::now();
        let mut steps = 0;
        reach(&problem, until, &Budget::default(), &mut |_| {
            steps += 1;
            ControlFlow::Continue(())
        });
        let seconds = clock.elapsed().as_secs_f64();
        let effort = Effort {
            runs,
            sharp: runs.min(100),
            steps: 12,
            slack: 1e-7,
        };
        let (end, time, last) = attacked(name, &problem, until, &effort);
        assert_eq!((end, time), (End::Reached, until));
        println!("{name}: {seconds:.2} s, {steps} steps, {:?}", widths(&last));
    }
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
    // nothing times what has no value has none
    let hidden: &Right = &|g, x| vec![g.constant(0.0) + (x[0] - x[0]) * (1.0 / x[0])];
    let (end, ..) = attack("0/x", &problem(hidden, &[(-0.1, 0.1)], &[], &[]), 1.0, 0);
    assert_eq!(end, End::Stuck);
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
    match random.below(22) {
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
        15 => (1.6 + b(random).sin()).powi(-2),
        16 => (0.8 * a.sin()).asin(),
        17 => a.atan2(1.2 + b(random).cos()),
        18 => (1.1 + a.cos()).pow(b(random).tanh()),
        19 => (0.7 * a.sin()).tan(),
        20 => 0.2 * (0.5 * a).cosh().max(b(random)),
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
    assert!(proved > 50, "{proved}");
}
