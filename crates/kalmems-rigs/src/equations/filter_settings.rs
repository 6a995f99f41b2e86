//! What the file says of one filter.

use super::events::{self, EventSettings, FilterEventUse};
use super::filter_devices::{FilterDevice, begins_by_swing, of_each_low_pass};
use super::inversion::Inverse;
use super::model::{EquationModel, RateDensity, StepRule};
use super::names;
use super::names::some;
use super::oscillation::MeasuredOscillation;
use super::own_device::{OwnDevice, densities};
use super::sine::QuantitySine;
use super::start::LaterStart;
use super::table::EquationsTable;
use super::threshold;
use crate::config::{
    ConfigError, ConfigFault, Estimate, ExpectedEntry, Experiment, FilterStart, FilterTable, Key, Method,
    Quantity, UncertainNumber, Values, Variant,
};
use crate::estimate::driven::combinations;
use crate::estimate::{DeviceParameter, FilterBasics, MeanAndCovariance, StatePrior, Tracked, process_noise};
use crate::units::kind;
use crate::units::{Dimension, name};
use kalmems_equations::{Device, EquationError, NoiseKind};
use std::sync::{Arc, OnceLock};

/// What the file says of one filter.
pub struct EquationFilterSettings {
    /// What every filter has.
    pub basics: FilterBasics,
    /// The device as it knows it: with the low-passes of the readout or without, and without the states that it is given.
    pub own: Arc<OwnDevice>,
    /// The states that it is given as inputs behind the stated ones, by their places in the device.
    pub known: Vec<usize>,
    /// The measurements that correct it, by their places; none for all that the recording has.
    pub measures: Vec<usize>,
    /// The variance that it takes a sample of its one signal for, where that is not the noise's.
    pub signal_variance: Option<f64>,
    /// Over how long it estimates the variance of a sample of its one signal, in s, where it does.
    pub noise_memory_s: Option<f64>,
    /// What of the signal corrects it.
    pub variant: Variant,
    /// How it uses the events.
    pub events: Vec<FilterEventUse>,
    /// The state that its measurement tells, where each sample is taken by itself.
    pub inverse: Option<Inverse>,
    /// The oscillations that lines of its measurements tell, of each of them and of each axis, where it asks for these.
    pub oscillations: Vec<MeasuredOscillation>,
    /// The states that it holds, by the table of a sine, because nothing in the file moves them.
    held: Vec<usize>,
    start: EquationStart,
    later_start: OnceLock<LaterStart>,
    /// How large each state usually is, where the device's table says it.
    usual: Vec<Option<f64>>,
    /// The density of the noise of each state's rate, where the file says one here.
    density: Vec<Option<f64>>,
}

/// Where a filter starts.
pub(super) enum EquationStart {
    /// At these states, with their standard deviations.
    Stated { mean: Vec<f64>, sd: Vec<f64> },
    /// At the oscillation that the first cycles of the signal show, which may be off by these standard deviations.
    Swing { sd: Vec<Option<f64>> },
    /// At what the first samples say, about these states where the file says some, with the standard deviations that are known before,
    /// where some are.
    Signal { about: Vec<Option<f64>>, sd: Vec<Option<f64>> },
}

impl EquationStart {
    /// At these states, of which some are stated, with these standard deviations.
    fn stated(
        experiment: &Experiment,
        at: &Key,
        own: &OwnDevice,
        (stated, sd): (Vec<Option<f64>>, Vec<Option<f64>>),
    ) -> Result<Self, ConfigError> {
        let mean = own.started(&stated);
        if let Some(names) = own.symmetric_rest(&mean) {
            let why = format!(
                "{names} are exactly 0; equations and signals are symmetric there, so that neither a filter nor the model would ever leave it; \
                 start from a small value, such as `1e-6`"
            );
            return Err(experiment.error(at.clone().child("start"), ConfigFault::Value { why }));
        }
        let deviations = names::deviations(&own.device);
        let missing = |missing: usize| missing_deviation(experiment, at, &deviations[missing]);
        let sd = following(own, &mean, sd).map_err(missing)?;
        Ok(Self::Stated { mean, sd })
    }
}

impl EquationFilterSettings {
    pub(super) fn of(
        experiment: &Experiment,
        estimate: &Estimate,
        (of, events, sine): (&FilterDevice<'_>, &[EventSettings], Option<&QuantitySine>),
        index: usize,
    ) -> Result<Self, ConfigError> {
        let FilterDevice { table, own, known: given } = of;
        let (device, filter) = (&own.device, &estimate.filters[index]);
        let at = Key::from("estimate").child("filter").index(index);
        let refuse = |name: &str, why: String| {
            Err(experiment.error(at.clone().child(name), ConfigFault::Value { why }))
        };
        let entries = names::entries(device);
        let start = if let Some(FilterStart::Values(values)) = &filter.start { Some(values) } else { None };
        let deviations = names::deviations(device);
        let of = |name: &str, values: &Values, known: &[ExpectedEntry]| {
            some(experiment, &at.clone().child(name), values, known)
        };
        let claims = filter.method.claims();
        let usual = some(experiment, &Key::from("device.equations.usual"), &table.usual, &deviations)?;
        let mut sd = if claims {
            let with_lags = filter.demodulator.then(|| of_each_low_pass(device, &filter.start_sd));
            of("start_sd", with_lags.as_ref().unwrap_or(&filter.start_sd), &deviations)?
        } else {
            vec![Some(0.0); entries.len()]
        };
        let by_swing = start.is_none() && begins_by_swing(table, own, filter);
        if start.is_none() && claims && !by_swing {
            if table.start_tells_itself {
                sd.fill(None);
            }
            sd.iter_mut().zip(&usual).for_each(|(sd, usual)| *sd = sd.or(*usual));
        }
        let (noise_key, noise) = process_noise(experiment, &at, filter)?;
        if claims {
            require_noises(experiment, table, (&noise_key, noise))?;
        }
        let density = some(experiment, &noise_key, noise, &names::densities(table, device))?;
        let is_moved = |state: &usize| density[*state].is_some() || sd[*state].is_some();
        let held = sine.map_or(&[][..], QuantitySine::held).iter().copied();
        let held: Vec<usize> = held.filter(|state| claims && !is_moved(state)).collect();
        let start = match start {
            None if by_swing => EquationStart::Swing { sd },
            None => {
                let about = of("start_about", &filter.start_about, &entries)?;
                EquationStart::Signal { about, sd: if claims { sd } else { vec![None; entries.len()] } }
            }
            Some(_) if !filter.start_about.is_empty() => {
                return refuse(
                    "start_about",
                    "`start` says where the filter starts; leave one of both out".to_owned(),
                );
            }
            Some(values) => {
                for state in &held {
                    sd[*state] = Some(0.0);
                }
                EquationStart::stated(experiment, &at, own, (of("start", values, &entries)?, sd))?
            }
        };
        let known = parameters(experiment, (table, device));
        let scales: Vec<f64> = known
            .iter()
            .zip(&own.values)
            .map(|(parameter, value)| if parameter.is_factor() { *value } else { 1.0 })
            .collect();
        let mut basics = FilterBasics::of(experiment, &at, filter, (known, &scales))?;
        if !given.is_empty() {
            let names: Vec<&str> = filter.known_states().1.collect();
            basics.name += &format!(", {} known", names.join(", "));
        }
        let variant = filter.variant.unwrap_or_default();
        if variant == Variant::Literal {
            // Its gain is not that of its innovations: these are larger than it claims when nothing is wrong with a sample.
            basics.taking.largest_nis = None;
        }
        threshold::check(experiment, (&at, filter))?;
        let measures = measures(experiment, &at, filter, own)?;
        let events = events::uses(experiment, own, events, (&at, filter))?;
        let all = 0..device.measures().len();
        let chosen = if measures.is_empty() { all.collect() } else { measures.clone() };
        let [signal_variance, noise_memory_s] = of_one_signal((experiment, &at, filter), device, &chosen)?;
        let (inverse, mut oscillations) = without_motion((experiment, &at, filter), (own, sine), &chosen)?;
        if by_swing && oscillations.is_empty() {
            let known = |measure: &usize| MeasuredOscillation::of(own, table, (*measure, 0)).ok();
            oscillations = chosen.iter().filter_map(known).collect();
        }
        // What the sine itself tells is not held by a start from it.
        let held = held.into_iter().filter(|state| sine.is_some_and(|sine| !sine.is_told(*state))).collect();
        Ok(Self {
            basics,
            own: Arc::clone(own),
            known: given.to_vec(),
            measures,
            signal_variance,
            noise_memory_s,
            variant,
            events,
            inverse,
            oscillations,
            held,
            start,
            later_start: OnceLock::new(),
            usual,
            density,
        })
    }

    /// What the file says of the states at the first sample; `None` where they come from the signal.
    pub fn stated(&self) -> Option<MeanAndCovariance> {
        let EquationStart::Stated { mean, sd } = &self.start else { return None };
        let own = mean.iter().copied().zip(sd.iter().copied());
        let parameters = self.basics.parameters().iter().map(|tracked| (0.0, tracked.sd));
        Some(MeanAndCovariance::apart(own.chain(parameters)))
    }

    /// How far the oscillation may be off that it starts at, of a filter that starts so.
    pub fn swing_sd(&self) -> Option<&[Option<f64>]> {
        let EquationStart::Swing { sd } = &self.start else { return None };
        Some(sd)
    }

    /// About where a state is at the start, where the file says it.
    pub fn about_of(&self, state: usize) -> Option<f64> {
        match &self.start {
            EquationStart::Stated { mean, .. } => mean.get(state).copied(),
            EquationStart::Swing { .. } => None,
            EquationStart::Signal { about, .. } => about.get(state).copied().flatten(),
        }
    }

    /// Where it begins, or where the search for its start does.
    fn about(&self) -> Vec<f64> {
        match &self.start {
            EquationStart::Stated { mean, .. } => mean.clone(),
            EquationStart::Swing { .. } => self.own.rest.clone(),
            EquationStart::Signal { about, .. } => {
                about.iter().zip(&self.own.rest).map(|(about, rest)| about.unwrap_or(*rest)).collect()
            }
        }
    }

    /// What is known of the states before the first sample, where the start comes from the signal: that they are about rest, or where the
    /// file says, as far as it says how far.
    pub fn prior(&self) -> Option<Vec<StatePrior>> {
        let EquationStart::Signal { sd, .. } = &self.start else { return None };
        let states = self.about().into_iter().zip(sd).map(|(mean, sd)| StatePrior { mean, sd: *sd });
        Some(self.holding(states.chain(self.basics.priors()).collect()))
    }

    /// The same, of which those that it holds are known.
    fn holding(&self, mut prior: Vec<StatePrior>) -> Vec<StatePrior> {
        for state in &self.held {
            prior[*state].sd = Some(0.0);
        }
        prior
    }

    /// How it is started again where it has lost the signal. It is found once, and not with each block of a stream.
    pub fn later_start(&self) -> &LaterStart {
        self.later_start.get_or_init(|| LaterStart::of(&self.own, self.prior_of_a_later_start()))
    }

    /// What is known of the states before a start that is sought later, since the signal was lost.
    pub fn prior_of_a_later_start(&self) -> Vec<StatePrior> {
        self.prior().unwrap_or_else(|| {
            let motion = self.own.rest.iter().zip(&self.usual);
            let motion = motion.map(|(rest, usual)| StatePrior { mean: *rest, sd: *usual });
            self.holding(motion.chain(self.basics.priors()).collect())
        })
    }

    /// The models that it runs on: one, but for a bank, whose models have its parameters off by their deviations.
    pub fn models(&self) -> Result<Vec<EquationModel>, EquationError> {
        if self.basics.method != Method::Bank {
            return Ok(vec![self.model(&[])?]);
        }
        combinations(&self.basics.tracked).iter().map(|shifts| self.model(shifts)).collect()
    }

    /// A model with its parameters off by so much.
    fn model(&self, shifts: &[f64]) -> Result<EquationModel, EquationError> {
        let own = &self.own;
        let mut values = own.values.clone();
        for (tracked, shift) in self.basics.tracked.iter().zip(shifts) {
            if let Some(place) = own.device.parameter(tracked.parameter.name) {
                values[place] += shift;
            }
        }
        let stated = densities(&own.device.noise(&values, &own.rest)?, own.rest.len());
        let varying = own.device.varying_noise(&[])?;
        let of_state = |(state, (stated, own)): (usize, (&f64, &Option<f64>))| match own {
            Some(own) => RateDensity::Held(*own),
            None if varying.iter().any(|(kind, _)| *kind == NoiseKind::Rate { state }) => {
                RateDensity::Varying
            }
            None => RateDensity::Held(*stated),
        };
        let density: Vec<_> = stated.iter().zip(&self.density).enumerate().map(of_state).collect();
        let rule =
            if self.basics.method == Method::EulerEkf { StepRule::Euler } else { StepRule::Exponential };
        let tracked: &[Tracked] = self.basics.parameters();
        let about = own.rest_about(&self.about());
        EquationModel::new(&own.device, &values, tracked, (&density, rule), (&own.rest, &about, own.pace()))
    }
}

/// Refuses a table of process noise in which a name of the device's own table is missing: what is left out would be none at all, which that has to say.
pub(super) fn require_noises(
    experiment: &Experiment,
    table: &EquationsTable,
    (key, noise): (&Key, &Values),
) -> Result<(), ConfigError> {
    let Some((name, _)) = table.noise_keys.iter().find(|(name, _)| !noise.contains_key(*name)) else {
        return Ok(());
    };
    let remedy = format!("write the density, such as `{name} = \"1e4 rad^2/s^3\"`; 0 for none");
    Err(experiment.error(key.clone().child(name), ConfigFault::MissingKey { remedy }))
}

/// That a state's standard deviation at the start is missing.
pub(super) fn missing_deviation(experiment: &Experiment, at: &Key, entry: &ExpectedEntry) -> ConfigError {
    let remedy =
        format!("write `{} = \"{}\"`: how well the state is known at first", entry.name, entry.kind.example);
    let key = at.clone().child("start_sd").child(entry.name);
    experiment.error(key, ConfigFault::MissingKey { remedy })
}

/// Standard deviations of all states, where those of lags and delays may be left out: they follow the others as they do when all
/// has settled. The place of a state whose own is missing, where one is.
pub fn following(own: &OwnDevice, start: &[f64], sd: Vec<Option<f64>>) -> Result<Vec<f64>, usize> {
    let Some(first) = sd.iter().position(Option::is_none) else {
        return Ok(sd.into_iter().flatten().collect());
    };
    let first_follower = own.device.own_states();
    if first < first_follower {
        return Err(first);
    }
    let states = start.len();
    let held: Vec<bool> = sd.iter().map(Option::is_some).collect();
    let settled = |start: &[f64]| own.settled(start, &held);
    let at = settled(start);
    let mut all: Vec<f64> = sd.iter().map(|sd| sd.unwrap_or(0.0)).collect();
    for (known, sd) in sd.iter().enumerate().filter_map(|(state, sd)| sd.map(|sd| (state, sd))) {
        let mut moved = start.to_vec();
        moved[known] += sd;
        let Some((at, moved)) = at.as_ref().zip(settled(&moved)) else { return Err(first) };
        for state in (0..states).filter(|state| !held[*state]) {
            all[state] = (all[state] * all[state] + (moved[state] - at[state]).powi(2)).sqrt();
        }
    }
    Ok(all)
}

/// The variance that a filter takes a sample of its one signal for, and over how long in s it estimates that, where it does either.
pub(super) fn of_one_signal(
    (experiment, at, filter): (&Experiment, &Key, &FilterTable),
    device: &Device,
    chosen: &[usize],
) -> Result<[Option<f64>; 2], ConfigError> {
    let found =
        [filter.signal_variance.as_ref().map(Quantity::si), filter.noise_memory.as_ref().map(Quantity::si)];
    let has_gain = filter.method.claims() && !filter.method.has_fixed_gain();
    let given =
        ["signal_variance", "noise_memory"].into_iter().zip(&found).find(|(_, given)| given.is_some());
    match given.and_then(|(key, _)| Some((key, refused_signal_variance(device, chosen, has_gain)?))) {
        Some((key, why)) => {
            Err(experiment.error(at.clone().child(key), ConfigFault::Value { why: why.to_owned() }))
        }
        None => Ok(found),
    }
}

/// Why a filter of these measurements has no use for a variance of its signal, where it has none.
pub(super) fn refused_signal_variance(
    device: &Device,
    chosen: &[usize],
    has_gain: bool,
) -> Option<&'static str> {
    let in_volts = |measure: &usize| {
        let named = device.measures().get(*measure);
        named.is_some_and(|named| names::kind_of(named).dimension == kind::VOLTAGE.dimension)
    };
    if chosen.len() != 1 || !chosen.iter().all(in_volts) {
        return Some("it is for a filter of one signal in V; name that in `channels`, or leave it out");
    }
    (!has_gain).then_some("this method has no gain that a variance would change; leave it out, or use `ekf`")
}

/// The measurements that a filter names.
pub(super) fn measures(
    experiment: &Experiment,
    at: &Key,
    filter: &FilterTable,
    own: &OwnDevice,
) -> Result<Vec<usize>, ConfigError> {
    let key = || at.clone().child("channels");
    let mut places = Vec::new();
    for name in &filter.channels {
        let place = own.signal_names.iter().position(|own| own == name);
        let Some(place) = place else {
            let known = own.signal_names.iter().map(String::as_str);
            return Err(experiment.error(key(), ConfigFault::unknown_word(name, known)));
        };
        if places.contains(&place) {
            let why = format!("`{name}` is named twice; a signal counts once");
            return Err(experiment.error(key(), ConfigFault::Value { why }));
        }
        places.push(place);
    }
    Ok(places)
}

/// What a method takes that follows no motion: the inverse of a measurement, or the oscillations that measurements show. What the equations
/// cannot give the method is refused.
fn without_motion(
    (experiment, at, filter): (&Experiment, &Key, &FilterTable),
    (own, sine): (&OwnDevice, Option<&QuantitySine>),
    chosen: &[usize],
) -> Result<(Option<Inverse>, Vec<MeasuredOscillation>), ConfigError> {
    let refused = |why| experiment.error(at.clone().child("method"), ConfigFault::Value { why });
    match (filter.method, chosen) {
        (Method::EulerEkf, _) if own.device.has_resets() => {
            let why = "a step of Euler's method does not find where states are set at once (`when`); use `ekf` or `ukf`";
            Err(refused(why.to_owned()))
        }
        (method, _) if method.has_fixed_gain() && own.device.has_resets() => {
            let why = "a gain for all times does not follow what is known of states that are set at once (`when`); use `ekf` or `ukf`";
            Err(refused(why.to_owned()))
        }
        (Method::DirectInversion, [measure]) => {
            Ok((Some(Inverse::of(own, *measure).map_err(refused)?), Vec::new()))
        }
        (Method::DirectInversion, _) => {
            let why = "an inversion is that of one measurement; name it".to_owned();
            Err(experiment.error(at.clone().child("channels"), ConfigFault::Value { why }))
        }
        _ => {
            let table = experiment.device_in_terms_of::<EquationsTable>()?;
            let axes = own.axes.len().max(1);
            let all = chosen.iter().flat_map(|measure| (0..axes).map(|axis| (*measure, axis)));
            let of = |place| MeasuredOscillation::of(own, &table, place);
            let all = match filter.method {
                Method::LockIn if sine.is_none() => all.map(of).collect::<Result<_, _>>().map_err(refused)?,
                // A gain that turns with the swing takes that from the signal, and so does the search for a start of several axes, where the table says
                // what a line means.
                method if method.has_fixed_gain() && own.swings() > 0 || axes > 1 => {
                    all.map(of).collect::<Result<_, _>>().unwrap_or_default()
                }
                _ => Vec::new(),
            };
            Ok((None, all))
        }
    }
}

/// The parameters that a filter may hold as uncertain: each by a factor, but for those whose deviation some filter of the
/// experiment states in the parameter's own unit, and for a number that is 0.
pub fn parameters(
    experiment: &Experiment,
    (table, device): (&EquationsTable, &Device),
) -> &'static [DeviceParameter] {
    let filters = || experiment.estimate.iter().flat_map(|estimate| &estimate.filters);
    let stated = experiment.stated_uncertain().unwrap_or_default();
    let is_added = |parameter: &kalmems_equations::Parameter| {
        let kind = names::kind_of(&parameter.named);
        let own = |filter: &FilterTable| {
            let Some(start_sd) = &filter.states.get(&*parameter.named.name)?.start_sd else {
                // No factor is taken of a number that is 0: what its table states is what it may be off by.
                let written = names::written(table, name(&parameter.named.name));
                let is_of = |number: &UncertainNumber| written.iter().any(|(key, _)| *key == number.name);
                return Some(stated.iter().any(|number| is_of(number) && number.value.si() == 0.0));
            };
            let dimension = start_sd.value().unit().dimension();
            Some(dimension != Dimension::NONE && kind.accepts(dimension))
        };
        filters().filter_map(own).any(|own| own)
    };
    let added: Vec<bool> = device.parameters().iter().map(is_added).collect();
    names::parameters((table, device), &added)
}
