//! Gap and gain of each electrode from the whole waveform of its signal.

use crate::fit::{DerivedNumber, Fit, FitError, FitSettings, ParameterBounds, Regression, fit};
use crate::signal::Sine;
use kalmems_core::Dual;
use kalmems_core::Portable;
use kalmems_models::capacitance::TiltingPlate;
use std::array;
use std::f64::consts::TAU;

/// Electrodes that a stage has for one axis.
pub const ELECTRODES: usize = 4;

/// Unknowns of one electrode.
const EACH: usize = 5;

/// All unknowns of a fit.
pub const UNKNOWNS: usize = 2 + EACH * ELECTRODES;

/// Where the unknowns stand in the fit.
pub mod unknown {
    /// What all stated motions are to be multiplied by.
    pub const SCALE: usize = 0;
    /// How much later than the motion its stated phase is, in s.
    pub const DELAY: usize = 1;
    /// D_n of an electrode in m.
    pub const fn gap(electrode: usize) -> usize {
        2 + super::EACH * electrode
    }
    /// η of an electrode in V·Ω.
    pub const fn gain(electrode: usize) -> usize {
        gap(electrode) + 1
    }
    /// The offset of its signal in V.
    pub const fn offset(electrode: usize) -> usize {
        gap(electrode) + 2
    }
    /// What its signal has of the drive in V/V, and of the drive's rate of change in V·s/V.
    pub const fn feedthrough(electrode: usize) -> [usize; 2] {
        [gap(electrode) + 3, gap(electrode) + 4]
    }
}

/// A record of steady motion.
#[derive(Clone, Debug)]
pub struct WaveRecord {
    /// When, in s.
    pub time_s: Vec<f64>,
    /// The drive in V.
    pub drive: Sine,
    /// The angle in rad, as late as the instrument that says it.
    pub angle: Sine,
    /// The signal of each electrode in V.
    pub signals: Vec<Vec<f64>>,
}

/// What of the electrodes is searched for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ElectrodeUnknowns {
    /// Gap and gain of each.
    Both,
    /// The gaps; the gains are trusted.
    Gaps,
    /// The gains; the gaps are trusted.
    Gains,
}

/// What is known, and what is asked for.
#[derive(Clone, Debug)]
pub struct Waveforms<'a> {
    /// The electrodes with the gaps that the search starts from; at most [`ELECTRODES`].
    pub plates: &'a [TiltingPlate<f64>],
    /// The gains that it starts from, in V·Ω.
    pub gains: &'a [f64],
    /// The standard deviation of each signal's noise in V.
    pub noise: &'a [f64],
    /// The records.
    pub records: &'a [WaveRecord],
    /// Where the delay starts, in s.
    pub delay_s: f64,
    /// Whether the motion's size is known, as a vibrometer says it.
    pub scale_known: bool,
    /// What of the electrodes is searched for.
    pub unknowns: ElectrodeUnknowns,
    /// Whether the signals have feedthrough that nothing has taken away: it is fitted, and what is then left to
    /// determine gap and gain is the harmonics.
    pub feedthrough: bool,
}

impl Waveforms<'_> {
    /// The unknowns that make the smallest sum of squares over all records.
    ///
    /// y = η·C′(θ)·θ̇ + y₀ + g·V + g′·V̇ with θ(t) = s·Θ·cos(2πf·(t + τ) + φ). Harmonics of y say Θ/D_n by how they compare
    /// with each other, so that gap and gain come apart only together with the size Θ of the motion; where the motion is not
    /// known, neither is (Chen, dissertation, 2018, section 3.5.4, matches two features of the waveform instead).
    pub fn fit(&self) -> Result<Fit<UNKNOWNS>, FitError> {
        let mut start = [0.0; UNKNOWNS];
        let mut free = [false; UNKNOWNS];
        let mut bounds = [ParameterBounds::FREE; UNKNOWNS];
        (start[unknown::SCALE], free[unknown::SCALE]) = (1.0, !self.scale_known);
        bounds[unknown::SCALE] = ParameterBounds { low: 0.05, high: 4.0 };
        (start[unknown::DELAY], free[unknown::DELAY]) = (self.delay_s, true);
        let largest = self.records.iter().map(|record| record.angle.amplitude).fold(0.0, f64::max);
        for (i, plate) in self.plates.iter().enumerate().take(ELECTRODES) {
            let (gap, gain) = (unknown::gap(i), unknown::gain(i));
            (start[gap], free[gap]) = (plate.gap, self.unknowns != ElectrodeUnknowns::Gains);
            // The plates stay apart; where the scale is searched for, it is the scale that gives way.
            let contact = plate.w1.abs().max(plate.w2.abs()) * largest.portable_tan();
            bounds[gap] = ParameterBounds { low: 1.02 * contact, high: f64::INFINITY };
            start[gap] = start[gap].max(1.1 * contact);
            (start[gain], free[gain]) = (self.gains[i], self.unknowns != ElectrodeUnknowns::Gaps);
            free[unknown::offset(i)] = true;
            for index in unknown::feedthrough(i) {
                free[index] = self.feedthrough;
            }
        }
        let settings =
            FitSettings { free, bounds, tolerance: 1e-12, iterations: 200, ..FitSettings::from_start(start) };
        fit(self, &settings)
    }

    /// What one electrode's signal is expected to be at one time.
    fn at(&self, p: &[f64; UNKNOWNS], record: &WaveRecord, electrode: usize, time_s: f64) -> ExpectedSample {
        let plate = &self.plates[electrode];
        let rate = TAU * record.angle.frequency_hz;
        let phase = rate * (time_s + p[unknown::DELAY]) + record.angle.phase_rad;
        let (sine, cosine) = phase.portable_sin_cos();
        let size = p[unknown::SCALE] * record.angle.amplitude;
        let (angle, speed) = (size * cosine, -size * rate * sine);
        // C′ with its derivatives by the gap and by the angle.
        let constant = Dual::<f64, 2>::constant;
        let varied = TiltingPlate {
            w1: constant(plate.w1),
            w2: constant(plate.w2),
            w3: constant(plate.w3),
            w4: constant(plate.w4),
            gap: Dual::variable(p[unknown::gap(electrode)], 0),
            permittivity: constant(plate.permittivity),
        };
        let slope = varied.slope(Dual::<f64, 2>::variable(angle, 1));
        let [by_gap, by_angle] = slope.gradient();
        let gain = p[unknown::gain(electrode)];
        let turn = TAU * record.drive.frequency_hz;
        let (drive_sine, drive_cosine) = (turn * time_s + record.drive.phase_rad).portable_sin_cos();
        let drive = [record.drive.amplitude * drive_cosine, -turn * record.drive.amplitude * drive_sine];
        let [direct, differentiated] = unknown::feedthrough(electrode).map(|index| p[index]);
        ExpectedSample {
            volts: gain * slope.value() * speed
                + p[unknown::offset(electrode)]
                + direct * drive[0]
                + differentiated * drive[1],
            by_gap: gain * by_gap * speed,
            by_gain: slope.value() * speed,
            by_time: gain * (by_angle * speed * speed - slope.value() * rate * rate * angle),
            by_scale: gain * speed * (by_angle * angle + slope.value()) / p[unknown::SCALE],
            by_feedthrough: drive,
        }
    }
}

/// A sample of a signal in V, and its derivatives.
struct ExpectedSample {
    volts: f64,
    by_gap: f64,
    by_gain: f64,
    by_time: f64,
    by_scale: f64,
    by_feedthrough: [f64; 2],
}

impl Waveforms<'_> {
    /// Every finite sample of every signal: its electrode, what is expected of it, and what it is.
    fn each_sample(&self, p: &[f64; UNKNOWNS], each: &mut impl FnMut(usize, &ExpectedSample, f64)) {
        for record in self.records {
            self.each_sample_of(p, record, &mut |electrode, _, expected, y| each(electrode, expected, y));
        }
    }

    /// The same of one record, with the time in s.
    fn each_sample_of(
        &self,
        p: &[f64; UNKNOWNS],
        record: &WaveRecord,
        each: &mut impl FnMut(usize, f64, &ExpectedSample, f64),
    ) {
        for (electrode, signal) in record.signals.iter().enumerate().take(self.plates.len()) {
            for (time_s, y) in record.time_s.iter().zip(signal).filter(|(_, y)| y.is_finite()) {
                each(electrode, *time_s, &self.at(p, record, electrode, *time_s), *y);
            }
        }
    }

    /// Of every sample of a record its electrode, its time in s, and its derivatives by the unknowns, in standard deviations of the noise.
    pub fn each_gradient(
        &self,
        p: &[f64; UNKNOWNS],
        record: &WaveRecord,
        each: &mut impl FnMut(usize, f64, &[f64; UNKNOWNS]),
    ) {
        self.each_sample_of(p, record, &mut |electrode, time_s, expected, _| {
            each(electrode, time_s, &self.gradient(electrode, expected));
        });
    }

    fn gradient(&self, electrode: usize, expected: &ExpectedSample) -> [f64; UNKNOWNS] {
        let weight = 1.0 / self.noise[electrode];
        let mut gradient = [0.0; UNKNOWNS];
        gradient[unknown::SCALE] = expected.by_scale * weight;
        gradient[unknown::DELAY] = expected.by_time * weight;
        gradient[unknown::gap(electrode)] = expected.by_gap * weight;
        gradient[unknown::gain(electrode)] = expected.by_gain * weight;
        gradient[unknown::offset(electrode)] = weight;
        for (index, drive) in unknown::feedthrough(electrode).into_iter().zip(expected.by_feedthrough) {
            gradient[index] = drive * weight;
        }
        gradient
    }
}

impl Regression<UNKNOWNS> for Waveforms<'_> {
    fn residuals(&self, p: &[f64; UNKNOWNS], each: &mut impl FnMut(f64)) {
        self.each_sample(p, &mut |electrode, expected, y| each((expected.volts - y) / self.noise[electrode]));
    }

    fn linearize(&self, p: &[f64; UNKNOWNS], each: &mut impl FnMut(f64, &[f64; UNKNOWNS])) {
        self.each_sample(p, &mut |electrode, expected, y| {
            let residual = (expected.volts - y) / self.noise[electrode];
            each(residual, &self.gradient(electrode, expected));
        });
    }
}

/// The motion of a record whose signals are all that is known of it: the size that makes the fundamental of the first
/// electrode's signal what its gap and gain say of a small angle.
pub fn motion_by(plate: &TiltingPlate<f64>, gain: f64, signal: &Sine) -> Sine {
    let per_rate = gain * plate.slope(0.0);
    // θ̇ leads θ by a quarter of a cycle, and a negative gain turns it over.
    let turned = signal.phase_rad - TAU / 4.0 + if per_rate < 0.0 { TAU / 2.0 } else { 0.0 };
    Sine {
        offset: 0.0,
        amplitude: signal.amplitude / (per_rate.abs() * TAU * signal.frequency_hz),
        frequency_hz: signal.frequency_hz,
        phase_rad: turned - TAU * (turned / TAU).round(),
        residual_rms: 0.0,
    }
}

/// What the waveform of a motion of unknown size does not say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Indeterminate {
    /// The singular value of the direction in which motion, gaps and gains grow together, over the largest one.
    pub singular_value: f64,
    /// The direction's part along the logarithms of the motion, the first gap and the first gain.
    pub parts: [f64; 3],
    /// The standard error of that common factor, relative to it.
    pub deviation: f64,
}

/// How well a record without a vibrometer says the absolute size of motion, gaps and gains, all of them free.
///
/// Θ → c·Θ, D_n → c·D_n, η → c·η leaves the waveform as it is but for tan θ against θ, a part in 10⁶ at 2 mrad: the
/// singular value is that small, and the standard error that large.
pub fn indeterminate(waveforms: &Waveforms) -> Result<Indeterminate, FitError> {
    let all = Waveforms { scale_known: false, unknowns: ElectrodeUnknowns::Both, ..waveforms.clone() };
    // At the best waveform with trusted gains; the direction is the same at every point of the line that it runs along.
    let trusted = Waveforms { unknowns: ElectrodeUnknowns::Gaps, ..all.clone() }.fit()?;
    let p = trusted.parameters;
    let logarithms: [f64; UNKNOWNS] = array::from_fn(|i| {
        let (electrode, place) = (i.saturating_sub(2) / EACH, i.saturating_sub(2) % EACH);
        let is_log = i == unknown::SCALE || (i >= 2 && place < 2 && electrode < all.plates.len());
        if is_log { p[i] } else { 0.0 }
    });
    let at = Logarithmic { waveforms: &all, point: p, logarithms };
    let free = array::from_fn(|i| logarithms[i] != 0.0 || i == unknown::DELAY);
    let settings =
        FitSettings { free, iterations: 1, tolerance: 1.0, ..FitSettings::from_start([0.0; UNKNOWNS]) };
    let linear = fit(&at, &settings)?;
    let weakest = linear.undetermined.first().copied().or(linear.weakest);
    let (singular_value, parts) = weakest.map_or((f64::NAN, [f64::NAN; 3]), |direction| {
        (direction.relative, [unknown::SCALE, unknown::gap(0), unknown::gain(0)].map(|i| direction.parts[i]))
    });
    Ok(Indeterminate { singular_value, parts, deviation: linear.parameter(unknown::SCALE).deviation })
}

/// The same regression, linear, in the logarithms of some unknowns around a point.
struct Logarithmic<'a> {
    waveforms: &'a Waveforms<'a>,
    point: [f64; UNKNOWNS],
    /// What one of a logarithm changes an unknown by; 0 for those that are taken as they are.
    logarithms: [f64; UNKNOWNS],
}

impl Regression<UNKNOWNS> for Logarithmic<'_> {
    fn residuals(&self, x: &[f64; UNKNOWNS], each: &mut impl FnMut(f64)) {
        self.linearize(x, &mut |residual, _| each(residual));
    }

    fn linearize(&self, x: &[f64; UNKNOWNS], each: &mut impl FnMut(f64, &[f64; UNKNOWNS])) {
        self.waveforms.linearize(&self.point, &mut |residual, gradient| {
            let row: [f64; UNKNOWNS] = array::from_fn(|i| {
                if self.logarithms[i] == 0.0 { gradient[i] } else { gradient[i] * self.logarithms[i] }
            });
            let moved: f64 = row.iter().zip(x).map(|(g, x)| g * x).sum();
            each(residual + moved, &row);
        });
    }
}

/// The correlation of the errors of an electrode's gap and gain.
pub fn correlation(fit: &Fit<UNKNOWNS>, electrode: usize) -> f64 {
    let (i, j) = (unknown::gap(electrode), unknown::gain(electrode));
    fit.covariance.get(j, i) / (fit.covariance.get(i, i) * fit.covariance.get(j, j)).sqrt()
}

/// The mean of values weighted by their standard errors.
pub fn weighted(values: &[DerivedNumber]) -> Option<DerivedNumber> {
    let usable = || values.iter().filter(|v| v.deviation.is_finite() && v.deviation > 0.0);
    let weight: f64 = usable().map(|v| v.deviation.powi(-2)).sum();
    let sum: f64 = usable().map(|v| v.value * v.deviation.powi(-2)).sum();
    (weight > 0.0).then(|| DerivedNumber { value: sum / weight, deviation: weight.sqrt().recip() })
}
