//! What the project's chores share: child processes, and Python environments that hold what a list pins.

pub mod process;
pub mod python;
