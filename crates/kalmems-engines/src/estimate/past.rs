//! What is kept of a segment from one part of it to the next.

use super::answers::AnswerRun;
use super::bank::BankFilters;
use super::driven::{DrivePast, InterpolationLag};
use super::gate::{Decisions, SampleGate};
use super::lock::LockJudge;
use super::lock_in::OpenWindow;
use super::{
    BatchStart, FilterBasics, MeanAndCovariance, NoiseEstimate, PhasePredictor, SampleSelection, StatedSign,
    Trajectory,
};
use crate::signal::{Sine, extremes_of_rate};
use serde::{Deserialize, Serialize};

/// What is kept of a segment for every device. What one device alone keeps stands in its own estimator, beside this.
#[derive(Default)]
pub struct Past {
    /// When the segment began, in s.
    pub start_s: f64,
    /// What is kept of its drive.
    pub drive: DrivePast,
    /// What is kept of its other inputs, of a device that has several.
    further_drives: Vec<DrivePast>,
    /// The rate of the motion in rad/s that phases are told by, from the first rows on; where that is asked for.
    pub motion_rate: Option<f64>,
    /// What the rig keeps in numbers; they are written, so that another run has them too.
    pub numbers: Vec<f64>,
    filters: Vec<FilterPast>,
    lag: InterpolationLag,
}

impl Past {
    /// Of a segment that begins at this time in s.
    pub fn from(start_s: f64) -> Self {
        Self { start_s, ..Self::default() }
    }

    /// Begins a segment at this time in s.
    pub fn begin(&mut self, start_s: f64) {
        let lag = self.lag;
        *self = Self::from(start_s);
        self.wait_for(lag);
    }

    /// Goes on from where another run was.
    pub(crate) fn resume(&mut self, state: &PastState) {
        let lag = self.lag;
        *self = Self::resumed(state);
        self.wait_for(lag);
    }

    /// Waits for so many samples behind an interval before the inputs in it are said.
    pub(crate) fn wait_for(&mut self, lag: InterpolationLag) {
        self.lag = lag;
        for input in std::iter::once(&mut self.drive).chain(&mut self.further_drives) {
            input.lag = lag;
        }
    }

    /// For how many samples behind an interval it waits.
    pub const fn lag(&self) -> InterpolationLag {
        self.lag
    }

    /// What is kept of one of several inputs, of which the first is the drive.
    pub fn input(&mut self, index: usize) -> &mut DrivePast {
        let Some(further) = index.checked_sub(1) else { return &mut self.drive };
        while self.further_drives.len() <= further {
            self.further_drives.push(DrivePast::waiting_for(self.lag));
        }
        &mut self.further_drives[further]
    }

    /// What predicts zero phases, where they are asked for, and whether the motion of its filter is mirrored.
    pub fn phase_predictor(&mut self) -> Option<(&mut PhasePredictor, bool)> {
        self.filters.iter_mut().find_map(|filter| {
            let mirrored = filter.is_mirrored() == Some(true);
            filter.predictor.as_mut().map(|predictor| (predictor, mirrored))
        })
    }

    /// What is kept of a filter, by its place in the list.
    pub fn filter(&mut self, index: usize) -> &mut FilterPast {
        while self.filters.len() <= index {
            self.filters.push(FilterPast::default());
        }
        &mut self.filters[index]
    }
}

/// What is written of a past, for another run to go on from it: numbers alone.
///
/// Where a filter keeps roots, they are made anew from its covariance. What a smoother and a judgement of the lock had begun
/// begins again.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PastState {
    start_s: NumberBits,
    /// Of the drive's sine: offset, amplitude, frequency, phase and residual.
    drive: Option<[NumberBits; 5]>,
    /// The same of other inputs.
    #[serde(default)]
    further_drives: Vec<Option<[NumberBits; 5]>>,
    #[serde(default)]
    numbers: Vec<NumberBits>,
    /// The rate of the motion that phases are told by.
    #[serde(default)]
    motion_rate: Option<NumberBits>,
    filters: Vec<FilterState>,
    /// Of the filters beside these that are told what else the device may be.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) varied: Vec<Self>,
    /// What innovations have told of the uncertain device, for each answer by its key.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) learnt: Vec<(String, Vec<NumberBits>)>,
}

/// What is written of one filter.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct FilterState {
    mean: Vec<NumberBits>,
    covariance: Vec<NumberBits>,
    #[serde(default)]
    numbers: Vec<NumberBits>,
    /// How it took its samples.
    #[serde(default)]
    watched: Vec<NumberBits>,
    /// What it knew of the loss of its signal.
    #[serde(default)]
    loss: Vec<NumberBits>,
    /// How many steps it took from one sample to the next.
    #[serde(default)]
    steps: Option<usize>,
    /// Whether each axis of each answer is mirrored.
    mirrored: Vec<Vec<Option<bool>>>,
    /// The times of the zero phases that were told last, in s.
    #[serde(default)]
    told: [Option<NumberBits>; 2],
}

/// A number by its bits, so that no digit is lost in text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct NumberBits(u64);

impl From<f64> for NumberBits {
    fn from(number: f64) -> Self {
        Self(number.to_bits())
    }
}

impl From<NumberBits> for f64 {
    fn from(bits: NumberBits) -> Self {
        Self::from_bits(bits.0)
    }
}

impl Past {
    /// What another run needs to go on from here.
    pub fn state(&self) -> PastState {
        let bits = |values: &[f64]| values.iter().copied().map(NumberBits::from).collect();
        let filters = self.filters.iter().map(|filter| {
            let known = filter.left.as_ref();
            let (mean, covariance) = known.map_or((&[][..], &[][..]), |known| (&known.mean, &known.lower));
            let mirrored = filter.answers.iter().map(|answer| answer.mirrored.clone()).collect();
            let told = filter.last_predicted_s().map(|told_s| told_s.map(NumberBits::from));
            FilterState {
                mean: bits(mean),
                covariance: bits(covariance),
                numbers: bits(&filter.numbers),
                watched: bits(&filter.watched),
                loss: bits(&filter.loss),
                steps: filter.steps,
                mirrored,
                told,
            }
        });
        PastState {
            start_s: self.start_s.into(),
            drive: written(&self.drive),
            further_drives: self.further_drives.iter().map(written).collect(),
            numbers: bits(&self.numbers),
            motion_rate: self.motion_rate.map(NumberBits::from),
            filters: filters.collect(),
            varied: Vec::new(),
            learnt: Vec::new(),
        }
    }

    /// A past that goes on from a state.
    pub fn resumed(state: &PastState) -> Self {
        let numbers = |bits: &[NumberBits]| bits.iter().copied().map(f64::from).collect::<Vec<f64>>();
        let filters = state.filters.iter().map(|filter| FilterPast {
            left: (!filter.mean.is_empty()).then(|| MeanAndCovariance {
                mean: numbers(&filter.mean),
                lower: numbers(&filter.covariance),
            }),
            numbers: numbers(&filter.numbers),
            watched: numbers(&filter.watched),
            loss: numbers(&filter.loss),
            steps: filter.steps,
            answers: (filter.mirrored.iter())
                .map(|mirrored| AnswerPast { mirrored: mirrored.clone(), ..AnswerPast::default() })
                .collect(),
            told_s: filter.told.map(|told| told.map(f64::from)),
            ..FilterPast::default()
        });
        Self {
            start_s: state.start_s.into(),
            drive: read(state.drive.as_ref()),
            further_drives: state.further_drives.iter().map(|sine| read(sine.as_ref())).collect(),
            numbers: numbers(&state.numbers),
            motion_rate: state.motion_rate.map(f64::from),
            filters: filters.collect(),
            lag: InterpolationLag::default(),
        }
    }
}

/// What is written of an input: the sine that it followed, if it did.
fn written(drive: &DrivePast) -> Option<[NumberBits; 5]> {
    let sine = drive.known()?;
    Some(
        [sine.offset, sine.amplitude, sine.frequency_hz, sine.phase_rad, sine.residual_rms]
            .map(NumberBits::from),
    )
}

fn read(written: Option<&[NumberBits; 5]>) -> DrivePast {
    DrivePast::resumed(written.map(|numbers| {
        let [offset, amplitude, frequency_hz, phase_rad, residual_rms] = numbers.map(f64::from);
        Sine { offset, amplitude, frequency_hz, phase_rad, residual_rms }
    }))
}

/// What is kept of one filter.
#[derive(Default)]
pub struct FilterPast {
    /// The filter on its way.
    pub(super) run: Option<Box<dyn AnswerRun>>,
    /// The filters of its models on their way, of a bank.
    pub(super) bank: Option<BankFilters>,
    /// The window that has not ended, of a lock-in.
    pub(super) open_window: OpenWindow,
    /// What the rig keeps of it in numbers; they are written, so that another run has them too.
    pub numbers: Vec<f64>,
    /// The start that was found in the segment's first samples, and the time in s of the row behind them: a smoother that goes over them again
    /// uses them once, as the filter did.
    start: Option<(f64, BatchStart)>,
    /// The variance of a sample, where the filter estimates it.
    pub noise: Option<NoiseEstimate>,
    /// What predicts zero phases, where they are asked for.
    pub predictor: Option<PhasePredictor>,
    /// The times of the zero phases that another run told last.
    told_s: [Option<f64>; 2],
    /// How many steps it takes from one sample to the next, once that is planned, and whether its run knows.
    pub(super) steps: Option<usize>,
    pub(super) is_planned: bool,
    /// What the filter knew where it was left.
    left: Option<MeanAndCovariance>,
    /// How it took its samples there, as numbers.
    watched: Vec<f64>,
    /// What it knew of the loss of its signal there, as numbers.
    loss: Vec<f64>,
    /// What another run of the filter rejected, where this one is to follow it.
    pub(super) decided: Option<Decisions>,
    /// That of the part that was taken last.
    decided_last: Vec<(f64, usize)>,
    /// One per answer.
    answers: Vec<AnswerPast>,
}

/// What is kept of one answer of a filter.
#[derive(Default)]
pub struct AnswerPast {
    /// What judges its lock.
    pub judge: LockJudge,
    /// Whether the motion of each axis is mirrored, once that is known.
    mirrored: Vec<Option<bool>>,
}

impl FilterPast {
    /// Keeps the start that was found from rows of these times in s.
    pub fn began_by(&mut self, start: &BatchStart, time_s: &[f64]) {
        self.start = time_s.get(start.row).map(|time_s| (*time_s, start.clone()));
    }

    /// That start among rows of these times in s.
    pub fn start_among(&self, time_s: &[f64]) -> Option<BatchStart> {
        let (start_s, start) = self.start.as_ref()?;
        Some(BatchStart { row: time_s.partition_point(|time_s| time_s < start_s), ..start.clone() })
    }

    /// What the filter knew where it was left; `None` at the beginning of a segment.
    pub fn left(&self) -> Option<&MeanAndCovariance> {
        self.left.as_ref()
    }

    /// How this filter takes its samples, from these on, of which it has the times in s.
    pub(super) fn watch(
        &self,
        filter: &FilterBasics,
        (time_s, samples): (&[f64], &SampleSelection),
    ) -> SampleGate {
        let start_s = time_s.get(samples.fresh.start).copied().unwrap_or(f64::NAN);
        let mut watch = SampleGate::new(filter.taking, start_s, samples.interval_s);
        watch.resume(&self.watched);
        watch
    }

    /// What the filter knew of the loss of its signal where it was left, as numbers.
    pub(super) fn loss(&self) -> &[f64] {
        &self.loss
    }

    /// Follows what another run of the filter rejected of the samples that come: of each the time in s and the signal.
    pub(crate) fn follow_rejections(&mut self, rejected: impl Iterator<Item = (f64, usize)>) {
        let now: Vec<(f64, usize)> = rejected.collect();
        // A smoother goes over the part before once more.
        self.decided = Some(self.decided_last.iter().chain(&now).copied().collect());
        self.decided_last = now;
    }

    /// Leaves a filter here, to go on later.
    pub(super) fn leave(&mut self, run: Box<dyn AnswerRun>) {
        self.left = Some(run.known());
        self.watched = run.watch_numbers();
        self.loss = run.loss_numbers();
        self.steps = Some(run.steps());
        self.run = Some(run);
    }

    /// The times in s of the zero phases that were told last, rising and falling as the filter has them.
    pub fn last_predicted_s(&self) -> [Option<f64>; 2] {
        self.predictor.as_ref().map_or(self.told_s, PhasePredictor::last_predicted_s)
    }

    /// Whether the motion of the first axis is mirrored, once that is known.
    pub fn is_mirrored(&self) -> Option<bool> {
        self.answers.first()?.mirrored.first().copied().flatten()
    }

    /// What is kept of an answer, from 0 in the order of the trajectories.
    pub fn answer(&mut self, index: usize) -> &mut AnswerPast {
        while self.answers.len() <= index {
            self.answers.push(AnswerPast::default());
        }
        &mut self.answers[index]
    }
}

impl AnswerPast {
    /// Gives a motion the stated sign of its first turning point behind a time in s, that of a peak of the drive.
    ///
    /// x → −x of some states is an exact symmetry of plant and sensor, and the filters keep it: had the filter started mirrored, its
    /// answer would be the mirrored one to the last bit. So the answer is mirrored, and says so. What came before the turning point was
    /// seen is mirrored with it as far as it is part of the same piece.
    pub fn orient(&mut self, trajectory: &mut Trajectory, sign: &StatedSign, peak_s: f64) {
        if self.mirrored.len() <= sign.axis {
            self.mirrored.resize(sign.axis + 1, None);
        }
        let mirrored = &mut self.mirrored[sign.axis];
        if mirrored.is_none()
            && let Some(rate) = trajectory.states.get(sign.rate)
        {
            let from = trajectory.time_s.partition_point(|t| *t < peak_s);
            let extremes = extremes_of_rate(&trajectory.time_s[from..], &rate.mean[from..]);
            *mirrored = extremes.first().map(|extreme| extreme.maximum != sign.is_positive);
        }
        if *mirrored == Some(true) {
            trajectory.mirror(&sign.states);
        }
    }
}
