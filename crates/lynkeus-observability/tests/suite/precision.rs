//! Standard errors against brute force: many noisy fits of simulated data.

mod column;
mod fits;
mod pendulum;
