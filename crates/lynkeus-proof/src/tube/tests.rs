//! Every operation of Taylor models contains what it stands for. The models are coarse: few
//! monomials and wide ranges, so that whatever is left out is large.

use lynkeus_expr::{Expr, Graph, Implicit, ImplicitUnknown, Interval, Node, Reals, Tape};

use super::algebra::Models;
use super::model::Model;
use super::ring::Ring;

const SHARES: [f64; 5] = [-1.0, -0.45, 0.0, 0.3, 1.0];
const CORNERS: [f64; 2] = [-1.0, 1.0];

type Function<'f> = &'f dyn for<'g> Fn(&'g Graph, &[Expr<'g>]) -> Expr<'g>;

/// All lists of so many of these values.
fn lists(values: &[f64], length: usize) -> Vec<Vec<f64>> {
    (0..length).fold(vec![vec![]], |lists, _| {
        let longer = |list: &Vec<f64>| {
            let list = list.clone();
            values.iter().map(move |x| [&list[..], &[*x]].concat())
        };
        lists.iter().flat_map(longer).collect()
    })
}

/// The polynomial where symbols and τ have these values.
fn polynomial(model: &Model, ring: &Ring, symbols: &[f64], tau: f64) -> f64 {
    let monomial = |i: usize| -> f64 {
        let powers = ring.exponents(i).iter().zip(symbols);
        powers.map(|(&n, s)| s.powi(i32::from(n))).product()
    };
    let rows = model.coefficients.chunks(ring.len()).enumerate();
    let row = |(k, row): (usize, &[f64])| -> f64 {
        let used = row.iter().enumerate().filter(|(_, c)| **c != 0.0);
        tau.powi(k as i32) * used.map(|(i, c)| c * monomial(i)).sum::<f64>()
    };
    rows.map(row).sum()
}

fn holds(model: &Model, ring: &Ring, symbols: &[f64], tau: f64, value: f64) -> bool {
    let off = (polynomial(model, ring, symbols, tau) - value).abs();
    off <= model.rest + 1e-12 * (1.0 + value.abs())
}

/// A model of one variable each: c + r·symbol, c + r·τ, c ± r, and c + r/2·symbol ± r/2.
fn around(ring: &Ring, centre: f64, radius: f64, symbol: usize) -> [Model; 4] {
    let constant = || Model::constant(ring, centre);
    let place = ring.symbol(symbol).unwrap();
    let mut all = [constant(), constant(), constant(), constant()];
    all[0].coefficients[place] = radius;
    all[1].coefficients.extend(vec![0.0; ring.len()]);
    all[1].coefficients[ring.len()] = radius;
    all[2].rest = radius;
    all[3].coefficients[place] = 0.5 * radius;
    all[3].rest = 0.5 * radius;
    all
}

fn tape(function: Function<'_>, arguments: usize) -> Tape {
    let g = Graph::new();
    let symbols: Vec<Expr<'_>> = (0..arguments).map(|i| g.symbol(&format!("x{i}"))).collect();
    let nodes: Vec<Node> = symbols.iter().map(|x| x.node()).collect();
    Tape::new(&g, &nodes, &[function(&g, &symbols).node()]).unwrap()
}

/// The function of the models holds the function of every member of theirs.
fn contained(ring: &Ring, degree: usize, function: Function<'_>, arguments: &[Model]) {
    let tape = tape(function, arguments.len());
    let found = &tape.eval_in(&Models { ring, degree }, arguments)[0];
    assert!(found.rest.is_finite(), "nothing known of {tape:?}");
    for symbols in lists(&SHARES, ring.exponents(0).len()) {
        for tau in [0.0, 0.4, 1.0] {
            for shares in lists(&[-1.0, 0.1, 1.0], arguments.len()) {
                let members = arguments.iter().zip(&shares);
                let member = |(x, share): (&Model, &f64)| {
                    polynomial(x, ring, &symbols, tau) + share * x.rest
                };
                let values: Vec<f64> = members.map(member).collect();
                let value = tape.eval_in(&Reals, &values)[0];
                assert!(
                    holds(found, ring, &symbols, tau, value),
                    "{value} of {values:?} is not within {} of {}, order {}",
                    found.rest,
                    polynomial(found, ring, &symbols, tau),
                    ring.order()
                );
            }
        }
    }
}

/// The same for one or two variables around these numbers, in every way that a model has.
fn contained_around(function: Function<'_>, variables: &[(f64, f64)]) {
    for order in 1..=2 {
        let ring = Ring::of_order(variables.len(), 0, order);
        let models = variables.iter().enumerate();
        let all: Vec<[Model; 4]> = models
            .map(|(i, &(centre, radius))| around(&ring, centre, radius, i))
            .collect();
        for kinds in 0..4_usize.pow(variables.len() as u32) {
            let models = all.iter().enumerate();
            let chosen = models.map(|(i, kind)| kind[kinds / 4_usize.pow(i as u32) % 4].clone());
            contained(&ring, 1, function, &chosen.collect::<Vec<Model>>());
        }
    }
}

/// One times every monomial with every power of τ, and a remainder of one alone.
fn single(ring: &Ring, degree: usize) -> Vec<Model> {
    let place = |k: usize| {
        let mut model = Model::constant(ring, 0.0);
        model.coefficients.resize((degree + 1) * ring.len(), 0.0);
        model.coefficients[k] = 1.0;
        model
    };
    let mut all: Vec<Model> = (0..(degree + 1) * ring.len()).map(place).collect();
    all.push(Model::within(ring, Interval::new(-1.0, 1.0).unwrap()));
    all
}

/// What is beyond the order or the degree, and every product with a remainder, counts.
#[test]
fn products_lose_nothing() {
    for (order, degree) in [(1, 1), (2, 1), (3, 2)] {
        let ring = Ring::of_order(2, 1, order);
        let all = single(&ring, degree);
        for (x, y) in all.iter().flat_map(|x| all.iter().map(move |y| (x, y))) {
            let product = x.times(y, &ring, degree);
            assert!(product.rest <= 1.0 + 1e-12);
            for symbols in lists(&CORNERS, 3) {
                for (e, tau) in [(1.0, 1.0), (-1.0, 1.0), (1.0, 0.0), (-1.0, 0.0)] {
                    let a = polynomial(x, &ring, &symbols, tau) + e * x.rest;
                    let b = polynomial(y, &ring, &symbols, tau) + y.rest;
                    assert!(
                        holds(&product, &ring, &symbols, tau, a * b),
                        "{x:?} times {y:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn integrals_and_ends() {
    let ring = Ring::of_order(1, 1, 3);
    for (k, x) in single(&ring, 2).iter().enumerate() {
        let integral = x.integral(&ring);
        let end = integral.at_end(&ring);
        assert!(integral.rest >= x.rest && end.rest >= integral.rest);
        let power = (k / ring.len()) as i32;
        for symbols in lists(&SHARES, 2) {
            let monomial = polynomial(x, &ring, &symbols, 1.0);
            for tau in [0.3, 1.0] {
                let value = monomial * f64::powi(tau, power + 1) / f64::from(power + 1);
                assert!(holds(&integral, &ring, &symbols, tau, value));
            }
            let value = monomial / f64::from(power + 1);
            assert!(holds(&end, &ring, &symbols, 0.0, value));
        }
    }
}

/// Lagrange's remainder of every elementary function, also of what only a remainder is known of.
#[test]
fn elementary_functions() {
    let functions: [(Function<'_>, f64, f64); 20] = [
        (&|_, x| x[0].sqrt(), 1.0, 0.8),
        (&|_, x| x[0].exp(), 0.3, 1.0),
        (&|_, x| x[0].ln(), 1.0, 0.7),
        (&|_, x| x[0].sin(), 1.0, 1.0),
        (&|_, x| x[0].cos(), 0.4, 1.0),
        (&|_, x| x[0].tan(), 0.5, 0.6),
        (&|_, x| x[0].asin(), 0.3, 0.5),
        (&|_, x| x[0].acos(), 0.3, 0.5),
        (&|_, x| x[0].atan(), 0.5, 0.8),
        (&|_, x| x[0].sinh(), 0.5, 1.0),
        (&|_, x| x[0].cosh(), 0.5, 1.0),
        (&|_, x| x[0].tanh(), 0.5, 0.8),
        (&|_, x| 2.0 / x[0], 1.5, 0.8),
        (&|_, x| 2.0 / x[0], -1.5, 0.8),
        (&|g, x| x[0].pow(g.constant(1.3)), 1.0, 0.7),
        (&|g, x| x[0].pow(g.constant(-0.6)), 1.0, 0.6),
        (&|g, x| g.constant(2.0).pow(x[0]), 0.5, 1.0),
        (&|_, x| x[0].powi(3), 0.4, 1.0),
        (&|_, x| x[0].powi(-2), 1.2, 0.5),
        (&|_, x| x[0].powi(4) - x[0], -0.2, 1.0),
    ];
    for (function, centre, radius) in functions {
        contained_around(function, &[(centre, radius)]);
    }
}

#[test]
fn functions_of_two() {
    let quotient: Function<'_> = &|_, x| x[0] / x[1];
    contained_around(quotient, &[(0.3, 1.0), (1.5, 0.7)]);
    contained_around(&|_, x| x[0].pow(x[1]), &[(1.2, 0.6), (0.5, 1.0)]);
    // all around, and over the cut
    let angle: Function<'_> = &|_, x| x[0].atan2(x[1]);
    let places = [
        [(0.2, 0.9), (1.5, 0.6)],
        [(1.5, 0.6), (-0.2, 0.9)],
        [(-1.5, 0.6), (0.2, 0.9)],
        [(0.2, 0.9), (-1.5, 0.6)],
    ];
    for place in places {
        contained_around(angle, &place);
    }
    let systems: Function<'_> = &|g, x| {
        let [a, b] = [x[0], x[1]];
        let matrix = [0.2 * a, 1.0 + b, b - 2.0, a];
        let right = [a, b + 1.0];
        let solution = g.solve(&matrix.map(|x| x.node()), &right.map(|x| x.node()));
        g.expr(solution.x[0]) - 0.3 * g.expr(solution.x[1])
    };
    contained_around(systems, &[(0.3, 0.3), (0.2, 0.3)]);
}

/// What bends or jumps where the model does: both sides, and all between.
#[test]
fn what_bends_or_jumps_is_enclosed() {
    let wide = [(0.2, 1.0)];
    let one: [Function<'_>; 8] = [
        &|_, x| x[0].abs(),
        &|_, x| x[0].sign() * (1.0 + x[0]),
        &|_, x| (2.0 * x[0]).floor(),
        &|g, x| x[0].less(g.constant(0.1)).select(2.0 * x[0], x[0] - 1.0),
        &|g, x| x[0].less_eq(g.constant(0.1)) * x[0],
        &|g, x| {
            let near = x[0]
                .less(g.constant(0.5))
                .and((-x[0]).less(g.constant(0.2)));
            (!near).select(g.constant(3.0), x[0])
        },
        &|g, x| {
            let far = x[0].less(g.constant(-0.5)).or(g.constant(0.7).less(x[0]));
            far.select(g.constant(3.0), x[0])
        },
        &|g, x| x[0].floor().equal(g.constant(0.0)).select(x[0], -x[0]),
    ];
    for function in one {
        contained_around(function, &wide);
        // and where it is decided
        contained_around(function, &[(5.25, 0.125)]);
        contained_around(function, &[(-5.25, 0.125)]);
    }
    contained_around(&|_, x| x[0].min(x[1]), &[(0.2, 1.0), (0.0, 0.7)]);
    contained_around(&|_, x| x[0].max(x[1] * x[0]), &[(0.2, 1.0), (0.5, 0.7)]);
    // Filippov's solutions take every value between both sides
    let ring = Ring::of_order(1, 0, 2);
    let models = Models {
        ring: &ring,
        degree: 1,
    };
    let [x, ..] = around(&ring, 0.0, 1.0, 0);
    let sign = tape(
        &|g, x| {
            g.constant(0.0)
                .less(x[0])
                .select(g.constant(-1.0), x[0] + 2.0)
        },
        1,
    );
    let found = &sign.eval_in(&models, &[x])[0];
    for s in SHARES {
        for share in [0.0, 0.25, 0.5, 1.0] {
            let value = (1.0 - share) * (s + 2.0) - share;
            assert!(holds(found, &ring, &[s], 0.0, value));
        }
    }
}

#[test]
fn implicit_functions() {
    // z + sin(z)/2 = x
    let root: Function<'_> = &|g, x| {
        let z = g.symbol("z");
        let unknown = ImplicitUnknown {
            symbol: z.node(),
            start: 0.0,
            range: Interval::new(-10.0, 10.0).unwrap(),
        };
        let residual = (z + 0.5 * z.sin() - x[0]).node();
        g.expr(Implicit::solve(g, &[unknown], &[residual]).unwrap()[0])
    };
    contained_around(root, &[(0.5, 1.0)]);
}

/// Nothing is known of what may have no value.
#[test]
fn what_may_have_no_value() {
    let functions: [Function<'_>; 15] = [
        &|_, x| x[0].sqrt(),
        &|_, x| x[0].ln(),
        &|_, x| 1.0 / x[0],
        &|g, x| x[0].pow(g.constant(0.5)),
        &|g, x| x[0].pow(g.constant(-1.5)),
        &|_, x| x[0].pow(x[0]),
        &|_, x| x[0].powi(-1),
        &|_, x| (0.5 + x[0]).asin(),
        &|_, x| (0.5 + x[0]).acos(),
        &|_, x| (1.2 + x[0]).tan(),
        &|_, x| x[0].atan2(x[0]),
        &|g, x| g.constant(0.0) * (1.0 / x[0]),
        &|g, x| g.constant(0.0) / x[0],
        &|_, x| (1.0 / x[0]).powi(0),
        &|g, x| x[0].less(g.constant(0.2)).select(x[0], x[0].sqrt()),
    ];
    let ring = Ring::of_order(1, 0, 3);
    let models = Models {
        ring: &ring,
        degree: 2,
    };
    for (number, function) in functions.into_iter().enumerate() {
        for x in around(&ring, -0.25, 1.0, 0) {
            let found = &tape(function, 1).eval_in(&models, &[x])[0];
            assert!(found.rest.is_infinite(), "{number}");
            assert!(!found.range(&ring).is_bounded());
        }
    }
    // a branch that is not taken has no influence
    let taken: Function<'_> = &|g, x| x[0].less(g.constant(3.0)).select(x[0], x[0].sqrt());
    contained_around(taken, &[(0.0, 1.0)]);
    // nor is anything known of numbers too large to write down
    let huge = Model::constant(&ring, 1e200);
    let product = huge.times(&Model::constant(&ring, 1e110), &ring, 2);
    assert!(product.rest.is_infinite());
}

/// The values of a model are within its ranges.
#[test]
fn ranges() {
    let ring = Ring::of_order(1, 1, 3);
    for x in single(&ring, 2) {
        let model = x.plus(&Model::constant(&ring, 0.25));
        let part = Interval::new(0.25, 0.5).unwrap();
        let (whole, part) = (model.range(&ring), model.range_over(&ring, part));
        for (symbols, tau) in lists(&SHARES, 2)
            .iter()
            .flat_map(|symbols| [0.0, 0.25, 0.5, 1.0].map(|tau| (symbols, tau)))
        {
            for share in CORNERS {
                let value = polynomial(&model, &ring, symbols, tau) + share * x.rest;
                assert!(whole.contains(value));
                assert!(part.contains(value) || tau == 0.0 || tau == 1.0);
                let end = model.at_end(&ring);
                let value = polynomial(&end, &ring, symbols, 0.0) + share * x.rest;
                assert!(end.range_at(&ring, &symbols[..1]).contains(value));
            }
        }
    }
}

/// As many wide ranges as a plant may have: the order falls.
#[test]
fn rings_of_many_symbols() {
    let orders = [1, 5, 19, 3000].map(|start| Ring::new(start, 0).order());
    assert_eq!(orders, [8, 4, 1, 1]);
}
