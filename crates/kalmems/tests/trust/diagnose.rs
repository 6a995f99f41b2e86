//! Diagnoses of simulated recordings whose fault is known.

mod faults;
mod outside;
mod single;
