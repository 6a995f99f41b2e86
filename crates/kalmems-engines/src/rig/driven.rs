//! The rig of any device that a recorded voltage drives and one recorded signal shows, made from its models.

use super::{Estimator, Rig, StateDensity};
use crate::config::{
    ConfigError, ConfigFault, DeviceDescription, DeviceKind, DeviceUses, Estimate, ExpectedEntry, Experiment,
    FilterStart, Key, Method, RecordingRole, Sign, Simulate, Values,
};
use crate::estimate::driven::{
    BLOCK, ByEuler, DrivenCourse, DrivenSegment, HYBRID_STEPS, ParameterPlaces, ParametricReadout,
    PlainModel, Plant, WithParameters, side_by_side,
};
use crate::estimate::{
    AngleAxis, AnyFilter, BatchStart, Course, DeviceParameter, EstimateError, FilterBasics, FilterPast,
    MeanAndCovariance, MotionRate, Past, RowsAround, SegmentEstimate, SegmentPart, SignalSegment,
    SignalStart, StartAgain, StartSearch, StartedCourse, StateName, StatePrior, Trajectory, answers_of_bank,
    begun, follow, process_noise, refuse_demodulator, rows_for_start, rows_to_start_again,
    start_again_from_signal, start_from_signal,
};
use crate::evaluate::ValueState;
use crate::outlook::{Outlook, OutlookTopic};
use crate::progress::Progress;
use crate::recording::{Finding, RecordingLayout, RecordingSource};
use crate::simulate::{
    Converter, Drive, SimulateError, SimulatedColumn, SimulatedSample, Simulation, Simulator, WhiteNoise,
    drive_of,
};
use crate::units::{kind, name};
use kalmems_core::augmentation::{ParametricDynamics, ParametricMeasurement};
use kalmems_core::{Mat, Measurement, Nodes, NoiseDensity, Parameters};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// A device of `M` states that a recorded voltage drives and one recorded voltage shows.
///
/// It says how the device moves, how it is read and what its numbers are. All else is that of any such device, and
/// [`DrivenRig`] has it: the filters with parameters as states, smoothers, gaps, parts of long recordings, simulation.
pub trait DrivenDevice<const M: usize>: Send + Sync + 'static {
    /// Its table in an experiment file.
    type Table: DeviceDescription;
    /// How it moves.
    type Motion: ParametricDynamics<f64, M, Input = f64> + Parameters<f64, Of<f64> = Self::Motion> + Copy;
    /// How it is read.
    type Readout: ParametricMeasurement<f64, M, 1> + Parameters<f64, Of<f64> = Self::Readout> + Copy;

    /// Its states; the first is what it is for.
    const STATES: [StateName; M];
    /// What a reference may know of them.
    const VALUES: &'static [ValueState];
    /// The columns of a simulated reference, one for each state.
    const TRUTH: &'static [SimulatedColumn];
    /// The state whose rate has white noise, and what the density of that is.
    const NOISE: (usize, ExpectedEntry);
    /// Its parameters that can be states.
    const PARAMETERS: &'static [DeviceParameter] = &[];

    /// Its numbers in SI.
    fn model(&self, table: &Self::Table) -> DrivenModel<Self::Motion, Self::Readout>;
}

/// The numbers of a device.
#[derive(Clone, Copy, Debug)]
pub struct DrivenModel<D, H> {
    /// How it moves.
    pub motion: D,
    /// How it is read.
    pub readout: H,
    /// The variance of one sample's noise in V².
    pub noise_variance: f64,
    /// The frequency of its free motion in Hz.
    pub natural_hz: f64,
}

/// The rig of such a device.
pub struct DrivenRig<D, const M: usize>(pub D);

/// The channels of a recording.
const CHANNELS: [&str; 2] = ["drive", "signal"];
/// Those of a simulated one.
const RECORDED: [SimulatedColumn; 2] = [
    SimulatedColumn { meaning: CHANNELS[0], column: "drive_V" },
    SimulatedColumn { meaning: CHANNELS[1], column: "signal_V" },
];
/// Cycles of the free motion that show how the device is driven, at least.
const STARTING_CYCLES: f64 = 40.0;

/// What models of a motion and of its readout do not tell.
static NO_METHODS: [(Method, &str); 3] = [
    (Method::LockIn, NO_INVERSE),
    (Method::DirectInversion, NO_INVERSE),
    (
        Method::KalmanBucy,
        "its models are stepped from sample to sample; use `steady_state`, whose gain is the same where samples are dense",
    ),
];

/// Why nothing is taken from the signal alone.
const NO_INVERSE: &str =
    "its models say what signal a state makes, and not what state a signal means; use `ekf`";

type ModelOf<D, const M: usize> =
    DrivenModel<<D as DrivenDevice<M>>::Motion, <D as DrivenDevice<M>>::Readout>;

impl<D: DrivenDevice<M>, const M: usize> DrivenRig<D, M> {
    fn model(&self, experiment: &Experiment) -> Result<ModelOf<D, M>, ConfigError> {
        Ok(self.0.model(&*experiment.device::<D::Table>()?))
    }
}

impl<D: DrivenDevice<M>, const M: usize> Rig for DrivenRig<D, M> {
    fn name(&self) -> &'static str {
        D::Table::NAME
    }

    fn device(&self) -> DeviceKind {
        DeviceKind::of::<D::Table>()
    }

    fn claims(&self, experiment: &Experiment) -> Result<bool, ConfigError> {
        experiment.device::<D::Table>().map(|_| true)
    }

    fn uses(&self, _: &Experiment) -> DeviceUses {
        DeviceUses { no_methods: &NO_METHODS, ..DeviceUses::default() }
    }

    fn densities(&self, _: &Experiment) -> Vec<StateDensity> {
        let (state, entry) = D::NOISE;
        let named = D::STATES.get(state);
        let unit = named.map_or("", |(_, _, kind)| name(&kind.dimension.to_string()));
        vec![StateDensity { entry, wanders: named.map_or("the state", |(state, ..)| state), unit }]
    }

    fn wanted(&self, experiment: &Experiment) -> Result<Vec<usize>, ConfigError> {
        DrivenSettings::of(self, experiment)?;
        experiment.to_estimate(&[RecordingRole::Test, RecordingRole::SteadyState], |index| {
            columns(experiment, index)
        })
    }

    fn layout(&self, experiment: &Experiment, index: usize) -> Result<RecordingLayout, ConfigError> {
        let cycle_s = self.model(experiment)?.natural_hz.recip();
        experiment.layout_to_estimate(index, &columns(experiment, index)?, cycle_s)
    }

    fn angles(&self) -> &'static [[&'static str; 2]] {
        &[]
    }

    fn values(&self, _: &Experiment) -> &'static [ValueState] {
        D::VALUES
    }

    fn parameters(&self, _: &Experiment) -> &'static [DeviceParameter] {
        D::PARAMETERS
    }

    fn estimator<'a>(
        &self,
        experiment: &'a Experiment,
        index: usize,
        progress: &'a dyn Progress,
    ) -> Result<Box<dyn Estimator + 'a>, EstimateError> {
        let (settings, columns) =
            (DrivenSettings::<D, M>::of(self, experiment)?, columns(experiment, index)?);
        Ok(Box::new(DrivenEstimator { settings, columns, past: Past::default(), progress }))
    }

    fn outlook(&self, experiment: &Experiment) -> Result<Outlook, SimulateError> {
        let hz = self.model(experiment)?.natural_hz;
        let text = format!("A small motion is free at {hz:.6} Hz.");
        Ok(Outlook::of(
            experiment,
            self.name(),
            vec![OutlookTopic::new("Device").with("natural_frequency_hz", [hz], text)],
        ))
    }

    fn simulate(&self, experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
        let Some(simulate) = &experiment.simulate else {
            let remedy =
                "add the table `[simulate]` with a drive, such as `[simulate.drive.sine]`".to_owned();
            return Err(experiment.error("simulate", ConfigFault::MissingKey { remedy }).into());
        };
        let (drive, source) = drive_of(experiment, simulate)?;
        Ok(Box::new(DrivenSimulation::<D, M> {
            model: self.model(experiment)?,
            drive,
            sources: source.into_iter().collect(),
            start: experiment.values("simulate.start", &simulate.start, entries::<D, M>(Sign::Any))?,
            simulate: simulate.clone(),
        }))
    }
}

fn columns(experiment: &Experiment, index: usize) -> Result<[&str; 2], ConfigError> {
    let key = Key::from("recording").index(index).child("channels");
    experiment.columns(key, &experiment.recording(index)?.channels, CHANNELS)
}

/// The states, as tables of values name them.
fn entries<D: DrivenDevice<M>, const M: usize>(sign: Sign) -> [ExpectedEntry; M] {
    D::STATES.map(|(name, _, kind)| ExpectedEntry { name, kind, sign })
}

/// What the file says, in SI.
struct DrivenSettings<D: DrivenDevice<M>, const M: usize> {
    model: ModelOf<D, M>,
    skip_s: f64,
    filters: Vec<DrivenFilterSettings<M>>,
}

struct DrivenFilterSettings<const M: usize> {
    basics: FilterBasics,
    /// `None` where it comes from the signal.
    start: Option<[f64; M]>,
    /// Of a start from the signal how far from rest a state may be, 0 where that is not known.
    start_sd: [f64; M],
    /// The density of the noise.
    density: f64,
}

impl<D: DrivenDevice<M>, const M: usize> DrivenSettings<D, M> {
    fn of(rig: &DrivenRig<D, M>, experiment: &Experiment) -> Result<Self, ConfigError> {
        let Some(estimate) = &experiment.estimate else {
            let remedy = "add the table `[estimate]` with `skip`, `process_noise` and at least one `[[estimate.filter]]`";
            return Err(experiment.error("estimate", ConfigFault::MissingKey { remedy: remedy.to_owned() }));
        };
        let model = rig.model(experiment)?;
        let of = |index| DrivenFilterSettings::of::<D>(experiment, estimate, &model, index);
        let filters = (0..estimate.filters.len()).map(of).collect::<Result<_, _>>()?;
        Ok(Self { skip_s: estimate.skip.si(), filters, model })
    }
}

impl<const M: usize> DrivenFilterSettings<M> {
    fn of<D: DrivenDevice<M>>(
        experiment: &Experiment,
        estimate: &Estimate,
        model: &ModelOf<D, M>,
        index: usize,
    ) -> Result<Self, ConfigError> {
        let filter = &estimate.filters[index];
        let at = Key::from("estimate").child("filter").index(index);
        refuse_demodulator(experiment, (&at, filter), "this device has none; leave it out")?;
        let values = |name: &str, values: &Values, sign| {
            experiment.values(at.clone().child(name), values, entries::<D, M>(sign))
        };
        let claims = filter.method.claims();
        let (noise_key, noise) = process_noise(experiment, &at, filter)?;
        let scale = |parameter: &DeviceParameter| parameter.scale(&model.motion, &model.readout);
        let scales: Vec<f64> = D::PARAMETERS.iter().map(scale).collect();
        let [density] = if claims { experiment.values(noise_key, noise, [D::NOISE.1])? } else { [0.0] };
        Ok(Self {
            start: match &filter.start {
                Some(FilterStart::Values(start)) => Some(values("start", start, Sign::Any)?),
                Some(FilterStart::FromSignal) | None => None,
            },
            start_sd: if claims && !filter.start_sd.is_empty() {
                values("start_sd", &filter.start_sd, Sign::NotNegative)?
            } else {
                [0.0; M]
            },
            density,
            basics: FilterBasics::of(experiment, &at, filter, (D::PARAMETERS, &scales))?,
        })
    }
}

/// Estimates recordings, part by part.
struct DrivenEstimator<'a, D: DrivenDevice<M>, const M: usize> {
    settings: DrivenSettings<D, M>,
    columns: [&'a str; 2],
    past: Past,
    progress: &'a dyn Progress,
}

impl<D: DrivenDevice<M>, const M: usize> Estimator for DrivenEstimator<'_, D, M> {
    fn around(&self, interval_s: f64) -> RowsAround {
        let first_s = STARTING_CYCLES / self.settings.model.natural_hz;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
        let rows = (first_s / interval_s).ceil() as usize;
        let from_signal = self.settings.filters.iter().filter(|filter| filter.start.is_none());
        let motion = (self.settings.model.natural_hz.recip(), interval_s);
        let for_start =
            from_signal.map(|filter| rows_for_start(motion, filter.basics.states(&D::STATES).len()));
        let rows = for_start.fold(rows, usize::max);
        let again = self.settings.filters.iter().map(|filter| filter.rows_to_start_again::<D>(motion));
        let again = again.fold(0, usize::max);
        let smooths = self.settings.filters.iter().any(|filter| filter.basics.smooth);
        let (before, after) = self.past.lag().rows_around();
        RowsAround {
            head: rows.clamp(BLOCK, RowsAround::LONGEST_HEAD),
            before: before + again,
            after,
            smooths,
        }
    }

    fn past(&mut self) -> &mut Past {
        &mut self.past
    }

    fn take(&mut self, part: &SegmentPart) -> Result<SegmentEstimate, EstimateError> {
        let (settings, [drive_column, signal_column]) = (&self.settings, self.columns);
        let past = &mut self.past;
        let segment = SignalSegment::of(part, (signal_column, &kind::VOLTAGE), settings.skip_s, past)?;
        segment.require_usable_signals(&[signal_column])?;
        let data = DrivenSegment::of(&segment, drive_column, past, self.progress)?;
        let drive = data.drive.first_sine().copied();
        let motion = match &drive {
            Some(sine) => MotionRate { frequency_hz: sine.frequency_hz, is_driven: true },
            None => MotionRate { frequency_hz: settings.model.natural_hz, is_driven: false },
        };
        let axes = [(D::STATES[0].0, motion)];
        let start_s = data.scored_from(settings.skip_s);
        let mut all = Vec::new();
        for (index, filter) in settings.filters.iter().enumerate() {
            let past = past.filter(index);
            let seen = FilterInput { data: &data, place: &segment.place, progress: self.progress };
            let mut found = filter.follow::<D>(&settings.model, seen, past)?;
            for (answer, trajectory) in found.iter_mut().enumerate() {
                let judge = &mut past.answer(answer).judge;
                trajectory.lock = judge.judge(trajectory, &axes, start_s, data.samples.ends);
            }
            all.append(&mut found);
        }
        let axis = AngleAxis { angle: D::STATES[0].0, motion, drive };
        Ok(segment.estimated_under(drive_column, (axis, Vec::new()), all))
    }

    fn conclude(&mut self, place: &str, diagnosis: &[Finding]) -> Result<(), EstimateError> {
        EstimateError::of_unusable_signal(diagnosis, (place, &[self.columns[1]]), |_| true)
    }
}

/// What a filter sees, of which segment, and who follows the work.
#[derive(Clone, Copy)]
struct FilterInput<'a> {
    data: &'a DrivenSegment<'a>,
    place: &'a str,
    progress: &'a dyn Progress,
}

impl<const M: usize> DrivenFilterSettings<M> {
    /// One filter over the new samples.
    fn follow<D: DrivenDevice<M>>(
        &self,
        model: &ModelOf<D, M>,
        seen: FilterInput,
        past: &mut FilterPast,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let mut lower = Mat::<f64, M, M>::zero();
        lower.0[D::NOISE.0][D::NOISE.0] = self.density;
        let noise = NoiseDensity::from_lower(lower);
        let (tracked, sizes) = (&self.basics.tracked, (model.noise_variance, model.natural_hz));
        let plain = PlainModel { dynamics: model.motion, readout: model.readout, noise };
        if self.basics.method == Method::Bank {
            return self.bank::<D>(&plain, sizes, seen, past);
        }
        if tracked.is_empty() {
            return match self.basics.method {
                Method::EulerEkf => self.through::<D, _>(&ByEuler(plain), sizes, seen, past),
                _ => self.through::<D, _>(&plain, sizes, seen, past),
            };
        }
        let wrong = |why| self.basics.no_model(why);
        let readout = ParametricReadout::new(model.readout, tracked, |parameter| parameter.in_readout);
        let readout = readout.map_err(wrong)?;
        let plant =
            WithParameters::new((model.motion, noise), readout, tracked, |parameter| parameter.in_motion);
        self.through::<D, _>(&plant.map_err(wrong)?, sizes, seen, past)
    }

    /// Filters of several models side by side.
    fn bank<D: DrivenDevice<M>>(
        &self,
        plain: &PlainModel<D::Motion, D::Readout, M>,
        (variance, natural_hz): (f64, f64),
        FilterInput { data, place, progress }: FilterInput,
        past: &mut FilterPast,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let enters: ParameterPlaces = [|parameter| parameter.in_motion, |parameter| parameter.in_readout];
        let plants = side_by_side(plain, &self.basics.tracked, enters);
        let course =
            |plant| DrivenCourse::new(plant, variance, data).map_err(|why| self.basics.no_model(why));
        let is_begun = past.left().is_some();
        let mut courses: Vec<Box<dyn Course + '_>> = Vec::new();
        let mut starts = Vec::new();
        for plant in &plants {
            let mut course = course(plant)?;
            let start =
                if is_begun { None } else { self.batch_start::<D>(&mut course, natural_hz, (data, place))? };
            courses.push(Box::new(StartedCourse::new(course, start.as_ref())));
            starts.push(start);
        }
        let start = |model: usize| {
            let found = starts.get(model).and_then(Option::as_ref);
            Ok(begun(None, found).unwrap_or_else(|| self.known()))
        };
        let states = self.basics.states(&D::STATES);
        answers_of_bank((&self.basics, past), start, (courses, &data.samples), &states, progress)
    }

    /// The start from the signal along a course; `None` where the file states one.
    fn batch_start<D: DrivenDevice<M>>(
        &self,
        course: &mut dyn Course,
        natural_hz: f64,
        (data, place): (&DrivenSegment, &str),
    ) -> Result<Option<BatchStart>, EstimateError> {
        if self.start.is_some() {
            return Ok(None);
        }
        let search = self.search(natural_hz);
        let (states, cycle_s) = (self.basics.states(&D::STATES), natural_hz.recip());
        let of = SignalStart { place, basics: &self.basics, states: (&states, M), sizes: &[], cycle_s };
        start_from_signal(course, &data.samples, &search, of).map(Some)
    }

    /// What the search for a start knows: how far from rest a motion may be, where the file says that.
    fn search(&self, natural_hz: f64) -> StartSearch {
        let is_stated = self.start.is_some();
        let from_rest = |sd: &f64| !is_stated && *sd > 0.0;
        let motion = self.start_sd.map(|sd| StatePrior { mean: 0.0, sd: Some(sd).filter(from_rest) });
        let prior = motion.into_iter().chain(self.basics.priors()).collect();
        StartSearch::of_oscillation(prior, TAU * natural_hz)
    }

    /// The rows that it is started again by, of a motion with this cycle and interval in s.
    fn rows_to_start_again<D: DrivenDevice<M>>(&self, motion: (f64, f64)) -> usize {
        rows_to_start_again(motion, self.basics.states(&D::STATES).len())
    }

    /// What is known at the first sample.
    fn known(&self) -> MeanAndCovariance {
        let motion = self.start.unwrap_or([0.0; M]).into_iter().zip(self.start_sd);
        MeanAndCovariance::apart(
            motion.chain(self.basics.parameters().iter().map(|tracked| (0.0, tracked.sd))),
        )
    }

    fn through<D: DrivenDevice<M>, P: Plant>(
        &self,
        plant: &P,
        (variance, natural_hz): (f64, f64),
        FilterInput { data, place, progress }: FilterInput,
        past: &mut FilterPast,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let course = DrivenCourse::new(plant, variance, data);
        let course = match self.basics.method {
            Method::HybridEkf => course.and_then(|course| course.in_steps(HYBRID_STEPS)),
            _ => course,
        };
        let mut course = course.map_err(|why| self.basics.no_model(why))?;
        let states = self.basics.states(&D::STATES);
        let (basics, interval_s) = (&self.basics, data.interval_s);
        let is_begun = past.left().is_some();
        let found =
            if is_begun { None } else { self.batch_start::<D>(&mut course, natural_hz, (data, place))? };
        // The model alone is corrected by nothing, and an observer forgets its start.
        let corrects = basics.method != Method::Model && basics.gain().is_none();
        let motion_hz = data.drive.first_sine().map_or(natural_hz, |sine| sine.frequency_hz);
        let rows = self.rows_to_start_again::<D>((natural_hz.recip(), interval_s));
        let again = basics.reacquisition(motion_hz, data.start_s, rows).map(|rule| {
            let search = self.search(natural_hz);
            StartAgain::by(rule, move |rows, _| {
                let mut course = DrivenCourse::new(plant, variance, data).ok()?;
                start_again_from_signal(&mut course, rows, &search, &basics.readout)
            })
        });
        let mut course =
            StartedCourse::new(course, found.as_ref().filter(|_| corrects)).starting_again(again);
        let begin = |left: Option<MeanAndCovariance>| {
            let left = begun(left, found.as_ref());
            let Some(gain) = basics.gain() else { return basics.begin(left, || Ok(self.known())) };
            let motion = plant.over(interval_s).map_err(|why| basics.no_model(why))?;
            let nodes = Nodes::held(0.0);
            let (step, sensor) = (plant.under(&motion, &nodes), plant.sensor());
            let (at_rest, known) =
                (MeanAndCovariance::apart([(0.0, 0.0); M]), left.unwrap_or_else(|| self.known()));
            let point = (&step as _, &sensor as _, variance);
            AnyFilter::of_constant_gain((gain, interval_s), (&at_rest, &known), point)
                .map_err(|why| basics.no_gain(&why))
        };
        let way = (&mut course as _, &data.samples);
        let mut all = follow((basics, past), begin, way, &states, progress)?;
        if self.basics.method == Method::Model {
            all.iter_mut().for_each(Trajectory::mark_model_alone);
        }
        Ok(all)
    }
}

/// A recording that is computed.
struct DrivenSimulation<D: DrivenDevice<M>, const M: usize> {
    model: ModelOf<D, M>,
    drive: Drive,
    sources: Vec<RecordingSource>,
    start: [f64; M],
    simulate: Simulate,
}

impl<D: DrivenDevice<M>, const M: usize> Simulation for DrivenSimulation<D, M> {
    fn recorded(&self) -> &[SimulatedColumn] {
        &RECORDED
    }

    fn truth(&self) -> &[SimulatedColumn] {
        D::TRUTH
    }

    fn samples(&self) -> u64 {
        self.simulate.samples()
    }

    fn sources(&self) -> &[RecordingSource] {
        &self.sources
    }

    fn run(&self, each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>) -> Result<(), SimulateError> {
        let Simulate { noise, seed, .. } = self.simulate;
        let deviation = if noise { self.model.noise_variance.sqrt() } else { 0.0 };
        let (rate_hz, steps) = (self.simulate.integration_rate.si(), self.simulate.steps_per_sample());
        let mut simulator = Simulator::new(self.model.motion, self.drive.clone(), rate_hz, self.start);
        let mut noise = WhiteNoise::new(seed, 0);
        let converter = self.simulate.adc.as_ref().map(Converter::of);
        let interval_s = self.simulate.sampling_rate.si().recip();
        for k in 0..self.samples() {
            let time_s = k as f64 * interval_s;
            let state = *simulator.state();
            if !state.iter().all(|x| x.is_finite()) {
                return Err(SimulateError::NotFinite { time_s });
            }
            let [clean] = self.model.readout.predict(&state);
            let analogue = clean + deviation * noise.sample();
            let signal = converter.map_or(analogue, |converter| converter.round(analogue));
            let recorded = [self.drive.at(time_s), signal];
            if each(&SimulatedSample { time_s, recorded: &recorded, truth: &state }).is_break() {
                return Err(SimulateError::Interrupted);
            }
            for _ in 0..steps {
                simulator.step();
            }
        }
        Ok(())
    }
}
