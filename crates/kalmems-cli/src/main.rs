//! The `kalmems` command.
fn main() {}
