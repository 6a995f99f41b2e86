//! All filters on the same recordings: how far off they are, and what a step costs.

use super::chance::{Chance, Spread, digits};
use super::drawing::with_bars;
use super::scanner::{
    DENSITY, INTERVAL, Motion, NOISE_VARIANCE, READOUT, SCANNER, START_SD, Score, Truth, signal,
};
use kalmems::figures::{Axis, Figure, Panel};
use kalmems_core::smooth::{Backward, FixedLag, SmoothingCourse, SmoothingError, smooth_interval};
use kalmems_core::update::{Always, Decimation, OnNeed, Policy};
use kalmems_core::{
    AddedState, Augmented, AugmentedMeasurement, Covariance, Drift, Ekf, Filter, FilterError, IteratedEkf,
    Measurement, Nodes, NoiseDensity, Parameters, Process, Rk4, Scaled, Scales, SigmaPoints, SquareRootEkf,
    SquareRootUkf, StateTransition, Ukf,
};
use kalmems_models::dynamics::ParametricScanner;
use std::cell::RefCell;
use std::error::Error;
use std::fmt::Write as _;
use std::num::NonZeroU32;
use std::time::Instant;

/// Recordings of each situation.
pub const SEEDS: u64 = 16;
const SAMPLES: usize = 30_000;
/// Not scored: the settling time.
const SETTLING: usize = 15_000;
const LAG: usize = 64;

/// How the true device differs from the model, and how far the model is trusted.
struct Situation {
    name: &'static str,
    stiffness: f64,
    /// The density of a filter that has no state for what is wrong, in rad²/s³.
    density: f64,
}

const SITUATIONS: [Situation; 2] = [
    Situation { name: "A: the model is exact", stiffness: 1.0, density: DENSITY },
    Situation { name: "B: the stiffness is 0.3 % wrong", stiffness: 0.997, density: 1e9 },
];

/// What a filter is given.
struct Recording {
    motion: Motion,
    signal: Vec<f64>,
    /// The same in single precision.
    drive32: Vec<Nodes<f32>>,
    signal32: Vec<f32>,
    density: f64,
}

#[allow(clippy::cast_possible_truncation)] // to f32, on purpose
fn narrow(value: f64) -> f32 {
    value as f32
}

impl Recording {
    fn new(situation: &Situation, seed: u64, samples: usize) -> Self {
        let mut chance = Chance::new(seed);
        let truth = Truth { stiffness: situation.stiffness, density: DENSITY, samples };
        let motion = truth.motion(&mut chance);
        let signal = signal(&motion, NOISE_VARIANCE.sqrt(), &mut chance);
        let nodes =
            |n: &Nodes<f64>| Nodes { start: narrow(n.start), middle: narrow(n.middle), end: narrow(n.end) };
        let drive32 = motion.drive.iter().map(nodes).collect();
        let signal32 = signal.iter().map(|y| narrow(*y)).collect();
        Self { motion, signal, drive32, signal32, density: situation.density }
    }

    fn process(&self) -> Rk4<ParametricScanner<f64>, f64, 2> {
        let noise = NoiseDensity::none().on::<1>(self.density);
        Rk4::new(SCANNER, INTERVAL, &noise, (&[0.0, 0.0], &0.0))
    }
}

type Outcome = Result<f64, Box<dyn Error>>;
/// Follows a recording and writes the angle at each sample; the share of samples that corrected it.
type Run = Box<dyn Fn(&Recording, &mut [f64]) -> Outcome>;

/// Which legend entry a filter belongs to.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Group {
    Model,
    Every,
    Need,
    Form,
    State,
    Lag,
    Interval,
}

const GROUPS: [(Group, &str); 7] = [
    (Group::Model, "model alone"),
    (Group::Every, "EKF with every 1st, 2nd, 5th, 10th, 20th sample"),
    (Group::Need, "EKF updated on need"),
    (Group::Form, "other forms (see the table)"),
    (Group::State, "stiffness as a state"),
    (Group::Lag, "smoother, 64 samples late"),
    (Group::Interval, "smoother of the whole recording"),
];

struct Candidate {
    name: String,
    group: Group,
    run: Run,
}

#[inline(never)]
fn follow<const N: usize>(
    filter: &mut impl Filter<f64, N>,
    (process, readout): (&impl Process<f64, N, Input = Nodes<f64>>, &impl Measurement<f64, N, 1>),
    recording: &Recording,
    angle: &mut [f64],
    policy: &impl Policy<f64, N>,
) -> Outcome {
    let r = Covariance::from_variances([NOISE_VARIANCE]);
    let mut taken = 0_u32;
    for ((drive, y), angle) in recording.motion.drive.iter().zip(&recording.signal).zip(angle.iter_mut()) {
        filter.predict(process, drive)?;
        taken += u32::from(filter.update_where(readout, &[*y], &r, policy)?.taken);
        *angle = filter.mean()[0];
    }
    Ok(f64::from(taken) / angle.len() as f64)
}

fn start(recording: &Recording) -> ([f64; 2], Covariance<f64, 2>) {
    (recording.motion.start, Covariance::from_standard_deviations(START_SD))
}

fn candidate(
    name: impl Into<String>,
    group: Group,
    run: impl Fn(&Recording, &mut [f64]) -> Outcome + 'static,
) -> Candidate {
    Candidate { name: name.into(), group, run: Box::new(run) }
}

/// A filter of two states, all samples used.
fn plain<F: Filter<f64, 2>>(
    name: &str,
    group: Group,
    filter: impl Fn([f64; 2], Covariance<f64, 2>) -> F + 'static,
) -> Candidate {
    candidate(name, group, move |recording, angle| {
        let (mean, covariance) = start(recording);
        let models = (&recording.process(), &READOUT);
        follow(&mut filter(mean, covariance), models, recording, angle, &Always)
    })
}

fn every(count: u32, name: &str) -> Option<Candidate> {
    let count = NonZeroU32::new(count)?;
    Some(candidate(format!("EKF, every {name} sample"), Group::Every, move |recording, angle| {
        let (mean, covariance) = start(recording);
        let (process, mut filter, mut turn) =
            (recording.process(), Ekf::new(mean, covariance), Decimation::every(count));
        let r = Covariance::from_variances([NOISE_VARIANCE]);
        for ((drive, y), angle) in recording.motion.drive.iter().zip(&recording.signal).zip(angle) {
            filter.predict(&process, drive)?;
            if turn.due() {
                filter.update(&READOUT, &[*y], &r)?;
            }
            *angle = filter.mean()[0];
        }
        Ok(1.0 / f64::from(count.get()))
    }))
}

fn on_need(fraction: f64) -> Candidate {
    candidate(format!("EKF on need, {fraction} σ"), Group::Need, move |recording, angle| {
        let (mean, covariance) = start(recording);
        let models = (&recording.process(), &READOUT);
        follow(&mut Ekf::new(mean, covariance), models, recording, angle, &OnNeed { fraction })
    })
}

#[allow(clippy::unnecessary_wraps)] // one signature for all
fn model_alone(recording: &Recording, angle: &mut [f64]) -> Outcome {
    let process = recording.process();
    let mut x = recording.motion.start;
    for (drive, angle) in recording.motion.drive.iter().zip(angle) {
        x = process.step(&x, drive);
        *angle = x[0];
    }
    Ok(0.0)
}

fn with_stiffness(recording: &Recording, angle: &mut [f64]) -> Outcome {
    // 1 is 0.3 %.
    let added = [AddedState {
        scale: 0.003 * SCANNER.resonator.stiffness,
        drift: Drift::RandomWalk { density: 0.0 },
    }];
    let noise = NoiseDensity::none().on::<1>(DENSITY);
    let plain = Rk4::new(SCANNER, INTERVAL, &noise, (&[0.0, 0.0], &0.0));
    let process = Augmented::<_, _, 2, 1, 3>::new(plain, &added, [Some("resonator.stiffness")])?;
    let readout = AugmentedMeasurement::<_, _, 2, 1>::new(READOUT, &added, [None])?;
    let [x, v] = recording.motion.start;
    let sd = Covariance::from_standard_deviations([START_SD[0], START_SD[1], 1.0]);
    follow(&mut Ekf::new([x, v, 0.0], sd), (&process, &readout), recording, angle, &Always)
}

fn in_single_precision(recording: &Recording, angle: &mut [f64]) -> Outcome {
    let model = SCANNER.map(|_, value| narrow(value));
    let scales = Scales::natural(&model)?;
    let noise = scales.scale_density(&NoiseDensity::none().on::<1>(narrow(recording.density)));
    let scaled = Scaled::new(model, scales);
    let process = Rk4::new(scaled, narrow(INTERVAL), &noise, (&[0.0, 0.0], &0.0));
    let readout = Scaled::new(READOUT.map(|_, value| narrow(value)), scales);
    let covariance = Covariance::from_standard_deviations(START_SD.map(narrow));
    let mean = scales.scale_state(&recording.motion.start.map(narrow));
    let mut filter = Ekf::new(mean, scales.scale_covariance(&covariance));
    let r = Covariance::from_variances([narrow(NOISE_VARIANCE)]);
    let unit = scales.sizes()[0];
    for ((drive, y), angle) in recording.drive32.iter().zip(&recording.signal32).zip(angle) {
        filter.predict(&process, drive)?;
        filter.update(&readout, &[*y], &r)?;
        *angle = f64::from(filter.mean()[0] * unit);
    }
    Ok(1.0)
}

fn late(recording: &Recording, angle: &mut [f64]) -> Outcome {
    let (mean, covariance) = start(recording);
    let process = recording.process();
    let mut filter = FixedLag::<f64, _, 2, LAG>::new(Ekf::new(mean, covariance));
    let r = Covariance::from_variances([NOISE_VARIANCE]);
    for (k, (drive, y)) in recording.motion.drive.iter().zip(&recording.signal).enumerate() {
        filter.predict(&process, drive)?;
        filter.update(&READOUT, &[*y], &r)?;
        if let (Some(k), Some(smoothed)) = (k.checked_sub(LAG), filter.smoothed()) {
            angle[k] = smoothed.mean[0];
        }
    }
    for lag in 0..LAG.min(angle.len()) {
        if let Some(smoothed) = filter.lagged(lag) {
            let k = angle.len() - 1 - lag;
            angle[k] = smoothed.mean[0];
        }
    }
    Ok(1.0)
}

/// A recording in memory, for the smoother of all of it.
struct Whole<'a> {
    recording: &'a Recording,
    process: Rk4<ParametricScanner<f64>, f64, 2>,
}

impl<F: Filter<f64, 2>> SmoothingCourse<f64, F, 2> for Whole<'_> {
    type Error = FilterError;
    fn samples(&self) -> usize {
        self.recording.signal.len()
    }
    fn advance(&mut self, filter: &mut F, sample: usize) -> Result<StateTransition<f64, 2>, FilterError> {
        filter.predict_linked(&self.process, &self.recording.motion.drive[sample])
    }
    fn correct(&mut self, filter: &mut F, sample: usize) -> Result<(), FilterError> {
        let r = Covariance::from_variances([NOISE_VARIANCE]);
        filter.update(&READOUT, &[self.recording.signal[sample]], &r).map(|_| ())
    }
}

fn whole() -> Candidate {
    let storage = RefCell::new(Vec::new());
    candidate("smoother of the whole recording", Group::Interval, move |recording, angle| {
        let (mean, covariance) = start(recording);
        let mut course = Whole { recording, process: recording.process() };
        let mut filter = Ekf::new(mean, covariance);
        if let Some(drive) = recording.motion.drive.first() {
            filter.predict(&course.process, drive)?;
        }
        let mut block = storage.borrow_mut();
        block.resize(recording.signal.len(), Backward::identity());
        smooth_interval(&filter, &mut course, &mut [filter], &mut block, |k, smoothed| {
            angle[k] = smoothed.mean[0];
            Ok(())
        })
        .map_err(|error: SmoothingError<FilterError>| error.to_string())?;
        Ok(1.0)
    })
}

/// Everyone who runs; the EKF is the first.
fn candidates() -> Vec<Candidate> {
    let standard = SigmaPoints::standard;
    let mut all = vec![plain("EKF", Group::Every, Ekf::new)];
    let fewer = [(2, "2nd"), (5, "5th"), (10, "10th"), (20, "20th")];
    all.extend(fewer.into_iter().filter_map(|(count, name)| every(count, name)));
    all.extend([0.02, 0.05, 0.1, 0.2, 0.5].map(on_need));
    all.extend([
        plain("iterated EKF, at most 3 steps", Group::Form, |x, p| IteratedEkf::<_, 2, 3>::new(x, p, 1e-3)),
        plain("UKF", Group::Form, move |x, p| Ukf::new(x, p, standard())),
        plain("square-root EKF", Group::Form, SquareRootEkf::new),
        plain("square-root UKF", Group::Form, move |x, p| SquareRootUkf::new(x, p, standard())),
        candidate("EKF in f32, states scaled", Group::Form, in_single_precision),
        candidate("EKF with the stiffness as a state", Group::State, with_stiffness),
        candidate("smoother, 64 samples late", Group::Lag, late),
        whole(),
        candidate("model alone", Group::Model, model_alone),
    ]);
    all
}

/// What a filter came to.
struct Figures {
    /// By situation, as all of them.
    cost: Vec<f64>,
    angle: Vec<Spread>,
    phase: Vec<Spread>,
    used: Vec<Spread>,
}

/// The time of each candidate's step over that of the EKF, which is the first: the median over rounds in which
/// each ran once.
fn costs(candidates: &[Candidate], situation: &Situation) -> Result<Vec<f64>, Box<dyn Error>> {
    const ROUNDS: usize = 151;
    let recording = Recording::new(situation, 1, 4000);
    let mut angle = vec![0.0; recording.signal.len()];
    let mut ratios = vec![Vec::new(); candidates.len()];
    for _ in 0..ROUNDS {
        let mut first = None;
        for (candidate, ratios) in candidates.iter().zip(&mut ratios) {
            let begun = Instant::now();
            (candidate.run)(&recording, &mut angle)?;
            let taken = begun.elapsed().as_secs_f64();
            ratios.push(taken / *first.get_or_insert(taken));
        }
    }
    Ok(ratios.into_iter().map(|ratios| Spread::of(ratios).median).collect())
}

/// What the UKF came to where the model is exact.
pub struct Unscented {
    /// The time of its step over that of the EKF.
    pub cost: f64,
    /// The median errors of the EKF and of itself, in 10⁻³ degrees.
    pub errors: [f64; 2],
}

/// The figures of cost and of fewer corrections, the table, and what it says of the UKF.
pub fn run() -> Result<([Figure; 2], String, Unscented), Box<dyn Error>> {
    let candidates = candidates();
    let nothing = || Figures { cost: Vec::new(), angle: Vec::new(), phase: Vec::new(), used: Vec::new() };
    let mut results: Vec<Figures> = candidates.iter().map(|_| nothing()).collect();
    for situation in &SITUATIONS {
        eprintln!("{}: {} filters, {SEEDS} seeds", situation.name, candidates.len());
        for (result, cost) in results.iter_mut().zip(costs(&candidates, situation)?) {
            result.cost.push(cost);
        }
        let mut scores = vec![(Vec::new(), Vec::new(), Vec::new()); candidates.len()];
        let mut angle = vec![0.0; SAMPLES];
        for seed in 1..=SEEDS {
            let recording = Recording::new(situation, seed, SAMPLES);
            for (candidate, (angles, phases, used)) in candidates.iter().zip(&mut scores) {
                used.push((candidate.run)(&recording, &mut angle)?);
                let score = Score::of(&angle, &recording.motion, SETTLING);
                angles.push(score.angle_mdeg);
                phases.push(score.phase_deg);
            }
        }
        for (result, (angles, phases, used)) in results.iter_mut().zip(scores) {
            result.angle.push(Spread::of(angles));
            result.phase.push(Spread::of(phases));
            result.used.push(Spread::of(used));
        }
    }
    let table = table(&candidates, &results);
    let of = |name: &str| {
        let place = candidates.iter().position(|candidate| candidate.name == name);
        let result = place.and_then(|place| results.get(place)).ok_or("no such filter")?;
        Ok::<_, Box<dyn Error>>((result.cost[0], result.angle[0].median))
    };
    let ((_, ekf), (cost, ukf)) = (of("EKF")?, of("UKF")?);
    let figures = [cost_figure(&candidates, &results), corrections_figure(&candidates, &results)];
    Ok((figures, table, Unscented { cost, errors: [ekf, ukf] }))
}

fn table(candidates: &[Candidate], results: &[Figures]) -> String {
    let mut table = String::from(
        "| | A: cost | angle, mdeg | phase, ° | B: cost | angle, mdeg | phase, ° |\n\
         |---|---:|---:|---:|---:|---:|---:|\n",
    );
    for (candidate, result) in candidates.iter().zip(results) {
        let _ = write!(table, "| {} |", candidate.name);
        for ((cost, angle), phase) in result.cost.iter().zip(&result.angle).zip(&result.phase) {
            let _ = write!(table, " {cost:.2} | {} | {} |", angle.text(), digits(phase.median));
        }
        table.push('\n');
    }
    table
}

fn cost_figure(candidates: &[Candidate], results: &[Figures]) -> Figure {
    let caption = "Median over the seeds; the bars span all of them.";
    let mut figure = Figure::new("filters_cost", "Accuracy against cost", caption);
    for (index, situation) in SITUATIONS.iter().enumerate() {
        let mut panel = Panel::new(
            Axis::new("time of a step over that of the EKF", ""),
            Axis::new(format!("{} RMS angle error", &situation.name[..2]), "deg").log(),
        );
        for (group, label) in GROUPS {
            let members: Vec<(f64, Spread)> = candidates
                .iter()
                .zip(results)
                .filter(|(candidate, _)| candidate.group == group)
                .map(|(_, result)| (result.cost[index], result.angle[index].times(1e-3)))
                .collect();
            panel = with_bars(panel, label, &members, matches!(group, Group::Every | Group::Need));
        }
        figure = figure.with(if index == 0 { panel } else { panel.sharing_x() });
    }
    figure
}

fn corrections_figure(candidates: &[Candidate], results: &[Figures]) -> Figure {
    let caption = "Median over the seeds; the bars span all of them. The prediction runs at every sample.";
    let mut figure = Figure::new("filters_corrections", "Fewer corrections", caption);
    for (index, situation) in SITUATIONS.iter().enumerate() {
        let mut panel = Panel::new(
            Axis::new("share of the samples that correct the EKF", "").log(),
            Axis::new(format!("{} RMS angle error", &situation.name[..2]), "deg").log(),
        );
        for (group, label) in [(Group::Every, "every 1st, 2nd, 5th, 10th, 20th"), (Group::Need, "on need")] {
            let members: Vec<(f64, Spread)> = candidates
                .iter()
                .zip(results)
                .filter(|(candidate, _)| candidate.group == group)
                .map(|(_, result)| (result.used[index].median, result.angle[index].times(1e-3)))
                .collect();
            panel = with_bars(panel, label, &members, true);
        }
        figure = figure.with(if index == 0 { panel } else { panel.sharing_x() });
    }
    figure
}
