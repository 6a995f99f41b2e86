//! Gaps and gains from the printed experiment, and what a tilt about the other axis does.

use super::failed;
use super::record_sets::{DRIVE_HZ, GAIN, GAP, NOISE_V, angle, channels, records};
use crate::program::{
    Check, CheckTolerance, Effort, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError,
    SeedSpread, ValueOrigin,
};
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};
use kalmems_models::capacitance::TiltingPlate;
use kalmems_rigs::micro_stage::identification::{
    ElectrodeUnknowns, Waveforms, by_crests, correlation, crests, expected, unknown,
};
use std::f64::consts::TAU;

/// Why gap and gain agree.
const MADE: &str = "the simulated electrodes have the printed values";

/// Gap and gain.
pub static PARAMETERS: ItemHead = ItemHead {
    key: "table-3-3",
    title: "gap and gain of the electrodes",
    kind: ItemKind::Table,
    places: &[PaperPlace { paper: "D", label: "Table 3.3", page: "page 43" }],
    origin: ValueOrigin::Measured,
};

/// The feature that tells the gap.
pub static CRESTS: ItemHead = ItemHead {
    key: "figure-3-12",
    title: "crest-to-trough distance over the gap",
    kind: ItemKind::Figure,
    places: &[PaperPlace { paper: "D", label: "Figure 3.12", page: "page 44" }],
    origin: ValueOrigin::Computed,
};

/// Off-axis motion.
pub static REJECTION: ItemHead = ItemHead {
    key: "table-3-4",
    title: "rejection of off-axis motion",
    kind: ItemKind::Table,
    places: &[
        PaperPlace { paper: "D", label: "Table 3.4", page: "page 45" },
        PaperPlace { paper: "D", label: "Figure 3.13", page: "page 46" },
    ],
    origin: ValueOrigin::Computed,
};

/// All three.
pub fn run(work: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    Ok(vec![parameters(work)?, crest_distance(), rejection()])
}

fn parameters(work: &PartWork) -> Result<Item, ReproduceError> {
    let sets = if work.effort == Effort::Quick { 3 } else { 12 };
    let plates = channels().map(|channel| TiltingPlate { gap: 19e-6, ..channel.plate });
    let noise = [NOISE_V[0]; 4];
    let seed = work.seed;
    let found = work.map("gaps and gains", (sets, 1), |index, _| {
        let records = records(seed + index as u64);
        let waveforms = Waveforms {
            plates: &plates,
            gains: &[0.95 * GAIN; 4],
            noise: &noise,
            records: &records,
            delay_s: 0.0,
            scale_known: true,
            unknowns: ElectrodeUnknowns::Both,
            feedthrough: false,
        };
        let fit = waveforms.fit();
        let features: Option<Vec<_>> = records
            .iter()
            .map(|r| Some((r.angle, crests(&r.time_s, &r.signals[2], DRIVE_HZ, NOISE_V[0])?)))
            .collect();
        Some((fit, features.map(|features| by_crests(&plates[2], -1.0, &features))))
    })?;
    let (mut gaps, mut gains, mut by_distance, mut together) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (fit, features) in found {
        let fit = fit.map_err(failed("table-3-3"))?;
        gaps.push(1e6 * fit.parameters[unknown::gap(2)]);
        gains.push(fit.parameters[unknown::gain(2)]);
        together.push(correlation(&fit, 2));
        if let Some(features) = features {
            by_distance.push(1e6 * features.map_err(failed("table-3-3"))?.gap.value);
        }
    }
    let together = SeedSpread::of(together);
    Ok(Item::new(&PARAMETERS)
        .check(Check::value("D_n of 2A by the waveforms", "um", 1e6 * GAP, SeedSpread::of(gaps), CheckTolerance::digit(0.1)).circular(MADE))
        .check(Check::value("D_n of 2A by crest and trough", "um", 1e6 * GAP, SeedSpread::of(by_distance), CheckTolerance::digit(0.1)).circular(MADE))
        .check(Check::value("eta of 2A by the waveforms", "V ohm", GAIN, SeedSpread::of(gains), CheckTolerance::part(3e-3, "three standard errors of a set")).circular(MADE))
        .remark(format!(
            "Ours are simulated sets of the printed experiment, four drives with a vibrometer. Errors of gap and gain are \
             correlated by {}: the dissertation's two features decouple their search, not their errors.",
            together.to_text()
        )))
}

fn crest_distance() -> Item {
    let [_, _, channel, _] = channels();
    let at = |gap: f64, volts: f64| {
        100.0 * expected(&TiltingPlate { gap, ..channel.plate }, &angle(volts), GAIN.signum())[0]
    };
    let gaps = (0..=40_u32).map(|k| GAP * (0.8 + 0.01 * f64::from(k)));
    let mut panel = Panel::new(Axis::new("gap", "m"), Axis::new("crest to trough, of the cycle", "%"));
    for volts in [1.0, 1.3] {
        let curve: Vec<(f64, f64)> = gaps.clone().map(|gap| (gap, at(gap, volts))).collect();
        panel = panel.with(Series::line(format!("{volts} V"), SeriesRole::Model, curve));
    }
    let (small, large) = (at(0.9 * GAP, 1.3), at(1.1 * GAP, 1.3));
    let is_monotonic = (at(GAP, 1.3) - 50.0).abs() < (small - 50.0).abs()
        && (large - 50.0).abs() < (at(GAP, 1.3) - 50.0).abs();
    // 1.6 µs in percent of the cycle, over the slope.
    let sample = 100.0 * 1.6e-6 * DRIVE_HZ;
    let slope = (small - large).abs() / 20.0;
    Item::new(&CRESTS)
        .check(Check::claim(
            "the distance changes with the gap, and not with the gain",
            "shown for several gaps",
            format!("{small:.2} % of the cycle at 0.9 of the gap, {large:.2} % at 1.1"),
            "it falls from 0.9 of the gap to the gap and on to 1.1",
            is_monotonic,
        ))
        .remark(format!(
            "At 1.3 V one sample of 1.6 µs is {:.1} % of the gap: the distance has to be found to a fraction of a sample.",
            sample / slope
        ))
        .figure(
            Figure::new(
                "figure-3-12_distance",
                "Crest to trough of 2A over the gap",
                "How much later the trough is than the crest, for two drives of the printed stage.",
            )
            .with(panel),
        )
}

/// D Table 3.4: off-axis over main motion, and 100 % less the rejection, in percent.
const PRINTED: [(f64, f64); 3] = [(0.01, 0.02), (0.1, 0.02), (0.5, 0.10)];
/// The amplitude of the main motion in rad.
const MAIN: f64 = 3e-3;

fn rejection() -> Item {
    let [_, _, channel, _] = channels();
    let mut item = Item::new(&REJECTION);
    let mut passed_by = Vec::new();
    for (ratio, printed) in PRINTED {
        let (mut apart, mut alone) = (0.0, 0.0);
        for k in 0..1000_u32 {
            let (sine, cosine) = (TAU * f64::from(k) / 1000.0).sin_cos();
            let (angles, rates) =
                ([ratio * MAIN * sine, MAIN * sine], [ratio * MAIN * cosine, MAIN * cosine]);
            let single: f64 = channel.voltage(angles[1], rates[1]);
            apart += (channel.voltage_of_both(angles, rates) - single).powi(2);
            alone += single * single;
        }
        // What gets through: the rejections differ in their last digits alone.
        let passed = 100.0 * (apart / alone).sqrt() / ratio;
        passed_by.push((100.0 * ratio, passed));
        let what = format!("100 % less the rejection at {} % off-axis motion", 100.0 * ratio);
        item = item.check(Check::value(
            what,
            "%",
            printed,
            SeedSpread::exact(passed),
            CheckTolerance::digit(0.01),
        ));
    }
    item.figure(profiles()).figure(passed_figure(&passed_by)).remark(
        "The difference of the two signals is divided by the root mean square of the signal, which D (57) leaves out; without \
         that it is in volts and no ratio. What gets through is in proportion to the ratio of the motions, so that the first \
         two printed values cannot both be right. Off-axis motion in phase with the main motion, at 3 mrad.",
    )
}

/// What gets through over the ratio of the motions, with the printed values.
fn passed_figure(passed_by: &[(f64, f64)]) -> Figure {
    let printed = PRINTED.map(|(ratio, passed)| (100.0 * ratio, passed));
    let panel = Panel::new(
        Axis::new("off-axis motion over the main motion", "%").log(),
        Axis::new("100 % less the rejection", "%").log(),
    )
    .with(Series::line("computed", SeriesRole::Model, passed_by.to_vec()))
    .with(Series::points("D Table 3.4", SeriesRole::Reference, printed));
    let caption =
        "What gets through is in proportion to the off-axis motion; the first two printed values are not.";
    Figure::new("table-3-4_rejection", "What gets through of off-axis motion", caption).with(panel)
}

/// The capacitance of an outer and an inner electrode over the tilt, and their signals over a cycle, with and without a
/// tenth of off-axis motion.
fn profiles() -> Figure {
    let [_, _, outer, inner] = channels();
    let mut curves = Panel::new(Axis::new("tilt", "rad"), Axis::new("capacitance", "F"));
    let mut waves = Panel::new(Axis::new("time", "s"), Axis::new("signal", "V"));
    for (name, channel, roles) in [
        ("2A", outer, [SeriesRole::Model, SeriesRole::Measured]),
        ("2B", inner, [SeriesRole::Estimate, SeriesRole::Reference]),
    ] {
        let over_tilt = |of_x: f64| -> Vec<(f64, f64)> {
            let tilts = (-50..=50_i32).map(|k| MAIN * f64::from(k) / 50.0);
            tilts.map(|y| (y, channel.plate.capacitance_of_both(of_x * y, y))).collect()
        };
        let over_time = |of_x: f64| -> Vec<(f64, f64)> {
            let turns = (0..=200_u32).map(|k| TAU * f64::from(k) / 200.0);
            let rate = TAU * DRIVE_HZ;
            turns
                .map(|turn| {
                    let [angle, speed] = [MAIN * turn.sin(), MAIN * rate * turn.cos()];
                    (turn / rate, channel.voltage_of_both([of_x * angle, angle], [of_x * speed, speed]))
                })
                .collect()
        };
        curves = curves
            .with(Series::line(format!("{name}, one axis"), roles[0], over_tilt(0.0)))
            .with(Series::line(format!("{name}, both axes"), roles[1], over_tilt(0.1)));
        waves = waves
            .with(Series::line(format!("{name}, one axis"), roles[0], over_time(0.0)))
            .with(Series::line(format!("{name}, both axes"), roles[1], over_time(0.1)));
    }
    Figure::new(
        "table-3-4_profiles",
        "Capacitances and signals of 2A and 2B",
        "As D Figure 3.13: a tilt of 3 mrad about the main axis, alone and with a tenth of it about the other, in phase. The \
         lines of one axis and of both lie on each other.",
    )
    .with(curves)
    .with(waves)
}
