//! The papers' filters have no gate against outliers: what is reproduced are filters that take every sample.

use std::fs;
use std::path::{Path, PathBuf};

/// Methods that predict no sample or claim nothing, and have no gate that could be switched off.
const WITHOUT_CLAIM: [&str; 3] = ["\"model\"", "\"lock_in\"", "\"direct_inversion\""];

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { files(&path, found) } else { found.push(path) }
    }
}

/// Whether the table of a filter switches its gate off.
fn is_literal(table: &str) -> bool {
    let lines: Vec<&str> = table.lines().take_while(|line| !line.starts_with('[')).collect();
    let value = |key: &str| {
        lines.iter().find_map(|line| line.strip_prefix(key)?.trim_start().strip_prefix('=').map(str::trim))
    };
    value("gate") == Some("false")
        || value("method").is_some_and(|method| WITHOUT_CLAIM.iter().any(|own| method.starts_with(own)))
}

#[test]
fn no_filter_of_a_reproduction_has_a_gate() {
    let mut all = Vec::new();
    files(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut all);
    let mut filters = 0;
    for path in all {
        let text = fs::read_to_string(&path).unwrap();
        let tables: Vec<&str> = text.split("[[estimate.filter]]").skip(1).collect();
        // A program that writes filters of its own would have to be looked at as well.
        assert!(
            tables.is_empty() || path.extension().is_some_and(|ending| ending == "toml"),
            "{}",
            path.display()
        );
        for table in &tables {
            assert!(is_literal(table), "{}: {table}", path.display());
        }
        filters += tables.len();
    }
    // Twenty-two as this is written; a search that finds none would pass.
    assert!(filters >= 20, "{filters}");
    assert!(!is_literal("\nmethod = \"ekf\"\n[estimate.filter.start]\ngate = false"));
}
