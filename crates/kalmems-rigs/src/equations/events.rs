//! The events of a device: where their times come from, and how filters are told of them, in SI.

use super::names;
use super::own_device::OwnDevice;
use super::table::EquationsTable;
use crate::config::{
    AnyValue, ConfigError, ConfigFault, CrossingApplication, CrossingTiming, Edge, Experiment, FilterTable,
    Key, Quantity, Sign,
};
use crate::crossings::{CrossingDelivery, CrossingLevel, DetectorSettings, RowsNeeded};
use crate::units::Kind;
use kalmems_equations::{Device, NoiseKind};

/// An event whose times are looked for.
#[derive(Clone, Copy, Debug)]
pub struct EventSettings {
    /// Its place among the device's events.
    pub event: usize,
    /// Its name.
    pub name: &'static str,
    /// Where its times come from.
    pub source: EventTimeSource,
    /// The variance of a time that is told, beside what a detector claims, in s².
    pub time_variance: f64,
    /// The variance of its expression then, in its unit².
    pub variance: f64,
    /// What its expression is then, by which all filters are judged.
    pub judged: f64,
    /// The angle in rad that is passed then, where it is told as that.
    pub passed_angle: Option<f64>,
}

/// Where the times of an event come from.
#[derive(Clone, Copy, Debug)]
pub enum EventTimeSource {
    /// From a channel of the recording: how long before its row the event was.
    Channel {
        /// The longest of these times in s; [`KNOWN_WITHIN`] if not stated.
        known_within_s: Option<f64>,
    },
    /// From a measurement that crosses a level.
    Signal {
        /// The measurement, by its place.
        measure: usize,
        /// What it crosses.
        level: CrossingLevel,
        /// Whether it falls there.
        falls: bool,
        /// How crossings are found.
        detector: DetectorSettings,
    },
}

/// How many samples after an event its time is recorded at most, where the file does not say.
const KNOWN_WITHIN: f64 = 4.0;

/// How a filter uses an event.
#[derive(Clone, Copy, Debug)]
pub struct FilterEventUse {
    /// The event, by its place among those that are looked for.
    pub event: usize,
    /// Where in time a crossing lies.
    pub timing: CrossingTiming,
    /// When the filter is told.
    pub delivery: CrossingDelivery,
    /// What the expression is then.
    pub value: f64,
    /// The variance of the expression; `None` takes that which follows from the event's time and its noise.
    pub variance: Option<f64>,
    /// The largest normalised innovation squared that is believed, where the file says one; the filter's own gate decides otherwise.
    pub gate_nis: Option<f64>,
}

impl EventSettings {
    /// The rows that are needed around the new ones for it, by these filters, in a recording of this interval in s.
    pub fn needed(&self, deliveries: impl Iterator<Item = CrossingDelivery>, interval_s: f64) -> RowsNeeded {
        match self.source {
            EventTimeSource::Channel { .. } => {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count
                let rows = (self.known_within_s(interval_s) / interval_s).ceil() as usize;
                RowsNeeded::of_rows(rows)
            }
            EventTimeSource::Signal { ref detector, .. } => {
                RowsNeeded::by(Some(detector), deliveries, interval_s)
            }
        }
    }

    /// Refuses a recording without the channel that the times come from: `places` are those of the measurements and of the events
    /// that it has.
    pub fn require_channel(
        &self,
        experiment: &Experiment,
        key: &Key,
        (measures, events): (&[usize], &[usize]),
    ) -> Result<(), ConfigError> {
        let (is_there, remedy) = match self.source {
            EventTimeSource::Channel { .. } => {
                let remedy = format!(
                    "name the column that says how long before its row the event was, such as `{0} = \"{0}_ago_s\"`, or the \
                     measurement that shows it in `[estimate.events.{0}]`",
                    self.name
                );
                (events.contains(&self.event), remedy)
            }
            EventTimeSource::Signal { measure, .. } => {
                let remedy =
                    format!("name the column of the measurement that shows the event `{}`", self.name);
                (measures.contains(&measure), remedy)
            }
        };
        if is_there { Ok(()) } else { Err(experiment.error(key.clone(), ConfigFault::MissingKey { remedy })) }
    }

    /// Whether a signal shows it.
    pub fn is_shown_by_a_signal(&self) -> bool {
        matches!(self.source, EventTimeSource::Signal { .. })
    }

    /// How long after it a channel tells of it at most, in s.
    pub fn known_within_s(&self, interval_s: f64) -> f64 {
        match self.source {
            EventTimeSource::Channel { known_within_s: Some(within_s) } => within_s,
            _ => KNOWN_WITHIN * interval_s,
        }
    }
}

/// The events whose times are looked for: those that the file says more of, and those that a filter uses.
pub fn events(experiment: &Experiment, own: &OwnDevice) -> Result<Vec<EventSettings>, ConfigError> {
    let Some(estimate) = &experiment.estimate else { return Ok(Vec::new()) };
    let device = &*own.device;
    for name in estimate.events.keys() {
        place(experiment, device, name, || Key::from("estimate.events"))?;
    }
    for (index, filter) in estimate.filters.iter().enumerate() {
        for name in filter.events.keys() {
            place(experiment, device, name, || {
                Key::from("estimate").child("filter").index(index).child("events")
            })?;
        }
    }
    let noise = device.noise(&own.values, &own.rest).map_err(|error| super::refused(experiment, &error))?;
    let size = |of: NoiseKind| noise.iter().find(|(kind, _)| *kind == of).map_or(0.0, |(_, size)| *size);
    let threshold = experiment.device_in_terms_of::<EquationsTable>()?.threshold.clone();
    let mut events = Vec::new();
    for (event, named) in device.events().iter().enumerate() {
        let uses = |filter: &FilterTable| filter.events.contains_key(&*named.name);
        let passed = threshold.as_ref().filter(|threshold| threshold.event == &*named.name);
        let of_threshold = passed.and_then(|threshold| threshold.source(estimate, own));
        if !(estimate.events.contains_key(&*named.name)
            || estimate.filters.iter().any(uses)
            || of_threshold.is_some())
        {
            continue;
        }
        let angle = passed.map(|threshold| threshold.judged_angle(estimate));
        let judged = angle.zip(passed).map_or(0.0, |(angle, threshold)| angle - threshold.angle);
        events.push(EventSettings {
            event,
            name: crate::units::name(&named.name),
            source: match of_threshold {
                Some(source) => source,
                None => source(experiment, device, &named.name)?,
            },
            time_variance: size(NoiseKind::EventTime { event }),
            variance: size(NoiseKind::Event { event }),
            judged,
            passed_angle: angle,
        });
    }
    Ok(events)
}

/// The place of an event among the device's.
fn place(
    experiment: &Experiment,
    device: &Device,
    name: &str,
    key: impl Fn() -> Key,
) -> Result<usize, ConfigError> {
    device.events().iter().position(|named| *named.name == *name).ok_or_else(|| {
        let known = device.events().iter().map(|named| &*named.name);
        experiment.error(key().child(name), ConfigFault::unknown_key(name, known))
    })
}

fn source(experiment: &Experiment, device: &Device, name: &str) -> Result<EventTimeSource, ConfigError> {
    let stated = experiment.estimate.as_ref().and_then(|estimate| estimate.events.get(name));
    let known_within_s = stated.and_then(|stated| stated.known_within.as_ref()).map(Quantity::si);
    let Some((stated, signal)) = stated.and_then(|stated| Some((stated, stated.signal.as_ref()?))) else {
        return Ok(EventTimeSource::Channel { known_within_s });
    };
    let key = |key: &str| Key::from("estimate.events").child(name).child(key);
    let Some(measure) = device.measures().iter().position(|named| *named.name == **signal) else {
        let known = device.measures().iter().map(|named| &*named.name);
        return Err(experiment.error(key("signal"), ConfigFault::unknown_word(signal, known)));
    };
    let kind = names::kind_of(&device.measures()[measure]);
    let level = stated.level.as_ref();
    let level = level.map(|level| experiment.value(key("level"), level, kind, Sign::Any)).transpose()?;
    let Some(detector) = &stated.detector else {
        // The file was refused where it states none.
        return Ok(EventTimeSource::Channel { known_within_s });
    };
    Ok(EventTimeSource::Signal {
        measure,
        level: CrossingLevel { value: level.unwrap_or(0.0), follows_mean: stated.follows_mean },
        falls: stated.edge == Some(Edge::Falling),
        detector: DetectorSettings::from(detector),
    })
}

/// How the filter at this place of the file uses the events.
pub fn uses(
    experiment: &Experiment,
    own: &OwnDevice,
    events: &[EventSettings],
    (at, filter): (&Key, &FilterTable),
) -> Result<Vec<FilterEventUse>, ConfigError> {
    let at = at.clone().child("events");
    let refuse = |key: Key, why: &str| Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }));
    if !filter.events.is_empty() && (!filter.method.claims() || filter.method.has_fixed_gain()) {
        let why = "this method has no gain by which an event could correct it; leave it out, or use `ekf`";
        return refuse(at, why);
    }
    let threshold = experiment.device_in_terms_of::<EquationsTable>()?.threshold.clone();
    let mut uses = Vec::new();
    for (place, event) in events.iter().enumerate() {
        if let Some(threshold) = threshold.as_ref().filter(|threshold| threshold.event == event.name) {
            uses.extend(filter.threshold.as_ref().map(|stated| threshold.of_filter(place, stated)));
            continue;
        }
        let Some(stated) = filter.events.get(event.name) else { continue };
        let at = at.clone().child(event.name);
        let named = &own.device.events()[event.event];
        let kind = names::kind_of(named);
        let number = |key: &str, value: &Option<AnyValue>, kind: &Kind, sign: Sign| {
            let read = |value| experiment.value(at.clone().child(key), value, kind, sign);
            value.as_ref().map(read).transpose()
        };
        let (sd, value) = (
            number("sd", &stated.sd, kind, Sign::Positive)?,
            number("value", &stated.value, kind, Sign::Any)?,
        );
        match event.source {
            EventTimeSource::Channel { .. } => {
                let of_signals = [
                    ("timing", stated.timing.is_some()),
                    ("applied", stated.applied.is_some()),
                    ("lag", stated.lag.is_some()),
                ];
                if let Some((name, _)) = of_signals.into_iter().find(|(_, given)| *given) {
                    let why = "a recorded event corrects the filter at the row in which it stands; leave this key out";
                    return refuse(at.child(name), why);
                }
                if sd.is_none() && event.time_variance == 0.0 && event.variance == 0.0 {
                    let remedy = format!(
                        "write how well its time is known, as a variance such as `{} = \"1e-14[s^2]\"`; a filter weighs it by that",
                        event.name
                    );
                    let key = Key::from("device.equations.noise").child(event.name);
                    return Err(experiment.error(key, ConfigFault::MissingKey { remedy }));
                }
            }
            EventTimeSource::Signal { .. } => {
                if stated.lag.is_some() && stated.applied == Some(CrossingApplication::InPlace) {
                    let why = "a filter that uses an event at the time of the event has no lag; leave this key out, or write `applied = \"late\"`";
                    return refuse(at.child("lag"), why);
                }
            }
        }
        uses.push(FilterEventUse {
            event: place,
            timing: stated.timing.unwrap_or_default(),
            delivery: CrossingDelivery {
                applied: stated.applied.unwrap_or_default(),
                lag_s: stated.lag.as_ref().map(Quantity::si),
            },
            value: value.unwrap_or(0.0),
            variance: sd.map(|sd| sd * sd),
            gate_nis: stated.gate.map(|sds| sds * sds),
        });
    }
    Ok(uses)
}
