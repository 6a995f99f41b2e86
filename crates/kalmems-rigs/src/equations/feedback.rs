//! Inputs of a simulated device that follow its measurements: a loop that is closed at each sample.

use super::names;
use super::own_device::OwnDevice;
use crate::config::{ConfigError, ConfigFault, DriveSource, Experiment, InputSource, Key, Sign, Simulate};
use crate::simulate::Drive;

/// An input that follows a measurement from sample to sample.
pub struct Loop {
    input: usize,
    measure: usize,
    /// What is applied with the sign of the measurement, in a loop of one bit.
    one_bit: Option<f64>,
}

impl Loop {
    /// Puts what follows from the samples of a row into the inputs, until the next row; a row without a sample leaves it as it is.
    pub fn answer(&self, measured: &[f64], drives: &mut [Drive]) {
        let Some(value) = measured.get(self.measure).filter(|value| value.is_finite()) else { return };
        let level = self.one_bit.map_or(*value, |level| if *value < 0.0 { -level } else { level });
        if let Some(drive) = drives.get_mut(self.input) {
            *drive = Drive::Constant { level };
        }
    }
}

/// The loops of a simulation.
pub fn loops(
    experiment: &Experiment,
    simulate: &Simulate,
    own: &OwnDevice,
) -> Result<Vec<Loop>, ConfigError> {
    let DriveSource::Inputs(sources) = &simulate.drive else { return Ok(Vec::new()) };
    let device = &own.device;
    let one = |(input, named): (usize, &kalmems_equations::Named)| {
        let Some(InputSource::Feedback(source)) = sources.get(&*named.name) else { return Ok(None) };
        let key = Key::from("simulate.drive.inputs").child(&named.name).child("feedback");
        let measures = device.measures();
        let Some(measure) = measures.iter().position(|measure| *measure.name == *source.of) else {
            let known = measures.iter().map(|measure| &*measure.name);
            return Err(experiment.error(key.child("of"), ConfigFault::unknown_word(&source.of, known)));
        };
        let (kind, seen) = (names::kind_of(named), names::kind_of(&measures[measure]));
        if kind.dimension != seen.dimension && source.one_bit.is_none() {
            let why = format!(
                "`{}` is measured in {}, and the input `{}` is in {}; write a measurement in the unit of the input, with the law of the \
                 controller",
                source.of, measures[measure].unit_text, named.name, named.unit_text
            );
            return Err(experiment.error(key.child("of"), ConfigFault::Value { why }));
        }
        let level = |value| experiment.value(key.clone().child("one_bit"), value, kind, Sign::Positive);
        Ok(Some(Loop { input, measure, one_bit: source.one_bit.as_ref().map(level).transpose()? }))
    };
    device.inputs().iter().enumerate().filter_map(|found| one(found).transpose()).collect()
}
