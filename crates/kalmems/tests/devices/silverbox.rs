//! The Silverbox, a measured electronic Duffing oscillator (Wigren and Schoukens 2013): filters that know the cubic
//! spring against the best linear Kalman filter, on the measurement and on a simulation of it.
//!
//! Each filter gets the noise that makes its own innovations most likely; the linear one gets all its other
//! parameters that way too, on the very samples that it is then judged by. Nothing is fitted of the cubic model:
//! its parameters are those of an independent simulation fit to another part of the recording.

use kalmems::signal::band_limited;
use kalmems_core::{
    Covariance, Ekf, Filter, FilterError, LinearMeasurement, LinearProcess, Mat, Nodes, NoiseDensity,
    Process, Rk4, SigmaPoints, Ukf,
};
use kalmems_models::dynamics::Duffing;
use std::f64::consts::TAU;
use std::path::PathBuf;

/// 10⁷/2¹⁴ Hz.
const RATE_HZ: f64 = 610.351_562_5;
/// The oscillation has nine samples per cycle: too few for one Runge–Kutta step from sample to sample.
const SUBSTEPS: usize = 4;
const SUBSTEP_S: f64 = 1.0 / (RATE_HZ * SUBSTEPS as f64);
/// The first samples, in which a filter finds the state, do not count.
const SETTLING: usize = 50;

/// The circuit: [`Duffing`] with its input less an offset and delayed, its output plus an offset, all in V.
#[derive(Clone, Copy)]
struct Circuit {
    duffing: Duffing<f64>,
    input_offset: f64,
    output_offset: f64,
    delay_s: f64,
}

/// The input over the substeps from each sample to the next.
type Drive<I> = Vec<[I; SUBSTEPS]>;

/// A signal at a fraction of the way from sample `k` to the next.
type Between = fn(&[f64], usize, f64) -> f64;

fn held(samples: &[f64], k: usize, _: f64) -> f64 {
    samples[k]
}

fn line(samples: &[f64], k: usize, fraction: f64) -> f64 {
    samples[k] + (samples[k + 1] - samples[k]) * fraction
}

/// Lagrange's polynomial through the two samples on each side.
fn cubic(samples: &[f64], k: usize, f: f64) -> f64 {
    let sample = |i: usize| samples[(k + i).saturating_sub(1)];
    let (before, after) = (f + 1.0, f - 2.0);
    sample(1) * before * (f - 1.0) * after / 2.0 - sample(2) * before * f * after / 2.0
        + (sample(3) * before - sample(0) * after) * f * (f - 1.0) / 6.0
}

fn band(samples: &[f64], k: usize, fraction: f64) -> f64 {
    band_limited(samples, k as f64 + fraction)
}

/// The input of the circuit before each of `count` samples but the first.
fn drive(input: &[f64], circuit: &Circuit, between: Between, count: usize) -> Drive<Nodes<f64>> {
    let at = |k: usize, substep: f64| {
        between(input, k, substep / SUBSTEPS as f64 - circuit.delay_s * RATE_HZ) - circuit.input_offset
    };
    (0..count - 1)
        .map(|k| {
            std::array::from_fn(|i| {
                let i = i as f64;
                Nodes { start: at(k, i), middle: at(k, i + 0.5), end: at(k, i + 1.0) }
            })
        })
        .collect()
}

/// What a filter said before it saw a sample, and after.
struct Step {
    residual: f64,
    variance: f64,
    log_likelihood: f64,
    /// The position once the sample is used.
    position: f64,
}

/// Runs a filter over samples of the position with white noise of this variance.
fn follow<F: Filter<f64, 2>, P: Process<f64, 2>>(
    mut filter: F,
    process: &P,
    drive: &Drive<P::Input>,
    positions: impl Iterator<Item = f64>,
    variance: f64,
) -> Result<Vec<Step>, FilterError> {
    let seen = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };
    let r = Covariance::from_variances([variance]);
    let mut steps = Vec::with_capacity(drive.len() + 1);
    for (k, y) in positions.enumerate() {
        if k > 0 {
            for input in &drive[k - 1] {
                filter.predict(process, input)?;
            }
        }
        let innovation = filter.update(&seen, &[y], &r)?;
        steps.push(Step {
            residual: innovation.residual[0],
            variance: innovation.covariance.get(0, 0),
            log_likelihood: innovation.log_likelihood(),
            position: filter.mean()[0],
        });
    }
    Ok(steps)
}

/// How well a filter predicted, the settling left out.
#[derive(Clone, Copy, Debug)]
struct Score {
    /// Per sample, of voltages in V.
    log_likelihood: f64,
    /// Of the innovation.
    rmse_mv: f64,
    /// The mean normalised innovation squared.
    nis: f64,
    /// The correlation of the normalised innovation with the one before.
    lag_1: f64,
    /// Ljung and Box's sum over 20 lags: about 20 ± 6 if the innovations are white.
    ljung_box: f64,
}

impl Score {
    fn of(steps: &[Step]) -> Self {
        let steps = &steps[SETTLING..];
        let n = steps.len() as f64;
        let mean = |f: &dyn Fn(&Step) -> f64| steps.iter().map(f).sum::<f64>() / n;
        let normalised: Vec<f64> = steps.iter().map(|s| s.residual / s.variance.sqrt()).collect();
        let nis = mean(&|s| s.residual.powi(2) / s.variance);
        let correlation = |lag: usize| {
            normalised.iter().zip(&normalised[lag..]).map(|(a, b)| a * b).sum::<f64>() / (n * nis)
        };
        Self {
            log_likelihood: mean(&|s| s.log_likelihood),
            rmse_mv: 1e3 * mean(&|s| s.residual.powi(2)).sqrt(),
            nis,
            lag_1: correlation(1),
            ljung_box: (1..=20).map(|l| correlation(l).powi(2) * n * (n + 2.0) / (n - l as f64)).sum(),
        }
    }
}

/// What a likelihood is maximised over for the cubic model.
#[derive(Clone, Copy, Debug)]
struct Noise {
    /// The density of white acceleration in V²/s³.
    acceleration_density: f64,
    /// The standard deviation of the measurement in V.
    deviation: f64,
}

impl Noise {
    /// From ln q and ln √R.
    fn of([density, deviation]: [f64; 2]) -> Self {
        Self { acceleration_density: density.exp(), deviation: deviation.exp() }
    }

    fn logarithms(&self) -> [f64; 2] {
        [self.acceleration_density.ln(), self.deviation.ln()]
    }

    fn process(&self, duffing: Duffing<f64>) -> Rk4<Duffing<f64>, f64, 2> {
        let density = NoiseDensity::none().on::<1>(self.acceleration_density);
        Rk4::new(duffing, SUBSTEP_S, &density, (&[0.0, 0.0], &0.0))
    }
}

/// Wider than the recording ever starts.
fn at_rest() -> ([f64; 2], Covariance<f64, 2>) {
    ([0.0, 0.0], Covariance::from_standard_deviations([0.03, 10.0]))
}

fn ekf() -> Ekf<f64, 2> {
    let (mean, covariance) = at_rest();
    Ekf::new(mean, covariance)
}

fn ukf() -> Ukf<f64, 2> {
    let (mean, covariance) = at_rest();
    Ukf::new(mean, covariance, SigmaPoints::standard())
}

/// A filter with the cubic model over `output`.
fn with_spring(
    filter: impl Filter<f64, 2>,
    circuit: &Circuit,
    drive: &Drive<Nodes<f64>>,
    output: &[f64],
    noise: &Noise,
) -> Result<Vec<Step>, FilterError> {
    let positions = output.iter().map(|y| y - circuit.output_offset);
    follow(filter, &noise.process(circuit.duffing), drive, positions, noise.deviation.powi(2))
}

/// The noise under which the innovations are most likely.
fn most_likely_noise(
    start: &Noise,
    step: f64,
    evaluations: usize,
    run: impl Fn(&Noise) -> Result<Vec<Step>, FilterError>,
) -> Noise {
    Noise::of(minimum(start.logarithms(), [step; 2], evaluations, |x| cost(run(&Noise::of(*x)))))
}

/// The circuit without its cubic spring, and its noise. Both offsets are one in a linear model.
#[derive(Clone, Copy, Debug)]
struct Linear {
    stiffness: f64,
    damping: f64,
    gain: f64,
    output_offset: f64,
    delay_s: f64,
    noise: Noise,
}

impl Linear {
    /// From numbers that are all of order one against the steps of the search.
    fn of(x: &[f64; 7]) -> Self {
        Self {
            stiffness: x[0].exp(),
            damping: x[1].exp(),
            gain: x[2].exp(),
            output_offset: x[3] * 1e-2,
            delay_s: x[4] * 1e-4,
            noise: Noise::of([x[5], x[6]]),
        }
    }

    /// The Kalman filter; `input` was not yet delayed nor offset. An EKF on a linear process is one, to the bit.
    fn run(&self, input: &Drive<Nodes<f64>>, output: &[f64]) -> Result<Vec<Step>, FilterError> {
        let duffing =
            Duffing { damping: self.damping, stiffness: self.stiffness, cubic: 0.0, gain: self.gain };
        let rk4 = self.noise.process(duffing);
        // A linear step is known by what it makes of each unit.
        let unit = |i: usize, j: usize| f64::from(u8::from(i == j));
        let free = [0, 1].map(|j| rk4.step(&[unit(0, j), unit(1, j)], &Nodes::held(0.0)));
        let driven = [0, 1, 2]
            .map(|j| rk4.step(&[0.0; 2], &Nodes { start: unit(0, j), middle: unit(1, j), end: unit(2, j) }));
        let process = LinearProcess::<f64, 2, 3> {
            transition: Mat::from_fn(|i, j| free[j][i]),
            input: Mat::from_fn(|i, j| driven[j][i]),
            noise: *rk4.noise(),
        };
        let delayed =
            input.iter().map(|substeps| substeps.map(|nodes| earlier(&nodes, self.delay_s))).collect();
        let positions = output.iter().map(|y| y - self.output_offset);
        follow(ekf(), &process, &delayed, positions, self.noise.deviation.powi(2))
    }

    /// The parameters under which the innovations are most likely, from those of the circuit at rest.
    fn most_likely(circuit: &Circuit, input: &Drive<Nodes<f64>>, output: &[f64], evaluations: usize) -> Self {
        let Duffing { stiffness, damping, gain, .. } = circuit.duffing;
        let start = [stiffness.ln(), damping.ln(), gain.ln(), -0.5, 0.0, 6.0, -9.0];
        let search = |start, scale: f64, evaluations| {
            let step = [0.04, 0.1, 0.02, 0.3, 0.2, 1.0, 1.0].map(|s| s * scale);
            minimum(start, step, evaluations, |x| cost(Self::of(x).run(input, output)))
        };
        // A simplex that has collapsed is spread anew.
        Self::of(&search(search(start, 1.0, evaluations * 2 / 3), 0.2, evaluations / 3))
    }
}

/// An input some microseconds ago, by the parabola through its nodes.
fn earlier(nodes: &Nodes<f64>, delay_s: f64) -> [f64; 3] {
    let curve = 2.0 * (nodes.start - 2.0 * nodes.middle + nodes.end);
    let at = |x: f64| nodes.middle + (nodes.end - nodes.start + curve * x) * x;
    let shift = delay_s / SUBSTEP_S;
    [at(-0.5 - shift), at(-shift), at(0.5 - shift)]
}

/// Minus the log-likelihood per sample.
fn cost(steps: Result<Vec<Step>, FilterError>) -> f64 {
    steps.map_or(f64::INFINITY, |steps| -Score::of(&steps).log_likelihood)
}

/// Nelder and Mead's simplex, until its costs agree to 10⁻⁷.
fn minimum<const K: usize>(
    start: [f64; K],
    step: [f64; K],
    evaluations: usize,
    cost: impl Fn(&[f64; K]) -> f64,
) -> [f64; K] {
    let judged = |x: [f64; K]| (cost(&x), x);
    let mut simplex = vec![judged(start)];
    for i in 0..K {
        let mut x = start;
        x[i] += step[i];
        simplex.push(judged(x));
    }
    let mut used = K + 1;
    while used < evaluations {
        simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (best, second_worst, worst) = (simplex[0], simplex[K - 1], simplex[K]);
        if worst.0 - best.0 < 1e-7 {
            break;
        }
        let centre: [f64; K] =
            std::array::from_fn(|i| simplex[..K].iter().map(|(_, x)| x[i]).sum::<f64>() / K as f64);
        let along = |t: f64| judged(std::array::from_fn(|i| centre[i] + t * (worst.1[i] - centre[i])));
        let mirrored = along(-1.0);
        used += 1;
        let mut next = mirrored;
        if mirrored.0 < best.0 || mirrored.0 >= second_worst.0 {
            used += 1;
            let factor = if mirrored.0 < best.0 {
                -2.0
            } else if mirrored.0 < worst.0 {
                -0.5
            } else {
                0.5
            };
            let other = along(factor);
            if other.0 < mirrored.0 {
                next = other;
            }
        }
        if next.0 < worst.0 {
            simplex[K] = next;
        } else {
            used += K;
            for vertex in &mut simplex[1..] {
                *vertex = judged(std::array::from_fn(|i| vertex.1[i].midpoint(best.1[i])));
            }
        }
    }
    simplex.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap().1
}

fn folder() -> PathBuf {
    let data = std::env::var_os("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names the folder");
    PathBuf::from(data).join("real/silverbox")
}

/// The parameters of the independent fit.
fn measured_circuit() -> Circuit {
    let text = std::fs::read_to_string(folder().join("expected.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let p = |key: &str| json["duffing_greybox_fit"]["parameters"][key].as_f64().unwrap();
    Circuit {
        duffing: Duffing { damping: p("d"), stiffness: p("w2"), cubic: p("a3"), gain: p("g") },
        input_offset: p("u0_v"),
        output_offset: p("y0_v"),
        delay_s: p("tau_s"),
    }
}

/// Input and output in V.
fn measurement() -> (Vec<f64>, Vec<f64>) {
    let mut reader = csv::Reader::from_path(folder().join("snls80mv.csv")).unwrap();
    reader.deserialize::<(f64, f64)>().map(Result::unwrap).unzip()
}

/// The part with noise of growing amplitude.
const ARROW: usize = 40_450;

#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn long_on_the_measured_circuit_the_cubic_model_predicts_better_than_any_linear_one() {
    let (input, output) = measurement();
    let output = &output[..ARROW];
    let circuit = measured_circuit();
    let inputs = drive(&input, &circuit, band, ARROW);
    let noise = Noise { acceleration_density: 10.0, deviation: 3e-4 };
    let noise =
        most_likely_noise(&noise, 1.0, 60, |noise| with_spring(ekf(), &circuit, &inputs, output, noise));
    let steps = with_spring(ekf(), &circuit, &inputs, output, &noise).unwrap();
    let extended = Score::of(&steps);
    println!("EKF       {extended:?} {noise:?}");
    // What is left grows with the amplitude: the cubic spring is not all there is to the circuit.
    for eighth in steps.chunks(ARROW / 8 + 1) {
        let Score { rmse_mv, nis, .. } = Score::of(eighth);
        println!("  an eighth: RMSE {rmse_mv:.3} mV, NIS {nis:.2}");
    }
    let noise =
        most_likely_noise(&noise, 0.2, 30, |noise| with_spring(ukf(), &circuit, &inputs, output, noise));
    let unscented = Score::of(&with_spring(ukf(), &circuit, &inputs, output, &noise).unwrap());
    println!("UKF       {unscented:?} {noise:?}");

    let bare = Circuit { input_offset: 0.0, delay_s: 0.0, ..circuit };
    let inputs = drive(&input, &bare, band, ARROW);
    let fitted = Linear::most_likely(&circuit, &inputs, output, 500);
    let linear = Score::of(&fitted.run(&inputs, output).unwrap());
    println!("linear KF {linear:?} {fitted:?}");
    assert_better(&extended, &linear);
    assert_better(&unscented, &linear);
}

/// Between its samples the input is not recorded.
#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn long_each_better_guess_of_the_input_between_its_samples_predicts_better() {
    let (input, output) = measurement();
    let output = &output[..ARROW];
    let circuit = measured_circuit();
    let score = |between| {
        let inputs = drive(&input, &circuit, between, ARROW);
        let run = |noise: &Noise| with_spring(ekf(), &circuit, &inputs, output, noise);
        let start = Noise { acceleration_density: 10.0, deviation: 3e-4 };
        Score::of(&run(&most_likely_noise(&start, 1.0, 60, run)).unwrap())
    };
    let guesses: [(&str, Between); 4] = [("held", held), ("line", line), ("cubic", cubic), ("band", band)];
    let scores = guesses.map(|(name, between)| {
        let score = score(between);
        println!("{name:5} {score:?}");
        score
    });
    for pair in scores.windows(2) {
        assert!(pair[1].rmse_mv < 0.7 * pair[0].rmse_mv, "{pair:?}");
        assert!(pair[1].log_likelihood > pair[0].log_likelihood + 0.3, "{pair:?}");
    }
    // What an independent extended Kalman filter reached with straight lines.
    assert!(scores[1].rmse_mv < 1.10);
}

/// Random numbers by Steele, Lea and Flood's SplitMix64 (2014).
struct Random(u64);

impl Random {
    /// Between 0 and 1, never 0.
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (((z ^ (z >> 31)) >> 11) as f64 + 0.5) / 2.0_f64.powi(53)
    }

    /// Of mean 0 and variance 1, by Box and Muller.
    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

/// A simulated recording of the circuit.
struct Simulated {
    input: Vec<f64>,
    output: Vec<f64>,
    position: Vec<f64>,
}

/// Noise of a growing amplitude below 200 Hz through the circuit, as in the measurement.
///
/// The input is a sum of sines and known at any time; the truth is integrated in 16 steps per sample, each with its
/// share of the white acceleration.
fn simulate(circuit: &Circuit, noise: &Noise, count: usize, seed: u64) -> Simulated {
    const FINE: usize = 16;
    let mut random = Random(seed);
    let sines: Vec<(f64, f64)> =
        (0..40).map(|i| (TAU * 4.9 * (f64::from(i) + random.uniform()), TAU * random.uniform())).collect();
    let duration = count as f64 / RATE_HZ;
    let input = |t: f64| {
        let sum: f64 = sines.iter().map(|(rate, phase)| (rate * t + phase).cos()).sum();
        // As in the measurement, an RMS of 38 mV at the end.
        0.038 * (t / duration) * sum / 20.0_f64.sqrt()
    };
    let h = 1.0 / (RATE_HZ * FINE as f64);
    let process = Rk4::new(circuit.duffing, h, &NoiseDensity::none(), (&[0.0, 0.0], &0.0));
    let kick = (noise.acceleration_density * h).sqrt();
    let mut x = [0.0, 0.0];
    let mut simulated = Simulated { input: vec![], output: vec![], position: vec![] };
    for k in 0..count * FINE {
        let t = k as f64 * h;
        if k % FINE == 0 {
            simulated.input.push(input(t) + circuit.input_offset);
            simulated.output.push(x[0] + circuit.output_offset + noise.deviation * random.normal());
            simulated.position.push(x[0]);
        }
        x = process.step(&x, &Nodes { start: input(t), middle: input(t + h / 2.0), end: input(t + h) });
        x[1] += kick * random.normal();
    }
    simulated
}

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_on_a_simulated_circuit_the_cubic_model_predicts_better_and_its_noise_is_found() {
    let circuit = Circuit {
        duffing: Duffing { damping: 41.893, stiffness: 184_260.6, cubic: 727_808.0, gain: 185_990.4 },
        input_offset: 8.4e-3,
        output_offset: 3e-3,
        delay_s: 0.0,
    };
    let truth = Noise { acceleration_density: 1.0, deviation: 1.8e-4 };
    let count = 2000;
    for seed in 1..=5 {
        let Simulated { input, output, position } = simulate(&circuit, &truth, count, seed);
        let inputs = drive(&input, &circuit, band, count);
        // Of the output without its noise.
        let error_mv = |steps: &[Step], offset: f64| {
            let errors = steps.iter().zip(&position).skip(SETTLING);
            let squares = errors.map(|(s, x)| (s.position + offset - x - circuit.output_offset).powi(2));
            1e3 * (squares.sum::<f64>() / (count - SETTLING) as f64).sqrt()
        };

        let run = |noise: &Noise| with_spring(ekf(), &circuit, &inputs, &output, noise);
        // With the true noise the innovations are what the filter says: χ² and white within four deviations.
        let told = Score::of(&run(&truth).unwrap());
        let deviation = 1.0 / ((count - SETTLING) as f64).sqrt();
        assert!((told.nis - 1.0).abs() < 4.0 * 2.0_f64.sqrt() * deviation, "{seed}: {told:?}");
        assert!(told.lag_1.abs() < 4.0 * deviation, "{seed}: {told:?}");
        assert!(told.ljung_box < 20.0 + 4.0 * 40.0_f64.sqrt(), "{seed}: {told:?}");

        let start = Noise { acceleration_density: 10.0, deviation: 3e-4 };
        let noise = most_likely_noise(&start, 1.0, 60, run);
        let steps = run(&noise).unwrap();
        let (extended, error) = (Score::of(&steps), error_mv(&steps, circuit.output_offset));
        let unscented = Score::of(&with_spring(ukf(), &circuit, &inputs, &output, &noise).unwrap());
        assert!((noise.deviation / truth.deviation - 1.0).abs() < 0.1, "{seed}: {noise:?}");
        assert!(
            (noise.acceleration_density / truth.acceleration_density).ln().abs() < 0.4,
            "{seed}: {noise:?}"
        );

        let bare = Circuit { input_offset: 0.0, ..circuit };
        let inputs = drive(&input, &bare, band, count);
        let fitted = Linear::most_likely(&circuit, &inputs, &output, 450);
        let steps = fitted.run(&inputs, &output).unwrap();
        let (linear, linear_error) = (Score::of(&steps), error_mv(&steps, fitted.output_offset));
        println!(
            "seed {seed}: RMSE ratio {:.3}, likelihood gain {:.3}, output's error {error:.3} mV against {linear_error:.3}",
            extended.rmse_mv / linear.rmse_mv,
            extended.log_likelihood - linear.log_likelihood
        );
        println!(
            "  EKF       {extended:?} {noise:?}\n  UKF       {unscented:?}\n  linear KF {linear:?} {fitted:?}"
        );
        assert_better(&extended, &linear);
        assert_better(&unscented, &linear);
        // The linear model is so far off that its filter does best to believe each sample.
        assert!(error < 0.8 * linear_error, "{seed}: {error} {linear_error}");
    }
}

/// At most 0.8 times the error and at least 0.15 more likely per sample.
fn assert_better(cubic: &Score, linear: &Score) {
    assert!(cubic.rmse_mv <= 0.8 * linear.rmse_mv, "{cubic:?} {linear:?}");
    assert!(cubic.log_likelihood >= linear.log_likelihood + 0.15, "{cubic:?} {linear:?}");
}
