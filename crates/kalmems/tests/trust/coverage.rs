//! Whether intervals of what is identified hold the truth as often as they say, and whether an experiment is better with what was found than
//! it was before. The recordings are made by programs written here, which share nothing with the models, integrators and random numbers of the
//! library.

mod accelerometer;
pub mod chance;
mod detuned;
mod gyroscope;
mod harm;
mod piston;
mod rows;
mod scanner;
mod stage;
mod threshold;
