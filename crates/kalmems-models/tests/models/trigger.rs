//! The trigger: against closed forms, and against the truth under a filter's own claim.

use kalmems_core::{
    Covariance, Ekf, Filter, Measurement, Nodes, NoiseDensity, Over, Process, ProcessNoise, Rk4, Scalar,
};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::control::{
    Mark, MotionPhase, NoCrossing, Oscillator, Trigger, TriggerEvent, TriggerSettings, UnusableTrigger,
};
use kalmems_models::dynamics::{Duffing, ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;
use std::collections::VecDeque;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Numbers of mean 0 and variance 1 from a linear congruential generator (Knuth's constants) and twelve uniforms.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let mut uniform = || {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }
}

const INTERVAL: f64 = 1e-6;

fn settings(rate: f64, mark: Mark<f64>, lead: f64) -> TriggerSettings<f64> {
    TriggerSettings { interval: INTERVAL, rate, mark, lead, least_amplitude: 1e-3 }
}

/// Without damping: θ = A·cos ωt exactly, from any point of the cycle to any phase, with the closed form of σ.
#[test]
fn a_harmonic_motion_passes_the_level_at_the_time_of_the_closed_form() {
    let rate = TAU * 15_700.0;
    let spring = Duffing { damping: 0.0, stiffness: rate * rate, cubic: 0.0, gain: 0.0 };
    let process = Rk4::new(spring, INTERVAL, &NoiseDensity::none(), (&[0.0; 2], &0.0));
    let (amplitude, sd) = (0.2, [1e-4, 5.0]);
    let covariance = Covariance::from_standard_deviations(sd);
    for (mark, phase) in [
        (Mark::Rising, -FRAC_PI_2),
        (Mark::Falling, FRAC_PI_2),
        (Mark::Phase(0.3), 0.3),
        (Mark::Phase(-2.0), -2.0),
    ] {
        let trigger = Trigger::new(settings(rate, mark, 10e-6)).unwrap();
        for k in 0..40 {
            let now = TAU * (f64::from(k) + 0.37) / 40.0;
            let mean = [amplitude * now.cos(), -amplitude * rate * now.sin()];
            let onward = (&process, &Nodes::held(0.0));
            let crossing = trigger.predict((&onward, (&mean, &covariance)), 0.0, 80e-6).unwrap();
            let turn = (phase - now).rem_euclid(TAU);
            let off = crossing.after - turn / rate;
            // RK4 loses (ωh)⁵/120 of the phase in each step; the cubic is off by 0.02·(ωh)⁴/ω.
            let bow = (rate * INTERVAL).powi(4) / rate;
            // Before the first whole sample a parabola is all there is: 0.07·(ωh)³/ω.
            let at_once = if turn < rate * INTERVAL { 0.07 * (rate * INTERVAL).powi(3) / rate } else { 0.0 };
            assert!(off.abs() < 0.03 * bow + bow * turn / 100.0 + at_once, "{mark:?} {k}: {off}");
            // Carried over the time t, the weights on angle and rate turn by ωt.
            let g = [(turn - phase).sin(), -(turn - phase).cos() / rate];
            let exact = (g[0] * sd[0]).hypot(g[1] * sd[1]) / (amplitude * rate);
            assert!((crossing.sd / exact - 1.0).abs() < 3e-3, "{mark:?} {k}: {} {exact}", crossing.sd);
        }
    }
}

/// White angular acceleration of density D adds ∫ D·sin²(ω(t − s))/ω² ds to the variance of the angle.
#[test]
fn process_noise_widens_what_lies_ahead() {
    let rate = TAU * 15_700.0;
    let density = 1e6;
    let spring = Duffing { damping: 0.0, stiffness: rate * rate, cubic: 0.0, gain: 0.0 };
    let noise = NoiseDensity::none().on::<1>(density);
    let process = Rk4::new(spring, INTERVAL, &noise, (&[0.0; 2], &0.0));
    let trigger = Trigger::new(settings(rate, Mark::Falling, 10e-6)).unwrap();
    for after in [3.3e-6, 9.6e-6, 15.9e-6] {
        let now = FRAC_PI_2 - rate * after;
        let mean = [0.2 * now.cos(), -0.2 * rate * now.sin()];
        let known = Covariance::from_standard_deviations([1e-12, 1e-9]);
        let onward = (&process, &Nodes::held(0.0));
        let crossing = trigger.predict((&onward, (&mean, &known)), 0.0, 40e-6).unwrap();
        let turned = 2.0 * rate * after;
        let variance = density / (rate * rate) * 0.5 * (after - turned.sin() / (2.0 * rate));
        let exact = variance.sqrt() / (0.2 * rate);
        assert!((crossing.sd / exact - 1.0).abs() < 0.04, "{after}: {} {exact}", crossing.sd);
    }
}

#[test]
fn what_cannot_be_told_is_refused() {
    let rate = 1e5;
    let spring = Duffing { damping: 0.0, stiffness: rate * rate, cubic: 0.0, gain: 0.0 };
    let process = Rk4::new(spring, INTERVAL, &NoiseDensity::none(), (&[0.0; 2], &0.0));
    let covariance = Covariance::from_standard_deviations([1e-4, 10.0]);
    let trigger = Trigger::new(settings(rate, Mark::Rising, 10e-6)).unwrap();
    let onward = (&process, &Nodes::held(0.0));
    let predict =
        |mean: [f64; 2], from, horizon| trigger.predict((&onward, (&mean, &covariance)), from, horizon);
    assert_eq!(predict([5e-4, 0.0], 0.0, 100e-6), Err(NoCrossing::TooSmall));
    assert_eq!(predict([f64::NAN, 0.0], 0.0, 100e-6), Err(NoCrossing::TooSmall));
    // From the positive turning point it rises again three quarters of 62.8 µs later.
    assert_eq!(predict([0.1, 0.0], 0.0, 47.1e-6), Err(NoCrossing::BeyondHorizon));
    assert!((predict([0.1, 0.0], 0.0, 47.2e-6).unwrap().after - 0.75 * TAU / rate).abs() < 1e-10);
    // And once more in each cycle.
    for cycles in [1.0, 20.0] {
        let from = (cycles + 0.25) * TAU / rate;
        let after = predict([0.1, 0.0], from, 2e-3).unwrap().after;
        assert!((after - (cycles + 0.75) * TAU / rate).abs() < 1e-9 * cycles, "{after}");
    }
    let unusable = |lead, rate| Trigger::new(settings(rate, Mark::Rising, lead)).err();
    assert_eq!(unusable(1e-6, rate), Some(UnusableTrigger::LeadTooShort));
    assert_eq!(unusable(4.2e-3, rate), Some(UnusableTrigger::LeadTooLong));
    assert_eq!(unusable(1e-5, 0.0), Some(UnusableTrigger::NotPositive));
    let nowhere = settings(rate, Mark::Phase(f64::NAN), 1e-5);
    assert_eq!(Trigger::new(nowhere).err(), Some(UnusableTrigger::NotPositive));
}

const SCANNER: ParametricScanner<f64> = ParametricScanner {
    resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
    comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
    carrier_mean_square: 18.0,
};
const READOUT: DemodulatedComb<f64> =
    DemodulatedComb { comb: SCANNER.comb, gain: -0.3574e12, offset: 6.3945 };

/// What a trigger told of one run, and how far it was off.
struct Told {
    /// Off by so many of its standard deviations.
    normalised: Vec<f64>,
    /// Off, in s.
    error_s: Vec<f64>,
    /// Passages of the truth that no event was told of.
    untold: usize,
}

const SAMPLES: u64 = 6000;

/// The scanner under its drive with noise on its angle and rate, seen through its readout by an EKF whose model is exact,
/// and the trigger on the EKF.
fn run(mark: Mark<f64>, lead: f64, seed: u64) -> Told {
    let rate = PI * 31_250.0;
    let mut drive = Oscillator { offset: 90.0, amplitude: 75.0, rate, phase: 0.0 };
    let density = 1e8;
    let noise = NoiseDensity::none().on::<1>(density);
    let process = Rk4::new(SCANNER, INTERVAL, &noise, (&[0.0; 2], &0.0));
    let variance: f64 = 1.92e-4;
    let r = Covariance::from_variances([variance]);
    let mut chance = Noise(seed);
    // On the upper branch; the first standard deviations are those of the start.
    let (start, sd) = ([0.195, 0.0], [2e-3, 200.0]);
    let mut truth = [start[0] + sd[0] * chance.next(), start[1] + sd[1] * chance.next()];
    let mut filter = Ekf::new(start, Covariance::from_standard_deviations(sd));
    let mut trigger = Trigger::new(settings(rate, mark, lead)).unwrap();
    let q: ProcessNoise<f64, 2> = *process.noise();
    let root = q.covariance().to_full();
    let (a, b) = (root.0[0][0].sqrt(), root.0[1][0] / root.0[0][0].sqrt());
    let c = (root.0[1][1] - b * b).sqrt();

    let weights = match mark {
        Mark::Rising => [1.0, 0.0],
        Mark::Falling => [-1.0, 0.0],
        Mark::Phase(phase) => [-phase.sin(), -phase.cos() / rate],
    };
    let value = |x: &[f64; 2]| weights[0] * x[0] + weights[1] * x[1];
    let mut waiting: VecDeque<(u64, TriggerEvent<f64>)> = VecDeque::new();
    let mut told = Told { normalised: Vec::new(), error_s: Vec::new(), untold: 0 };
    for k in 0..SAMPLES {
        let onward = (&process, &(drive, INTERVAL));
        if let Some(event) = trigger.step(&onward, (filter.mean(), &filter.covariance())) {
            assert_eq!(event.sample, k);
            waiting.push_back((k, event));
        }
        let nodes = drive.nodes(INTERVAL);
        let before = truth;
        truth = process.step(&truth, &nodes);
        let (first, second) = (chance.next(), chance.next());
        truth = [truth[0] + a * first, truth[1] + b * first + c * second];
        drive.advance(INTERVAL);
        filter.predict(&process, &nodes).unwrap();
        let [clean] = READOUT.predict(&truth);
        filter.update(&READOUT, &[clean + variance.sqrt() * chance.next()], &r).unwrap();
        if value(&before) < 0.0 && value(&truth) >= 0.0 && k > 500 {
            // Within a step the truth is a straight line with noise; its bow is 0.1 % of a sample.
            let into = value(&before) / (value(&before) - value(&truth));
            match waiting.pop_front() {
                Some((at, event)) => {
                    // At the first sample at which it is no farther away, to what a filter learns in one.
                    let after = event.crossing.after;
                    assert!(after <= lead && after > lead - 1.1 * INTERVAL, "{after} {lead}");
                    let error = event.crossing.after - ((k - at) as f64 + into) * INTERVAL;
                    told.error_s.push(error);
                    told.normalised.push(error / event.crossing.sd);
                }
                None => told.untold += 1,
            }
        } else if k <= 500 {
            // While the filter settles, some come too suddenly.
            let now = k as f64 * INTERVAL;
            waiting.retain(|(at, event)| *at as f64 * INTERVAL + event.crossing.after > now);
        }
    }
    // Each passage is told once: what waits has not happened yet.
    let end = SAMPLES as f64 * INTERVAL;
    for (at, event) in waiting {
        assert!(at as f64 * INTERVAL + event.crossing.after > end - INTERVAL);
    }
    told
}

/// Over `seeds` runs: the mean square of the normalised errors against χ² of as many degrees, with the correlation between
/// neighbouring events taken from the spread over the runs, and the mean error.
fn judge(mark: Mark<f64>, lead: f64, seeds: u64) {
    let (mut squares, mut means, mut events, mut untold) = (Vec::new(), Vec::new(), 0, 0);
    for seed in 1..=seeds {
        let told = run(mark, lead, seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let count = told.normalised.len() as f64;
        squares.push(told.normalised.iter().map(|x| x * x).sum::<f64>() / count);
        means.push(told.normalised.iter().sum::<f64>() / count);
        events += told.normalised.len();
        untold += told.untold;
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let standard_error = |values: &[f64]| {
        let middle = mean(values);
        let n = values.len() as f64;
        (values.iter().map(|x| (x - middle).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt()
    };
    let (nees, bias) = (mean(&squares), mean(&means));
    let (of_nees, of_bias) = (standard_error(&squares), standard_error(&means));
    println!(
        "{mark:?} {lead:e}: {events} events, NEES {nees:.3} ± {of_nees:.3}, bias {bias:.3} ± {of_bias:.3} σ"
    );
    assert_eq!(untold, 0, "{mark:?}");
    // Three standard errors, which themselves are small enough to tell a σ that is 10 % off.
    assert!((nees - 1.0).abs() < 3.0 * of_nees && of_nees < 0.07, "{mark:?} {nees} {of_nees}");
    assert!(bias.abs() < 3.0 * of_bias && of_bias < 0.12, "{mark:?} {bias} {of_bias}");
}

#[test]
fn the_times_are_as_uncertain_as_they_say() {
    judge(Mark::Rising, 10e-6, 24);
    judge(Mark::Phase(1.0), 15e-6, 24);
    // Some cycles of 64 µs.
    judge(Mark::Falling, 300e-6, 24);
}

#[test]
#[ignore = "slow"]
fn slow_the_times_are_as_uncertain_as_they_say_over_many_seeds() {
    for lead in [2e-6, 5e-6, 15e-6, 40e-6, 200e-6] {
        for mark in [Mark::Rising, Mark::Falling, Mark::Phase(0.0), Mark::Phase(2.5)] {
            judge(mark, lead, 200);
        }
    }
}

/// A gap of the samples: what passes in it without having been told is counted, what was told is not.
#[test]
fn what_passes_in_a_gap_is_counted() {
    let rate = TAU * 15_700.0;
    let spring = Duffing { damping: 0.0, stiffness: rate * rate, cubic: 0.0, gain: 0.0 };
    let process = Rk4::new(spring, INTERVAL, &NoiseDensity::none(), (&[0.0; 2], &0.0));
    let covariance = Covariance::from_standard_deviations([1e-4, 5.0]);
    let onward = (&process, &Nodes::held(0.0));
    // θ rises through 0 at each whole cycle; a lead of two cycles and a half.
    let mean = |time: f64| [0.2 * (rate * time).sin(), 0.2 * rate * (rate * time).cos()];
    let cycle = TAU / rate;
    let mut trigger = Trigger::new(settings(rate, Mark::Rising, 2.5 * cycle)).unwrap();
    let mut told = Vec::new();
    let mut step = |trigger: &mut Trigger<f64>, time: f64| {
        if let Some(event) = trigger.step(&onward, (&mean(time), &covariance)) {
            told.push(((time + event.crossing.after) / cycle).round());
        }
    };
    let mut time = 0.2 * cycle;
    for _ in 0..400 {
        step(&mut trigger, time);
        time += INTERVAL;
    }
    // Told are those until 2.5 cycles on; ten cycles without a sample.
    let known = (time - INTERVAL) / cycle + 2.5;
    let gap = 10.0 * cycle;
    time += gap - INTERVAL;
    assert!(trigger.passes(&mean(time), gap));
    assert_eq!(trigger.missed() as f64, (time / cycle).floor() - known.floor());
    let before = told.len();
    assert_eq!(told, (1..=before).map(|k| k as f64).collect::<Vec<f64>>());
    let mut step = |trigger: &mut Trigger<f64>, time: f64| {
        if let Some(event) = trigger.step(&onward, (&mean(time), &covariance)) {
            told.push(((time + event.crossing.after) / cycle).round());
        }
    };
    let missed = trigger.missed();
    for _ in 0..200 {
        time += INTERVAL;
        step(&mut trigger, time);
    }
    // From the next one on each is told again, and none is missed.
    let next = (time / cycle - 200.0 * INTERVAL / cycle).ceil();
    let after: Vec<f64> = (0..told.len() - before).map(|k| next + k as f64).collect();
    assert_eq!(told[before..], after);
    assert!(after.len() > 4 && trigger.missed() == missed);
    // Another one that knows what was told goes on where this one is.
    let mut resumed =
        Trigger::new(settings(rate, Mark::Rising, 2.5 * cycle)).unwrap().resumed(trigger.last_predicted());
    for _ in 0..200 {
        time += INTERVAL;
        let events = [&mut trigger, &mut resumed].map(|t| t.step(&onward, (&mean(time), &covariance)));
        assert_eq!(events[0].map(|event| event.crossing), events[1].map(|event| event.crossing));
    }
}

/// In f32 the event is told within nanoseconds of that in f64.
#[test]
fn single_precision_predicts_the_same_time() {
    fn after<P: Scalar + Over<P>>() -> P {
        let p = |x: f64| P::of(x);
        let resonator =
            TorsionalResonator { inertia: p(1.15e-14), damping: p(5.95e-12), stiffness: p(1.10e-4) };
        let comb = GaussianComb { nominal: p(5.71e-12), angular_width: p(0.2), bias: p(9.79e-12) };
        let scanner = ParametricScanner { resonator, comb, carrier_mean_square: p(18.0) };
        let noise = NoiseDensity::none().on::<1>(p(1e6));
        let process = Rk4::new(scanner, p(INTERVAL), &noise, (&[p(0.0); 2], &p(0.0)));
        let settings = TriggerSettings {
            interval: p(INTERVAL),
            rate: p(98_170.0),
            mark: Mark::Falling,
            lead: p(15e-6),
            least_amplitude: p(1e-3),
        };
        let drive = Oscillator { offset: p(90.0), amplitude: p(75.0), rate: p(98_170.0), phase: p(0.4) };
        let covariance = Covariance::from_standard_deviations([p(1e-4), p(10.0)]);
        let trigger = Trigger::new(settings).unwrap();
        let onward = (&process, &(drive, p(INTERVAL)));
        let state = (&[p(0.17), p(-9e3)], &covariance);
        trigger.predict((&onward, state), p(0.0), p(40e-6)).unwrap().after
    }
    let (double, single) = (after::<f64>(), after::<f32>());
    assert!((double - f64::from(single)).abs() < 2e-11, "{double} {single}");
}

/// Amplitude and phase of a state, all round the cycle.
#[test]
fn the_phase_of_a_state_is_that_of_its_cosine() {
    for k in -17..18 {
        let phase = f64::from(k) * PI / 18.0;
        let mean = [0.1 * phase.cos(), -0.1 * 1e5 * phase.sin(), 7.0];
        let wide = Covariance::from_standard_deviations([2e-4, 20.0, 1.0]);
        let of = MotionPhase::of(&mean, &wide, 1e5);
        assert!((of.phase - phase).abs() < 1e-14 && (of.amplitude - 0.1).abs() < 1e-15);
        // 2e-4 of the angle and as much of rate/ω: the same in every direction.
        assert!((of.amplitude_sd - 2e-4).abs() < 1e-12 && (of.phase_sd - 2e-3).abs() < 1e-11);
    }
    let single = MotionPhase::of(&[-0.1_f32, -1.0], &Covariance::from_standard_deviations([1e-4, 1.0]), 1e5);
    assert!((f64::from(single.phase) - (PI - 1e-4)).abs() < 1e-6);
}
