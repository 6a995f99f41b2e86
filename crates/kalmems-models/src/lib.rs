//! The physics of MEMS devices with capacitive sensors: each law once.
//!
//! Laws are generic over the number they are computed in and, apart from that, over the number their
//! parameters are held in: with `f64` parameters and dual numbers as the angle a law gives its derivative by
//! the angle; with dual numbers as parameters too, it gives the derivative by the parameters. SI units
//! throughout.
//!
//! Nothing here knows a filter; [`kalmems_core`] knows nothing of what is here.

#![no_std]

mod bisection;
pub mod capacitance;
pub mod circuit;
pub mod constants;
pub mod control;
pub mod dynamics;
pub mod inertial;
pub mod noise;
pub mod readout;
