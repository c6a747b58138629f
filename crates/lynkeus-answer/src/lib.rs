//! What every answer is made of.
//!
//! An [`Error`] says what was expected, what was found, where, and what to do. A [`Document`] is
//! what is told, for terminals, pages and notebooks. Names of others are made
//! [safe to show](visible), and a wrong one is answered with its [nearest](near).
//!
//! This crate knows what people are told, and nothing of plants, observers or files.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod document;
mod error;
pub mod near;
pub mod visible;

pub use document::Document;
pub use error::{Error, ErrorKind, code};
