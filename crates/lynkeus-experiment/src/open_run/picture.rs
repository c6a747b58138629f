//! An open run drawn: what the plant alone does, with the readings over it.

use lynkeus_plot::{Curve, Figure, Kind, Panel};

use super::{OpenRun, Simulated};
use crate::Error;
use crate::figure::{PANELS, in_brackets, named, over_time, spread};

impl OpenRun {
    /// The variables of the study's `show`, else the outputs with readings, else all outputs and states.
    ///
    /// # Errors
    /// `show` names something that is no variable of the plant.
    pub fn figure(&self) -> Result<Figure, Error> {
        let chosen = match &self.show {
            Some(names) => named(&self.variables, names, |v| &v.name, "nothing")?,
            None => {
                let all = self.variables.iter();
                let read: Vec<_> = all.clone().filter(|v| v.misfit.is_some()).collect();
                match read.is_empty() {
                    true => spread(all.collect(), PANELS),
                    false => spread(read, PANELS),
                }
            }
        };
        let title = format!("{}: the plant alone", self.plant);
        let panels = chosen.into_iter().map(|v| self.panel(v)).collect();
        Ok(over_time(title, self.time_unit.as_deref(), panels))
    }

    fn panel(&self, variable: &Simulated) -> Panel {
        let unit = in_brackets(variable.unit.as_deref());
        let described = variable.description.iter();
        let described: String = described.map(|text| format!(": {text}")).collect();
        let misfit = variable.misfit.as_ref();
        let fit = misfit.and_then(|misfit| misfit.fit);
        let fit = fit.map_or(String::new(), |fit| {
            format!(", fit {} %", lynkeus_words::figures(fit, 3))
        });
        let curve = |kind, values| Curve::new(kind, self.time.clone(), values);
        let readings = misfit.map(|misfit| curve(Kind::Measured, misfit.readings.clone()));
        let own = curve(Kind::Estimated, variable.values.clone()).named("plant alone");
        Panel {
            name: variable.name.clone(),
            caption: format!("{}{described}{unit}{fit}", variable.name),
            curves: readings.into_iter().chain([own]).collect(),
            ..Panel::default()
        }
    }
}
