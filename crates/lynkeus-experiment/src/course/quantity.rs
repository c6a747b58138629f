//! What is known of one quantity over a run.

use lynkeus_model::Home;
use lynkeus_run::manifold::wrapped;

use crate::Series;

/// One quantity of the result with everything that is known of it.
#[derive(Clone, Debug, Default)]
pub struct Quantity {
    /// name in the plant
    pub name: String,
    /// unit, if declared
    pub unit: Option<String>,
    /// description, if declared
    pub description: Option<String>,
    /// what it truly is: simulated, or logged although it is not used
    pub truth: Option<Series>,
    /// what the sensor reads
    pub measured: Option<Series>,
    /// the measured output that shows it, where that has another name
    pub sensor: Option<String>,
    /// what the observer makes of it
    pub estimate: Option<Series>,
    /// what the estimate says of a measured output that is no state
    pub expected: Option<Series>,
    /// its standard deviation, where it is asked for
    pub deviation: Option<Series>,
    /// the estimate given later rows, too
    pub smoothed: Option<Series>,
    /// the standard deviation of that, where it is asked for
    pub smoothed_deviation: Option<Series>,
    /// header of the estimate's column: `<name>_hat` unless the model has that name
    pub estimate_header: String,
    /// header of the standard deviation's column
    pub deviation_header: String,
    /// header of the column of the estimate given later rows
    pub smoothed_header: String,
    /// header of the column of its standard deviation
    pub smoothed_deviation_header: String,
    /// an input that nobody measures
    pub unknown_input: bool,
    /// an input of the plant
    pub is_input: bool,
    /// where its values live
    pub home: Home,
    /// what is known of a rotation, with the scalar of its quaternion
    pub rotation: Option<Box<Rotation>>,
}

/// What is known of a rotation as a whole.
#[derive(Clone, Debug, Default)]
pub struct Rotation {
    /// name of the array
    pub name: String,
    /// the angle, in rad, between what it truly is and its estimate, where the truth is known
    pub error: Option<Series>,
    /// the standard deviation of that angle, where deviations are asked for
    pub deviation: Option<Series>,
    /// the same given later rows
    pub smoothed_deviation: Option<Series>,
    /// header of the deviation's column: `<name>_sd` unless the model has that name
    pub deviation_header: String,
    /// header of the column of the deviation given later rows
    pub smoothed_deviation_header: String,
}

impl Quantity {
    /// √(mean (estimate − truth)²) over the last half of the rows, where the truth is known; none
    /// where it is not.
    pub fn settled_error(&self) -> Option<f64> {
        let rows = self.errors()?.count();
        let late = self.errors()?.skip(rows / 2);
        mean_square(late.map(|error| error.powi(2)))
    }

    /// The same under the name of what it is the error of: of a quaternion that is its array, and its angle counts.
    pub(crate) fn told_error(&self) -> Option<(String, f64)> {
        let Some(rotation) = &self.rotation else {
            return Some((self.name.clone(), self.settled_error()?));
        };
        let angles = rotation.error.as_ref()?;
        let late = angles.iter_from(angles.len() / 2);
        let rms = mean_square(late.map(|angle| angle.powi(2)))?;
        Some((rotation.name.clone(), rms))
    }

    /// Estimate − truth row by row: of an angle up to full turns; none of a number of a quaternion, of which that
    /// of the whole counts.
    pub fn errors(&self) -> Option<impl Iterator<Item = f64> + '_> {
        let (truth, estimate) = (self.truth.as_ref()?, self.estimate.as_ref()?);
        let difference = match self.home {
            Home::Line | Home::Signed { .. } => |off: f64| off,
            Home::Circle { .. } => wrapped,
            Home::Rotation { .. } => return None,
        };
        let pairs = truth.iter().zip(estimate);
        Some(pairs.map(move |(x, hat)| difference(hat - x)))
    }

    /// The column of its standard deviation under its header; of a quaternion there is one.
    pub(crate) fn deviation_column(&self) -> Option<(&String, &Series)> {
        match (self.home, &self.rotation) {
            (Home::Rotation { .. }, None) => None,
            (_, Some(own)) => Some((&own.deviation_header, own.deviation.as_ref()?)),
            (_, None) => Some((&self.deviation_header, self.deviation.as_ref()?)),
        }
    }

    /// The same given later rows.
    pub(crate) fn smoothed_deviation_column(&self) -> Option<(&String, &Series)> {
        match (self.home, &self.rotation) {
            (Home::Rotation { .. }, None) => None,
            (_, Some(own)) => {
                let values = own.smoothed_deviation.as_ref()?;
                Some((&own.smoothed_deviation_header, values))
            }
            (_, None) => {
                let values = self.smoothed_deviation.as_ref()?;
                Some((&self.smoothed_deviation_header, values))
            }
        }
    }
}

/// The root of the mean of those that are finite.
pub(crate) fn mean_square(squares: impl Iterator<Item = f64>) -> Option<f64> {
    let known = squares.filter(|e| e.is_finite());
    let (sum, count) = known.fold((0.0, 0.0), |(sum, count), e| (sum + e, count + 1.0));
    (count > 0.0).then(|| (sum / count).sqrt())
}
