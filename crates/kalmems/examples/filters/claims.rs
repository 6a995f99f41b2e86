//! The pros and cons of Table 6.1 of Chen's dissertation (2018), in numbers: by simulation, on two devices.

use super::chance::{Chance, Spread, digits};
use super::scanner::{
    COMB, DENSITY, INTERVAL, Motion, NOISE_VARIANCE, POLE, READOUT, SCANNER, START_SD, Score, Truth,
};
use super::{contest, curvature};
use kalmems_core::discretize::discretize;
use kalmems_core::{
    AddedState, Augmented, Covariance, Drift, Dynamics, Ekf, Filter, LinearMeasurement, LinearProcess, Mat,
    Measurement, Nodes, NoiseDensity, Over, Process, Rk4,
};
use kalmems_models::dynamics::ParametricScanner;
use std::error::Error;
use std::f64::consts::TAU;
use std::fmt::Write as _;

pub const SEEDS: u64 = 16;
type Outcome<T> = Result<T, Box<dyn Error>>;

/// The scanner of chapter 4 in free decay, read by a DC circuit: y = N_g·(1/(1 + exp(−N_θ·(θ − θ_th))) − ½)·ω, in
/// V, times 1 + 0.03·s where the state has a third component s.
struct ThresholdComb {
    /// N_g in V·s/rad.
    gain: f64,
}

/// N_θ in 1/rad, θ_th in rad.
const STEEPNESS: f64 = 76.0;
const THRESHOLD: f64 = 3.71e-3;
const GAIN: f64 = 2.82e-3;
/// Of one sample of the signal, in V; and of a crossing's time, in s.
const SIGNAL_SD: f64 = 0.0435;
const TIMING_SD: f64 = 0.9e-6;
const SAMPLE: f64 = 2e-6;
const DECAY_SAMPLES: usize = 10_000;
const PUSHES: f64 = 1e3;

impl<const N: usize> Measurement<f64, N, 1> for ThresholdComb {
    fn predict<S: Over<f64>>(&self, x: &[S; N]) -> [S; 1] {
        let away = (x[0] - S::of(THRESHOLD)) * S::of(-STEEPNESS);
        let logistic = (S::of(1.0) + away.exp()).recip() - S::of(0.5);
        let gain = match x.get(2) {
            Some(deviation) => S::of(1.0) + *deviation * S::of(0.03),
            None => S::of(1.0),
        };
        [logistic * x[1] * gain * S::of(self.gain)]
    }
}

/// 624.6 Hz with a damping ratio of 0.0066; the third state, if any, stays.
fn decay<const N: usize>() -> Mat<f64, N, N> {
    let w = TAU * 624.6;
    Mat(std::array::from_fn(|i| {
        std::array::from_fn(|j| match (i, j) {
            (0, 1) => 1.0,
            (1, 0) => -w * w,
            (1, 1) => -2.0 * 0.0066 * w,
            _ => 0.0,
        })
    }))
}

struct Decay {
    /// θ and ω at the samples.
    state: Vec<[f64; 2]>,
    signal: Vec<f64>,
    /// For each interval, how long before its end a crossing was detected, if one was.
    crossing: Vec<Option<f64>>,
    start: [f64; 2],
}

/// Free decay from 0.15 rad, with the gain off by a factor.
fn free_decay(seed: u64, gain: f64) -> Decay {
    let mut chance = Chance::new(seed);
    let process = LinearProcess::<f64, 2, 0>::exact(&decay(), &Mat::zero(), &NoiseDensity::none(), SAMPLE);
    let comb = ThresholdComb { gain: GAIN * gain };
    let mut x = [0.15, 0.0];
    let start = [x[0] + 0.01 * chance.gaussian(), 40.0 * chance.gaussian()];
    let mut decay = Decay { state: Vec::new(), signal: Vec::new(), crossing: Vec::new(), start };
    for _ in 0..DECAY_SAMPLES {
        let before = x[0] - THRESHOLD;
        x = process.step(&x, &[]);
        x[1] += (PUSHES * SAMPLE).sqrt() * chance.gaussian();
        let after = x[0] - THRESHOLD;
        let ago = SAMPLE * after / (after - before) + TIMING_SD * chance.gaussian();
        decay.crossing.push((before * after < 0.0).then_some(ago));
        decay.signal.push(comb.predict(&x)[0] + SIGNAL_SD * chance.gaussian());
        decay.state.push(x);
    }
    decay
}

/// Which measurements a filter uses.
#[derive(Clone, Copy)]
struct Uses {
    signal: bool,
    crossings: bool,
}

/// The RMS angle error of the second half in 10⁻³ degrees.
fn follow_decay<const N: usize>(decay_of: &Decay, uses: Uses) -> Outcome<f64> {
    let density = NoiseDensity::none().on::<1>(PUSHES);
    let process = LinearProcess::<f64, N, 0>::exact(&decay(), &Mat::zero(), &density, SAMPLE);
    let mut mean = [0.0; N];
    mean[..2].copy_from_slice(&decay_of.start);
    let sd = std::array::from_fn(|i| [0.01, 40.0, 1.0][i.min(2)]);
    let mut filter = Ekf::new(mean, Covariance::from_standard_deviations(sd));
    let comb = ThresholdComb { gain: GAIN };
    let r = Covariance::from_variances([SIGNAL_SD * SIGNAL_SD]);
    let mut squares = 0.0;
    let half = DECAY_SAMPLES / 2;
    for k in 0..DECAY_SAMPLES {
        filter.predict(&process, &[])?;
        if let (true, Some(ago)) = (uses.crossings, decay_of.crossing[k]) {
            // What the angle was at the crossing, seen from now.
            let back = discretize(&decay::<N>(), &NoiseDensity::none(), -ago).transition;
            let timing = (filter.mean()[1] * TIMING_SD).powi(2);
            let then = LinearMeasurement { matrix: Mat([back.0[0]]) };
            filter.update(&then, &[THRESHOLD], &Covariance::from_variances([timing]))?;
        }
        if uses.signal {
            filter.update(&comb, &[decay_of.signal[k]], &r)?;
        }
        if k >= half {
            squares += (filter.mean()[0] - decay_of.state[k][0]).powi(2);
        }
    }
    Ok((squares / half as f64).sqrt().to_degrees() * 1e3)
}

/// The gain wrong by 0 to 3 %: the errors of five ways, and the table of them.
fn gain_drift() -> Outcome<([[Spread; 5]; 4], String)> {
    eprintln!("gain drift, {SEEDS} seeds");
    let (signal, both, crossings) = (
        Uses { signal: true, crossings: false },
        Uses { signal: true, crossings: true },
        Uses { signal: false, crossings: true },
    );
    let mut table = String::from(
        "| true gain | signal | signal and crossings | crossings alone | signal, gain as a state | both, gain as a \
         state |\n|---:|---:|---:|---:|---:|---:|\n",
    );
    let mut all = Vec::new();
    for percent in [0.0, 1.0, 2.0, 3.0] {
        let mut errors: [Vec<f64>; 5] = Default::default();
        for seed in 1..=SEEDS {
            let decay = free_decay(seed, 1.0 + percent / 100.0);
            errors[0].push(follow_decay::<2>(&decay, signal)?);
            errors[1].push(follow_decay::<2>(&decay, both)?);
            errors[2].push(follow_decay::<2>(&decay, crossings)?);
            errors[3].push(follow_decay::<3>(&decay, signal)?);
            errors[4].push(follow_decay::<3>(&decay, both)?);
        }
        let spreads = errors.map(Spread::of);
        let _ = write!(table, "| +{percent} % |");
        for spread in &spreads {
            let _ = write!(table, " {} |", spread.text());
        }
        table.push('\n');
        all.push(spreads);
    }
    let all = <[[Spread; 5]; 4]>::try_from(all).map_err(|_| "four gains")?;
    Ok((all, table))
}

/// A comb of its own for sensing under a constant voltage, read by its current through a resistance:
/// y = −R·V_b·C′(θ)·ω − R·C_ft·dV/dt, in V. The third state, if any, is C_ft over [`FEEDTHROUGH`].
#[derive(Clone, Copy)]
struct DcCircuit {
    /// What the known feedthrough capacitance adds, in V; and the share that a third state adds for each 1.
    known: f64,
    unit: f64,
}

const RESISTANCE: f64 = 100e3;
const BIAS: f64 = 10.0;
/// 50 fF.
const FEEDTHROUGH: f64 = 50e-15;

impl<const N: usize> Measurement<f64, N, 1> for DcCircuit {
    fn predict<S: Over<f64>>(&self, x: &[S; N]) -> [S; 1] {
        let motion = COMB.slope(x[0]) * x[1] * S::of(-RESISTANCE * BIAS) + S::of(self.known);
        [match x.get(2) {
            Some(share) => motion + *share * S::of(self.unit),
            None => motion,
        }]
    }
}

/// The scanner with the demodulator's two poles as states: θ, θ̇, and C/C₀ behind one pole and behind both.
#[derive(Clone, Copy)]
struct WithPoles;

impl Dynamics<f64, 4> for WithPoles {
    type Input = f64;
    fn derivative<S: Over<f64>>(&self, x: &[S; 4], voltage: &f64) -> [S; 4] {
        let seen = COMB.capacitance(x[0]) * S::of(1.0 / COMB.nominal);
        let pole = S::of(POLE);
        [x[1], SCANNER.acceleration(x[0], x[1], *voltage), (seen - x[2]) * pole, (x[2] - x[3]) * pole]
    }
}

/// a·C₀·x₃ + b.
struct BehindPoles;

impl Measurement<f64, 4, 1> for BehindPoles {
    fn predict<S: Over<f64>>(&self, x: &[S; 4]) -> [S; 1] {
        [x[3] * S::of(READOUT.gain * COMB.nominal) + S::of(READOUT.offset)]
    }
    fn depends(_: usize, state: usize) -> bool {
        state == 3
    }
}

const SAMPLES: usize = 20_000;
const SETTLING: usize = 10_000;

fn scanner_process() -> Rk4<ParametricScanner<f64>, f64, 2> {
    Rk4::new(SCANNER, INTERVAL, &NoiseDensity::none().on::<1>(DENSITY), (&[0.0, 0.0], &0.0))
}

/// Follows a signal; the measurement is made anew for each sample.
fn follow<const N: usize, H: Measurement<f64, N, 1>>(
    process: &impl Process<f64, N, Input = Nodes<f64>>,
    (mean, sd): ([f64; N], [f64; N]),
    (motion, signal): (&Motion, &[f64]),
    readout: impl Fn(usize) -> H,
) -> Outcome<Score> {
    let r = Covariance::from_variances([NOISE_VARIANCE]);
    let mut filter = Ekf::new(mean, Covariance::from_standard_deviations(sd));
    let mut angle = Vec::new();
    for (k, (drive, y)) in motion.drive.iter().zip(signal).enumerate() {
        filter.predict(process, drive)?;
        filter.update(&readout(k), &[*y], &r)?;
        angle.push(filter.mean()[0]);
    }
    Ok(Score::of(&angle, motion, SETTLING))
}

/// The scores of a way of filtering over all seeds.
#[derive(Clone, Copy)]
struct Scores {
    angle: Spread,
    phase: Spread,
}

impl Scores {
    fn of(scores: &[Score]) -> Self {
        Self {
            angle: Spread::of(scores.iter().map(|s| s.angle_mdeg).collect()),
            phase: Spread::of(scores.iter().map(|s| s.phase_deg).collect()),
        }
    }
    fn text(&self) -> String {
        format!("{} mdeg, {}°", digits(self.angle.median), digits(self.phase.median))
    }
}

/// Motions and their noise, one for each seed.
struct Motions(Vec<(Motion, Vec<f64>)>);

impl Motions {
    fn new() -> Self {
        let one = |seed| {
            let mut chance = Chance::new(seed);
            let motion = Truth { stiffness: 1.0, density: DENSITY, samples: SAMPLES }.motion(&mut chance);
            let noise = (0..SAMPLES).map(|_| NOISE_VARIANCE.sqrt() * chance.gaussian()).collect();
            (motion, noise)
        };
        Self((1..=SEEDS).map(one).collect())
    }

    /// Each motion with a signal, given what the circuit makes of a sample.
    fn score(
        &self,
        circuit: impl Fn(&Motion, usize) -> f64,
        run: impl Fn(&Motion, &[f64]) -> Outcome<Score>,
    ) -> Outcome<Scores> {
        let mut scores = Vec::new();
        for (motion, noise) in &self.0 {
            let signal: Vec<f64> = noise.iter().enumerate().map(|(k, v)| circuit(motion, k) + v).collect();
            scores.push(run(motion, &signal)?);
        }
        Ok(Scores::of(&scores))
    }
}

/// The circuits: the rows of the table about them.
struct Circuits {
    dc_clean: Scores,
    dc_unmodelled: Scores,
    dc_known: Scores,
    dc_state: Scores,
    /// Of the drive's line at the output over the motion's, both as amplitudes.
    dc_share: f64,
    carrier_clean: Scores,
    carrier_lag_ignored: Scores,
    carrier_lag_modelled: Scores,
    carrier_line: Scores,
    /// The drive's line behind a first-order and behind a fourth-order high-pass, in V.
    lines: [f64; 2],
}

/// The amplitude in V at which the drive's line leaves a carrier circuit with a synchronous demodulator: through
/// C_ft as through the comb, less by its lower frequency and voltage, then a high-pass at 482 kHz, shifted by the
/// carrier to 500 ± 31 kHz, and two low-pass poles at 31 kHz.
fn carrier_line(order: i32) -> f64 {
    const CARRIER: f64 = 500e3;
    const DRIVE: f64 = 31_350.0;
    let high_pass = |hz: f64| (hz / hz.hypot(482e3)).powi(order);
    let capacitance = FEEDTHROUGH * (90.0 * DRIVE) / (6.0 * CARRIER) * high_pass(DRIVE) / high_pass(CARRIER);
    let low_pass = |hz: f64| 1.0 / (1.0 + (TAU * hz / POLE).powi(2));
    READOUT.gain.abs() * capacitance * low_pass(CARRIER - DRIVE)
}

fn circuits() -> Outcome<Circuits> {
    eprintln!("circuits, {SEEDS} seeds");
    let motions = Motions::new();
    let two = |motion: &Motion| (motion.start, START_SD);
    let known =
        |motion: &Motion, k: usize, capacitance: f64| -RESISTANCE * capacitance * motion.drive_slope[k];
    let dc = |known: f64| DcCircuit { known, unit: 0.0 };
    let bare = |motion: &Motion, k: usize| dc(0.0).predict(&motion.state[k])[0];
    let fed = |motion: &Motion, k: usize| bare(motion, k) + known(motion, k, FEEDTHROUGH);

    let ignoring = |motion: &Motion, signal: &[f64]| {
        follow(&scanner_process(), two(motion), (motion, signal), |_| dc(0.0))
    };
    let exact = |motion: &Motion, signal: &[f64]| {
        let readout = |k| dc(known(motion, k, FEEDTHROUGH));
        follow(&scanner_process(), two(motion), (motion, signal), readout)
    };
    let as_state = |motion: &Motion, signal: &[f64]| {
        let added = [AddedState { scale: 1.0, drift: Drift::RandomWalk { density: 0.0 } }];
        let process = Augmented::<_, _, 2, 1, 3>::new(scanner_process(), &added, [None])?;
        let [angle, rate] = motion.start;
        let start = ([angle, rate, 0.0], [START_SD[0], START_SD[1], 1.0]);
        let readout = |k| DcCircuit { known: 0.0, unit: known(motion, k, FEEDTHROUGH) };
        follow(&process, start, (motion, signal), readout)
    };
    let amplitude =
        |f: &dyn Fn(usize) -> f64| (SETTLING..SAMPLES).map(f).fold(0.0, |a: f64, b| a.max(b.abs()));
    let dc_share = motions.0.first().map_or(f64::NAN, |(motion, _)| {
        amplitude(&|k| known(motion, k, FEEDTHROUGH)) / amplitude(&|k| bare(motion, k))
    });

    let clean = |motion: &Motion, k: usize| READOUT.predict(&motion.state[k])[0];
    let lagging = |motion: &Motion, k: usize| READOUT.gain * motion.filtered_capacitance[k] + READOUT.offset;
    let lines = [carrier_line(1), carrier_line(4)];
    let with_line = |motion: &Motion, k: usize| {
        // The lower of the two lines, as the sampler sees it.
        clean(motion, k) + lines[0] * (TAU * (500e3 - 31_350.0) * k as f64 * INTERVAL).cos()
    };
    let static_readout = |motion: &Motion, signal: &[f64]| {
        follow(&scanner_process(), two(motion), (motion, signal), |_| READOUT)
    };
    let with_poles = |motion: &Motion, signal: &[f64]| {
        let noise = NoiseDensity::none().on::<1>(DENSITY);
        let process = Rk4::new(WithPoles, INTERVAL, &noise, (&[0.0; 4], &0.0));
        let [angle, rate] = motion.start;
        let seen = COMB.capacitance(angle) / COMB.nominal;
        let start = ([angle, rate, seen, seen], [START_SD[0], START_SD[1], 0.1, 0.1]);
        follow(&process, start, (motion, signal), |_| BehindPoles)
    };
    Ok(Circuits {
        dc_clean: motions.score(bare, ignoring)?,
        dc_unmodelled: motions.score(fed, ignoring)?,
        dc_known: motions.score(fed, exact)?,
        dc_state: motions.score(fed, as_state)?,
        dc_share,
        carrier_clean: motions.score(clean, static_readout)?,
        carrier_lag_ignored: motions.score(lagging, static_readout)?,
        carrier_lag_modelled: motions.score(lagging, with_poles)?,
        carrier_line: motions.score(with_line, static_readout)?,
        lines,
    })
}

/// The table of claims, and that of the gain's drift. What there is to say of the UKF comes from other parts.
pub fn run(ukf: &contest::Unscented, tuning: &curvature::Tuning) -> Outcome<(String, String)> {
    let (drift, drift_table) = gain_drift()?;
    let c = circuits()?;
    let mut table =
        String::from("| the dissertation | what we find (simulated) | in numbers |\n|---|---|---|\n");
    let mut row = |claim: &str, finding: &str, figures: String| {
        let _ = writeln!(table, "| {claim} | {finding} | {figures} |");
    };
    let (exact, off) = (&drift[0], &drift[3]);
    row(
        "analogue sensing: prone to temperature",
        "Yes, if the gain is trusted. As a state it is found from the signal itself; that costs something if it was right",
        format!(
            "gain +3 %: {} mdeg, right: {}; with the gain as a state {} and {}",
            digits(off[0].median),
            digits(exact[0].median),
            digits(off[3].median),
            digits(exact[3].median)
        ),
    );
    row(
        "threshold sensing: accurate, robust to temperature",
        "Crossings do not know the gain. Alone they say less than the signal. Together with a signal that the filter trusts they do not help: there are hundreds of samples to a crossing",
        format!(
            "crossings alone {} mdeg at any gain; signal and crossings {} at +3 %, {} where the gain is right",
            digits(off[2].median),
            digits(off[1].median),
            digits(exact[1].median)
        ),
    );
    row(
        "DC circuit: does not separate feedthrough",
        "Yes: the line of the drive has the frequency of the signal. A constant capacitance is cheap to model",
        format!(
            "50 fF are {} % of the signal: ignored {}; known {}; as a state {}; none {}",
            digits(c.dc_share * 100.0),
            c.dc_unmodelled.text(),
            c.dc_known.text(),
            c.dc_state.text(),
            c.dc_clean.text()
        ),
    );
    row(
        "carrier circuit (AMDM): separates feedthrough",
        "Yes, with a synchronous demodulator and electrodes of its own",
        format!(
            "the same 50 fF leave {} µV (first-order high-pass) or {} µV (fourth): {} instead of {}",
            digits(c.lines[0] * 1e6),
            digits(c.lines[1] * 1e6),
            c.carrier_line.text(),
            c.carrier_clean.text()
        ),
    );
    row(
        "carrier circuit: more delays and dynamics; DC circuit: fewer",
        "The delay ruins the estimate only if the model leaves it out",
        format!(
            "two poles at 31 kHz: ignored {}; as states {}",
            c.carrier_lag_ignored.text(),
            c.carrier_lag_modelled.text()
        ),
    );
    row(
        "EKF: low accuracy; UKF: higher",
        "Not if samples follow each other closely. In a single correction of an angle that is hardly known, yes",
        format!(
            "RMS angle at 1 MHz {} and {} mdeg; after one correction from ± 3° {} and {}, iterated EKF {}",
            digits(ukf.errors[0]),
            digits(ukf.errors[1]),
            digits(tuning.ekf),
            digits(tuning.ukf),
            digits(tuning.iterated)
        ),
    );
    row(
        "UKF: higher computational complexity",
        "Yes",
        format!("{:.1} times the time of the EKF with two states", ukf.cost),
    );
    row(
        "UKF: sigma points need a lot of tuning",
        "Not along a recording. In a correction from ± 3° they matter less than the choice of the filter",
        format!(
            "six choices of α and κ: {}–{} mdeg along a recording at 16.7 kHz, {}–{} after one correction",
            digits(tuning.along.least),
            digits(tuning.along.most),
            digits(tuning.once.least),
            digits(tuning.once.most)
        ),
    );
    Ok((table, drift_table))
}
