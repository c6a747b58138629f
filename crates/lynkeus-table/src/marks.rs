//! What point and comma mean in a column.

use super::cell::Mark;

/// A cell that bears witness.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Witness {
    pub line: u64,
    pub text: String,
}

/// Why a column's numbers cannot be told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Refusal {
    pub line: u64,
    pub message: String,
    pub hint: &'static str,
}

/// The first cell of each kind of mark in a column.
#[derive(Clone, Debug, Default)]
pub(super) struct Marks {
    point: Option<Witness>,
    short_point: Option<Witness>,
    comma: Option<Witness>,
    short_comma: Option<Witness>,
    grouping_comma: Option<Witness>,
    grouping_point: Option<Witness>,
    /// a number of three digits or more without a mark: what comes after 999 may be `1,000`
    hundreds: bool,
}

/// What the cells of a whole file say for certain.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FileMarks {
    pub point: bool,
    pub comma: bool,
}

/// What `1,234` means in a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ShortComma {
    Decimal,
    Grouping,
}

impl ShortComma {
    /// The value of a cell that is `value` where the comma groups.
    pub(super) fn of(self, value: f64) -> f64 {
        match self {
            Self::Grouping => value,
            // of whole numbers, so the nearest to the decimal number
            Self::Decimal => value / 1000.0,
        }
    }
}

/// What to do about numbers that cannot be told.
const WRITE_PLAINLY: &str =
    "write the numbers without marks between thousands and with one decimal mark";

impl Marks {
    /// Takes note of a cell; only the first of a kind is kept.
    pub(super) fn see(&mut self, mark: Mark, line: u64, text: &str) {
        let slot = match mark {
            Mark::Point => &mut self.point,
            Mark::ShortPoint => &mut self.short_point,
            Mark::Comma => &mut self.comma,
            Mark::ShortComma => &mut self.short_comma,
            Mark::GroupingComma => &mut self.grouping_comma,
            Mark::GroupingPoint => &mut self.grouping_point,
        };
        if slot.is_none() {
            let text = text.to_owned();
            *slot = Some(Witness { line, text });
        }
    }

    /// Takes note of a number without a mark.
    pub(super) fn see_plain(&mut self, value: f64) {
        self.hundreds |= value.abs() >= 100.0;
    }

    /// Adds what this column says for certain.
    pub(super) fn tell(&self, file: &mut FileMarks) {
        file.point |= self.point.is_some() || self.grouping_comma.is_some();
        file.comma |= self.comma.is_some() || self.grouping_point.is_some();
    }

    /// What `1,234` means here as far as the column itself says.
    pub(super) fn own(&self) -> Option<ShortComma> {
        let grouping = self.point.is_some() || self.grouping_comma.is_some();
        match self.comma {
            Some(_) => Some(ShortComma::Decimal),
            None => grouping.then_some(ShortComma::Grouping),
        }
    }

    /// What `1,234` means here, or why that cannot be told.
    pub(super) fn decide(&self, file: FileMarks) -> Result<ShortComma, Refusal> {
        let comma_is_decimal = self.comma.as_ref().or(self.grouping_point.as_ref());
        let point_is_decimal = self.point.as_ref().or(self.grouping_comma.as_ref());
        if let (Some(a), Some(b)) = (comma_is_decimal, point_is_decimal) {
            return Err(mixed(a, b));
        }
        if let (Some(a), Some(b)) = (comma_is_decimal, self.short_point.as_ref()) {
            return Err(mixed(a, b));
        }
        if let (Some(a), Some(b)) = (&self.grouping_point, &self.short_comma) {
            return Err(mixed(a, b));
        }
        if let (Some(a), Some(b), None) = (&self.short_comma, &self.short_point, self.own()) {
            return Err(mixed(a, b));
        }
        if let Some(own) = self.own() {
            return Ok(own);
        }
        match (&self.short_comma, &self.short_point) {
            (Some(_), _) if file.point && !file.comma => Ok(ShortComma::Grouping),
            (Some(_), _) if file.comma && !file.point && !self.hundreds => Ok(ShortComma::Decimal),
            (Some(witness), _) => Err(ambiguous(witness)),
            (None, Some(witness)) if !file.point && (file.comma || self.hundreds) => {
                Err(ambiguous(witness))
            }
            (None, _) => Ok(ShortComma::Decimal),
        }
    }
}

fn mixed(a: &Witness, b: &Witness) -> Refusal {
    let (first, second) = if a.line <= b.line { (a, b) } else { (b, a) };
    Refusal {
        line: second.line,
        message: format!(
            "expected one decimal mark, found \"{}\" after \"{}\" in line {}",
            second.text, first.text, first.line
        ),
        hint: WRITE_PLAINLY,
    }
}

fn ambiguous(witness: &Witness) -> Refusal {
    Refusal {
        line: witness.line,
        message: format!(
            "\"{}\" may have a decimal mark or a mark between thousands, and nothing else in the file tells which",
            witness.text
        ),
        hint: WRITE_PLAINLY,
    }
}

#[cfg(test)]
mod tests {
    use super::super::Table;

    /// The column `y` of a log whose rows are `t;y`.
    fn y(text: &str) -> Result<Vec<f64>, String> {
        let table = Table::parse(&format!("t;y\n{text}\n"), "log.csv").unwrap();
        let values = table.readings("y").map(crate::Series::to_vec);
        values.map_err(|e| e.to_string())
    }

    #[test]
    fn thousands_beside_hundreds() {
        // the times say that the point is decimal
        assert_eq!(
            y("0;998\n0.05;999\n0.1;1,000").unwrap(),
            [998.0, 999.0, 1000.0]
        );
        assert_eq!(y("0;999.5\n1;1,000").unwrap(), [999.5, 1000.0]);
        assert_eq!(y("0;1,000\n1;1,000,000").unwrap(), [1e3, 1e6]);
        assert_eq!(y("0;1,000\n1;1,234.5").unwrap(), [1e3, 1234.5]);
        assert_eq!(y("0;1.000.000\n1;5").unwrap(), [1e6, 5.0]);
        for open in [
            "0;998\n1;999\n2;1,000",
            "0,0;998\n0,5;999\n1,0;1,000",
            "0;998\n1;999\n2;1.000",
            "0;1,250\n1;2,125",
            "0,5;1.250\n1,5;2.125",
        ] {
            let refusal = y(open).unwrap_err();
            assert!(
                refusal.contains("mark between thousands"),
                "{open}: {refusal}"
            );
        }
        assert!(
            y("0;998\n1;999\n2;1,000")
                .unwrap_err()
                .starts_with("log.csv:4: column \"y\"")
        );
    }

    #[test]
    fn three_decimals_after_a_decimal_comma() {
        assert_eq!(
            y("0;1,250\n1;0,999\n2;2,125").unwrap(),
            [1.25, 0.999, 2.125]
        );
        assert_eq!(y("0,5;1,250\n1,5;2").unwrap(), [1.25, 2.0]);
        // each is the number nearest to its decimals
        let texts: Vec<String> = (1..1000)
            .map(|i| format!("{i};{},{i:03}", i % 7 + 1))
            .collect();
        let read = y(&format!("0;0,5\n{}", texts.join("\n"))).unwrap();
        for (text, value) in texts.iter().zip(&read[1..]) {
            let number = text.split_once(';').unwrap().1.replace(',', ".");
            assert_eq!(number.parse(), Ok(*value));
        }
        assert_eq!(y("0;1.234,5\n1;0,5").unwrap(), [1234.5, 0.5]);
    }

    #[test]
    fn point_and_comma_in_one_column_are_refused() {
        for mixed in [
            "0;0.5\n1;0,5",
            "0;0,5\n1;0.5",
            "0;1.234\n1;0,5",
            "0;1,234.5\n1;0,5",
        ] {
            let refusal = y(mixed).unwrap_err();
            assert!(
                refusal.starts_with("log.csv:3: column \"y\": expected one"),
                "{refusal}"
            );
            assert!(refusal.contains("in line 2"), "{refusal}");
        }
        // marks of one column do not blame another
        assert_eq!(y("0,5;1.5").unwrap(), [1.5]);
    }
}
