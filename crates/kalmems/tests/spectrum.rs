//! Spectra of recorded interferograms against the instrument's own.

use kalmems::applications::spectrum::{Apodisation, transform, zero_path};
use std::path::{Path, PathBuf};

fn columns(path: &Path) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(path).unwrap();
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    (0..rows[0].len()).map(|j| rows.iter().map(|row| row[j]).collect()).collect()
}

/// Both records, forward and backward: the mean of both scans' magnitudes, after one common scale, against the
/// instrument's single-channel spectra, which are power spectra's roots too.
#[test]
#[ignore = "needs the reference data"]
fn recorded_interferograms_give_the_instruments_spectra() {
    let data = std::env::var("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names the folder");
    let folder = PathBuf::from(data).join("real/ftir_opus_doublesided");
    let text = std::fs::read_to_string(folder.join("expected.json")).unwrap();
    let expected: serde_json::Value = serde_json::from_str(&text).unwrap();
    let interferograms = columns(&folder.join("interferograms.csv"));
    let step_m = expected["parameters"]["opd_step_m"].as_f64().unwrap();
    // 4 per cm, and the weight's end at 0.9 over that.
    let largest_m = 0.9 / 400.0;
    for (first, file, key) in [
        (0, "single_channel.csv", "igsm->sm half-width 0.9/res"),
        (2, "reference_single_channel.csv", "igrf->rf half-width 0.9/res"),
    ] {
        let scans = &interferograms[first..first + 2];
        let spectra = [0, 1].map(|i| {
            let centre = zero_path(&scans[i]).unwrap();
            let stated = [7376, 7353][i];
            assert!(usize::abs_diff(centre, stated) <= 1, "{centre} {stated}");
            transform(&scans[i], centre, step_m, (Apodisation::BlackmanHarris3, largest_m), 16_384).unwrap()
        });
        let ours: Vec<f64> = (spectra[0].magnitudes().iter().zip(spectra[1].magnitudes()))
            .map(|(a, b)| (a + b) / 2.0)
            .collect();
        let instrument = columns(&folder.join(file));
        // Their wavenumbers are on our grid.
        let pairs: Vec<(f64, f64)> = (instrument[0].iter().zip(&instrument[1]))
            .map(|(nu, theirs)| {
                let place = nu / spectra[0].step_per_m;
                assert!((place - place.round()).abs() < 1e-4, "{nu}");
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the grid
                let index = place.round() as usize;
                (ours[index], *theirs)
            })
            .collect();
        let sum = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>();
        let scale = sum(&|(o, t)| o * t) / sum(&|(o, _)| o * o);
        let peak = pairs.iter().map(|(_, t)| *t).fold(0.0, f64::max);
        let rms = (sum(&|(o, t)| (scale * o - t).powi(2)) / pairs.len() as f64).sqrt() / peak;
        let independent = expected["independent_check_in_numpy"][key]["rms_over_peak"].as_f64().unwrap();
        println!("{file}: {rms:.3e} of the peak, independently {independent:.3e}");
        assert!(rms <= 1.2 * independent, "{rms} {independent}");
    }
}
