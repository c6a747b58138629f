//! The table of operations: how each is built, and a box on which it is smooth.

use lynkeus_expr::{Binary, Expr, Graph, Node, Tape, Unary};

use crate::sample::POWERS;

/// One operation as a function of some symbols.
pub struct Case {
    pub name: String,
    pub graph: Graph,
    pub symbols: Vec<Node>,
    pub result: Node,
    /// Bounds of each symbol between which the operation is defined and smooth.
    pub domain: Vec<(f64, f64)>,
}

impl Case {
    fn new(
        name: String,
        domain: &[(f64, f64)],
        build: impl for<'g> FnOnce(&'g Graph, &[Expr<'g>]) -> Node,
    ) -> Self {
        let graph = Graph::new();
        let symbols: Vec<Node> = (0..domain.len())
            .map(|i| graph.symbol(&format!("x{i}")).node())
            .collect();
        let expressions: Vec<Expr<'_>> = symbols.iter().map(|&s| graph.expr(s)).collect();
        let result = build(&graph, &expressions);
        let domain = domain.to_vec();
        Self {
            name,
            graph,
            symbols,
            result,
            domain,
        }
    }

    pub fn tape(&self) -> Tape {
        Tape::new(&self.graph, &self.symbols, &[self.result]).expect("all symbols are inputs")
    }
}

/// Every operation; those with kinks appear on either side of them.
pub fn cases() -> Vec<Case> {
    let unary = Unary::ALL.iter().flat_map(|&op| {
        unary_domains(op).iter().map(move |&domain| {
            Case::new(format!("{op:?}"), &[domain], |g, x| {
                g.unary(op, x[0].node())
            })
        })
    });
    let binary = Binary::ALL.iter().flat_map(|&op| {
        binary_domains(op).iter().map(move |domain| {
            Case::new(format!("{op:?}"), domain, |g, x| {
                g.binary(op, x[0].node(), x[1].node())
            })
        })
    });
    let powers = POWERS.iter().flat_map(|&n| {
        [(-2.0, -0.5), (0.5, 2.0)].map(|domain| {
            Case::new(format!("powi {n}"), &[domain], |g, x| {
                g.powi(x[0].node(), n)
            })
        })
    });
    unary
        .chain(binary)
        .chain(powers)
        .chain(compound())
        .collect()
}

/// Selections, linear systems, and operations with a constant or a repeated argument.
fn compound() -> Vec<Case> {
    let wide = (-2.0, 2.0);
    let mut cases = vec![
        Case::new("select, true".into(), &[(0.5, 1.0), wide, wide], choose),
        Case::new("select, false".into(), &[(-1.0, -0.5), wide, wide], choose),
        Case::new("pow of a constant".into(), &[wide], |g, x| {
            g.binary(Binary::Pow, g.constant(1.5).node(), x[0].node())
        }),
        Case::new("constant power".into(), &[(0.5, 2.0)], |g, x| {
            g.binary(Binary::Pow, x[0].node(), g.constant(-1.7).node())
        }),
        Case::new("x to the x".into(), &[(0.5, 2.0)], |_, x| {
            x[0].pow(x[0]).node()
        }),
        Case::new("log10".into(), &[(0.5, 20.0)], |_, x| x[0].log10().node()),
        Case::new("square by product".into(), &[wide], |_, x| {
            (x[0] * x[0]).node()
        }),
    ];
    let diagonal = (5.0, 7.0);
    let two = [diagonal, wide, wide, diagonal, wide, wide];
    cases.extend((0..2).map(|entry| {
        Case::new(format!("solve 2×2, entry {entry}"), &two, |g, x| {
            solve(g, x, 2, entry)
        })
    }));
    let off = (-1.5, 1.5);
    let three = [
        diagonal, off, off, off, diagonal, off, off, off, diagonal, wide, wide, wide,
    ];
    cases.extend((0..3).map(|entry| {
        Case::new(format!("solve 3×3, entry {entry}"), &three, |g, x| {
            solve(g, x, 3, entry)
        })
    }));
    cases
}

fn choose<'g>(graph: &'g Graph, x: &[Expr<'g>]) -> Node {
    let condition = graph.constant(0.0).less(x[0]);
    graph.select(condition.node(), (x[1] * x[0]).node(), (x[2] + x[0]).node())
}

fn solve(graph: &Graph, x: &[Expr<'_>], n: usize, entry: usize) -> Node {
    let nodes: Vec<Node> = x.iter().map(|x| x.node()).collect();
    let (a, b) = nodes.split_at(n * n);
    graph.solve(a, b).x[entry]
}

fn unary_domains(op: Unary) -> &'static [(f64, f64)] {
    match op {
        Unary::Abs | Unary::Sign | Unary::Not => &[(-3.0, -0.5), (0.5, 3.0)],
        Unary::Floor => &[(-1.9, -1.1), (2.1, 2.9)],
        Unary::Sqrt | Unary::Ln => &[(0.3, 5.0)],
        Unary::Tan => &[(-1.2, 1.2), (2.0, 4.2)],
        Unary::Asin | Unary::Acos => &[(-0.9, 0.9)],
        Unary::Sin | Unary::Cos => &[(-7.0, 7.0)],
        Unary::Neg | Unary::Exp | Unary::Atan | Unary::Sinh | Unary::Cosh | Unary::Tanh => {
            &[(-3.0, 3.0)]
        }
    }
}

fn binary_domains(op: Binary) -> &'static [[(f64, f64); 2]] {
    match op {
        Binary::Add | Binary::Sub | Binary::Mul => &[[(-2.0, 2.0), (-3.0, 3.0)]],
        Binary::Div => &[[(-2.0, 2.0), (0.5, 3.0)], [(-2.0, 2.0), (-3.0, -0.5)]],
        Binary::Pow => &[[(0.4, 3.0), (-2.0, 2.0)]],
        Binary::Atan2 => &[
            [(-2.0, 2.0), (0.5, 2.0)],
            [(0.5, 2.0), (-2.0, 2.0)],
            [(-2.0, -0.5), (-2.0, 2.0)],
        ],
        Binary::Min | Binary::Max | Binary::Less | Binary::LessEq => {
            &[[(-2.0, -0.5), (0.0, 1.0)], [(0.5, 2.0), (-1.0, 0.0)]]
        }
        Binary::Equal | Binary::And | Binary::Or => {
            &[[(-2.0, -0.5), (0.5, 1.0)], [(0.5, 2.0), (-1.0, -0.2)]]
        }
    }
}
