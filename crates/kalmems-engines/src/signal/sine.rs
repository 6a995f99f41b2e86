//! Least-squares sine fits with three and four parameters.
//!
//! Sines and arcs are those of `kalmems_core`, since those of platforms differ in the last digit.

use super::{NormalEquations, fourier_transform};
use crate::progress::Interruption;
use kalmems_core::{Covariance, Ldl, Mat, Portable, Scalar};
use realfft::num_complex::Complex64;
use std::borrow::Cow;
use std::f64::consts::TAU;

/// y(t) = offset + amplitude·cos(2π·frequency·t + phase).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sine {
    /// The mean, in the unit of y.
    pub offset: f64,
    /// The amplitude, not negative, in the unit of y.
    pub amplitude: f64,
    /// The frequency in Hz.
    pub frequency_hz: f64,
    /// The phase at t = 0 in rad, in (−π, π].
    pub phase_rad: f64,
    /// The root mean square of what the sine leaves, in the unit of y.
    pub residual_rms: f64,
}

impl Sine {
    /// The value at a time in s.
    pub fn at(&self, time_s: f64) -> f64 {
        self.offset + self.amplitude * Scalar::cos(TAU * self.frequency_hz * time_s + self.phase_rad)
    }

    /// Its rate at a time in s, per s.
    pub fn rate_at(&self, time_s: f64) -> f64 {
        let rate = TAU * self.frequency_hz;
        -self.amplitude * rate * Scalar::sin(rate * time_s + self.phase_rad)
    }

    /// The first maximum at or after a time in s.
    pub fn peak_after(&self, time_s: f64) -> f64 {
        let cycles = self.frequency_hz * time_s + self.phase_rad / TAU;
        (cycles.ceil() - self.phase_rad / TAU) / self.frequency_hz
    }

    /// The same with the root mean square of what it leaves of a signal.
    fn with_residual(self, time_s: &[f64], y: &[f64]) -> Self {
        let (mut sum, mut count) = (0.0, 0_usize);
        for (t, v) in time_s.iter().zip(y).filter(|(_, v)| v.is_finite()) {
            sum += (v - self.at(*t)).powi(2);
            count += 1;
        }
        Self { residual_rms: (sum / count.max(1) as f64).sqrt(), ..self }
    }

    /// The standard deviation of each of its two components, of the amplitude and of the phase times the amplitude, behind white noise in so many
    /// samples: σ·√(2/N).
    pub fn component_sd(&self, samples: usize) -> f64 {
        self.residual_rms * (2.0 / samples.max(1) as f64).sqrt()
    }

    /// Whether the sine explains the signal: less than 2 % of its amplitude is left.
    pub fn is_steady(&self) -> bool {
        self.residual_rms < 0.02 * self.amplitude
    }
}

/// The sine of known frequency that fits best; samples that are not finite are passed over. `None` where fewer
/// than three samples, or samples at too few phases, do not determine it.
pub fn fit_sine_at(time_s: &[f64], y: &[f64], frequency_hz: f64) -> Option<Sine> {
    fit_at(time_s, y, frequency_hz, &Interruption::never()).map(|sine| sine.with_residual(time_s, y))
}

/// The sine that fits a uniformly sampled signal best, its frequency included.
///
/// The frequency starts at the largest line of a spectrum of the first samples and is refined by Gauss–Newton
/// steps over windows that grow fourfold, so that the phase stays known to a fraction of a cycle over any
/// length. `None` where there is no line to start from or a fit does not settle.
pub fn fit_sine(time_s: &[f64], y: &[f64], interval_s: f64) -> Option<Sine> {
    fit_sine_until(time_s, y, interval_s, &Interruption::never())
}

/// The same, which gives nothing where it is stopped.
pub fn fit_sine_until(time_s: &[f64], y: &[f64], interval_s: f64, stop: &Interruption) -> Option<Sine> {
    let n = time_s.len().min(y.len());
    let mut window = n.min(4096);
    // The last digits of a transform are the platform's, and would be those of the fit.
    #[allow(clippy::cast_possible_truncation)]
    let line = largest_line(&on_a_grid(&time_s[..window], &y[..window], interval_s))? as f32;
    let mut frequency = f64::from(line) / interval_s;
    loop {
        let (t, v) = (&time_s[..window], &y[..window]);
        frequency = refine(t, v, frequency, stop)?;
        if window == n {
            return fit_at(t, v, frequency, stop).map(|sine| sine.with_residual(t, v));
        }
        window = (window * 4).min(n);
    }
}

/// The sine near a frequency that fits best, its frequency included; samples may be missing. `None` where the fit does not
/// settle.
pub fn fit_sine_near(time_s: &[f64], y: &[f64], frequency_hz: f64) -> Option<Sine> {
    fit_sine_at(time_s, y, refine(time_s, y, frequency_hz, &Interruption::never())?)
}

/// The sine of known frequency that fits best, without what it leaves.
fn fit_at(time_s: &[f64], y: &[f64], frequency_hz: f64, stop: &Interruption) -> Option<Sine> {
    // Times are taken from the middle, so that the phase is not multiplied by a large number.
    let middle = middle(time_s)?;
    let [offset, c, s] = least_squares_until(time_s, y, stop, |t| {
        let phase = TAU * frequency_hz * (t - middle);
        [1.0, Scalar::cos(phase), Scalar::sin(phase)]
    })?;
    let phase = (-s).portable_atan2(c) - TAU * frequency_hz * middle;
    Some(Sine {
        offset,
        amplitude: c.portable_hypot(s),
        frequency_hz,
        phase_rad: phase - TAU * (phase / TAU).round(),
        residual_rms: 0.0,
    })
}

/// Gauss–Newton on the frequency, linear least squares on the rest (IEEE Std 1057).
fn refine(time_s: &[f64], y: &[f64], start: f64, stop: &Interruption) -> Option<f64> {
    let middle = middle(time_s)?;
    let span = time_s.last()? - time_s.first()?;
    let mut frequency = start;
    for _ in 0..30 {
        let fit = fit_at(time_s, y, frequency, stop)?;
        let phase = fit.phase_rad + TAU * frequency * middle;
        let [_, _, _, change] = least_squares_until(time_s, y, stop, |t| {
            let turn = TAU * frequency * (t - middle);
            let slope = -fit.amplitude * TAU * (t - middle) * Scalar::sin(turn + phase);
            [1.0, Scalar::cos(turn), Scalar::sin(turn), slope]
        })?;
        frequency += change;
        // A hundred-thousandth of the width of a spectral line.
        if (change * span).abs() < 1e-5 {
            return Some(frequency);
        }
        if !(frequency > 0.0 && (frequency - start).abs() * span < 20.0) {
            return None;
        }
    }
    None
}

fn middle(time_s: &[f64]) -> Option<f64> {
    Some(time_s.first()?.midpoint(*time_s.last()?))
}

/// Linear least squares over the finite samples.
pub fn least_squares<const P: usize>(
    time_s: &[f64],
    y: &[f64],
    basis: impl Fn(f64) -> [f64; P],
) -> Option<[f64; P]> {
    least_squares_until(time_s, y, &Interruption::never(), basis)
}

/// The same, which gives nothing where it is stopped.
fn least_squares_until<const P: usize>(
    time_s: &[f64],
    y: &[f64],
    stop: &Interruption,
    basis: impl Fn(f64) -> [f64; P],
) -> Option<[f64; P]> {
    let mut normal = NormalEquations::<P>::new();
    for (k, (t, v)) in time_s.iter().zip(y).enumerate() {
        if stop.is_requested_at(k) {
            return None;
        }
        if !v.is_finite() {
            continue;
        }
        normal.add(&basis(*t), *v);
    }
    let NormalEquations { matrix: normal, right } = normal;
    // Columns of one size: the derivative by the frequency is many orders away from the others.
    let scale: [f64; P] = std::array::from_fn(|i| normal.0[i][i].sqrt().recip());
    let unit = Mat::<f64, P, P>::from_fn(|i, j| normal.0[i][j] * scale[i] * scale[j]);
    let ldl = Ldl::of(&Covariance::from_lower(unit));
    let scaled: [f64; P] = ldl.solve(&std::array::from_fn(|i| right[i] * scale[i]));
    let solution: [f64; P] = std::array::from_fn(|i| scaled[i] * scale[i]);
    (ldl.positive && solution.iter().all(|x| x.is_finite())).then_some(solution)
}

/// Samples put where they belong among equidistant ones; what is missing is not a number.
fn on_a_grid<'a>(time_s: &[f64], y: &'a [f64], interval_s: f64) -> Cow<'a, [f64]> {
    let (Some(first), Some(last)) = (time_s.first(), time_s.last()) else { return Cow::Borrowed(y) };
    let intervals = ((last - first) / interval_s).round();
    // As many as there are; or times that make no grid.
    if !(intervals > y.len() as f64 - 0.5 && intervals < 4.0 * y.len() as f64) {
        return Cow::Borrowed(y);
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the grid
    let place = |time: f64| ((time - first) / interval_s).round() as usize;
    let mut grid = vec![f64::NAN; place(*last) + 1];
    for (time, value) in time_s.iter().zip(y) {
        if let Some(cell) = grid.get_mut(place(*time)) {
            *cell = *value;
        }
    }
    Cow::Owned(grid)
}

/// The frequency of the largest line in cycles per sample, by a parabola through the logarithms of a Hann-windowed
/// spectrum. Missing samples count as the mean, which is enough to start from.
pub(crate) fn largest_line(y: &[f64]) -> Option<f64> {
    let n = y.len();
    if n < 16 {
        return None;
    }
    let finite = || y.iter().copied().filter(|v| v.is_finite());
    let mean = finite().sum::<f64>() / finite().count().max(1) as f64;
    let mut input: Vec<f64> = y
        .iter()
        .enumerate()
        .map(|(i, v)| {
            let window = 0.5 - 0.5 * Scalar::cos(TAU * i as f64 / n as f64);
            if v.is_finite() { (v - mean) * window } else { 0.0 }
        })
        .collect();
    let power: Vec<f64> = fourier_transform(&mut input).iter().map(Complex64::norm_sqr).collect();
    // The first bins hold what is left of the mean.
    let (bin, largest) = power.iter().copied().enumerate().skip(2).max_by(|a, b| a.1.total_cmp(&b.1))?;
    if largest <= 0.0 || largest.is_nan() {
        return None;
    }
    let shift = match (power.get(bin - 1), power.get(bin + 1)) {
        (Some(&below), Some(&above)) if below > 0.0 && above > 0.0 => {
            let (a, b, c) = (below.portable_ln(), largest.portable_ln(), above.portable_ln());
            let curvature = a - 2.0 * b + c;
            if curvature < 0.0 { (0.5 * (a - c) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
        }
        _ => 0.0,
    };
    Some((bin as f64 + shift) / n as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    fn sampled(n: usize, interval: f64, sine: &Sine) -> (Vec<f64>, Vec<f64>) {
        let time: Vec<f64> = (0..n).map(|i| 0.3 + i as f64 * interval).collect();
        let y = time.iter().map(|t| sine.at(*t)).collect();
        (time, y)
    }

    const DRIVE: Sine =
        Sine { offset: 90.0, amplitude: 85.0, frequency_hz: 31_350.4, phase_rad: -1.3, residual_rms: 0.0 };

    #[test]
    fn finds_a_sine_exactly() {
        for n in [700, 5000, 300_000] {
            let (time, y) = sampled(n, 1e-6, &DRIVE);
            let fit = fit_sine(&time, &y, 1e-6).unwrap();
            assert_abs_diff_eq!(fit.frequency_hz, DRIVE.frequency_hz, epsilon = 1e-4);
            assert_abs_diff_eq!(fit.amplitude, DRIVE.amplitude, epsilon = 1e-7);
            assert_abs_diff_eq!(fit.offset, DRIVE.offset, epsilon = 1e-7);
            let t = 0.3 + n as f64 * 0.5e-6;
            assert_abs_diff_eq!(fit.at(t), DRIVE.at(t), epsilon = 1e-6);
            assert!(fit.is_steady());
        }
    }

    #[test]
    fn missing_samples_are_passed_over() {
        let (time, mut y) = sampled(20_000, 1e-6, &DRIVE);
        for v in &mut y[5000..5400] {
            *v = f64::NAN;
        }
        let fit = fit_sine(&time, &y, 1e-6).unwrap();
        assert_abs_diff_eq!(fit.frequency_hz, DRIVE.frequency_hz, epsilon = 1e-4);
        assert_abs_diff_eq!(fit.residual_rms, 0.0, epsilon = 1e-6);
    }

    #[test]
    fn rows_that_are_not_there_do_no_harm() {
        let (time, y) = sampled(5000, 1e-6, &DRIVE);
        let kept = |k: &usize| !(k * 7919).is_multiple_of(20);
        let some = |values: &[f64]| (0..5000).filter(kept).map(|k| values[k]).collect::<Vec<f64>>();
        let fit = fit_sine(&some(&time), &some(&y), 1e-6).unwrap();
        assert_abs_diff_eq!(fit.frequency_hz, DRIVE.frequency_hz, epsilon = 1e-4);
        let near = fit_sine_near(&some(&time), &some(&y), 31_300.0).unwrap();
        assert_abs_diff_eq!(near.frequency_hz, DRIVE.frequency_hz, epsilon = 1e-4);
    }

    #[test]
    fn a_sweep_is_not_steady_and_nothing_has_no_sine() {
        let time: Vec<f64> = (0..20_000).map(|i| f64::from(i) * 1e-6).collect();
        let sweep: Vec<f64> = time.iter().map(|t| (TAU * (30e3 + 2e5 * t) * t).cos()).collect();
        assert!(fit_sine(&time, &sweep, 1e-6).is_none_or(|fit| !fit.is_steady()));
        assert_eq!(fit_sine(&time, &vec![90.0; 20_000], 1e-6), None);
        assert_eq!(fit_sine(&time, &vec![f64::NAN; 20_000], 1e-6), None);
        assert_eq!(fit_sine(&[], &[], 1e-6), None);
    }

    #[test]
    fn peaks_follow() {
        let sine = Sine { frequency_hz: 2.0, phase_rad: -TAU / 4.0, ..DRIVE };
        assert_abs_diff_eq!(sine.peak_after(0.0), 0.125, epsilon = 1e-15);
        assert_abs_diff_eq!(sine.peak_after(0.126), 0.625, epsilon = 1e-15);
    }
}
