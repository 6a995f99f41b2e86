//! Records of a whole unit, gyroscopes and accelerometers, against simulations that share no code with the crate.

#![allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)] // small positive counts

mod certificate;
mod checks;
mod coverage;
mod example;
mod measured;
mod positions;
mod rates;
mod refusals;
mod simulated;
mod sine;
mod temperature;
mod times;
mod turns;
mod vibration;
