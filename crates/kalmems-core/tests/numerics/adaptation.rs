//! Noise and models found while filtering, against the truth that made the data. `--nocapture` prints the
//! figures.

use crate::chance::{Chance, binomial_interval, minus, plus, spread};
use kalmems_core::adapt::{Bank, Bounds, InnovationWindow, Score};
use kalmems_core::consistency::{Consistency, nees};
use kalmems_core::{
    Covariance, Dual, Ekf, Filter, FilterError, Kalman, LinearMeasurement, LinearProcess, Mat, NoiseDensity,
    Process, Scalar, SigmaPoints, Ukf,
};
use proptest::prelude::*;
use std::array;

const SEEDS: u32 = 100;

/// A resonator of 1 kHz and quality 20, sampled at 10 kHz; position and velocity/ω. Q for a density on the
/// velocity.
fn resonator(frequency: f64, density: f64) -> LinearProcess<f64, 2, 0> {
    let w = std::f64::consts::TAU * frequency;
    let noise = NoiseDensity::none().on::<1>(density);
    LinearProcess::exact(&Mat([[0.0, w], [-w, -w / 20.0]]), &Mat::zero(), &noise, 1e-4)
}

const DENSITY: f64 = 500.0;
const POSITION: LinearMeasurement<f64, 2, 1> = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };
const BOTH: LinearMeasurement<f64, 2, 2> = LinearMeasurement { matrix: Mat([[1.0, 0.0], [0.3, 1.0]]) };

/// A simulated resonator and its noisy measurements.
struct Device {
    process: LinearProcess<f64, 2, 0>,
    x: [f64; 2],
    chance: Chance,
}

impl Device {
    fn new(seed: u64) -> Self {
        Self { process: resonator(1000.0, DENSITY), x: [0.0; 2], chance: Chance::new(seed) }
    }

    fn sample<const M: usize>(
        &mut self,
        h: &LinearMeasurement<f64, 2, M>,
        r: &Covariance<f64, M>,
    ) -> [f64; M] {
        let noise = self.chance.vector(self.process.noise.covariance());
        self.x = plus(self.process.step(&self.x, &[]), noise);
        plus(h.matrix.times_vector(&self.x), self.chance.vector(r))
    }
}

/// Mean over the seeds, its standard error, and the spread of one estimate.
fn report(name: &str, values: &[f64]) -> (f64, f64) {
    let (mean, deviation) = spread(values);
    let error = deviation / (values.len() as f64).sqrt();
    println!("{name}: {mean:.4} ± {error:.4}, one seed ± {deviation:.4}");
    (mean, error)
}

#[test]
fn a_window_finds_r_from_ten_times_too_much_and_too_little() {
    // Two correlated channels. Blocks of 500 samples, 20 to converge and 20 averaged.
    let truth = Covariance::from_lower(Mat([[1.0, 0.0], [0.4, 0.5]]));
    for wrong in [10.0, 0.1] {
        let start = Covariance::<f64, 2>::from_variances([wrong, 0.5 * wrong]);
        let (mut entries, mut nis) = ([Vec::new(), Vec::new(), Vec::new()], Vec::new());
        for seed in 0..u64::from(SEEDS) {
            let mut device = Device::new(seed);
            let mut filter = Kalman::new([0.0; 2], Covariance::from_variances([1.0; 2]));
            let (mut r, mut window) = (start, InnovationWindow::new(1.0));
            let (mut sums, mut consistency) = ([0.0; 3], Consistency::<f64, 2, 1>::new());
            for block in 0..40 {
                for _ in 0..500 {
                    let y = device.sample(&BOTH, &truth);
                    filter.predict(&device.process, &[]).unwrap();
                    let innovation = filter.update(&BOTH, &y, &r).unwrap();
                    window.add(&innovation, &r);
                    if block >= 20 {
                        consistency.add(&innovation);
                    }
                }
                assert_eq!(window.samples(), 500.0);
                r = window.measurement_noise();
                window.clear();
                if block >= 20 {
                    sums = plus(sums, [r.get(0, 0) / 20.0, r.get(1, 0) / 20.0, r.get(1, 1) / 20.0]);
                }
            }
            for (all, sum) in entries.iter_mut().zip(sums) {
                all.push(sum);
            }
            nis.push(consistency.mean_nis() / 2.0);
        }
        for ((name, expected), values) in [("R₀₀", 1.0), ("R₁₀", 0.4), ("R₁₁", 0.5)].iter().zip(&entries)
        {
            let (mean, error) = report(&format!("start × {wrong}: {name}"), values);
            // A block's R̂ is nonlinear in its own noise: a bias of the order of 1/500.
            assert!((mean - expected).abs() < 4.0 * error + 0.005 * expected, "{name} {mean} ± {error}");
            // No single seed is far off: a tenth is more than 5 of its standard deviations.
            assert!(values.iter().all(|v| (v - expected).abs() < 0.15), "{name}");
        }
        let (mean, error) = report("  NIS/2", &nis);
        assert!((mean - 1.0).abs() < 4.0 * error + 0.005);
    }
}

#[test]
fn a_window_finds_the_scale_of_q() {
    let r = Covariance::from_variances([0.1]);
    for wrong in [10.0, 0.1] {
        let (mut scales, mut nis) = (Vec::new(), Vec::new());
        for seed in 0..u64::from(SEEDS) {
            let mut device = Device::new(seed);
            let mut filter = Kalman::new([0.0; 2], Covariance::from_variances([1.0; 2]));
            let (mut scale, mut window) = (wrong, InnovationWindow::new(1.0));
            let (mut sum, mut consistency) = (0.0, Consistency::<f64, 1, 1>::new());
            for block in 0..60 {
                let process = resonator(1000.0, scale * DENSITY);
                for _ in 0..500 {
                    let y = device.sample(&POSITION, &r);
                    filter.predict(&process, &[]).unwrap();
                    let innovation = filter.update(&POSITION, &y, &r).unwrap();
                    window.add(&innovation, &r);
                    if block >= 30 {
                        consistency.add(&innovation);
                    }
                }
                scale *= window.process_noise_scale();
                window.clear();
                if block >= 30 {
                    sum += scale.ln() / 30.0;
                }
            }
            scales.push(sum);
            nis.push(consistency.mean_nis());
        }
        let (mean, error) = report(&format!("start × {wrong}: ln(scale of Q)"), &scales);
        assert!(mean.abs() < 4.0 * error + 0.01, "{mean} ± {error}");
        let (mean, error) = report("  NIS", &nis);
        assert!((mean - 1.0).abs() < 4.0 * error + 0.005);
    }
}

/// R and Q of the device as functions of two logarithms, and the rest of it, in dual numbers.
type D<const P: usize> = Dual<f64, P>;

fn lifted<const R: usize, const C: usize, const P: usize>(m: &Mat<f64, R, C>) -> Mat<D<P>, R, C> {
    Mat::from_fn(|i, j| D::constant(m[(i, j)]))
}

/// R and the scale of Q together: 12 short blocks to converge, two long ones, and one step from a longer one.
fn found_jointly(start: [f64; 2], seed: u64) -> ([f64; 2], [f64; 2], f64) {
    let truth = Covariance::from_variances([0.1]);
    let mut device = Device::new(seed);
    let (f, q) = (device.process.transition, device.process.noise.covariance().to_full());
    let seen = LinearMeasurement { matrix: lifted::<1, 2, 2>(&POSITION.matrix) };
    let mut filter = Kalman::new([D::of(0.0); 2], Covariance::from_variances([D::of(1.0); 2]));
    let mut theta = start;
    for block in 0..=14 {
        let [log_r, log_q]: [D<2>; 2] = array::from_fn(|p| D::variable(theta[p], p).exp());
        let process = LinearProcess::<D<2>, 2, 0> {
            transition: lifted(&f),
            input: Mat::zero(),
            noise: Covariance::from_lower(lifted::<2, 2, 2>(&q).scaled(log_q)).into(),
        };
        let r = Covariance::from_variances([log_r * 0.1]);
        let mut score = Score::new();
        let mut consistency = Consistency::<D<2>, 1, 1>::new();
        for k in 0..[300, 2000, 5000][usize::from(block > 11) + usize::from(block > 13)] {
            let y = device.sample(&POSITION, &truth);
            filter.predict(&process, &[]).unwrap();
            let innovation = filter.update(&seen, &[D::constant(y[0])], &r).unwrap();
            // The derivatives of the state forget the last θ within some tens of samples.
            if k >= 50 {
                score.add(&innovation);
                consistency.add(&innovation);
            }
        }
        let step = score.step().unwrap();
        if block == 14 {
            return (
                array::from_fn(|p| theta[p] + step.change[p]),
                step.standard_deviation,
                consistency.mean_nis().value(),
            );
        }
        let within = Bounds { least: theta.map(|t| t - 1.0), most: theta.map(|t| t + 1.0) };
        theta = within.hold(plus(theta, step.change)).value;
    }
    unreachable!()
}

#[test]
fn r_and_the_scale_of_q_are_found_together_with_their_standard_errors() {
    let ten = 10_f64.ln();
    let runs: Vec<_> = (0..u64::from(SEEDS)).map(|seed| found_jointly([ten, -ten], seed)).collect();
    for (p, name) in ["ln(scale of R)", "ln(scale of Q)"].iter().enumerate() {
        let values: Vec<f64> = runs.iter().map(|run| run.0[p]).collect();
        let (mean, error) = report(name, &values);
        assert!(mean.abs() < 4.0 * error + 1e-3, "{name}: {mean} ± {error}");
        // The stated standard error is that of the estimates: a standard deviation of 100 values is known to
        // 7 %.
        let normalized: Vec<f64> = runs.iter().map(|run| run.0[p] / run.1[p]).collect();
        let (_, deviation) = spread(&normalized);
        println!("    stated {:.4}, error over stated {deviation:.3}", runs[0].1[p]);
        assert!((0.75..1.3).contains(&deviation), "{name}: {deviation}");
    }
    let (mean, error) = report("NIS", &runs.iter().map(|run| run.2).collect::<Vec<_>>());
    assert!((mean - 1.0).abs() < 4.0 * error + 2e-3);
    // From the other wrong starts the same answer, the start forgotten.
    for start in [[ten, ten], [-ten, ten], [-ten, -ten]] {
        for seed in 0..10 {
            let (found, deviation, _) = found_jointly(start, seed);
            for p in 0..2 {
                let other = runs[usize::try_from(seed).unwrap()].0[p];
                assert!((found[p] - other).abs() < 0.01 * deviation[p], "{start:?} {seed}");
            }
        }
    }
}

/// Noise on the velocity of a resonator, a random walk of the sensor's offset, and the sensor's own noise:
/// three logarithms.
fn three_sources(seed: u64) -> ([f64; 3], [f64; 3]) {
    let device = resonator(1000.0, DENSITY);
    let mut x = [0.0; 3];
    let mut chance = Chance::new(seed);
    let walk = 0.02;
    let embedded = |m: &Mat<f64, 2, 2>, corner: f64| {
        Mat::<f64, 3, 3>::from_fn(|i, j| {
            if i < 2 && j < 2 { m[(i, j)] } else { f64::from(u8::from(i == j)) * corner }
        })
    };
    let f = embedded(&device.transition, 1.0);
    let (motion, offset) =
        (embedded(&device.noise.covariance().to_full(), 0.0), embedded(&Mat::zero(), walk * walk));
    let h = Mat([[1.0, 0.0, 1.0]]);
    let truth = Covariance::from_lower(motion.plus(&offset));
    let seen = LinearMeasurement { matrix: lifted::<1, 3, 3>(&h) };
    let mut filter = Kalman::new([D::of(0.0); 3], Covariance::from_variances([D::of(1.0); 3]));
    let mut theta = [1.0, -1.0, 1.0];
    for block in 0..=10 {
        let [r, q1, q2]: [D<3>; 3] = array::from_fn(|p| D::variable(theta[p], p).exp());
        let process = LinearProcess::<D<3>, 3, 0> {
            transition: lifted(&f),
            input: Mat::zero(),
            noise: Covariance::from_lower(
                lifted::<3, 3, 3>(&motion).scaled(q1).plus(&lifted::<3, 3, 3>(&offset).scaled(q2)),
            )
            .into(),
        };
        let mut score = Score::new();
        for k in 0..if block < 8 { 500 } else { 5000 } {
            x = plus(f.times_vector(&x), chance.vector(&truth));
            let y = h.times_vector(&x)[0] + 0.1_f64.sqrt() * chance.gaussian();
            filter.predict(&process, &[]).unwrap();
            let r = Covariance::from_variances([r * 0.1]);
            let innovation = filter.update(&seen, &[D::constant(y)], &r).unwrap();
            if k >= 100 {
                score.add(&innovation);
            }
        }
        let step = score.step().unwrap();
        if block == 10 {
            return (plus(theta, step.change), step.standard_deviation);
        }
        let within = Bounds { least: theta.map(|t| t - 1.0), most: theta.map(|t| t + 1.0) };
        theta = within.hold(plus(theta, step.change)).value;
    }
    unreachable!()
}

#[test]
fn sources_of_different_spectrum_are_found_together() {
    let runs: Vec<_> = (0..40).map(three_sources).collect();
    for p in 0..3 {
        let (mean, error) = report("ln(scale)", &runs.iter().map(|run| run.0[p]).collect::<Vec<_>>());
        println!("    stated {:.4}", runs[0].1[p]);
        assert!(mean.abs() < 4.0 * error + 1e-2, "{p}: {mean} ± {error}");
        // 40 values: their standard deviation is known to 11 %.
        let (_, deviation) = spread(&runs.iter().map(|run| run.0[p] / run.1[p]).collect::<Vec<_>>());
        assert!((0.65..1.45).contains(&deviation), "{p}: {deviation}");
    }
}

#[test]
fn two_sources_with_one_effect_are_not_distinguished() {
    // The scale of R as a product of two: only their sum of logarithms is in the data.
    let run = |separate: bool| {
        let mut device = Device::new(5);
        let (f, q) = (device.process.transition, device.process.noise.covariance().to_full());
        let [a, b]: [D<2>; 2] = array::from_fn(|p| D::variable(0.0, p).exp());
        let (scale, q_scale) = if separate { (a, b) } else { (a * b, D::of(1.0)) };
        let process = LinearProcess::<D<2>, 2, 0> {
            transition: lifted(&f),
            input: Mat::zero(),
            noise: Covariance::from_lower(lifted::<2, 2, 2>(&q).scaled(q_scale)).into(),
        };
        let seen = LinearMeasurement { matrix: lifted::<1, 2, 2>(&POSITION.matrix) };
        let mut filter = Kalman::new([D::of(0.0); 2], Covariance::from_variances([D::of(1.0); 2]));
        let mut score = Score::new();
        for _ in 0..2000 {
            let y = device.sample(&POSITION, &Covariance::from_variances([0.1]));
            filter.predict(&process, &[]).unwrap();
            let r = Covariance::from_variances([scale * 0.1]);
            score.add(&filter.update(&seen, &[D::constant(y[0])], &r).unwrap());
        }
        score.step()
    };
    assert!(run(true).is_some());
    assert!(run(false).is_none());
    // Nothing counted, nothing told.
    assert!(Score::<f64, 2>::new().step().is_none());
}

#[test]
fn a_window_alone_does_not_tell_r_from_q() {
    // Twice R and half Q: with R adapted to it, the window is content, and whiteness is not.
    let mut device = Device::new(3);
    let process = resonator(1000.0, 0.2 * DENSITY);
    let mut filter = Kalman::new([0.0; 2], Covariance::from_variances([1.0; 2]));
    let (truth, mut r) = (Covariance::from_variances([0.1]), Covariance::from_variances([0.1]));
    let mut window = InnovationWindow::new(1.0);
    let mut consistency = Consistency::<f64, 1, 10>::new();
    for k in 1..=40_000 {
        let y = device.sample(&POSITION, &truth);
        filter.predict(&process, &[]).unwrap();
        let innovation = filter.update(&POSITION, &y, &r).unwrap();
        window.add(&innovation, &r);
        if k % 1000 == 0 {
            r = window.measurement_noise();
            if k < 40_000 {
                window.clear();
            }
        }
        if k > 20_000 {
            consistency.add(&innovation);
        }
    }
    println!("R {:.3}, NIS {:.3}", r.get(0, 0), consistency.mean_nis());
    assert!(r.get(0, 0) > 0.15);
    assert!((window.process_noise_scale() - 1.0).abs() < 0.2);
    assert!((consistency.mean_nis() - 1.0).abs() < 0.05);
    assert!(consistency.ljung_box().statistic > 100.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// R̂ of one innovation is what the residual after the correction says, and positive definite whatever R
    /// is.
    #[test]
    fn r_from_one_innovation_is_that_of_the_residual(
        a in prop::array::uniform4(-1.0..1.0_f64),
        b in prop::array::uniform4(-1.0..1.0_f64),
        d in prop::array::uniform4(0.05..1.0_f64),
        y in prop::array::uniform2(-5.0..5.0_f64),
    ) {
        let square = |m: [f64; 4], d: [f64; 2]| {
            let m = Mat::<f64, 2, 2>::from_fn(|i, j| m[2 * i + j]);
            Covariance::from_lower(m.times_transposed(&m)).plus(&Covariance::from_variances(d))
        };
        let (p, r) = (square(a, [d[0], d[1]]), square(b, [d[2], d[3]]));
        let mut filter = Ekf::new([0.0; 2], p);
        let innovation = filter.update(&BOTH, &y, &r).unwrap();
        let mut window = InnovationWindow::new(0.9);
        window.add(&innovation, &r);
        let residual = minus(&y, &BOTH.matrix.times_vector(filter.mean()));
        let left = filter.covariance().transformed(&BOTH.matrix);
        let found = window.measurement_noise();
        for i in 0..2 {
            for j in 0..=i {
                let expected = residual[i] * residual[j] + left.get(i, j);
                let size = 1.0 + r.get(0, 0) + r.get(1, 1) + (residual[i] * residual[j]).abs();
                prop_assert!((found.get(i, j) - expected).abs() < 1e-9 * size);
            }
        }
        prop_assert!(found.get(0, 0) > 0.0);
        prop_assert!(found.get(0, 0) * found.get(1, 1) > found.get(1, 0).powi(2));
        prop_assert!(window.process_noise_scale() > 0.0);
    }

    /// Magill's weights are Bayes' rule with the joint density of all samples, written out densely.
    #[test]
    fn weights_are_bayes_rule(
        levels in prop::array::uniform3(-2.0..2.0_f64),
        variances in prop::array::uniform3(0.1..2.0_f64),
        prior in prop::array::uniform3(0.1..1.0_f64),
        ys in prop::array::uniform4(-3.0..3.0_f64),
    ) {
        // A constant drawn from N(level, variance), seen four times with variance 0.5.
        let filters: [_; 3] =
            array::from_fn(|k| Ekf::new([levels[k]], Covariance::from_variances([variances[k]])));
        let mut bank = Bank::<_, f64, 1, 3>::new(filters, prior);
        let seen = [LinearMeasurement { matrix: Mat([[1.0]]) }; 3];
        let mut evidence = 0.0;
        for y in ys {
            let r = [Covariance::from_variances([0.5]); 3];
            evidence += bank.update(&seen, &[y], &r).unwrap().log_likelihood;
        }
        let y = nalgebra::Vector4::from(ys);
        let total: f64 = prior.iter().sum();
        let joint: [f64; 3] = array::from_fn(|k| {
            let s = nalgebra::Matrix4::from_element(variances[k]) + nalgebra::Matrix4::identity() * 0.5;
            let e = y.add_scalar(-levels[k]);
            let square = (e.transpose() * s.try_inverse().unwrap() * e)[0];
            let volume = s.determinant() * std::f64::consts::TAU.powi(4);
            prior[k] / total * (-0.5 * square).exp() / volume.sqrt()
        });
        let sum: f64 = joint.iter().sum();
        for k in 0..3 {
            prop_assert!((bank.weights()[k] - joint[k] / sum).abs() < 1e-10);
        }
        prop_assert!((evidence - sum.ln()).abs() < 1e-9 * (1.0 + sum.ln().abs()));
        // Mean and variance of the mixture of the three conditional Gaussians.
        let w: [f64; 3] = array::from_fn(|k| joint[k] / sum);
        let parts: [(f64, f64); 3] = array::from_fn(|k| {
            let p = 1.0 / (1.0 / variances[k] + 4.0 / 0.5);
            (p * (levels[k] / variances[k] + ys.iter().sum::<f64>() / 0.5), p)
        });
        let mean: f64 = (0..3).map(|k| w[k] * parts[k].0).sum();
        let second: f64 = (0..3).map(|k| w[k] * (parts[k].1 + parts[k].0.powi(2))).sum();
        let mixture = bank.mixture();
        prop_assert!((mixture.mean[0] - mean).abs() < 1e-9);
        prop_assert!((mixture.covariance.get(0, 0) - (second - mean.powi(2))).abs() < 1e-9);
    }
}

/// A bank of five resonances, 2 % apart, over a recording of a device of 1 kHz.
fn bank_of_resonances<F: Filter<f64, 2> + Clone>(
    filter: &F,
    seed: u64,
    samples: usize,
) -> (Bank<F, f64, 2, 5>, f64) {
    let mut device = Device::new(seed);
    let processes = [960.0, 980.0, 1000.0, 1020.0, 1040.0].map(|f| resonator(f, DENSITY));
    let mut bank = Bank::new(array::from_fn(|_| filter.clone()), [0.2; 5]);
    let r = Covariance::from_variances([0.01]);
    let mut error = 0.0;
    for k in 0..samples {
        let y = device.sample(&POSITION, &r);
        bank.predict(&processes, &[]).unwrap();
        bank.update(&[POSITION; 5], &y, &[r; 5]).unwrap();
        if k + 1 == samples {
            let mixture = bank.mixture();
            error = nees(&minus(&device.x, &mixture.mean), &mixture.covariance);
        }
    }
    (bank, error)
}

#[test]
fn the_right_resonance_wins() {
    let start = Covariance::from_variances([1.0; 2]);
    let results: Vec<_> = (0..u64::from(SEEDS))
        .map(|seed| bank_of_resonances(&Ekf::new([0.0; 2], start), seed, 20_000))
        .collect();
    // If a weight above 0.99 is a probability, no more than 1 in 100 is wrong: at least the lower end of the
    // 99.9 % interval must be right.
    let right = results.iter().filter(|(bank, _)| bank.weights()[2] > 0.99).count();
    println!("right {right} of {SEEDS}");
    assert!(right >= binomial_interval(results.len(), 0.99, 1e-3).0);
    // The combined NEES: χ² with 2 degrees of freedom for each seed, its mean over 100 within 4·√(4/100) of
    // 2.
    let (mean, _) = spread(&results.iter().map(|result| result.1).collect::<Vec<_>>());
    println!("NEES {mean:.2}");
    assert!((mean - 2.0).abs() < 0.8);
    // Other filters as well.
    let points = SigmaPoints::standard();
    let (unscented, _) = bank_of_resonances(&Ukf::new([0.0; 2], start, points), 0, 20_000);
    for k in 0..5 {
        assert!((unscented.log_weights()[k] - results[0].0.log_weights()[k]).abs() < 1e-5);
    }
}

#[test]
fn while_the_models_are_undecided_the_mixture_is_honest() {
    // The true level is drawn from the prior of the bank: then the mixture is the exact posterior, and its
    // NEES is 1 on average, though not χ².
    let levels = [-1.0, 0.0, 2.0];
    let mut squares = Vec::new();
    for seed in 0..4000 {
        let mut chance = Chance::new(seed);
        let drawn = chance.uniform();
        let level = levels[usize::from(drawn > 1.0 / 3.0) + usize::from(drawn > 2.0 / 3.0)];
        let x = level + 0.2 * chance.gaussian();
        let filters = levels.map(|level| Ekf::new([level], Covariance::from_variances([0.04])));
        let mut bank = Bank::<_, f64, 1, 3>::new(filters, [1.0; 3]);
        let seen = [LinearMeasurement { matrix: Mat([[1.0]]) }; 3];
        bank.update(&seen, &[x + chance.gaussian()], &[Covariance::from_variances([1.0]); 3]).unwrap();
        let mixture = bank.mixture();
        squares.push(nees(&[x - mixture.mean[0]], &mixture.covariance));
    }
    let (mean, error) = report("NEES of the mixture", &squares);
    assert!((mean - 1.0).abs() < 4.0 * error);
}

#[test]
fn a_bank_takes_all_or_nothing_and_a_floor_holds() {
    let filters = [Ekf::new([0.0], Covariance::zero()), Ekf::new([1.0], Covariance::zero())];
    let mut bank = Bank::<_, f64, 1, 2>::new(filters, [3.0, 1.0]);
    assert!((bank.weights()[0] - 0.75).abs() < 1e-15);
    let seen = [LinearMeasurement { matrix: Mat([[1.0]]) }; 2];
    let r = Covariance::from_variances([1e-4]);
    // The second model's noise is no noise.
    let bad = [r, Covariance::from_variances([-1.0])];
    assert_eq!(bank.update(&seen, &[0.5], &bad).unwrap_err(), FilterError::InnovationNotPositive);
    assert!((bank.weights()[0] - 0.75).abs() < 1e-15);
    // A hundred samples say no to the first; beyond the smallest number that f64 has.
    for _ in 0..100 {
        bank.update(&seen, &[1.0], &[r; 2]).unwrap();
    }
    assert_eq!(bank.weights(), [0.0, 1.0]);
    assert!((bank.log_weights()[0] + 500_000.0 - 3_f64.ln()).abs() < 1e-6);
    // And a hundred take it back.
    for _ in 0..100 {
        bank.update(&seen, &[0.0], &[r; 2]).unwrap();
    }
    assert!((bank.weights()[0] - 0.75).abs() < 1e-9);
    // With a floor one sample does.
    let mut bank = Bank::<_, f64, 1, 2>::new(filters, [1.0, 1.0]).with_floor(1e-3);
    for _ in 0..100 {
        bank.update(&seen, &[1.0], &[r; 2]).unwrap();
    }
    assert!((bank.weights()[0] - 1e-3 / 1.001).abs() < 1e-15);
    bank.update(&seen, &[0.0], &[r; 2]).unwrap();
    assert!(bank.weights()[0] > 0.998);
}

#[test]
fn bounds_say_when_they_bind() {
    let bounds = Bounds { least: [0.1_f64, 0.1], most: [1.0, 1.0] };
    let free = bounds.hold([0.5, 0.6]);
    assert!(!free.binds() && free.value == [0.5, 0.6]);
    let held = bounds.hold([0.01, 0.6]);
    assert!(held.binds() && held.value == [0.1, 0.6] && held.at_least == [true, false]);
    assert!(bounds.hold([f64::NAN, 0.5]).value[0].is_nan());
}
