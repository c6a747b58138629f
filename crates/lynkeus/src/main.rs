//! The `lynkeus` command.
fn main() {}
