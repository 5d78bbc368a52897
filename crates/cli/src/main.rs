//! The `scrnn` program.
fn main() {}
