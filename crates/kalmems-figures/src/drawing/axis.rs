//! The range of an axis, and where values and ticks lie on it.

use crate::decimate::{SMALLEST, is_drawable};
use crate::figure::{Axis, AxisScale};
use crate::prefix::{Prefixed, prefixed};
use crate::text::{decimal, power_of_ten, with_printed_unit, with_unit};

/// What an axis shows, from `low` to `high`, with `low < high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Range {
    pub(crate) scale: AxisScale,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Range {
    /// The range that the axis asks for, where it can be used.
    pub(crate) fn fixed(axis: &Axis) -> Option<Self> {
        let [low, high] = axis.range?;
        let usable = low < high && is_drawable(low) && is_drawable(high);
        let resolved = !is_constant(low, high);
        let below_log = axis.scale == AxisScale::Log && low < SMALLEST;
        (usable && resolved && !below_log).then_some(Self { scale: axis.scale, low, high })
    }

    /// All of the values, and `margin` of their span on either side. None where no value can be shown.
    pub(crate) fn around(scale: AxisScale, values: impl Iterator<Item = f64>, margin: f64) -> Option<Self> {
        let positive = |v: &f64| scale == AxisScale::Linear || *v >= SMALLEST;
        let (low, high) = values.filter(|v| is_drawable(*v)).filter(positive).fold(None, |range, v| {
            let (low, high) = range.unwrap_or((v, v));
            Some((v.min(low), v.max(high)))
        })?;
        Some(match scale {
            AxisScale::Linear => Self::linear(low, high, margin),
            AxisScale::Log => Self::log(low, high, margin),
        })
    }

    fn linear(low: f64, high: f64, margin: f64) -> Self {
        let scale = AxisScale::Linear;
        if is_constant(low, high) {
            let largest = low.abs().max(high.abs());
            let room = if largest >= SMALLEST { 0.1 * largest } else { 1.0 };
            return Self { scale, low: low - room, high: high + room };
        }
        let room = margin * (high - low);
        Self { scale, low: low - room, high: high + room }
    }

    fn log(low: f64, high: f64, margin: f64) -> Self {
        let decades = libm::log10(high) - libm::log10(low);
        let factor = libm::pow(10.0, if decades < 1e-6 { 0.5 } else { margin * decades });
        // The margin of hundreds of decades must not leave the numbers.
        Self { scale: AxisScale::Log, low: (low / factor).max(1e-302), high: (high * factor).min(1e302) }
    }

    /// Where a value lies: 0 at `low`, 1 at `high`. On a logarithmic axis −∞ for what is not positive.
    pub(crate) fn position(self, value: f64) -> f64 {
        match self.scale {
            AxisScale::Linear => (value - self.low) / (self.high - self.low),
            AxisScale::Log if value <= 0.0 => f64::NEG_INFINITY,
            AxisScale::Log => {
                let start = libm::log10(self.low);
                (libm::log10(value) - start) / (libm::log10(self.high) - start)
            }
        }
    }
}

/// Whether two ends are closer than numbers of their size can tell apart.
fn is_constant(low: f64, high: f64) -> bool {
    high - low <= (1e-13 * low.abs().max(high.abs())).max(SMALLEST)
}

/// A labelled mark at a value of the data.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tick {
    pub(crate) at: f64,
    pub(crate) label: String,
}

/// The marks of an axis and what it is called with them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Ticks {
    pub(crate) major: Vec<Tick>,
    /// Without labels: between the decades of a logarithmic axis.
    pub(crate) minor: Vec<f64>,
    /// Label, offset and prefixed unit: `time − 100 s (µs)`.
    pub(crate) title: String,
}

impl Ticks {
    /// About `count` marks at most.
    pub(crate) fn new(axis: &Axis, range: Range, count: f64) -> Self {
        if !axis.names.is_empty() {
            return named_ticks(axis);
        }
        match range.scale {
            AxisScale::Linear => linear_ticks(axis, range, count),
            AxisScale::Log => log_ticks(axis, range, count),
        }
    }

    pub(crate) fn none(axis: &Axis) -> Self {
        Self { major: Vec::new(), minor: Vec::new(), title: with_unit(&axis.label, &axis.unit) }
    }
}

fn named_ticks(axis: &Axis) -> Ticks {
    let names = axis.names.iter().enumerate();
    let major = names.map(|(place, name)| Tick { at: -(place as f64), label: name.clone() });
    Ticks { major: major.collect(), minor: Vec::new(), title: with_unit(&axis.label, &axis.unit) }
}

/// A mark is a whole number of `10^exponent`.
struct TickStep {
    mantissa: i64,
    exponent: i32,
}

impl TickStep {
    /// The smallest of 1, 2 and 5 times a power of ten that is at least `size`.
    fn at_least(size: f64) -> Self {
        let exponent = whole(libm::log10(size).floor());
        for mantissa in [1, 2, 5] {
            if mantissa as f64 * ten(exponent) >= size * (1.0 - 1e-9) {
                return Self { mantissa, exponent };
            }
        }
        Self { mantissa: 1, exponent: exponent + 1 }
    }
}

/// Labels with more characters than this are shortened by an offset in the title.
const LONGEST_LABEL: usize = 7;

fn linear_ticks(axis: &Axis, range: Range, count: f64) -> Ticks {
    let TickStep { mantissa, exponent } = TickStep::at_least((range.high - range.low) / count.max(1.0));
    let unit = ten(exponent);
    let step = mantissa as f64 * unit;
    // A little slack, so that a mark that falls on the end of the range is there.
    let first = whole64((range.low / step - 1e-6).ceil());
    let last = whole64((range.high / step + 1e-6).floor());
    let counts: Vec<i64> = (first..=last).take(100).map(|k| k.saturating_mul(mantissa)).collect();

    let largest = range.low.abs().max(range.high.abs());
    let prefix = prefixed(&axis.unit, largest);
    let longest = |p: &Prefixed| {
        counts.iter().map(|c| decimal(c.abs(), exponent - p.exponent).chars().count()).max().unwrap_or(0)
    };
    let (offset, prefix) = if longest(&prefix) > LONGEST_LABEL {
        let offset = offset_below(&counts);
        let left = counts.last().map_or(mantissa, |c| (c - offset).max(mantissa));
        (offset, prefixed(&axis.unit, left as f64 * unit))
    } else {
        (0, prefix)
    };
    Ticks {
        major: counts
            .iter()
            .map(|c| Tick {
                at: *c as f64 * unit,
                label: decimal(c.saturating_sub(offset), exponent - prefix.exponent),
            })
            .collect(),
        minor: Vec::new(),
        title: with_printed_unit(&with_offset(axis, offset, exponent), &prefix.unit),
    }
}

/// A round number at or below the first mark, so that what is left of the labels is as long as their span.
fn offset_below(counts: &[i64]) -> i64 {
    let (Some(first), Some(last)) = (counts.first(), counts.last()) else { return 0 };
    let mut round = 1_i64;
    while round <= last.saturating_sub(*first) {
        round = round.saturating_mul(10);
    }
    first.div_euclid(round).saturating_mul(round)
}

fn with_offset(axis: &Axis, offset: i64, exponent: i32) -> String {
    if offset == 0 {
        return axis.label.clone();
    }
    let sign = if offset < 0 { "+" } else { "−" };
    let size = offset.abs();
    let prefix = prefixed(&axis.unit, size as f64 * ten(exponent));
    let number = decimal(size, exponent - prefix.exponent);
    let number =
        if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { &number };
    format!("{} {sign} {number}{}{}", axis.label, prefix.joint(), prefix.unit).trim_end().to_owned()
}

fn log_ticks(axis: &Axis, range: Range, count: f64) -> Ticks {
    let (start, end) = (libm::log10(range.low), libm::log10(range.high));
    let (first, last) = (whole((start - 1e-9).ceil()), whole((end + 1e-9).floor()));
    let inside = |v: f64| v >= range.low * (1.0 - 1e-9) && v <= range.high * (1.0 + 1e-9);
    let all = |mantissas: &[i64]| -> Vec<(i64, i32)> {
        (first - 1..=last)
            .flat_map(|e| mantissas.iter().map(move |m| (*m, e)))
            .filter(|(m, e)| inside(*m as f64 * ten(*e)))
            .collect()
    };
    let decades = f64::from(last - first + 1);
    let (marks, minor) = if end - start >= 1.5 && decades >= 2.0 {
        let stride = whole((decades / count.max(2.0)).ceil()).max(1);
        let marks: Vec<_> = (first..=last).filter(|e| e.rem_euclid(stride) == 0).map(|e| (1, e)).collect();
        // Between labelled decades either their parts or the other decades.
        let minor = match stride {
            1 => all(&[2, 3, 4, 5, 6, 7, 8, 9]),
            2..=5 => all(&[1]),
            _ => Vec::new(),
        };
        (marks, minor)
    } else {
        (all(&[1, 2, 5]), all(&[3, 4, 6, 7, 8, 9]))
    };
    // Less than a decade, and not even 1, 2 or 5 twice.
    if marks.len() < 2 && end - start < 1.0 {
        return linear_ticks(axis, range, count.min(5.0));
    }
    let (low, high) = (marks.first().map_or(0, |m| m.1), marks.last().map_or(0, |m| m.1));
    let at_top = prefixed(&axis.unit, ten(high));
    let at_one = prefixed(&axis.unit, 1.0);
    let prefix = if low - at_top.exponent >= -3 && !at_top.is_power { at_top } else { at_one };
    let plain = low - prefix.exponent >= -3 && high - prefix.exponent <= 4;
    let label = |m: i64, e: i32| match (plain, m, e) {
        (true, _, _) => decimal(m, e - prefix.exponent),
        (false, _, 0) => m.to_string(),
        (false, 1, 1) => "10".to_owned(),
        (false, 1, _) => power_of_ten(e),
        (false, _, _) => format!("{m}·{}", power_of_ten(e)),
    };
    Ticks {
        major: marks.iter().map(|(m, e)| Tick { at: *m as f64 * ten(*e), label: label(*m, *e) }).collect(),
        minor: minor.iter().map(|(m, e)| *m as f64 * ten(*e)).collect(),
        title: with_printed_unit(&axis.label, &prefix.unit),
    }
}

/// A power of ten, rounded once; `powi` is not.
fn ten(exponent: i32) -> f64 {
    format!("1e{exponent}").parse().unwrap_or(f64::NAN)
}

#[allow(clippy::cast_possible_truncation)] // a cast saturates, and exponents lie within ±400
fn whole(x: f64) -> i32 {
    x as i32
}

#[allow(clippy::cast_possible_truncation)] // a cast saturates, and counts of steps lie within ±1e15
fn whole64(x: f64) -> i64 {
    x as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ticks(unit: &str, low: f64, high: f64, count: f64) -> (String, String) {
        let axis = Axis::new("q", unit);
        let got = Ticks::new(&axis, Range { scale: AxisScale::Linear, low, high }, count);
        (got.major.iter().map(|t| t.label.as_str()).collect::<Vec<_>>().join(" "), got.title)
    }

    #[test]
    fn names_stand_in_place_of_numbers_within_the_range() {
        let axis = Axis::of_names(["all".to_owned(), "noise".to_owned()]);
        let range = Range::fixed(&axis).unwrap();
        let ticks = Ticks::new(&axis, range, 3.0);
        let marks: Vec<(f64, &str)> = ticks.major.iter().map(|tick| (tick.at, tick.label.as_str())).collect();
        assert_eq!(marks, [(0.0, "all"), (-1.0, "noise")]);
        assert!(marks.iter().all(|(at, _)| (0.0..=1.0).contains(&range.position(*at))), "{range:?}");
        assert!(ticks.title.is_empty() && ticks.minor.is_empty());
    }

    #[test]
    fn labels_are_short_and_exact() {
        for (unit, low, high, count, labels, title) in [
            ("s", 0.0, 0.3e-3, 7.0, "0 50 100 150 200 250 300", "q (µs)"),
            ("s", 22.0e-3, 22.3e-3, 7.0, "22.00 22.05 22.10 22.15 22.20 22.25 22.30", "q (ms)"),
            ("s", 0.0, 24e-3, 6.0, "0 5 10 15 20", "q (ms)"),
            ("s", 0.0, 3600.0, 4.0, "0 1000 2000 3000", "q (s)"),
            ("V", -1.06, 1.06, 5.0, "−1.0 −0.5 0.0 0.5 1.0", "q (V)"),
            ("F", 0.0, 5.7e-12, 3.0, "0 2 4", "q (pF)"),
            ("Hz", 15_000.0, 16_000.0, 3.0, "15.0 15.5 16.0", "q (kHz)"),
            ("deg", -0.8e-1, 0.8e-1, 4.0, "−0.05 0.00 0.05", "q (deg)"),
            ("deg", -2e-3, 2e-3, 4.0, "−2 −1 0 1 2", "q (10⁻³ deg)"),
            ("V^2", 0.0, 2e-6, 4.0, "0.0 0.5 1.0 1.5 2.0", "q (10⁻⁶ V²)"),
            ("V/sqrt(Hz)", 0.0, 2e-6, 2.0, "0 1 2", "q (µV/√Hz)"),
            ("", 0.0, 1e-21, 2.0, "0.0 0.5 1.0", "q (10⁻²¹)"),
            ("rad/s", 0.0, 1e5, 2.0, "0 50 100", "q (krad/s)"),
            // Offsets that no label could hold.
            ("s", 100.0003, 100.0006, 3.0, "300 400 500 600", "q − 100 s (µs)"),
            ("s", 100.0013, 100.0016, 3.0, "300 400 500 600", "q − 100.001 s (µs)"),
            ("Hz", 15_700.000_1, 15_700.000_3, 2.1, "100 200 300", "q − 15.7 kHz (µHz)"),
            ("V", -2.000_000_2, -2.0, 2.0, "0.8 0.9 1.0", "q + 2.000001 V (µV)"),
        ] {
            assert_eq!(ticks(unit, low, high, count), (labels.to_owned(), title.to_owned()), "{low}..{high}");
        }
    }

    fn log_labels(unit: &str, low: f64, high: f64, count: f64) -> (String, String) {
        let axis = Axis::new("q", unit).log();
        let got = Ticks::new(&axis, Range { scale: AxisScale::Log, low, high }, count);
        (got.major.iter().map(|t| t.label.as_str()).collect::<Vec<_>>().join(" "), got.title)
    }

    #[test]
    fn decades_are_labelled() {
        for (unit, low, high, labels, title) in [
            ("", 0.01, 20.0, "0.01 0.1 1 10", "q"),
            ("", 0.9e-4, 20.0, "10⁻⁴ 10⁻³ 10⁻² 10⁻¹ 1 10", "q"),
            ("Hz", 10.0, 5e5, "0.01 0.1 1 10 100", "q (kHz)"),
            ("V^2/Hz", 1e-14, 1e-10, "10⁻¹⁴ 10⁻¹³ 10⁻¹² 10⁻¹¹ 10⁻¹⁰", "q (V²/Hz)"),
            ("", 1e-14, 1e6, "10⁻¹² 10⁻⁸ 10⁻⁴ 1 10⁴", "q"),
            ("", 1.5, 6.0, "2 5", "q"),
            ("", 3.0, 12.0, "5 10", "q"),
            ("", 3.1, 3.4, "3.1 3.2 3.3 3.4", "q"),
        ] {
            assert_eq!(
                log_labels(unit, low, high, 6.0),
                (labels.to_owned(), title.to_owned()),
                "{low}..{high}"
            );
        }
    }

    #[test]
    fn ranges_fit_what_they_show() {
        let around = |values: &[f64]| Range::around(AxisScale::Linear, values.iter().copied(), 0.05).unwrap();
        let range = around(&[1.0, -1.0]);
        approx::assert_relative_eq!(range.low, -1.1);
        approx::assert_relative_eq!(range.high, 1.1);
        // Constants, tiny and huge ones.
        for v in [0.0, 1e-21, -5.0, 1e300, f64::from_bits(1)] {
            let range = around(&[v]);
            assert!(range.low < v && v < range.high, "{v:e} {range:?}");
        }
        assert!(Range::around(AxisScale::Linear, [f64::NAN].into_iter(), 0.0).is_none());
        assert!(Range::around(AxisScale::Log, [0.0, -1.0].into_iter(), 0.0).is_none());
        for bad in [[1.0, 1.0], [2.0, 1.0], [f64::NAN, 1.0], [0.0, f64::INFINITY]] {
            assert_eq!(Range::fixed(&Axis::new("", "").between(bad[0], bad[1])), None);
        }
        assert_eq!(Range::fixed(&Axis::new("", "").log().between(0.0, 1.0)), None);
    }

    fn magnitude() -> impl Strategy<Value = f64> {
        (-300.0..300.0_f64, any::<bool>())
            .prop_map(|(e, minus)| 10_f64.powf(e) * if minus { -1.0 } else { 1.0 })
    }

    proptest! {
        #[test]
        fn ticks_lie_inside_and_say_their_value(
            centre in magnitude(),
            relative in -12.0..2.0_f64,
            count in 1.0..20.0_f64,
        ) {
            let half = centre.abs() * 10_f64.powf(relative);
            prop_assume!(half.is_finite() && half > 0.0);
            let Some(range) = Range::around(AxisScale::Linear, [centre - half, centre + half].into_iter(), 0.05)
                else { return Ok(()) };
            let ticks = Ticks::new(&Axis::new("q", ""), range, count);
            // Room for one in 5/2 of the step that was asked for, at worst.
            prop_assert!(ticks.major.len() as f64 <= count + 2.0);
            prop_assert!(count < 5.0 || ticks.major.len() >= 2, "{ticks:?}");
            for tick in &ticks.major {
                let position = range.position(tick.at);
                prop_assert!((-1e-3..=1.001).contains(&position), "{position}");
                prop_assert!(tick.label.chars().count() <= LONGEST_LABEL + 1, "{ticks:?}");
            }
            // All labels differ from each other by the same amount.
            let numbers: Vec<f64> =
                ticks.major.iter().map(|t| t.label.replace('−', "-").parse().unwrap()).collect();
            for pair in numbers.windows(3) {
                let (a, b) = (pair[1] - pair[0], pair[2] - pair[1]);
                prop_assert!((a - b).abs() < 1e-6 * a.abs(), "{numbers:?}");
            }
        }

        #[test]
        fn log_ticks_lie_inside(low in -300.0..299.0_f64, decades in 0.001..500.0_f64, count in 1.0..20.0_f64) {
            let (low, high) = (10_f64.powf(low), 10_f64.powf((low + decades).min(300.0)));
            prop_assume!(low < high);
            let Some(range) = Range::around(AxisScale::Log, [low, high].into_iter(), 0.02) else { return Ok(()) };
            let ticks = Ticks::new(&Axis::new("q", "").log(), range, count);
            prop_assert!(ticks.major.len() + ticks.minor.len() <= 200);
            for at in ticks.major.iter().map(|t| t.at).chain(ticks.minor) {
                let position = range.position(at);
                prop_assert!((-1e-3..=1.001).contains(&position), "{position}");
            }
        }
    }
}
