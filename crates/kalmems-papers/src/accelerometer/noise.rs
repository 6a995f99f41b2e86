//! Figure 12, and the ratios of signal and noise in equations 3-11 to 3-17.

use super::bench::{AccelerometerBench, BenchRecord, SKIP_S, decibels};
use super::published::device;
use crate::program::{
    Check, CheckTolerance, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError,
    SeedSpread, ValueOrigin,
};
use crate::signal::fit_sine_at;
use kalmems_figures::significant;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use kalmems_models::constants::STANDARD_GRAVITY;
use kalmems_models::control::{PiController, RebalanceLoop};
use kalmems_models::noise::Mosfet;
use kalmems_rigs::accelerometer::Acceleration;
use std::f64::consts::TAU;

/// The electronics.
pub static FIGURE_12: ItemHead = ItemHead {
    key: "figure-12",
    title: "electronic noise over frequency",
    kind: ItemKind::Figure,
    places: &[PaperPlace { paper: "Z", label: "Figure 12", page: "page 28" }],
    origin: ValueOrigin::Computed,
};

/// What a loop does to signal and noise.
pub static RATIOS: ItemHead = ItemHead {
    key: "signal-to-noise",
    title: "signal and noise in the open and the closed loop",
    kind: ItemKind::Table,
    places: &[
        PaperPlace { paper: "Z", label: "Equation 3-13", page: "page 30" },
        PaperPlace { paper: "Z", label: "Equation 3-17", page: "page 31" },
    ],
    origin: ValueOrigin::Computed,
};

/// Computes both.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let bench = AccelerometerBench::new(4.0)?;
    Ok(vec![electronics(&bench), ratios(&bench, work)?])
}

const TEMPERATURE: f64 = 300.0;
const CARRIER_HZ: f64 = 1e6;

fn electronics(bench: &AccelerometerBench) -> Item {
    let stage = Mosfet::ASSUMED;
    let grid = || (0..=240).map(|k| 10_f64.powf(1.0 + f64::from(k) / 30.0));
    let line = |label: &str, role, of: &dyn Fn(f64) -> f64| {
        Series::line(label, role, grid().map(|hz| (hz, of(hz).sqrt())).collect::<Vec<_>>())
    };
    let thermal = |_: f64| stage.thermal(TEMPERATURE);
    let figure = Figure::new(
        "figure-12_electronics",
        "Electronic noise at the gate",
        "Densities of a transistor of assumed values: the thesis names none.",
    )
    .with(
        Panel::new(Axis::new("frequency", "Hz").log(), Axis::new("noise", "V/√Hz").log())
            .with(line("all", SeriesRole::Estimate, &|hz| stage.total(hz, TEMPERATURE)))
            .with(line("thermal", SeriesRole::Model, &thermal))
            .with(line("flicker", SeriesRole::Input, &|hz| stage.flicker(hz)))
            .with(line("leakage", SeriesRole::Bound, &|hz| stage.leakage(hz))),
    );
    let closed = &bench.closed;
    let divided = 1.0 + 2.0 * closed.readout.plates.at_rest() / closed.readout.feedback_capacitance;
    let at_input =
        (2.0 * stage.total(CARRIER_HZ, TEMPERATURE)).sqrt() * divided * closed.input_referred(TAU * 10.0)
            / STANDARD_GRAVITY;
    let corner = |hz: f64| stage.total(hz, TEMPERATURE) / stage.thermal(TEMPERATURE);
    Item::new(&FIGURE_12)
        .check(Check::claim(
            "the noise falls with frequency and is flat in the end",
            "Figure 12",
            format!(
                "{} times the thermal noise at 10 Hz, {} at the carrier",
                significant(corner(10.0).sqrt()),
                significant(corner(CARRIER_HZ).sqrt())
            ),
            "ten times the thermal noise at 10 Hz, and less than √2 times at the carrier",
            corner(10.0) > 100.0 && corner(CARRIER_HZ) < 2.0,
        ))
        .check(Check::value(
            "at the input, 1 MHz carrier",
            "µg/√Hz",
            1e6 * device::ELECTRONIC_G_PER_ROOT_HZ,
            SeedSpread::exact(1e6 * at_input),
            CheckTolerance::digit(10.0),
        ))
        .remark(
            "Equations 3-7 to 3-10, the leakage with the 2 that equation 3-9 has lost. The thesis gives no value of its \
             transistor: those here are ASSUMED, an n-channel transistor of a 0.5 µm process with 200 µm × 0.6 µm and 0.1 mA. \
             They reproduce the shape of the figure; its level is theirs and not the thesis's.",
        )
        .figure(figure)
}

/// Signal over noise in a band of 1 Hz.
struct Ratio {
    brownian_db: f64,
    electronic_db: f64,
}

/// The loop, the same device with the same bias and without feedback, and the same without a bias.
fn kinds(bench: &AccelerometerBench) -> [(&'static str, RebalanceLoop<f64>); 3] {
    let still =
        RebalanceLoop { controller: PiController { proportional: 0.0, integral: 0.0 }, ..bench.closed };
    [("closed", bench.closed), ("open, biased", still), ("open, no bias", bench.open().closed)]
}

const AMPLITUDE: f64 = 0.1 * STANDARD_GRAVITY;

fn ratio(bench: &AccelerometerBench, closed: &RebalanceLoop<f64>, hz: f64) -> Ratio {
    let brownian = 2.0 * closed.device.mass.acceleration_density(bench.hardware().force_density);
    let density = (2.0 * bench.hardware().noise_variance * super::bench::INTERVAL_S).sqrt();
    let rms = AMPLITUDE * std::f64::consts::FRAC_1_SQRT_2;
    Ratio {
        brownian_db: decibels(rms / brownian.sqrt()),
        electronic_db: decibels(rms / (density * closed.input_referred(TAU * hz))),
    }
}

/// Where the runs have their signal, in Hz: low, so that the plates' pull counts.
const RUN_HZ: f64 = 100.0;
/// What is judged of a run, in s: whole periods.
const JUDGED_S: f64 = 0.5;
/// Frequencies on either side at which the noise is taken, in bins.
const NEIGHBOURS: u32 = 20;
/// Samples that are made one, to fit sines to fewer.
const FEWER: usize = 51;

/// Signal over the readout's noise in 1 Hz, in dB, of the output of a run without the molecules' push.
fn of_run(bench: &AccelerometerBench, closed: &RebalanceLoop<f64>, seed: u64) -> Option<f64> {
    let acceleration = Acceleration::Sine { amplitude: AMPLITUDE, frequency_hz: RUN_HZ };
    let mut run = bench.run(acceleration, SKIP_S + JUDGED_S, seed);
    run.closed = *closed;
    run.hardware.sensed.device = closed.device;
    run.hardware.force_density = 0.0;
    let record = BenchRecord::of(&run).decimated(FEWER, true);
    let (time_s, output) = (&record.time_s[record.from()..], &record.output[record.from()..]);
    let signal = fit_sine_at(time_s, output, RUN_HZ)?;
    let noise: Vec<f64> =
        time_s.iter().zip(output).map(|(time_s, volts)| volts - signal.at(*time_s)).collect();
    let mut square = 0.0;
    for k in 3..3 + NEIGHBOURS {
        for side in [-1.0, 1.0] {
            let hz = RUN_HZ + side * f64::from(k) / JUDGED_S;
            square += fit_sine_at(time_s, &noise, hz)?.amplitude.powi(2);
        }
    }
    // The mean square of a sine's amplitude in noise of a one-sided density S over T is 2·S/T.
    let density = square / f64::from(2 * NEIGHBOURS) * JUDGED_S / 2.0;
    Some(decibels(signal.amplitude * std::f64::consts::FRAC_1_SQRT_2 / density.sqrt()))
}

fn ratios(bench: &AccelerometerBench, work: &PartWork) -> Result<Item, ReproduceError> {
    let runs = match work.effort {
        Effort::Quick => 6,
        Effort::Full => 60,
    };
    let kinds = kinds(bench);
    let first_seed = work.seed;
    let found = work.map("signal and noise", (3 * runs, 1), |index, _| {
        Some(of_run(bench, &kinds[index % 3].1, first_seed + (index / 3) as u64))
    })?;
    let simulated: Vec<SeedSpread> = (0..3)
        .map(|kind| SeedSpread::of(found.iter().skip(kind).step_by(3).map(|db| db.unwrap_or(f64::NAN))))
        .collect();
    let mut table = TextTable::new(
        "A sine of 0.1 g over the noise of 1 Hz",
        [
            ColumnHead::text("structure"),
            ColumnHead::number("molecules, any frequency", "dB"),
            ColumnHead::number("readout, 10 Hz", "dB"),
            ColumnHead::number("readout, 1 kHz", "dB"),
            ColumnHead::number("readout, 10 kHz", "dB"),
            ColumnHead::number("readout, 100 Hz", "dB"),
            ColumnHead::number("readout, 100 Hz, simulated", "dB"),
        ],
    );
    let of = |closed: &RebalanceLoop<f64>, hz| ratio(bench, closed, hz);
    for ((name, closed), simulated) in kinds.iter().zip(&simulated) {
        let db = |value: f64| format!("{value:.1}");
        table.push([
            (*name).to_owned(),
            db(of(closed, 10.0).brownian_db),
            db(of(closed, 10.0).electronic_db),
            db(of(closed, 1e3).electronic_db),
            db(of(closed, 1e4).electronic_db),
            db(of(closed, RUN_HZ).electronic_db),
            simulated.to_text(),
        ]);
    }
    let loss = simulated[1].median - simulated[0].median;
    // What equations 3-13 and 3-17 differ by: |1 − M·H|, the plates' pull in the open loop alone.
    let soft = bench.open().closed;
    let mut stiff = soft;
    stiff.device.carrier_mean_square = 0.0;
    let printed = decibels(soft.compliance(TAU * RUN_HZ).size() / stiff.compliance(TAU * RUN_HZ).size());
    let chance = 10.0 / std::f64::consts::LN_10 / f64::from(2 * NEIGHBOURS).sqrt();
    // By the output for an acceleration and for a force, with all that the loop does to either.
    let brownian = |closed: &RebalanceLoop<f64>| {
        let force = (2.0 * bench.hardware().force_density).sqrt();
        let rate = TAU * RUN_HZ;
        let of_force = closed.displacement(rate).size() / closed.device.mass.mass * force;
        let of_signal = closed.displacement(rate).size() * AMPLITUDE * std::f64::consts::FRAC_1_SQRT_2;
        decibels(of_signal / of_force)
    };
    let [brownian_closed, brownian_open] = [brownian(&bench.closed), brownian(&soft)];
    Ok(Item::new(&RATIOS)
        .check(Check::claim(
            "the loop does not change the ratio to the Brownian noise",
            "equations 3-12 and 3-16: m·a/F_B in both",
            format!("{brownian_closed:.1} dB with the loop, {brownian_open:.1} dB without"),
            "less than 0.1 dB",
            (brownian_closed - brownian_open).abs() < 0.1,
        ))
        .check(Check::claim(
            "the loop lowers the ratio to the electronic noise",
            format!("equations 3-13 and 3-17: by |1 − M·H|, {printed:.1} dB at 100 Hz"),
            format!(
                "by 0.0 dB: both are divided by 1 + L; simulated {loss:+.2} dB, with {chance:.1} dB of chance in a run"
            ),
            "by at least half of what is printed",
            loss > 0.5 * printed,
        ))
        .remark(
            "Equation 3-15 has the plates' pull in the open loop's signal, equation 3-11 has none in the closed loop's; the \
             printed disadvantage of the loop is that difference. With the pull in both, signal and noise are divided by the \
             same 1 + L, and the ratio is m·S·X·a/V_N with or without a loop. The bias of a loop softens the spring further, \
             which raises the signal: a loop is better by that at low frequencies.",
        )
        .table(table))
}
