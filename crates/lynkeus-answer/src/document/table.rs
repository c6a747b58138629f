//! Tables of answers.

/// Rows of cells under titles. A row with fewer cells than there are columns ends with one that takes the
/// room of those that are missing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    pub(super) titles: Vec<String>,
    pub(super) rows: Vec<Vec<Cell>>,
    /// a text does not show the titles: names and what belongs to them
    pub(super) is_plain: bool,
    /// rows of a text, and what it says of the others
    pub(super) most: Option<(usize, &'static str)>,
}

/// A cell of a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Nothing is known.
    Missing,
    /// Words.
    Text(String),
    /// A number as it is shown.
    Number(String),
    /// A word that decides something.
    Verdict(String),
    /// What a value is equal to.
    Formula(String),
}

impl Cell {
    /// A number as `shown`, if there is one.
    pub fn number(value: Option<f64>, shown: impl FnOnce(f64) -> String) -> Self {
        value.map_or(Self::Missing, |value| Self::Number(shown(value)))
    }

    /// How a text shows it.
    pub(super) fn words(&self) -> &str {
        match self {
            Self::Missing => "–",
            Self::Text(text) | Self::Number(text) | Self::Verdict(text) | Self::Formula(text) => {
                text
            }
        }
    }
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Self {
        Self::Text(text.into())
    }
}

impl Table {
    /// With titles, and no rows.
    pub fn new<T: Into<String>>(titles: impl IntoIterator<Item = T>) -> Self {
        Self {
            titles: titles.into_iter().map(Into::into).collect(),
            ..Self::default()
        }
    }

    /// Names and what belongs to them: a text shows no titles.
    pub fn plain<T: Into<String>>(titles: impl IntoIterator<Item = T>) -> Self {
        Self {
            is_plain: true,
            ..Self::new(titles)
        }
    }

    /// With rows.
    #[must_use]
    pub fn with(mut self, rows: impl IntoIterator<Item = Vec<Cell>>) -> Self {
        self.rows.extend(rows);
        self
    }

    /// A text shows so many rows, and then "and 3" and these words.
    #[must_use]
    pub fn at_most(mut self, rows: usize, others: &'static str) -> Self {
        self.most = Some((rows, others));
        self
    }

    /// Without the columns in which nothing stands.
    #[must_use]
    pub fn dense(mut self) -> Self {
        let is_blank = |cell: &Cell| matches!(cell, Cell::Missing) || cell.words().is_empty();
        for place in (0..self.titles.len()).rev() {
            if self
                .rows
                .iter()
                .filter_map(|row| row.get(place))
                .all(is_blank)
            {
                self.titles.remove(place);
                for row in self.rows.iter_mut().filter(|row| row.len() > place) {
                    row.remove(place);
                }
            }
        }
        self
    }

    pub(super) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Whether a column's cells end in line.
    pub(super) fn is_numeric(&self, place: usize) -> bool {
        let mut column = self.rows.iter().filter_map(|row| row.get(place));
        column.any(|cell| matches!(cell, Cell::Number(_)))
    }
}
