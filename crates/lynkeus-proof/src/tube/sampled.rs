//! A tube that jumps at samples, such as that of a plant beside its filter.
//!
//! z(t₀) = z₀(s) for unknown numbers s in ranges, z' = f(t, z, u) between samples, and at a sample
//! z⁺ = g(t, z, ν) with |νⱼ| ≤ bⱼ, other numbers at every sample. A sample takes the set p₀(s) + Gξ as a step
//! does where it ends: g is evaluated over Taylor models with a symbol per νⱼ beside those of s and of
//! the remainder; what comes back linear in the symbols of ν are new columns of G.

use std::ops::ControlFlow;

use lynkeus_expr::{Budget, Interval, Tape};

use super::End;
use super::step::{Problem, Stepper};

/// What flows and jumps.
#[derive(Clone, Debug)]
pub struct Sampled {
    /// between samples; its `start` is the ranges of s, and there are no `constants`: what is constant
    /// is a state with derivative 0
    pub flow: Problem,
    /// z₀: its inputs are s
    pub first: Tape,
    /// g: its inputs are z, time, ν
    pub sample: Tape,
    /// b
    pub errors: Vec<f64>,
    /// when the samples are, from `flow.from` on, one after the other
    pub times: Vec<f64>,
}

/// Who looks at the parts of a tube: from when, to when, in which ranges.
pub type See<'s> = dyn FnMut(f64, f64, &[Interval]) -> ControlFlow<()> + 's;

impl Sampled {
    /// Integrates until a time, shows from when to when z is in which ranges, a sample as a part without length, and
    /// says where and why it ended, and in which ranges z is then.
    ///
    /// Everything that it shows is proved: every solution from z₀ exists so far and lies in the ranges.
    pub fn reach(
        &self,
        until: f64,
        budget: &Budget,
        see: &mut See<'_>,
    ) -> (End, f64, Vec<Interval>) {
        let errors = self.errors.len();
        let Some(mut stepper) = Stepper::lifted(&self.flow, &self.first, errors, until) else {
            return (End::Stuck, self.flow.from, vec![]);
        };
        let mut last = stepper.ranges();
        for time in self.times.iter().copied().filter(|time| *time <= until) {
            let end = advance(&mut stepper, time, budget, &mut last, see);
            let Some(after) = end
                .is_none()
                .then(|| stepper.jump(&self.sample, &self.errors))
            else {
                return (end.unwrap_or(End::Stuck), stepper.time(), last);
            };
            let Some(after) = after else {
                return (End::Stuck, stepper.time(), last);
            };
            last = after;
            if see(time, time, &last).is_break() {
                return (End::Stopped, time, last);
            }
        }
        let end = advance(&mut stepper, until, budget, &mut last, see);
        (end.unwrap_or(End::Reached), stepper.time(), last)
    }
}

/// To a time, and why not there.
fn advance(
    stepper: &mut Stepper<'_>,
    until: f64,
    budget: &Budget,
    last: &mut Vec<Interval>,
    see: &mut See<'_>,
) -> Option<End> {
    stepper.aim(until);
    while stepper.time() < until {
        let found = stepper.step(budget);
        if let Some(spent) = budget.spent() {
            return Some(End::Spent(spent));
        }
        let Some(segment) = found else {
            return Some(End::Stuck);
        };
        let stop = see(segment.from(), segment.to(), &segment.range()).is_break();
        *last = segment.end();
        stepper.take(segment.into_end());
        if stop {
            return Some(End::Stopped);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use lynkeus_expr::{Expr, Graph, Node};

    use super::*;

    fn tape(g: &Graph, inputs: &[Expr<'_>], outputs: &[Expr<'_>]) -> Tape {
        let nodes = |all: &[Expr<'_>]| all.iter().map(|e| e.node()).collect::<Vec<Node>>();
        Tape::new(g, &nodes(inputs), &nodes(outputs)).unwrap()
    }

    fn interval(low: f64, high: f64) -> Interval {
        Interval::new(low, high).unwrap()
    }

    /// A constant x in [1, 2] of which x̂ = 1.5 is known with variance `p`, read with errors up to `b`
    /// and of variance `r`: z = (x, e, P).
    fn constant(p: f64, r: f64, b: f64, count: i32) -> Sampled {
        let g = Graph::new();
        let [x, e, P, t, ν] = ["x", "e", "P", "t", "ν"].map(|name| g.symbol(name));
        let zero = g.constant(0.0);
        let K = P / (P + r);
        Sampled {
            flow: Problem {
                right: tape(&g, &[x, e, P, t], &[zero, zero, zero]),
                from: 0.0,
                start: vec![interval(1.0, 2.0)],
                constants: vec![],
                inputs: vec![],
            },
            first: tape(&g, &[x], &[x, 1.5 - x, g.constant(p)]),
            sample: tape(&g, &[x, e, P, t, ν], &[x, e + K * (ν - e), P - K * P]),
            errors: vec![b],
            times: (0..count).map(f64::from).collect(),
        }
    }

    fn end(of: &Sampled, until: f64) -> Vec<Interval> {
        let go_on = &mut |_: f64, _: f64, _: &[Interval]| ControlFlow::Continue(());
        let (end, time, last) = of.reach(until, &Budget::default(), go_on);
        assert_eq!((end, time), (End::Reached, until));
        last
    }

    /// After k samples 1/P = 1/p + k/r, and e is (r/p·e₀ + Σν)/(r/p + k): the set is as wide, and no wider.
    #[test]
    fn what_is_known_of_a_constant() {
        let (p, r, b) = (0.5, 0.2, 0.03);
        for count in [1, 2, 7, 40] {
            let last = end(&constant(p, r, b, count), 60.0);
            let (k, share) = (f64::from(count), r / p);
            let radius = (share * 0.5 + k * b) / (share + k);
            let near = |found: f64, exact: f64| (found - exact).abs() < 1e-9;
            assert!(
                near(last[1].hi(), radius) && near(last[1].lo(), -radius),
                "{last:?} {radius}"
            );
            assert!(last[1].hi() >= radius && last[1].lo() <= -radius);
            let P = 1.0 / (1.0 / p + k / r);
            assert!(
                last[2].contains(P) && last[2].width() < 1e-12,
                "{last:?} {P}"
            );
            assert!(last[0].contains(1.0) && last[0].contains(2.0) && last[0].width() < 1.0 + 1e-9);
        }
    }

    /// A sample is at its time: neither one before nor one after counts.
    #[test]
    fn samples_are_at_their_times() {
        let mut of = constant(1.0, 1.0, 0.0, 0);
        of.times = vec![0.5, 2.0, 7.0];
        let mut seen = vec![];
        let see = &mut |from: f64, to: f64, z: &[Interval]| {
            seen.push((from, to, z[2].midpoint()));
            ControlFlow::Continue(())
        };
        let (end, _, last) = of.reach(3.0, &Budget::default(), see);
        assert!(end == End::Reached && (last[2].midpoint() - 1.0 / 3.0).abs() < 1e-9);
        let jumps: Vec<_> = seen.iter().filter(|part| part.0 == part.1).collect();
        assert_eq!(jumps.len(), 2);
        assert!(jumps[0].0 == 0.5 && (jumps[0].2 - 0.5).abs() < 1e-12);
        for (from, to, P) in seen.iter().filter(|part| part.0 < part.1) {
            let exact = if *to <= 0.5 {
                1.0
            } else if *to <= 2.0 {
                0.5
            } else {
                1.0 / 3.0
            };
            assert!(
                (P - exact).abs() < 1e-9 && (*to <= 0.5 || *from >= 0.5),
                "{from} {to} {P}"
            );
        }
    }

    /// A pendulum that slips, z = (x, v, e, d, P₁₁, P₁₂, P₂₂), beside runs of a filter that is written out here.
    #[test]
    fn runs_of_a_filter_stay_inside() {
        let g = Graph::new();
        let names = ["x", "v", "e", "d", "P", "Q", "R", "t", "ν"];
        let [x, v, e, d, P, Q, R, t, ν] = names.map(|name| g.symbol(name));
        let (r, q) = (0.01, 0.02);
        let slope = -(x + e).cos();
        let flow = [
            v,
            -x.sin() - 0.1 * v,
            d,
            -(x + e).sin() + x.sin() - 0.1 * d,
            2.0 * Q,
            R + slope * P - 0.1 * Q,
            2.0 * (slope * Q - 0.1 * R) + q,
        ];
        let S = P + r;
        let inner = ν - e;
        let sample = [
            x,
            v,
            e + P / S * inner,
            d + Q / S * inner,
            r * P / S,
            r * Q / S,
            R - Q * Q / S,
        ];
        let (b, every) = (0.02, 0.25);
        let of = Sampled {
            flow: Problem {
                right: tape(&g, &[x, v, e, d, P, Q, R, t], &flow),
                from: 0.0,
                start: vec![interval(0.85, 1.15), interval(-0.15, 0.15)],
                constants: vec![],
                inputs: vec![],
            },
            first: tape(
                &g,
                &[x, v],
                &[
                    x,
                    v,
                    1.0 - x,
                    -v,
                    g.constant(0.02),
                    g.constant(0.0),
                    g.constant(0.02),
                ],
            ),
            sample: tape(&g, &[x, v, e, d, P, Q, R, t, ν], &sample),
            errors: vec![b],
            times: (1..=20).map(|k| every * f64::from(k)).collect(),
        };
        let mut jumps = vec![];
        let see = &mut |from: f64, to: f64, z: &[Interval]| {
            if from == to {
                jumps.push(z.to_vec());
            }
            ControlFlow::Continue(())
        };
        let (found, _, last) = of.reach(5.0, &Budget::default(), see);
        assert_eq!(found, End::Reached);
        assert_eq!((jumps.len(), jumps.last()), (20, Some(&last)));
        // narrow enough to say something
        assert!(
            last[2].magnitude() < 0.1 && last[3].magnitude() < 0.15,
            "{last:?}"
        );
        assert!(
            last[4].lo() > 0.0 && last[4].width() < 0.2 * last[4].hi(),
            "{last:?}"
        );
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 40) as f64 / f64::from(1 << 23) - 1.0
        };
        let mut largest = 0.0_f64;
        for run in 0..200 {
            let corner = |u: f64| if run % 2 == 0 { u.signum() } else { u };
            let start = [1.0 + 0.15 * corner(random()), 0.15 * corner(random())];
            // plant, estimate, covariance
            let mut z = [start[0], start[1], 1.0, 0.0, 0.02, 0.0, 0.02];
            for inside in &jumps {
                for _ in 0..50 {
                    z = step(z, every / 50.0, q);
                }
                let reading = z[0] + b * corner(random());
                let S = z[4] + r;
                let (K, inner) = ([z[4] / S, z[5] / S], reading - z[2]);
                let after = [z[4] - K[0] * z[4], z[5] - K[0] * z[5], z[6] - K[1] * z[5]];
                z = [
                    z[0],
                    z[1],
                    z[2] + K[0] * inner,
                    z[3] + K[1] * inner,
                    after[0],
                    after[1],
                    after[2],
                ];
                let own = [z[0], z[1], z[2] - z[0], z[3] - z[1], z[4], z[5], z[6]];
                for (value, range) in own.into_iter().zip(inside) {
                    assert!(
                        range.inflate(1e-8).contains(value),
                        "{run}: {value} {range}"
                    );
                }
                largest = largest.max((z[2] - z[0]).abs() / inside[2].magnitude());
            }
        }
        assert!(largest > 0.6, "{largest}");
    }

    /// Runge and Kutta's step of the pendulum, its estimate and the covariance.
    fn step(z: [f64; 7], h: f64, q: f64) -> [f64; 7] {
        let f = |z: [f64; 7]| {
            let slope = -z[2].cos();
            [
                z[1],
                -z[0].sin() - 0.1 * z[1],
                z[3],
                -z[2].sin() - 0.1 * z[3],
                2.0 * z[5],
                z[6] + slope * z[4] - 0.1 * z[5],
                2.0 * (slope * z[5] - 0.1 * z[6]) + q,
            ]
        };
        let along = |k: [f64; 7], h: f64| std::array::from_fn(|i| z[i] + h * k[i]);
        let a = f(z);
        let b = f(along(a, h / 2.0));
        let c = f(along(b, h / 2.0));
        let d = f(along(c, h));
        std::array::from_fn(|i| z[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]))
    }
}
