//! Records of a whole unit, gyroscopes and accelerometers, against simulations that share no code with the crate.

mod certificate;
mod example;
mod positions;
mod rates;
mod simulated;
mod temperature;
