//! Series and doubling against one integration of everything.

use super::*;
use crate::filter::root::Root;
use crate::filter::transition::joint::Joint;
use crate::{BetweenSamples, Tolerances};
use lynkeus_expr::{Expr, Graph};

/// x_i' from x_{i−1} (or the input), x_i, x_{i+1} (or x_i at the end) and the input.
type Law = for<'g> fn([Expr<'g>; 4], usize) -> Expr<'g>;

fn chain(n: usize, law: Law) -> Linearised {
    let g = Graph::new();
    let (time, u) = (g.symbol("time"), g.symbol("u"));
    let x: Vec<_> = (0..n).map(|i| g.symbol(&format!("x{i}"))).collect();
    let dx: Vec<_> = (0..n)
        .map(|i| {
            let left = if i == 0 { u } else { x[i - 1] };
            law([left, x[i], x[(i + 1).min(n - 1)], u], i).node()
        })
        .collect();
    let states: Vec<_> = (0..n)
        .map(|i| (format!("x{i}"), x[i].node(), 0.3 + 0.1 * (i % 5) as f64))
        .collect();
    let signals = [("u".to_string(), u.node())];
    Linearised::flow(&g, time.node(), &states, &signals, &dx, &Default::default()).unwrap()
}

fn tight(relative: f64) -> Tolerances {
    Tolerances {
        relative,
        absolute: 1e-2 * relative,
        ..Tolerances::default()
    }
}

/// x̂, Φ and W over three samples by both ways; the largest relative difference.
fn differ(chain: &Linearised, step: f64, ours: Method, reference: Method) -> f64 {
    let n = chain.system().states().len();
    let noise: Vec<f64> = (0..n)
        .map(|i| 0.01 * f64::from(u8::from(i % 3 != 1)))
        .collect();
    let mut variation = Piecewise::new(chain, &noise, ours).unwrap();
    let mut joint = Joint::new(chain, &noise, reference).unwrap();
    let mut worst = 0.0_f64;
    let mut x = chain.system().start().to_vec();
    let mut driven = chain.system().driven(BetweenSamples::Linear);
    driven.start(&[0.5]);
    for k in 0..3 {
        let (from, to) = (step * f64::from(k), step * f64::from(k + 1));
        let belief = Belief {
            x: x.clone(),
            root: Root::diagonal(&vec![0.04; n]),
        };
        driven.aim(from, to, &[0.5 + 0.3 * f64::from(k)]);
        let mut other = x.clone();
        let mut expected = Transition::start(n, true);
        joint
            .advance(
                &mut driven.clone(),
                &belief.root,
                from,
                to,
                &mut other,
                &mut expected,
            )
            .unwrap();
        let found = variation
            .advance(&mut driven, &belief, from, to, &mut x)
            .unwrap();
        driven.arrive();
        let pairs = [
            (x.as_slice(), other.as_slice()),
            (found.matrix.entries(), expected.matrix.entries()),
            (
                found.noise.as_ref().unwrap().entries(),
                expected.noise.as_ref().unwrap().entries(),
            ),
        ];
        for (a, b) in pairs {
            let size = b.iter().fold(0.0_f64, |m, b| m.max(b.abs()));
            let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs() / size);
            worst = apart.fold(worst, f64::max);
        }
    }
    worst
}

/// Nonlinear, with an input that moves, over short and over long samples.
#[test]
fn series_agree_with_one_integration() {
    let chain = chain(13, |[left, own, right, u], i| {
        left - own * 1.5 + (own * right).sin() * 0.4 + u * own * 0.2 + 0.01 * i as f64
    });
    for (step, tolerance) in [(0.05, 1e-9), (0.7, 1e-9), (4.0, 1e-9), (0.7, 1e-5)] {
        let off = differ(
            &chain,
            step,
            Method::Explicit(tight(tolerance)),
            Method::Explicit(tight(1e-12)),
        );
        assert!(off < 10.0 * tolerance, "{step}: {off}");
    }
}

/// Rates that are odd about the middle of every sample look constant, or a line, from its ends and
/// its middle: a whole wave, and a part of one.
#[test]
fn a_wave_in_step_with_the_samples_is_seen() {
    let whole = chain(12, |[left, own, _, u], i| {
        let wave = ((u - 0.5) * (std::f64::consts::TAU / 0.3)).sin();
        left - own * (1.5 + wave * (0.2 * i as f64))
    });
    let part = chain(12, |[left, own, _, u], i| {
        let wave = ((u - 0.65) * 4.0).sin() + ((u - 0.95) * 4.0).sin();
        left - own * (1.5 + wave * (0.2 * i as f64))
    });
    for chain in [whole, part] {
        let ours = Method::Explicit(tight(1e-9));
        let off = differ(&chain, 1.0, ours, Method::Explicit(tight(1e-12)));
        assert!(off < 1e-8, "{off}");
    }
}

/// A derivative with a kink that the estimate crosses within a sample.
#[test]
fn a_kink_is_found() {
    let chain = chain(10, |[left, own, _, _], _| left - own + (own - 0.45).abs());
    let off = differ(
        &chain,
        0.9,
        Method::Explicit(tight(1e-7)),
        Method::Explicit(tight(1e-11)),
    );
    assert!(off < 1e-5, "{off}");
}

/// Rates of 10⁴ per sample, constant and not.
#[test]
fn stiff_flows_are_doubled_up() {
    let linear = chain(12, |[left, own, right, _], i| match i % 2 {
        0 => (right - own) * 1e4,
        _ => left - own * 2.0,
    });
    let reference = Method::Explicit(tight(1e-10));
    let off = differ(&linear, 1.0, Method::Adaptive(tight(1e-9)), reference);
    assert!(off < 1e-8, "{off}");
    let bent = chain(12, |[left, own, right, _], i| match i % 2 {
        0 => (right - own) * 1e4,
        _ => left - own * own * 2.0,
    });
    let off = differ(&bent, 1.0, Method::Adaptive(tight(1e-9)), reference);
    assert!(off < 1e-4, "{off}");
}

fn at(nodes: &[f64], f: impl Fn(f64) -> f64) -> Vec<Vec<f64>> {
    nodes.iter().map(|s| vec![f(*s)]).collect()
}

#[test]
fn polynomials_are_found_and_others_refused() {
    let (of_three, of_five) = (basis(&[FINE[0], FINE[2], FINE[4]]), basis(&FINE));
    let line = coarse(&of_three, &at(&[0.0, 0.5, 1.0], |s| 2.0 - 3.0 * s), 1e-12);
    let line = line.unwrap();
    assert_eq!(line.len(), 2);
    assert!((line[0][0] - 2.0).abs() < 1e-15 && (line[1][0] + 3.0).abs() < 1e-14);
    assert!(coarse(&of_three, &at(&[0.0, 0.5, 1.0], f64::exp), 1e-3).is_none());
    let wave = |s: f64| (0.2 * s).sin();
    let fit = fine(&of_five, &at(&FINE, wave), 1e-8).unwrap();
    for k in 0..=10 {
        let s = 0.1 * f64::from(k);
        let value: f64 = fit.iter().rev().fold(0.0, |sum, c| sum * s + c[0]);
        assert!((value - wave(s)).abs() < 1e-8, "{s}");
    }
    assert!(fine(&of_five, &at(&FINE, |s| (s - 0.4).abs()), 1e-3).is_none());
    assert!(fine(&of_five, &at(&FINE, |_| f64::NAN), 1e-3).is_none());
}

/// What is odd about the middle has no even coefficients to fall: its own tell, and what three
/// nodes take for a line does not meet it elsewhere.
#[test]
fn a_wave_that_is_odd_about_the_middle_is_no_line() {
    let (of_three, of_five) = (basis(&[FINE[0], FINE[2], FINE[4]]), basis(&FINE));
    let three = [FINE[0], FINE[2], FINE[4]];
    for rate in [1.0, std::f64::consts::TAU] {
        let wave = |s: f64| (rate * (s - 0.5)).sin();
        let line = coarse(&of_three, &at(&three, wave), 1e-9).unwrap();
        assert!(line.len() <= 2);
        assert!(!meets(&line, FINE[1], &[wave(FINE[1])], 1e-4));
        assert!(fine(&of_five, &at(&FINE, wave), 1e-6).is_none());
    }
    let slow = |s: f64| (0.02 * (s - 0.5)).sin();
    let line = coarse(&of_three, &at(&three, slow), 1e-6).unwrap();
    assert!(meets(&line, FINE[1], &[slow(FINE[1])], 1e-6));
    let fit = fine(&of_five, &at(&FINE, slow), 1e-9).unwrap();
    assert!(meets(&fit, 0.3, &[slow(0.3)], 1e-9));
    assert!(!meets(&fit, 0.3, &[f64::NAN], 1e-9));
}
