//! The stated range of a channel, in every command that reads recordings: what is at its ends or beyond it is an empty cell.

use super::columns::{example, root, run, said};
use std::path::Path;
use tempfile::TempDir;

/// A text of cells in which those of a column are left empty whose size is a limit or more, and how many they are.
fn without(text: &str, column: usize, limit: f64) -> (String, usize) {
    let mut count = 0;
    let rows: Vec<String> = text
        .lines()
        .map(|row| {
            let mut cells: Vec<&str> = row.split(',').collect();
            if cells[column].parse::<f64>().is_ok_and(|value| value.abs() >= limit) {
                cells[column] = "";
                count += 1;
            }
            cells.join(",")
        })
        .collect();
    (rows.join("\n") + "\n", count)
}

/// Two folders with the same settings: in one a range is stated, in the other the cells beyond it are empty.
struct RangePair {
    folders: [TempDir; 2],
    count: usize,
}

impl RangePair {
    fn new(recording: (&str, &str), column: usize, limit: f64) -> Self {
        let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let (name, text) = recording;
        let (emptied, count) = without(text, column, limit);
        for (folder, text) in folders.iter().zip([text, &emptied]) {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        assert!((2..50).contains(&count), "{count} cells of {name}");
        Self { folders, count }
    }

    /// Writes settings into both: with the stated range, and without it.
    fn settings(&self, name: &str, text: &str, column: &str, stated: &str) {
        assert!(text.contains(column), "{column}: {text}");
        for (folder, text) in self.folders.iter().zip([text.replace(column, stated), text.to_owned()]) {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
    }

    /// Another file into both.
    fn copy(&self, from: &Path) {
        for folder in &self.folders {
            std::fs::copy(from, folder.path().join(from.file_name().unwrap())).unwrap();
        }
    }

    /// What a command prints and says in both folders, whose files are called `@NAME`.
    fn run(&self, arguments: &[&str]) -> [(String, String); 2] {
        self.folders.each_ref().map(|folder| {
            let path = |word: &&str| match word.strip_prefix('@') {
                Some(name) => folder.path().join(name).to_str().unwrap().to_owned(),
                None => (*word).to_owned(),
            };
            let arguments: Vec<String> = arguments.iter().map(path).collect();
            let output = run(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
            let said = said(&output).replace(folder.path().to_str().unwrap(), "FOLDER");
            (String::from_utf8(output.stdout).unwrap(), said)
        })
    }

    /// A result in both.
    fn results(&self, name: &str) -> [Vec<u8>; 2] {
        self.folders.each_ref().map(|folder| std::fs::read(folder.path().join(name)).unwrap())
    }

    /// Expects that the command said how many values are beyond the range, and of which column.
    fn expect_counted(&self, (printed, said): &(String, String), column: &str) {
        let counted = format!("(the first of {} cells)", self.count);
        let is_it = |line: &str| {
            line.contains(&format!("column `{column}`"))
                && line.contains("beyond the stated range")
                && line.contains(&counted)
        };
        assert!(printed.lines().chain(said.lines()).any(is_it), "{counted}: {printed}{said}");
    }
}

/// Estimate, diagnosis and stream of the shared scanner.
#[test]
fn a_stated_range_counts_in_estimate_diagnose_and_stream() {
    let (text, rows) = example();
    let pair = RangePair::new(("recording.csv", &rows), 2, 1.79995);
    let stated = "{ column = \"cap_V\", full_scale = \"1.79995 V\" }";
    pair.settings("experiment.toml", &text, "\"cap_V\" }", &format!("{stated} }}"));
    let [stated_output, _] = pair.run(&["estimate", "@experiment.toml", "--out", "@out"]);
    pair.expect_counted(&stated_output, "cap_V");
    let [stated_result, emptied] = pair.results("out/trajectory_ekf.csv");
    assert!(stated_result == emptied && !emptied.is_empty(), "estimate");
    let [(stated_result, _), (emptied, _)] = pair.run(&["diagnose", "@experiment.toml", "--json"]);
    assert!(stated_result == emptied && emptied.contains("innovation"), "diagnose: {emptied}");
    let live = std::fs::read_to_string(root().join("examples/shared_scanner/stream.toml")).unwrap();
    pair.settings(
        "stream.toml",
        &live.replace("\"8 ms\"", "\"0.4 ms\""),
        "\"cap_V\" }",
        &format!("{stated} }}"),
    );
    pair.run(&["stream", "@stream.toml", "--from", "@recording.csv", "--lines", "@lines.txt"]);
    let [stated_result, emptied] = pair.results("lines.txt");
    assert!(stated_result == emptied && emptied.len() > 1000, "stream");
}

#[test]
fn a_stated_range_counts_in_identify() {
    let folder = root().join("examples/shared_scanner");
    let rows = std::fs::read_to_string(folder.join("ring_down_recording.csv")).unwrap();
    let column = rows.lines().next().unwrap().split(',').position(|name| name == "vo1_V").unwrap();
    let pair = RangePair::new(("ring_down_recording.csv", &rows), column, 0.1085);
    // The ring-down alone.
    let text = std::fs::read_to_string(folder.join("ring_down.toml")).unwrap();
    let others = text.find("[[recording]]\nname = \"steady-state\"").unwrap()
        ..text.find("[identify.ring_down]").unwrap();
    let text = format!("{}{}", &text[..others.start], &text[others.end..]);
    pair.copy(&folder.join("ring_down_reference.csv"));
    let stated = "{ column = \"vo1_V\", full_scale = \"0.1085 V\" }";
    pair.settings("ring_down.toml", &text, "\"vo1_V\"", stated);
    let results = pair.run(&["identify", "@ring_down.toml", "--out", "@out", "--json"]);
    pair.expect_counted(&results[0], "vo1_V");
    let [stated_result, emptied] = results.map(|(json, said)| -> serde_json::Value {
        serde_json::from_str(&json).unwrap_or_else(|error| panic!("{error}: {said}"))
    });
    assert_eq!(stated_result["parameters"], emptied["parameters"]);
    assert!(emptied["parameters"].as_array().is_some_and(|found| !found.is_empty()));
}

#[test]
fn a_stated_range_counts_in_image() {
    let folder = root().join("examples/shared_scanner");
    let intensity = std::fs::read_to_string(folder.join("image_intensity.csv")).unwrap();
    let pair = RangePair::new(("image_intensity.csv", &intensity), 0, 0.97);
    pair.copy(&folder.join("image_trajectory.csv"));
    // A search would take its time.
    let text =
        std::fs::read_to_string(folder.join("image.toml")).unwrap().replace("search = ", "# search = ");
    let stated = "{ column = \"intensity_1\", full_scale = 0.97 }";
    pair.settings("image.toml", &text, "\"intensity_1\"", stated);
    let results = pair.run(&["image", "@image.toml", "--out", "@out"]);
    pair.expect_counted(&results[0], "intensity_1");
    let [stated_result, emptied] = pair.results("out/image.png");
    assert!(stated_result == emptied && !emptied.is_empty());
}

/// An interferogram and a record at rest are of no use without the values beyond the range, and are refused.
#[test]
fn a_stated_range_counts_in_spectrum_and_calibrate() {
    let value = |k: i32| {
        let x = f64::from(k) * 0.5e-6;
        (std::f64::consts::TAU * 2e5 * x).cos() * (-(x / 1e-4).powi(2)).exp()
    };
    let rows = (-512..512).fold("detector_1\n".to_owned(), |text, k| format!("{text}{}\n", value(k)));
    let pair = RangePair::new(("i.csv", &rows), 0, 0.95);
    let text = "name = \"s\"\n[interferogram]\nfile = \"i.csv\"\ncolumns = [\"detector_1\"]\n[path]\nstep = \"0.5 um\"\n\
                [transform]\napodisation = \"boxcar\"\nphase = \"power\"\n";
    pair.settings("s.toml", text, "\"detector_1\"", "{ column = \"detector_1\", full_scale = 0.95 }");
    let [(_, with), (_, emptied)] = pair.run(&["spectrum", "@s.toml", "--out", "@out"]);
    let first = (-512..512).position(|k| value(k).abs() >= 0.95).unwrap();
    assert!(with == emptied && with.contains(&format!("sample {first} is not a finite number")), "{with}");

    let rows = (0..4096_u32).fold("w_rad_per_s\n".to_owned(), |text, k| {
        let noise = f64::from(k.wrapping_mul(2_654_435_769) >> 8) / f64::from(1 << 24) - 0.5;
        format!("{text}{noise:.7}\n")
    });
    let pair = RangePair::new(("rest.csv", &rows), 0, 0.4985);
    let text = "name = \"r\"\n[sensor]\nrate = \"10 Hz\"\nchannels = { z = \"w_rad_per_s\" }\n[rest]\nfile = \"rest.csv\"\n";
    let stated = "{ column = \"w_rad_per_s\", full_scale = \"0.4985 rad/s\" }";
    pair.settings("rest.toml", text, "\"w_rad_per_s\"", stated);
    let [(_, with), _] = pair.run(&["calibrate", "gyro", "@rest.toml", "--out", "@out"]);
    let counted = format!("the signal `w_rad_per_s` is clipped in {} samples", pair.count);
    assert!(with.contains(&counted), "{counted}: {with}");
}
