//! The detector on simulated free decays of the threshold-sensing scanner: how many crossings it finds against how
//! many it makes up, and how well it knows their times.

use crate::chance::{Chance, spread};
use kalmems_core::detect::{CubicFit, HoldLevel, Peak, SlopeKernel, Threshold, peaks};
use kalmems_core::{Measurement, Process};
use kalmems_models::capacitance::{CombCurve, CurveShape};
use kalmems_models::dynamics::MirrorResonator;
use kalmems_models::readout::CurrentReadout;
use std::f64::consts::TAU;

/// s between two samples.
const INTERVAL: f64 = 2e-6;
/// Samples of a record: 80 ms.
const LENGTH: usize = 40_000;
/// Samples of a segment; there are four.
const SEGMENT: f64 = 10_000.0;
/// V of a sample.
const NOISE: f64 = 0.0435;
/// Samples within which one maximum is kept.
const REACH: usize = 150;
/// Within so many samples, 0.2 ms, a detection is that of a crossing.
const NEAR: f64 = 100.0;
/// Samples at the ends in which nothing is scored.
const ENDS: f64 = 200.0;
/// One false alarm in 100 ms, per sample.
const RARE: f64 = 0.01 * 1e3 * INTERVAL;

fn mirror() -> MirrorResonator<f64> {
    MirrorResonator { natural_rate: TAU * 624.6, damping_ratio: 0.0066 }
}

fn comb() -> CombCurve<f64> {
    CombCurve { centre: 0.0037, gain: 2.82e-3, steepness: 76.0, shape: CurveShape::Logistic }
}

fn kernel() -> SlopeKernel<f64, 60> {
    SlopeKernel::new(15.0).unwrap()
}

fn responses(signal: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; signal.len()];
    kernel().responses(signal, &mut out);
    out
}

/// One crossing: when, in samples, and how fast, in rad/s.
#[derive(Clone, Copy)]
struct Crossing {
    time: f64,
    rate: f64,
}

/// A free decay from 0.15 rad.
struct Decay {
    states: Vec<[f64; 2]>,
    clean: Vec<f64>,
    crossings: Vec<Crossing>,
}

impl Decay {
    /// From this phase of the motion, in cycles.
    fn from(phase: f64) -> Self {
        let mirror = mirror();
        let step = mirror.exact(INTERVAL, 0.0);
        let readout = CurrentReadout { comb: comb(), offset: 0.0 };
        let (sine, cosine) = (TAU * phase).sin_cos();
        let mut x = [0.15 * sine, 0.15 * mirror.natural_rate * cosine];
        let mut decay = Self { states: vec![], clean: vec![], crossings: vec![] };
        for k in 0..LENGTH {
            let [volts]: [f64; 1] = readout.predict(&x);
            decay.states.push(x);
            decay.clean.push(volts);
            let next = step.step(&x, &[0.0]);
            if (x[0] < comb().centre) != (next[0] < comb().centre) {
                // Within a sample the angle is a parabola to 10⁻⁹ rad.
                let acceleration = mirror.acceleration(x[0], x[1], 0.0);
                let mut t = 0.0;
                for _ in 0..5 {
                    let miss = x[0] - comb().centre + t * (x[1] + 0.5 * acceleration * t);
                    t -= miss / (x[1] + acceleration * t);
                }
                decay
                    .crossings
                    .push(Crossing { time: k as f64 + t / INTERVAL, rate: x[1] + acceleration * t });
            }
            x = next;
        }
        decay.crossings.retain(|crossing| scored(crossing.time));
        decay
    }

    fn noisy(&self, chance: &mut Chance) -> Vec<f64> {
        self.clean.iter().map(|volts| volts + NOISE * chance.gaussian()).collect()
    }

    /// The angle at a time, by a parabola from the sample before.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // scored times are within the record
    fn angle(&self, time: f64) -> f64 {
        let [angle, rate] = self.states[time as usize];
        let t = time.fract() * INTERVAL;
        angle + t * (rate + 0.5 * mirror().acceleration(angle, rate, 0.0) * t)
    }

    fn nearest(&self, time: f64) -> Option<Crossing> {
        let apart = |crossing: &Crossing| (crossing.time - time).abs();
        let nearest = self.crossings.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
        (apart(nearest) < NEAR).then_some(*nearest)
    }
}

fn scored(time: f64) -> bool {
    (ENDS..=LENGTH as f64 - 1.0 - ENDS).contains(&time)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // not negative and below four
fn segment(time: f64) -> usize {
    (time / SEGMENT) as usize
}

/// How many crossings there were in each segment, how many were found, and how many detections belong to none.
#[derive(Clone, Copy, Default)]
struct Count {
    crossings: [f64; 4],
    found: [f64; 4],
    made_up: [f64; 4],
}

impl Count {
    fn add(&mut self, decay: &Decay, found: &[Peak<f64>]) {
        let mut seen = vec![false; decay.crossings.len()];
        for peak in found.iter().filter(|peak| scored(peak.index as f64)) {
            let time = peak.index as f64;
            match decay.crossings.iter().position(|crossing| (crossing.time - time).abs() < NEAR) {
                Some(place) => seen[place] = true,
                None => self.made_up[segment(time)] += 1.0,
            }
        }
        for (crossing, seen) in decay.crossings.iter().zip(seen) {
            self.crossings[segment(crossing.time)] += 1.0;
            self.found[segment(crossing.time)] += f64::from(seen);
        }
    }

    fn found_share(&self, segment: usize) -> f64 {
        self.found[segment] / self.crossings[segment]
    }
}

/// False alarms of so many records without motion.
fn alarms(chance: &mut Chance, records: usize, threshold: Threshold<f64>) -> usize {
    let record = |chance: &mut Chance| -> usize {
        let signal: Vec<f64> = (0..LENGTH).map(|_| NOISE * chance.gaussian()).collect();
        peaks(&responses(&signal), REACH, threshold).count()
    };
    (0..records).map(|_| record(chance)).sum()
}

fn rare(hold: Option<HoldLevel>) -> Threshold<f64> {
    Threshold::for_false_alarms(&kernel(), NOISE, RARE, REACH, hold).unwrap()
}

const FOLLOW: HoldLevel = HoldLevel { deviations: 2.0, samples: 600 };

#[test]
#[ignore = "slow"]
fn slow_detections_against_false_alarms() {
    const RECORDS: u32 = 120;
    let ms = f64::from(RECORDS) * LENGTH as f64 * INTERVAL * 1e3;
    let deviation = kernel().noise_deviation(NOISE);
    let levels: Vec<f64> = (6..=22).map(|k| 0.25 * f64::from(k)).collect();
    let mut thresholds: Vec<(String, Threshold<f64>)> = levels
        .iter()
        .map(|level| (format!("{level:.2} sigma"), Threshold::fixed(level * deviation)))
        .collect();
    for (name, hold) in [("rare, one level", None), ("rare, following", Some(FOLLOW))] {
        let threshold = rare(hold);
        let [acquire, keep] = [threshold.acquire(), threshold.keep()].map(|level| level / deviation);
        thresholds.push((format!("{name} {acquire:.2}/{keep:.2}"), threshold));
    }
    let mut counts = vec![Count::default(); thresholds.len()];
    let mut still = vec![0_usize; thresholds.len()];
    let mut chance = Chance::new(2);
    for record in 0..RECORDS {
        let decay = Decay::from(f64::from(record) / f64::from(RECORDS));
        let slopes = responses(&decay.noisy(&mut chance));
        let noise: Vec<f64> = (0..LENGTH).map(|_| NOISE * chance.gaussian()).collect();
        let noise = responses(&noise);
        for ((count, still), (_, threshold)) in counts.iter_mut().zip(&mut still).zip(&thresholds) {
            count.add(&decay, &peaks(&slopes, REACH, *threshold).collect::<Vec<_>>());
            *still += peaks(&noise, REACH, *threshold).count();
        }
    }
    println!(
        "{:<28} found in each segment              false per ms in each segment        without motion",
        ""
    );
    for ((name, _), (count, still)) in thresholds.iter().zip(counts.iter().zip(&still)) {
        let found: Vec<String> = (0..4).map(|i| format!("{:.4}", count.found_share(i))).collect();
        let made_up: Vec<String> = count.made_up.iter().map(|n| format!("{:.5}", 4.0 * n / ms)).collect();
        println!("{name:<28} {}    {}    {:.5}", found.join(" "), made_up.join(" "), *still as f64 / ms);
    }
    // What was measured elsewhere without motion: 0.74 per ms at 2 σ and 0.0025 at 4 σ.
    let at = |level: f64| still[levels.iter().position(|l| *l == level).unwrap()] as f64 / ms;
    assert!((at(2.0) / 0.74 - 1.0).abs() < 0.05, "{}", at(2.0));
    assert!((at(4.0) * ms - 0.0025 * ms).abs() < 4.0 * (0.0025 * ms).sqrt(), "{}", at(4.0));
    let [one, following] = [levels.len(), levels.len() + 1];
    for place in [one, following] {
        for i in 0..3 {
            assert!(counts[place].found_share(i) >= 0.99, "{place} {i}");
        }
    }
    // Following finds more where the signal is weak.
    assert!(counts[following].found_share(3) > counts[one].found_share(3));
}

#[test]
#[ignore = "slow"]
fn slow_false_alarms_are_as_many_as_were_asked_for() {
    const RECORDS: usize = 1000;
    let samples = (RECORDS * (LENGTH - 120)) as f64;
    for (seed, hold) in [(3, None), (4, Some(FOLLOW))] {
        let count = alarms(&mut Chance::new(seed), RECORDS, rare(hold)) as f64;
        let mean = RARE * samples;
        println!(
            "{count} false alarms, {mean:.0} asked for, {:.5} per ms",
            count / samples / INTERVAL * 1e-3
        );
        // Four standard deviations of the count; false alarms that bring others make it wider.
        assert!((count - mean).abs() < 4.0 * (1.7 * mean).sqrt(), "{count} {mean}");
    }
}

/// Errors of times and angles in each segment, over many records.
#[derive(Default)]
struct Errors {
    /// Of the parabola through the maximum, in samples.
    slope: [Vec<f64>; 4],
    /// Its variance as predicted, Canny's, and the square of the maximum's bias by its formula, in samples².
    predicted: [Vec<[f64; 3]>; 4],
    /// Of the zero crossing: the angle, in rad; times σ of the time as told.
    zero: [Vec<f64>; 4],
    told: [Vec<f64>; 4],
}

/// The time of the steepest slope after the crossing, in samples: −3·(θ_th/ω + 2ζ/ω_n)/(N_θ²A²/2 + 4), with the
/// amplitude of a swing that passes θ_th at ω.
fn bias(crossing: Crossing) -> f64 {
    let (mirror, comb) = (mirror(), comb());
    let square = comb.centre.powi(2) + (crossing.rate / mirror.natural_rate).powi(2);
    let late = comb.centre / crossing.rate + 2.0 * mirror.damping_ratio / mirror.natural_rate;
    -3.0 * late / (comb.steepness.powi(2) * square / 2.0 + 4.0) / INTERVAL
}

/// The variance as the kernel predicts it and Canny's, in samples², for the edge without noise.
fn variances(clean: &[f64], crossing: Crossing) -> [f64; 2] {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the record
    let k = (crossing.time + bias(crossing)).round() as usize;
    let curvature = clean[k - 1] - 2.0 * clean[k] + clean[k + 1];
    // ∫g′² of the derivative of a Gaussian of 15 samples.
    let jitter = 3.0 / (8.0 * std::f64::consts::PI.sqrt() * 15_f64.powi(5));
    [kernel().timing_variance(NOISE * NOISE, curvature), jitter * (NOISE / curvature).powi(2)]
}

fn errors(records: u32) -> Errors {
    let fit = CubicFit::<f64, 90>::new(30.0).unwrap();
    let mut errors = Errors::default();
    let mut chance = Chance::new(6);
    for record in 0..records {
        let decay = Decay::from(f64::from(record) / f64::from(records));
        let clean = responses(&decay.clean);
        let signal = decay.noisy(&mut chance);
        let found: Vec<Peak<f64>> = peaks(&responses(&signal), REACH, rare(Some(FOLLOW))).collect();
        let places: Vec<usize> = found.iter().map(|peak| usize::try_from(peak.index).unwrap()).collect();
        let between = &signal[places[0]..=places[places.len() - 1]];
        let offset = between.iter().sum::<f64>() / between.len() as f64;
        for (peak, place) in found.iter().zip(places) {
            let time = peak.index as f64 + peak.fraction;
            let Some(crossing) = decay.nearest(time) else { continue };
            let i = segment(crossing.time);
            errors.slope[i].push(time - crossing.time);
            let [predicted, canny] = variances(&clean, crossing);
            errors.predicted[i].push([predicted, canny, bias(crossing).powi(2)]);
            if let Some(zero) = fit.crossing(&signal, place, offset, NOISE * NOISE) {
                let time = place as f64 + zero.displacement;
                errors.zero[i].push(decay.angle(time) - comb().centre);
                errors.told[i].push(zero.timing_variance * (crossing.rate * INTERVAL).powi(2));
            }
        }
    }
    errors
}

fn root_mean(squares: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = squares.len() as f64;
    (squares.sum::<f64>() / n).sqrt()
}

/// Bars for the standard deviation of the angle at zero crossings, in rad, and for its mean.
const ANGLES: [f64; 4] = [0.5e-3, 0.5e-3, 0.8e-3, 1.3e-3];
const ANGLE_BIAS: f64 = 0.35e-3;

#[test]
fn a_few_records_have_all_crossings_at_the_right_angle() {
    let errors = errors(6);
    for (i, bar) in ANGLES.into_iter().enumerate() {
        let (mean, deviation) = spread(&errors.zero[i]);
        println!("segment {i}: {} crossings, {mean:.2e} +- {deviation:.2e} rad", errors.zero[i].len());
        assert!(errors.zero[i].len() >= if i < 3 { 146 } else { 130 });
        assert!(mean.abs() < ANGLE_BIAS && deviation < bar);
    }
}

#[test]
#[ignore = "slow"]
fn slow_times_and_angles_are_as_well_known_as_predicted() {
    let errors = errors(200);
    for (i, bar) in ANGLES.into_iter().enumerate() {
        let seen = root_mean(errors.slope[i].iter().map(|e| e * e));
        let predicted = root_mean(errors.predicted[i].iter().map(|[variance, _, bias]| variance + bias));
        let canny = root_mean(errors.predicted[i].iter().map(|[_, canny, bias]| canny + bias));
        let (mean, deviation) = spread(&errors.zero[i]);
        let told = root_mean(errors.told[i].iter().copied());
        println!(
            "segment {i}: {} times off by {:.3} us rms, predicted {:.3} (by Canny {:.3}); {} zero crossings: bias \
             {:.3} mrad, sd {:.3}, told {:.3}",
            errors.slope[i].len(),
            seen * INTERVAL * 1e6,
            predicted * INTERVAL * 1e6,
            canny * INTERVAL * 1e6,
            errors.zero[i].len(),
            mean * 1e3,
            deviation * 1e3,
            told * 1e3,
        );
        assert!((seen / predicted - 1.0).abs() < 0.15, "{i}: {seen} {predicted}");
        // Canny's alone is that of small displacements.
        assert_eq!((seen / canny - 1.0).abs() < 0.15, i < 2, "{i}: {seen} {canny}");
        assert!(mean.abs() < ANGLE_BIAS, "{i}: {mean:e}");
        assert!(deviation < bar, "{i}: {deviation:e}");
        assert!((deviation / told - 1.0).abs() < 0.1, "{i}: {deviation:e} {told:e}");
    }
}
