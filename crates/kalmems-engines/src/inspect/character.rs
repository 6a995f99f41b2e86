//! What a channel seems to show, in the words of a laboratory.

use super::quantity::quantity;
use super::{InspectedChannel, Inspection};

/// What a channel seems to show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Character {
    /// All its values are the same one.
    Constant(f64),
    /// No line stands out of its noise; this is its standard deviation, in SI.
    Noise(f64),
    /// No line stands out of its noise, and yet it changes little from sample to sample: less than a few cycles of a motion, or a drift.
    /// From its lowest to its highest value.
    Slow(f64),
    /// A line stands out of the noise.
    Swing {
        /// The frequency of the strongest line, in Hz or in cycles per sample.
        frequency: f64,
        /// Its amplitude over the whole segment, in SI.
        amplitude: f64,
        /// What becomes of the swing.
        course: SwingCourse,
        /// The frequencies from which and to which it is swept, where it is.
        swept: Option<(f64, f64)>,
    },
}

/// What becomes of a swing from the beginning of a segment to its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SwingCourse {
    /// It stays as large as it is.
    Steady,
    /// It becomes smaller, to this part of its size.
    Decays(f64),
    /// It becomes larger, to so many times its size.
    Grows(f64),
}

/// Into so many parts a segment is cut, to see how the size of a swing changes.
const PARTS: usize = 64;
/// The sizes of so many parts at either end are compared.
const AT_AN_END: usize = 6;
/// A signal whose roughness is below this is no noise that a filter would take for white.
const SMOOTH: f64 = 0.1;
/// A swing that changes by less than this factor is steady.
const CHANGES: f64 = 1.5;

impl Inspection {
    /// What a channel seems to show, by the longest segment; `None` where it has no values.
    pub fn character(&self, channel: &InspectedChannel) -> Option<Character> {
        let figures = &channel.statistics;
        let (low, high) = (figures.minimum?, figures.maximum?);
        if low.total_cmp(&high).is_eq() {
            return Some(Character::Constant(low));
        }
        let Some(line) = channel.spectrum.as_ref().and_then(|spectrum| spectrum.lines.first()) else {
            let is_smooth = channel.course.roughness.is_some_and(|roughness| roughness < SMOOTH);
            let noise = figures.standard_deviation.map(Character::Noise);
            return if is_smooth { Some(Character::Slow(high - low)) } else { noise };
        };
        let course = self.course(channel).unwrap_or(SwingCourse::Steady);
        Some(Character::Swing {
            frequency: line.frequency,
            amplitude: line.amplitude,
            course,
            swept: channel.course.swept,
        })
    }

    fn course(&self, channel: &InspectedChannel) -> Option<SwingCourse> {
        let rows = self.longest_segment()?.rows;
        let series = self.series(&channel.column, 0..rows, PARTS)?;
        let sizes: Vec<f64> =
            series.maximum.iter().zip(&series.minimum).map(|(high, low)| high - low).collect();
        let middle = |sizes: &[f64]| {
            let mut sizes: Vec<f64> = sizes.iter().copied().filter(|size| size.is_finite()).collect();
            sizes.sort_by(f64::total_cmp);
            sizes.get(sizes.len() / 2).copied().filter(|size| *size > 0.0)
        };
        let first = middle(sizes.get(..AT_AN_END)?)?;
        let last = middle(sizes.get(sizes.len().checked_sub(AT_AN_END)?..)?)?;
        Some(match last / first {
            factor if factor > CHANGES => SwingCourse::Grows(factor),
            factor if factor < 1.0 / CHANGES => SwingCourse::Decays(factor),
            _ => SwingCourse::Steady,
        })
    }
}

impl Character {
    /// In words, with the unit of the channel's values and that of frequencies.
    pub fn sentence(self, unit: &str, frequency_unit: &str) -> String {
        match self {
            Self::Constant(value) => format!("always {}", quantity(value, unit)),
            Self::Noise(sd) => {
                format!(
                    "no line stands out of its noise, which has a standard deviation of {}",
                    quantity(sd, unit)
                )
            }
            Self::Slow(range) => {
                format!("a smooth change by {}, without a line in its spectrum", quantity(range, unit))
            }
            Self::Swing { course, swept: Some((first, last)), .. } => {
                let course = match course {
                    SwingCourse::Steady => "",
                    SwingCourse::Decays(_) => ", and it decays",
                    SwingCourse::Grows(_) => ", and it grows",
                };
                let [first, last] = [first, last].map(|frequency| quantity(frequency, frequency_unit));
                format!("a swing whose frequency is swept from about {first} to {last}{course}")
            }
            Self::Swing { frequency, amplitude, course, swept: None } => {
                let course = match course {
                    SwingCourse::Steady => "of a steady size".to_owned(),
                    SwingCourse::Decays(factor) => {
                        format!("that decays to {:.0} % of its size", 100.0 * factor)
                    }
                    SwingCourse::Grows(factor) => format!("that grows to {factor:.1} times its size"),
                };
                let (frequency, amplitude) = (quantity(frequency, frequency_unit), quantity(amplitude, unit));
                format!("a swing {course}, its strongest line {amplitude} at {frequency}")
            }
        }
    }
}
