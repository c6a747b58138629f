//! What a filter's corrections are made of, row by row.

use lynkeus_run::Estimator;
use lynkeus_run::filter::Record;

use crate::Series;
use lynkeus_table::series::Store;

/// What a filter made of each row of a log ([`Record`]). Matrices are a column for each entry, row by row of the
/// matrix.
#[derive(Clone, Debug)]
pub struct Corrections {
    /// names of the measured outputs
    pub sensors: Vec<String>,
    /// names of the states, unknown inputs among them
    pub states: Vec<String>,
    /// ŷ by sensor
    pub predicted: Vec<Series>,
    /// ν = y − ŷ by sensor; NaN where it did not report
    pub innovation: Vec<Series>,
    /// its covariance S, sensors × sensors; NaN where one of the two did not report
    pub innovation_covariance: Vec<Series>,
    /// −½(log det 2πS + νᵀS⁻¹ν)
    pub log_likelihood: Series,
    /// K, states × sensors; NaN of a moving horizon
    pub gain: Vec<Series>,
    /// P⁺, states × states
    pub covariance: Vec<Series>,
}

impl Corrections {
    /// Without rows, of an estimator that keeps a record.
    pub(crate) fn of(estimator: &Estimator, store: &Store) -> Option<Self> {
        let record = estimator.record()?;
        let columns = |values: &[f64]| vec![Series::within(store); values.len()];
        Some(Self {
            sensors: estimator.signals()[..estimator.sensors()].to_vec(),
            states: estimator.names().to_vec(),
            predicted: columns(&record.predicted),
            innovation: columns(&record.innovation),
            innovation_covariance: columns(&record.innovation_covariance),
            log_likelihood: Series::within(store),
            gain: columns(&record.gain),
            covariance: columns(&record.covariance),
        })
    }

    /// Does something to each column.
    pub(crate) fn each(&mut self, change: impl Fn(&mut Series)) {
        let columns = [
            &mut self.predicted,
            &mut self.innovation,
            &mut self.innovation_covariance,
            &mut self.gain,
            &mut self.covariance,
        ];
        let columns = columns.into_iter().flatten();
        columns.chain([&mut self.log_likelihood]).for_each(change);
    }

    /// Takes the next row.
    pub(crate) fn add(&mut self, record: &Record) {
        let add = |columns: &mut [Series], row: &[f64]| {
            let cells = columns.iter_mut().zip(row);
            cells.for_each(|(column, x)| column.push(*x));
        };
        add(&mut self.predicted, &record.predicted);
        add(&mut self.innovation, &record.innovation);
        add(
            &mut self.innovation_covariance,
            &record.innovation_covariance,
        );
        add(&mut self.gain, &record.gain);
        add(&mut self.covariance, &record.covariance);
        self.log_likelihood.push(record.log_likelihood);
    }
}
