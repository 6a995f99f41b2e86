//! The verdict on simulated recordings: of filters that are told what is true, and of filters that are told something wrong.

mod devices;
mod right;
mod wrong;
