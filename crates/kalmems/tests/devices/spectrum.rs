//! Spectra of recorded interferograms against the instrument's own, and of simulated ones against what they must be.

use crate::scene::{Scene, write_columns};
use kalmems::applications::ApplicationFile;
use kalmems::applications::spectrum::SpectrumFile;
use kalmems::applications::spectrum::SpectrumMetrics;
use kalmems::applications::spectrum::{
    Apodisation, SpectrumError, SpectrumOutcome, line_height, measure, transform, zero_path,
};
use kalmems::progress::Silent;
use kalmems::rigs::published;
use std::f64::consts::{PI, TAU};
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

/// One-sided and dispersive, in a file with a known step, one scan each way: the spectrum of the symmetric light.
#[test]
fn a_one_sided_dispersive_recording_is_corrected() {
    let folder = tempfile::tempdir().unwrap();
    let (step, long, short) = (3e-6, 4000_i32, 500_i32);
    let band = |nu: f64| {
        (-((nu - 80e3) / 18e3).powi(2)).exp() * (1.0 - 0.4 * (-((nu - 90e3) / 0.4e3).powi(2)).exp())
    };
    let phase = |nu: f64| 0.4 + 1.1 * ((nu - 80e3) / 5e4) - 0.6 * ((nu - 80e3) / 5e4).powi(2);
    let grid: Vec<f64> = (0..3000).map(|i| 30e3 + 1e5 * f64::from(i) / 3000.0).collect();
    let light = |k: i32, dispersive: bool| {
        let x = step * f64::from(k);
        let angle = |nu: f64| TAU * nu * x + if dispersive { phase(nu) } else { 0.0 };
        grid.iter().map(|nu| band(*nu) * angle(*nu).cos()).sum::<f64>() + 7.0
    };
    let forward: Vec<f64> = (-short..=long).map(|k| light(k, true)).collect();
    let backward = forward.iter().rev().copied().collect();
    write_columns(&folder.path().join("one.csv"), &[("forward_1", &forward), ("backward_1", &backward)]);
    let whole: Vec<f64> = (-long..=long).map(|k| light(k.abs(), false)).collect();
    let whole = transform(
        &whole,
        usize::try_from(long).unwrap(),
        step,
        (Apodisation::NortonBeerMedium, step * f64::from(long)),
        1 << 16,
    )
    .unwrap();
    let text = r#"
name = "one-sided"
interferogram = { file = "one.csv", columns = ["forward_1", "backward_1"] }
path = { step = "3 um" }
[transform]
apodisation = "norton_beer_medium"
phase = "mertz"
band = { from = "450 1/cm", to = "1150 1/cm" }
[[line]]
wavenumber = "900 1/cm"
within = "2 1/cm"
absorption = true
"#;
    let file = SpectrumFile::parse(text, &folder.path().join("one.toml")).unwrap();
    let outcome = measure(published(), &file, &Silent).unwrap();
    let scans = &outcome.processed.scans;
    assert_eq!(scans.spectra.len(), 2);
    let peak = whole.values.iter().map(|v| v.re).fold(0.0, f64::max);
    for spectrum in &scans.spectra {
        for (index, found) in spectrum.iter().enumerate() {
            let place = scans.grid.wavenumber(index) / whole.step_per_m;
            assert!((place - place.round()).abs() < 1e-6);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the grid
            let ideal = whole.values[place.round() as usize].re;
            assert!((found - ideal).abs() < 1e-3 * peak, "{place}: {found} {ideal}");
        }
    }
    // On the slope of the band a dip's lowest point lies a little aside.
    let dip = outcome.lines[0].unwrap().line.wavenumber_per_m;
    assert!((dip / 100.0 - 900.0).abs() < 0.2, "{dip}");
}

/// 40 scans along the true positions: the noise of the mean falls with 1/√N, and is that of the detector's samples.
/// Then with a zero path that is another in each scan: lines lose the height that such errors cost, and
/// laid over each other the scans give it back.
#[test]
fn co_added_scans_gain_the_root_of_their_number_unless_they_are_shifted() {
    let scene = Scene { noise: 0.2, scans: 40, ..Scene::default() };
    let still = scene.measure(&|_| 0.0, "");
    // Of a sum Σ y·w·a with white noise σ, real part: σ·√(½·Σ(w·a)²).
    let squares: f64 = still.processed.samples.iter().map(|s| s.weight * s.weight).sum();
    let of_one = 0.2 * (0.5 * squares / 40.0).sqrt();
    assert_eq!(still.noise.iter().map(|entry| entry.scans).collect::<Vec<_>>(), [4, 8, 16, 32, 40]);
    for entry in &still.noise {
        let expected = of_one / (entry.scans as f64).sqrt();
        println!("{} scans: noise {:.3e}, expected {expected:.3e}", entry.scans, entry.noise);
        // A hundred independent values in the band: 7 %.
        assert!((entry.noise / expected - 1.0).abs() < 0.2, "{entry:?} {expected}");
    }
    assert!(still.residual_delay_s.unwrap().0.abs() < 4.0 * still.residual_delay_s.unwrap().1);

    // A half period each; the same for all of it, and independent of the next.
    let mut noise = kalmems::simulate::WhiteNoise::new(7, 0);
    let offsets: Vec<f64> = (0..200).map(|_| 200e-9 * noise.sample()).collect();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the list
    let offset = |t: f64| offsets[(t * 1e3 + 0.7 / PI) as usize];
    let height = |outcome: &SpectrumOutcome| outcome.lines[0].unwrap().line.height;
    let shifted = scene.measure(&offset, "");
    let laid = scene.measure(&offset, "registration = \"each\"\n");
    let ideal = height(&still);
    // Positions are off by the offsets about the one of their zero path.
    let shift = &shifted.processed.misregistration_m;
    let sd = (shift.iter().map(|x| x * x).sum::<f64>() / shift.len() as f64).sqrt();
    println!(
        "heights: {:.4} with misregistration of {:.0} nm, {:.4} laid over each other",
        height(&shifted) / ideal,
        sd * 1e9,
        height(&laid) / ideal
    );
    let phases = shift.iter().map(|x| (TAU * 200e3 * x).cos()).sum::<f64>() / shift.len() as f64;
    assert!((height(&shifted) / ideal - phases).abs() < 0.02, "{phases}");
    assert!((phases - line_height(200e3, sd / 2.0)).abs() < 0.08);
    assert!((height(&laid) / ideal - 1.0).abs() < 0.01);
}

/// The same scans by a sum over the samples and by interpolation to equal steps.
#[test]
fn resampling_gives_what_the_weighted_sum_gives() {
    let scene = Scene { scans: 4, ..Scene::default() };
    let weighted = scene.measure(&|_| 0.0, "");
    let resampled = scene.measure(&|_| 0.0, "method = \"resampled\"\n");
    for (a, b) in weighted.lines.iter().zip(&resampled.lines) {
        let (a, b) = (a.unwrap().line, b.unwrap().line);
        assert!((a.wavenumber_per_m - b.wavenumber_per_m).abs() < 0.5, "{a:?} {b:?}");
        assert!((a.height / b.height - 1.0).abs() < 1e-3, "{a:?} {b:?}");
    }
    // By magnitude too: it needs no zero path.
    let power = scene.measure(&|_| 0.0, "method = \"resampled\"\n#power\n");
    let height = |outcome: &SpectrumOutcome| outcome.lines[0].unwrap().line.height;
    assert!((height(&power) / height(&weighted) - 1.0).abs() < 2e-3);
}

/// A detector 20 ns late: forward and backward scans tell by how much, and the budget says what it costs in height. Told of it,
/// nothing is left.
#[test]
fn a_late_detector_is_found_and_its_cost_predicted() {
    let scene = Scene { scans: 20, late_s: 20e-9, ..Scene::default() };
    let late = scene.measure(&|_| 0.0, "#delay_sd = 20 ns\n");
    let (delay, sd) = late.residual_delay_s.unwrap();
    println!("found {:.2} ± {:.2} ns", delay * 1e9, sd * 1e9);
    assert!((delay / 20e-9 - 1.0).abs() < 0.02, "{delay}");
    let ideal = Scene { late_s: 0.0, ..scene }.measure(&|_| 0.0, "");
    let left = late.lines[0].unwrap().line.height / ideal.lines[0].unwrap().line.height;
    let metrics = SpectrumMetrics::of(&late);
    let predicted = metrics.lines[0].budget.iter().find(|entry| entry.of == "delay of the detector").unwrap();
    println!("left {left:.4} of the height, predicted {:.4}", predicted.height);
    assert!(left < 0.999 && (left - predicted.height).abs() < 0.1 * (1.0 - left), "{left} {predicted:?}");
    let told = scene.measure(&|_| 0.0, "#told\n");
    assert!(told.residual_delay_s.unwrap().0.abs() < 0.1e-9, "{:?}", told.residual_delay_s);
    // A correction of the phase removes the delay as well, and the summary says that it is not determined.
    let corrected =
        |text: String| text.replacen("phase = \"none\"", "phase = \"mertz\"\nmethod = \"resampled\"", 1);
    let corrected = scene.try_measure(&|_| 0.0, &corrected).unwrap();
    let says = |outcome: &SpectrumOutcome| {
        SpectrumMetrics::of(outcome).to_text().contains("delay of the detector is not determined")
    };
    assert!(says(&corrected) && !says(&late));
}

/// A reference that is the same spectrum but for one wavenumber in the dark, by 0.3 of the peak: the mean square hides it among all, and the
/// place is said.
#[test]
fn the_residual_is_said_where_it_is_worst() {
    let scene = Scene { scans: 4, ..Scene::default() };
    let own = scene.measure(&|_| 0.0, "");
    let wavenumbers = own.processed.scans.grid.wavenumbers();
    let place = wavenumbers.partition_point(|nu| *nu < 180e3);
    let peak = own.spectrum.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
    let mut theirs = own.spectrum.clone();
    theirs[place] -= 0.3 * peak;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("reference.csv");
    write_columns(&file, &[("wavenumber_per_m", &wavenumbers), ("value", &theirs)]);
    let reference = format!(
        "[reference.spectrum]\nfile = {:?}\nwavenumber = \"wavenumber_per_m\"\ncolumn = \"value\"\n",
        file.display()
    );
    let compared = scene.try_measure(&|_| 0.0, &|text| text.replace("#errors", &reference)).unwrap();
    let metrics = SpectrumMetrics::of(&compared);
    let found = metrics.reference.as_ref().unwrap();
    assert!((found.worst_at_per_cm - wavenumbers[place] / 100.0).abs() < 1e-6, "{found:?}");
    assert!((found.worst_over_peak - 0.3).abs() < 0.01 && found.rms_over_peak < 0.03, "{found:?}");
    let text = metrics.to_text();
    assert!(text.contains(&format!("where it is worst, at {:.3} 1/cm", found.worst_at_per_cm)), "{text}");
}

#[test]
fn what_cannot_become_a_spectrum_is_named() {
    let scene = Scene { scans: 3, ..Scene::default() };
    let error = |change: &dyn Fn(String) -> String| scene.try_measure(&|_| 0.0, change).unwrap_err();
    let nothing = error(&|text| text.replace("\"0.95 mm\"", "\"1.2 mm\""));
    assert!(matches!(nothing, SpectrumError::NoScan(counts) if counts.incomplete_scans == 1), "{nothing}");
    for (from, to, expected) in [
        ("column = \"position_m\"", "column = \"time_s\"", "expected a length"),
        ("\"0.95 mm\"", "\"0.95 s\"", "expected a length"),
        ("phase = \"none\"", "phase = \"mertz\"", "needs equal steps"),
        ("from = \"1700", "from = \"2900", "is not below"),
        ("file = \"path.csv\"", "file = \"nowhere.csv\"", "there is no file"),
        ("norton_beer_medium", "norton_beer", "norton_beer_medium"),
    ] {
        let message = error(&|text| text.replacen(from, to, 1)).to_string();
        assert!(message.contains(expected), "{message}");
    }
}

/// What a detector's clock, filter and sampling rate do to a line at 2000 per cm, with positions that are exact: the tables of
/// the book.
#[test]
#[ignore = "minutes in a debug build; run by name with `--release`"]
fn slow_clock_filter_and_rate_of_the_detector() {
    let ideal = Scene { scans: 40, ..Scene::default() };
    let of = |outcome: &SpectrumOutcome| outcome.lines[0].unwrap().line;
    let reference = of(&ideal.measure(&|_| 0.0, ""));
    let row = |what: &str, scene: Scene, more: &str| {
        let outcome = scene.measure(&|_| 0.0, more);
        let Some(line) = outcome.lines[0].map(|found| found.line) else {
            println!("| {what} | no line | |");
            return (f64::NAN, 0.0);
        };
        let shift = (line.wavenumber_per_m - reference.wavenumber_per_m) / 100.0;
        let height = line.height / reference.height;
        println!("| {what} | {shift:+.4} | {height:.4} |");
        (shift, height)
    };
    println!("| clock skew, 40 scans over 40 ms | shift in 1/cm | height |\n|---|---|---|");
    for skew in [1e-7, 1e-6, 3e-6, 1e-5] {
        let scene = Scene { skew, ..ideal };
        row(&format!("{skew:.0e}"), scene, "");
        // Forward and backward scans part by 2·v·skew·t, which laying them over each other undoes. Within a scan the
        // path is too short by the skew.
        let (shift, height) =
            row(&format!("{skew:.0e}, each laid over the others"), scene, "registration = \"each\"\n");
        assert!((shift / (-2000.0 * skew) - 1.0).abs() < 0.3 || shift.abs() < 4e-4, "{shift}");
        assert!(height > 0.98, "{height}");
    }
    println!("| low pass, 628 kHz at the zero path | shift in 1/cm | height |\n|---|---|---|");
    let samples = ideal.measure(&|_| 0.0, "directions = \"forward\"\n").processed.samples;
    for corner in [10e6, 5e6, 2e6, 1e6, 0.5e6] {
        let scene = Scene { low_pass_hz: Some(corner), ..ideal };
        let name = format!("{} MHz", corner / 1e6);
        row(&name, scene, "");
        let (_, height) =
            row(&format!("{name}, each laid over the others"), scene, "registration = \"each\"\n");
        // Of each sample a first-order stage leaves 1/(1 + i·f/f_c), at f = ν·v; its mean delay is taken off.
        let (mut real, mut imaginary, mut total) = (0.0, 0.0, 0.0);
        for sample in &samples {
            let ratio = 200e3 * sample.speed_m_per_s / corner;
            real += sample.weight / (1.0 + ratio * ratio);
            imaginary -= sample.weight * ratio / (1.0 + ratio * ratio);
            total += sample.weight;
        }
        let expected = f64::hypot(real, imaginary) / total;
        assert!((height / expected - 1.0).abs() < 2e-3, "{corner}: {height} {expected}");
    }
    println!("| sampling rate | shift in 1/cm | height |\n|---|---|---|");
    for rate_hz in [8e6, 4e6, 1.6e6, 1.3e6, 1.2e6, 0.8e6] {
        let (shift, height) = row(&format!("{} MHz", rate_hz / 1e6), Scene { rate_hz, ..ideal }, "");
        if rate_hz >= 1.3e6 {
            assert!(shift.abs() < 0.01 && (height - 1.0).abs() < 0.01, "{shift} {height}");
        }
    }
}
