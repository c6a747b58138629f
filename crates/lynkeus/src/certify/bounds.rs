//! What is left of an error in the end, for every quantity.

use lynkeus_experiment::entries::{Named, finite};
use lynkeus_experiment::words::number;
use lynkeus_observers::UltimateBound;

use super::CertifyReport;

/// `0.3 K of T`, for every bounded quantity.
pub(super) fn in_words(report: &CertifyReport, each: &[UltimateBound]) -> Vec<String> {
    let estimates = &report.design.observer.estimates;
    let unit = |name: &str| {
        let mut found = estimates.iter().filter(|e| e.variable.name == name);
        let unit = found.next().and_then(|e| e.variable.unit.as_deref());
        unit.filter(|unit| !unit.is_empty())
            .map_or(String::new(), |unit| format!(" {unit}"))
    };
    each.iter()
        .map(|b| format!("{}{} of {}", number(b.value), unit(&b.name), b.name))
        .collect()
}

/// The same for machines.
pub(super) fn by_name(each: &[UltimateBound]) -> Named<Option<f64>> {
    let each = each.iter();
    each.map(|b| (b.name.clone(), finite(b.value))).collect()
}
