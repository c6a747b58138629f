//! The branches of an `if`: of an expression, of equations and of statements.

use lynkeus_expr::Node;

use super::evaluate::Evaluator;
use crate::syntax::Result;
use crate::syntax::ast::ExprId;

/// A condition of an `if` around, and whether it holds in the branch that is taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct OnPath {
    pub condition: Node,
    pub holds: bool,
}

/// What a branch may hold, where that is not known before the variables are.
pub(super) struct Branches<T> {
    /// conditions that may hold, with their branches
    pub open: Vec<(Node, T)>,
    /// the branch where none of them does
    pub last: T,
}

impl Evaluator<'_> {
    /// A condition that is known takes its branch or leaves it unread, so that a loop may hold
    /// `if i == 1 then … else x[i - 1]`.
    pub(super) fn branches<T>(
        &mut self,
        branches: impl Iterator<Item = (ExprId, T)>,
        otherwise: T,
    ) -> Result<Branches<T>> {
        let mut open = vec![];
        for (condition, branch) in branches {
            let node = self.condition(condition)?;
            match self.graph.constant_value(node) {
                Some(0.0) => {}
                Some(_) => return Ok(Branches { open, last: branch }),
                None => open.push((node, branch)),
            }
        }
        Ok(Branches {
            open,
            last: otherwise,
        })
    }

    /// Notes that none of the conditions holds; gives how many there were around.
    pub(super) fn pass<T>(&mut self, branches: &Branches<T>) -> usize {
        let around = self.conditions.len();
        let passed = branches.open.iter().map(|&(condition, _)| OnPath {
            condition,
            holds: false,
        });
        self.conditions.extend(passed);
        around
    }

    /// The last condition that was passed holds.
    pub(super) fn enter(&mut self) {
        if let Some(on_path) = self.conditions.last_mut() {
            on_path.holds = true;
        }
    }
}
