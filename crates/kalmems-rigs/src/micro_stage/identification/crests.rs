//! Gap and gain from two features of the waveform: the distance from crest to trough, and the height.

use crate::fit::{DerivedNumber, Fit, FitError, FitSettings, Regression, fit};
use crate::signal::{Sine, least_squares};
use kalmems_core::Portable;
use kalmems_core::{Dual, Scalar};
use kalmems_models::capacitance::TiltingPlate;
use std::array;
use std::f64::consts::TAU;

/// Harmonics of a signal that are looked at: of the largest published motion the next one is a 4000th of the first.
const HARMONICS: usize = 6;
const BASIS: usize = 1 + 2 * HARMONICS;

/// A periodic signal as a sum of harmonics.
#[derive(Clone, Copy, Debug)]
struct HarmonicSeries {
    /// The mean, and the parts along cosine and sine of each harmonic.
    coefficients: [f64; BASIS],
}

impl HarmonicSeries {
    fn of(time_s: &[f64], signal: &[f64], frequency_hz: f64) -> Option<Self> {
        let coefficients = least_squares(time_s, signal, |t| {
            array::from_fn(|i| {
                let turned = TAU * frequency_hz * t * i.div_ceil(2) as f64;
                if i % 2 == 1 {
                    turned.portable_cos()
                } else {
                    turned.portable_sin() + f64::from(u8::from(i == 0))
                }
            })
        })?;
        Some(Self { coefficients })
    }

    /// Value, first and second derivative by the phase of the fundamental.
    fn at(&self, phase: f64) -> [f64; 3] {
        let mut sum = [self.coefficients[0], 0.0, 0.0];
        for harmonic in 1..=HARMONICS {
            let (a, b) = (self.coefficients[2 * harmonic - 1], self.coefficients[2 * harmonic]);
            let k = harmonic as f64;
            let (s, c) = (k * phase).portable_sin_cos();
            sum[0] += a * c + b * s;
            sum[1] += k * (b * c - a * s);
            sum[2] -= k * k * (a * c + b * s);
        }
        sum
    }
}

/// Phases on a grid from which the extremes are refined.
const GRID: u32 = 256;

/// The phases of the crest and the trough of a periodic function, whose value and two derivatives are given, and its
/// values there.
fn extremes(of: impl Fn(f64) -> [f64; 3]) -> [[f64; 2]; 2] {
    let on_grid = |sign: f64| {
        let height = |k: &u32| sign * of(TAU * f64::from(*k) / f64::from(GRID))[0];
        let best = (0..GRID).max_by(|a, b| height(a).total_cmp(&height(b))).unwrap_or(0);
        let mut phase = TAU * f64::from(best) / f64::from(GRID);
        for _ in 0..8 {
            let [_, first, second] = of(phase);
            let step = first / second;
            if step.abs() < TAU / f64::from(GRID) * 4.0 {
                phase -= step;
            }
        }
        [phase, of(phase)[0]]
    };
    [on_grid(1.0), on_grid(-1.0)]
}

/// Where the signal's crest and trough are, to a fraction of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crests {
    /// λ: from the crest to the next trough, in cycles.
    pub distance: DerivedNumber,
    /// From the trough up to the crest, in V.
    pub height: DerivedNumber,
}

/// The features of a signal with white noise of this standard deviation in V. `None` where the samples do not determine
/// its harmonics.
///
/// A harmonic series through the whole record: a single sample, 1.6 µs, is 3 to 5 % of the gap (equation 55 of Chen,
/// dissertation, 2018, matches this distance). The standard errors are those of the noise.
pub fn crests(time_s: &[f64], signal: &[f64], frequency_hz: f64, noise: f64) -> Option<Crests> {
    let series = HarmonicSeries::of(time_s, signal, frequency_hz)?;
    let [[crest, top], [trough, bottom]] = extremes(|phase| series.at(phase));
    let cycles = (trough - crest) / TAU;
    // Each coefficient has the variance 2σ²/n.
    let samples = signal.iter().filter(|y| y.is_finite()).count();
    let variance = 2.0 * noise * noise / samples as f64;
    let [bend_crest, bend_trough] = [series.at(crest)[2], series.at(trough)[2]];
    let sums = (1..=HARMONICS).fold([0.0, 0.0], |[distance, height], harmonic| {
        let k = harmonic as f64;
        let common = (k * (trough - crest)).portable_cos();
        let cross = 2.0 * common / (bend_crest * bend_trough);
        [
            distance + k * k * (bend_crest.powi(-2) + bend_trough.powi(-2) - cross),
            height + 2.0 * (1.0 - common),
        ]
    });
    Some(Crests {
        distance: DerivedNumber {
            value: cycles.rem_euclid(1.0),
            deviation: (variance * sums[0]).sqrt() / TAU,
        },
        height: DerivedNumber { value: top - bottom, deviation: (variance * sums[1]).sqrt() },
    })
}

/// λ in cycles and the height in V per V·Ω of gain, for a plate under θ = Θ·cos(2πft), with this sign of the gain.
pub fn expected(plate: &TiltingPlate<f64>, angle: &Sine, sign: f64) -> [f64; 2] {
    let rate = TAU * angle.frequency_hz;
    let wave = |phase: f64| {
        // Value and two derivatives by the phase: second ones by differences of first ones that are exact.
        let first = |phase: f64| {
            let x = Dual::<f64, 1>::variable(phase, 0);
            let y = plate.slope(x.cos() * angle.amplitude) * x.sin() * (-angle.amplitude * rate * sign);
            let [by_phase] = y.gradient();
            (y.value(), by_phase)
        };
        let (value, by_phase) = first(phase);
        let step = 1e-4;
        [value, by_phase, (first(phase + step).1 - first(phase - step).1) / (2.0 * step)]
    };
    let [[crest, top], [trough, bottom]] = extremes(wave);
    [((trough - crest) / TAU).rem_euclid(1.0), top - bottom]
}

/// Gap in m and gain in V·Ω of one electrode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ByCrests {
    /// D_n: the gap whose waveforms have the measured distances.
    pub gap: DerivedNumber,
    /// η: by the heights, with that gap.
    pub gain: DerivedNumber,
}

/// Gap and gain from the features of several records with known motions.
pub fn by_crests(
    plate: &TiltingPlate<f64>,
    sign: f64,
    records: &[(Sine, Crests)],
) -> Result<ByCrests, FitError> {
    let distances = CrestDistances { plate, sign, records };
    let found: Fit<1> =
        fit(&distances, &FitSettings { tolerance: 1e-12, ..FitSettings::from_start([plate.gap]) })?;
    let noise = distances.noise_deviation(&found);
    let gap = DerivedNumber { value: found.parameters[0], deviation: noise };
    let gain_with = |gap: f64| {
        let plate = TiltingPlate { gap, ..*plate };
        let (mut up, mut down) = (0.0, 0.0);
        for (angle, crests) in records {
            let per_gain = expected(&plate, angle, sign)[1];
            let weight = crests.height.deviation.powi(-2);
            up += weight * per_gain * crests.height.value;
            down += weight * per_gain * per_gain;
        }
        sign * up / down
    };
    let value = gain_with(gap.value);
    let by_gap = (gain_with(gap.value + gap.deviation) - gain_with(gap.value - gap.deviation)) / 2.0;
    Ok(ByCrests { gap, gain: DerivedNumber { value, deviation: by_gap.abs() } })
}

struct CrestDistances<'a> {
    plate: &'a TiltingPlate<f64>,
    sign: f64,
    records: &'a [(Sine, Crests)],
}

impl CrestDistances<'_> {
    fn residual(&self, gap: f64, (angle, crests): &(Sine, Crests)) -> f64 {
        let distance = expected(&TiltingPlate { gap, ..*self.plate }, angle, self.sign)[0];
        (distance - crests.distance.value) / crests.distance.deviation
    }

    fn slope(&self, gap: f64, record: &(Sine, Crests)) -> f64 {
        let step = 1e-4 * gap;
        (self.residual(gap + step, record) - self.residual(gap - step, record)) / (2.0 * step)
    }

    /// The gap's standard deviation from the noise of the distances; few records say little by their scatter.
    fn noise_deviation(&self, found: &Fit<1>) -> f64 {
        let information: f64 =
            self.records.iter().map(|record| self.slope(found.parameters[0], record).powi(2)).sum();
        information.sqrt().recip()
    }
}

impl Regression<1> for CrestDistances<'_> {
    fn residuals(&self, [gap]: &[f64; 1], each: &mut impl FnMut(f64)) {
        self.records.iter().for_each(|record| each(self.residual(*gap, record)));
    }

    fn linearize(&self, [gap]: &[f64; 1], each: &mut impl FnMut(f64, &[f64; 1])) {
        for record in self.records {
            each(self.residual(*gap, record), &[self.slope(*gap, record)]);
        }
    }
}
