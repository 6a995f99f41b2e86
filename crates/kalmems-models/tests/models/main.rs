//! The models against closed forms and second methods.

mod accelerometer;
mod accelerometer_loop;
mod accelerometer_matched;
mod augmentation;
#[path = "../../../kalmems-core/tests/chance/mod.rs"]
mod chance;
mod circuit;
mod crossings;
mod delay;
mod inertial;
mod laws;
mod micro_stage;
mod piston;
mod regulated_scanner;
mod regulator;
mod threshold;
mod tilting_plate;
mod trigger;
mod two_axis;
