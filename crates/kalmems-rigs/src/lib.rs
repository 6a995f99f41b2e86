//! The published systems, one room each, and the job that they do from end to end.
//!
//! To add one: a folder here, with its device table, and one line in [`published`]. A device can as well come from another
//! crate: whoever has a [`Workbench`] adds a rig to it.

pub mod accelerometer;
pub mod crossings;
pub mod equations;
pub mod micro_stage;
pub mod piston_mirror;
pub mod shared_scanner;
mod side_outputs;
mod source_code;
mod spikes;
mod table_file;
pub mod threshold_scanner;
pub mod workflow;

pub use kalmems_engines::rig::{
    Estimator, Expansion, NumberForm, OmittedNumber, RecordingChannels, Rig, StateDensity, Template,
    TemplateChannel, Workbench, sampling,
};

use kalmems_engines::{
    circuit, config, estimate, evaluate, export, fit, identify, inspect, outlook, progress, recording,
    signal, simulate, units,
};

use std::sync::OnceLock;

/// The published systems.
pub fn published() -> &'static Workbench {
    // A `LazyLock` would hold the function that fills it, and with it all rigs would be compiled into every test program.
    static PUBLISHED: OnceLock<Workbench> = OnceLock::new();
    PUBLISHED.get_or_init(|| {
        Workbench::new()
            .with(equations::PresetRig::<shared_scanner::device::SharedScanner>::new())
            .with(equations::PresetRig::of(&shared_scanner::SECOND_AXIS))
            .with(equations::PresetRig::<threshold_scanner::device::ThresholdScanner>::new())
            .with(equations::PresetRig::<micro_stage::device::MicroStage>::new())
            .with(equations::PresetRig::<accelerometer::device::AccelerometerTable>::new())
            .with(equations::PresetRig::<piston_mirror::device::PistonMirror>::new())
            .with(equations::EquationsRig)
    })
}
