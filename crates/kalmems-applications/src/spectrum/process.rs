//! From interferograms to the spectrum of each scan.

use super::coadd::Scans;
use super::grid::WavenumberGrid;
use super::measure::SpectrumError;
use super::mertz::{OneSided, one_sided, without_phase};
use super::nonuniform::path_weights;
use super::register::{shift_to, turn};
use super::resample::resample;
use super::scans::{DetectorSignal, MirrorScan, PathScale, Reach, ScanCounts, path_differences, scans};
use super::track::PositionTrack;
use super::transform::{Spectrum, transform};
use super::zero_path::zero_path;
use crate::config::Quantity;
use crate::progress::Progress;
use crate::signal::PortableComplex;
use crate::spectrum::file::{
    Directions, PathTrajectory, PhaseCorrection, Registration, SpectrumTransform, TransformMethod,
    WavenumberBand,
};
use kalmems_core::Portable;
use realfft::num_complex::Complex64;

/// The spectra of all scans, and what was met on the way.
#[derive(Clone, Debug)]
pub struct ProcessedScans {
    /// The spectra.
    pub scans: Scans,
    /// What became of the samples, along a trajectory.
    pub counts: Option<ScanCounts>,
    /// The position in m that counts as the zero path, along a trajectory.
    pub zero_m: Option<f64>,
    /// Where the zero path of each scan lies beyond the common one, in m of path; with `phase = "none"`.
    pub misregistration_m: Vec<f64>,
    /// The phases of the mean spectra, where there is light: those that were removed, or the one that is left.
    pub phases: Vec<SpectrumPhase>,
    /// Whether the light lowers the detector's value.
    pub inverted: bool,
    /// By how much the path changes for each unit of the position; 2 where there is no trajectory.
    pub path_per_position: f64,
    /// The largest path difference in m.
    pub largest_m: f64,
    /// The largest wavenumber in 1/m that the samples can tell from lower ones where they are furthest apart.
    pub limit_per_m: f64,
    /// The interferogram of the first scan: path differences in m and values.
    pub interferogram: Vec<(f64, f64)>,
    /// Samples in scans, along a trajectory: for the budget.
    pub samples: Vec<PathSample>,
}

/// The phase of a mean spectrum.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectrumPhase {
    /// Which it is, such as `removed, forward`.
    pub of: &'static str,
    /// In rad, at the wavenumbers of the spectrum; NaN where less than a twentieth of the most light is.
    pub rad: Vec<f64>,
}

impl SpectrumPhase {
    fn of(of: &'static str, sign: f64, values: &[Complex64]) -> Self {
        let most = values.iter().map(|value| value.portable_norm()).fold(0.0, f64::max);
        let one = |value: &Complex64| {
            let is_lit = value.portable_norm() > DARK * most;
            if is_lit { (sign * value.im).portable_atan2(sign * value.re) } else { f64::NAN }
        };
        Self { of, rad: values.iter().map(one).collect() }
    }
}

/// The share of the most light below which a phase is one of noise.
const DARK: f64 = 0.05;

/// A sample of a scan: its time and what it counts for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathSample {
    /// In s.
    pub time_s: f64,
    /// The path's speed in m/s, negative where it falls.
    pub speed_m_per_s: f64,
    /// Its share of the path times its apodisation.
    pub weight: f64,
    /// What it counts for where interferograms are laid over each other: its share of the path times the square of its
    /// apodised value.
    pub energy: f64,
}

/// Samples that are kept for the budget, at most.
const SAMPLES: usize = 100_000;

/// Spectra of columns with a known step.
pub(super) fn of_steps(
    columns: &[DetectorSignal],
    step_m: f64,
    settings: &SpectrumTransform,
) -> Result<ProcessedScans, SpectrumError> {
    let mertz_wanted = settings.phase == PhaseCorrection::Mertz;
    let mut centred = Vec::new();
    for column in columns {
        let mut values = column.value.clone();
        let mut zero = zero_path(&values).ok_or(SpectrumError::NoZeroPath)?;
        // The long side lies behind.
        if mertz_wanted && zero > values.len() / 2 {
            values.reverse();
            zero = values.len() - 1 - zero;
        }
        centred.push((values, zero));
    }
    let reaches = centred.iter().map(|(values, zero)| {
        let behind = values.len() - 1 - zero;
        if mertz_wanted { behind } else { behind.min(*zero) }
    });
    let all = reaches.min().unwrap_or(0) as f64 * step_m;
    let largest_m = settings.largest_path_difference.as_ref().map_or(all, Quantity::si);
    if largest_m > all * (1.0 + 1e-9) || all == 0.0 {
        return Err(SpectrumError::Reach { wanted_m: largest_m, found_m: all });
    }
    let points = points(largest_m / step_m, settings);
    let mut spectra = Vec::new();
    let mut grid = None;
    for (values, zero) in &centred {
        let (spectrum, on) = fast(values, *zero, step_m, largest_m, points, settings)?;
        grid = Some(on);
        spectra.push(spectrum);
    }
    let grid = grid.ok_or(SpectrumError::NoScan(ScanCounts::default()))?;
    let forward = vec![true; spectra.len()];
    // Each has its own zero path anyway.
    let finished = finish(spectra, forward, grid, settings, Registration::Each, false);
    let interferogram = centred.first().map(|(values, zero)| {
        let place = |k: usize| step_m * (k as f64 - *zero as f64);
        values.iter().enumerate().map(|(k, y)| (place(k), *y)).collect()
    });
    Ok(ProcessedScans {
        largest_m,
        limit_per_m: 0.5 / step_m,
        interferogram: interferogram.unwrap_or_default(),
        ..finished
    })
}

/// Spectra along a trajectory. Where the zero path is to be searched, all is done twice: about the sample that deviates most,
/// and, as that may be some fringes off, about the zero path that the spectrum then shows.
pub(super) fn along(
    columns: &[DetectorSignal],
    track: &PositionTrack,
    trajectory: &PathTrajectory,
    settings: &SpectrumTransform,
    progress: &dyn Progress,
) -> Result<ProcessedScans, SpectrumError> {
    let told = settings.zero_path.as_ref().map(Quantity::si);
    let about = |zero| along_about(zero, columns, track, trajectory, settings, progress);
    let found = about(told)?;
    match found.zero_m {
        Some(zero) if told.is_none() && settings.phase != PhaseCorrection::Mertz => about(Some(zero)),
        _ => Ok(found),
    }
}

fn along_about(
    told: Option<f64>,
    columns: &[DetectorSignal],
    track: &PositionTrack,
    trajectory: &PathTrajectory,
    settings: &SpectrumTransform,
    progress: &dyn Progress,
) -> Result<ProcessedScans, SpectrumError> {
    let largest_m = settings.largest_path_difference.as_ref().map_or(0.0, Quantity::si);
    let short_m = settings.short_path_difference.as_ref().map_or(largest_m, Quantity::si);
    let reach = Reach { largest_m, short_m };
    let factor = trajectory.path_per_position();
    let scale =
        PathScale { path_per_position: factor, delay_s: trajectory.delay_s(), zero_m: told.unwrap_or(0.0) };
    let mut counts = ScanCounts::default();
    let mut passes: Vec<(usize, MirrorScan)> = Vec::new();
    let mut paths = Vec::new();
    let mut zero_m = told;
    for (index, column) in columns.iter().enumerate() {
        let (mut path, of_column) = path_differences(column, track, scale);
        let zero = match zero_m {
            Some(zero) => zero,
            None => coarse_zero(column, &path).ok_or(SpectrumError::NoScan(of_column))? / factor,
        };
        zero_m = Some(zero);
        if told.is_none() {
            for x in &mut path {
                *x -= factor * zero;
            }
        }
        let mut of_column = of_column;
        for scan in scans(&column.time_s, &path, reach, &mut of_column) {
            let wanted = match settings.directions.unwrap_or_default() {
                Directions::Both => true,
                Directions::Forward => scan.forward,
                Directions::Backward => !scan.forward,
            };
            if wanted {
                of_column.used += scan.rows.len();
                passes.push((index, scan));
            } else {
                of_column.unwanted_scans += 1;
            }
        }
        counts = counts.plus(of_column);
        paths.push(path);
    }
    let path_of = |(column, scan): &(usize, MirrorScan)| &paths[*column][scan.rows.clone()];
    let widest = passes.iter().flat_map(|pass| path_of(pass).windows(2).map(|p| (p[1] - p[0]).abs()));
    let widest = widest.fold(0.0, f64::max);
    if passes.is_empty() || widest == 0.0 {
        return Err(SpectrumError::NoScan(counts));
    }
    progress.begin("transforming", passes.len() as u64);
    let mut spectra = Vec::new();
    let mut grid = None;
    for (done, pass) in passes.iter().enumerate() {
        let (column, scan) = pass;
        let (spectrum, on) = match settings.method.unwrap_or_default() {
            TransformMethod::Weighted => {
                let value = &columns[*column].value[scan.rows.clone()];
                let (fine, grid) = weighted(path_of(pass), value, largest_m, settings)?;
                (OfScan { fine, coarse: Vec::new() }, grid)
            }
            TransformMethod::Resampled => {
                #[allow(clippy::cast_possible_truncation)] // as many as there are samples
                let ends = (-(short_m / widest).floor() as i32, (largest_m / widest).floor() as i32);
                let even = resample(&columns[*column].value, &paths[*column], scan, widest, ends)?;
                let points = points(largest_m / widest, settings);
                let zero = usize::try_from(-ends.0).unwrap_or(0);
                fast(&even, zero, widest, largest_m, points, settings)?
            }
        };
        grid = Some(on);
        spectra.push(spectrum);
        if progress.reached(done as u64 + 1).is_break() {
            return Err(SpectrumError::Interrupted);
        }
    }
    let grid = grid.ok_or(SpectrumError::NoScan(counts))?;
    let forward = passes.iter().map(|(_, scan)| scan.forward).collect();
    let registration = settings.registration.unwrap_or_default();
    let finished = finish(spectra, forward, grid, settings, registration, told.is_some());
    let interferogram = passes.first().map(|pass| {
        let value = &columns[pass.0].value[pass.1.rows.clone()];
        path_of(pass).iter().copied().zip(value.iter().copied()).collect()
    });
    Ok(ProcessedScans {
        samples: path_samples(columns, &paths, &passes, counts.used, settings),
        counts: Some(counts),
        path_per_position: factor,
        zero_m: zero_m.map(|zero| zero + finished.zero_m.unwrap_or(0.0) / factor),
        largest_m,
        limit_per_m: 0.5 / widest,
        interferogram: interferogram.unwrap_or_default(),
        ..finished
    })
}

/// The samples of all passes, or some of many.
fn path_samples(
    columns: &[DetectorSignal],
    paths: &[Vec<f64>],
    passes: &[(usize, MirrorScan)],
    used: usize,
    settings: &SpectrumTransform,
) -> Vec<PathSample> {
    let every = (used / SAMPLES).max(1);
    let largest_m = settings.largest_path_difference.as_ref().map_or(0.0, Quantity::si);
    let samples = passes.iter().flat_map(|(column, scan)| {
        let time = &columns[*column].time_s[scan.rows.clone()];
        let value = &columns[*column].value[scan.rows.clone()];
        let path = &paths[*column][scan.rows.clone()];
        let mean = value.iter().sum::<f64>() / value.len() as f64;
        let speeds = time.windows(2).zip(path.windows(2)).zip(value).step_by(every);
        speeds.map(move |((t, x), y)| {
            let (share, apodised) = ((x[1] - x[0]).abs(), settings.apodisation.weight(x[0] / largest_m));
            PathSample {
                time_s: t[0],
                speed_m_per_s: (x[1] - x[0]) / (t[1] - t[0]),
                weight: share * apodised,
                energy: share * (apodised * (y - mean)).powi(2),
            }
        })
    });
    samples.collect()
}

/// The path at the sample that deviates most.
fn coarse_zero(column: &DetectorSignal, path: &[f64]) -> Option<f64> {
    let placed: Vec<f64> =
        column.value.iter().zip(path).map(|(y, x)| if x.is_nan() { f64::NAN } else { *y }).collect();
    zero_path(&placed).map(|row| path[row])
}

/// Points of a fast transform: a power of two, for speed.
fn points(reach: f64, settings: &SpectrumTransform) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    let samples = (2.0 * reach).ceil() as usize + 1;
    samples.saturating_mul(settings.zero_filling.unwrap_or(DEFAULT_FILLING) as usize).next_power_of_two()
}

/// Values for each resolved one, where nothing is said.
const DEFAULT_FILLING: u32 = 8;

fn weighted(
    path: &[f64],
    value: &[f64],
    largest_m: f64,
    settings: &SpectrumTransform,
) -> Result<(Vec<Complex64>, WavenumberGrid), SpectrumError> {
    let [from, to] = settings.band.as_ref().map_or([0.0, 0.0], WavenumberBand::per_m);
    let filling = f64::from(settings.zero_filling.unwrap_or(DEFAULT_FILLING));
    let step_per_m = (2.0 * largest_m * filling).recip();
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked below
    let points = ((to - from) / step_per_m).floor() as usize + 1;
    if points > MOST_POINTS {
        return Err(SpectrumError::TooManyPoints { points });
    }
    let grid = WavenumberGrid { first_per_m: from, step_per_m, points };
    let weights = path_weights(path);
    let total: f64 = weights.iter().sum();
    let mean = value.iter().zip(&weights).map(|(y, w)| y * w).sum::<f64>() / total;
    let weighted: Vec<f64> = (value.iter().zip(&weights).zip(path))
        .map(|((y, w), x)| (y - mean) * w * settings.apodisation.weight(x / largest_m))
        .collect();
    Ok((grid.transform(path, &weighted), grid))
}

/// The most wavenumbers of a weighted transform.
const MOST_POINTS: usize = 1 << 20;

/// The spectrum of a scan.
struct OfScan {
    /// With its phase.
    fine: Vec<Complex64>,
    /// What tells the phase at the same wavenumbers, with `phase = "mertz"`; else empty.
    coarse: Vec<Complex64>,
}

fn fast(
    values: &[f64],
    zero: usize,
    step_m: f64,
    largest_m: f64,
    points: usize,
    settings: &SpectrumTransform,
) -> Result<(OfScan, WavenumberGrid), SpectrumError> {
    let end = (settings.apodisation, largest_m);
    let OneSided { fine: Spectrum { step_per_m, values }, coarse } =
        if settings.phase == PhaseCorrection::Mertz {
            one_sided(values, zero, step_m, end, points)?
        } else {
            OneSided { fine: transform(values, zero, step_m, end, points)?, coarse: Vec::new() }
        };
    let last = values.len() - 1;
    let [from, to] = settings.band.as_ref().map_or([0.0, f64::INFINITY], WavenumberBand::per_m);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    let index = |nu: f64| ((nu / step_per_m) as usize).min(last);
    let (first, last) = (index(from), index(to));
    let fine = values[first..=last].to_vec();
    let coarse = coarse.get(first..=last).unwrap_or_default().to_vec();
    let grid = WavenumberGrid { first_per_m: step_per_m * first as f64, step_per_m, points: fine.len() };
    Ok((OfScan { fine, coarse }, grid))
}

/// Real spectra: phases are removed, and scans laid over each other.
fn finish(
    scans: Vec<OfScan>,
    forward: Vec<bool>,
    grid: WavenumberGrid,
    settings: &SpectrumTransform,
    registration: Registration,
    zero_is_told: bool,
) -> ProcessedScans {
    let (mut spectra, coarse): (Vec<Vec<Complex64>>, Vec<Vec<Complex64>>) =
        scans.into_iter().map(|scan| (scan.fine, scan.coarse)).unzip();
    let mut misregistration_m = Vec::new();
    let (mut common_m, mut inverted) = (0.0, false);
    let mut phases = Vec::new();
    if settings.phase == PhaseCorrection::Mertz {
        phases = remove_phases(&mut spectra, coarse, &forward, grid);
    }
    if settings.phase == PhaseCorrection::None {
        misregistration_m = misregistrations(&spectra, grid);
        if registration == Registration::Each {
            for (spectrum, shift) in spectra.iter_mut().zip(&misregistration_m) {
                turn(spectrum, grid, *shift);
            }
        }
    }
    if settings.phase != PhaseCorrection::Mertz {
        let together = mean(&spectra, grid);
        if zero_is_told {
            inverted = together.iter().map(|value| value.re).sum::<f64>() < 0.0;
        } else {
            let (shift, sign) = shift_to(&together, None, grid);
            (common_m, inverted) = (shift, sign < 0.0);
            for spectrum in &mut spectra {
                turn(spectrum, grid, shift);
            }
        }
    }
    let power = settings.phase == PhaseCorrection::Power;
    // A magnitude has no sign.
    let inverted = inverted && !power;
    let sign = if inverted { -1.0 } else { 1.0 };
    if settings.phase != PhaseCorrection::Mertz {
        phases.push(SpectrumPhase::of("left, of the mean", sign, &mean(&spectra, grid)));
    }
    let real = |value: &Complex64| if power { value.portable_norm() } else { sign * value.re };
    let spectra = spectra.iter().map(|spectrum| spectrum.iter().map(real).collect()).collect();
    ProcessedScans {
        scans: Scans { grid, spectra, forward },
        counts: None,
        zero_m: Some(common_m),
        misregistration_m,
        phases,
        inverted,
        path_per_position: 2.0,
        largest_m: 0.0,
        limit_per_m: 0.0,
        interferogram: Vec::new(),
        samples: Vec::new(),
    }
}

/// Removes the phase of the scans of either direction together, as what delays the light's signal does not delay the mirror: they are laid over
/// each other by what tells their phases, and the phase is that of the mean of it.
///
/// The phase of each scan by itself would have the scan's own noise, which it turns towards positive values where there is no light.
fn remove_phases(
    spectra: &mut [Vec<Complex64>],
    mut coarse: Vec<Vec<Complex64>>,
    forward: &[bool],
    grid: WavenumberGrid,
) -> Vec<SpectrumPhase> {
    let mut phases = Vec::new();
    for (direction, of) in [(true, "removed, forward"), (false, "removed, backward")] {
        let places: Vec<usize> = (0..spectra.len()).filter(|place| forward[*place] == direction).collect();
        let mut own: Vec<Vec<Complex64>> =
            places.iter().map(|place| std::mem::take(&mut coarse[*place])).collect();
        let shifts = misregistrations(&own, grid);
        for ((place, coarse), shift) in places.iter().zip(&mut own).zip(shifts) {
            turn(&mut spectra[*place], grid, shift);
            turn(coarse, grid, shift);
        }
        let together = mean(&own, grid);
        if !places.is_empty() {
            phases.push(SpectrumPhase::of(of, 1.0, &together));
        }
        for place in places {
            let real = without_phase(&spectra[place], &together);
            spectra[place] = real.into_iter().map(|value| Complex64::new(value, 0.0)).collect();
        }
    }
    phases
}

/// Where the zero path of each scan lies beyond their mean one: first against the mean of the scans as they are, then against
/// the mean of those that were laid over it.
fn misregistrations(spectra: &[Vec<Complex64>], grid: WavenumberGrid) -> Vec<f64> {
    let as_they_are = mean(spectra, grid);
    let mut laid = spectra.to_vec();
    for spectrum in &mut laid {
        let (shift, _) = shift_to(spectrum, Some(&as_they_are), grid);
        turn(spectrum, grid, shift);
    }
    let together = mean(&laid, grid);
    let shifts: Vec<f64> =
        spectra.iter().map(|spectrum| shift_to(spectrum, Some(&together), grid).0).collect();
    let middle = shifts.iter().sum::<f64>() / shifts.len().max(1) as f64;
    shifts.iter().map(|shift| shift - middle).collect()
}

fn mean(spectra: &[Vec<Complex64>], grid: WavenumberGrid) -> Vec<Complex64> {
    let mut mean = vec![Complex64::new(0.0, 0.0); grid.points];
    for spectrum in spectra {
        for (mean, value) in mean.iter_mut().zip(spectrum) {
            *mean += value / spectra.len() as f64;
        }
    }
    mean
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;
    use crate::spectrum::mertz;
    use std::f64::consts::PI;

    /// Sixteen one-sided scans of a band of light behind a dispersive beam splitter, with noise of a thousandth of the peak, and wavenumbers
    /// without light. What a phase with the noise of the scan itself turns towards positive values there falls with the root of the number of
    /// scans when their phase is common, and the light is the same.
    #[test]
    fn a_common_phase_turns_less_noise_into_light() {
        const SCANS: usize = 16;
        let (step, long, short) = (3e-6, 1500_usize, 300_usize);
        let grid: Vec<f64> = (0..1500).map(|i| 30e3 + 1e5 * f64::from(i) / 1500.0).collect();
        let light = |nu: f64| (-((nu - 70e3) / 9e3).powi(2)).exp();
        let phase = |nu: f64| 0.4 + 1.1 * ((nu - 80e3) / 5e4) - 0.6 * ((nu - 80e3) / 5e4).powi(2);
        let clean: Vec<f64> = (0..=short + long)
            .map(|k| {
                let x = step * (k as f64 - short as f64);
                grid.iter().map(|nu| light(*nu) * (2.0 * PI * nu * x + phase(*nu)).cos()).sum()
            })
            .collect();
        let peak = clean.iter().map(|y: &f64| y.abs()).fold(0.0, f64::max);
        let mut noise = WhiteNoise::new(20_261_124, 3);
        let columns: Vec<DetectorSignal> = (0..SCANS)
            .map(|_| {
                let value: Vec<f64> = clean.iter().map(|y| y + 1e-3 * peak * noise.sample()).collect();
                DetectorSignal { time_s: vec![f64::NAN; value.len()], value }
            })
            .collect();
        let settings: SpectrumTransform =
            toml::from_str("apodisation = \"norton_beer_medium\"\nphase = \"mertz\"").unwrap();
        let found = of_steps(&columns, step, &settings).unwrap().scans;
        let mean = found.mean();
        let of = |band: [f64; 2], spectrum: &[f64]| -> Vec<f64> {
            let inside = |nu: f64| (band[0]..band[1]).contains(&nu);
            let wavenumbers = found.grid.wavenumbers();
            wavenumbers.iter().zip(spectrum).filter(|(nu, _)| inside(**nu)).map(|(_, y)| *y).collect()
        };
        let average = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        // One after the other, with a phase each.
        let behind = columns.iter().map(|column| column.value.len() - 1 - zero_path(&column.value).unwrap());
        let end = (settings.apodisation, step * behind.min().unwrap() as f64);
        let points = points(end.1 / step, &settings);
        let mut alone = vec![0.0; found.grid.points];
        for column in &columns {
            let zero = zero_path(&column.value).unwrap();
            let (_, one) = mertz(&column.value, zero, step, end, points).unwrap();
            alone.iter_mut().zip(one).for_each(|(sum, y)| *sum += y / SCANS as f64);
        }
        let dark = [110e3, 160e3];
        let [together, each] = [&mean, &alone].map(|spectrum| average(&of(dark, spectrum)));
        assert!(each > 0.0 && together > 0.0, "{each} {together}");
        let ratio = each / together;
        assert!((3.0..5.5).contains(&ratio), "{ratio}: {each} {together}");
        let bright = [60e3, 80e3];
        let [together, each] = [&mean, &alone].map(|spectrum| of(bright, spectrum));
        let highest = each.iter().copied().fold(0.0, f64::max);
        assert!(together.iter().zip(&each).all(|(a, b)| (a - b).abs() < 0.01 * highest));
    }
}
