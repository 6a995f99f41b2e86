//! Diagnoses of simulated recordings whose fault is known.

mod coloured;
mod faults;
mod outside;
mod single;
