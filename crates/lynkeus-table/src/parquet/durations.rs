//! Which columns are durations: Parquet has no such type, so that writers say it beside the columns.
//!
//! Arrow says it in its own schema, which polars and pandas write, too; pandas alone in its own metadata.

use std::collections::HashMap;

use ::parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type as Physical};
use ::parquet::file::metadata::FileMetaData;
use ::parquet::schema::types::ColumnDescriptor;

use super::arrow_schema;
use super::meaning::{Meaning, nanoseconds};

/// Nanoseconds of the units of NumPy, by name.
const UNITS: [(&str, i64); 4] = [
    ("s", 1_000_000_000),
    ("ms", 1_000_000),
    ("us", 1000),
    ("ns", 1),
];

/// The columns that are durations, by path, with the nanoseconds of their units.
#[derive(Debug, Default)]
pub(super) struct Durations {
    arrow: HashMap<String, i64>,
    pandas: HashMap<String, i64>,
}

impl Durations {
    pub fn of(file: &FileMetaData) -> Self {
        let said = |key: &str| {
            let mut pairs = file.key_value_metadata()?.iter();
            pairs.find(|pair| pair.key == key)?.value.as_deref()
        };
        Self {
            arrow: said("ARROW:schema")
                .and_then(arrow_schema::durations)
                .unwrap_or_default(),
            pandas: said("pandas").and_then(of_pandas).unwrap_or_default(),
        }
    }

    /// What a column's values mean, by what Parquet and its writer say of it.
    pub fn meaning(&self, described: &ColumnDescriptor) -> Meaning {
        let meaning = Meaning::of(described);
        let name = described.path().string();
        let unit = match (described.physical_type(), described.logical_type_ref()) {
            (Physical::INT64, None) if meaning == Meaning::Number => {
                self.arrow.get(&name).or(self.pandas.get(&name)).copied()
            }
            // fastparquet calls a duration a time of the day, in a unit that is not the one of pandas
            (Physical::INT64, Some(LogicalType::Time(time))) if self.pandas.contains_key(&name) => {
                Some(nanoseconds(&time.unit))
            }
            (Physical::INT64, None)
                if described.converted_type() == ConvertedType::TIME_MICROS
                    && self.pandas.contains_key(&name) =>
            {
                Some(nanoseconds(&TimeUnit::MICROS))
            }
            _ => None,
        };
        unit.map_or(meaning, |unit| Meaning::Duration { unit })
    }
}

/// The columns that pandas calls `timedelta64[…]`.
fn of_pandas(text: &str) -> Option<HashMap<String, i64>> {
    let said: serde_json::Value = serde_json::from_str(text).ok()?;
    let columns = said.get("columns")?.as_array()?.iter();
    let durations = columns.filter_map(|column| {
        let kind = column.get("numpy_type")?.as_str()?;
        let unit = kind.strip_prefix("timedelta64[")?.strip_suffix(']')?;
        let (_, unit) = UNITS.into_iter().find(|(name, _)| *name == unit)?;
        Some((column.get("field_name")?.as_str()?.to_owned(), unit))
    });
    Some(durations.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pandas_names_the_unit_of_each_duration() {
        let text = r#"{"columns": [
            {"field_name": "t", "numpy_type": "timedelta64[ms]"},
            {"field_name": "day", "numpy_type": "datetime64[ns]"},
            {"field_name": "odd", "numpy_type": "timedelta64[D]"},
            {"field_name": null, "numpy_type": "timedelta64[s]"}]}"#;
        let expected = HashMap::from([("t".to_owned(), 1_000_000)]);
        assert_eq!(of_pandas(text), Some(expected));
        assert_eq!((of_pandas("{}"), of_pandas("[")), (None, None));
    }
}
