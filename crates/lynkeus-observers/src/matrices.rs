//! The matrices that a paper names, for the reader of a design: as expressions of the
//! plant, and their values at the start.

use lynkeus_expr::real::rounded;
use lynkeus_expr::{Graph, MissingInput, Node, Tape};
use lynkeus_structure::{Extended, Matrix};

use crate::TuningError;
use crate::estimate::{Copy, middle};

/// Characters of an entry that are shown.
const SHOWN: usize = 60;

/// The point at which a run starts: the estimate where it starts, known inputs at their
/// start values (else the middle of their ranges, else 0), time 0.
pub(crate) struct Start<'g> {
    graph: &'g Graph,
    symbols: Vec<Node>,
    values: Vec<f64>,
}

impl<'g> Start<'g> {
    pub fn new(copy: &Copy<'_, 'g>) -> Result<Self, TuningError> {
        let extended: &Extended<'g> = copy.extended;
        let (mut symbols, mut values) = (vec![extended.plant.time], vec![0.0]);
        for input in &extended.inputs {
            symbols.push(input.node);
            values.push(input.start.unwrap_or_else(|| middle(input)));
        }
        symbols.extend(extended.symbols());
        values.extend(copy.states()?.iter().map(|(_, start)| start));
        Ok(Self {
            graph: extended.graph(),
            symbols,
            values,
        })
    }

    /// The entries of a matrix of the plant's symbols, row by row.
    pub fn values(&self, A: &Matrix<'_>) -> Result<Vec<Vec<f64>>, MissingInput> {
        let dense = A.dense();
        let tape = Tape::new(self.graph, &self.symbols, &dense)?;
        let mut found = vec![0.0; dense.len()];
        tape.evaluator().eval(&self.values, &mut found);
        Ok(found
            .chunks(A.columns.max(1))
            .map(<[f64]>::to_vec)
            .collect())
    }

    /// The same in words: `[[1, 0], [0, 0.5]]`.
    pub fn shown(&self, A: &Matrix<'_>) -> Result<String, MissingInput> {
        Ok(numbers(&self.values(A)?))
    }
}

/// Whether every entry is a number.
pub(crate) fn is_constant(A: &Matrix<'_>) -> bool {
    A.graph().symbols_of(&A.nonzero()).is_empty()
}

/// `[[x1, 0], [0, 2]]`
pub(crate) fn expressions(A: &Matrix<'_>) -> String {
    let entry = |i, j| match A.get(i, j) {
        Some(node) => A.graph().render(node, SHOWN),
        None => "0".to_owned(),
    };
    let row = |i| (0..A.columns).map(|j| entry(i, j)).collect();
    rows((0..A.rows).map(row).collect())
}

/// Numbers row by row, with six digits; a dash where there is none.
pub(crate) fn numbers(A: &[Vec<f64>]) -> String {
    let number = |x: &f64| {
        if x.is_nan() {
            return "–".to_owned();
        }
        rounded(*x, 6).to_string()
    };
    rows(
        A.iter()
            .map(|row| row.iter().map(number).collect())
            .collect(),
    )
}

fn rows(A: Vec<Vec<String>>) -> String {
    let rows: Vec<String> = A
        .iter()
        .map(|row| format!("[{}]", row.join(", ")))
        .collect();
    format!("[{}]", rows.join(", "))
}
