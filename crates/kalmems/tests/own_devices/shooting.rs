//! Fits of differential equations: simulated devices whose parameters are known, and the measured Silverbox.

#![allow(clippy::inline_always)] // models are inlined whole, by the macro

use kalmems::fit::{
    ByDual, DerivedNumber, Fit, FitSettings, ParameterBounds, Regression, ResidualLaw, Shooting,
    ShootingError, Unknown, fit,
};
use kalmems::signal::band_limited;
use kalmems::simulate::WhiteNoise;
use kalmems_core::{
    Covariance, Dynamics, Ldl, Mat, Measurement, Nodes, NoiseDensity, Over, Process, Rk4, Scalar,
};
use kalmems_macros::{Parameters, model};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{Duffing, ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;
use statrs::distribution::{Binomial, ChiSquared, ContinuousCDF, Discrete, DiscreteCDF};
use std::f64::consts::TAU;

/// ÿ + d·ẏ + ω₀²·y + a₃·y³ = g·(u − u₀).
#[derive(Clone, Copy, Parameters)]
struct Circuit<P> {
    duffing: Duffing<P>,
    input_offset: P,
}

#[model(parametric)]
impl<T: Scalar> Dynamics<T, 2> for Circuit<T> {
    type Input = T;

    fn derivative<S: Over<T>>(&self, x: &[S; 2], input: &T) -> [S; 2] {
        [x[1], self.duffing.acceleration(x[0], x[1], *input - self.input_offset)]
    }
}

/// y + y₀.
#[derive(Clone, Copy, Parameters)]
struct Output<P> {
    offset: P,
}

#[model(parametric)]
impl<T: Scalar> Measurement<T, 2, 1> for Output<T> {
    fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 1] {
        [x[0] + self.offset]
    }
}

fn rk4<D: Dynamics<f64, 2, Input = f64>>(dynamics: D, interval_s: f64) -> Rk4<D, f64, 2> {
    Rk4::new(dynamics, interval_s, &NoiseDensity::none(), (&[0.0; 2], &0.0))
}

/// Over many records: intervals of 50 and 95 % hold the truth that often for each unknown, and the errors of all
/// unknowns together are as large as the covariance says. Each test would fail by chance once in a thousand sets
/// of seeds; the seeds are fixed.
fn assert_deviations_are_right<const Q: usize, const K: usize>(
    names: [&str; Q],
    truth: &[f64; Q],
    fits: &[Fit<K>],
) {
    let n = fits.len() as u64;
    for (i, name) in names.iter().enumerate() {
        let scores: Vec<f64> =
            fits.iter().map(|fit| (fit.parameters[i] - truth[i]) / fit.parameter(i).deviation).collect();
        for (coverage, width) in [(0.5, 0.674_490), (0.95, 1.959_964)] {
            let inside = scores.iter().filter(|z| z.abs() < width).count() as u64;
            let binomial = Binomial::new(coverage, n).unwrap();
            let at_most = binomial.cdf(inside);
            let at_least = 1.0 - at_most + binomial.pmf(inside);
            println!("{name}: {inside} of {n} within {coverage}");
            assert!(
                at_most > 5e-4 && at_least > 5e-4,
                "{name}: {inside} of {n} within {coverage}: {scores:?}"
            );
        }
    }
    let distance: f64 = fits
        .iter()
        .map(|fit| {
            // Scaled by the deviations: the parameters are many orders of magnitude apart.
            let scale: [f64; Q] = std::array::from_fn(|i| fit.parameter(i).deviation);
            let error: [f64; Q] = std::array::from_fn(|i| (fit.parameters[i] - truth[i]) / scale[i]);
            let correlation = Mat::from_fn(|i, j| fit.covariance.get(i, j) / (scale[i] * scale[j]));
            let solved = Ldl::of(&Covariance::<f64, Q>::from_lower(correlation)).solve(&error);
            error.iter().zip(solved).map(|(a, b)| a * b).sum::<f64>()
        })
        .sum();
    let expected = fits.len() * Q;
    let below = ChiSquared::new(expected as f64).unwrap().cdf(distance);
    println!("squared errors {distance:.1} of {expected} expected");
    assert!((5e-4..1.0 - 5e-4).contains(&below), "{distance} of {expected}");
}

/// A circuit like the Silverbox, driven by a multisine that bends its spring by a tenth.
#[test]
fn a_driven_duffing_oscillator_within_its_standard_deviations() {
    const RATE_HZ: f64 = 610.0;
    const COUNT: usize = 800;
    const STEPS: usize = 4;
    let circuit = Circuit {
        duffing: Duffing { damping: 42.0, stiffness: 1.84e5, cubic: 7.3e5, gain: 1.86e5 },
        input_offset: 8e-3,
    };
    let offset = 3e-3;
    let start = [0.05, -3.0];
    let input = |t: f64| -> f64 {
        (0..12)
            .map(|i| {
                let f = 20.0 + 10.3 * f64::from(i);
                0.012 * (TAU * f * t + 1.7 * f64::from(i * i)).sin()
            })
            .sum()
    };
    let nodes = |step: usize, per_sample: usize| {
        let at = |half: usize| input((2 * step + half) as f64 / (2.0 * per_sample as f64 * RATE_HZ));
        Nodes { start: at(0), middle: at(1), end: at(2) }
    };
    // The truth is integrated four times as finely.
    let fine = rk4(circuit, 1.0 / (16.0 * RATE_HZ));
    let mut x = start;
    let mut truth = vec![x[0] + offset];
    for step in 0..16 * (COUNT - 1) {
        x = fine.step(&x, &nodes(step, 16));
        if step % 16 == 15 {
            truth.push(x[0] + offset);
        }
    }
    assert!(truth.iter().any(|y| 3.0 * 7.3e5 * y * y > 0.1 * 1.84e5), "the spring is hardly bent");

    let drive: Vec<Nodes<f64>> = (0..STEPS * (COUNT - 1)).map(|step| nodes(step, STEPS)).collect();
    let unknowns = [
        Unknown::Process("duffing.damping"),
        Unknown::Process("duffing.stiffness"),
        Unknown::Process("duffing.cubic"),
        Unknown::Process("duffing.gain"),
        Unknown::Process("input_offset"),
        Unknown::Measurement("offset"),
        Unknown::Start(0),
        Unknown::Start(1),
    ];
    let names = ["damping", "stiffness", "cubic", "gain", "input offset", "output offset", "x", "x rate"];
    let right = [42.0, 1.84e5, 7.3e5, 1.86e5, 8e-3, offset, start[0], start[1]];
    let believed = Circuit {
        duffing: Duffing { damping: 60.0, stiffness: 1.9e5, cubic: 0.0, gain: 1.7e5 },
        input_offset: 0.0,
    };
    let fits: Vec<Fit<8>> = (0..40)
        .map(|seed| {
            let mut noise = WhiteNoise::new(seed, 0);
            let mut samples: Vec<[f64; 1]> = truth.iter().map(|y| [y + 1e-3 * noise.sample()]).collect();
            // Missing samples are passed over, but time goes on.
            samples[300..340].fill([f64::NAN]);
            let shooting = Shooting::new(
                (rk4(believed, 1.0 / (STEPS as f64 * RATE_HZ)), Output { offset: 0.0 }),
                ([0.0; 2], unknowns),
                (STEPS, |step| drive[step]),
                (&samples, [1e-3]),
            )
            .unwrap();
            let found = fit(&ByDual(shooting), &FitSettings::from_start(shooting.nominal())).unwrap();
            assert_eq!(found.degrees_of_freedom, COUNT - 40 - 8);
            assert!((found.residual_deviation() - 1.0).abs() < 0.13, "{}", found.residual_deviation());
            found
        })
        .collect();
    assert_deviations_are_right(names, &right, &fits);
}

fn scanner(stiffness: f64, damping: f64, comb: GaussianComb<f64>) -> ParametricScanner<f64> {
    ParametricScanner {
        resonator: TorsionalResonator { inertia: 1.15e-14, damping, stiffness },
        comb,
        carrier_mean_square: 18.0,
    }
}

const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };

fn readout(comb: GaussianComb<f64>) -> DemodulatedComb<f64> {
    DemodulatedComb { comb, gain: -0.3574e12, offset: 6.3945 }
}

/// The scanner left to itself under a bias of 60 V, whose electrodes pull and are seen at once: without the bias's
/// stiffness the mechanical one would come out 0.5 % too high.
#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_a_ring_down_with_electrodes_that_pull_and_are_seen() {
    const COUNT: usize = 1500;
    const INTERVAL_S: f64 = 2e-6;
    const STEPS: usize = 4;
    let truth = scanner(1.10e-4, 5.95e-12, COMB);
    let start = [0.15, 2e3];
    let fine = rk4(truth, INTERVAL_S / 16.0);
    let mut x = start;
    let mut clean = Vec::new();
    for _ in 0..COUNT {
        let [y] = readout(COMB).predict(&x);
        clean.push(y);
        for _ in 0..16 {
            x = fine.step(&x, &Nodes::held(60.0));
        }
    }
    let unknowns = [
        Unknown::Process("resonator.stiffness"),
        Unknown::Process("resonator.damping"),
        Unknown::Shared { process: "comb.nominal", measurement: "comb.nominal" },
        Unknown::Start(0),
        Unknown::Start(1),
        Unknown::Shared { process: "comb.angular_width", measurement: "comb.angular_width" },
    ];
    let deviation = 1.92e-4_f64.sqrt();
    let comb = GaussianComb { nominal: 5.6e-12, ..COMB };
    let samples_of = |seed: u64| -> Vec<[f64; 1]> {
        let mut noise = WhiteNoise::new(seed, 1);
        clean.iter().map(|y| [y + deviation * noise.sample()]).collect()
    };
    let fit_to = |samples: &[[f64; 1]], width_is_free: bool| {
        let believed = scanner(1.1002e-4, 7e-12, comb);
        let shooting = Shooting::new(
            (rk4(believed, INTERVAL_S / STEPS as f64), readout(comb)),
            ([0.14, 0.0], unknowns),
            (STEPS, |_| Nodes::held(60.0)),
            (samples, [deviation]),
        )
        .unwrap();
        // θ → −θ is as good an answer: the sign of the start says which.
        let mut settings = FitSettings::from_start(shooting.nominal());
        settings.bounds[3] = ParameterBounds { low: 0.01, high: 0.5 };
        settings.free[5] = width_is_free;
        fit(&ByDual(shooting), &settings).unwrap()
    };
    let fits: Vec<Fit<6>> = (0..24).map(|seed| fit_to(&samples_of(seed), false)).collect();
    // Without the width, which was held.
    let names = ["stiffness", "damping", "C0", "angle", "rate"];
    let right = [1.10e-4, 5.95e-12, COMB.nominal, start[0], start[1]];
    assert_deviations_are_right(names, &right, &fits);

    // Width and angle grow together without being seen, but for the little that the bias then pulls less: that is
    // the direction that the record says least of.
    let all = fit_to(&samples_of(0), true);
    let weakest = all.weakest.unwrap();
    assert!(weakest.parts[3] * weakest.parts[5] > 0.4, "{weakest:?}");
    assert!(all.parameter(5).deviation > 0.03 * COMB.angular_width);
}

/// What is not right is refused, and named.
#[test]
fn wrong_unknowns_are_named() {
    let samples = [[0.0]; 3];
    let shoot = |unknowns: [Unknown; 2], steps: usize, deviation: f64| {
        Shooting::new(
            (rk4(scanner(1e-4, 6e-12, COMB), 1e-6), readout(COMB)),
            ([0.1, 0.0], unknowns),
            (steps, |_| Nodes::held(0.0)),
            (&samples, [deviation]),
        )
        .map(|shooting| shooting.nominal())
    };
    let stiffness = Unknown::Process("resonator.stiffness");
    assert_eq!(shoot([stiffness, Unknown::Start(0)], 1, 1.0), Ok([1e-4, 0.1]));
    assert_eq!(shoot([stiffness, Unknown::Measurement("comb.bias")], 1, 1.0), Ok([1e-4, COMB.bias]));
    let message = |unknowns| shoot(unknowns, 1, 1.0).unwrap_err().to_string();
    assert_eq!(
        message([stiffness, Unknown::Measurement("comb.bais")]),
        "the measurement has no parameter `comb.bais`; it has: comb.nominal, comb.angular_width, comb.bias, gain, \
         offset"
    );
    assert_eq!(message([stiffness, Unknown::Start(2)]), "there is no state 2; there are 2, counted from 0");
    let shared = Unknown::Shared { process: "comb.bias", measurement: "comb.bias" };
    assert_eq!(
        shoot([shared, Unknown::Measurement("comb.bias")], 1, 1.0),
        Err(ShootingError::Twice { first: 0, second: 1 })
    );
    assert_eq!(shoot([stiffness, Unknown::Start(0)], 0, 1.0), Err(ShootingError::NoSteps));
    for deviation in [0.0, f64::NAN, f64::INFINITY] {
        let refused = shoot([stiffness, Unknown::Start(0)], 1, deviation);
        assert_eq!(refused, Err(ShootingError::Deviation { output: 0 }));
    }
}

/// The derivatives that run along are those of the residuals.
#[test]
fn derivatives_are_those_of_finite_differences() {
    let samples = [[0.5], [f64::NAN], [0.6], [0.7]];
    let shooting = Shooting::new(
        (rk4(scanner(1e-4, 6e-12, COMB), 1e-6), readout(COMB)),
        (
            [0.1, 100.0],
            [
                Unknown::Process("resonator.stiffness"),
                Unknown::Shared { process: "comb.nominal", measurement: "comb.nominal" },
                Unknown::Start(1),
            ],
        ),
        (7, |step| Nodes::held(80.0 + step as f64)),
        (&samples, [0.01]),
    )
    .unwrap();
    let law = ByDual(shooting);
    let at = shooting.nominal();
    let residuals = |p: &[f64; 3]| {
        let mut all = Vec::new();
        law.residuals(p, &mut |r| all.push(r));
        all
    };
    let mut rows = Vec::new();
    law.linearize(&at, &mut |r, gradient| rows.push((r, *gradient)));
    assert_eq!(rows.iter().map(|(r, _)| *r).collect::<Vec<_>>(), residuals(&at));
    assert_eq!(rows.len(), 3);
    for i in 0..3 {
        let step = 1e-5 * at[i];
        let [up, down] = [step, -step].map(|h| {
            let mut p = at;
            p[i] += h;
            residuals(&p)
        });
        for (k, (_, gradient)) in rows.iter().enumerate() {
            let difference = (up[k] - down[k]) / (2.0 * step);
            let size = rows.iter().map(|(_, g)| g[i].abs()).fold(0.0, f64::max);
            assert!((gradient[i] - difference).abs() < 1e-6 * size, "residual {k}, unknown {i}");
        }
    }
    // The law itself is generic: it can be asked for numbers as well.
    let mut count = 0;
    ResidualLaw::<3>::residuals(&shooting, &at, &mut |_: f64| count += 1);
    assert_eq!(count, 3);
}

/// Reading and drive of the Silverbox from `from` on.
struct Silverbox {
    input: Vec<f64>,
    output: Vec<[f64; 1]>,
}

impl Silverbox {
    const RATE_HZ: f64 = 610.351_562_5;
    const STEPS: usize = 4;

    fn load() -> (Self, serde_json::Value) {
        let data =
            std::env::var_os("KALMEMS_REFERENCE_DATA").expect("KALMEMS_REFERENCE_DATA names the folder");
        let folder = std::path::PathBuf::from(data).join("real/silverbox");
        let text = std::fs::read_to_string(folder.join("snls80mv.csv")).unwrap();
        let (input, output) = text
            .lines()
            .skip(1)
            .map(|line| {
                let (u, y) = line.split_once(',').unwrap();
                (u.parse::<f64>().unwrap(), [y.parse::<f64>().unwrap()])
            })
            .unzip();
        let expected = std::fs::read_to_string(folder.join("expected.json")).unwrap();
        (Self { input, output }, serde_json::from_str(&expected).unwrap())
    }

    /// The input of each step from sample `from` to sample `to`, seen this much later.
    fn drive(&self, from: usize, to: usize, delay_s: f64) -> Vec<Nodes<f64>> {
        // Every half step once: they are shared by neighbours.
        let halves = 2 * Self::STEPS;
        let at = |half: usize| {
            band_limited(&self.input, from as f64 + half as f64 / halves as f64 - delay_s * Self::RATE_HZ)
        };
        let values: Vec<f64> = (0..=halves * (to - from - 1)).map(at).collect();
        let steps = values.windows(3).step_by(2);
        steps.map(|v| Nodes { start: v[0], middle: v[1], end: v[2] }).collect()
    }
}

/// What `scipy`'s least squares found with an integrator of its own, and the bars of the project: f0 within
/// 0.05 Hz, Q within 0.05, 0.45 mV on the part that no parameter has seen.
#[test]
#[ignore = "needs KALMEMS_REFERENCE_DATA"]
fn the_measured_silverbox() {
    let (recorded, expected) = Silverbox::load();
    let expected = &expected["duffing_greybox_fit"];
    let (from, to) = (40_500, 57_868);
    let samples = &recorded.output[from..to];
    let unknowns = [
        Unknown::Process("duffing.damping"),
        Unknown::Process("duffing.stiffness"),
        Unknown::Process("duffing.cubic"),
        Unknown::Process("duffing.gain"),
        Unknown::Process("input_offset"),
        Unknown::Measurement("offset"),
        Unknown::Start(0),
        Unknown::Start(1),
    ];
    // From the linear frequency response: 73 Hz and a damping ratio of 0.05.
    let rate = TAU * 73.0;
    let believed = Circuit {
        duffing: Duffing { damping: 0.1 * rate, stiffness: rate * rate, cubic: 0.0, gain: 0.8 * rate * rate },
        input_offset: 0.0,
    };
    let interval_s = 1.0 / (Silverbox::RATE_HZ * Silverbox::STEPS as f64);
    let with_delay = |delay_s: f64, start: Option<[f64; 8]>| {
        let drive = recorded.drive(from, to, delay_s);
        let shooting = Shooting::new(
            (rk4(believed, interval_s), Output { offset: 0.0 }),
            ([0.0; 2], unknowns),
            (Silverbox::STEPS, |step: usize| drive[step]),
            (samples, [1.0]),
        )
        .unwrap();
        fit(&ByDual(shooting), &FitSettings::from_start(start.unwrap_or(shooting.nominal()))).unwrap()
    };
    // The delay by a parabola through three of a grid, the others being fitted at each.
    let spacing = 5e-6;
    let middle = with_delay(0.0, None);
    let sides = [-spacing, spacing].map(|delay| with_delay(delay, Some(middle.parameters)).sum_of_squares);
    let curvature = sides[0] - 2.0 * middle.sum_of_squares + sides[1];
    let delay_s = 0.5 * spacing * (sides[0] - sides[1]) / curvature;
    let found = with_delay(delay_s, Some(middle.parameters));

    let frequency = found.derived(|p| Scalar::sqrt(p[1]) * (1.0 / TAU));
    let quality = found.derived(|p| Scalar::sqrt(p[1]) / p[0]);
    let said =
        |what: &str, ours: DerivedNumber| println!("{what}: {:.6e} ± {:.1e}", ours.value, ours.deviation);
    said("f0", frequency);
    said("Q", quality);
    println!("delay {delay_s:.3e} s");
    assert!((frequency.value - 68.32).abs() < 0.05 && (quality.value - 10.25).abs() < 0.05);
    for (index, key) in ["d", "w2", "a3", "g", "u0_v", "y0_v"].into_iter().enumerate() {
        let (value, sd) =
            (expected["parameters"][key].as_f64().unwrap(), expected["sd"][key].as_f64().unwrap());
        let ours = found.parameter(index);
        said(key, ours);
        println!("    expected {value:e} ± {sd:.1e}: {:.2} of them", (ours.value - value) / sd);
        assert!((ours.value - value).abs() < sd, "{key}");
    }

    // The arrow: noise of growing amplitude, up to twice what was trained on.
    let count = 40_450;
    let drive = recorded.drive(0, count, delay_s);
    let arrow = Shooting::new(
        (rk4(believed, interval_s), Output { offset: 0.0 }),
        ([0.0; 2], unknowns),
        (Silverbox::STEPS, |step: usize| drive[step]),
        (&recorded.output[..count], [1.0]),
    )
    .unwrap();
    let mut at_rest = found.parameters;
    at_rest[6..].fill(0.0);
    let mut sum = 0.0;
    arrow.run(&at_rest, count, |k, [y]: [f64; 1]| {
        if k >= 400 {
            sum += (y - recorded.output[k][0]).powi(2);
        }
    });
    let rmse = (sum / (count - 400) as f64).sqrt();
    println!("arrow: {:.4} mV", 1e3 * rmse);
    assert!(rmse < 0.45e-3);
}
