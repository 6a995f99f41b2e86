//! Where the EKF and the UKF differ: long intervals, much noise, a start that is hardly known.

use super::chance::{Chance, Spread, digits};
use super::drawing::with_bars;
use super::scanner::{INTERVAL, Motion, NOISE_VARIANCE, READOUT, SCANNER, START_SD, Truth, signal};
use kalmems::figures::{Axis, Figure, Panel};
use kalmems_core::{
    ContinuousDiscrete, Covariance, Ekf, Filter, IteratedEkf, Measurement, NoiseDensity, SigmaPoints, Ukf,
};
use std::error::Error;
use std::fmt::Write as _;

pub const SEEDS: u64 = 16;
const SAMPLES: usize = 30_000;
const SETTLING: usize = 15_000;
/// The angular acceleration of this part, in rad²/s³: a device that is pushed hard.
const DENSITY: f64 = 1e8;
/// Samples of the recording to a sample of the filter: 1 MHz down to 5 kHz.
const EVERY: [usize; 8] = [1, 2, 4, 10, 25, 60, 100, 200];
/// The noise's standard deviation over that of the device.
const NOISE: f64 = 10.0;

struct Recording {
    motion: Motion,
    signal: Vec<f64>,
    variance: f64,
}

impl Recording {
    fn new(seed: u64, density: f64, noise: f64, samples: usize) -> Self {
        let mut chance = Chance::new(seed);
        let motion = Truth { stiffness: 1.0, density, samples }.motion(&mut chance);
        let variance = noise * noise * NOISE_VARIANCE;
        let signal = signal(&motion, variance.sqrt(), &mut chance);
        Self { motion, signal, variance }
    }
}

/// The filters of this part.
#[derive(Clone, Copy)]
enum Way {
    Ekf,
    Iterated,
    Ukf(SigmaPoints<f64>),
}

/// Does the same with a filter of each way.
macro_rules! with_filter {
    ($way:expr, $mean:expr, $start:expr, |$filter:ident| $body:expr) => {
        match $way {
            Way::Ekf => {
                let $filter = Ekf::new($mean, $start);
                $body
            }
            Way::Iterated => {
                let $filter = IteratedEkf::<f64, 2, 10>::new($mean, $start, 1e-3);
                $body
            }
            Way::Ukf(points) => {
                let $filter = Ukf::new($mean, $start, points);
                $body
            }
        }
    };
}

/// The estimates of the angle, and the truth at the same samples.
type Followed = (Vec<f64>, Vec<[f64; 2]>);

/// Follows every `every`-th sample over its whole interval.
fn follow(
    mut filter: impl Filter<f64, 2>,
    recording: &Recording,
    density: f64,
    every: usize,
) -> Result<Followed, Box<dyn Error>> {
    let maker = ContinuousDiscrete::new(SCANNER, NoiseDensity::none().on::<1>(density), INTERVAL)?;
    let r = Covariance::from_variances([recording.variance]);
    let interval = every as f64 * INTERVAL;
    let (mut angle, mut truth) = (Vec::new(), Vec::new());
    for k in (every - 1..recording.signal.len()).step_by(every) {
        let begin = (k + 1 - every) as f64 * INTERVAL;
        let drive = |t: f64| recording.motion.truth.volts(begin + t);
        let process = maker.over(interval, filter.mean(), drive)?;
        filter.predict(&process, &())?;
        filter.update(&READOUT, &[recording.signal[k]], &r)?;
        angle.push(filter.mean()[0]);
        truth.push(recording.motion.state[k]);
    }
    Ok((angle, truth))
}

/// The root mean square error of the second half, in 10⁻³ degrees.
fn error(angle: &[f64], truth: &[[f64; 2]]) -> f64 {
    let from = angle.len() * SETTLING / SAMPLES;
    let squares: Vec<f64> = angle.iter().zip(truth).skip(from).map(|(a, x)| (a - x[0]).powi(2)).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt().to_degrees() * 1e3
}

/// The error of a whole recording, from the usual start.
fn of_recording(way: Way, recording: &Recording, every: usize) -> Result<f64, Box<dyn Error>> {
    let (mean, start) = (recording.motion.start, Covariance::from_standard_deviations(START_SD));
    let (angle, truth) = with_filter!(way, mean, start, |filter| follow(filter, recording, DENSITY, every))?;
    Ok(error(&angle, &truth))
}

/// The error that one correction leaves of an angle that is known to be 0.1 rad, but for this standard deviation:
/// 2000 times, in 10⁻³ degrees.
fn of_correction(way: Way, sd: f64, seed: u64) -> Result<f64, Box<dyn Error>> {
    const TIMES: u32 = 2000;
    let mut chance = Chance::new(seed);
    let start = Covariance::from_standard_deviations([sd, 1.0]);
    let r = Covariance::from_variances([NOISE_VARIANCE]);
    let mut squares = 0.0;
    for _ in 0..TIMES {
        let truth = 0.1 + sd * chance.gaussian();
        let y = READOUT.predict(&[truth, 0.0])[0] + NOISE_VARIANCE.sqrt() * chance.gaussian();
        let angle = with_filter!(way, [0.1, 0.0], start, |filter| {
            let mut filter = filter;
            filter.update(&READOUT, &[y], &r)?;
            filter.mean()[0]
        });
        squares += (angle - truth).powi(2);
    }
    Ok((squares / f64::from(TIMES)).sqrt().to_degrees() * 1e3)
}

/// The error of each seed, in the order of the seeds.
fn of_seeds(run: impl Fn(u64) -> Result<f64, Box<dyn Error>>) -> Result<Vec<f64>, Box<dyn Error>> {
    (1..=SEEDS).map(run).collect()
}

/// What the choice of filter and of sigma points comes to, in 10⁻³ degrees: medians.
pub struct Tuning {
    /// After one correction from ± 3°.
    pub ekf: f64,
    pub iterated: f64,
    /// With the standard sigma points.
    pub ukf: f64,
    /// Over the choices of sigma points, after one correction from ± 3°.
    pub once: Spread,
    /// The same along a recording at a low rate.
    pub along: Spread,
}

/// The figure over the sampling rate and over the prior, the table of rates, that of sigma points, and what that
/// says.
pub fn run() -> Result<(Figure, [String; 2], Tuning), Box<dyn Error>> {
    let ukf = Way::Ukf(SigmaPoints::standard());
    let mut table =
        String::from("| rate | EKF, mdeg | UKF over EKF | iterated EKF over EKF |\n|---:|---:|---:|---:|\n");
    eprintln!("EKF and UKF over the sampling rate, {SEEDS} seeds");
    let recordings: Vec<_> = (1..=SEEDS).map(|seed| Recording::new(seed, DENSITY, NOISE, SAMPLES)).collect();
    let (mut unscented, mut iterated) = (Vec::new(), Vec::new());
    for every in EVERY {
        let of =
            |way| recordings.iter().map(|r| of_recording(way, r, every)).collect::<Result<Vec<f64>, _>>();
        let errors = of(Way::Ekf)?;
        let over = |others: Vec<f64>| Spread::of(others.iter().zip(&errors).map(|(a, b)| a / b).collect());
        let (by_ukf, by_iterated) = (over(of(ukf)?), over(of(Way::Iterated)?));
        let rate = 1.0 / (every as f64 * INTERVAL);
        let _ = writeln!(
            table,
            "| {} kHz | {} | {} | {} |",
            digits(rate / 1e3),
            Spread::of(errors.clone()).text(),
            by_ukf.text(),
            by_iterated.text()
        );
        unscented.push((rate, by_ukf));
        iterated.push((rate, by_iterated));
    }
    let mut rates = Panel::new(
        Axis::new("sampling rate, noise × 10", "Hz").log(),
        Axis::new("error over that of the EKF", "").between(0.95, 1.05),
    );
    for (name, ratios) in [("UKF", unscented), ("iterated EKF", iterated)] {
        rates = with_bars(rates, name, &ratios, true);
    }
    let mut priors = Panel::new(
        Axis::new("standard deviation of the angle before one correction", "deg").log(),
        Axis::new("RMS error after it", "deg").log(),
    );
    for (name, way) in [("UKF", ukf), ("iterated EKF", Way::Iterated), ("EKF", Way::Ekf)] {
        let mut points = Vec::new();
        for sd in [0.1, 0.2, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0] {
            let errors = of_seeds(|seed| of_correction(way, f64::to_radians(sd), seed))?;
            points.push((sd, Spread::of(errors).times(1e-3)));
        }
        priors = with_bars(priors, name, &points, true);
    }
    let caption = "Median over the seeds; the bars span all of them.";
    let figure =
        Figure::new("filters_curvature", "Where curvature matters", caption).with(rates).with(priors);
    let (points, tuning) = sigma_points(&recordings)?;
    Ok((figure, [table, points], tuning))
}

/// How much the choice of sigma points matters: along a recording, in one correction, and from a start that is
/// hardly known.
fn sigma_points(noisy: &[Recording]) -> Result<(String, Tuning), Box<dyn Error>> {
    const WIDE: [f64; 2] = [0.15, 15e3];
    const STARTS: u64 = 40;
    const LOW: usize = 60;
    eprintln!("sigma points: {SEEDS} seeds, {STARTS} starts");
    let mut table = format!(
        "| | at {} kHz, noise × 10, mdeg | one correction from ± 0.5°, mdeg | from ± 3°, mdeg | wide start: settled \
         | after, µs |\n|---|---:|---:|---:|---:|---:|\n",
        digits(1e3 / LOW as f64)
    );
    let points = |alpha, kappa| Way::Ukf(SigmaPoints { alpha, beta: 2.0, kappa });
    let ways = [
        ("EKF", Way::Ekf),
        ("iterated EKF, at most 10 steps", Way::Iterated),
        ("UKF, α = 1, κ = 1", points(1.0, 1.0)),
        ("UKF, α = 1, κ = 0", points(1.0, 0.0)),
        ("UKF, α = 1, κ = 4", points(1.0, 4.0)),
        ("UKF, α = 0.5, κ = 0", points(0.5, 0.0)),
        ("UKF, α = 0.1, κ = 0", points(0.1, 0.0)),
        ("UKF, α = 0.001, κ = 0", points(1e-3, 0.0)),
    ];
    let starts: Vec<_> = (1..=STARTS).map(|seed| Recording::new(seed, 1e6, 1.0, 4000)).collect();
    let (mut along, mut once) = (Vec::new(), Vec::new());
    for (name, way) in ways {
        let slow = noisy.iter().map(|r| of_recording(way, r, LOW)).collect::<Result<Vec<f64>, _>>()?;
        let corrected =
            |deg: f64| of_seeds(|seed| of_correction(way, deg.to_radians(), seed)).map(Spread::of);
        let mut settled = Vec::new();
        for (seed, recording) in (1..).zip(&starts) {
            let mut chance = Chance::new(1000 + seed);
            let mean = [0.15 + WIDE[0] * chance.gaussian(), WIDE[1] * chance.gaussian()];
            let start = Covariance::from_standard_deviations(WIDE);
            // A filter that gives up has not settled.
            let followed = with_filter!(way, mean, start, |filter| follow(filter, recording, 1e6, 1));
            if let Ok((angle, truth)) = followed {
                settled.extend(settles(&angle, &truth).filter(|after| *after < 3000.0));
            }
        }
        let (slow, near, far) = (Spread::of(slow), corrected(0.5)?, corrected(3.0)?);
        along.push(slow.median);
        once.push(far.median);
        let _ = writeln!(
            table,
            "| {name} | {} | {} | {} | {} of {STARTS} | {} |",
            slow.text(),
            near.text(),
            far.text(),
            settled.len(),
            Spread::of(settled).text()
        );
    }
    let [ekf, iterated, ukf, ..] = once[..] else { return Err("three filters at least".into()) };
    let choices = |all: &[f64]| Spread::of(all.iter().skip(2).copied().collect());
    let tuning = Tuning { ekf, iterated, ukf, once: choices(&once), along: choices(&along) };
    Ok((table, tuning))
}

/// After how many samples the angle stays within 0.2° of the truth or of its mirror image: the sign of the motion
/// cannot be seen.
fn settles(angle: &[f64], truth: &[[f64; 2]]) -> Option<f64> {
    let far = |sign: f64| {
        let off = |(a, x): (&f64, &[f64; 2])| (sign * a - x[0]).abs().to_degrees() > 0.2;
        angle.iter().zip(truth).rposition(off).map_or(0, |last| last + 1)
    };
    let after = far(1.0).min(far(-1.0));
    (after < angle.len()).then_some(after as f64)
}
