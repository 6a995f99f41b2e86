//! The commands, one file each.

#[cfg(feature = "parquet-results")]
pub mod batch;
pub mod calibrate;
pub mod compare;
pub mod completions;
pub mod diagnose;
pub mod estimate;
pub mod expand;
pub mod export;
pub mod help;
pub mod identify;
pub mod image;
pub mod inspect;
pub mod man;
pub mod new;
#[cfg(feature = "papers")]
pub mod reproduce;
pub mod schema;
pub mod simulate;
mod source_cost;
#[cfg(not(target_family = "wasm"))]
mod source_trial;
pub mod spectrum;
mod stated;
pub mod stream;
pub mod study;
#[cfg(not(target_family = "wasm"))]
pub mod view;
