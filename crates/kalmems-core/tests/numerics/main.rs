//! The filter core against closed forms, second methods and published numbers.

mod adaptation;
mod augmentation;
mod bounds;
#[path = "../chance/mod.rs"]
mod chance;
mod consistency;
mod continuous_discrete;
mod decimation;
mod detection;
mod detection_reference;
mod discretization;
mod filters;
mod iterated;
mod late;
mod long_run;
mod math;
mod nile;
mod portable;
mod scaling;
mod schmidt;
mod sequential;
mod smoothers;
mod square_root;
mod steady_state;
