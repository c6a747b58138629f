//! The scatter drawn: the error of each quantity over time.

use super::{MonteCarlo, Scattered};
use crate::Error;
use crate::figure::{PANELS, spread, time_label};
use crate::prepare::mentioned::not_drawn;
use lynkeus_plot::{Band, Curve, Extent, Figure, Kind, Panel};
use lynkeus_study::Name;

impl MonteCarlo {
    /// The errors of the quantities of `show`, else of unknown inputs and hidden states first, six at
    /// most: the band from the 5 % to the 95 % quantile, the mean, and the run with the greatest RMS error.
    ///
    /// # Errors
    /// `show` names something that is not estimated.
    pub fn figure(&self) -> Result<Figure, Error> {
        let chosen = match &self.show {
            Some(names) => self.shown(names)?,
            None => {
                let mut all: Vec<&Scattered> = self.quantities.iter().collect();
                all.sort_by_key(|q| (q.is_measured, !q.unknown_input));
                spread(all, PANELS)
            }
        };
        Ok(Figure {
            title: format!(
                "{}: {} observer, {} runs",
                self.plant,
                self.family,
                self.seeds.len()
            ),
            time_label: time_label(self.time_unit.as_deref()),
            panels: chosen.into_iter().map(|q| self.panel(q)).collect(),
        })
    }

    fn shown(&self, names: &[Name]) -> Result<Vec<&Scattered>, Error> {
        let find = |name: &Name| {
            let mut own = self.quantities.iter().filter(|q| q.name == name.text);
            own.next().ok_or_else(|| {
                let names = self.quantities.iter().map(|q| q.name.as_str());
                not_drawn(name, "nothing estimated", &names.collect::<Vec<_>>())
            })
        };
        names.iter().map(find).collect()
    }

    fn panel(&self, quantity: &Scattered) -> Panel {
        let unit = quantity.unit.as_ref().filter(|unit| *unit != "1");
        let unit = unit.map_or(String::new(), |unit| format!(" ({unit})"));
        let curve = |kind, values: &[f64]| Curve {
            kind,
            time: self.time.clone().into(),
            values: values.to_vec().into(),
        };
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
