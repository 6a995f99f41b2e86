//! The drive frequencies of the experiments: over which of them the device moves, and how far.

use super::bench::{DRIVE_V, ScannerBench};
use super::published::{d_table_5_1, s_table_i};
use crate::program::{
    Check, CheckTolerance, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, SeedSpread,
    ValueOrigin,
};
use crate::simulate::{Drive, Stability, SweepPoint, SweepSettings, stepped_sweep};
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};

/// The sweeps.
pub static HEAD: ItemHead = ItemHead {
    key: "sweep",
    title: "sweep over the 15 drive frequencies",
    kind: ItemKind::Figure,
    places: &[
        PaperPlace { paper: "S", label: "Section III-B", page: "second set of experiments" },
        PaperPlace { paper: "D", label: "Section 5.4.2", page: "page 95" },
    ],
    origin: ValueOrigin::Measured,
};

/// One tenth of what is printed, and well below the 1.3e-12 N m s where the printed drive begins to move it.
const LOW_DAMPING: f64 = 5.95e-13;
/// Frequencies that S measured.
const COUNT: u32 = 15;
/// What 15 frequencies tell of a band.
const STEPS: CheckTolerance = CheckTolerance::difference(56.0, "a step of the 15 frequencies at each end");
/// Below this, in rad, the device counts as still.
const STILL: f64 = 0.01;

/// A way to make the device move.
struct DriveMethod {
    words: String,
    scanner: ParametricScanner<f64>,
    volts: f64,
    frequencies_hz: Vec<f64>,
    periods: u32,
}

/// Equal steps from one frequency to another.
fn grid([low, high]: [f64; 2], count: u32) -> Vec<f64> {
    (0..count).map(|i| low + (high - low) * f64::from(i) / f64::from(count - 1)).collect()
}

/// The lowest and the highest frequency at which it moves, in kHz.
fn band(points: &[SweepPoint]) -> Option<[f64; 2]> {
    let moving = || points.iter().filter(|p| p.amplitude > STILL).map(|p| p.drive_hz / 1e3);
    Some([moving().reduce(f64::min)?, moving().reduce(f64::max)?])
}

/// How wide that is, in Hz.
fn width_hz([low, high]: [f64; 2]) -> f64 {
    1e3 * (high - low)
}

/// Sweeps down and up, for the drive that moves the published device and for the published drive.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let published = ScannerBench::new()?.scanner();
    let resonator = TorsionalResonator { damping: LOW_DAMPING, ..published.resonator };
    let ways = [
        DriveMethod {
            words: "90 V + 90 V sin, damping as printed".to_owned(),
            scanner: published,
            volts: DRIVE_V,
            frequencies_hz: grid(s_table_i::DRIVE_KHZ.map(|f| f * 1e3), COUNT),
            periods: 3000,
        },
        DriveMethod {
            words: "30 V + 30 V sin as printed, a tenth of the damping".to_owned(),
            scanner: ParametricScanner { resonator, ..published },
            volts: s_table_i::DRIVE_V,
            frequencies_hz: grid([31_120.0, 31_190.0], 29),
            periods: 6000,
        },
    ];
    let units = |way: &DriveMethod| u64::from(way.periods) * 48 * way.frequencies_hz.len() as u64;
    let largest = ways.iter().map(units).max().unwrap_or(0);
    let sweeps = work.map("sweeps", (4, largest), |index, _| {
        let (way, downwards) = (&ways[index / 2], index % 2 == 0);
        let settings = SweepSettings {
            offset: way.volts,
            amplitude: way.volts,
            periods: way.periods,
            steps_per_period: 48,
            disturbance: 1e-3,
        };
        let mut frequencies = way.frequencies_hz.clone();
        if downwards {
            frequencies.reverse();
        }
        let mut points = stepped_sweep(way.scanner, frequencies, &settings);
        points.sort_by(|a, b| a.drive_hz.total_cmp(&b.drive_hz));
        Some(points)
    })?;
    Ok(vec![item(&ways, &sweeps)])
}

fn item(ways: &[DriveMethod; 2], sweeps: &[Vec<SweepPoint>]) -> Item {
    // Mathieu's tongue without damping is h/2·f wide.
    let drive = Drive::Sine {
        offset: s_table_i::DRIVE_V,
        amplitude: s_table_i::DRIVE_V,
        frequency_hz: 31_150.0,
        phase_rad: 0.0,
    };
    let tongue_hz =
        Stability::of(&ways[1].scanner, &drive).map_or(f64::NAN, |s| s.pump_depth * s.resonance_hz);
    let (loud_down, loud_up, low_down) = (&sweeps[0], &sweeps[1], &sweeps[2]);
    let width = |points: &[SweepPoint]| SeedSpread::exact(band(points).map_or(f64::NAN, width_hz));
    let [d_hz, s_hz] = [d_table_5_1::DRIVE_KHZ, s_table_i::DRIVE_KHZ].map(|b| width_hz(b).round());
    let largest = |points: &[SweepPoint]| {
        points
            .iter()
            .max_by(|a, b| a.amplitude.total_cmp(&b.amplitude))
            .map_or((f64::NAN, f64::NAN), |p| (p.drive_hz / 1e3, p.amplitude.to_degrees()))
    };
    let (at_down, degrees_down) = largest(loud_down);
    let (_, degrees_up) = largest(loud_up);
    let mut table = TextTable::new(
        "Amplitude at the 15 drive frequencies of S, 90 V + 90 V sin",
        [
            ColumnHead::number("drive", "kHz"),
            ColumnHead::number("sweeping down", "deg"),
            ColumnHead::number("sweeping up", "deg"),
        ],
    );
    for (down, up) in loud_down.iter().zip(loud_up) {
        let cell = |p: &SweepPoint| {
            if p.amplitude > STILL { format!("{:.2}", p.amplitude.to_degrees()) } else { "still".to_owned() }
        };
        table.push([format!("{:.3}", down.drive_hz / 1e3), cell(down), cell(up)]);
    }
    let mut figure = Figure::new(
        "sweep_amplitude",
        "Amplitude against drive frequency",
        "Above, the drive that moves the published device; below, the published drive with a tenth of the damping. \
         Each frequency starts from the motion at the one before: sweeping down holds on to motions that sweeping up \
         does not find.",
    );
    for (way, sweeps) in ways.iter().zip(sweeps.chunks(2)) {
        let mut panel = Panel::new(
            Axis::new(format!("drive frequency ({})", way.words), "Hz"),
            Axis::new("amplitude", "deg"),
        );
        for (label, role, points) in [
            ("sweeping down", SeriesRole::Model, &sweeps[0]),
            ("sweeping up", SeriesRole::Estimate, &sweeps[1]),
        ] {
            let points: Vec<(f64, f64)> =
                points.iter().map(|p| (p.drive_hz, p.amplitude.to_degrees())).collect();
            panel =
                panel.with(Series::line(label, role, points.clone())).with(Series::points("", role, points));
        }
        figure = figure.with(panel);
    }
    Item::new(&HEAD)
        .check(Check::claim(
            "sweeping down reaches the largest amplitude, near the low end",
            "swept from high to low near 31.10 kHz",
            format!("{degrees_down:.1} deg at {at_down:.3} kHz down, {degrees_up:.1} deg up"),
            "larger than sweeping up, and in the lower half of the band",
            degrees_down > degrees_up && at_down < s_table_i::DRIVE_KHZ.iter().sum::<f64>() / 2.0,
        ))
        .check(Check::value("width of S's band, at 90 V + 90 V sin", "Hz", s_hz, width(loud_down), STEPS))
        .check(Check::value("width of S's band, at 0 to 60 V, little damped", "Hz", s_hz, width(low_down), STEPS))
        .check(Check::value("width of D's band, at 0 to 60 V, little damped", "Hz", d_hz, width(low_down), CheckTolerance::difference(10.0, "rounding of both ends")))
        .remark(format!(
            "The direction and the hysteresis are there; the width of S's band is not. However small the damping, 0 to \
             60 V starts no motion outside a band of {tongue_hz:.0} Hz, and what sweeping down holds on to adds little: \
             that is D's band, to its order of magnitude, and not S's. One of the two ranges, or the voltage, is not \
             that of the device. The position of a band means less: the three digits of the printed stiffness are \
             worth ±70 Hz."
        ))
        .figure(figure)
        .table(table)
}
