//! Where a gain that does not change serves: a resonator with a sensor that is linear.

use super::chance::{Chance, Spread, digits};
use kalmems_core::{
    Covariance, FilterError, FixedGain, Kalman, LinearMeasurement, LinearProcess, Mat, NoiseDensity,
    OperatingPoint,
};
use std::error::Error;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::time::Instant;

const SEEDS: u64 = 16;
const SAMPLES: usize = 20_000;
const SETTLING: usize = 5000;
const SEEN: LinearMeasurement<f64, 2, 1> = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };

/// 1 kHz, quality 50, pushed at random to about 1 rms, sampled at 50 kHz; position and velocity over ω.
fn resonator() -> LinearProcess<f64, 2, 0> {
    let w = TAU * 1000.0;
    let density = NoiseDensity::none().on::<1>(2.0 * w / 50.0);
    LinearProcess::exact(&Mat([[0.0, w], [-w, -w / 50.0]]), &Mat::zero(), &density, 2e-5)
}

fn kalman(process: &LinearProcess<f64, 2, 0>, ys: &[f64], out: &mut [f64]) -> Result<(), FilterError> {
    let mut filter = Kalman::new([0.0, 0.0], Covariance::from_variances([1.0, 1.0]));
    let r = Covariance::from_variances([1.0]);
    for (y, out) in ys.iter().zip(out) {
        filter.predict(process, &[])?;
        filter.update(&SEEN, &[*y], &r)?;
        *out = filter.mean()[0];
    }
    Ok(())
}

fn fixed(
    mut filter: FixedGain<f64, 2, 1>,
    process: &LinearProcess<f64, 2, 0>,
    ys: &[f64],
    out: &mut [f64],
) -> Result<(), FilterError> {
    for (y, out) in ys.iter().zip(out) {
        filter.predict(process, &[])?;
        filter.update(&SEEN, &[*y])?;
        *out = filter.mean()[0];
    }
    Ok(())
}

/// The table, and the cost of the fixed gain over that of the Kalman filter.
pub fn run() -> Result<String, Box<dyn Error>> {
    eprintln!("a fixed gain, {SEEDS} seeds");
    let process = resonator();
    let noise = Covariance::from_variances([1.0]);
    let point = OperatingPoint::of(&process, (&SEEN, noise), (&[0.0, 0.0], &[]));
    let steady = FixedGain::steady_state([0.0, 0.0], &point)?;
    let q = process.noise.covariance();
    let root = [q.get(0, 0).sqrt(), q.get(0, 1) / q.get(0, 0).sqrt()];
    let rest = (q.get(1, 1) - root[1] * root[1]).sqrt();
    let (mut errors, mut ratios) = ([Vec::new(), Vec::new()], Vec::new());
    let mut out = vec![0.0; SAMPLES];
    for seed in 1..=SEEDS {
        let mut chance = Chance::new(seed);
        let mut x = [chance.gaussian(), chance.gaussian()];
        let (mut ys, mut truth) = (Vec::new(), Vec::new());
        for _ in 0..SAMPLES {
            let (a, b) = (chance.gaussian(), chance.gaussian());
            let moved = process.transition.times_vector(&x);
            x = [moved[0] + root[0] * a, moved[1] + root[1] * a + rest * b];
            truth.push(x[0]);
            ys.push(x[0] + chance.gaussian());
        }
        let error = |out: &[f64]| {
            let squares = out.iter().zip(&truth).skip(SETTLING).map(|(a, b)| (a - b).powi(2));
            (squares.sum::<f64>() / (SAMPLES - SETTLING) as f64).sqrt()
        };
        kalman(&process, &ys, &mut out)?;
        errors[0].push(error(&out));
        fixed(steady, &process, &ys, &mut out)?;
        errors[1].push(error(&out));
        for _ in 0..20 {
            let begun = Instant::now();
            kalman(&process, &ys, &mut out)?;
            let first = begun.elapsed().as_secs_f64();
            let begun = Instant::now();
            fixed(steady, &process, &ys, &mut out)?;
            ratios.push(begun.elapsed().as_secs_f64() / first);
        }
    }
    let ratio = Spread::of(ratios).median;
    let mut table = String::from("| | cost | RMS error over the sensor's noise |\n|---|---:|---:|\n");
    for ((name, cost), errors) in [("Kalman filter", 1.0), ("its steady gain", ratio)].iter().zip(errors) {
        let _ = writeln!(table, "| {name} | {} | {} |", digits(*cost), Spread::of(errors).text());
    }
    Ok(table)
}
