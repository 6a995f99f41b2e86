//! Devices as differential equations with units, in text.
//!
//! A [`Description`] has the names and texts of a device in their order; [`Device::of`] reads them: every name is looked up,
//! every unit checked, every derivative made symbolically. A [`Motion`] and a [`ReadoutProgram`] are programs of its rates, of what
//! is measured, and of their Jacobians, which an interpreter runs over registers of `f64`. A parameter's new value needs no
//! new program.
//!
//! ```
//! use kalmems_core::Nodes;
//! use kalmems_equations::{Description, Device};
//! let text = r#"
//! [states]
//! theta = "rad"
//! omega = "rad/s"
//! [inputs]
//! V = "V"
//! [parameters]
//! J = "1.15e-14 kg m^2"
//! b = "5.95e-12 N m s"
//! k = "1.10e-4 N m"
//! C0 = "5.71 pF"
//! width = "0.2 rad"
//! Cb = "9.79 pF"
//! gain = "-0.3574 V/pF"
//! offset = "6.3945 V"
//! [let]
//! C = "gaussian_comb(theta, C0, width, Cb)"
//! [derivative]
//! theta = "omega"
//! omega = "(electrostatic_force(d(C, theta), V^2) - b*omega - k*theta)/J"
//! [measure]
//! signal = "gain*C + offset in V"
//! "#;
//! let device = Device::of(&Description::read(text)?)?;
//! let motion = device.motion(&[])?;
//! let mut work = motion.work(&device.values());
//! let (mut next, mut jacobian) = ([0.0; 2], [0.0; 4]);
//! let volts = Nodes::held(&[60.0][..]);
//! let mut tables = motion.tables();
//! // What is linear at rest is followed exactly.
//! assert!(motion.linearize(&mut work, &[0.0; 2], &[0.0], &mut next, &mut jacobian));
//! motion.set_tables(&mut tables, &jacobian, 1e-6);
//! assert!(motion.linearized_step(&mut work, &[0.1, 0.0], &volts, &tables, &mut next, &mut jacobian));
//! assert!(next[0] < 0.1 && next[1] < 0.0);
//! # Ok::<(), kalmems_equations::EquationError>(())
//! ```

mod curve;
mod description;
mod device;
mod emit;
mod energy;
mod error;
mod file;
mod graph;
mod hidden_turns;
mod laws;
mod limits;
mod modes;
mod motion;
mod numeric;
mod program;
mod quantity;
mod readout;
mod reset_path;
mod resets;
mod rest_state;
mod symmetry;
mod syntax;
mod table_end;
mod typeset;
mod vectors;

pub use description::{CurveExtension, CurvePoints, Description, Follower, NamedText, ResetText, TextPlace};
pub use device::{Device, Named, NoiseKind, Parameter};
pub use emit::{
    EmitDigits, EmitError, EmitEvent, EmitGain, EmitLanguage, EmitMeasure, EmitRequest, EmitWatch,
    EmittedFilter, FreeParameter, InputCourse, SettledGain, StateStart, StepMethod, TestSample, TestVectors,
};
pub use energy::{EnergyCheck, StatePower};
pub use error::{EquationError, EquationFault, EquationNotice};
pub use hidden_turns::StateTurn;
pub use modes::{Mode, modes, shape};
pub use motion::{MOST_STATES, Motion, StepTables};
pub use program::ProgramNumbers;
pub use readout::{Reading, ReadoutProgram};
pub use reset_path::ResetPath;
pub use resets::{CrossingDirection, ResetStep, Resets};
pub use table_end::LeftTable;
pub use vectors::{VectorElement, text_of_element, vector_elements};
