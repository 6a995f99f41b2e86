//! Compiling and running what is emitted.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A folder of its own below the target directory.
pub fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("emit").join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

pub fn write(folder: &Path, files: &[(String, String)]) {
    for (name, text) in files {
        fs::write(folder.join(name), text).unwrap();
    }
}

/// Whether a program is there; says so where it is not.
pub fn has(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok();
    if !found {
        println!("SKIPPED: there is no `{program}` on this machine");
    }
    found
}

/// Runs a compiler in a folder, which must not say anything.
pub fn compile(folder: &Path, program: &str, arguments: &[&str]) {
    let output = Command::new(program).args(arguments).current_dir(folder).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.is_empty(), "{program} in {}: {said}", folder.display());
}

/// The lines of numbers that a program writes for this input.
pub fn run(folder: &Path, program: &str, arguments: &[&str], input: &str) -> Vec<Vec<f64>> {
    let given = folder.join("input");
    fs::write(&given, input).unwrap();
    let output = Command::new(folder.join(program))
        .args(arguments)
        .stdin(Stdio::from(fs::File::open(given).unwrap()))
        .output()
        .unwrap();
    assert!(output.status.success(), "{program}: {}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines().map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect()).collect()
}
