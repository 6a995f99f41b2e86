//! The shared-electrode scanner's parameters from simulated recordings whose truth is known.
//!
//! The recordings are made by an integrator written here, and the Cramér–Rao bound is computed from it by finite
//! differences: neither uses the models, the integrator or the derivatives of the fit.

use kalmems::identify::fit_affine;
use kalmems::progress::Silent;
use kalmems::rigs::shared_scanner::identification::{
    RingDown, RingDownError, RingDownFit, SteadyState, fit_ring_down, fit_steady_state,
    integrated_capacitance, unknown,
};
use kalmems::simulate::WhiteNoise;
use kalmems_core::{Covariance, Ldl, Mat};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use statrs::distribution::{Binomial, DiscreteCDF};
use std::f64::consts::TAU;

const INERTIA: f64 = 1.15e-14;
const BIAS: f64 = 23.76;
const GAIN: f64 = 17.86e3 * BIAS;
/// k, b, C0, theta0 of Chen et al. 2020, Table II.
const DEVICE: [f64; 4] = [1.10e-4, 5.95e-12, 5.71e-12, 0.2];
const NAMES: [&str; 4] = ["k", "b", "C0", "theta0"];
/// Of V_o1 in V and of the reference in rad, per sample.
const NOISE: [f64; 2] = [1e-3, 0.5e-3];

/// V_o1 and angle of a ring-down: unknowns in the order of the fit's. Ten steps per µs: the frequency is right to 10⁻¹⁰.
fn ring_down(p: &[f64; unknown::COUNT], interval_s: f64, count: usize) -> Vec<[f64; 2]> {
    let [k, b, c0, width, angle, rate, offset, angle_offset] = *p;
    let slope = |a: f64| -2.0 * c0 * a / (width * width) * (-(a / width).powi(2)).exp();
    let f = |[a, w]: [f64; 2]| [w, (0.5 * slope(a) * BIAS * BIAS - b * w - k * a) / INERTIA];
    let on = |x: [f64; 2], d: [f64; 2], h: f64| [x[0] + h * d[0], x[1] + h * d[1]];
    let steps = if interval_s > 2e-7 { 10 } else { 2 };
    let h = interval_s / f64::from(steps);
    let mut x = [angle, rate];
    (0..count)
        .map(|_| {
            let seen = [GAIN * slope(x[0]) * x[1] + offset, x[0] + angle_offset];
            for _ in 0..steps {
                let d1 = f(x);
                let d2 = f(on(x, d1, h / 2.0));
                let d3 = f(on(x, d2, h / 2.0));
                let d4 = f(on(x, d3, h));
                x = [0, 1].map(|i| x[i] + h / 6.0 * (d1[i] + 2.0 * d2[i] + 2.0 * d3[i] + d4[i]));
            }
            seen
        })
        .collect()
}

/// The least standard deviations that any unbiased estimator can have.
fn bound(p: &[f64; unknown::COUNT], interval_s: f64, count: usize) -> [f64; unknown::COUNT] {
    let steps = [1e-6 * p[0], 1e-3 * p[1], 1e-3 * p[2], 1e-3 * p[3], 1e-5, 1.0, 1e-3, 1e-3];
    let columns: Vec<Vec<[f64; 2]>> = (0..unknown::COUNT)
        .map(|i| {
            let [up, down] = [steps[i], -steps[i]].map(|by| {
                let mut moved = *p;
                moved[i] += by;
                ring_down(&moved, interval_s, count)
            });
            let scale = |c: usize| 1.0 / (2.0 * NOISE[c]);
            up.iter().zip(&down).map(|(u, d)| [0, 1].map(|c| (u[c] - d[c]) * scale(c))).collect()
        })
        .collect();
    let information = Mat::<f64, { unknown::COUNT }, { unknown::COUNT }>::from_fn(|i, j| {
        columns[i].iter().zip(&columns[j]).map(|(a, b)| a[0] * b[0] + a[1] * b[1]).sum()
    });
    let size: [f64; unknown::COUNT] = std::array::from_fn(|i| information.0[i][i].sqrt());
    let unit = Mat::from_fn(|i, j| information.0[i][j] / (size[i] * size[j]));
    let ldl = Ldl::of(&Covariance::from_lower(unit));
    assert!(ldl.positive);
    std::array::from_fn(|i| {
        let one: [f64; unknown::COUNT] = std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 });
        ldl.solve(&one)[i].sqrt() * steps[i] / size[i]
    })
}

/// What a laboratory believes before: stiffness 0.3 %, damping 20 %, capacitance 5 % and width 8 % wrong.
fn believed() -> ParametricScanner<f64> {
    let [k, b, c0, width] = DEVICE;
    ParametricScanner {
        resonator: TorsionalResonator { inertia: INERTIA, damping: 0.8 * b, stiffness: 1.003 * k },
        comb: GaussianComb { nominal: 1.05 * c0, angular_width: 0.92 * width, bias: 9.79e-12 },
        carrier_mean_square: 18.0,
    }
}

/// A truth that starts anywhere on an orbit of 6 to 10 degrees.
fn truth(seed: u64) -> [f64; unknown::COUNT] {
    let mut chance = WhiteNoise::new(seed, 7);
    // A monotone map to (0, 1): an even spread is not needed.
    let mut uniform = || 0.5 * (1.0 + (0.8 * chance.sample()).tanh());
    let amplitude = (6.0 + 4.0 * uniform()).to_radians();
    let (sine, cosine) = (TAU * uniform()).sin_cos();
    let rate = (DEVICE[0] / INERTIA).sqrt();
    let [k, b, c0, width] = DEVICE;
    let offsets = [2e-3 * (uniform() - 0.5), 2e-3 * (uniform() - 0.5)];
    [k, b, c0, width, amplitude * sine, amplitude * rate * cosine, offsets[0], offsets[1]]
}

struct Record {
    signal: Vec<f64>,
    angle: Vec<f64>,
}

fn noisy(clean: &[[f64; 2]], seed: u64) -> Record {
    let mut noises = [0, 1].map(|stream| WhiteNoise::new(seed, stream));
    let mut channel =
        |c: usize| clean.iter().map(|y| y[c] + NOISE[c] * noises[c].sample()).collect::<Vec<f64>>();
    Record { signal: channel(0), angle: channel(1) }
}

fn fitted(record: &Record, interval_s: f64, with_reference: bool) -> RingDownFit {
    let angle = if with_reference { &record.angle[..] } else { &[] };
    let scanner = believed();
    let signal = &record.signal;
    fit_ring_down(&RingDown { interval_s, signal, angle, scanner, bias: BIAS, gain: GAIN }, &Silent).unwrap()
}

/// Errors in units of the bound, and whether each 95 % interval held the truth.
fn judge(seed: u64, interval_s: f64, count: usize) -> ([f64; 4], [bool; 4]) {
    let p = truth(seed);
    let bound = bound(&p, interval_s, count);
    let found = fitted(&noisy(&ring_down(&p, interval_s, count), seed), interval_s, true);
    let error = |i: usize| found.fit.parameters[i] - p[i];
    let inside = |i: usize| error(i).abs() < 1.959_964 * found.fit.parameter(i).deviation;
    for i in 0..4 {
        // The fit claims what the bound says: both are computed from different derivatives.
        let claimed = found.fit.parameter(i).deviation / bound[i];
        assert!((0.9..1.1).contains(&claimed), "seed {seed}: {} claims {claimed} bounds", NAMES[i]);
    }
    (std::array::from_fn(|i| error(i) / bound[i]), std::array::from_fn(inside))
}

/// Two short records, from phases and amplitudes of their own: within the bound's reach, and the claims are the bound.
#[test]
fn a_ring_down_gives_what_the_bound_allows() {
    for seed in [1, 2] {
        let (errors, _) = judge(seed, 1e-6, 3000);
        println!("seed {seed}: errors in bounds {errors:?}");
        assert!(errors.iter().all(|e| e.abs() < 4.0), "seed {seed}: {errors:?}");
    }
}

/// 120 records of 10 ms at 5 MHz, as the paper sampled them: root mean square errors within 1.3 of the bound for each
/// parameter, and coverage of the 95 % intervals that a binomial test of 99 % accepts.
#[test]
#[ignore = "takes minutes"]
fn slow_ring_downs_reach_the_bound_and_cover() {
    const RECORDS: u64 = 120;
    let judged: Vec<([f64; 4], [bool; 4])> = std::thread::scope(|scope| {
        let half = |from: u64| {
            move || (from..RECORDS).step_by(2).map(|seed| judge(seed, 2e-7, 50_000)).collect::<Vec<_>>()
        };
        let workers = [0, 1].map(|from| scope.spawn(half(from)));
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect()
    });
    for i in 0..4 {
        let ratio = (judged.iter().map(|(e, _)| e[i] * e[i]).sum::<f64>() / RECORDS as f64).sqrt();
        let mean = judged.iter().map(|(e, _)| e[i]).sum::<f64>() / RECORDS as f64;
        let inside = judged.iter().filter(|(_, inside)| inside[i]).count() as u64;
        let binomial = Binomial::new(0.95, RECORDS).unwrap();
        let (low, high) = (binomial.inverse_cdf(0.005), binomial.inverse_cdf(0.995));
        println!(
            "{}: error/bound {ratio:.3}, mean {mean:+.3}, {inside} of {RECORDS} covered ({low} to {high} allowed)",
            NAMES[i]
        );
        assert!((0.75..=1.3).contains(&ratio), "{}: {ratio}", NAMES[i]);
        // The mean of 120 errors of 1 is 0.09.
        assert!(mean.abs() < 0.36, "{}: {mean}", NAMES[i]);
        assert!((low..=high).contains(&inside), "{}: {inside}", NAMES[i]);
    }
}

/// The bias is a spring of C₀·V²/θ₀² at small angles, 7.3·10⁻⁴ of the bars' own; over a swing of amplitude A the mean of
/// the torque weakens it by 1 − ¾·(A/θ₀)² to first order. Left out of the model it lands in k.
#[test]
fn a_bias_that_is_ignored_lands_in_the_stiffness() {
    const COUNT: usize = 2000;
    let [k, b, c0, width] = DEVICE;
    for (amplitude, width_tolerance) in [(0.02_f64, 0.01), (0.12, 0.1)] {
        let clean = ring_down(&[k, b, c0, width, amplitude, 0.0, 0.0, 0.0], 1e-6, COUNT);
        let signal: Vec<f64> = clean.iter().map(|y| y[0]).collect();
        let angle: Vec<f64> = clean.iter().map(|y| y[1]).collect();
        let with = |bias: f64| {
            let scanner = believed();
            let record =
                RingDown { interval_s: 1e-6, signal: &signal, angle: &angle, scanner, bias, gain: GAIN };
            fit_ring_down(&record, &Silent).unwrap().fit.parameters[unknown::STIFFNESS] / k - 1.0
        };
        // The amplitude falls to 0.6 meanwhile: a fit weighs its square as 0.65 of the first, or so.
        let weakened = 1.0 - 0.75 * 0.65 * (amplitude / width).powi(2);
        let expected = c0 * BIAS * BIAS / (width * width * k) * weakened;
        let (ignored, included) = (with(0.0), with(BIAS));
        println!(
            "at {amplitude} rad: k off by {ignored:.3e} (expected {expected:.3e}), with the bias {included:.1e}"
        );
        assert!((ignored / expected - 1.0).abs() < width_tolerance, "{ignored} against {expected}");
        assert!(included.abs() < 3e-7, "{included}");
    }
}

/// V_o1 alone: θ₀ and the angle grow together almost unseen, the fit says so, and its errors are as large as claimed.
#[test]
fn without_a_reference_the_scale_of_the_angle_is_hardly_known() {
    const COUNT: usize = 3000;
    for seed in [3, 4] {
        let p = truth(seed);
        let record = noisy(&ring_down(&p, 1e-6, COUNT), seed);
        let (with, without) = (fitted(&record, 1e-6, true), fitted(&record, 1e-6, false));
        assert!(with.with_reference && !without.with_reference);
        let width = |fit: &RingDownFit| fit.fit.parameter(unknown::WIDTH).deviation / p[unknown::WIDTH];
        println!("seed {seed}: theta0 to {:.1e} with, {:.1e} without", width(&with), width(&without));
        assert!(width(&without) > 30.0 * width(&with), "{} {}", width(&without), width(&with));
        let weakest = without.fit.weakest.unwrap();
        let part = |i: usize| weakest.parts[i] * weakest.parts[i];
        let (of_width, of_start) = (part(unknown::WIDTH), part(unknown::ANGLE) + part(unknown::RATE));
        println!("weakest {weakest:?}");
        assert!(of_width > 0.2 && of_start > 0.2 && of_width + of_start > 0.8, "{weakest:?}");
        // The mirror image is as good an answer.
        let sign = (without.fit.parameters[unknown::RATE] / p[unknown::RATE]).signum();
        for (i, sign) in [1.0, 1.0, 1.0, 1.0, sign, sign, 1.0].into_iter().enumerate() {
            let found = without.fit.parameter(i);
            let error = (sign * found.value - p[i]) / found.deviation;
            assert!(error.abs() < 4.0, "seed {seed}: unknown {i} is {error} deviations off");
        }
    }
}

/// Adding up charge over 10 ms: an offset of V_o1 of 24 µV, too small to be seen in it, becomes 0.56 pF, and white noise
/// √n·σ·Δt/(R_f·V) = 0.24 pF rms. The fit takes both as what they are.
#[test]
fn charge_walks_away_and_the_fit_does_not() {
    const COUNT: usize = 10_000;
    const OFFSET: f64 = 23.8e-6;
    let [k, b, c0, width] = DEVICE;
    let clean = ring_down(&[k, b, c0, width, 0.14, 2e3, OFFSET, 0.0], 1e-6, COUNT);
    let capacitance = |angle: f64| c0 * (-(angle / width).powi(2)).exp();
    let change = capacitance(clean[COUNT - 1][1]) - capacitance(clean[0][1]);
    let off = |signal: &[f64]| integrated_capacitance(signal, 1e-6, GAIN)[COUNT - 1] - change;
    let drift = OFFSET * 1e-6 * (COUNT - 1) as f64 / GAIN;
    let quiet: Vec<f64> = clean.iter().map(|y| y[0]).collect();
    assert!((off(&quiet) - drift).abs() < 0.02e-12, "{} against {drift}", off(&quiet));

    let walk = (COUNT as f64).sqrt() * NOISE[0] * 1e-6 / GAIN;
    // The root mean square of 200 is right to 5 %.
    let squares: f64 = (0..200).map(|seed| (off(&noisy(&clean, seed).signal) - drift).powi(2)).sum();
    let rms = (squares / 200.0).sqrt();
    println!("offset {:.3} pF, noise {:.3} pF rms, {:.3} expected", drift * 1e12, rms * 1e12, walk * 1e12);
    assert!((0.8..1.2).contains(&(rms / walk)), "{rms} against {walk}");

    let found = fitted(&noisy(&clean, 9), 1e-6, true);
    let (nominal, offset) = (found.fit.parameter(unknown::NOMINAL), found.fit.parameter(unknown::OFFSET));
    assert!(
        (nominal.value - c0).abs() < 4.0 * nominal.deviation && nominal.deviation < 0.1 * drift,
        "{nominal:?}"
    );
    assert!((offset.value - OFFSET).abs() < 4.0 * offset.deviation, "{offset:?}");
}

#[test]
fn what_is_no_ring_down_is_refused() {
    let attempt = |signal: &[f64]| {
        let scanner = believed();
        fit_ring_down(
            &RingDown { interval_s: 1e-6, signal, angle: &[], scanner, bias: BIAS, gain: GAIN },
            &Silent,
        )
        .map(|found| found.fit.parameters)
    };
    assert!(matches!(attempt(&[0.1; 100]), Err(RingDownError::TooShort { .. })));
    assert!(matches!(attempt(&[]), Err(RingDownError::TooShort { .. })));
    assert_eq!(attempt(&vec![0.0; 3000]), Err(RingDownError::NoMotion));
    assert_eq!(attempt(&vec![f64::NAN; 3000]), Err(RingDownError::NoMotion));
}

const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
const CIRCUIT: [f64; 2] = [-0.3574e12, 6.3945];
const MOTION_HZ: f64 = 15.625e3;

/// Time, angle and capacitance of a steady motion of 9 degrees at 1 MHz: whole cycles of 64 samples.
fn motion(count: usize) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let time: Vec<f64> = (0..count).map(|k| k as f64 * 1e-6).collect();
    let angle: Vec<f64> = time.iter().map(|t| 9_f64.to_radians() * (TAU * MOTION_HZ * t).sin()).collect();
    let capacitance = angle.iter().map(|a| 5.71e-12 * (-(a / 0.2).powi(2)).exp() + 9.79e-12).collect();
    (time, angle, capacitance)
}

fn steady<'a>(time_s: &'a [f64], angle: &'a [f64], signal: &'a [f64]) -> SteadyState<'a> {
    let comb_covariance = Covariance::zero();
    SteadyState { time_s, interval_s: 1e-6, signal, angle, comb: COMB, comb_covariance }
}

/// Gain and offset over 200 records: errors as large as the closed form of a line says, and the claims are that.
#[test]
fn gain_and_offset_have_the_errors_of_a_line() {
    const COUNT: usize = 1280;
    const RECORDS: u64 = 200;
    let (_, _, c) = motion(COUNT);
    let n = COUNT as f64;
    let sigma = 1.92e-4_f64.sqrt();
    let mean = c.iter().sum::<f64>() / n;
    let spread: f64 = c.iter().map(|c| (c - mean).powi(2)).sum();
    let exact = [sigma / spread.sqrt(), sigma * (1.0 / n + mean * mean / spread).sqrt()];
    let mut squares = [0.0; 2];
    let mut inside = [0; 2];
    for seed in 0..RECORDS {
        let mut noise = WhiteNoise::new(seed, 11);
        let y: Vec<f64> = c.iter().map(|c| CIRCUIT[0] * c + CIRCUIT[1] + sigma * noise.sample()).collect();
        let line = fit_affine(&c, &y).unwrap();
        for (i, found) in [line.slope(), line.at(0.0)].into_iter().enumerate() {
            assert!(
                (found.deviation / exact[i] - 1.0).abs() < 0.12,
                "seed {seed}: {}",
                found.deviation / exact[i]
            );
            squares[i] += ((found.value - CIRCUIT[i]) / exact[i]).powi(2);
            inside[i] += u64::from((found.value - CIRCUIT[i]).abs() < 1.959_964 * found.deviation);
        }
    }
    for (square, inside) in squares.into_iter().zip(inside) {
        let ratio = (square / RECORDS as f64).sqrt();
        let below = Binomial::new(0.95, RECORDS).unwrap().cdf(inside);
        println!("error/closed form {ratio:.3}, {inside} of {RECORDS} covered");
        assert!((0.85..1.15).contains(&ratio) && (0.005..0.9975).contains(&below), "{ratio} {inside}");
    }
}

/// Without poles none are found, and C₀'s error of 1 % is one of the gain: only a·C₀ is observable.
#[test]
fn only_the_products_are_observable() {
    let (time, angle, c) = motion(1280);
    let mut noise = WhiteNoise::new(5, 12);
    let y: Vec<f64> = c.iter().map(|c| CIRCUIT[0] * c + CIRCUIT[1] + 0.0139 * noise.sample()).collect();
    let mut record = steady(&time, &angle, &y);
    let plain = fit_steady_state(&record, &Silent).unwrap().unwrap();
    assert!(plain.poles.is_none());
    record.comb.nominal *= 1.01;
    record.comb.bias *= 1.5;
    record.comb_covariance = Covariance::from_standard_deviations([0.01 * COMB.nominal, 0.0]);
    let other = fit_steady_state(&record, &Silent).unwrap().unwrap();
    assert!((other.gain.value / plain.gain.value * 1.01 - 1.0).abs() < 1e-9);
    assert!((other.swing.value / plain.swing.value - 1.0).abs() < 1e-9);
    assert!((other.level.value - plain.level.value).abs() < 1e-9);
    // The doubt of C₀ is one of the gain and not of the product.
    let doubt = (other.gain.deviation.powi(2) - (plain.gain.deviation / 1.01).powi(2)).sqrt();
    assert!((doubt / (0.01 * other.gain.value.abs() / 1.01) - 1.0).abs() < 1e-3, "{doubt}");
    assert!((other.swing.deviation / plain.swing.deviation - 1.0).abs() < 1e-3);
}

/// A circuit of two poles at 40.8 and 41.1 kHz: each harmonic of C through its gain and lag, computed from the Fourier
/// series. The fit with two equal poles finds their geometric mean, gain and offset; the affine one is far off.
#[test]
fn the_poles_of_the_demodulator_are_found() {
    const PERIOD: usize = 64;
    const COUNT: usize = 40 * PERIOD;
    let (time, angle, c) = motion(COUNT);
    let mut filtered = vec![0.0; PERIOD];
    for harmonic in 0..=PERIOD / 2 {
        let phase = |k: usize| TAU * (harmonic * k % PERIOD) as f64 / PERIOD as f64;
        let part = |f: fn(f64) -> f64| (0..PERIOD).map(|k| c[k] * f(phase(k))).sum::<f64>() / PERIOD as f64;
        let (re, im) = (part(f64::cos), -part(f64::sin));
        let (mut gain, mut lag) = (1.0, 0.0_f64);
        for pole in [40.8e3, 41.1e3] {
            let ratio = harmonic as f64 * MOTION_HZ / pole;
            gain /= (1.0 + ratio * ratio).sqrt();
            lag += ratio.atan();
        }
        let twice = if harmonic == 0 || harmonic == PERIOD / 2 { 1.0 } else { 2.0 };
        for (k, y) in filtered.iter_mut().enumerate() {
            let at = phase(k) - lag;
            *y += twice * gain * (re * at.cos() - im * at.sin());
        }
    }
    let mut noise = WhiteNoise::new(6, 13);
    let y: Vec<f64> =
        (0..COUNT).map(|k| CIRCUIT[0] * filtered[k % PERIOD] + CIRCUIT[1] + 2e-3 * noise.sample()).collect();
    let found = fit_steady_state(&steady(&time, &angle, &y), &Silent).unwrap().unwrap();
    let poles = found.poles.as_ref().unwrap();
    let frequency = poles.frequency_hz();
    println!("poles {frequency:?}, gain {:?}, offset {:?}", poles.fit.parameter(1), poles.fit.parameter(2));
    println!("left: affine {:.4}, poles {:.4}", found.affine_residual(&y), found.poles_residual(&y).unwrap());
    assert!((frequency.value - (40.8e3_f64 * 41.1e3).sqrt()).abs() < 4.0 * frequency.deviation);
    for (i, truth) in CIRCUIT.into_iter().enumerate() {
        let part = poles.fit.parameter(i + 1);
        assert!((part.value - truth).abs() < 4.0 * part.deviation, "{part:?}");
    }
    assert!((poles.fit.residual_deviation() / 2e-3 - 1.0).abs() < 0.06);
    assert!(poles.whiteness.is_white() && !found.affine.whiteness.is_white());
    assert!(found.affine_residual(&y) > 0.3);
}
