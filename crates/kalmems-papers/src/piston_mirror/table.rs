//! The bounds per parameter, and what the spectrometer asks for.

use super::bench::{COMPUTED_NOISE, MIRROR, plates};
use super::published::{circuit, results, table_i};
use crate::program::{
    Check, CheckTolerance, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, SeedSpread,
    ValueOrigin,
};
use kalmems_applications::spectrum::line_height;
use kalmems_figures::{Axis, ColumnHead, Figure, Panel, Series, SeriesRole, TextTable};
use kalmems_figures::{number, significant};
use kalmems_rigs::piston_mirror::motion_bound;
use std::f64::consts::TAU;

/// P Table I.
pub static HEAD: ItemHead = ItemHead {
    key: "table-i",
    title: "uncertainties for a parametric description",
    kind: ItemKind::Table,
    places: &[PaperPlace { paper: "P", label: "Table I", page: "section II-F" }],
    origin: ValueOrigin::Computed,
};

/// P section II.
pub static WANTED: ItemHead = ItemHead {
    key: "resolution",
    title: "resolution that the spectrum needs",
    kind: ItemKind::Table,
    places: &[PaperPlace { paper: "P", label: "Section II-A", page: "section II-A" }],
    origin: ValueOrigin::Computed,
};

/// What a plate may be taken for the paper's series for C(d).
const PLATE: CheckTolerance = CheckTolerance::part(0.05, "a parallel plate in place of the series");

/// The largest of a function of the phase over a cycle.
fn largest(of: impl Fn(f64, f64) -> f64) -> f64 {
    (0..3600).map(|k| (TAU * f64::from(k) / 3600.0).sin_cos()).map(|(s, c)| of(s, c)).fold(0.0, f64::max)
}

/// Equation 11 for one sample behind a bandwidth in Hz, at the phase that tells most: amplitude in m, phase in rad.
fn one_sample(noise: f64, bandwidth_hz: f64) -> [f64; 2] {
    let [amplitude, _, rest] = MIRROR;
    let slope = |c: f64| plates().slope(rest + amplitude * c).abs();
    let sigma = noise * bandwidth_hz.sqrt();
    [sigma / largest(|_, c| slope(c) * c.abs()), sigma / largest(|s, c| slope(c) * amplitude * s.abs())]
}

/// The joint bound over one second.
fn joint(noise: f64) -> [f64; 5] {
    let [amplitude, frequency, rest] = MIRROR;
    let motion = [amplitude, frequency, 0.7, rest, 0.0];
    let bound = motion_bound(&plates(), &motion, (50e3, 50_000), noise);
    bound.map_or([f64::NAN; 5], |bound| {
        let sd = |i: usize| bound.covariance.standard_deviation(i);
        [sd(0), sd(2), sd(3), sd(1), bound.position_rms_m]
    })
}

/// Both.
#[allow(clippy::unnecessary_wraps)] // the signature of every part
pub fn run(_: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    Ok(vec![table(), wanted()])
}

fn table() -> Item {
    let printed = one_sample(circuit::NOISE, table_i::BANDWIDTH_HZ);
    // ∂C/∂f = ∂C/∂φ·2πt: when a sample tells the frequency no better than printed.
    let when = printed[1] / (TAU * table_i::FREQUENCY_HZ);
    let seconds = [circuit::NOISE, COMPUTED_NOISE].map(joint);
    let mut figure = Figure::new(
        "table-i_bandwidth",
        "What one sample tells of the amplitude, against the bandwidth",
        "Equation 11 at the nearest turning point, where it tells most. The bound of all parameters together, over one \
         second, does not depend on the bandwidth.",
    );
    let mut panel = Panel::new(
        Axis::new("bandwidth", "Hz").log(),
        Axis::new("standard deviation of the amplitude", "m").log(),
    );
    for (noise, role, word) in [
        (circuit::NOISE, SeriesRole::Estimate, "0.151 aF/√Hz"),
        (COMPUTED_NOISE, SeriesRole::Model, "0.393 aF/√Hz"),
    ] {
        let points = (0..=40).map(|k| 10_f64.powf(2.0 + 0.1 * f64::from(k)));
        let points: Vec<(f64, f64)> = points.map(|b| (b, one_sample(noise, b)[0])).collect();
        panel = panel.with(Series::line(format!("one sample, {word}"), role, points)).with(Series::level(
            format!("all parameters over one second, {word}"),
            SeriesRole::Other,
            joint(noise)[0],
        ));
    }
    figure = figure.with(panel.with(Series::points(
        "P Table I",
        SeriesRole::Reference,
        vec![(table_i::BANDWIDTH_HZ, table_i::AMPLITUDE_NM * 1e-9)],
    )));
    let mut bounds = TextTable::new(
        "Bounds of all parameters together over one second, at any sampling rate",
        [
            ColumnHead::text("parameter"),
            ColumnHead::number("P Table I", ""),
            ColumnHead::number("0.151 aF/√Hz", ""),
            ColumnHead::number("0.393 aF/√Hz", ""),
        ],
    );
    let rows = [
        ("amplitude in nm", table_i::AMPLITUDE_NM, 0, 1e9),
        ("phase in rad", table_i::PHASE, 1, 1.0),
        ("offset in nm", table_i::OFFSET_NM, 2, 1e9),
        ("frequency in Hz", table_i::FREQUENCY_HZ, 3, 1.0),
    ];
    for (name, paper, i, unit) in rows {
        let ours = seconds.map(|second| {
            let value = second[i] * unit;
            if value < 1e-3 { format!("{value:.2e}") } else { significant(value) }
        });
        bounds.push([name.to_owned(), number(paper), ours[0].clone(), ours[1].clone()]);
    }
    let against = |quantity, unit, paper, ours, tolerance| {
        Check::value(quantity, unit, paper, SeedSpread::exact(ours), tolerance)
    };
    let single_nm = printed[0] * 1e9;
    Item::new(&HEAD)
        .check(against("amplitude, one sample at 2 kHz", "nm", table_i::AMPLITUDE_NM, single_nm, PLATE))
        .check(against("phase, one sample at 2 kHz", "rad", table_i::PHASE, printed[1], PLATE))
        .check(against("offset, one sample at 2 kHz", "nm", table_i::OFFSET_NM, single_nm, PLATE))
        .check(against("frequency, over one second", "Hz", table_i::FREQUENCY_HZ, seconds[0][3], PLATE))
        .remark(
            "Amplitude and phase are those of equation 11 for a single sample at the phase that tells most of each, \
             up to what the paper's series for C(d) does to a parallel plate: they are no bound of what a recording \
             tells.",
        )
        .remark(format!(
            "The offset cannot be right: where a sample determines the amplitude best, at the nearest turning point, ∂C/∂d₀ and \
             ∂C/∂A are equal but for the sign, so that its entry would have to be that of the amplitude. It is \
             {:.0} times smaller.",
            table_i::AMPLITUDE_NM / table_i::OFFSET_NM
        ))
        .remark(format!(
            "Nor can the frequency: ∂C/∂f = ∂C/∂φ·2πt grows with time, and a single sample says so little only \
             {:.1} µs after the phase was 0. Over one second the frequency is known to {:.1e} Hz.",
            when * 1e6,
            seconds[0][3]
        ))
        .figure(figure)
        .table(bounds)
}

fn wanted() -> Item {
    let resolution = |stroke_m: f64| 0.01 / (2.0 * stroke_m);
    let kept = line_height(2000e2, results::WANTED_NM * 1e-9);
    Item::new(&WANTED)
        .check(Check::value("resolution at 200 um", "1/cm", 25.0, SeedSpread::exact(resolution(200e-6)), CheckTolerance::digit(1.0)))
        .check(Check::value("resolution at ±0.5 mm", "1/cm", 10.0, SeedSpread::exact(resolution(500e-6)), CheckTolerance::digit(1.0)))
        .check(Check::claim(
            "50 nm are enough for 10 1/cm",
            "res_pos < 50 nm is necessary",
            format!("white errors of 50 nm leave {:.1} % of a line at 2000 1/cm", 100.0 * kept),
            "more than 95 % are left",
            kept > 0.95,
        ))
        .remark(
            "White errors of the position cost height and do not shift a line. What shifts lines is an amplitude \
             that is wrong: 0.33 %, the drift of one second at 20 %/min, moves a line at 2000 1/cm by 6.7 1/cm.",
        )
}
