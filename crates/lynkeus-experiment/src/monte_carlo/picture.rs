//! The scatter drawn: the error of each quantity over time.

use super::{MonteCarlo, Scattered};
use crate::Error;
use crate::figure::{PANELS, in_brackets, named, over_time, spread};
use lynkeus_plot::{Band, Curve, Extent, Figure, Kind, Panel};

impl MonteCarlo {
    /// The errors of the quantities of `show`, else of unknown inputs and hidden states first, six at
    /// most: the band from the 5 % to the 95 % quantile, the mean, and the run with the greatest RMS error.
    ///
    /// # Errors
    /// `show` names something that is not estimated.
    pub fn figure(&self) -> Result<Figure, Error> {
        let chosen = match &self.show {
            Some(names) => named(&self.quantities, names, |q| &q.name, "nothing estimated")?,
            None => {
                let mut all: Vec<&Scattered> = self.quantities.iter().collect();
                all.sort_by_key(|q| (q.is_measured, !q.unknown_input));
                spread(all, PANELS)
            }
        };
        let runs = self.seeds.len();
        let title = format!("{}: {} observer, {runs} runs", self.plant, self.family);
        let panels = chosen.into_iter().map(|q| self.panel(q));
        Ok(over_time(
            title,
            self.time_unit.as_deref(),
            panels.collect(),
        ))
    }

    fn panel(&self, quantity: &Scattered) -> Panel {
        let unit = in_brackets(quantity.unit.as_deref());
        let curve = |kind, values: &[f64]| Curve::new(kind, self.time.clone(), values.to_vec());
        Panel {
            name: quantity.name.clone(),
            caption: format!("error of {}{unit}", quantity.name),
            curves: vec![
                curve(Kind::Worst, &quantity.worst_course),
                curve(Kind::Mean, &quantity.error.mean),
            ],
            bands: vec![Band {
                extent: Extent::Quantiles,
                time: self.time.clone().into(),
                low: quantity.error.low.clone().into(),
                high: quantity.error.high.clone().into(),
            }],
            ..Panel::default()
        }
    }
}
