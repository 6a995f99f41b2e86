//! Which lines the two drives make, and what they come near to.

use crate::simulate::{Drive, Stability, Tone};
use kalmems_core::Portable;
use kalmems_models::dynamics::{ParametricScanner, TwoAxisScanner};
use serde::Serialize;
use std::f64::consts::TAU;
use std::fmt;

/// A drive of both axes: offset + Σ amplitude·sin(2πft).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlannedDrive {
    /// In V.
    pub offset: f64,
    /// Of the sine for x and of that for y, in V.
    pub amplitude: [f64; 2],
    /// Their frequencies f_x and f_y, about twice the resonances.
    pub frequency_hz: [f64; 2],
}

impl PlannedDrive {
    /// A drive of two tones; `None` for any other.
    pub fn of(drive: &Drive) -> Option<Self> {
        let Drive::Tones { offset, tones } = drive else { return None };
        let [Tone { amplitude: a, frequency_hz: f, .. }, Tone { amplitude: b, frequency_hz: g, .. }] =
            tones.as_slice()
        else {
            return None;
        };
        Some(Self { offset: *offset, amplitude: [*a, *b], frequency_hz: [*f, *g] })
    }

    /// The mean of V² in V².
    fn mean_square(&self) -> f64 {
        self.amplitude.iter().fold(self.offset * self.offset, |sum, a| sum + 0.5 * a * a)
    }
}

/// Where a line stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LinePlace {
    /// In the square of the voltage: it modulates the stiffness of both axes.
    SquareVoltage,
    /// In the demodulated signal.
    Signal,
}

/// A line at m·f_x + n·f_y.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CombinationLine {
    /// Where.
    pub place: LinePlace,
    /// m and n; of a difference the sign that makes the frequency positive.
    pub multiples: [i32; 2],
    /// Its frequency.
    pub frequency_hz: f64,
    /// Its amplitude in V², of a line in the square of the voltage.
    pub square_volts: Option<f64>,
}

/// What a line must keep away from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum ProtectedBand {
    /// 2·f/order of an axis, f its resonance: there a modulated stiffness can start a motion.
    Parametric {
        /// 0 for x, 1 for y.
        axis: usize,
        /// From 1.
        order: i32,
        /// 2·f/order.
        frequency_hz: f64,
    },
    /// A harmonic of an axis's drive, where the signal tells of that axis.
    Motion {
        /// 0 for x, 1 for y.
        axis: usize,
        /// From 1.
        harmonic: i32,
        /// Its frequency.
        frequency_hz: f64,
    },
    /// No frequency: a line near it moves the signal's offset, or the stiffness slowly.
    Offset,
}

/// A line near a band.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Conflict {
    /// The line.
    pub line: CombinationLine,
    /// The band.
    pub band: ProtectedBand,
    /// From the band to the line; below 0 for a line below it.
    pub distance_hz: f64,
    /// For a parametric resonance of order 1: the line's pump depth over the one that starts a motion.
    pub over_threshold: Option<f64>,
}

/// The plan of one drive.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BandPlan {
    /// The drive, its first sine that of x.
    pub drive: PlannedDrive,
    /// The resonances of x and y at rest, with the mean stiffness of the electrodes under both drives.
    pub resonance_hz: [f64; 2],
    /// Every line.
    pub lines: Vec<CombinationLine>,
    /// How far lines shall be from bands.
    pub guard_hz: f64,
    /// Those that are not, the nearest first.
    pub conflicts: Vec<Conflict>,
    /// The line that is nearest to any band.
    pub nearest: Option<Conflict>,
    /// What is said of each axis with its own drive, in words.
    pub oscillates: [String; 2],
    /// Drive frequencies at which both axes start by themselves and all lines keep as far away as they can, and how
    /// far that is. `None` where an axis does not start.
    pub suggestion: Option<([f64; 2], f64)>,
}

/// Parametric resonances that are looked at: the next ones need far more than the drives can give.
const ORDERS: i32 = 4;
/// Harmonics of the motion that the signal tells of.
const WANTED: i32 = 2;
/// Harmonics of the other axis, and the order of products |m| + |n|, that are looked at in the signal.
const PRODUCTS: i32 = 3;
/// Frequencies tried in each tongue for a suggestion.
const TRIED: u32 = 41;

impl BandPlan {
    /// A guard that a window of 2 ms resolves.
    pub const GUARD_HZ: f64 = 500.0;

    /// The plan of a scanner under a drive. Of the two sines the one nearer to twice its resonance is that of x.
    ///
    /// V² of V = V_o + V_x·sin + V_y·sin has lines at f_x and f_y (2·V_o·V), 2·f_x and 2·f_y (½·V²), f_x ± f_y
    /// (V_x·V_y) and no others. In the signal each axis has its drive's harmonics; products of both come from motions
    /// that V² modulates and from a detector that is not linear. Of those the frequencies are given alone.
    pub fn of(scanner: &TwoAxisScanner<f64>, drive: &PlannedDrive, guard_hz: f64) -> Self {
        let axes = [scanner.x, scanner.y];
        let mean = drive.mean_square();
        let mut drive = *drive;
        let rest = axes.map(|axis| stability(&axis, mean, 0.0, 0.0).resonance_hz);
        let away =
            |sine: usize, axis: usize| (drive.frequency_hz[sine] / (2.0 * rest[axis])).portable_ln().abs();
        if away(0, 0) + away(1, 1) > away(1, 0) + away(0, 1) {
            drive.frequency_hz.swap(0, 1);
            drive.amplitude.swap(0, 1);
        }
        let own = [0, 1].map(|i| {
            stability(&axes[i], mean, 2.0 * drive.offset * drive.amplitude[i], drive.frequency_hz[i])
        });
        let judge = |drive: &PlannedDrive| judge(&axes, rest, mean, drive);
        let near = judge(&drive);
        let suggestion = suggest(&own.map(|axis| axis.tongue_hz()), |frequency_hz| {
            judge(&PlannedDrive { frequency_hz, ..drive })
                .first()
                .map_or(f64::INFINITY, |c| c.distance_hz.abs())
        });
        Self {
            drive,
            resonance_hz: rest,
            lines: lines(&drive),
            guard_hz,
            nearest: near.first().copied(),
            conflicts: near.into_iter().filter(|c| c.distance_hz.abs() < guard_hz).collect(),
            oscillates: own.map(|axis| axis.to_string()),
            suggestion,
        }
    }

    /// Whether every line keeps the guard.
    pub fn is_clear(&self) -> bool {
        self.conflicts.is_empty()
    }
}

/// An axis with the electrodes' mean stiffness, pumped by one line of V².
fn stability(axis: &ParametricScanner<f64>, mean: f64, component: f64, line_hz: f64) -> Stability {
    let per_square_volt = -0.5 * axis.comb.curvature_at_rest();
    let stiffness = axis.resonator.stiffness + per_square_volt * (mean + axis.carrier_mean_square);
    let rate = (stiffness / axis.resonator.inertia).sqrt();
    Stability {
        resonance_hz: rate / TAU,
        quality: axis.resonator.inertia * rate / axis.resonator.damping,
        harmonic: 1,
        pump_depth: per_square_volt * component.abs() / stiffness,
        drive_hz: [line_hz; 2],
    }
}

fn lines(drive: &PlannedDrive) -> Vec<CombinationLine> {
    let [f, g] = drive.frequency_hz;
    let [a, b] = drive.amplitude.map(f64::abs);
    let line = |place, [m, n]: [i32; 2], square_volts| {
        let frequency = f64::from(m) * f + f64::from(n) * g;
        let sign = if frequency < 0.0 { -1 } else { 1 };
        CombinationLine {
            place,
            multiples: [sign * m, sign * n],
            frequency_hz: frequency.abs(),
            square_volts,
        }
    };
    let offset = drive.offset.abs();
    let mut lines: Vec<CombinationLine> = [
        ([1, 0], 2.0 * offset * a),
        ([0, 1], 2.0 * offset * b),
        ([2, 0], 0.5 * a * a),
        ([0, 2], 0.5 * b * b),
        ([1, -1], a * b),
        ([1, 1], a * b),
    ]
    .map(|(multiples, amplitude)| line(LinePlace::SquareVoltage, multiples, Some(amplitude)))
    .into();
    for m in 0..=PRODUCTS {
        for n in -PRODUCTS..=PRODUCTS {
            // Of ±(m, n) one is enough.
            let is_new = m > 0 || n > 0;
            if is_new && m + n.abs() <= PRODUCTS {
                lines.push(line(LinePlace::Signal, [m, n], None));
            }
        }
    }
    lines
}

/// Every line with its nearest band, the nearest pair first.
fn judge(
    axes: &[ParametricScanner<f64>; 2],
    rest: [f64; 2],
    mean: f64,
    drive: &PlannedDrive,
) -> Vec<Conflict> {
    let mut bands = vec![ProtectedBand::Offset];
    for (axis, resonance_hz) in rest.iter().enumerate() {
        bands.extend((1..=ORDERS).map(|order| {
            let frequency_hz = 2.0 * resonance_hz / f64::from(order);
            ProtectedBand::Parametric { axis, order, frequency_hz }
        }));
        bands.extend((1..=WANTED).map(|harmonic| {
            let frequency_hz = f64::from(harmonic) * drive.frequency_hz[axis];
            ProtectedBand::Motion { axis, harmonic, frequency_hz }
        }));
    }
    let lines = lines(drive);
    let mut near: Vec<Conflict> = (lines.iter())
        .filter_map(|line| {
            let of_line = bands.iter().filter(|band| band.minds(line)).map(|band| Conflict {
                line: *line,
                band: *band,
                distance_hz: line.frequency_hz - band.frequency_hz(),
                over_threshold: match (band, line.square_volts) {
                    (ProtectedBand::Parametric { axis, order: 1, .. }, Some(component)) => {
                        let pumped = stability(&axes[*axis], mean, component, line.frequency_hz);
                        Some(pumped.pump_depth / pumped.threshold())
                    }
                    _ => None,
                },
            });
            of_line.min_by(|a, b| a.distance_hz.abs().total_cmp(&b.distance_hz.abs()))
        })
        .collect();
    near.sort_by(|a, b| a.distance_hz.abs().total_cmp(&b.distance_hz.abs()));
    near
}

/// The frequencies in the middle half of both tongues that keep every line farthest from every band.
fn suggest(tongues: &[Option<[f64; 2]>; 2], distance: impl Fn([f64; 2]) -> f64) -> Option<([f64; 2], f64)> {
    let [Some(x), Some(y)] = tongues else { return None };
    let at = |[low, high]: [f64; 2], i: u32| {
        low + (high - low) * (0.25 + 0.5 * f64::from(i) / f64::from(TRIED - 1))
    };
    let tried = (0..TRIED).flat_map(|i| (0..TRIED).map(move |j| [at(*x, i), at(*y, j)]));
    tried.map(|pair| (pair, distance(pair))).max_by(|a, b| a.1.total_cmp(&b.1))
}

impl ProtectedBand {
    /// Its middle.
    pub fn frequency_hz(&self) -> f64 {
        match self {
            Self::Parametric { frequency_hz, .. } | Self::Motion { frequency_hz, .. } => *frequency_hz,
            Self::Offset => 0.0,
        }
    }

    /// Whether a line can disturb it: not the one that it is there for.
    fn minds(&self, line: &CombinationLine) -> bool {
        let own =
            |axis: usize, multiple: i32| line.multiples[axis] == multiple && line.multiples[1 - axis] == 0;
        match (self, line.place) {
            (Self::Parametric { axis, order: 1, .. }, LinePlace::SquareVoltage) => !own(*axis, 1),
            // At no frequency: a slow modulation of the stiffness is a slow change of both motions.
            (Self::Parametric { .. }, LinePlace::SquareVoltage) | (Self::Offset, _) => true,
            (Self::Motion { axis, harmonic, .. }, LinePlace::Signal) => !own(*axis, *harmonic),
            _ => false,
        }
    }
}

const AXES: [char; 2] = ['x', 'y'];

impl fmt::Display for CombinationLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = self.multiples.iter().zip(AXES).filter(|(m, _)| **m != 0).collect::<Vec<_>>();
        parts.sort_by_key(|(m, _)| **m < 0);
        for (k, (m, axis)) in parts.into_iter().enumerate() {
            let sign = match (k, *m < 0) {
                (0, false) => "",
                (0, true) => "−",
                (_, false) => " + ",
                (_, true) => " − ",
            };
            let times = if m.abs() == 1 { String::new() } else { format!("{}·", m.abs()) };
            write!(f, "{sign}{times}f_{axis}")?;
        }
        let place = match self.place {
            LinePlace::SquareVoltage => "in V²",
            LinePlace::Signal => "in the signal",
        };
        write!(f, " {place} ({:.3} kHz)", self.frequency_hz / 1e3)
    }
}

impl fmt::Display for ProtectedBand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let khz = self.frequency_hz() / 1e3;
        match self {
            Self::Parametric { axis, order, .. } => {
                write!(f, "the parametric resonance of order {order} of {} ({khz:.3} kHz)", AXES[*axis])
            }
            Self::Motion { axis, harmonic, .. } => {
                write!(f, "harmonic {harmonic} of the motion of {} ({khz:.3} kHz)", AXES[*axis])
            }
            Self::Offset => write!(f, "no frequency"),
        }
    }
}

impl fmt::Display for Conflict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} is {:.0} Hz from {}", self.line, self.distance_hz.abs(), self.band)?;
        match self.over_threshold {
            Some(ratio) => write!(f, ", with {ratio:.2} of the pump depth that starts a motion"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for BandPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (axis, text) in AXES.iter().zip(&self.oscillates) {
            writeln!(f, "{axis} {text}")?;
        }
        if self.is_clear() {
            write!(f, "band plan: clear by {:.0} Hz", self.guard_hz)?;
            if let Some(nearest) = &self.nearest {
                write!(f, "; the nearest: {nearest}")?;
            }
        } else {
            write!(
                f,
                "band plan: {} of the lines are nearer than {:.0} Hz",
                self.conflicts.len(),
                self.guard_hz
            )?;
            for conflict in &self.conflicts {
                write!(f, "\n  {conflict}")?;
            }
        }
        match self.suggestion {
            _ if self.is_clear() => Ok(()),
            Some(([x, y], distance)) if distance >= self.guard_hz => {
                write!(f, "\n  drives of {:.2} and {:.2} kHz keep {distance:.0} Hz", x / 1e3, y / 1e3)
            }
            Some(([x, y], distance)) => write!(
                f,
                "\n  no drives at which both axes start by themselves keep that; {:.2} and {:.2} kHz keep {distance:.0} \
                 Hz: move a resonance",
                x / 1e3,
                y / 1e3
            ),
            None => write!(f, "\n  an axis does not start by itself; no drives are suggested"),
        }
    }
}
