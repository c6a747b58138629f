//! Standard errors against brute force: many noisy fits of simulated data.
#![allow(clippy::unwrap_used)]

mod column;
mod fits;
mod pendulum;
