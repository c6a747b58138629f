//! What is asked of a log.

use std::collections::HashSet;

use lynkeus_expr::Budget;

use super::Pattern;

/// What of a log is read, and within which limits.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// what reading may take
    pub budget: Budget,
    /// headers of the columns that are asked for, as far as it can be left out what else there is; all without it
    pub columns: Option<HashSet<String>>,
    /// how a CSV file is written, as far as that is said
    pub format: Format,
    /// the headers of the columns whose times are written by a pattern
    pub times: Vec<String>,
}

/// How a CSV file is written; what is not said is found out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Format {
    /// between cells
    pub delimiter: Option<u8>,
    /// before the fraction of a number
    pub decimal: Option<Decimal>,
    /// lines before the header
    pub skip: u64,
    /// what times are written like
    pub times: Option<Pattern>,
}

/// The decimal mark; the other one groups thousands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decimal {
    /// `1,234.5`
    Point,
    /// `1.234,5`
    Comma,
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
