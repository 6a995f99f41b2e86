//! The rig: what is this device's own. All else is that of any device with a drive and a signal.

use crate::device::CombResonatorTable;
use crate::model::{CombResonator, Output};
use kalmems::config::{ExpectedEntry, Sign};
use kalmems::estimate::{DeviceParameter, StateName};
use kalmems::evaluate::ValueState;
use kalmems::rigs::{DrivenDevice, DrivenModel};
use kalmems::simulate::SimulatedColumn;
use kalmems::units::kind;

/// A comb resonator.
pub struct CombDevice;

impl DrivenDevice<3> for CombDevice {
    type Table = CombResonatorTable;
    type Motion = CombResonator<f64>;
    type Readout = Output<f64>;

    const STATES: [StateName; 3] = [
        ("deflection", "m", &kind::LENGTH),
        ("velocity", "m_per_s", &kind::VELOCITY),
        ("output", "V", &kind::VOLTAGE),
    ];
    const VALUES: &'static [ValueState] = &[
        ValueState { name: "deflection", kind: &kind::LENGTH, rate: Some("velocity") },
        ValueState { name: "velocity", kind: &kind::VELOCITY, rate: None },
        ValueState { name: "output", kind: &kind::VOLTAGE, rate: None },
    ];
    const TRUTH: &'static [SimulatedColumn] = &[
        SimulatedColumn { meaning: "deflection", column: "deflection_m" },
        SimulatedColumn { meaning: "velocity", column: "velocity_m_per_s" },
        SimulatedColumn { meaning: "output", column: "output_V" },
    ];
    const NOISE: (usize, ExpectedEntry) =
        (1, ExpectedEntry::new("velocity", &kind::VELOCITY_DRIFT, Sign::NotNegative));
    const PARAMETERS: &'static [DeviceParameter] = &[
        DeviceParameter::factor("natural_frequency").in_motion("rate").written(&[("natural_frequency", 1)]),
        DeviceParameter::volts("offset").in_readout("offset"),
    ];

    fn model(&self, table: &CombResonatorTable) -> DrivenModel<CombResonator<f64>, Output<f64>> {
        DrivenModel {
            motion: table.model(),
            readout: Output { offset: 0.0 },
            noise_variance: table.noise_variance.si(),
            natural_hz: table.natural_frequency.si(),
        }
    }
}
