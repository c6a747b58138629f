//! What is asked of a log.

use std::collections::HashSet;

use lynkeus_expr::Budget;

/// What of a log is read, and within which limits.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// what reading may take
    pub budget: Budget,
    /// headers of the columns that are asked for, as far as it can be left out what else there is; all without it
    pub columns: Option<HashSet<String>>,
}

impl Request {
    /// Whether somebody asks for a column.
    #[cfg(feature = "parquet")]
    pub(super) fn wants(&self, header: &str) -> bool {
        self.columns
            .as_ref()
            .is_none_or(|columns| columns.contains(header))
    }
}
