//! Straight-line code, and the implicit functions that it calls: these are made of code themselves.

use std::hash::{Hash, Hasher};
use std::sync::Arc;

use crate::{Binary, Fused, Interval, Node, Unary};

pub(crate) type Register = u32;

/// The four operations that most code is made of stand beside the others: one jump to them
/// instead of two.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Instruction {
    Add(Register, Register, Register),
    Sub(Register, Register, Register),
    Mul(Register, Register, Register),
    Div(Register, Register, Register),
    Unary(Unary, Register, Register),
    Powi(i32, Register, Register),
    Binary(Binary, Register, Register, Register),
    Select(Register, Register, Register, Register),
    Fused(Fused, Register, [Register; 3]),
    /// index among the tape's linear systems and implicit functions
    Solve(u32),
}

impl Instruction {
    pub(crate) fn binary(op: Binary, to: Register, x: Register, y: Register) -> Self {
        match op {
            Binary::Add => Self::Add(to, x, y),
            Binary::Sub => Self::Sub(to, x, y),
            Binary::Mul => Self::Mul(to, x, y),
            Binary::Div => Self::Div(to, x, y),
            _ => Self::Binary(op, to, x, y),
        }
    }
}

/// What a system computes from its arguments.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) enum System {
    /// A x = b of n unknowns, from A and b
    Linear(usize),
    /// z with g(z, p) = 0, from p
    Implicit(Implicit),
}

/// Registers of one system: its arguments, and where its used results go.
#[derive(Clone, Debug)]
pub(crate) struct SystemSlots {
    pub(crate) system: System,
    pub(crate) arguments: Vec<Register>,
    /// (which result, register)
    pub(crate) results: Vec<(usize, Register)>,
}

/// Straight-line code for some outputs as functions of some inputs. Only what
/// the outputs need is computed and registers are reused. A clone shares the code.
#[derive(Clone, Debug)]
pub struct Tape {
    pub(crate) code: Arc<Code>,
}

impl Tape {
    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.code.inputs
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.code.outputs.len()
    }

    /// Number of instructions.
    pub fn len(&self) -> usize {
        self.code.instructions.len()
    }

    /// True where nothing has to be computed.
    pub fn is_empty(&self) -> bool {
        self.code.instructions.is_empty()
    }

    /// Number of registers: inputs, constants and temporaries.
    pub fn registers(&self) -> usize {
        self.code.registers
    }
}

#[derive(Debug, Default)]
pub(crate) struct Code {
    pub(crate) inputs: usize,
    /// constants live in the registers after the inputs
    pub(crate) constants: Vec<f64>,
    pub(crate) registers: usize,
    /// places behind the registers: for the arguments of the largest system
    pub(crate) room: usize,
    pub(crate) instructions: Vec<Instruction>,
    /// the node each instruction computes
    pub(crate) sources: Vec<Node>,
    pub(crate) systems: Vec<SystemSlots>,
    pub(crate) outputs: Vec<Register>,
}

/// The function p ↦ z with g(z, p) = 0 and z in its declared range. A clone shares the code;
/// two functions are equal where one is a clone of the other.
///
/// ```
/// use lynkeus_expr::{Graph, Implicit, ImplicitUnknown, Interval, Tape};
///
/// let g = Graph::new();
/// let (a, x) = (g.symbol("a"), g.symbol("x"));
/// let unknown = ImplicitUnknown { symbol: a.node(), start: 0.0, range: Interval::ENTIRE };
/// // a + exp(a) = x
/// let root = Implicit::solve(&g, &[unknown], &[(a + a.exp() - x).node()])?[0];
/// let tape = Tape::new(&g, &[x.node()], &[root])?;
/// let mut out = [0.0];
/// tape.evaluator().eval(&[1.0 + 1f64.exp()], &mut out);
/// assert!((out[0] - 1.0).abs() < 1e-15);
/// # Ok::<(), lynkeus_expr::MissingInput>(())
/// ```
#[derive(Clone, Debug)]
pub struct Implicit(pub(crate) Arc<Body>);

#[derive(Debug)]
pub(crate) struct Body {
    /// what the unknowns are called
    pub(crate) names: Vec<String>,
    /// the equations, for people
    pub(crate) equations: Vec<String>,
    pub(crate) start: Vec<f64>,
    pub(crate) range: Vec<Interval>,
    /// number of entries of p
    pub(crate) parameters: usize,
    /// g, of (z, p)
    pub(crate) residual: Residual,
    pub(crate) by_parameters: Slopes,
    /// where there are any
    pub(crate) sides: Option<Sides>,
}

/// Some equations, as functions of the same inputs.
#[derive(Debug)]
pub(crate) struct Residual {
    pub(crate) values: Tape,
    pub(crate) by_unknowns: Slopes,
    /// what is not continuous as z moves: each is constant where the equations do not jump
    pub(crate) steps: Tape,
}

/// What in g jumps from one side to another as z moves, and g where all of it is held.
#[derive(Debug)]
pub(crate) struct Sides {
    /// the relations, signs and whole numbers m, of (z, p)
    pub(crate) values: Tape,
    /// which of them are true or false
    pub(crate) are_relations: Vec<bool>,
    /// g of (z, p, m)
    pub(crate) held: Residual,
}

/// The entries of a Jacobian that are not zero everywhere, as functions of (z, p).
#[derive(Debug)]
pub(crate) struct Slopes {
    pub(crate) tape: Tape,
    /// (row, column) of each
    pub(crate) places: Vec<(usize, usize)>,
}

impl PartialEq for Implicit {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Eq for Implicit {}

impl Hash for Implicit {
    fn hash<H: Hasher>(&self, state: &mut H) {
        Arc::as_ptr(&self.0).hash(state);
    }
}

impl Implicit {
    /// What the unknowns are called.
    pub fn names(&self) -> &[String] {
        &self.0.names
    }

    /// Number of unknowns.
    pub fn size(&self) -> usize {
        self.0.names.len()
    }

    /// Number of entries of p.
    pub fn parameters(&self) -> usize {
        self.0.parameters
    }

    /// Whether g may jump as its unknowns move.
    pub fn steps(&self) -> bool {
        self.0.residual.steps.outputs() > 0
    }

    pub(crate) fn start(&self) -> &[f64] {
        &self.0.start
    }

    pub(crate) fn range(&self) -> &[Interval] {
        &self.0.range
    }
}
