//! The engines serve any device, and so none of them has a device's name in its code.

use kalmems_rigs::published;
use std::fs;
use std::path::Path;

/// All of the code below a folder, without tests and comments, lower case, with a space for what joins words in names.
fn code_below(folder: &Path, found: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.file_stem().is_some_and(|name| name == "tests") {
            continue;
        }
        if path.is_dir() {
            code_below(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            let code = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
            let lines: Vec<&str> = code.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
            let words = lines.join("\n").to_lowercase().replace(['_', '-'], " ");
            found.push((path.display().to_string(), words));
        }
    }
}

#[test]
fn no_engine_names_a_device() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut sources = Vec::new();
    for name in ["kalmems-engines", "kalmems-figures", "kalmems-store", "kalmems-formats"] {
        code_below(&crates.join(name).join("src"), &mut sources);
    }
    assert!(sources.len() > 100, "{}", sources.len());
    let mut names: Vec<String> = published()
        .rigs()
        .map(|rig| rig.name().replace('_', " "))
        // Equations and two axes are words of all devices.
        .filter(|name| name != "equations" && name != "two axes")
        .collect();
    assert!(names.iter().any(|name| name == "shared scanner"), "{names:?}");
    names.extend(["shared electrode", "threshold sensing"].map(str::to_owned));
    for (path, words) in &sources {
        for name in &names {
            assert!(!words.contains(name), "{path} names the device `{name}`");
        }
    }
}
