//! The file beside a report that has each sample of its series, read as the book describes it.

use crate::cli::long_recording;
use kalmems::estimate::Trajectory;
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::workflow::{Outcome, estimate};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::path::Path;
use std::process::Command;

/// A file of samples and its description.
struct SamplesFile {
    bytes: Vec<u8>,
    known: Value,
}

impl SamplesFile {
    fn open(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap();
        let end = bytes.len() - 16;
        assert!(bytes.starts_with(b"kalmems samples\n") && bytes.ends_with(b"samples\n"));
        let length = u64::from_le_bytes(bytes[end..end + 8].try_into().unwrap());
        let known = serde_json::from_slice(&bytes[end - usize::try_from(length).unwrap()..end]).unwrap();
        Self { bytes, known }
    }

    fn f64_at(&self, place: usize) -> f64 {
        f64::from_le_bytes(self.bytes[place..place + 8].try_into().unwrap())
    }

    /// Time and value of each sample of a track.
    fn values(&self, track: &str) -> Vec<[f64; 2]> {
        let track = &self.known["tracks"][track];
        let per = self.known["samples_of_a_block"].as_u64().unwrap();
        let columns = track["columns"].as_array().unwrap().len();
        let mut left = track["samples"].as_u64().unwrap();
        let mut all = Vec::new();
        for block in track["blocks"].as_array().unwrap() {
            let at = usize::try_from(block[0].as_u64().unwrap()).unwrap();
            let count = left.min(per);
            left -= count;
            let [first, step, offset, unit] = [0, 8, 16, 24].map(|place| self.f64_at(at + place));
            assert!(step > 0.0 && unit > 0.0);
            let values = at + 16 + 16 * columns;
            all.extend((0..usize::try_from(count).unwrap()).map(|k| {
                let place = values + 4 * k;
                let number = f32::from_le_bytes(self.bytes[place..place + 4].try_into().unwrap());
                [first + step * k as f64, offset + unit * f64::from(number)]
            }));
        }
        assert_eq!(left, 0);
        all
    }
}

/// The angles and the innovations of every filter in the file beside the report of this result are those of the trajectories, and the manifest owns the file.
pub fn agrees(result: &Path, outcome: &Outcome) {
    let file = SamplesFile::open(&result.join("report_samples.bin"));
    let manifest = std::fs::read_to_string(result.join("manifest.toml")).unwrap();
    let digest =
        Sha256::digest(&file.bytes).iter().fold(String::new(), |text, byte| format!("{text}{byte:02x}"));
    assert!(manifest.contains(&format!("\"report_samples.bin\" = \"{digest}\"")), "{manifest}");
    let page = std::fs::read_to_string(result.join("report.html")).unwrap();
    assert!(page.contains(&format!("\"bytes\":{}", file.bytes.len())));
    for trajectory in &outcome.recordings[0].segments[0].estimate.trajectories {
        let degrees: Vec<f64> = trajectory.states[0].mean.iter().map(|angle| angle.to_degrees()).collect();
        near(&file, trajectory, "angle", &degrees);
        near(&file, trajectory, "innovation", &trajectory.innovation);
    }
    for (name, track) in file.known["tracks"].as_object().unwrap() {
        let times = file.values(name);
        assert!(times.windows(2).all(|pair| pair[0][0] < pair[1][0]), "{name} goes back");
        // The errors begin after the settling time.
        let expected = if name.contains("error") { 8_000..8_001 } else { 0..1 };
        let samples = outcome.recordings[0].segments[0].estimate.segment.time.len() as u64
            - track["samples"].as_u64().unwrap();
        assert!(expected.contains(&samples), "{name}: {samples} too few");
    }
}

fn near(file: &SamplesFile, trajectory: &Trajectory, of: &str, expected: &[f64]) {
    let found = file.values(&format!("{}, {of}", trajectory.key));
    assert_eq!(found.len(), expected.len(), "{of}");
    let finite = expected.iter().filter(|value| value.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    let tolerance = 1e-6 * (high - low);
    for (([t, found], time_s), expected) in found.iter().zip(&trajectory.time_s).zip(expected) {
        assert!((t - time_s).abs() < 1e-9, "{t} {time_s}");
        assert!(
            (found - expected).abs() < tolerance || expected.is_nan() && found.is_nan(),
            "{t}: {found} {expected}"
        );
    }
}

#[test]
fn samples_lie_beside_a_report_that_shows_groups_of_them_and_beside_no_other() {
    let folder = tempfile::tempdir().unwrap();
    for (rows, options, expected) in
        [(20_000, &[][..], false), (50_000, &[], true), (50_000, &["--no-trajectories"], false)]
    {
        let path = long_recording(folder.path(), rows, true);
        let out = folder.path().join(format!("out{rows}{}", options.concat()));
        let output = Command::new(env!("CARGO_BIN_EXE_kalmems"))
            .args(["estimate", path.to_str().unwrap(), "--out", out.to_str().unwrap()])
            .args(options)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(out.join("report_samples.bin").exists(), expected, "{rows} {options:?}");
        if expected {
            agrees(&out, &estimate(published(), &published().load(&path).unwrap(), &Silent).unwrap());
        }
    }
}
