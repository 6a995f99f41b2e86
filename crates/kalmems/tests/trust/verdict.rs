//! The verdict on simulated recordings: of filters that are told what is true, and of filters that are told something wrong.

mod calibration;
mod doubted;
mod power;
mod right;
mod uncertain;
mod wrong;
