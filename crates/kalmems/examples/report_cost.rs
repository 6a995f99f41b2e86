//! What the report of a long recording costs: the processor time of an estimate without any result, with a report, and with trajectories and the
//! single samples of the report as well. Each is measured by turns, so that what else the machine does falls on all.
//!
//!     cargo run --release --example report_cost -- EXPERIMENT.toml [TURNS]
//!
//! Linux only: the processor time is read from `/proc`.

use kalmems::diagnose::NumberCheck;
use kalmems::progress::Silent;
use kalmems::results::{LongEstimate, Output, RunInfo, Work, WriteOptions};
use kalmems::rigs::published;
use kalmems::workflow::{WholeRecording, estimate_in_parts};
use std::error::Error;
use std::path::Path;
use std::time::{Duration, SystemTime};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or("expected an experiment file, as `kalmems simulate` writes it")?;
    let turns: usize = arguments.next().map_or(Ok(3), |turns| turns.parse())?;
    let experiment = published().load(Path::new(&file))?;
    let rig = published().rig(&experiment)?;
    let folder = tempfile::tempdir()?;
    println!(
        "processor time in s: nothing written, with a report, with trajectories and single samples as well"
    );
    for turn in 0..turns {
        let start = processor_time_s()?;
        estimate_in_parts(published(), &experiment, &Silent, &mut |_| Ok::<(), Box<dyn Error>>(()))
            .map_err(told)?;
        let mut times = vec![processor_time_s()? - start];
        for trajectories in [false, true] {
            let start = processor_time_s()?;
            let place = folder.path().join(format!("{turn}_{trajectories}"));
            let output = Output::begin(&place, &Work::of_file("estimate", Path::new(&file), Vec::new()))?;
            let mut results =
                LongEstimate::begin(rig, &experiment, &output, WriteOptions { trajectories }, &|| false);
            let whole: Vec<WholeRecording> =
                estimate_in_parts(published(), &experiment, &Silent, &mut |part| results.part(&part))
                    .map_err(told)?;
            let info = RunInfo { started: SystemTime::UNIX_EPOCH, took: Duration::ZERO };
            results.finish(&whole, (NumberCheck::default(), Vec::new()), info)?;
            output.commit()?;
            times.push(processor_time_s()? - start);
        }
        let [plain, report, all] = times[..] else { return Err("three times are expected".into()) };
        println!("{plain:.2} {report:.2} {all:.2}; the report adds {:.1} %", 100.0 * (report / plain - 1.0));
    }
    Ok(())
}

/// What went wrong, in words.
fn told(error: impl std::fmt::Debug) -> String {
    format!("{error:?}")
}

/// User and system time of this process, all threads together.
fn processor_time_s() -> Result<f64, Box<dyn Error>> {
    // The fields behind the name of the program, which may have spaces in it: 14 and 15 of all are hundredths of seconds.
    let stat = std::fs::read_to_string("/proc/self/stat")?;
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    let ticks =
        |place: usize| fields.get(place).and_then(|field| field.parse::<f64>().ok()).ok_or("no times");
    Ok((ticks(11)? + ticks(12)?) / 100.0)
}
