//! How likely a reading is where a particle says what its sensor should show.

use crate::filter::censored::{End, Tail};
use crate::filter::model::Sensor;
use crate::noise::Level;

/// ½ log 2π
const HALF_LOG_TAU: f64 = 0.918_938_533_204_672_7;

/// A noise that is a share of the value has at least this share of what it is over all particles: a particle that shows
/// nothing at all is no proof against every reading.
const LEAST: f64 = 1e-9;

/// The logarithm of the density of a reading; of one at an end of its sensor's range, of how likely it is that the value
/// is there or beyond.
#[derive(Clone, Copy, Debug)]
pub(super) struct Likelihood {
    level: Level,
    reading: f64,
    end: Option<End>,
    /// the smallest deviation
    least: f64,
}

impl Likelihood {
    /// Of a reading of a sensor that shows values of such a size.
    pub fn of(sensor: &Sensor, reading: f64, end: Option<End>, size: f64) -> Self {
        Self {
            level: sensor.noise,
            reading,
            end,
            least: LEAST * sensor.noise.size() * size,
        }
    }

    /// Where a particle says that the value is `h`; −∞ where h is no number.
    pub fn log_density(&self, h: f64) -> f64 {
        if !h.is_finite() {
            return f64::NEG_INFINITY;
        }
        let off = self.reading - h;
        let deviation = match self.level {
            Level::Uniform(bound) => return self.uniform(off, bound),
            Level::Absolute(deviation) => deviation,
            Level::Relative(share) => (share * h.abs()).max(self.least),
        };
        let z = off / deviation;
        match self.end {
            None => -0.5 * z * z - deviation.ln() - HALF_LOG_TAU,
            Some(end) => Tail::beyond(end.sign() * z).log_weight(),
        }
    }

    fn uniform(&self, off: f64, bound: f64) -> f64 {
        match self.end {
            None if off.abs() <= bound => -(2.0 * bound).ln(),
            None => f64::NEG_INFINITY,
            Some(end) => {
                let share = 0.5 * (1.0 - end.sign() * off / bound);
                share.clamp(0.0, 1.0).ln()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use lynkeus_expr::Graph;

    use super::*;

    fn sensor(noise: Level) -> Sensor {
        Sensor {
            name: "y".to_owned(),
            output: Graph::new().symbol("y").node(),
            noise,
            limits: None,
        }
    }

    /// By hand, and by sums: a density over all readings, and what is beyond an end of it, make 1.
    #[test]
    fn densities_sum_to_one() {
        let levels = [
            Level::Absolute(0.3),
            Level::Relative(0.1),
            Level::Uniform(0.5),
        ];
        let h = 2.0;
        for level in levels {
            let own = sensor(level);
            let at = |y: f64, end| Likelihood::of(&own, y, end, 2.0).log_density(h).exp();
            let width = 1e-4;
            let inside = |from: f64, to: f64| {
                let count = ((to - from) / width).round() as usize;
                (0..count)
                    .map(|k| at(from + (k as f64 + 0.5) * width, None) * width)
                    .sum::<f64>()
            };
            assert!((inside(-2.0, 6.0) - 1.0).abs() < 1e-3, "{level:?}");
            let capped = inside(-2.0, 2.1) + at(2.1, Some(End::High));
            assert!((capped - 1.0).abs() < 1e-3, "{level:?} {capped}");
            let floored = inside(1.8, 6.0) + at(1.8, Some(End::Low));
            assert!((floored - 1.0).abs() < 1e-3, "{level:?} {floored}");
        }
        let exact = Likelihood::of(&sensor(Level::Absolute(2.0)), 1.0, None, 1.0).log_density(4.0);
        let expected = -0.5 * 2.25 - (2.0_f64).ln() - 0.5 * std::f64::consts::TAU.ln();
        assert!((exact - expected).abs() < 1e-14);
        let nothing = Likelihood::of(&sensor(Level::Relative(0.1)), 1.0, None, 1.0);
        assert!(nothing.log_density(0.0).is_finite());
        assert_eq!(nothing.log_density(f64::NAN), f64::NEG_INFINITY);
    }
}
