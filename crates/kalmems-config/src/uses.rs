//! What of an experiment file a device has a use for.

use super::{ConfigError, ConfigFault, Experiment, FilterTable, Key, Method};
use crate::units::kind;

/// What of an experiment file a device has a use for, beyond what every device has; the rest is refused where it is given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(clippy::struct_excessive_bools)] // each is for keys of its own
pub struct DeviceUses {
    /// The keys about crossings of a threshold: `crossings` of the estimate, `variant` and `threshold` of a filter.
    pub crossings: bool,
    /// `parts` of the estimate: the device has an angle, whose errors are told in parts.
    pub angles: bool,
    /// A filter's `signal_variance`.
    pub signal_variance: bool,
    /// A filter's `start_about`: its search for a start begins wherever the file says.
    pub start_about: bool,
    /// The tables `events` of the estimate and of a filter: the device has events.
    pub events: bool,
    /// A filter's `channels`: the device has several signals.
    pub several_signals: bool,
    /// The methods of filters that it has no use for, and why, as physics has it.
    pub no_methods: &'static [(Method, &'static str)],
    /// Whether a filter's `readout` is of a capacitance, and not of a voltage.
    pub reads_capacitance: bool,
    /// Whether there is no `readout` of a filter: the device's equations say all of it.
    pub states_readout: bool,
    /// A filter's `noise_memory`, `known` and `known_acceleration`: the device is one of equations.
    pub equations: bool,
    /// The dither of a simulation, which is added to a feedback.
    pub feedback: bool,
    /// The `channels` of a simulation: its measurements have names of their own.
    pub simulated_channels: bool,
}

impl DeviceUses {
    /// Refuses what is given and of no use: the first of it.
    pub fn check(self, experiment: &Experiment) -> Result<(), ConfigError> {
        let refuse =
            |key: Key, why: &str| Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }));
        if let Some(key) = self.crossing_key(experiment) {
            return refuse(key, "it is for a device whose signal passes a threshold; leave it out");
        }
        if !self.angles && experiment.estimate.as_ref().is_some_and(|estimate| estimate.parts.is_some()) {
            let why = "this device has no angle whose error has parts; leave it out";
            return refuse(Key::from("estimate.parts"), why);
        }
        if let Some(key) = self.event_key(experiment) {
            return refuse(
                key,
                "it is for a device that states events in `[device.equations.events]`; leave it out",
            );
        }
        let filters = experiment.estimate.iter().flat_map(|estimate| &estimate.filters);
        for (index, filter) in filters.enumerate() {
            let key = |name: &str| Key::from("estimate").child("filter").index(index).child(name);
            if !(self.several_signals || filter.channels.is_empty()) {
                return refuse(key("channels"), "this device has one signal; leave it out");
            }
            let refused = self.no_methods.iter().find(|(method, _)| *method == filter.method);
            if let Some((method, why)) = refused {
                let why = format!("the method `{}` is not for this device: {why}", method.word());
                return refuse(key("method"), &why);
            }
            if !(self.start_about || filter.start_about.is_empty()) {
                let why = "the start of this device is looked for without it; leave it out";
                return refuse(key("start_about"), why);
            }
            if filter.signal_variance.is_some() && !self.signal_variance {
                let why = "this device takes each sample for the noise that its readout states; leave it out";
                return refuse(key("signal_variance"), why);
            }
            if let Some(readout) = &filter.readout {
                if self.states_readout {
                    let why = "of a device of equations the readout is in `measure`: write the offset, the line or the feedthrough there as parameters, \
                               which `states` can name, and coloured noise as a state of its own; leave it out";
                    return refuse(key("readout"), why);
                }
                let sizes = readout.offset.iter().map(|offset| &offset.start_sd);
                let sizes = sizes.chain(readout.lines.iter().map(|line| &line.start_sd));
                let mut sizes = sizes.chain(readout.coloured_noise.iter().map(|noise| &noise.sd));
                let (kind, name) = if self.reads_capacitance {
                    (&kind::CAPACITANCE, "a capacitance, such as `1 aF`")
                } else {
                    (&kind::VOLTAGE, "a voltage, such as `10 mV`")
                };
                if sizes.any(|size| !kind.accepts(size.value().unit().dimension())) {
                    let why = format!(
                        "its signal is recorded as {name}; expected an offset, lines and coloured noise of that kind"
                    );
                    return refuse(key("readout"), &why);
                }
            }
            if self.equations {
                continue;
            }
            if filter.noise_memory.is_some() {
                let why = "no filter of this device estimates the variance of a sample; leave it out";
                return refuse(key("noise_memory"), why);
            }
            let (known, mut names) = filter.known_states();
            if names.next().is_some() {
                return refuse(key(known), "no filter of this device is given a state; leave it out");
            }
        }
        let dithered = experiment.simulate.as_ref().is_some_and(|simulate| simulate.dither.is_some());
        if dithered && !self.feedback {
            let why = "a dither is added to the feedback of a device, and there is none; leave it out, or describe a feedback \
                       in the device's table";
            return refuse(Key::from("simulate.dither"), why);
        }
        let named = experiment.simulate.as_ref().is_some_and(|simulate| !simulate.channels.is_empty());
        if named && !self.simulated_channels {
            let why = "it is for a device that equations describe; leave it out, or write the device as equations \
                       (`kalmems expand`)";
            return refuse(Key::from("simulate.channels"), why);
        }
        Ok(())
    }

    /// A key about crossings that is given and of no use.
    fn crossing_key(self, experiment: &Experiment) -> Option<Key> {
        let estimate = experiment.estimate.as_ref().filter(|_| !self.crossings)?;
        let at = Key::from("estimate");
        let of_all = estimate.crossings.is_some().then(|| at.clone().child("crossings"));
        let of_filter = |(index, filter): (usize, &FilterTable)| {
            let given = [("variant", filter.variant.is_some()), ("threshold", filter.threshold.is_some())];
            let at = at.clone().child("filter").index(index);
            given.into_iter().find(|(_, given)| *given).map(|(name, _)| at.child(name))
        };
        of_all.or_else(|| estimate.filters.iter().enumerate().find_map(of_filter))
    }

    /// A key about events that is given and of no use.
    fn event_key(self, experiment: &Experiment) -> Option<Key> {
        let estimate = experiment.estimate.as_ref().filter(|_| !self.events)?;
        let at = Key::from("estimate");
        let mut filters = estimate.filters.iter().enumerate();
        let of_filter = |(index, filter): (usize, &FilterTable)| {
            (!filter.events.is_empty()).then(|| at.clone().child("filter").index(index).child("events"))
        };
        let of_all = (!estimate.events.is_empty()).then(|| at.clone().child("events"));
        of_all.or_else(|| filters.find_map(of_filter))
    }
}
