//! The stage's resonance from a stepped sweep of the drive's frequency.

use crate::fit::{ByDual, DerivedNumber, Fit, FitError, FitSettings, ResidualLaw, fit};
use crate::identify::{Circle, ResonantResponse, ResponseModel, ResponsePoint, fit_circle, fit_response};
use kalmems_core::Portable;
use kalmems_core::{Over, Scalar};
use std::f64::consts::TAU;

/// One step of the sweep: the angular rate over the drive, as the instruments show them, in rad/s/V.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageSweepPoint {
    /// The drive's frequency in Hz.
    pub frequency_hz: f64,
    /// The real part.
    pub re: f64,
    /// The imaginary part.
    pub im: f64,
    /// The standard deviation of either part.
    pub deviation: f64,
}

/// The stage's parameters, by two ways.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepFit {
    /// By least squares on the response, with the delay of the vibrometer and modes outside of the band.
    pub response: ResonantResponse,
    /// The circle that the rate's response is in the complex plane, and how it is passed, fitted together: [x and y of the centre and radius in
    /// rad/s/V, phase at resonance in rad, f_n in Hz, ζ].
    pub circle: Fit<6>,
}

/// Why a sweep says nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SweepError {
    /// Too few steps, or none beyond the resonance.
    #[error(
        "the sweep has {points} steps, {below} of them below the largest response and {above} above; expected at least \
         6, with 2 on either side: step the drive's frequency through the resonance"
    )]
    NotThrough {
        /// Steps.
        points: usize,
        /// Those below the peak.
        below: usize,
        /// Those above.
        above: usize,
    },
    /// A fit failed.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// Fits a resonance to the steps of a sweep.
///
/// The response of the angle is that of the rate over 2πjf. Where the phase of the rate is 0 is no resonance: a
/// vibrometer that is 6.9 µs late moves that by 0.6 Hz.
pub fn fit_sweep(points: &[StageSweepPoint]) -> Result<SweepFit, SweepError> {
    let size = |p: &StageSweepPoint| p.re.portable_hypot(p.im);
    let peak = points.iter().max_by(|a, b| size(a).total_cmp(&size(b))).map_or(0.0, |p| p.frequency_hz);
    let below = points.iter().filter(|p| p.frequency_hz < peak).count();
    let above = points.iter().filter(|p| p.frequency_hz > peak).count();
    if points.len() < 6 || below < 2 || above < 2 {
        return Err(SweepError::NotThrough { points: points.len(), below, above });
    }
    let angles: Vec<ResponsePoint> = points
        .iter()
        .map(|p| {
            let rate = TAU * p.frequency_hz;
            ResponsePoint {
                frequency_hz: p.frequency_hz,
                re: p.im / rate,
                im: -p.re / rate,
                deviation: p.deviation / rate,
            }
        })
        .collect();
    let response = fit_response(&angles, ResponseModel::WithResidualModes)?;
    let in_time = without_delay(points, &response);
    let plane: Vec<[f64; 2]> = in_time.iter().map(|p| [p.re, p.im]).collect();
    let circle = passed_circle(&in_time, &fit_circle(&plane)?, &response)?;
    Ok(SweepFit { response, circle })
}

/// The steps without what the delay of the vibrometer turns them by against the resonance: over a band of 8 Hz a delay of 7 µs turns them by 0.35 mrad, which
/// moves the drive gain by the circle by seven standard deviations of a usual sweep. The delay is known to a thousandth of that.
fn without_delay(points: &[StageSweepPoint], near: &ResonantResponse) -> Vec<StageSweepPoint> {
    let (natural, delay) = (near.natural_frequency_hz().value, near.delay_s().value);
    let turned = points.iter().map(|p| {
        let angle = TAU * (p.frequency_hz - natural) * delay;
        let (sine, cosine) = angle.portable_sin_cos();
        StageSweepPoint { re: p.re * cosine - p.im * sine, im: p.re * sine + p.im * cosine, ..*p }
    });
    turned.collect()
}

/// Circle and passage together: c + R·e^{jψ(f)} with ψ(f) = ψ₀ − 2·atan((f/f_n − f_n/f)/(2ζ)). The angles alone would take centre and radius as
/// exact, and leave the damping's interval too short by their errors.
fn passed_circle(
    points: &[StageSweepPoint],
    circle: &Circle,
    near: &ResonantResponse,
) -> Result<Fit<6>, FitError> {
    let [x, y] = circle.centre();
    let natural = near.natural_frequency_hz().value;
    let nearest = points
        .iter()
        .min_by(|a, b| (a.frequency_hz - natural).abs().total_cmp(&(b.frequency_hz - natural).abs()));
    let phase = nearest.map_or(0.0, |p| (p.im - y).portable_atan2(p.re - x));
    let start = [x, y, circle.radius(), phase, natural, near.damping_ratio().value];
    fit(&ByDual(PassedCircle(points)), &FitSettings::from_start(start))
}

struct PassedCircle<'a>(&'a [StageSweepPoint]);

impl ResidualLaw<6> for PassedCircle<'_> {
    fn residuals<S: Over<f64>>(&self, p: &[S; 6], each: &mut impl FnMut(S)) {
        for point in self.0 {
            let ratio = S::lift(point.frequency_hz) / p[4];
            let detuning = (ratio - ratio.recip()) / p[5].twice();
            // Cosine and sine of 2·atan of that.
            let half = (detuning.sq() + 1.0).recip().twice();
            let (cosine, sine) = (half - 1.0, half * detuning);
            let (of_phase_cosine, of_phase_sine) = (p[3].cos(), p[3].sin());
            let re = p[0] + p[2] * (of_phase_cosine * cosine + of_phase_sine * sine);
            let im = p[1] + p[2] * (of_phase_sine * cosine - of_phase_cosine * sine);
            each((re - point.re) * (1.0 / point.deviation));
            each((im - point.im) * (1.0 / point.deviation));
        }
    }
}

impl SweepFit {
    /// f_n in Hz.
    pub fn natural_frequency_hz(&self) -> DerivedNumber {
        self.response.natural_frequency_hz()
    }

    /// ζ.
    pub fn damping_ratio(&self) -> DerivedNumber {
        self.response.damping_ratio()
    }

    /// b_c in rad/s²/V: ω_n² times the static angle per volt.
    pub fn drive_gain(&self) -> DerivedNumber {
        self.response.fit.derived(|p| p[0] * (p[1] * TAU).sq())
    }

    /// The covariance of the errors of f_n, ζ and b_c, by their places.
    pub fn covariance(&self, i: usize, j: usize) -> f64 {
        let [angle, frequency, ..] = self.response.fit.parameters;
        let by_angle = (TAU * frequency).powi(2);
        // How each follows from the static angle per volt, f_n and ζ.
        let follows = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [by_angle, 2.0 * angle * by_angle / frequency, 0.0]];
        let places = (0..3).flat_map(|k| (0..3).map(move |l| (k, l)));
        places.map(|(k, l)| follows[i][k] * self.response.fit.covariance.get(k, l) * follows[j][l]).sum()
    }

    /// The delay of the vibrometer in s.
    pub fn delay_s(&self) -> DerivedNumber {
        self.response.delay_s()
    }

    /// Centre and radius of the circle in rad/s/V.
    pub fn circle(&self) -> ([f64; 2], f64) {
        let [x, y, radius, ..] = self.circle.parameters;
        ([x, y], radius)
    }

    /// f_n in Hz by the circle.
    pub fn circle_frequency_hz(&self) -> DerivedNumber {
        self.circle.parameter(4)
    }

    /// ζ by the circle.
    pub fn circle_damping_ratio(&self) -> DerivedNumber {
        self.circle.parameter(5)
    }

    /// b_c in rad/s²/V by the circle: its diameter is b_c/(2ζω_n).
    pub fn circle_drive_gain(&self) -> DerivedNumber {
        self.circle.derived(|p| p[2] * p[4] * p[5] * (4.0 * TAU))
    }

    /// The phase of the rate at resonance in rad: 0 but for the delay of the vibrometer.
    pub fn phase_at_resonance(&self) -> DerivedNumber {
        self.circle.parameter(3)
    }
}
