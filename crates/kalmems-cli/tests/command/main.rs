//! The command, as a process.

#[cfg(feature = "parquet-results")]
mod batch;
mod cli;
mod columns;
mod diagnosis;
mod docs;
mod expansion;
mod from_recording;
mod gaps;
mod image;
mod interruption;
mod limits;
mod live;
mod live_state;
mod new;
mod ranges;
mod rates;
mod readme;
mod remedies;
mod report_samples;
mod rest;
mod spectrum;
mod store;
mod study;
mod terminal_output;
