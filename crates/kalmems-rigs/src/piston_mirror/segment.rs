//! The estimates of one segment.

use super::course::PhasorCourse;
use super::data::PistonSegment;
use super::observability::{ReadoutFault, amplitude_per_rest};
use super::phase_lock::PhaseLock;
use super::phasor::{Drifting, FixedRestPhasor, Phasor, STATES};
use super::plates::distance_at;
use super::settings::{MotionKnowledge, PistonFilterSettings, PistonSettings};
use super::start::{PistonBatchStart, batch_fit, batch_start_of, rows_of_window, wrapped};
use crate::config::Method;
use crate::estimate::driven::{OfMotion, ParametricReadout, combinations, shifted};
use crate::estimate::{
    self, AnyFilter, Course, EstimateError, FilterPast, GainOf, LockInWindows, MeanAndCovariance,
    MeasurementSensor, Past, SampleSelection, StartAgain, StartedCourse, StateName, Swing, Tracked,
    Trajectory, answers, answers_of_bank, follow, inversion, lock_in, start_again_from,
};
use crate::progress::Progress;
use crate::signal::{Sine, fit_sine_at};
use crate::units::kind;
use kalmems_core::Portable;
use kalmems_core::{Covariance, Gaussian, Mat};
use kalmems_models::readout::PhasorDetector;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

/// Runs the filters of the settings over the new samples of a segment, judges the lock of each trajectory, and gives the
/// frequency of the motion.
///
/// The past is [`Past::default`] at the beginning of a segment, and is kept from one part of it to the next.
pub fn estimate(
    settings: &PistonSettings,
    part: &PartData,
    past: &mut Past,
    progress: &dyn Progress,
) -> Result<(Vec<Trajectory>, estimate::MotionRate), EstimateError> {
    let begun_s = past.start_s;
    let motion_hz = *past.motion_rate.get_or_insert_with(|| TAU * first_hz(settings, part)) / TAU;
    let mut all = Vec::new();
    for (index, filter) in settings.filters.iter().enumerate() {
        let task = PistonFilterTask { settings, filter, part, begun_s, motion_hz, progress };
        let mut trajectories = task.run(past.filter(index))?;
        let phases = trajectories.iter_mut().flat_map(|trajectory| &mut trajectory.states);
        for phase in phases.filter(|state| state.name == "phase") {
            phase.mean.iter_mut().for_each(|phase| *phase = wrapped(*phase));
        }
        all.push(trajectories);
    }
    // What is known of it when the head is over serves the whole segment.
    let frequency_hz = if let [frequency_hz] = past.numbers[..] {
        frequency_hz
    } else {
        let mut of_filters = all.iter().flatten();
        let found = of_filters.find_map(|trajectory| found_frequency(trajectory, part.head.len()));
        // Where no filter says it, the signal does.
        let of_signal = || {
            let filter = &settings.filters[0];
            let task = PistonFilterTask { settings, filter, part, begun_s, motion_hz, progress };
            task.batch().map(|batch| batch.mean[1])
        };
        found.map_or_else(of_signal, Ok)?
    };
    past.numbers = vec![frequency_hz];
    let motion = estimate::MotionRate { frequency_hz, is_driven: false };
    let start_s = past.start_s + settings.skip_s;
    for (index, trajectories) in all.iter_mut().enumerate() {
        for (answer, trajectory) in trajectories.iter_mut().enumerate() {
            let judge = &mut past.filter(index).answer(answer).judge;
            let ends = part.samples.ends;
            trajectory.lock = judge.judge(trajectory, &[("position", motion)], start_s, ends);
        }
    }
    Ok((all.into_iter().flatten().collect(), motion))
}

/// The frequency of the motion in Hz at a segment's beginning, by its trigger, by its first samples, or by what the file says of the first filter
/// that has a start; not a number where nothing tells it.
fn first_hz(settings: &PistonSettings, part: &PartData) -> f64 {
    let stated = settings.filters.iter().find_map(|filter| match filter.motion {
        MotionKnowledge::Steady { start: Some((mean, ..)), .. } => Some(mean[1]),
        MotionKnowledge::Drifting { start: Some((mean, _)), .. } => Some(mean[1]),
        _ => None,
    });
    let has_harmonics = settings.filters.iter().any(PistonFilterSettings::has_harmonics);
    let by_signal =
        || Some(batch_start_of(&settings.hardware.plates, &part.head(), has_harmonics).ok()?.mean[1]);
    part.data.motion_hz.or_else(by_signal).or(stated).unwrap_or(f64::NAN)
}

/// A part of a segment of capacitances as the filters see it, or the whole of it.
#[derive(Clone, Debug)]
pub struct PartData<'a> {
    /// Those that are there.
    pub data: PistonSegment<'a>,
    /// Which of them are new.
    pub samples: SampleSelection,
    /// Those of the segment's beginning that a start from the signal looks at; none in a later part.
    pub head: Range<usize>,
    /// What messages call the segment.
    pub place: &'a str,
}

impl<'a> PartData<'a> {
    /// The samples of the segment's beginning.
    fn head(&self) -> PistonSegment<'a> {
        let head = self.head.clone();
        PistonSegment {
            time_s: &self.data.time_s[head.clone()],
            signal: &self.data.signal[head],
            ..self.data
        }
    }
}

/// The frequency in Hz that a filter gives after so many samples, or after all that there are; where it can be one.
fn found_frequency(trajectory: &Trajectory, samples: usize) -> Option<f64> {
    let frequencies = &trajectory.state("frequency")?.mean;
    let last = frequencies.get(samples.min(frequencies.len()).checked_sub(1)?).copied();
    last.filter(|frequency| frequency.is_finite() && *frequency > 0.0)
}

/// One filter over one part of a segment.
struct PistonFilterTask<'a> {
    settings: &'a PistonSettings,
    filter: &'a PistonFilterSettings,
    part: &'a PartData<'a>,
    /// When the segment began, in s.
    begun_s: f64,
    /// The frequency of the motion in Hz by which its loss is judged.
    motion_hz: f64,
    progress: &'a dyn Progress,
}

/// How much wider than the fit of the first samples a filter starts that sees these samples again: they count a second
/// time for a hundredth.
const WIDER: f64 = 10.0;

/// What a start from the signal allows the amplitude's rate to be, relative to the amplitude, in 1/s: 30 % per minute,
/// the largest drift that was considered (Faller and Zangl, 2017, section IV), as one standard deviation.
const RATE_SD: f64 = 0.3 / 60.0;

/// What direct inversion and the lock-in give: the first alone, or both.
const POSITION: [StateName; 2] = [("position", "m", &kind::LENGTH), ("velocity", "m_per_s", &kind::VELOCITY)];

/// Mean and standard deviations that a file gives.
type StatedStart = ([f64; 5], [f64; 5]);

/// Mean and covariance.
type PistonState<const N: usize> = ([f64; N], Covariance<f64, N>);

impl PistonFilterTask<'_> {
    /// Chooses the model.
    fn run(&self, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let plates = self.settings.hardware.plates;
        match self.filter.motion {
            MotionKnowledge::None if self.filter.basics.method == Method::LockIn => {
                Ok(vec![self.lock_in(past)?])
            }
            MotionKnowledge::None => Ok(vec![self.inversion()]),
            MotionKnowledge::Steady { density, start } => {
                let names = &STATES[..3];
                if let Some((mean, sd, rest)) = start {
                    let covariance = Covariance::from_standard_deviations(sd);
                    let steady = FixedRestPhasor::new(plates, rest, density);
                    return self.follow::<_, 3>(&steady, names, past, || Ok((mean, covariance).into()));
                }
                let (start, held) = self.held(past)?;
                let steady = FixedRestPhasor::new(plates, held.rest, density);
                let mut trajectories = self.follow::<_, 3>(&steady, names, past, || Ok(start.into()))?;
                for trajectory in &mut trajectories {
                    held.add_to(trajectory);
                }
                Ok(trajectories)
            }
            MotionKnowledge::Drifting { density, start } => {
                let drifting = Drifting::new(plates, density);
                let basics = &self.filter.basics;
                if let Some(gain) = basics.gain() {
                    return self.lock(&drifting, gain, past, start.map(|(mean, _)| mean));
                }
                match basics.method {
                    Method::Bank => self.bank(&drifting, past, start),
                    _ if !basics.tracked.is_empty() => self.with_parameters(&drifting, past, start),
                    _ => {
                        let known = || Ok(self.started(start)?.into());
                        self.follow::<_, 5>(&drifting, &STATES, past, known)
                    }
                }
            }
        }
    }

    /// What a filter of five states knows at the first sample.
    fn started(&self, given: Option<StatedStart>) -> Result<PistonState<5>, EstimateError> {
        if let Some((mean, sd)) = given {
            return Ok((mean, Covariance::from_standard_deviations(sd)));
        }
        let batch = self.batch()?;
        Ok((batch.mean, with_rate(&widened(&batch.covariance), RATE_SD * batch.mean[0])))
    }

    /// What one of each parameter adds to the amplitude and the rest position that a start from the signal says. A start of
    /// values is where the mirror is, whatever the readout has.
    fn misled(&self, given: Option<StatedStart>, mean: &[f64; 5]) -> Vec<[f64; 2]> {
        let (plates, motion) = (&self.settings.hardware.plates, [mean[0], mean[3]]);
        let of = |tracked: &Tracked| match (given, tracked.parameter.unit) {
            (None, "1") => ReadoutFault::gain(plates, motion).takes_up(),
            (None, "F") => ReadoutFault::offset(plates, motion).takes_up(),
            // A start of values, and one of a motion with harmonics.
            _ => [0.0; 2],
        };
        self.filter.basics.tracked.iter().map(of).collect()
    }

    /// With parameters of the readout as states, estimated or considered.
    fn with_parameters(
        &self,
        drifting: &Drifting,
        past: &mut FilterPast,
        given: Option<StatedStart>,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let basics = &self.filter.basics;
        let readout =
            ParametricReadout::new(drifting.amplified(), &basics.tracked, |parameter| parameter.in_readout);
        let readout = readout.map_err(|why| basics.no_model(why))?;
        let known = |given: Option<StatedStart>, &(mean, covariance): &PistonState<5>| {
            let misled = self.misled(given, &mean);
            let parameters = basics.tracked.iter().map(|tracked| (0.0, tracked.sd));
            let mut known = MeanAndCovariance::from((mean, covariance)).with(parameters);
            for (parameter, ([amplitude, rest], tracked)) in misled.iter().zip(&basics.tracked).enumerate() {
                // x is what the signal says less what the parameter adds to that.
                let column = [(0, -amplitude), (3, -rest)];
                known.correlate(5 + parameter, &column, tracked.sd);
            }
            known
        };
        let start = || Ok(known(given, &self.started(given)?));
        let course = || {
            PhasorCourse::new(drifting, &self.part.data, Box::new(readout.clone()))
                .with_parameters(&basics.tracked)
        };
        let again = self.start_again(course, |found| known(None, found));
        let mut course = StartedCourse::new(course(), None).starting_again(again);
        let way = (&mut course as _, &self.part.samples);
        answers((basics, past), start, way, &basics.states(&STATES), self.progress)
    }

    /// Filters side by side, each with another readout.
    fn bank(
        &self,
        drifting: &Drifting,
        past: &mut FilterPast,
        given: Option<StatedStart>,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let basics = &self.filter.basics;
        let models = combinations(&basics.tracked);
        let course = |shifts: &Vec<f64>| -> Box<dyn Course + '_> {
            let by = (&basics.tracked[..], &shifts[..]);
            let readout = shifted(&drifting.amplified(), by, |parameter| parameter.in_readout);
            Box::new(PhasorCourse::new(drifting, &self.part.data, Box::new(OfMotion::<_, 5>(readout))))
        };
        let start = |model: usize| {
            let (mut mean, covariance) = self.started(given)?;
            let misled = self.misled(given, &mean);
            for ([amplitude, rest], shift) in misled.iter().zip(&models[model]) {
                mean[0] -= amplitude * shift;
                mean[3] -= rest * shift;
            }
            Ok((mean, covariance).into())
        };
        let way = (models.iter().map(course).collect(), &self.part.samples);
        answers_of_bank((basics, past), start, way, &STATES, self.progress)
    }

    /// Cycle by cycle of the motion: a sine through the distances that the capacitances mean.
    fn lock_in(&self, past: &mut FilterPast) -> Result<Trajectory, EstimateError> {
        let PartData { data, samples, .. } = self.part;
        let (motion_hz, start_s) = if let [motion_hz, start_s] = past.numbers[..] {
            (motion_hz, start_s)
        } else {
            let by_signal = || self.batch().map(|batch| batch.mean[1]);
            let start_s = data.time_s.get(samples.fresh.start).copied().unwrap_or(0.0);
            (data.motion_hz.map_or_else(by_signal, Ok)?, start_s)
        };
        past.numbers = vec![motion_hz, start_s];
        let plates = &self.settings.hardware.plates;
        let distance = |capacitance: &f64| distance_at(plates, *capacitance).unwrap_or(f64::NAN);
        let distances: Vec<f64> = data.signal.iter().map(distance).collect();
        let (time_s, length_s) = (data.time_s, 1.0 / motion_hz);
        let windows = LockInWindows { time_s, signals: &[&distances], samples, start_s, length_s };
        let detect = |time_s: &[f64], distances: &[&[f64]], _: &[Swing]| {
            let Sine { offset, amplitude, phase_rad, .. } =
                fit_sine_at(time_s, distances.first()?, motion_hz)?;
            Some(vec![Swing { rest: offset, amplitude, rate: TAU * motion_hz, phase: phase_rad + FRAC_PI_2 }])
        };
        Ok(lock_in((&self.filter.basics, past), &windows, &POSITION, detect))
    }

    /// Where a filter of three states goes on, or at the beginning starts, and the rest position that it holds.
    fn held(&self, past: &mut FilterPast) -> Result<(PistonState<3>, HeldRestPosition), EstimateError> {
        if let (Some(left), [rest, rest_sd, taken_up]) = (past.left(), &past.numbers[..]) {
            let Gaussian { mean, covariance } = left.gaussian();
            return Ok((
                (mean, covariance),
                HeldRestPosition { rest: *rest, rest_sd: *rest_sd, taken_up: *taken_up },
            ));
        }
        let batch = self.batch()?;
        let [a, f, phase, ..] = batch.mean;
        let (rest, rest_sd) = self.rest(&batch);
        let taken_up = amplitude_per_rest(&self.settings.hardware.plates, [a, rest]);
        past.numbers = vec![rest, rest_sd, taken_up];
        Ok((([a, f, phase], widened(&batch.covariance)), HeldRestPosition { rest, rest_sd, taken_up }))
    }

    /// The phase-locked loop from a state, or from what the signal says.
    fn lock(
        &self,
        drifting: &Drifting,
        gain: GainOf,
        past: &mut FilterPast,
        start: Option<[f64; 5]>,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let data = &self.part.data;
        // The gain is that for the motion at the segment's beginning.
        let mean = match (past.numbers[..].try_into(), start) {
            (Ok(mean), _) | (Err(_), Some(mean)) => mean,
            (Err(_), None) => self.settled(self.batch()?.mean),
        };
        past.numbers = mean.to_vec();
        let begin = |_: Option<MeanAndCovariance>| {
            let detector = PhasorDetector { series: self.settings.hardware.plates };
            let samples = (data.interval_s, data.noise_variance);
            let lock = PhaseLock::new(detector, drifting, gain, mean, samples);
            let lock = lock.map_err(|why| self.filter.basics.no_gain(&why))?;
            Ok(AnyFilter::this(lock))
        };
        let mut course =
            PhasorCourse::new(drifting, data, Box::new(MeasurementSensor::<_, 5>(drifting.readout())));
        let (filter, course) = (&self.filter.basics, (&mut course as _, &self.part.samples));
        follow((filter, past), begin, course, &STATES, self.progress)
    }

    /// The motion at the first sample from the whole settling time, in which no filter is scored; `None` where that
    /// is not longer than what a start looks at, or the fit does not settle.
    fn over_settling_time(&self, from: [f64; 5]) -> Option<PistonBatchStart> {
        let head = self.part.head();
        let first_s = head.time_s.first().copied()?;
        let end = head.time_s.partition_point(|t| *t < first_s + self.settings.skip_s);
        let window = PistonSegment { time_s: &head.time_s[..end], signal: &head.signal[..end], ..head };
        batch_fit(&self.settings.hardware.plates, &window, from, true).ok()
    }

    /// The rest position and its standard deviation in m, for a filter that holds it. What 20 ms leave of it a
    /// filter of three states would keep for ever, and its innovations would not show it: all of the settling time
    /// is used.
    fn rest(&self, batch: &PistonBatchStart) -> (f64, f64) {
        let of = |fit: &PistonBatchStart| (fit.mean[3], fit.covariance.standard_deviation(3));
        let first = of(batch);
        let longer = self.over_settling_time(batch.mean).map_or(first, |fit| of(&fit));
        if longer.1 < first.1 { longer } else { first }
    }

    /// Where a filter starts that forgets its start as slowly as a settled one does.
    fn settled(&self, from: [f64; 5]) -> [f64; 5] {
        self.over_settling_time(from).map_or(from, |fit| fit.mean)
    }

    /// The filtered trajectory, and the smoothed ones that are wanted.
    fn follow<P: Phasor<N>, const N: usize>(
        &self,
        phasor: &P,
        states: &[StateName],
        past: &mut FilterPast,
        start: impl FnOnce() -> Result<MeanAndCovariance, EstimateError>,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let course = || {
            let sensor = Box::new(MeasurementSensor::<_, N>(phasor.readout()));
            PhasorCourse::new(phasor, &self.part.data, sensor)
        };
        // A filter of three states has the first three.
        let again = self.start_again(course, |(mean, covariance)| {
            let first = std::array::from_fn::<f64, N, _>(|i| mean[i]);
            (first, Covariance::from_lower(Mat::from_fn(|i, j| covariance.get(i, j)))).into()
        });
        let mut course = StartedCourse::new(course(), None).starting_again(again);
        let (past, course) = ((&self.filter.basics, past), (&mut course as _, &self.part.samples));
        let mut all = answers(past, start, course, states, self.progress)?;
        if self.filter.basics.method == Method::Model {
            all.iter_mut().for_each(Trajectory::mark_model_alone);
        }
        Ok(all)
    }

    /// How the filter is started again where it has lost the signal, along such a course; `known` gives its states by the motion that was found.
    fn start_again<'b, C: Course + 'b>(
        &'b self,
        course: impl Fn() -> C + 'b,
        known: impl Fn(&PistonState<5>) -> MeanAndCovariance + 'b,
    ) -> Option<StartAgain<'b>> {
        let data = &self.part.data;
        let (plates, basics) = (&self.settings.hardware.plates, &self.filter.basics);
        let rule = basics.reacquisition(self.motion_hz, self.begun_s, rows_of_window(data.interval_s))?;
        Some(StartAgain::by(rule, move |rows, _| {
            let (time_s, signal) = (data.time_s.get(rows.clone())?, data.signal.get(rows.clone())?);
            let window = PistonSegment { time_s, signal, motion_hz: None, ..*data };
            let found = batch_start_of(plates, &window, self.filter.has_harmonics()).ok()?;
            let covariance = with_rate(&widened(&found.covariance), RATE_SD * found.mean[0]);
            start_again_from(&mut course(), rows, &known(&(found.mean, covariance)), &basics.readout)
        }))
    }

    /// Where the first samples say that the motion starts.
    fn batch(&self) -> Result<PistonBatchStart, EstimateError> {
        let (plates, head) = (&self.settings.hardware.plates, self.part.head());
        batch_start_of(plates, &head, self.filter.has_harmonics()).map_err(|why| EstimateError::NoStart {
            place: self.part.place.to_owned(),
            filter: self.filter.basics.name.clone(),
            why: why.to_string(),
        })
    }

    /// Each capacitance as a distance, with what its noise makes of it. A capacitance that no distance has is left
    /// out and counted as a missing signal.
    fn inversion(&self) -> Trajectory {
        let plates = &self.settings.hardware.plates;
        let PartData { data, samples, .. } = self.part;
        let noise = data.noise_variance.sqrt();
        let [position, _] = POSITION;
        let rows = (data.time_s, data.signal, samples);
        inversion(&self.filter.basics, rows, &[position], |_, capacitance| {
            let distance = distance_at(plates, capacitance)?;
            Some([(distance, noise / plates.slope(distance).abs())])
        })
    }
}

/// A rest position that a filter holds.
#[derive(Clone, Copy, Debug)]
struct HeldRestPosition {
    /// The rest position in m.
    rest: f64,
    /// Its standard deviation in m.
    rest_sd: f64,
    /// What the amplitude takes up of a wrong one, per metre of it.
    taken_up: f64,
}

impl HeldRestPosition {
    /// Adds what the uncertainty of the rest position makes of position, velocity and amplitude to what the filter says
    /// of them. The amplitude takes up what it can of a wrong rest position.
    fn add_to(&self, trajectory: &mut Trajectory) {
        let state = |name: &str| trajectory.state(name).map(|state| state.mean.clone()).unwrap_or_default();
        let (phases, frequencies) = (state("phase"), state("frequency"));
        for state in &mut trajectory.states {
            for ((sd, phase), frequency) in state.sd.iter_mut().zip(&phases).zip(&frequencies) {
                let (sine, cosine) = phase.portable_sin_cos();
                let per_metre = match state.name {
                    "amplitude" => self.taken_up,
                    "position" => 1.0 + self.taken_up * cosine,
                    "velocity" => -TAU * frequency * self.taken_up * sine,
                    _ => continue,
                };
                *sd = sd.portable_hypot(per_metre * self.rest_sd);
            }
        }
    }
}

/// The upper left part of a covariance, [`WIDER`].
fn widened<const N: usize>(covariance: &Covariance<f64, 5>) -> Covariance<f64, N> {
    let full = covariance.to_full();
    Covariance::from_lower(Mat::from_fn(|i, j| WIDER * WIDER * full.0[i][j]))
}

/// The same with an uncorrelated last state of this standard deviation.
fn with_rate(covariance: &Covariance<f64, 5>, sd: f64) -> Covariance<f64, 5> {
    let of_rate = |i: usize, j: usize| if i == j { sd * sd } else { 0.0 };
    Covariance::from_lower(Mat::from_fn(
        |i, j| {
            if i == 4 || j == 4 { of_rate(i, j) } else { covariance.get(i, j) }
        },
    ))
}
