//! The `kalmems` command with the published devices.

use std::process::ExitCode;

fn main() -> ExitCode {
    kalmems_cli::run(kalmems::rigs::published())
}
