//! What the rig takes from the tables of filters, in SI.

use super::hardware::ThresholdHardware;
use super::settings::{state_at, states};
use crate::config::{
    ConfigError, ConfigFault, CrossingApplication, CrossingTiming, Estimate, ExpectedEntry, Experiment,
    FilterStart, Key, Method, Quantity, Sign, Variant,
};
use crate::crossings::CrossingDelivery;
use crate::estimate::{
    DeviceParameter, FilterBasics, MeanAndCovariance, StateName, StatePrior, process_noise,
    refuse_demodulator,
};
use crate::units::kind;

/// What one `[[estimate.filter]]` says: how the filter takes signal and crossings, where it starts, and its process noise.
#[derive(Clone, Debug)]
pub struct ThresholdFilterSettings {
    /// What every filter has.
    pub basics: FilterBasics,
    /// How it takes the signal.
    pub variant: Variant,
    /// The variance of a sample that it reckons with, in V².
    pub signal_variance: f64,
    /// How it uses the crossings, if it does.
    pub threshold: Option<ThresholdSettings>,
    /// Angle in rad and rate in rad/s to start from, 0 where they come from the signal and for the lock-in.
    pub start: [f64; 2],
    /// Their standard deviations, 0 for what claims none; with a start from the signal how far from rest they may be, 0 where that is not
    /// known.
    pub start_sd: [f64; 2],
    /// Whether the start comes from the signal.
    pub from_signal: bool,
    /// The density of the angular acceleration's noise, in rad²/s³.
    pub acceleration_density: f64,
}

/// How a filter uses the crossings.
#[derive(Clone, Copy, Debug)]
pub struct ThresholdSettings {
    /// Where in time a crossing lies.
    pub timing: CrossingTiming,
    /// When the filter is told.
    pub delivery: CrossingDelivery,
    /// The angle in rad.
    pub angle: f64,
    /// Its standard deviation in rad; `None` takes that which follows from the crossing's time.
    pub angle_sd: Option<f64>,
    /// The largest normalised innovation squared that is believed.
    pub gate_nis: Option<f64>,
}

/// The name of the capacitance that the drive reaches the signal through.
pub const FEEDTHROUGH: &str = "feedthrough";

/// All of them.
pub static PARAMETERS: [DeviceParameter; 4] = [
    DeviceParameter::factor("gain").in_readout("comb.gain").written(&[("comb.gain", 1)]),
    DeviceParameter::volts("offset").in_readout("offset").written(&[("readout.offset", 1)]),
    DeviceParameter::factor("natural_frequency")
        .in_motion("resonator.natural_rate")
        .written(&[("resonator.natural_frequency", 1)]),
    DeviceParameter::factor(FEEDTHROUGH).written(&[("readout.feedthrough_capacitance", 1)]),
];

/// What a deviation of 1 adds to each of them.
fn scales(hardware: &ThresholdHardware) -> [f64; 4] {
    [hardware.readout.comb.gain, 1.0, hardware.mirror.resonator.natural_rate, hardware.feedthrough]
}

/// The states of the motion, as trajectories name them.
const MOTION: [StateName; 2] = [("angle", "rad", &kind::ANGLE), ("rate", "rad_per_s", &kind::ANGULAR_RATE)];

/// The density of its process noise.
pub const NOISE: [ExpectedEntry; 1] =
    [ExpectedEntry::new("angular_acceleration", &kind::ANGULAR_ACCELERATION_DENSITY, Sign::NotNegative)];

impl ThresholdFilterSettings {
    /// Reads and checks the filter at this place of the file.
    pub fn of(
        experiment: &Experiment,
        estimate: &Estimate,
        hardware: &ThresholdHardware,
        index: usize,
    ) -> Result<Self, ConfigError> {
        let filter = &estimate.filters[index];
        let at = Key::from("estimate").child("filter").index(index);
        let refuse = |name: &str, why: &str| {
            Err(experiment.error(at.clone().child(name), ConfigFault::Value { why: why.to_owned() }))
        };
        let claims = filter.method.claims();
        refuse_demodulator(experiment, (&at, filter), "this device has no demodulator; leave it out")?;
        let start = match &filter.start {
            Some(FilterStart::Values(start)) => Some(state_at(experiment, at.clone().child("start"), start)?),
            Some(FilterStart::FromSignal) | None => None,
        };
        let variant = filter.variant.unwrap_or_default();
        let more = [
            ("variant", filter.variant.is_some()),
            ("signal_variance", filter.signal_variance.is_some()),
            ("threshold", filter.threshold.is_some()),
        ];
        if let Some((name, _)) = more.into_iter().find(|(_, given)| *given)
            && (!claims || filter.method.has_fixed_gain())
        {
            let why = "this method takes no crossings, and every sample as the readout is stated or none; leave it out, or use `ekf`";
            return refuse(name, why);
        }
        if let Some(threshold) = &filter.threshold
            && threshold.lag.is_some()
            && threshold.applied == CrossingApplication::InPlace
        {
            let why = "a filter that uses a crossing at the time of the crossing has no lag; leave this key out, or write `applied = \"late\"`";
            let key = at.clone().child("threshold").child("lag");
            return Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }));
        }
        if variant == Variant::Literal && !filter.states.is_empty() {
            return refuse("states", "the variant `literal` has the published states alone; leave it out");
        }
        if variant == Variant::TimingOnly && filter.threshold.is_none() {
            return refuse(
                "variant",
                "`timing_only` uses the crossings alone; add `threshold = { gate = 4 }`",
            );
        }
        let otherwise =
            filter.signal_variance.is_some() || filter.threshold.is_some() || variant != Variant::Full;
        if filter.readout.is_some() && otherwise {
            let why = "crossings are sought in the signal as it is recorded, and every sample has to count at its worth; leave `threshold`, \
                       `variant` and `signal_variance` out, or track `offset`, `gain` and `feedthrough` in `states`";
            return refuse("readout", why);
        }
        let start_sd = if claims && !filter.start_sd.is_empty() {
            experiment.values(at.clone().child("start_sd"), &filter.start_sd, states(Sign::Positive))?
        } else {
            [0.0; 2]
        };
        let (noise_key, noise) = process_noise(experiment, &at, filter)?;
        let [acceleration_density] = if claims { experiment.values(noise_key, noise, NOISE)? } else { [0.0] };
        let mut basics = FilterBasics::of(experiment, &at, filter, (&PARAMETERS, &scales(hardware)))?;
        if variant == Variant::Literal {
            // Its gain is not that of its innovations: these are larger than it claims when nothing is wrong with a sample.
            basics.taking.largest_nis = None;
        }
        Ok(Self {
            basics,
            variant,
            signal_variance: filter.signal_variance.as_ref().map_or(hardware.noise_variance, Quantity::si),
            threshold: filter.threshold.as_ref().map(|threshold| ThresholdSettings {
                timing: threshold.timing,
                delivery: CrossingDelivery {
                    applied: threshold.applied,
                    lag_s: threshold.lag.as_ref().map(Quantity::si),
                },
                angle: threshold.angle.as_ref().map_or(hardware.readout.comb.centre, Quantity::si),
                angle_sd: threshold.angle_sd.as_ref().map(Quantity::si),
                gate_nis: threshold.gate.map(|sds| sds * sds),
            }),
            from_signal: start.is_none() && filter.method != Method::LockIn,
            start: start.unwrap_or_default(),
            start_sd,
            acceleration_density,
        })
    }

    /// The names of its states.
    pub fn states(&self) -> Vec<StateName> {
        self.basics.states(&MOTION)
    }

    /// What is known of its states before a start from the signal: how far from rest they may be, where the file says that.
    pub fn prior(&self) -> Vec<StatePrior> {
        let from_rest = |sd: &f64| self.from_signal && *sd > 0.0;
        let motion = self.start_sd.map(|sd| StatePrior { mean: 0.0, sd: Some(sd).filter(from_rest) });
        motion.into_iter().chain(self.basics.priors()).collect()
    }

    /// What the file says of its states at the first sample.
    pub fn start(&self) -> MeanAndCovariance {
        let motion = self.start.into_iter().zip(self.start_sd);
        MeanAndCovariance::apart(
            motion.chain(self.basics.parameters().iter().map(|tracked| (0.0, tracked.sd))),
        )
    }
}
