//! Compiled code gives what the interpreter gives, to the bit.

use lynkeus_expr::lanes::Lanes;
use lynkeus_expr::{Binary, Graph, Node, Tape, Unary};
use lynkeus_native::Function;
use proptest::prelude::*;

/// One step of a random program: what to do with which earlier values.
#[derive(Clone, Debug)]
struct Draw {
    kind: u8,
    op: usize,
    from: [usize; 6],
    power: i32,
    constant: f64,
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => -3.0..3.0_f64,
        1 => any::<f64>(),
        1 => prop::sample::select(vec![0.0, -0.0, 1.0, -1.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 5e-324]),
    ]
}

fn draw() -> impl Strategy<Value = Draw> {
    let from = prop::array::uniform6(0..1000_usize);
    (0..20_u8, 0..1000_usize, from, -5..9_i32, number()).prop_map(
        |(kind, op, from, power, constant)| Draw {
            kind,
            op,
            from,
            power,
            constant,
        },
    )
}

/// A graph of these steps; the last values, and some earlier ones, are outputs.
fn build(g: &Graph, inputs: &[Node], draws: &[Draw]) -> Vec<Node> {
    let mut nodes = inputs.to_vec();
    for draw in draws {
        // mostly recent values, so that programs are deep and long-lived ones are spilled
        let pick = |i: usize| {
            let span = if draw.from[i] % 3 == 0 {
                nodes.len()
            } else {
                nodes.len().min(6)
            };
            nodes[nodes.len() - 1 - draw.from[i] % span]
        };
        match draw.kind {
            0..5 => nodes.push(g.unary(Unary::ALL[draw.op % Unary::ALL.len()], pick(0))),
            5 => nodes.push(g.powi(pick(0), draw.power)),
            6 => nodes.push(g.select(pick(0), pick(1), pick(2))),
            7 => {
                let solution = g.solve(&[pick(0), pick(1), pick(2), pick(3)], &[pick(4), pick(5)]);
                nodes.extend(solution.x);
                nodes.push(solution.rcond);
            }
            8 => nodes.push(g.constant(draw.constant).node()),
            9..14 => nodes.push(g.binary(Binary::ALL[draw.op % 4], pick(0), pick(1))),
            _ => nodes.push(g.binary(Binary::ALL[draw.op % Binary::ALL.len()], pick(0), pick(1))),
        }
    }
    let mut outputs: Vec<Node> = nodes.iter().rev().step_by(7).copied().collect();
    outputs.extend(nodes.iter().rev().take(4));
    outputs
}

fn same(x: f64, y: f64) -> bool {
    x.to_bits() == y.to_bits() || (x.is_nan() && y.is_nan())
}

/// In every second program products and sums are fused.
fn agrees(draws: &[Draw], rows: &[[f64; 5]; 8]) -> Result<(), TestCaseError> {
    let g = Graph::new();
    let inputs: Vec<Node> = (0..5).map(|i| g.symbol(&format!("x{i}")).node()).collect();
    let outputs = build(&g, &inputs, draws);
    let tape = match draws.len() % 2 {
        0 => Tape::new,
        _ => Tape::fused,
    };
    let tape_of = |outputs: &[Node]| tape(&g, &inputs, outputs).expect("all inputs are there");
    tape_agrees(&tape_of(&outputs), rows)?;
    steps_agree(&tape_of(&outputs[..2]), rows)
}

/// Three steps at once, each from the last inputs that the one before gave, are what each gives alone.
fn steps_agree(tape: &Tape, rows: &[[f64; 5]; 8]) -> Result<(), TestCaseError> {
    let Some(mut steps) = Function::<1>::stepping(tape, 1) else {
        return Ok(());
    };
    let [shared, own @ ..] = rows[0];
    let mut values: Vec<[f64; 1]> = own.map(|x| [x]).to_vec();
    for row in &rows[1..4] {
        values.extend([[row[0]], [row[1]], [7.0], [7.0]]);
    }
    let mut expected = values.clone();
    let mut interpreter = tape.evaluator();
    for step in 0..3 {
        let own = expected[4 * step..][..4].as_flattened();
        let mut found = [0.0; 2];
        interpreter.eval(&[&[shared], own].concat(), &mut found);
        expected[4 * step + 6] = [found[0]];
        expected[4 * step + 7] = [found[1]];
    }
    steps.steps(3, &[[shared]], &mut values);
    let pairs = values.as_flattened().iter().zip(expected.as_flattened());
    for (found, expected) in pairs {
        prop_assert!(same(*found, *expected), "{found} {expected}");
    }
    Ok(())
}

fn tape_agrees(tape: &Tape, rows: &[[f64; 5]; 8]) -> Result<(), TestCaseError> {
    let outputs = tape.outputs();
    let Some(mut single) = Function::<1>::compile(tape) else {
        eprintln!("skipped: machine code is not made here");
        return Ok(());
    };
    let mut narrow = Function::<1>::compile_for_avx2(tape).expect("any processor has it");
    let mut interpreter = tape.evaluator();
    let [first, second] = [0, 1].map(|half| std::array::from_fn(|lane| rows[4 * half + lane]));
    for rows in [&first, &second] {
        side_by_side::<4>(tape, rows)?;
    }
    side_by_side::<8>(tape, rows)?;
    for row in rows {
        let (mut expected, mut found) = (vec![0.0; outputs], vec![[0.0]; outputs]);
        interpreter.eval(row, &mut expected);
        for single in [&mut single, &mut narrow] {
            single.eval(&row.map(|x| [x]), &mut found);
            for (i, &e) in expected.iter().enumerate() {
                prop_assert!(same(e, found[i][0]), "output {i}: {e} and {}", found[i][0]);
            }
        }
    }
    Ok(())
}

/// So many lanes give what the interpreter gives in each, where they are compiled for.
fn side_by_side<const N: usize>(tape: &Tape, rows: &[[f64; 5]; N]) -> Result<(), TestCaseError> {
    let Some(mut lanes) = Function::<N>::compile(tape) else {
        prop_assert!(N == 8, "as for one lane");
        return Ok(());
    };
    let columns: Vec<[f64; N]> = (0..5).map(|i| rows.map(|row| row[i])).collect();
    let mut found = vec![[0.0; N]; tape.outputs()];
    lanes.eval(&columns, &mut found);
    let expected = tape.eval_in(&Lanes::<N>, &columns);
    for (i, (e, found)) in expected.iter().zip(&found).enumerate() {
        for lane in 0..N {
            let (e, found) = (e[lane], found[lane]);
            prop_assert!(
                same(e, found),
                "output {i}, lane {lane} of {N}: {e} and {found}"
            );
        }
    }
    Ok(())
}

/// Three groups with two inputs in common give what each gives alone.
fn sweeps_agree<const N: usize>(draws: &[Draw], rows: &[[f64; 5]; N]) -> Result<(), TestCaseError> {
    const SPARE: usize = 3;
    let g = Graph::new();
    let inputs: Vec<Node> = (0..5).map(|i| g.symbol(&format!("x{i}")).node()).collect();
    let outputs = build(&g, &inputs, draws);
    let tape = Tape::new(&g, &inputs, &outputs).expect("all inputs are there");
    let spacing = outputs.len() + SPARE;
    let Some(mut sweeper) = Function::<N>::sweeping(&tape, 2, spacing) else {
        return Ok(());
    };
    let [u, v, a, b, c] = std::array::from_fn(|i| rows.map(|row| row[i]));
    let own = [[a, b, c], [b, c, a], [c, c, b]];
    let mut found = vec![[7.0; N]; 3 * spacing];
    sweeper.sweep(3, &[u, v], own.as_flattened(), &mut found);
    for (group, [a, b, c]) in own.into_iter().enumerate() {
        let expected = tape.eval_in(&Lanes::<N>, &[u, v, a, b, c]);
        let (values, spare) = found[group * spacing..][..spacing].split_at(outputs.len());
        let pairs = values.as_flattened().iter().zip(expected.as_flattened());
        for (found, expected) in pairs {
            prop_assert!(same(*found, *expected), "group {group}: {found} {expected}");
        }
        prop_assert_eq!(spare, &[[7.0; N]; SPARE]);
    }
    Ok(())
}

/// Linear systems of every size up to one that the stack has no room for, twice in a program; the largest is
/// beyond what is compiled.
#[test]
fn linear_systems_of_every_size_agree() {
    for n in [1, 2, 5, 6, 9, 64, 65] {
        let g = Graph::new();
        let [x, y] = ["x", "y"].map(|name| g.symbol(name));
        let entry = |k: usize| (1.7 * (k * k) as f64).sin() + x * (k % 5) as f64 - y;
        let a: Vec<Node> = (0..n * n).map(|k| entry(k).node()).collect();
        let b: Vec<Node> = (0..n).map(|k| entry(k + 3).node()).collect();
        let first = g.solve(&a, &b);
        let second = g.solve(&a, &first.x);
        let outputs = [&first.x[..], &second.x, &[first.rcond, second.rcond]].concat();
        let tape = Tape::new(&g, &[x.node(), y.node()], &outputs).expect("all inputs are there");
        if n == 65 {
            assert!(Function::<4>::compile(&tape).is_none());
            continue;
        }
        systems_agree::<4>(&tape);
        systems_agree::<8>(&tape);
    }
}

fn systems_agree<const N: usize>(tape: &Tape) {
    let Some(mut lanes) = Function::<N>::compile(tape) else {
        assert!(Function::<N>::compile(&smallest()).is_none());
        return;
    };
    let [x, y] = [[0.3, -1.5, f64::NAN, 0.0], [2.0, 0.25, 1.0, 0.0]];
    let inputs = [x, y].map(|row| std::array::from_fn(|lane| row[lane % 4]));
    let mut found = vec![[0.0; N]; tape.outputs()];
    for _ in 0..2 {
        lanes.eval(&inputs, &mut found);
        let expected = tape.eval_in(&Lanes::<N>, &inputs);
        let pairs = found.as_flattened().iter().zip(expected.as_flattened());
        assert!(pairs.clone().all(|(f, e)| same(*f, *e)));
        assert!(found[0][0].is_finite() && found[0][0] != 0.0);
    }
}

/// What every machine compiles that compiles at all.
fn smallest() -> Tape {
    let g = Graph::new();
    let x = g.symbol("x").node();
    Tape::new(&g, &[x], &[x]).expect("its input is there")
}

fn rows() -> impl Strategy<Value = [[f64; 5]; 8]> {
    prop::array::uniform8(prop::array::uniform5(number()))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10_000))]

    #[test]
    fn random_programs_agree(draws in prop::collection::vec(draw(), 1..200), rows in rows()) {
        agrees(&draws, &rows)?;
        sweeps_agree::<8>(&draws, &rows)?;
        sweeps_agree::<4>(&draws, &std::array::from_fn(|lane| rows[lane]))?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    /// Long ones, with values that wait in the frame for thousands of operations.
    #[test]
    fn long_programs_agree(draws in prop::collection::vec(draw(), 10_000..30_000), rows in rows()) {
        agrees(&draws, &rows)?;
    }
}
