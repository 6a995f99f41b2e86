//! The detector against closed forms, and its stream against its batch.

use crate::chance::{Chance, spread};
use kalmems_core::detect::{
    CubicDesign, CubicFit, DetectError, Detection, Detector, HoldLevel, Peak, SlopeDesign, SlopeKernel,
    Threshold, angle_at, peaks,
};
use kalmems_core::{
    Covariance, Ekf, Filter, LinearMeasurement, LinearProcess, Mat, NoiseDensity, Scalar,
    discretize::matrix_exponential,
};
use proptest::prelude::*;
use std::f64::consts::PI;

/// The width of most kernels here, in samples.
const S: f64 = 15.0;

fn kernel() -> SlopeKernel<f64, 60> {
    SlopeKernel::new(S).unwrap()
}

fn responses<T: Scalar, const HALF: usize>(kernel: &SlopeKernel<T, HALF>, signal: &[T]) -> Vec<T> {
    let mut out = vec![T::of(0.0); signal.len()];
    kernel.responses(signal, &mut out);
    out
}

/// An edge of this height whose slope is a bell of standard deviation `width` around `time`: ½·erf.
fn edge(k: usize, time: f64, width: f64) -> f64 {
    0.5 * libm::erf((k as f64 - time) / (width * 2.0_f64.sqrt()))
}

/// All that a stream finds, what is due after its end included.
fn stream<T: Scalar, const HALF: usize, const REACH: usize, const MEMORY: usize>(
    mut detector: Detector<T, HALF, REACH, MEMORY>,
    signal: &[T],
) -> Vec<Detection<T>> {
    let rest = std::iter::repeat_n(T::of(f64::NAN), Detector::<T, HALF, REACH, MEMORY>::LOOK_AHEAD);
    signal.iter().copied().chain(rest).filter_map(|sample| detector.push(sample)).collect()
}

#[test]
fn the_response_to_a_bell_of_slope_is_a_wider_bell() {
    let width = 20.0;
    let signal: Vec<f64> = (0..600).map(|k| edge(k, 300.3, width)).collect();
    // Five s on each side: less than 10⁻⁵ is cut off.
    let kernel = SlopeKernel::<f64, 75>::new(S).unwrap();
    let found: Vec<Peak<f64>> = peaks(&responses(&kernel, &signal), 100, Threshold::fixed(1e-3)).collect();
    assert_eq!(found.len(), 1);
    let square = S * S + width * width;
    let height = (-0.3_f64.powi(2) / (2.0 * square)).exp() / (2.0 * PI * square).sqrt();
    assert_eq!(found[0].index, 300);
    assert!((found[0].height / height - 1.0).abs() < 1e-4, "{}", found[0].height / height);
    assert!((found[0].fraction - 0.3).abs() < 1e-3, "{}", found[0].fraction);
    // The curvature by three samples is that of the bell but for 1/(4·625).
    assert!((found[0].curvature * square / -height - 1.0).abs() < 2e-3);
    // Falling edges are found by the other sign alone.
    let falling: Vec<f64> = signal.iter().map(|y| -y).collect();
    assert_eq!(peaks(&responses(&kernel, &falling), 100, Threshold::fixed(1e-3)).count(), 0);
    let other = peaks(&responses(&kernel.falling(), &falling), 100, Threshold::fixed(1e-3)).next().unwrap();
    assert_eq!(other, found[0]);
}

#[test]
fn gains_are_those_of_a_gaussian_in_continuous_time() {
    let wide = SlopeKernel::<f64, 120>::new(S).unwrap();
    // ∫g² = 1/(4·√π·s³), ∫g′² = 3/(8·√π·s⁵).
    let noise = (4.0 * PI.sqrt() * S.powi(3)).sqrt().recip();
    assert!((wide.noise_deviation(1.0) / noise - 1.0).abs() < 1e-8);
    let jitter = 3.0 / (8.0 * PI.sqrt() * S.powi(5));
    assert!((wide.timing_variance(1.0, -1.0) / jitter - 1.0).abs() < 1e-8);
    // Rice: all maxima, √(5/2)/(2π·s), and those far up, √(3/2)/(2π·s)·e^{−η²/2}.
    let maxima = wide.noise_maxima();
    assert!((maxima.above(-30.0) * 2.0 * PI * S / 2.5_f64.sqrt() - 1.0).abs() < 1e-6);
    let crossings = 1.5_f64.sqrt() / (2.0 * PI * S) * (-18.0_f64).exp();
    assert!((maxima.above(6.0) / crossings - 1.0).abs() < 1e-4);
    // A cubic's value at the centre: ∫φ²·((3 − u²)/2)² = 27/(32·√π·s).
    let fit = CubicFit::<f64, 180>::new(30.0).unwrap();
    let ramp: Vec<f64> = (0..361).map(|k| f64::from(k) - 180.0).collect();
    let variance = fit.crossing(&ramp, 180, 0.0, 1.0).unwrap().timing_variance;
    assert!((variance * 32.0 * PI.sqrt() * 30.0 / 27.0 - 1.0).abs() < 1e-6, "{variance}");
}

#[test]
fn a_cubic_is_fitted_exactly_and_its_nearest_zero_found() {
    let fit = CubicFit::<f64, 90>::new(30.0).unwrap();
    let signal: Vec<f64> = (0..400)
        .map(|k| {
            let u = (f64::from(k) - 207.25) / 100.0;
            0.7 + 0.5 * u * (1.0 + 0.3 * u - 0.2 * u * u)
        })
        .collect();
    for centre in [180, 207, 230] {
        let found = fit.crossing(&signal, centre, 0.7, 1e-6).unwrap();
        assert!((centre as f64 + found.displacement - 207.25).abs() < 1e-6, "{centre}: {found:?}");
        assert!((found.slope - 0.005).abs() < 1e-10);
    }
    // Beyond the ends, in a gap, or without a zero near: nothing.
    assert_eq!(fit.crossing(&signal, 89, 0.7, 1e-6), None);
    assert_eq!(fit.crossing(&signal, 310, 0.7, 1e-6), None);
    assert_eq!(fit.crossing(&signal, 207, 9.7, 1e-6), None);
    assert_eq!(fit.crossing(&[0.7; 400], 207, 0.7, 1e-6), None);
    let mut gap = signal;
    gap[150] = f64::NAN;
    assert_eq!(fit.crossing(&gap, 207, 0.7, 1e-6), None);
}

/// Noise alone: detections per sample at a threshold, over so many samples.
fn alarms<const HALF: usize>(
    kernel: &SlopeKernel<f64, HALF>,
    reach: usize,
    threshold: Threshold<f64>,
    seed: u64,
    samples: usize,
) -> usize {
    let mut chance = Chance::new(seed);
    let noise: Vec<f64> = (0..samples).map(|_| chance.gaussian()).collect();
    peaks(&responses(kernel, &noise), reach, threshold).count()
}

/// The counts within which a Poisson count of this mean lies, but for a chance of 10⁻⁴; clumps make it no wider.
fn near(count: usize, mean: f64, bias: f64) -> bool {
    (count as f64 - mean).abs() < 3.9 * mean.sqrt() + bias * mean
}

#[test]
fn noise_has_the_number_of_maxima_that_rice_predicts() {
    let samples = 1_000_000;
    let mut seed = 1;
    let check = |count: usize, mean: f64, bias: f64| {
        println!("{count} maxima, {mean:.1} expected");
        assert!(near(count, mean, bias), "{count} maxima, {mean} expected");
    };
    for deviations in [0.0, 1.0, 2.0, 3.0] {
        let kernel = kernel();
        let level = Threshold::fixed(deviations * kernel.noise_deviation(1.0));
        let count = alarms(&kernel, 0, level, seed, samples);
        check(count, kernel.noise_maxima().above(deviations) * samples as f64, 0.0);
        // Narrow kernels have more.
        let narrow = SlopeKernel::<f64, 20>::new(5.0).unwrap();
        let level = Threshold::fixed(deviations * narrow.noise_deviation(1.0));
        let count = alarms(&narrow, 0, level, seed + 1, samples / 2);
        check(count, narrow.noise_maxima().above(deviations) * samples as f64 / 2.0, 0.01);
        seed += 2;
    }
}

#[test]
fn a_threshold_has_the_rate_of_false_alarms_that_was_asked_for() {
    let (kernel, samples, reach) = (kernel(), 1_000_000, 150);
    // Maxima that follow each other closely are not quite independent: a few per cent.
    let bias = 0.06;
    let hold = HoldLevel { deviations: 2.0, samples: 600 };
    for (seed, per_sample) in [(21, 1.4e-3), (22, 5e-4), (23, 1e-4)] {
        let level = Threshold::for_false_alarms(&kernel, 1.0, per_sample, reach, None).unwrap();
        let count = alarms(&kernel, reach, level, seed, samples);
        println!("{count} alone, {}", per_sample * samples as f64);
        assert!(near(count, per_sample * samples as f64, bias), "{count} for {per_sample}");
    }
    for (seed, per_sample) in [(31, 5e-4), (32, 2e-4)] {
        let level = Threshold::for_false_alarms(&kernel, 1.0, per_sample, reach, Some(hold)).unwrap();
        assert!(level.keep() < level.acquire());
        let count = alarms(&kernel, reach, level, seed, samples);
        println!("{count} with a lower level while following, {}", per_sample * samples as f64);
        // A false alarm brings others with it: counts spread by up to √2.4 more.
        assert!(near(count, per_sample * samples as f64, 2.0 * bias), "{count} for {per_sample}");
    }
}

/// A table made before a program is has the numbers of the program's kernel and fit.
#[test]
fn a_design_is_what_the_kernel_weighs_with() {
    let (kernel, design) = (SlopeKernel::<f64, 7>::new(2.5).unwrap(), SlopeDesign::new(2.5, 7).unwrap());
    for n in 1..=7 {
        let mut impulse = [0.0; 15];
        impulse[7 + n] = 1.0;
        assert_eq!(kernel.response(&impulse), design.weight(n));
    }
    assert_eq!(kernel.noise_deviation(1.0), design.noise_gain().sqrt());
    // A cubic is fitted exactly, and its value at the centre by weights with the sum one.
    let fit = CubicDesign::new(3.0, 9).unwrap();
    let [zeroth, second, fourth, _] = fit.moments;
    let weight = |n: usize| {
        fit.weight(n) * (fourth - second * (n as f64 / 3.0).powi(2)) / (zeroth * fourth - second.powi(2))
    };
    let both = |f: &dyn Fn(usize) -> f64| f(0) + 2.0 * (1..=9).map(f).sum::<f64>();
    assert!((both(&weight) - 1.0).abs() < 1e-12);
    assert!(both(&|n| weight(n) * (n as f64).powi(2)).abs() < 1e-12);
    assert!((both(&|n| weight(n).powi(2)) / fit.noise_gain - 1.0).abs() < 1e-12);
}

#[test]
fn what_cannot_be_is_refused() {
    for width in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(SlopeKernel::<f64, 5>::new(width), Err(DetectError::Width { .. })));
        assert!(matches!(CubicFit::<f64, 5>::new(width), Err(DetectError::Width { .. })));
    }
    let with = |noise, rate| Threshold::for_false_alarms(&kernel(), noise, rate, 150, None);
    assert!(matches!(with(0.0, 1e-4), Err(DetectError::Noise { .. })));
    assert!(matches!(with(f64::NAN, 1e-4), Err(DetectError::Noise { .. })));
    for rate in [0.0, -1.0, f64::NAN, 1.0, 1.0 / 300.0] {
        assert!(matches!(with(1.0, rate), Err(DetectError::Rate { .. })), "{rate}");
    }
    // A tail this thin still has a level.
    let level = with(1.0, 1e-30).unwrap().acquire() / kernel().noise_deviation(1.0);
    assert!((11.0..12.0).contains(&level), "{level}");
}

/// It owns its memory and is `Copy`: it cannot grow.
#[test]
fn a_detector_is_as_large_as_its_type() {
    const fn copied<T: Copy>() -> usize {
        size_of::<T>()
    }
    let bytes = copied::<Detector<f64, 60, 150, 400>>();
    println!("{bytes} bytes");
    // 400 samples twice, 60 weights, 150 maxima of four numbers, and less than 200 bytes besides.
    assert!((8 * (800 + 60 + 600)..8 * (800 + 60 + 600) + 200).contains(&bytes), "{bytes}");
}

/// Times found in noisy copies of an edge: by the parabola, by the zero crossing, and the mean of the variances told.
struct Timing {
    slope: (f64, f64),
    zero: (f64, f64),
    told: [f64; 2],
}

fn timing(noise: f64, width: f64, trials: usize) -> Timing {
    let fit = CubicFit::<f64, 90>::new(30.0).unwrap();
    let detector =
        || Detector::new(kernel(), Threshold::fixed(10.0 * kernel().noise_deviation(noise)), noise * noise);
    let mut chance = Chance::new(5);
    let (mut slopes, mut zeros, mut told) = (vec![], vec![], [0.0; 2]);
    for _ in 0..trials {
        let time = 299.5 + chance.uniform();
        let mut detector: Detector<f64, 60, 150, 401> = detector();
        for k in 0..620 {
            let sample = edge(k, time, width) + noise * chance.gaussian();
            if let Some(found) = detector.push(sample) {
                slopes.push(found.index as f64 + found.fraction - time);
                let zero = detector.crossing(&fit, 0.0).unwrap();
                zeros.push(found.index as f64 + zero.displacement - time);
                told[0] += found.timing_variance;
                told[1] += zero.timing_variance;
            }
        }
    }
    assert_eq!(slopes.len(), trials);
    Timing { slope: spread(&slopes), zero: spread(&zeros), told: told.map(|sum| sum / trials as f64) }
}

#[test]
fn crossing_times_scatter_with_the_claimed_variances() {
    let (noise, width, trials) = (0.02, 20.0, 400);
    let timing = timing(noise, width, trials);
    // Canny's, for the curvature of the bell.
    let square = S * S + width * width;
    let curvature = -1.0 / ((2.0 * PI).sqrt() * square.powf(1.5));
    let canny = kernel().timing_variance(noise * noise, curvature).sqrt();
    println!("slope {:?}, Canny {canny}, told {}", timing.slope, timing.told[0].sqrt());
    println!("zero {:?}, told {}", timing.zero, timing.told[1].sqrt());
    // A standard deviation of 400 trials is known to 3.5 %.
    assert!((timing.slope.1 / canny - 1.0).abs() < 0.12);
    assert!((timing.told[0].sqrt() / canny - 1.0).abs() < 0.1);
    assert!((timing.zero.1 / timing.told[1].sqrt() - 1.0).abs() < 0.12);
    for (mean, deviation) in [timing.slope, timing.zero] {
        assert!(mean.abs() < 4.0 * deviation / (trials as f64).sqrt());
    }
}

/// The variance of the place of the highest maximum of an edge's response in noise, over Canny's, by the density of maxima.
///
/// Units: the noise's standard deviation, and the distance 1/β over which it changes. The edge's response is a parabola
/// −κ·t²/2, κ = 1/q. Rice: the density of maxima at t of height u, times the chance e^{−U} that none is higher, U the
/// crossings of u towards the middle beyond those that the parabola brings by itself.
fn competing(q: f64) -> f64 {
    let normal = |x: f64| (-x * x / 2.0).exp() / (2.0 * PI).sqrt();
    let below = |x: f64| 0.5 * libm::erfc(-x / 2.0_f64.sqrt());
    // λ₀ = λ₂ = 1 and λ₄ = (5/2s²)/(3/2s²); the second derivative given the height.
    let spread = (5.0_f64 / 3.0 - 1.0).sqrt();
    let kappa = 1.0 / q;
    let (extent, steps) = ((6.0 * q / (1.0 + q).sqrt()).min(12.0 * (2.0 * q).sqrt() + 3.0), 300_usize);
    let step = extent / steps as f64;
    let (mut squares, mut mass) = (0.0, 0.0);
    for height in -45..65 {
        let u = 0.1 * f64::from(height);
        let (mut crossings, mut here, mut spread_here) = (0.0, 0.0, 0.0);
        for i in 0..=steps {
            let t = step * i as f64;
            let weight = if i == 0 || i == steps { 1.0 } else { 2.0 };
            let (x, slope) = (u + kappa * t * t / 2.0, kappa * t);
            let rate = normal(x) * (normal(slope) + slope * below(slope)) - normal(x) * slope;
            crossings += weight * step * rate.max(0.0) / below(x);
            let mean = -kappa - x;
            let bend = spread * normal(mean / spread) - mean * below(-mean / spread);
            let density = weight * step * normal(slope) * normal(x) * bend;
            here += density;
            spread_here += density * t * t;
        }
        squares += spread_here * (-crossings).exp();
        mass += here * (-crossings).exp();
    }
    squares / mass / (q * q)
}

#[test]
fn the_highest_of_several_maxima_is_as_near_as_rice_predicts() {
    // β² = ∫g″²…: of the derivative of a Gaussian λ₂/λ₀ = 3/(2s²).
    let beta = (1.5_f64).sqrt() / S;
    let jitter = 3.0 / (8.0 * PI.sqrt() * S.powi(5));
    for q in [0.05, 0.2, 0.5, 1.0, 2.0, 4.0, 6.5, 10.0, 20.0, 40.0] {
        // The curvature at which Canny's standard deviation is q/β.
        let curvature = jitter.sqrt() * beta / q;
        let told = kernel().timing_variance(1.0, -curvature) / (q / beta).powi(2);
        let rice = competing(q);
        println!("q = {q}: {:.3} of Canny's, {:.3} by Rice", told.sqrt(), rice.sqrt());
        assert!((told / rice).sqrt().ln().abs() < 0.05, "{q}: {told} {rice}");
    }
}

#[test]
fn single_precision_finds_the_same() {
    let mut chance = Chance::new(9);
    let signal: Vec<f64> =
        (0..20_000).map(|k| (2.0 * PI * f64::from(k) / 800.3).sin() + 0.3 * chance.gaussian()).collect();
    let narrow: Vec<f32> = signal.iter().map(|y| f32::of(*y)).collect();
    let level = 4.0 * kernel().noise_deviation(0.3);
    let double = stream(Detector::<f64, 60, 150, 401>::new(kernel(), Threshold::fixed(level), 0.09), &signal);
    let kernel = SlopeKernel::<f32, 60>::new(S).unwrap();
    let single =
        stream(Detector::<f32, 60, 150, 401>::new(kernel, Threshold::fixed(f32::of(level)), 0.09), &narrow);
    assert!(double.len() >= 24);
    assert_eq!(double.len(), single.len());
    for (a, b) in double.iter().zip(&single) {
        let apart = a.index as f64 - b.index as f64 + a.fraction - f64::from(b.fraction);
        assert!(apart.abs() < 0.1, "{a:?} {b:?}");
    }
}

#[test]
fn a_gap_is_not_bridged_and_hides_only_its_own_crossings() {
    let clean: Vec<f64> = (0..4000).map(|k| (2.0 * PI * f64::from(k) / 800.0).sin()).collect();
    let find = |signal: &[f64]| -> Vec<u64> {
        let detector = Detector::<f64, 60, 150, 401>::new(kernel(), Threshold::fixed(1e-3), 1.0);
        stream(detector, signal).iter().map(|found| found.index).collect()
    };
    assert_eq!(find(&clean), [800, 1600, 2400, 3200]);
    let with_gap = |from: usize, to: usize| {
        let mut signal = clean.clone();
        signal[from..to].fill(f64::NAN);
        find(&signal)
    };
    // One missing sample within the kernel of a crossing hides it, on either side or at its middle.
    for hidden in [1541, 1600, 1659] {
        assert_eq!(with_gap(hidden, hidden + 1), [800, 2400, 3200], "{hidden}");
    }
    // Farther away it does not, and its time is that without a gap.
    for elsewhere in [1538, 1662, 2000] {
        assert_eq!(with_gap(elsewhere, elsewhere + 1), [800, 1600, 2400, 3200], "{elsewhere}");
    }
    // A long gap, with a jump over it: the jump is no edge.
    assert_eq!(with_gap(900, 1500), [800, 1600, 2400, 3200]);
    let mut jump = vec![-1.0; 500];
    jump.extend([f64::NAN; 3]);
    jump.extend([1.0; 500]);
    assert!(find(&jump).is_empty());
}

#[test]
fn of_equal_maxima_near_each_other_the_first_is_taken() {
    // Every sixth response is the same to the last bit.
    let signal: Vec<f64> = (0..60).map(|k| [0.0, 1.0, 3.0, 4.0, 3.0, 1.0][k % 6]).collect();
    let kernel = SlopeKernel::<f64, 3>::new(1.0).unwrap();
    for (reach, count) in [(7, 1), (6, 1), (5, 9)] {
        let slope = responses(&kernel, &signal);
        assert_eq!(peaks(&slope, reach, Threshold::fixed(0.1)).count(), count, "{reach}");
    }
    let found = stream(Detector::<f64, 3, 6, 20>::new(kernel, Threshold::fixed(0.1), 1.0), &signal);
    assert_eq!(found.len(), 1);
    assert!(found[0].index < 10);
}

#[test]
fn following_a_motion_lowers_the_level_and_its_end_raises_it() {
    // Edges of 6 σ, 3 σ and 3 σ, 400 samples apart, and one of 3 σ long after.
    let deviation = kernel().noise_deviation(1.0);
    let edge_of = |k: usize, time: f64, height: f64| {
        height * deviation * 25.0 * (2.0 * PI).sqrt() * edge(k, time, 20.0)
    };
    let signal: Vec<f64> = (0..5000)
        .map(|k| {
            [(400.0, 6.0), (800.0, 3.0), (1200.0, 3.0), (4000.0, 3.0)]
                .iter()
                .map(|(time, height)| edge_of(k, *time, *height))
                .sum()
        })
        .collect();
    let rate = 2e-5;
    let hold = Some(HoldLevel { deviations: 2.0, samples: 600 });
    let found = |hold| -> Vec<u64> {
        let threshold = Threshold::for_false_alarms(&kernel(), 1.0, rate, 150, hold).unwrap();
        let detector = Detector::<f64, 60, 150, 401>::new(kernel(), threshold, 1.0);
        stream(detector, &signal).iter().map(|found| found.index).collect()
    };
    assert_eq!(found(None), [400]);
    assert_eq!(found(hold), [400, 800, 1200]);
}

#[test]
fn a_late_crossing_gives_the_estimate_of_one_in_time() {
    // Without process noise the state then and the state now are one another's image.
    let omega = 2.0 * PI * 624.6;
    let a = Mat([[0.0, 1.0], [-omega * omega, -2.0 * 0.0066 * omega]]);
    let interval = 2e-6;
    let density = NoiseDensity::none();
    let step = LinearProcess::<f64, 2, 0>::exact(&a, &Mat::zero(), &density, interval);
    let start = Ekf::new([0.004, 560.0], Covariance::from_variances([1e-5, 400.0]));
    let r = Covariance::from_variances([1e-7]);
    let angle = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };
    let mut in_time = start;
    in_time.update(&angle, &[0.0037], &r).unwrap();
    // Half a sample more than a whole number: the crossing was between two samples.
    let half = matrix_exponential(&a.scaled(-0.5 * interval));
    for lag in [1_u32, 60, 195] {
        let (mut late, mut then) = (start, in_time);
        for _ in 0..lag {
            late.predict(&step, &[]).unwrap();
            then.predict(&step, &[]).unwrap();
        }
        let delay = f64::from(lag) * interval;
        late.update(&angle_at(&a, delay), &[0.0037], &r).unwrap();
        for i in 0..2 {
            let scale = late.covariance().get(i, i).sqrt();
            assert!((late.mean()[i] - then.mean()[i]).abs() < 1e-7 * scale);
            let apart = late.covariance().get(i, i) - then.covariance().get(i, i);
            assert!(apart.abs() < 1e-6 * scale * scale, "{lag} {i}");
        }
        let between = angle_at(&a, delay + 0.5 * interval).matrix;
        let expected = angle_at(&a, delay).matrix;
        for j in 0..2 {
            let product: f64 =
                (0..2).map(|k| half.0[0][k] * matrix_exponential(&a.scaled(-delay)).0[k][j]).sum();
            assert!((between.0[0][j] - product).abs() < 1e-9 * product.abs() + 1e-15);
            assert!(between.0[0][j] != expected.0[0][j]);
        }
    }
}

/// A sample: coarse, so that responses are often equal, and now and then missing.
fn sample() -> impl Strategy<Value = f64> {
    prop_oneof![
        40 => (-3_i32..=3).prop_map(f64::from),
        10 => -5.0..5.0_f64,
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn a_stream_finds_what_the_batch_finds(
        signal in prop::collection::vec(sample(), 0..300),
        width in 0.5..4.0_f64,
        level in 0.0..0.5_f64,
        hold in 0.0..2.0_f64,
    ) {
        let kernel = SlopeKernel::<f64, 3>::new(width).unwrap();
        let fixed = Threshold::fixed(level);
        let hold = Some(HoldLevel { deviations: hold, samples: 20 });
        let two = Threshold::for_false_alarms(&kernel, 1.0, 0.01, 7, hold).unwrap();
        for threshold in [fixed, two] {
            let slope = responses(&kernel, &signal);
            let batch: Vec<Peak<f64>> = peaks(&slope, 7, threshold).collect();
            let found = stream(Detector::<f64, 3, 7, 20>::new(kernel, threshold, 1.0), &signal);
            prop_assert_eq!(batch.len(), found.len());
            for (peak, detection) in batch.iter().zip(&found) {
                prop_assert_eq!(peak.index, detection.index);
                prop_assert_eq!(peak.height.to_bits(), detection.slope.to_bits());
                prop_assert_eq!(peak.fraction.to_bits(), detection.fraction.to_bits());
            }
            // What a detection is, said once more: the highest for seven samples on either side.
            for peak in &batch {
                let k = usize::try_from(peak.index).unwrap();
                prop_assert!(signal[k - 3..=k + 3].iter().all(|sample| sample.is_finite()));
                prop_assert!(peak.fraction.abs() <= 0.5 && peak.curvature < 0.0);
            }
            for pair in batch.windows(2) {
                prop_assert!(pair[1].index - pair[0].index > 7);
            }
        }
    }

    #[test]
    fn a_zero_crossing_of_the_stream_is_that_of_the_batch(seed in 0_u64..1000) {
        let mut chance = Chance::new(seed);
        let signal: Vec<f64> = (0..3000)
            .map(|k| (2.0 * PI * f64::from(k) / 310.0).sin() + 0.2 * chance.gaussian())
            .collect();
        let fit = CubicFit::<f64, 90>::new(30.0).unwrap();
        let threshold = Threshold::fixed(3.0 * kernel().noise_deviation(0.2));
        let mut detector = Detector::<f64, 60, 150, 401>::new(kernel(), threshold, 0.04);
        let mut compared = 0;
        for &sample in &signal {
            let Some(found) = detector.push(sample) else { continue };
            let here = detector.crossing(&fit, 0.05);
            let batch = fit.crossing(&signal, usize::try_from(found.index).unwrap(), 0.05, 0.04);
            prop_assert_eq!(here, batch);
            compared += usize::from(here.is_some());
        }
        prop_assert!(compared >= 8);
    }
}
