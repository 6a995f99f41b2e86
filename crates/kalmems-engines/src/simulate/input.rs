//! The inputs of a device as the experiment file describes them, each in its own unit.

use super::source::read;
use super::{Drive, Interruptions, SimulateError, Tone};
use crate::config::{
    AnyValue, CaptureDrive, ConfigError, ConfigFault, Experiment, InputSource, Key, PowerCut, Quantity, Sign,
    Simulate, SquareInput,
};
use crate::recording::RecordingSource;
use crate::units::Kind;

/// One input, ready to drive a device.
#[derive(Clone, Debug)]
pub struct SimulatedInput {
    /// Its course, in SI.
    pub drive: Drive,
    /// The file that it comes from, if it comes from one.
    pub source: Option<RecordingSource>,
    /// For how long before the recording it moves the device, in s.
    pub before_s: f64,
}

/// An input of this name and kind, as `[simulate.drive.inputs]` describes it.
pub fn input_of(
    experiment: &Experiment,
    simulate: &Simulate,
    (name, kind): (&str, &'static Kind),
    source: &InputSource,
) -> Result<SimulatedInput, SimulateError> {
    let place = InputPlace { experiment, key: Key::from("simulate.drive.inputs").child(name), kind };
    let mut before_s = 0.0;
    let drive = match source {
        // A loop is closed by whoever simulates the device.
        InputSource::None | InputSource::Feedback(_) => Drive::Constant { level: 0.0 },
        InputSource::Constant(constant) => {
            Drive::Constant { level: place.value("constant.value", &constant.value, Sign::Any)? }
        }
        InputSource::Sine(sine) => {
            let drive = Drive::Sine {
                offset: place.or_zero("sine.offset", sine.offset.as_ref())?,
                amplitude: place.value("sine.amplitude", &sine.amplitude, Sign::NotNegative)?,
                frequency_hz: sine.frequency.si(),
                phase_rad: sine.phase.as_ref().map_or(0.0, Quantity::si),
            };
            place.cut_off("sine.cut_off", drive, sine.cut_off.as_ref())?
        }
        InputSource::Square(square) => square_of(&place, simulate, square)?,
        InputSource::Sweep(sweep) => {
            let begins_s = sweep.begins.as_ref().map_or(0.0, Quantity::si);
            let duration_s =
                sweep.lasting.as_ref().map_or_else(|| simulate.duration.si() - begins_s, Quantity::si);
            if duration_s <= 0.0 {
                let why = "it begins after the end of the recording; state an earlier time".to_owned();
                return Err(place.refused("sweep.begins", why).into());
            }
            if let Some(Err(why)) = sweep.begins.as_ref().map(|begins| simulate.may_precede(begins)) {
                return Err(place.refused("sweep.begins", why).into());
            }
            before_s = (-begins_s).max(0.0);
            let drive = Drive::Sweep {
                offset: place.or_zero("sweep.offset", sweep.offset.as_ref())?,
                amplitude: place.value("sweep.amplitude", &sweep.amplitude, Sign::NotNegative)?,
                from_hz: sweep.from.si(),
                to_hz: sweep.to.si(),
                duration_s,
            };
            let drive =
                if begins_s == 0.0 { drive } else { Drive::Late { drive: Box::new(drive), by_s: begins_s } };
            place.cut_off("sweep.cut_off", drive, sweep.cut_off.as_ref())?
        }
        InputSource::Tones(sum) => {
            let tone = |(place_of, tone): (usize, &crate::config::InputTone)| {
                let key = place.key.clone().child("tones").child("tone").index(place_of).child("amplitude");
                Ok::<_, ConfigError>(Tone {
                    amplitude: experiment.value(key, &tone.amplitude, kind, Sign::NotNegative)?,
                    frequency_hz: tone.frequency.si(),
                    phase_rad: tone.phase.as_ref().map_or(0.0, Quantity::si),
                })
            };
            let tones = sum.tone.iter().enumerate().map(tone).collect::<Result<_, _>>()?;
            Drive::Tones { offset: place.or_zero("tones.offset", sum.offset.as_ref())?, tones }
        }
        InputSource::Steps(steps) => {
            let key = |place_of: usize| place.key.clone().child("steps").child("step").index(place_of);
            let mut times: Vec<(f64, f64)> = Vec::new();
            for (place_of, step) in steps.step.iter().enumerate() {
                let value = experiment.value(key(place_of).child("value"), &step.value, kind, Sign::Any)?;
                if times.last().is_some_and(|(before_s, _)| *before_s >= step.at.si()) {
                    let why = format!(
                        "`{}` is not later than the jump before it; write them in order",
                        step.at.text()
                    );
                    return Err(experiment
                        .error(key(place_of).child("at"), ConfigFault::Value { why })
                        .into());
                }
                times.push((step.at.si(), value));
            }
            Drive::Steps { first: place.or_zero("steps.first", steps.first.as_ref())?, steps: times }
        }
        InputSource::RingDown(before) => {
            before_s = before.lasting.si();
            let sine = Drive::Sine {
                offset: place.or_zero("ring_down.offset", before.offset.as_ref())?,
                amplitude: place.value("ring_down.amplitude", &before.amplitude, Sign::NotNegative)?,
                frequency_hz: before.frequency.si(),
                phase_rad: 0.0,
            };
            let level = place.or_zero("ring_down.then", before.then.as_ref())?;
            Drive::Switched { at_s: 0.0, before: Box::new(sine), after: Box::new(Drive::Constant { level }) }
        }
        InputSource::Recorded(recorded) => {
            let key = place.key.clone().child("recorded").child("file");
            let (drive, source) = read((experiment, key), simulate, recorded, kind)?;
            return Ok(SimulatedInput { drive, source: Some(source), before_s });
        }
    };
    Ok(SimulatedInput { drive, source: None, before_s })
}

/// The drive that catches a resonance by a sweep and holds it there, until the recording begins and from then on.
pub fn captured(capture: &CaptureDrive) -> SimulatedInput {
    let half = 0.5 * capture.voltage.si();
    let (sweep_s, before_s) = (capture.sweep.si(), capture.sweep.si() + capture.hold.si());
    let sweep = Drive::Sweep {
        offset: half,
        amplitude: half,
        from_hz: capture.from.si(),
        to_hz: capture.to.si(),
        duration_s: sweep_s,
    };
    let late = Drive::Late { drive: Box::new(sweep), by_s: -before_s };
    let drive = match &capture.cut_off {
        None => late,
        Some(cut_off) => Drive::Interrupted { drive: Box::new(late), off: Interruptions::from(cut_off) },
    };
    SimulatedInput { drive, source: None, before_s }
}

/// A square wave that is integrated as often as it changes, in SI.
fn square_of(place: &InputPlace, simulate: &Simulate, square: &SquareInput) -> Result<Drive, SimulateError> {
    if square.duty_cycle.si() >= 1.0 {
        let why = format!("`{}` is not below 1; expected a part, such as `50 %`", square.duty_cycle.text());
        return Err(place.refused("square.duty_cycle", why).into());
    }
    if let Err(why) = simulate.resolves_square(&square.frequency) {
        return Err(place.refused("square.frequency", why).into());
    }
    Ok(Drive::Square {
        low: place.value("square.low", &square.low, Sign::Any)?,
        high: place.value("square.high", &square.high, Sign::Any)?,
        frequency_hz: square.frequency.si(),
        duty: square.duty_cycle.si(),
    })
}

/// Where in the file an input stands, and what its values are.
struct InputPlace<'a> {
    experiment: &'a Experiment,
    key: Key,
    kind: &'static Kind,
}

impl InputPlace<'_> {
    /// A key below it, from names joined by dots.
    fn key(&self, names: &str) -> Key {
        names.split('.').fold(self.key.clone(), Key::child)
    }

    fn refused(&self, names: &str, why: String) -> ConfigError {
        self.experiment.error(self.key(names), ConfigFault::Value { why })
    }

    fn value(&self, names: &str, value: &AnyValue, sign: Sign) -> Result<f64, ConfigError> {
        self.experiment.value(self.key(names), value, self.kind, sign)
    }

    fn or_zero(&self, names: &str, value: Option<&AnyValue>) -> Result<f64, ConfigError> {
        value.map_or(Ok(0.0), |value| self.value(names, value, Sign::Any))
    }

    fn cut_off(&self, names: &str, drive: Drive, cut_off: Option<&PowerCut>) -> Result<Drive, ConfigError> {
        let Some(cut_off) = cut_off else { return Ok(drive) };
        if let Err((name, why)) = cut_off.check() {
            return Err(self.refused(&format!("{names}.{name}"), why));
        }
        Ok(Drive::Interrupted { drive: Box::new(drive), off: Interruptions::from(cut_off) })
    }
}
