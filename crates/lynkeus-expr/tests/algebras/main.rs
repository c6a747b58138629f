//! Every operation in every algebra against an independent value: evaluation with hundreds of bits.

mod derivatives;
mod exact;
mod interval_operations;
mod interval_systems;
mod interval_tightness;
mod jets;
mod operations;
mod sample;
mod values;
