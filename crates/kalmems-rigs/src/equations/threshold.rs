//! The keys of a threshold, `crossings` of an estimate and `threshold` of its filters, as an event of equations.

use super::events::{EventTimeSource, FilterEventUse};
use super::own_device::OwnDevice;
use crate::config::{
    ConfigError, ConfigFault, CrossingApplication, CrossingUse, Estimate, Experiment, FilterTable, Key,
    Method, Quantity, Variant,
};
use crate::crossings::{CrossingDelivery, CrossingLevel, DetectorSettings};

/// An event that is the passage of an angle, of a device whose own table has such keys.
#[derive(Clone, Debug)]
pub struct PassedThreshold {
    /// The event, whose expression is an angle less the one that is passed.
    pub event: &'static str,
    /// The measurement that crosses its level then.
    pub signal: &'static str,
    /// That level as it is stated, in V: the mean of the signal from one crossing to the next.
    pub level: f64,
    /// Whether the signal falls there.
    pub falls: bool,
    /// The angle that is passed, in rad.
    pub angle: f64,
}

impl PassedThreshold {
    /// How crossings are looked for; where the file asks for none all the same as soon as a filter relies on the signal, to see that this is the
    /// device's.
    pub fn source(&self, estimate: &Estimate, own: &OwnDevice) -> Option<EventTimeSource> {
        let relied_on = estimate.filters.iter().any(|filter| filter.method != Method::Model);
        let usual = || {
            own.natural_hz()
                .filter(|_| relied_on)
                .map(|natural_hz| DetectorSettings::usual(natural_hz.recip()))
        };
        let detector = estimate.crossings.as_ref().map(DetectorSettings::from).or_else(usual)?;
        let measure = own.device.measures().iter().position(|named| *named.name == *self.signal)?;
        let level = CrossingLevel { value: self.level, follows_mean: true };
        Some(EventTimeSource::Signal { measure, level, falls: self.falls, detector })
    }

    /// The angle in rad by which every filter is judged at a crossing: the first that one is told, or the device's.
    pub fn judged_angle(&self, estimate: &Estimate) -> f64 {
        let of_filters = estimate.filters.iter().find_map(|filter| filter.threshold.as_ref());
        of_filters.map_or(self.angle, |stated| self.angle_of(stated))
    }

    fn angle_of(&self, stated: &CrossingUse) -> f64 {
        stated.angle.as_ref().map_or(self.angle, Quantity::si)
    }

    /// How a filter uses the event at this place of those that are looked for.
    pub fn of_filter(&self, event: usize, stated: &CrossingUse) -> FilterEventUse {
        FilterEventUse {
            event,
            timing: stated.timing,
            delivery: CrossingDelivery {
                applied: stated.applied,
                lag_s: stated.lag.as_ref().map(Quantity::si),
            },
            value: self.angle_of(stated) - self.angle,
            variance: stated.angle_sd.as_ref().map(|sd| sd.si() * sd.si()),
            gate_nis: stated.gate.map(|sds| sds * sds),
        }
    }
}

/// Refuses keys of a threshold that contradict what a filter does.
pub fn check(experiment: &Experiment, (at, filter): (&Key, &FilterTable)) -> Result<(), ConfigError> {
    let refuse = |name: &str, why: &str| {
        Err(experiment.error(at.clone().child(name), ConfigFault::Value { why: why.to_owned() }))
    };
    let given = [("variant", filter.variant.is_some()), ("threshold", filter.threshold.is_some())];
    let has_gain = filter.method.claims() && !filter.method.has_fixed_gain();
    if let Some((name, _)) = given.into_iter().find(|(_, given)| *given && !has_gain) {
        let why = "this method takes no crossings, and every sample as the readout is stated or none; leave it out, or use `ekf`";
        return refuse(name, why);
    }
    let variant = filter.variant.unwrap_or_default();
    if variant == Variant::Literal && !filter.states.is_empty() {
        return refuse("states", "the variant `literal` has the published states alone; leave it out");
    }
    let otherwise =
        filter.signal_variance.is_some() || filter.threshold.is_some() || variant != Variant::Full;
    if filter.readout.is_some() && otherwise {
        let why = "crossings are sought in the signal as it is recorded, and every sample has to count at its worth; leave `threshold`, \
                   `variant` and `signal_variance` out, or track `offset`, `gain` and `feedthrough` in `states`";
        return refuse("readout", why);
    }
    let Some(threshold) = &filter.threshold else {
        if variant == Variant::TimingOnly {
            let why = "`timing_only` uses the crossings alone; add `threshold = { gate = 4 }`";
            return refuse("variant", why);
        }
        return Ok(());
    };
    if threshold.lag.is_some() && threshold.applied == CrossingApplication::InPlace {
        let why = "a filter that uses a crossing at the time of the crossing has no lag; leave this key out, or write `applied = \"late\"`";
        let key = at.clone().child("threshold").child("lag");
        return Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }));
    }
    if experiment.estimate.as_ref().is_some_and(|estimate| estimate.crossings.is_none()) {
        let remedy =
            "a filter uses the crossings of the threshold; write `[estimate.crossings]` with `width = \
                      \"30 us\"`, `separation = \"300 us\"` and `threshold = 4`"
                .to_owned();
        return Err(experiment.error("estimate.crossings", ConfigFault::MissingKey { remedy }));
    }
    Ok(())
}
