//! The end of a column, which lies in memory.

use std::fmt;
use std::ops::Deref;
use std::sync::Arc;

/// Numbers in memory that do not change, whoever owns them.
pub type Lent = Arc<dyn AsRef<[f64]> + Send + Sync>;

/// Numbers in memory: its own, or lent ones, which are copied before they are changed.
#[derive(Clone, Default)]
pub(super) struct Tail {
    own: Vec<f64>,
    lent: Option<Lent>,
}

impl Tail {
    /// Of numbers that somebody else owns.
    pub fn lent(values: Lent) -> Self {
        Self {
            own: vec![],
            lent: Some(values),
        }
    }

    /// The numbers, to be changed.
    #[inline]
    pub fn own(&mut self) -> &mut Vec<f64> {
        if self.lent.is_some() {
            self.copy();
        }
        &mut self.own
    }

    #[cold]
    fn copy(&mut self) {
        self.own = self.to_vec();
        self.lent = None;
    }

    /// Keeps the first so many.
    pub fn truncate(&mut self, rows: usize) {
        if rows < self.len() {
            self.own().truncate(rows);
        }
    }
}

impl From<Vec<f64>> for Tail {
    fn from(own: Vec<f64>) -> Self {
        Self { own, lent: None }
    }
}

impl Deref for Tail {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        match &self.lent {
            Some(lent) => (**lent).as_ref(),
            None => &self.own,
        }
    }
}

impl fmt::Debug for Tail {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}
