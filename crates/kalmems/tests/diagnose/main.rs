//! Diagnoses of simulated recordings whose fault is known.

#[path = "../verdict/devices.rs"]
#[allow(dead_code)] // what is judged there is another question
mod devices;
mod faults;
mod outside;
mod single;
