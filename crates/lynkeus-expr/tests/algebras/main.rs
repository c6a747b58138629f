//! Every operation in every algebra against an independent value: evaluation with hundreds of bits.

mod derivatives;
mod exact;
mod flows;
mod interval_operations;
mod interval_systems;
mod interval_tightness;
mod jets;
mod lanes;
mod library;
mod loops;
mod operations;
mod random_graphs;
mod recipe;
mod roots;
mod sample;
mod sides;
mod values;
