//! The threshold-sensing scanner: a comb senses how fast a mirror turns, and most sharply when it passes the comb.
//!
//! Chen et al., Improved Extended Kalman Filter Estimation using Threshold Signal Detection with a MEMS Electrostatic
//! Microscanner, 2019, and chapter 4 of Chen's dissertation, 2018. The current of a biased comb gives a voltage h(θ)·θ̇ whose sign changes at one angle, which stays where it is while gain
//! and resonance drift. Filters take the signal sample by sample, and the times at which that angle is passed.

pub mod device;
mod equations;
mod export;
mod hardware;
pub mod identification;

use crate::config::{ConfigError, Experiment};
use crate::equations::{OwnExport, Preset};
use crate::evaluate::Instruments;
use crate::export::ExportError;
use crate::identify::{Identification, IdentifyError};
use crate::outlook::OutlookTopic;
use crate::progress::Progress;
use crate::simulate::{SimulateError, SimulatedColumn};
use crate::{Expansion, NumberForm, OmittedNumber, Template, TemplateChannel};
use device::{PositionDetector, ThresholdScanner};
pub use hardware::ThresholdHardware;

/// The channels that an estimate needs.
const MEANINGS: [&str; 2] = ["drive", "signal"];

/// A channel that a recording may hold beside them: what a position detector shows.
const POSITION: &str = "position";

impl Preset for ThresholdScanner {
    const TEMPLATE: Template = Template {
        text: include_str!("template.toml"),
        channels: &[TemplateChannel::DRIVE, TemplateChannel::SIGNAL],
        references: &[
            TemplateChannel::ANGLE,
            TemplateChannel::RATE,
            TemplateChannel::optional(
                POSITION,
                ("the output of the position detector", "V"),
                &["psd", "position", "detector"],
            ),
        ],
    };

    const COLUMNS: [&'static [SimulatedColumn]; 2] = [
        &[
            SimulatedColumn { meaning: MEANINGS[0], column: "drive_V" },
            SimulatedColumn { meaning: MEANINGS[1], column: "cap_V" },
            SimulatedColumn { meaning: POSITION, column: "psd_V" },
        ],
        &SimulatedColumn::ANGLE_AND_RATE,
    ];

    const READS_CAPACITANCE: bool = false;

    fn expanded(&self, experiment: &Experiment) -> Result<Expansion, ConfigError> {
        Ok(equations::expanded(self, experiment))
    }

    fn instruments(&self) -> Instruments {
        let beam = self.position_detector.as_ref().map(PositionDetector::beam);
        Instruments { beam, ..Instruments::default() }
    }

    fn left_out(&self) -> Vec<OmittedNumber> {
        let number = |key, unit, step| OmittedNumber {
            key,
            unit,
            step,
            is_never_negative: false,
            form: NumberForm::Number,
            filter_switch: None,
        };
        vec![number("readout.feedthrough_capacitance", "pF", 1e-3), number("readout.offset", "mV", 0.1)]
    }

    fn exported(experiment: &Experiment, place: usize) -> Result<Option<OwnExport>, ExportError> {
        let Some(filter) = export::exported(experiment, place)? else { return Ok(None) };
        let channels = experiment.recordings.first().map(|recording| &recording.channels);
        let column = |meaning: &str| {
            channels.and_then(|channels| channels.column(meaning)).unwrap_or_default().to_owned()
        };
        Ok(Some((Box::new(filter), MEANINGS.map(column))))
    }

    fn identify(experiment: &Experiment, progress: &dyn Progress) -> Result<Identification, IdentifyError> {
        identification::identify(experiment, progress)
    }

    fn topics(experiment: &Experiment) -> Result<Vec<OutlookTopic>, SimulateError> {
        let hardware = ThresholdHardware::of(experiment)?;
        let (rate, steepest) = (hardware.mirror.resonator.natural_rate, hardware.readout.comb.steepest());
        let noise = hardware.noise_variance.sqrt();
        let flanks = OutlookTopic::new("What a crossing determines");
        let flanks = [0.15_f64, 0.05, 0.02].into_iter().fold(flanks, |topic, amplitude| {
            let rise = steepest * (amplitude * rate).powi(2);
            topic.with(
                "flank_v_per_s",
                [amplitude, rise],
                format!(
                    "At an amplitude of {amplitude} rad the signal rises by {rise:.3e} V/s where the threshold is passed: \
                     noise of one sample, {noise:.3e} V, is {:.2} µs there.",
                    1e6 * noise / rise.abs()
                ),
            )
        });
        Ok(vec![flanks])
    }
}
