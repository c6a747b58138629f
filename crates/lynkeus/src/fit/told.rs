//! A fit in words.

use lynkeus_answer::Document;
use lynkeus_answer::document::{Cell, Line, Table};
use lynkeus_words::{Words, counted, short};
use serde_json::Value;

use super::Fit;
use super::errors::Portion;
use super::uncertainty::Known;
use super::unknown::{Kind, Scale, Unknown};
use crate::{Answer, Error, Series};
use lynkeus_experiment::rewrite::{Assignment, Change, rewritten};
use lynkeus_experiment::{Doubt, DoubtLevel};

lynkeus_experiment::displayed!(Fit);

impl Answer for Fit {
    fn document(&self) -> Document {
        let readings = counted(self.readings, "reading");
        let title = Line::from(format!(
            "{}: {} fitted to {readings} of {}",
            self.plant,
            counted(self.unknowns.len(), "value"),
            self.logs.join(", ")
        ));
        let mut document = Document::new(match self.contradiction() {
            Some(doubt) => {
                let title = title.and("; ").decided("not credible");
                title.and(format!(": {}", doubt.text))
            }
            None => title,
        });
        self.tell_undetermined(&mut document);
        document.part().table(self.table());
        self.tell_quality(&mut document);
        document.part().table(self.errors_table());
        self.tell_correlations(&mut document);
        self.tell_ahead(&mut document);
        document
    }

    fn entries(&self) -> Value {
        Self::entries(self)
    }

    fn columns(&self) -> Vec<(String, Series)> {
        let at = &self.rows.at;
        let numbers: Vec<f64> = at.iter().map(|(log, _)| *log as f64).collect();
        let times: Vec<f64> = at.iter().map(|(_, t)| *t).collect();
        let mut all = vec![("t".to_owned(), times.into())];
        if self.logs.len() > 1 {
            all.insert(0, ("log".to_owned(), numbers.into()));
        }
        for own in &self.rows.columns {
            let columns = [
                ("innovation", &own.innovation),
                ("innovation_sd", &own.deviation),
                ("free_run_error", &own.free_run),
            ];
            for (header, column) in columns {
                all.push((format!("{}_{header}", own.output), column.clone().into()));
            }
        }
        all
    }

    #[cfg(feature = "plot")]
    fn svg(&self) -> Result<Option<String>, Error> {
        self.figure().to_svg().map(Some)
    }

    fn refusal(&self) -> Option<Error> {
        let at = |error: Error| Some(error.at(&self.file));
        if !self.undetermined.is_empty() {
            let names = self.undetermined.join(", ");
            if self.has_events {
                let message = format!(
                    "at these values the logs do not determine {names}: events in which they have a say do not happen"
                );
                return at(Error::refused(message).hint(
                    "start nearer, by [parameters], or try more `starts` in [fit] within `bounds`",
                ));
            }
            let message = format!("the logs do not determine {names}");
            return at(Error::refused(message).hint(self.remedy()));
        }
        if let Some(spent) = self.ended {
            return at(Error::ended(spent));
        }
        if !self.is_converged {
            let message = "the search did not converge: the values are the best so far";
            return at(Error::refused(message)
                .hint("more `starts` in [fit], a better start or narrower `bounds` may help"));
        }
        if let Some(doubt) = self.contradiction() {
            let message = format!("the values are not credible: {}", doubt.text);
            return at(Error::refused(message).hint(
                "try more `starts` in [fit], or a start nearer to the plant by [parameters]; if that ends here, too, the model or what is declared of its noises is wrong: let them be found (`noise`, `process_noise` of [fit]), compare units and columns of the log with the model",
            ));
        }
        None
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }
}

impl Fit {
    /// What readings say against the values that were found, where they refuse them.
    fn contradiction(&self) -> Option<&Doubt> {
        let refusal = self.doubts.iter().find(|d| d.level == DoubtLevel::Refusal);
        refusal.filter(|_| self.undetermined.is_empty())
    }

    fn remedy(&self) -> String {
        let known = self.combinations();
        let combinations = match known.is_empty() {
            true => String::new(),
            false => format!("; {} can be known", known.join(", ")),
        };
        format!(
            "leave one of them out of [fit], or say what is known of it: priors = {{ name = {{ mean = …, sd = … }} }}; or take a log in which inputs excite it{combinations}"
        )
    }

    fn tell_undetermined(&self, document: &mut Document) {
        if self.undetermined.is_empty() && self.exact.hidden.is_empty() {
            return;
        }
        document.part();
        if !self.undetermined.is_empty() {
            document.line(format!(
                "the logs do not determine: {}",
                self.undetermined.join(", ")
            ));
        } else {
            document.line(format!(
                "the outputs alone do not determine {}: what is said of the start or by priors fixes it",
                self.exact.hidden.join(", ")
            ));
        }
        document.items(self.exact.symmetries.iter().map(Words::words));
    }

    fn table(&self) -> Table {
        let titles = ["", "value", "sd", "95 % from", "to", "start", ""];
        let rows = self.values().map(|(unknown, known)| {
            let number = |x: Option<f64>| Cell::number(x, brief);
            let digits = |x: f64| match known.sd {
                Some(sd) => to_digits_of(x, sd),
                None => brief(x),
            };
            let (low, high) = known.interval.unzip();
            let remark = if known.is_bound { "at its bound" } else { "" };
            vec![
                Cell::from(unknown.label()),
                Cell::number(Some(known.value), digits),
                number(known.sd),
                Cell::number(low, digits),
                Cell::number(high, digits),
                number(Some(unknown.start)),
                Cell::from(remark),
            ]
        });
        Table::new(titles).with(rows)
    }

    fn tell_quality(&self, document: &mut Document) {
        let count = self.unknowns.len() as f64;
        let bic = 2.0 * self.nll + count * (self.readings as f64).ln();
        let at_start = match self.nll_at_start.is_finite() {
            true => short(self.nll_at_start),
            false => "none".to_owned(),
        };
        document.part().line(format!(
            "\u{2212}log L {} (at the start {at_start}), AIC {}, BIC {}",
            short(self.nll),
            short(2.0 * self.nll + 2.0 * count),
            short(bic)
        ));
        let searches: usize = self.optima.iter().map(|o| o.found).sum();
        if let ([first, ..], true) = (&self.optima[..], searches > 1) {
            document.line(format!(
                "{} of {searches} searches that converged ended at the best one",
                first.found
            ));
        }
    }

    /// Errors of predictions, and what of the innovations is left to predict.
    fn errors_table(&self) -> Table {
        let titles = [
            "errors of",
            "rows",
            "readings",
            "one step",
            "free run",
            "\u{3bd}\u{b2}/\u{3c3}\u{b2}",
            "whiteness",
        ];
        let number = |x: Option<f64>| Cell::number(x, brief);
        let row = |name: &str, rows: &str, portion: &Portion, white: Option<f64>| {
            vec![
                Cell::from(name.to_owned()),
                Cell::from(rows.to_owned()),
                Cell::number(Some(portion.readings as f64), |x| format!("{x}")),
                number(portion.one_step),
                number(portion.free_run),
                number(portion.squares),
                number(white),
            ]
        };
        let rows = self.errors.iter().flat_map(|errors| {
            let white = errors.whiteness.map(|w| w.ljung_box);
            let fitted = row(&errors.output, "fitted", &errors.fitted, white);
            let held_out = errors.held_out.as_ref();
            let held_out = held_out.map(|p| row(&errors.output, "held out", p, None));
            std::iter::once(fitted).chain(held_out).collect::<Vec<_>>()
        });
        Table::new(titles).with(rows)
    }

    /// Pairs whose errors are nearly one.
    fn tell_correlations(&self, document: &mut Document) {
        const CLOSE: f64 = 0.95;
        let (free, matrix) = (&self.uncertainty.free, &self.uncertainty.correlation);
        for i in 0..free.len() {
            for j in 0..i {
                let r = matrix[(i, j)];
                if r.abs() > CLOSE {
                    let [a, b] = [i, j].map(|k| self.unknowns[free[k]].label());
                    document.line(format!(
                        "{b} and {a} are hardly told apart: their errors have the correlation {}",
                        brief(r)
                    ));
                }
            }
        }
    }
}

impl Fit {
    /// The next experiment, where it is asked for.
    fn tell_ahead(&self, document: &mut Document) {
        let Some(ahead) = &self.ahead else {
            return;
        };
        let percent = |x: f64| format!("{} %", brief(100.0 * x));
        let now = match &ahead.now {
            Some((name, share)) => {
                format!("with these logs {name} is known to ±{}", percent(*share))
            }
            None => "these logs do not determine all values".to_owned(),
        };
        document.part().line(format!("the next experiment: {now}"));
        let titles = [
            "with one more log",
            "readings",
            "worst",
            "sd/value",
            "× now",
            "volume ×",
            "trace ×",
            "makes known",
        ];
        let number = |x: Option<f64>| Cell::number(x, brief);
        let rows = ahead.tried.iter().map(|next| {
            vec![
                Cell::from(next.name.clone()),
                Cell::number(Some(next.readings as f64), |x| format!("{x}")),
                Cell::from(next.worst.clone().unwrap_or_default()),
                Cell::number(next.relative_sd, percent),
                number(next.factor),
                number(next.volume),
                number(next.trace),
                Cell::from(next.determines.join(", ")),
            ]
        });
        document.table(Table::new(titles).with(rows));
        let is_vain = ahead.tried.iter().all(|next| next.determines.is_empty());
        if !self.undetermined.is_empty() && is_vain {
            document.line("none of them makes known what the logs do not determine");
        }
    }

    /// The study's text with the values found, and what changed; the starts of several logs stay out of it.
    ///
    /// # Errors
    /// `text` is not the study that was fitted.
    pub fn rewritten(&self, text: &str) -> Result<(String, Vec<Change>), Error> {
        let several = self.logs.len() > 1;
        let own = self
            .values()
            .filter(|(unknown, _)| !(several && matches!(unknown.kind, Kind::Start { .. })));
        let written: Vec<_> = own
            .map(|(unknown, known)| (unknown, written(unknown, known)))
            .collect();
        let assignments = written.iter().map(|(unknown, written)| Assignment {
            key: unknown.key(),
            tables: match unknown.kind {
                Kind::Parameter => &["parameters"],
                Kind::Noise(_) => &["sensors", "noise"],
                Kind::Density(_) => &["process_noise"],
                Kind::Start { .. } => &["observer", "initial"],
            },
            place: Some((&unknown.name, &[])),
            written,
        });
        rewritten(text, assignments)
    }
}

/// A value as a study has it, to a ten-thousandth of its deviation.
fn written(unknown: &Unknown, known: &Known) -> impl Fn(Option<f64>) -> String + use<> {
    let (value, sd, scale) = (known.value, known.sd, unknown.scale);
    move |present| {
        let digits = sd.map_or(17.0, |sd| 5.0 + (value.abs() / sd).log10().ceil());
        let digits = if digits.is_finite() {
            digits.clamp(5.0, 17.0)
        } else {
            17.0
        };
        let text = |x: f64| {
            let rounded: f64 = format!("{x:.*e}", digits as usize - 1).parse().unwrap_or(x);
            lynkeus_table::significant(rounded)
        };
        match (scale, present) {
            (Scale::Share, Some(_)) => text(100.0 * value),
            (Scale::Share, None) => format!("\"{}%\"", text(100.0 * value)),
            (Scale::Bound, None) => format!("{{ uniform = {} }}", text(value)),
            _ => text(value),
        }
    }
}

/// A value to a tenth of its deviation.
fn to_digits_of(value: f64, sd: f64) -> String {
    let ratio = (value.abs() / sd).max(1.0);
    match ratio.is_finite() {
        true => lynkeus_words::figures(value, 2 + ratio.log10().ceil() as usize),
        false => brief(value),
    }
}

/// Three significant digits.
fn brief(x: f64) -> String {
    lynkeus_words::figures(x, 3)
}
