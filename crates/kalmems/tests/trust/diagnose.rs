//! Diagnoses of simulated recordings whose fault is known.

use crate::devices;
mod faults;
mod outside;
mod single;
