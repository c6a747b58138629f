//! Estimators, plants and observers as files for other machines.

pub(crate) mod continuous;
pub(crate) mod device;
pub(crate) mod fmu;
pub(crate) mod head;
pub(crate) mod target;
pub(crate) mod tunable;
