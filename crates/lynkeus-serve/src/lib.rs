//! A study's estimator beside a plant: rows in, estimates out, for as long as the plant runs.
//!
//! A message ([`json`], [`influx`]) is a row of one asset. An [`Engine`] writes the rows of a batch to its
//! `state`, takes them to the estimators of their assets, and answers each with lines: the estimate at the row, and
//! corrections of what was told before where a row came late. What it answered is on the disk, so that it goes on
//! after `kill -9` as if nothing had been. [`stdio`] is the loop between standard input and output,
//! [`mqtt`] the one between topics of a broker, `opcua` (a feature) the one between nodes of a server.
//!
//! It knows studies as [`Stream`](lynkeus::stream::Stream) has them, and no family, plant or file of one.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod asset;
mod assets;
mod board;
mod bytes;
mod consistency;
mod engine;
mod handover;
mod history;
pub mod http;
pub mod influx;
pub mod json;
mod live;
pub mod mqtt;
#[cfg(feature = "opcua")]
pub mod opcua;
mod parquet;
mod row;
mod sandbox;
mod sensor;
mod state;
pub mod stdio;

pub use asset::Line;
pub use assets::{Named, assets};
pub use board::{Board, Heard, Shown};
pub use engine::{Answer, Arrival, Engine, Refusal};
pub use row::{Reader, Stamp};
pub use stdio::{Format, serve};
