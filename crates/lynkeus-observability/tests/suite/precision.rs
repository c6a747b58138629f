//! Standard errors against brute force: many noisy fits of simulated data.

mod ball;
mod column;
mod fits;
mod pendulum;
