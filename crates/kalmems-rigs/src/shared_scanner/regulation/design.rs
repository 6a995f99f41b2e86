//! From the file to a regulator: the motion that is wanted, its gains and its margins.

use super::super::settings::{ScannerHardware, estimate_table, state_at};
use super::drift::TemperatureDrift;
use super::filter::ObserverFilter;
use super::observer::RegulationObserver;
use crate::config::{
    ConfigError, ConfigFault, DriveSource, Experiment, Key, Quantity, RegulatedDrive, Simulate,
    TriggerDirection,
};
use crate::shared_scanner::device::SharedScanner;
use crate::simulate::{Drive, LoopMargins, RegulatedMotion};
use kalmems_core::Portable;
use kalmems_core::augmentation::AugmentationError;
use kalmems_models::control::{
    Limits, Mark, RegulatorSettings, StartUp, Tolerance, Trigger, TriggerSettings,
};
use std::f64::consts::PI;
use std::fmt;

/// What is needed to regulate the scanner that an experiment describes.
#[derive(Clone, Debug)]
pub struct Regulation {
    /// The device as the file has it.
    pub(super) hardware: ScannerHardware,
    /// The filter that observes.
    pub(super) filter: ObserverFilter,
    /// The motion that is wanted, and how it answers.
    pub motion: RegulatedMotion,
    /// What the regulator goes by.
    pub settings: RegulatorSettings<f64>,
    /// The margins of the amplitude's and of the phase's loop.
    pub margins: [LoopMargins; 2],
    /// What changes with the temperature.
    pub(super) drift: Option<TemperatureDrift>,
    /// From when on the commands are held, in s.
    pub(super) hold_from_s: Option<f64>,
    /// The trigger at work, where there is one.
    pub(super) trigger: Option<Trigger<f64>>,
    /// Where the simulated device starts.
    pub(super) start: [f64; 2],
}

/// The share of the motion's rate at which the estimate is smoothed: ripple at twice the rate is left a tenth.
const SMOOTHING: f64 = 0.2;
/// The share of the wanted amplitude from which a motion is taken over.
const CAUGHT: f64 = 0.3;
/// The share of that from which the filter starts.
const LEAST: f64 = 0.8;
/// What counts as regulated, and for how many periods of the slower loop.
const TOLERANCE: (f64, f64) = (5e-3, 0.1);
const LASTING: f64 = 0.25;
/// Samples between a signal and what it does to the drive: one to compute in, and half of the one over which frequency and
/// voltage are held.
const LATENCY: f64 = 1.5;

impl Regulation {
    /// Reads and checks what the file says.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let (simulate, regulated) = tables(experiment)?;
        let at = |name: &str| Key::from("simulate.drive.regulated").child(name);
        let wrong = |key: Key, why: String| Err(experiment.error(key, ConfigFault::Value { why }));
        let hardware = ScannerHardware::of(experiment)?;
        let device = experiment.device::<SharedScanner>()?;
        if device.circuit.is_some() {
            let why = "a regulated drive is simulated with the readout of `gain` and `offset`, not through the \
                       circuit; remove the table `circuit`";
            return wrong(Key::from("device.shared_scanner.circuit"), why.to_owned());
        }
        if device.carrier.included_in_drive {
            let why = "a drive that is computed has no carrier in it; write `false`".to_owned();
            return wrong(Key::from("device.shared_scanner.carrier.included_in_drive"), why);
        }
        let estimate = estimate_table(experiment)?;
        let Some(index) = estimate.filters.iter().position(|filter| filter.name == regulated.filter) else {
            let known: Vec<String> = estimate.filters.iter().map(|f| format!("`{}`", f.name)).collect();
            let why = format!(
                "no `[[estimate.filter]]` has the name `{}`; there are: {}",
                regulated.filter,
                known.join(", ")
            );
            return wrong(at("filter"), why);
        };
        let filter = ObserverFilter::of(experiment, estimate, &hardware, (index, at("filter")))?;
        let offset = regulated.offset.si();
        let wanted = (regulated.amplitude.si(), regulated.phase.as_ref().map_or(0.0, Quantity::si));
        let voltage =
            Limits { lowest: regulated.lowest_voltage.si(), highest: regulated.highest_voltage.si() };
        let motion =
            RegulatedMotion::of(&hardware.scanner, offset, wanted, [voltage.lowest, voltage.highest]);
        let Some(motion) = motion else {
            let why = format!(
                "no voltage between `{}` and `{}` keeps up a motion of `{}` at this phase; change them, or the offset",
                regulated.lowest_voltage.text(),
                regulated.highest_voltage.text(),
                regulated.amplitude.text()
            );
            return wrong(at("amplitude"), why);
        };
        let sweep_hz = [regulated.from.si(), regulated.to.si()];
        if !(sweep_hz[1]..sweep_hz[0]).contains(&motion.drive_hz) {
            let why = format!(
                "the wanted motion needs a drive of {:.1} Hz, which does not lie between `to` and `from`",
                motion.drive_hz
            );
            return wrong(at("from"), why);
        }
        let settings = settings(simulate, regulated, &motion);
        let trigger = trigger(simulate, regulated, &motion)
            .map_err(|why| experiment.error(at("trigger").child("lead"), ConfigFault::Value { why }))?;
        let delay_s = LATENCY * settings.interval;
        let margins =
            motion.margins(&[settings.amplitude_loop, settings.phase_loop], settings.smoothing_rate, delay_s);
        Ok(Self {
            start: state_at(experiment, "simulate.start", &simulate.start)?,
            hardware,
            filter,
            motion,
            settings,
            margins,
            drift: simulate.temperature.as_ref().map(TemperatureDrift::of),
            hold_from_s: regulated.hold_from.as_ref().map(Quantity::si),
            trigger,
        })
    }

    /// The filter that observes at this interval, before its first sample.
    pub fn observer(&self, interval_s: f64) -> Result<RegulationObserver, AugmentationError> {
        RegulationObserver::new(&self.hardware, &self.filter, interval_s, LEAST * self.settings.start.caught)
    }

    /// The drive that keeps up the wanted motion.
    pub fn expected_drive(&self) -> Drive {
        Drive::Sine {
            offset: self.settings.offset,
            amplitude: self.motion.voltage,
            frequency_hz: self.motion.drive_hz,
            phase_rad: 0.0,
        }
    }
}

/// Parameters that the observing filter tracks at most.
pub const MOST: usize = 4;

fn tables(experiment: &Experiment) -> Result<(&Simulate, &RegulatedDrive), ConfigError> {
    let Some(simulate) = &experiment.simulate else {
        let remedy = "add the table `[simulate]` with `[simulate.drive.regulated]`".to_owned();
        return Err(experiment.error("simulate", ConfigFault::MissingKey { remedy }));
    };
    if let DriveSource::Regulated(regulated) = &simulate.drive {
        return Ok((simulate, regulated));
    }
    let why = "the drive is not a regulated one; write `[simulate.drive.regulated]`".to_owned();
    Err(experiment.error("simulate.drive", ConfigFault::Value { why }))
}

fn settings(
    simulate: &Simulate,
    regulated: &RegulatedDrive,
    motion: &RegulatedMotion,
) -> RegulatorSettings<f64> {
    let (amplitude_hz, phase_hz) = (regulated.amplitude_bandwidth.si(), regulated.phase_bandwidth.si());
    let [amplitude_loop, phase_loop] = motion.controllers(amplitude_hz, phase_hz);
    let [from, to] =
        [&regulated.from, &regulated.to].map(|frequency| RegulatorSettings::rate_of(frequency.si()));
    let (relative, degrees) = TOLERANCE;
    RegulatorSettings {
        interval: 1.0 / simulate.sampling_rate.si(),
        amplitude: motion.amplitude,
        phase: motion.phase,
        phase_loop,
        amplitude_loop,
        smoothing_rate: SMOOTHING * PI * motion.drive_hz,
        offset: regulated.offset.si(),
        rate: Limits { lowest: to - 0.5 * (from - to), highest: from + 0.5 * (from - to) },
        voltage: Limits { lowest: regulated.lowest_voltage.si(), highest: regulated.highest_voltage.si() },
        start: StartUp {
            from,
            to,
            slope: (from - to) / regulated.sweep.si(),
            voltage: regulated.highest_voltage.si(),
            caught: CAUGHT * motion.amplitude,
            climb: motion.amplitude * amplitude_hz,
        },
        tolerance: Tolerance {
            amplitude: relative,
            phase: degrees.to_radians(),
            lasting: LASTING / amplitude_hz.min(phase_hz),
        },
    }
}

fn trigger(
    simulate: &Simulate,
    regulated: &RegulatedDrive,
    motion: &RegulatedMotion,
) -> Result<Option<Trigger<f64>>, String> {
    let Some(output) = &regulated.trigger else { return Ok(None) };
    let mark = match output.direction {
        TriggerDirection::Rising => Mark::Rising,
        TriggerDirection::Falling => Mark::Falling,
    };
    let settings = TriggerSettings {
        interval: 1.0 / simulate.sampling_rate.si(),
        rate: PI * motion.drive_hz,
        mark,
        lead: output.lead.si(),
        least_amplitude: CAUGHT * motion.amplitude,
    };
    Trigger::new(settings).map(Some).map_err(|why| format!("`{}`: {why}", output.lead.text()))
}

impl fmt::Display for Regulation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let RegulatedMotion { amplitude, phase, voltage, drive_hz, fold, .. } = &self.motion;
        writeln!(
            f,
            "wanted: {:.3} deg at a phase of {:.2} deg, which {:.2} V at {drive_hz:.1} Hz keep up",
            amplitude.to_degrees(),
            phase.to_degrees(),
            voltage
        )?;
        if let Some(fold) = fold {
            writeln!(
                f,
                "at this voltage the branch of large motions ends {:.1} Hz below, {:.1} deg of phase away",
                drive_hz - fold.drive_hz,
                (phase - fold.phase).to_degrees()
            )?;
        }
        let [[aa, ap], [pa, pp]] = self.motion.flow;
        let [ga, gp] = self.motion.by_voltage;
        writeln!(
            f,
            "small changes, amplitude relative and phase in rad: {aa:.0} {ap:+.0}, {pa:.0} {pp:+.0} per s; by volt {ga:.2}, \
             {gp:.2} per s"
        )?;
        for (index, name) in ["amplitude", "phase"].into_iter().enumerate() {
            let LoopMargins { crossover_hz, phase, gain } = self.margins[index];
            let gain = if gain.is_finite() {
                format!("{:.0} dB", 20.0 * gain.portable_log10())
            } else {
                "any".to_owned()
            };
            let end = if index == 0 { "\n" } else { "" };
            write!(
                f,
                "{name} loop: crossover {crossover_hz:.0} Hz, phase margin {:.0} deg, gain margin {gain}{end}",
                phase.to_degrees()
            )?;
        }
        Ok(())
    }
}
