use crate::crossings::{Acceptance, DetectorSettings, LevelCrossing, SearchedSignal, SignalRows, find};
use crate::simulate::WhiteNoise;
use kalmems_core::Process;
use kalmems_models::capacitance::{CombCurve, CurveShape};
use kalmems_models::dynamics::MirrorResonator;
use std::f64::consts::TAU;
use std::ops::Range;

const INTERVAL_S: f64 = 2e-6;
const NOISE: f64 = 0.0435;

fn mirror() -> MirrorResonator<f64> {
    MirrorResonator { natural_rate: TAU * 624.6, damping_ratio: 0.0066 }
}

fn comb() -> CombCurve<f64> {
    CombCurve { centre: 0.0037, gain: 2.82e-3, steepness: 76.0, shape: CurveShape::Logistic }
}

/// A free decay, and when it passes the threshold.
struct ThresholdDecay {
    time_s: Vec<f64>,
    volts: Vec<f64>,
    crossings_s: Vec<f64>,
}

impl ThresholdDecay {
    /// From this amplitude in rad and phase in cycles, step by step of the exact process.
    fn of(amplitude: f64, phase: f64, samples: usize, noise: (f64, u64)) -> Self {
        let (mirror, comb, mut white) = (mirror(), comb(), WhiteNoise::new(noise.1, 0));
        let step = mirror.exact(INTERVAL_S, 0.0);
        let (sine, cosine) = (TAU * phase).sin_cos();
        let mut x = [amplitude * sine, amplitude * mirror.natural_rate * cosine];
        let mut decay = Self { time_s: vec![], volts: vec![], crossings_s: vec![] };
        for k in 0..samples {
            let time_s = k as f64 * INTERVAL_S;
            decay.time_s.push(time_s);
            decay.volts.push(comb.sensitivity(x[0]) * x[1] + noise.0 * white.sample());
            let next = step.step(&x, &[0.0]);
            if (x[0] < comb.centre) != (next[0] < comb.centre) {
                decay.crossings_s.push(time_s + INTERVAL_S * (comb.centre - x[0]) / (next[0] - x[0]));
            }
            x = next;
        }
        decay
    }

    /// By how much a time in s is off the nearest crossing; `None` near the ends, where the nearest one may be beyond them.
    fn error_s(&self, time_s: f64) -> Option<f64> {
        let ends_s = self.time_s.last()? - 1e-3;
        let errors = self.crossings_s.iter().map(|truth_s| time_s - truth_s);
        errors.min_by(|a, b| a.abs().total_cmp(&b.abs())).filter(|_| (1e-3..ends_s).contains(&time_s))
    }
}

fn found(
    decay: &ThresholdDecay,
    noise: f64,
    told: (CombCurve<f64>, MirrorResonator<f64>),
    least: f64,
) -> Vec<LevelCrossing> {
    let sought = SearchedSignal::of_comb((INTERVAL_S, noise * noise, 0.0), told.0, told.1);
    let acceptance = Acceptance::Deviations(least);
    let settings = DetectorSettings { width_s: 30e-6, separation_s: 300e-6, acceptance };
    find(SignalRows { time_s: &decay.time_s, volts: &decay.volts, first: 0 }, sought, &settings).unwrap()
}

/// Errors over the standard deviations that are claimed of them.
#[derive(Default)]
struct Claims {
    count: usize,
    within: usize,
    square: f64,
    error: f64,
}

impl Claims {
    fn add(&mut self, error_s: f64, sd_s: f64) {
        let ratio = error_s / sd_s;
        self.count += 1;
        self.within += usize::from(ratio.abs() <= 3.0);
        self.square += ratio * ratio;
        self.error += error_s * error_s;
    }

    fn rms(&self) -> f64 {
        (self.square / self.count as f64).sqrt()
    }

    fn within(&self) -> f64 {
        self.within as f64 / self.count as f64
    }

    fn holds(&self) -> bool {
        self.within() >= 0.97 && (0.7..=1.2).contains(&self.rms())
    }
}

impl std::fmt::Display for Claims {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let error_us = 1e6 * (self.error / self.count as f64).sqrt();
        let (count, within, rms) = (self.count, self.within(), self.rms());
        write!(f, "{count}: {error_us:.1} us, {rms:.2} sd, {within:.3} within 3")
    }
}

/// Of decays with a noise so many times the usual one: what is told instead of a zero, all that is told, and the vertex with the
/// jitter of its own curvature instead of the former.
fn claims(
    times: f64,
    least: f64,
    told: (CombCurve<f64>, MirrorResonator<f64>),
    seeds: &Range<u64>,
) -> [Claims; 3] {
    let mut claims: [Claims; 3] = Default::default();
    let noise = times * NOISE;
    for seed in seeds.clone() {
        let decay = ThresholdDecay::of(0.15, 0.618 * seed as f64, 40_000, (noise, seed));
        for crossing in found(&decay, noise, told, least) {
            let best = crossing.best();
            let Some(error_s) = decay.error_s(best.time_s) else { continue };
            claims[1].add(error_s, best.sd_s);
            if crossing.fallback.is_some() {
                claims[0].add(error_s, best.sd_s);
                if let Some(error_s) = decay.error_s(crossing.parabola.time_s) {
                    claims[2].add(error_s, crossing.parabola.sd_s);
                }
            }
        }
    }
    claims
}

/// Other seeds than those that the numbers of the method were chosen by.
const DECAYS: Range<u64> = 7_000..7_014;

#[test]
fn errors_of_crossings_are_as_large_as_claimed_at_all_noises() {
    claims_hold(&DECAYS);
}

#[test]
#[ignore = "30 decays at each of five noises"]
fn slow_errors_of_crossings_are_as_large_as_claimed_in_30_decays() {
    claims_hold(&(7_000..7_030));
}

/// At noises from the usual one to sixteen times as much, where the steepest slope of the largest motion is eight deviations of noise.
fn claims_hold(seeds: &Range<u64>) {
    for times in [1.0, 2.0, 4.0, 8.0, 16.0] {
        let [fallback, all, vertex] = claims(times, 2.0, (comb(), mirror()), seeds);
        println!("{times} x: instead of a zero {fallback}; all {all}; vertices {vertex}");
        assert!(fallback.count >= 200 && fallback.holds(), "{times}: {fallback}");
        assert!(all.holds(), "{times}: {all}");
        // What they claimed by the curvature that noise gives them.
        assert!(vertex.rms() > 3.0 && vertex.within() < 0.7, "{times}: {vertex}");
        let [fallback, all, _] = claims(times, 4.0, (comb(), mirror()), seeds);
        println!("{times} x, from 4 deviations: instead of a zero {fallback}; all {all}");
        assert!(all.count >= 200 && all.holds(), "{times}: {all}");
    }
}

/// Told a gain that is 10 % too large, a comb whose edge is 28 % too wide and a resonance that is 0.8 % too high.
#[test]
fn errors_of_crossings_are_as_large_as_claimed_by_a_model_that_is_wrong() {
    let wrong = CombCurve { gain: 1.1 * comb().gain, steepness: 0.72 * comb().steepness, ..comb() };
    let resonance = MirrorResonator { natural_rate: 1.008 * mirror().natural_rate, ..mirror() };
    for times in [2.0, 8.0] {
        let [fallback, all, _] = claims(times, 2.0, (wrong, resonance), &DECAYS);
        println!("{times} x: instead of a zero {fallback}; all {all}");
        assert!(fallback.count >= 200 && fallback.holds(), "{times}: {fallback}");
    }
}

/// Where samples are missing beside a crossing of a strong signal no zero is fitted, and the vertex is what there is.
#[test]
fn vertices_beside_gaps_are_as_far_off_as_claimed() {
    for (times, amplitude) in [(0.3, 0.15), (1.0, 0.15), (1.0, 0.08)] {
        let (noise, mut claims, mut loud) = (times * NOISE, Claims::default(), 0);
        for seed in 8_000..8_006 {
            let mut decay = ThresholdDecay::of(amplitude, 0.618 * seed as f64, 20_000, (noise, seed));
            for (place, crossing_s) in decay.crossings_s.iter().enumerate() {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a row
                let row = (crossing_s / INTERVAL_S) as usize;
                // On either side, within what a zero is fitted to and beyond what a slope is computed from.
                let missing = if place % 2 == 0 {
                    row + 78..row + 84
                } else {
                    row.saturating_sub(84)..row.saturating_sub(78)
                };
                for volts in decay.volts.get_mut(missing).into_iter().flatten() {
                    *volts = f64::NAN;
                }
            }
            for crossing in found(&decay, noise, (comb(), mirror()), 4.0) {
                let Some(instant) = crossing.fallback else { continue };
                let Some(error_s) = decay.error_s(instant.time_s) else { continue };
                claims.add(error_s, instant.sd_s);
                loud += usize::from(crossing.zero.is_none());
            }
        }
        println!("{times} x noise, {amplitude} rad: {claims}, {loud} without a zero");
        assert!(claims.count >= 200 && loud >= 200 && claims.holds(), "{claims}");
    }
}

#[test]
fn zeros_of_a_strong_signal_are_delivered_unchanged() {
    let decay = ThresholdDecay::of(0.15, 0.2, 20_000, (NOISE, 9_000));
    let found = found(&decay, NOISE, (comb(), mirror()), 4.0);
    let inner = found.iter().filter(|crossing| (200..19_800).contains(&crossing.index));
    let told = inner.filter(|crossing| crossing.fallback.is_none() && Some(crossing.best()) == crossing.zero);
    assert!(told.count() >= 48, "{found:?}");
}

/// The model's line is that of a mirror that moves. Of one that rests most slopes of noise tell no time all the same: their standard
/// deviations are above half that of a time of which nothing is known but that it is within a quarter of the cycle, 400 µs.
#[test]
fn most_slopes_of_a_mirror_at_rest_tell_no_time() {
    let (mut slopes, mut told) = (0, 0);
    for seed in 9_200..9_206 {
        let still = ThresholdDecay::of(0.0, 0.0, 40_000, (NOISE, seed));
        for crossing in found(&still, NOISE, (comb(), mirror()), 2.0) {
            slopes += 1;
            told += usize::from(crossing.best().sd_s < 0.5 * 400e-6 / 3.0_f64.sqrt());
        }
    }
    println!("{told} of {slopes} slopes of noise are told");
    assert!(slopes > 300 && 2 * told < slopes, "{told} of {slopes}");
}
