//! The accuracies in the table of the README are those that the commands beside them print.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A row of the table: the device, as `kalmems reproduce` has it; the line of its output and the cell of that line, counted from the name; what
/// makes the unit of the README of the printed one.
const ROWS: [(&str, &str, usize, f64); 5] = [
    ("shared_scanner", "UKF, angle RMSE (deg)", 2, 1.0),
    ("threshold_scanner", "HYB, overall (rad)", 2, 1e3),
    ("micro_stage", "RMSE of the rate (rad/s)", 2, 1.0),
    ("accelerometer", "standard deviation, exact Q, R (pm)", 2, 1.0),
    ("piston_mirror", "five states", 1, 1.0),
];

/// The number at the beginning of a text.
fn number(text: &str) -> f64 {
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    text[..end].parse().unwrap_or_else(|e| panic!("{text}: {e}"))
}

#[test]
#[ignore = "slow: computes the tables of five papers"]
fn slow_the_accuracies_of_the_readme_are_those_that_reproduce_prints() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    let readme = std::fs::read_to_string(root.join("README.md")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let printed = |device: &str, at: &Path| {
        let output = Command::new(env!("CARGO_BIN_EXE_kalmems"))
            .current_dir(at)
            .args(["reproduce", device])
            .output()
            .unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    for (device, line, cell, factor) in ROWS {
        let row = readme
            .lines()
            .find(|row| row.starts_with('|') && row.contains(&format!("`kalmems reproduce {device}`")))
            .unwrap_or_else(|| panic!("the README has no row of {device}"));
        let shown = row.split('|').nth(4).unwrap().trim();
        let text = printed(device, folder.path());
        let found =
            text.lines().find(|text| text.starts_with(line)).unwrap_or_else(|| panic!("{line}: {text}"));
        let cells: Vec<&str> = found.split("  ").map(str::trim).filter(|cell| !cell.is_empty()).collect();
        let (value, readme) = (number(cells[cell]) * factor, number(shown));
        // Half of the last digit that the README shows.
        let digits = shown
            .split_once('.')
            .map_or(0, |(_, decimals)| decimals.chars().take_while(char::is_ascii_digit).count());
        let half = 0.5 * 10_f64.powi(-i32::try_from(digits).unwrap());
        println!("{device}: {value} printed, {shown} in the README");
        assert!((value - readme).abs() <= 1.000_001 * half, "{device}: {value} and {shown}");
    }
}
