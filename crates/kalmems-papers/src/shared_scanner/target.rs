//! The phase accuracy that an image needs.

use super::published::{d_target, s_target};
use crate::program::{
    Check, CheckTolerance, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, SeedSpread,
    ValueOrigin,
};
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};
use std::f64::consts::TAU;

/// S equation 7.
pub static SCANNER: ItemHead = ItemHead {
    key: "target-phase",
    title: "phase accuracy that an image needs",
    kind: ItemKind::Table,
    places: &[PaperPlace { paper: "S", label: "Equation 7", page: "sections II-A and IV-C" }],
    origin: ValueOrigin::Computed,
};

/// D equation 79.
pub static SAMPLING: ItemHead = ItemHead {
    key: "target-sampling",
    title: "phase accuracy that the sampling allows",
    kind: ItemKind::Table,
    places: &[PaperPlace { paper: "D", label: "Equation 79", page: "page 82" }],
    origin: ValueOrigin::Computed,
};

/// The largest shift in pixels on a line of 2m pixels when the phase is off by this much, over all phases.
fn largest_shift(m: f64, error_rad: f64) -> u32 {
    const PHASES: u32 = 50_000;
    let index = |phase: f64| (m * phase.sin()).ceil();
    let shift = |i: u32| {
        let phase = TAU * f64::from(i) / f64::from(PHASES);
        (index(phase + error_rad) - index(phase)).abs()
    };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count of pixels
    let largest = (0..PHASES).map(shift).fold(0.0, f64::max) as u32;
    largest
}

/// Both targets.
#[allow(clippy::unnecessary_wraps)] // the signature of every part
pub fn run(_: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let mut scanner = Item::new(&SCANNER);
    for (pixels, shift, printed) in s_target::TARGETS {
        let m = f64::from(pixels) / 2.0;
        let bound = (f64::from(shift) / m).to_degrees();
        let quantity = format!("{pixels} pixels, shift of {shift}");
        scanner = scanner.check(Check::value(
            quantity,
            "deg",
            printed,
            SeedSpread::exact(bound),
            CheckTolerance::digit(0.01),
        ));
    }
    let m = 150.0;
    let at = |pixels: f64| largest_shift(m, pixels / m);
    let (at_bound, beyond) = (at(1.0), at(1.02));
    let errors = || (0..=150).map(|i| 0.02 * f64::from(i));
    let shifts: Vec<(f64, f64)> = errors().map(|p| ((p / m).to_degrees(), f64::from(at(p)))).collect();
    let bound = errors().map(|p| ((p / m).to_degrees(), p));
    let figure = Figure::new(
        "target-phase_shift",
        "Shift of pixels against phase error, 300 pixels",
        "The largest shift over all phases of a sweep, counted, and the line that S equation 7 draws: a whole pixel is \
         lost as soon as the phase error is beyond p/m.",
    )
    .with(
        Panel::new(Axis::new("phase error", "deg"), Axis::new("largest shift (pixels)", ""))
            .with(Series::points("counted", SeriesRole::Model, shifts))
            .with(Series::line("m·δφ", SeriesRole::Bound, bound)),
    );
    let scanner = scanner
        .check(Check::claim(
            "the bound is met at p/m and broken beyond it (m = 150, p = 1)",
            "shift of at most 1",
            format!("shift of {at_bound} at p/m, {beyond} at 1.02·p/m"),
            "counted over all phases",
            at_bound == 1 && beyond == 2,
        ))
        .remark(
            "S equation 1 should read x = ½·sin(·) + ½: as printed, the line would be two fields of view long. The \
             bound itself is exact with the ceiling of equation 2. Between a forward and a backward pass the two \
             shifts add up, so that the blur is twice the bound.",
        )
        .figure(figure);

    let cycles = d_target::INTERVALS * d_target::RESONANCE_HZ / d_target::SAMPLING_HZ;
    let sampling = Item::new(&SAMPLING)
        .check(Check::value(
            "two sampling intervals at 10 MHz, 15.5 kHz",
            "deg",
            d_target::PRINTED_DEG,
            SeedSpread::exact(360.0 * cycles),
            CheckTolerance::digit(0.01),
        ))
        .remark(format!(
            "The equation gives cycles, {cycles:.4}. The printed 0.18 degrees are these {cycles:.4} taken for radians: a \
             factor of 2π is missing."
        ));
    Ok(vec![scanner, sampling])
}

#[cfg(test)]
mod tests {
    use super::largest_shift;

    /// m·(sin(ψ + δ) − sin ψ) is at most 2m·sin(δ/2) and reaches it: so many pixels, rounded up.
    #[test]
    fn the_largest_shift_is_the_chord_rounded_up() {
        for m in [50.0, 150.0, 200.0] {
            for pixels in [0.5, 0.99, 1.03, 1.7, 2.5, 3.2] {
                let error: f64 = pixels / m;
                let chord = 2.0 * m * (0.5 * error).sin();
                assert_eq!(f64::from(largest_shift(m, error)), chord.ceil(), "{m} {pixels}");
            }
        }
    }
}
