//! The chosen values into the study file, of which everything else stays as it is.

use toml_edit::{DocumentMut, Item, TableLike, Value};

use super::axis::shown;
use super::{Axis, Sweep};
use crate::Error;

/// What was changed at a key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// The key as the sweep has it: `theta`, `theta[1]`.
    pub key: String,
    /// What stood there; none where the key is new.
    pub from: Option<String>,
    /// What stands there now.
    pub to: String,
}

impl std::fmt::Display for Change {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.from {
            Some(from) if *from == self.to => write!(f, "{} stays {}", self.key, self.to),
            Some(from) => write!(f, "{}: {from} becomes {}", self.key, self.to),
            None => write!(f, "{} = {} is new", self.key, self.to),
        }
    }
}

impl Sweep {
    /// The study's text with the values of the knee at the swept keys, and what changed. Only
    /// those numbers are touched: comments, order and layout stay.
    ///
    /// # Errors
    /// There is no knee, or `text` is not the study that was swept.
    pub fn rewritten(&self, text: &str) -> Result<(String, Vec<Change>), Error> {
        let knee = self.chosen().ok_or_else(|| self.refusal())?;
        let mut document: DocumentMut = text
            .parse()
            .map_err(|e| Error::input(format!("not a TOML file: {e}")))?;
        let observer = document
            .get_mut("observer")
            .and_then(Item::as_table_like_mut)
            .ok_or_else(|| Error::input("the study has no [observer] to write to"))?;
        let pairs = self.axes.iter().zip(&knee.values);
        let changes = pairs
            .map(|(axis, value)| put(observer, axis, *value))
            .collect::<Result<_, _>>()?;
        Ok((document.to_string(), changes))
    }
}

fn put(observer: &mut dyn TableLike, axis: &Axis, value: f64) -> Result<Change, Error> {
    let (base, path) = axis.path();
    let Some(item) = observer.get_mut(base) else {
        let number = number(value)?;
        let to = number.to_string();
        observer.insert(base, Item::Value(number));
        return Ok(Change {
            key: axis.key.clone(),
            from: None,
            to,
        });
    };
    let gone = || Error::input(format!("[observer] no longer has `{}`", axis.key));
    let mut slot = item.as_value_mut().ok_or_else(gone)?;
    for &index in path {
        let entries = slot.as_array_mut().ok_or_else(gone)?;
        slot = entries.get_mut(index).ok_or_else(gone)?;
    }
    let from = bare(slot);
    scale(slot, axis, value)?;
    Ok(Change {
        key: axis.key.clone(),
        from: Some(from),
        to: bare(slot),
    })
}

/// Replaces a number, or every number of a list, and keeps the spaces and comments around it.
fn scale(slot: &mut Value, axis: &Axis, value: f64) -> Result<(), Error> {
    if let Some(entries) = slot.as_array_mut() {
        return entries.iter_mut().try_for_each(|e| scale(e, axis, value));
    }
    let whole = slot.as_integer().map(|i| i as f64);
    let Some(present) = slot.as_float().or(whole) else {
        return Err(Error::input(format!(
            "`{}` is no longer a number",
            axis.key
        )));
    };
    let chosen = axis.chosen(present, value);
    if chosen == present {
        return Ok(()); // as it was written
    }
    let mut number = number(chosen)?;
    *number.decor_mut() = slot.decor().clone();
    *slot = number;
    Ok(())
}

fn number(x: f64) -> Result<Value, Error> {
    let text = shown(x);
    text.parse()
        .map_err(|e| Error::input(format!("cannot write {text} as TOML: {e}")))
}

/// A value without the spaces and comments around it.
fn bare(value: &Value) -> String {
    value.clone().decorated("", "").to_string()
}

#[cfg(test)]
mod tests {
    use super::super::{Row, axis, measures};
    use super::*;
    use crate::Study;

    fn sweep(text: &str, values: &[f64]) -> Sweep {
        let axes = axis::axes(&Study::parse(text, "s.toml").unwrap()).unwrap();
        let mut row = Row::empty(values, measures::SIMULATED.len());
        row.set(measures::TOTAL_ERROR, Some(1.0));
        Sweep {
            plant: "P".to_owned(),
            log: None,
            axes,
            measures: measures::SIMULATED,
            rows: vec![row],
            knee: Some(0),
            time_unit: None,
            notes: vec![],
        }
    }

    #[test]
    fn only_the_number_changes() {
        let text =
            "# head\nplant = 'p.mo'\n\n[observer]   # how\n  theta=4.0      # 1/min\nr = 1\n";
        let (new, changes) = sweep(text, &[3.5]).rewritten(text).unwrap();
        assert_eq!(new, text.replace("4.0", "3.5"));
        assert_eq!(changes[0].to_string(), "theta: 4.0 becomes 3.5");
        let (same, changes) = sweep(text, &[4.0]).rewritten(text).unwrap();
        assert_eq!(same, text);
        assert_eq!(changes[0].to_string(), "theta stays 4.0");
    }

    #[test]
    fn entries_lists_and_new_keys() {
        let text = "observer = { theta = [ 1.5,  # for mu\n  0.7 ] }\ntune.keys = { \"theta[2]\" = [1, 2], delta = [1, 2] }\n";
        let (new, changes) = sweep(text, &[2.0, 1.0]).rewritten(text).unwrap();
        assert!(
            new.starts_with("observer = { theta = [ 1.5,  # for mu\n  2 ]"),
            "{new}"
        );
        assert!(new.contains("delta = 1 }"), "{new}");
        assert_eq!(changes[1].to_string(), "delta = 1 is new");

        let text = "[observer]\npoles = [-2, -3.1] # 1/y\n";
        let (new, changes) = sweep(text, &[1.1]).rewritten(text).unwrap();
        assert_eq!(new, "[observer]\npoles = [-2.2, -3.41] # 1/y\n");
        assert_eq!(
            changes[0].to_string(),
            "poles: [-2, -3.1] becomes [-2.2, -3.41]"
        );
    }

    #[test]
    fn another_study_is_refused() {
        let sweep = sweep("observer = { theta = 1 }", &[2.0]);
        let refusal = |text: &str| sweep.rewritten(text).unwrap_err().to_string();
        assert!(refusal("plant = 'p'").contains("no [observer]"));
        assert!(refusal("observer.theta = 'x'").contains("no longer a number"));
        assert!(refusal("observer.theta = ").contains("not a TOML file"));
    }
}
