//! Devices that an experiment file describes by equations, and numbers that are uncertain.

mod contacts;
mod equations;
mod events;
mod example_devices;
mod export;
mod export_agreement;
mod export_faults;
mod export_table;
mod input_rate;
mod measured_devices;
mod measured_outliers;
mod own_angles;
mod own_axes;
mod own_circuit;
mod own_commands;
mod own_device;
mod own_feedthrough;
mod own_force;
mod own_inputs;
mod own_lock_in;
mod own_loops;
mod own_sine;
mod own_start;
mod parameter_quantities;
#[path = "../parts/mod.rs"]
mod parts;
mod resets;
mod sampling_rates;
mod several_signals;
mod shooting;
mod sizes;
mod step_errors;
mod table_end;
mod uncertain_device;
mod varying_noise;
