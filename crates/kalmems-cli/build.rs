//! Lets the linker of a release keep functions with the same instructions once, where it can: generic code of many types has many.

use std::env::{self, var};
use std::process::{Command, Stdio};

/// What tells LLD, which is the linker of Rust on Linux, to do so.
const FOLDING: &str = "-Wl,--icf=all";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if var("PROFILE").is_ok_and(|profile| profile == "release") && links_with(FOLDING).unwrap_or(false) {
        println!("cargo::rustc-link-arg-bins={FOLDING}");
    }
}

/// Whether a program of one line is linked with this argument, as the command will be.
fn links_with(argument: &str) -> Option<bool> {
    let mut rustc = Command::new(env::var_os("RUSTC")?);
    rustc.args(var("CARGO_ENCODED_RUSTFLAGS").ok()?.split('\x1f').filter(|flag| !flag.is_empty()));
    rustc.args(["--target", &var("TARGET").ok()?]);
    if let Ok(linker) = var("RUSTC_LINKER") {
        rustc.args(["-C", &format!("linker={linker}")]);
    }
    let source = std::path::Path::new(&env::var_os("OUT_DIR")?).join("probe.rs");
    std::fs::write(&source, "fn main() {}").ok()?;
    rustc.args(["-C", &format!("link-arg={argument}"), "-o"]).arg(source.with_extension("out")).arg(&source);
    Some(rustc.stdout(Stdio::null()).stderr(Stdio::null()).status().ok()?.success())
}
