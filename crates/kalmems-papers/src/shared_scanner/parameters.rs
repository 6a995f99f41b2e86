//! The settings and parameters that are printed, and whether the device moves with them.

use super::bench::ScannerBench;
use super::published::{d_table_5_1, s_table_i, s_table_ii};
use crate::program::{
    Check, CheckTolerance, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, SeedSpread,
    ValueOrigin,
};
use crate::simulate::{Drive, Stability, floquet_exponent};
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use std::f64::consts::TAU;

type Scanner = ParametricScanner<f64>;

/// The settings.
pub static SETTINGS: ItemHead = ItemHead {
    key: "settings",
    title: "settings of the experiments",
    kind: ItemKind::Table,
    places: &[
        PaperPlace { paper: "S", label: "Table I", page: "section III-B" },
        PaperPlace { paper: "D", label: "Table 5.1", page: "page 94" },
    ],
    origin: ValueOrigin::Stated,
};

/// The parameters, and what follows from both tables.
pub static MOTION: ItemHead = ItemHead {
    key: "motion",
    title: "whether the device moves with what is printed",
    kind: ItemKind::Table,
    places: &[
        PaperPlace { paper: "S", label: "Table II", page: "section IV-A" },
        PaperPlace { paper: "D", label: "Table 5.2", page: "page 97" },
    ],
    origin: ValueOrigin::Measured,
};

/// 0 V to 2·`volts`.
fn drive(volts: f64, frequency_hz: f64) -> Drive {
    Drive::Sine { offset: volts, amplitude: volts, frequency_hz, phase_rad: 0.0 }
}

/// Threshold over pump depth: above 1 nothing moves.
fn shortfall(scanner: &Scanner, volts: f64) -> Option<f64> {
    let stability = Stability::of(scanner, &drive(volts, 31.3e3))?;
    Some(stability.threshold() / stability.pump_depth)
}

fn damped(scanner: &Scanner, damping: f64) -> Scanner {
    ParametricScanner { resonator: TorsionalResonator { damping, ..scanner.resonator }, ..*scanner }
}

/// How fast a small motion grows at best, by integration over one period at drive frequencies about twice the
/// resonance.
fn best_growth(scanner: &Scanner, volts: f64) -> Option<f64> {
    let resonance = Stability::of(scanner, &drive(volts, 31.3e3))?.resonance_hz;
    (-8..=8)
        .map(|i| 2.0 * resonance * (1.0 + 5e-5 * f64::from(i)))
        .filter_map(|f| floquet_exponent(*scanner, &drive(volts, f), 64))
        .reduce(f64::max)
}

/// Where a function that rises through 0 does so.
fn crossing([mut low, mut high]: [f64; 2], rises: impl Fn(f64) -> f64) -> f64 {
    while high - low > 1e-6 * high {
        let middle = low.midpoint(high);
        if rises(middle) < 0.0 { low = middle } else { high = middle }
    }
    low.midpoint(high)
}

/// Both tables.
pub fn run(_: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let bench = ScannerBench::new()?;
    Ok(vec![settings(&bench), motion(&bench)])
}

fn settings(bench: &ScannerBench) -> Item {
    let scanner = bench.scanner();
    let free = scanner.resonator.natural_rate() / TAU / 1e3;
    let [s_low, s_high] = s_table_i::DRIVE_KHZ;
    let [d_low, d_high] = d_table_5_1::DRIVE_KHZ;
    let table = TextTable::new(
        "What the two papers print for the same device, and what is used here",
        ["setting", "S Table I", "D Table 5.1 and text", "here"].map(ColumnHead::text),
    )
    .row(["driving voltage", "30 V (0 V to 60 V)", "30 V; text: 0 to 60 V amplitude", "90 V + 90 V sin"])
    .row(["carrier voltage", "6 V", "6 V; text: 12 V", "6 V"])
    .row(["carrier frequency", "500 kHz", "500 kHz", "500 kHz, as a mean square"])
    .row(["drive frequency", "31.11 to 31.50 kHz", "31.10 to 31.15 kHz", "as S; see the sweep"])
    .row(["resonance", "15.50 kHz", "15.5 kHz", "from k, J and the mean voltage"])
    .row(["bias of the ring-down", "23.76 V", "23.76 V", "23.76 V"])
    .row(["sampling, ring-down", "5 MHz", "1 MHz", "1 MHz"]);
    Item::new(&SETTINGS)
        .check(Check::value(
            "resonance: √(k/J)/2π of S Table II",
            "kHz",
            s_table_i::RESONANCE_KHZ,
            SeedSpread::exact(free),
            CheckTolerance::part(0.005, "three digits of k and of J"),
        ))
        .check(Check::claim(
            "both papers drive the same device over the same frequencies",
            format!("S {s_low:.2} to {s_high:.2} kHz, D {d_low:.2} to {d_high:.2} kHz"),
            format!("widths of {:.0} and {:.0} Hz", 1e3 * (s_high - s_low), 1e3 * (d_high - d_low)),
            "the printed numbers are the same",
            s_table_i::DRIVE_KHZ == d_table_5_1::DRIVE_KHZ,
        ))
        .check(Check::claim(
            "the dissertation's text and table have the same carrier",
            format!("text {} V, table {} V", d_table_5_1::CARRIER_IN_TEXT_V, s_table_i::CARRIER_V),
            format!("a factor of {}", d_table_5_1::CARRIER_IN_TEXT_V / s_table_i::CARRIER_V),
            "the printed numbers are the same",
            d_table_5_1::CARRIER_IN_TEXT_V == s_table_i::CARRIER_V,
        ))
        .remark(
            "Nothing here is estimated: these are inputs. A pure sine at f_dr, as S equation 16 has it, puts V² at \
             2·f_dr and does not move a device whose resonance is near f_dr/2; the printed 0 V to 60 V is taken as \
             30 V + 30 V sin.",
        )
        .table(table)
}

fn motion(bench: &ScannerBench) -> Item {
    let scanner = bench.scanner();
    let factor = shortfall(&scanner, s_table_i::DRIVE_V).unwrap_or(f64::NAN);
    let margin = |volts: f64| 1.0 - shortfall(&scanner, volts).unwrap_or(f64::INFINITY);
    let volts = crossing([s_table_i::DRIVE_V, 300.0], margin);
    let volts_integrated =
        crossing([s_table_i::DRIVE_V, 300.0], |v| best_growth(&scanner, v).unwrap_or(f64::NAN));
    let b = scanner.resonator.damping;
    let growth = |times: f64| best_growth(&damped(&scanner, b / times), s_table_i::DRIVE_V);
    let times_integrated = crossing([1.0, 50.0], |times| growth(times).unwrap_or(f64::NAN));

    let needed = TextTable::new(
        "What would make it move, from rest",
        [
            ColumnHead::text("change"),
            ColumnHead::number("Mathieu's equation", ""),
            ColumnHead::number("integration over a period", ""),
            ColumnHead::number("printed", ""),
        ],
    )
    .row([
        "offset and amplitude of the drive, at least (V)".to_owned(),
        format!("{volts:.1}"),
        format!("{volts_integrated:.1}"),
        format!("{}", s_table_i::DRIVE_V),
    ])
    .row([
        "or damping b, at most (1e-12 N m s)".to_owned(),
        format!("{:.2}", b * 1e12 / factor),
        format!("{:.2}", b * 1e12 / times_integrated),
        format!("{}", s_table_ii::DAMPING),
    ]);
    let grid = || (5..=75).map(|i| 2.0 * f64::from(i));
    let depth =
        |volts: f64| Stability::of(&scanner, &drive(volts, 31.3e3)).map(|s| (s.pump_depth, s.threshold()));
    let depths = grid().filter_map(|v| Some((v, depth(v)?.0))).collect::<Vec<_>>();
    let thresholds = grid().filter_map(|v| Some((v, depth(v)?.1))).collect::<Vec<_>>();
    let printed = depth(s_table_i::DRIVE_V).map(|(depth, _)| (s_table_i::DRIVE_V, depth));
    let figure = Figure::new(
        "motion_pump-depth",
        "Pump depth against drive voltage",
        "The drive modulates the stiffness by this part of it (offset and amplitude equal). Below the threshold 2/Q \
         every motion dies. The point is S Table I.",
    )
    .with(
        Panel::new(Axis::new("offset and amplitude of the drive", "V"), Axis::new("pump depth", "1").log())
            .with(Series::line("pump depth", SeriesRole::Model, depths))
            .with(Series::line("threshold 2/Q", SeriesRole::Bound, thresholds))
            .with(Series::points("0 V to 60 V", SeriesRole::Input, printed)),
    );
    Item::new(&MOTION)
        .check(Check::claim(
            "with S Tables I and II the device moves",
            "yes: steady motion was recorded",
            format!("no: the pump depth is {factor:.2} times below the threshold"),
            "the pump depth is above the threshold",
            factor <= 1.0,
        ))
        .remark(format!(
            "Tables I and II together do not oscillate. Either the voltage at the electrodes was higher than the table \
             says (at least 0 to {:.0} V), or the damping is not that of the ring-down's fit (at most {:.2}e-12 N m s \
             instead of 5.95e-12). The parameters themselves serve here as the simulated device.",
            2.0 * volts,
            b * 1e12 / factor
        ))
        .table(needed)
        .figure(figure)
}
