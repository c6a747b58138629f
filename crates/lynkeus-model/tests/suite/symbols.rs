//! Parameters as symbols.

use lynkeus_expr::Node;
use lynkeus_model::{LoadOptions, Plant};

/// Of parameters that are symbols some can be numbers, and it is told which are points of a table.
#[test]
fn some_parameters_are_numbers_beside_symbols() {
    let text = "model M
           parameter Real k = 2, p[2] = {1, 5}, last = 4;
           parameter Boolean large = k > 1;
           parameter Real twice = 2*last;
           Real x(start = 1);
           output Real y = Modelica.Math.Vectors.interpolate({0, p[1], p[2]}, {0, 1, k}, x);
           output Real z = if large then twice else p[2];
         equation
           der(x) = -k*x;
         end M;";
    let of = |numbers: &[&str]| {
        let options = LoadOptions {
            symbolic_parameters: true,
            numbers: numbers.iter().map(|name| (*name).to_owned()).collect(),
            ..LoadOptions::default()
        };
        Plant::from_modelica(text, "m.mo", &options).unwrap()
    };
    let read = |plant: &Plant, nodes: &[Node]| {
        let symbols = plant.graph.symbols_of(nodes).into_iter();
        let mut names: Vec<String> = symbols.filter_map(|s| plant.graph.symbol_name(s)).collect();
        names.sort();
        names
    };
    let all = of(&[]);
    let points: Vec<Node> = all.table_points.iter().copied().collect();
    assert_eq!(read(&all, &points), ["p[1]", "p[2]"]);
    assert_eq!(read(&all, &[all.outputs[1].node]), ["k", "last", "p[2]"]);
    let some = of(&["p[2]", "k"]);
    let points: Vec<Node> = some.table_points.iter().copied().collect();
    assert_eq!(read(&some, &points), ["p[1]"]);
    assert_eq!(read(&some, &some.derivatives), ["x"]);
    assert_eq!(read(&some, &[some.outputs[1].node]), ["last"]);
    let none = of(&["p[1]", "p[2]", "k", "last"]);
    assert!(none.table_points.is_empty());
    let jl = LoadOptions {
        symbolic_parameters: true,
        parameters: [("a", 2.0), ("b", 3.0)]
            .map(|(n, v)| (n.to_owned(), v))
            .into(),
        numbers: ["a".to_owned()].into(),
        ..LoadOptions::default()
    };
    let decay = "@ODEmodel(x'(t) = -a*b*x(t), y(t) = x(t))";
    let decay = Plant::from_ode_model(decay, "d.jl", &jl).unwrap();
    assert_eq!(read(&decay, &decay.derivatives), ["b", "x"]);
}
