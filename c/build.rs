//! The name by which programs find the shared library: with the version within which its interface stays.

use std::env;
use std::path::Path;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("linux") {
        return;
    }
    let version = |part: &str| env::var(format!("CARGO_PKG_VERSION_{part}")).unwrap_or_default();
    // Before 1.0 a minor version may change the interface.
    let major = version("MAJOR");
    let interface = if major == "0" { format!("0.{}", version("MINOR")) } else { major };
    let name = format!("libkalmems_c.so.{interface}");
    println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,{name}");
    // So that a program that is linked with the library where it was built finds it there.
    #[cfg(unix)]
    if let Some(folder) = env::var_os("OUT_DIR").as_deref().and_then(|out| Path::new(out).ancestors().nth(3))
    {
        let link = folder.join(name);
        let _ = std::fs::remove_file(&link);
        if let Err(why) = std::os::unix::fs::symlink("libkalmems_c.so", &link) {
            println!("cargo:warning={}: {why}", link.display());
        }
    }
}
