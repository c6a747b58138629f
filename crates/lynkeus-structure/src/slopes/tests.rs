use super::*;
use crate::{AugmentedPlant, Sensors};
use lynkeus_model::{LoadOptions, Plant};
use proptest::prelude::*;

fn plant(text: &str) -> Plant {
    Plant::from_modelica(text, "p.mo", &LoadOptions::default()).unwrap()
}

fn slopes(plant: &Plant) -> (Slopes, Region) {
    let augmented = AugmentedPlant::new(plant, &Sensors::default()).unwrap();
    let region = augmented.region();
    let symbols = augmented.symbols();
    let found = Slopes::new(
        augmented.graph(),
        &augmented.derivatives,
        &symbols,
        &[],
        &region,
    );
    (found.unwrap(), region)
}

/// The trays share one slope each, whatever stands before it in their two equations.
#[test]
fn a_term_of_several_equations_has_one_slope() {
    let plant = plant(
        "model P
          Real a(min = 0, max = 1); Real b(min = 0, max = 2);
          output Real y = a;
        equation
          der(a) = 3*(1.65*b/(1 + 0.65*b)) - a;
          0.5*der(b) = -(1.65*b/(1 + 0.65*b)) + 0.1*a;
        end P;",
    );
    let (found, _) = slopes(&plant);
    assert_eq!(found.slopes.len(), 1, "{:?}", found.slopes);
    let sector = &found.models[0].sectors[0];
    let weights: Vec<f64> = sector.direction.iter().map(|w| w.midpoint()).collect();
    assert_eq!(sector.column, 1);
    assert!((weights[0] / weights[1] + 1.5).abs() < 1e-12, "{weights:?}");
    // 1.65·d/db b/(1 + 0.65 b) runs from 1.65 at b = 0 to 1.65/2.3² at b = 2
    let scale = weights[0] / 3.0 * 1.0;
    let (low, high) = (sector.range.lo() * scale, sector.range.hi() * scale);
    assert!((low - 1.65 / (2.3 * 2.3)).abs() < 2e-3 && (high - 1.65).abs() < 2e-3);
    assert!((found.models[0].constant[1][0].midpoint() - 0.2).abs() < 1e-15);
}

#[test]
fn inputs_that_enter_affinely_become_vertices() {
    let plant = plant(
        "model P
          input Real u(min = 1, max = 2); input Real w(min = 0, max = 1);
          Real a(min = 0, max = 1); Real b(min = 0, max = 1);
          output Real y = a;
        equation
          der(a) = u*(b - a); der(b) = sin(w*b) - u*a*b;
        end P;",
    );
    let (found, _) = slopes(&plant);
    let [side] = &found.inputs[..] else {
        panic!("{:?}", found.inputs)
    };
    assert_eq!((side.name.as_str(), side.min, side.max), ("u", 1.0, 2.0));
    let corner: Vec<f64> = found
        .models
        .iter()
        .map(|m| m.constant[0][1].midpoint())
        .collect();
    assert_eq!(corner, [1.0, 2.0]);
}

/// Between its ends a step does what they do not show; what is only added does nothing.
#[test]
fn steps_and_added_inputs_are_no_vertices() {
    for (equation, inputs) in [
        ("u*a + (if u > 1 and u < 1.1 then 9 else 0)*a", 0),
        ("u*a + floor(u)*a", 0),
        ("u*a + sign(u - 1)", 0),
        ("-a^3 + 2*u + u*w", 0),
        ("u*a + 2*w", 1),
    ] {
        let plant = plant(&format!(
            "model P
              input Real u(min = 0, max = 3); input Real w(min = 0, max = 1);
              Real a(min = 0, max = 1);
              output Real y = a;
            equation
              der(a) = {equation};
            end P;"
        ));
        let (found, _) = slopes(&plant);
        assert_eq!(found.inputs.len(), inputs, "{equation}");
        assert_eq!(found.models.len(), 1 << inputs, "{equation}");
    }
}

#[test]
fn a_variable_without_bound_is_named() {
    let plant = plant(
        "model P
          Real a(min = 0, max = 1); Real b;
          output Real y = a;
        equation
          der(a) = b; der(b) = -a*b^2;
        end P;",
    );
    let (found, region) = slopes(&plant);
    let (_, names) = found.unbounded(&region).unwrap();
    assert_eq!(names, ["b"]);
}

#[test]
fn what_jumps_has_no_slope_and_what_bends_has() {
    let text = |f: &str| {
        format!(
            "model P
              Real a(min = -1, max = 1); output Real y = a;
            equation
              der(a) = {f};
            end P;"
        )
    };
    for f in [
        "if a > 0 then 1 else 0",
        "(a + 1)*sign(a)",
        "floor(a)",
        "atan2(a, -0.5)",
        "mod(a, 0.5)",
        "sqrt(a)",
        "1/a",
    ] {
        let plant = plant(&text(f));
        let (found, region) = slopes(&plant);
        assert!(
            found.unbounded(&region).is_some(),
            "{f}: {:?}",
            found.slopes
        );
    }
    for (f, low, high) in [
        ("abs(a)", -1.0, 1.0),
        ("max(a, 0)", 0.0, 1.0),
        ("a*sign(a)", -1.0, 1.0),
        ("-(2*sign(-a))*(3*a)", -6.0, 6.0),
        ("1/(1 + a*(0.5*sign(a)))", -0.5, 0.5),
        ("a*abs(a)", 0.0, 2.0),
        ("atan2(a, 2)", 0.4, 0.5),
        ("atan2(0.5, a)", -2.0, -0.4),
        ("if a > 0 then a else 0", 0.0, 1.0),
    ] {
        let plant = plant(&text(f));
        let (found, region) = slopes(&plant);
        assert!(found.unbounded(&region).is_none(), "{f}");
        let range = found.slopes[0].range;
        assert!(
            (range.lo() - low).abs() < 1e-3 && (range.hi() - high).abs() < 1e-3,
            "{f} {range:?}"
        );
    }
}

/// g(x̂)·ε costs the range of g; through the mean value theorem it would cost ε·∂g/∂x̂ too.
#[test]
fn a_gain_times_an_innovation_costs_the_range_of_the_gain() {
    let plant = plant(
        "model P
          Real a(min = 0, max = 4); Real b(min = 1, max = 2);
          output Real y = a;
        equation
          der(a) = b^3; der(b) = -b;
        end P;",
    );
    let graph = &plant.graph;
    let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
    let mut region = augmented.region();
    let [a, b] = augmented.symbols()[..] else {
        panic!("two states")
    };
    let error = graph.fresh("error of a");
    region.dimensions.push(crate::Dimension {
        name: "error of a".into(),
        symbol: error.node(),
        min: -4.0,
        max: 4.0,
        integer: false,
    });
    let correction = (error * 5.0) / graph.expr(b).powi(2);
    let corrected = vec![
        (graph.expr(augmented.derivatives[0]) - error * 7.0).node(),
        (graph.expr(augmented.derivatives[1]) - correction).node(),
    ];
    let innovations = [Innovation {
        symbol: error.node(),
        state: 0,
    }];
    let found = Slopes::new(graph, &corrected, &[a, b], &innovations, &region).unwrap();
    let model = &found.models[0];
    assert_eq!(model.constant[0][0], Interval::point(-7.0));
    let of = |column: usize| model.sectors.iter().filter(move |s| s.column == column);
    let gains: Vec<_> = of(0).collect();
    assert_eq!(gains.len(), 1, "{:?}", found.slopes);
    let ends = gains[0].direction[1] * gains[0].range;
    assert!(
        (ends.lo() + 5.0).abs() < 1e-2 && (ends.hi() + 1.25).abs() < 1e-2,
        "{ends:?}"
    );
    // only b³ is left for b
    assert_eq!(of(1).count(), 1, "{:?}", found.slopes);
    let slope = of(1).next().unwrap().range;
    assert!((slope.lo() - 3.0).abs() < 1e-2 && (slope.hi() - 12.0).abs() < 1e-1);
}

/// Two slopes of one state in one equation are one uncertain number.
#[test]
fn slopes_of_the_same_state_and_equation_are_added() {
    let plant = plant(
        "model P
          Real a(min = 0, max = 4); Real b(min = 1, max = 2);
          output Real y = a;
        equation
          der(a) = b; der(b) = -a^2;
        end P;",
    );
    let graph = &plant.graph;
    let augmented = AugmentedPlant::new(&plant, &Sensors::default()).unwrap();
    let mut region = augmented.region();
    let symbols = augmented.symbols();
    let error = graph.fresh("error of a");
    region.dimensions.push(crate::Dimension {
        name: "error of a".into(),
        symbol: error.node(),
        min: -4.0,
        max: 4.0,
        integer: false,
    });
    let correction = error * graph.expr(symbols[1]);
    let corrected = vec![
        augmented.derivatives[0],
        (graph.expr(augmented.derivatives[1]) - correction).node(),
    ];
    let innovations = [Innovation {
        symbol: error.node(),
        state: 0,
    }];
    let found = Slopes::new(graph, &corrected, &symbols, &innovations, &region).unwrap();
    // −2a in [−8, 0] and −b in [−2, −1]
    assert_eq!(found.slopes.len(), 1, "{:?}", found.slopes);
    let sector = &found.models[0].sectors[0];
    let range = sector.direction[1] * sector.range;
    assert!(
        (range.lo() + 10.0).abs() < 0.05 && (range.hi() + 1.0).abs() < 0.05,
        "{range:?}"
    );
}

const SYSTEM: &str = "model P
  input Real u(min = -1, max = 2); input Real w(min = 0, max = 1);
  Real a(min = -1, max = 1); Real b(min = 0, max = 2); Real c(min = -2, max = 1);
  output Real y = a;
equation
  der(a) = 2*b*(1 + 0.3*a) - u*a + sin(a)*w;
  der(b) = c - 0.7*(b*a) + u*w*b + exp(-b^2);
  der(c) = a*b*c/(3 + w) - c^3 + 0.5*sin(a)*w + u;
end P;";

proptest! {
    /// f(x̂) − f(x) = A(x̂ − x) for some A of the model: the difference lies in the
    /// interval hull of A's entries times the error.
    #[test]
    fn differences_lie_in_the_hull(
        p in proptest::array::uniform3(0.0_f64..1.0),
        q in proptest::array::uniform3(0.0_f64..1.0),
        s in proptest::array::uniform2(0.0_f64..1.0),
    ) {
        let plant = plant(SYSTEM);
        let (found, region) = slopes(&plant);
        let at = |i: usize, s: f64| {
            let d = &region.dimensions[i];
            d.min + s * (d.max - d.min)
        };
        let inputs = [at(3, s[0]), at(4, s[1])];
        let evaluate = |x: [f64; 3]| {
            let symbols = region.symbols();
            let tape = lynkeus_expr::Tape::new(&plant.graph, &symbols, &plant.derivatives).unwrap();
            let mut out = [0.0; 3];
            tape.evaluator().eval(&[x[0], x[1], x[2], inputs[0], inputs[1], 0.0], &mut out);
            out
        };
        let (x, z) = ([at(0, p[0]), at(1, p[1]), at(2, p[2])], [at(0, q[0]), at(1, q[1]), at(2, q[2])]);
        let (f, g) = (evaluate(x), evaluate(z));
        let hull = hull(&found, &region, &inputs);
        for i in 0..3 {
            let product = (0..3).fold(Interval::ZERO, |sum, j| {
                sum + hull[i][j] * (Interval::point(z[j]) - Interval::point(x[j]))
            });
            let difference = g[i] - f[i];
            prop_assert!(product.inflate(1e-9).contains(difference), "{i}: {difference} in {product:?}");
        }
    }
}

/// Interval hull of A over the slopes, at the inputs' place between the vertices.
fn hull(found: &Slopes, region: &Region, inputs: &[f64]) -> Vec<Vec<Interval>> {
    let n = found.models[0].size();
    let mut sum = vec![vec![Interval::ZERO; n]; n];
    for (vertex, model) in found.models.iter().enumerate() {
        let weight: f64 = found
            .inputs
            .iter()
            .enumerate()
            .map(|(bit, side)| {
                let place = region
                    .dimensions
                    .iter()
                    .position(|d| d.name == side.name)
                    .unwrap();
                let s = (inputs[place - 3] - side.min) / (side.max - side.min);
                if vertex >> bit & 1 == 1 { s } else { 1.0 - s }
            })
            .product();
        let mut A = model.constant.clone();
        for sector in &model.sectors {
            for (row, weight) in A.iter_mut().zip(&sector.direction) {
                row[sector.column] = row[sector.column] + *weight * sector.range;
            }
        }
        for i in 0..n {
            for j in 0..n {
                sum[i][j] = sum[i][j] + A[i][j] * Interval::point(weight);
            }
        }
    }
    sum
}
