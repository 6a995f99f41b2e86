//! A filter along a recording, corrected in one of many ways.

use crate::devices::{Device, Number};
use crate::recording::{EVENT, Recording, SAMPLES};
use kalmems_core::update::{Decimation, Gate, OnNeed, Sequential};
use kalmems_core::{Covariance, Delayed, Filter, FilterError, Innovation, LinearMeasurement, Lu, Mat};
use std::num::NonZeroU32;

/// When the other sensor is used: at every twentieth sample, its number being about that sample.
#[derive(Clone, Copy, PartialEq)]
pub enum Events {
    Never,
    InTime,
    /// One sample later, looking back.
    LookingBack,
}

/// Whether a sample is one of those that the other sensor speaks about.
pub fn event(sample: usize) -> bool {
    sample % 20 == 10
}

/// How a filter is corrected.
#[derive(Clone, Copy)]
pub struct Corrections {
    /// The largest NIS per component.
    pub gate: f64,
    /// The least change in standard deviations.
    pub need: f64,
    pub every: u32,
    /// One component after the other.
    pub sequential: bool,
    pub events: Events,
    /// Where there is no number.
    pub missing: fn(usize) -> bool,
}

/// All samples, as they come.
pub const PLAIN: Corrections = Corrections {
    gate: f64::INFINITY,
    need: 0.0,
    every: 1,
    sequential: false,
    events: Events::Never,
    missing: |_| false,
};

/// What a filter said at one sample, after its corrections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Said<const N: usize> {
    pub mean: [f64; N],
    pub deviation: [f64; N],
    /// Of the device's own sensor, where it was asked.
    pub nis: Option<f64>,
    pub taken: bool,
}

pub type Trace<const N: usize> = Vec<Said<N>>;

/// A number of the recording as the filter has it.
pub fn narrow<T: Number, const M: usize>(y: &[f64; M]) -> [T; M] {
    y.map(T::of)
}

/// Mean and standard deviations in f64.
pub fn said<T: Number, F: Filter<T, N>, const N: usize>(
    filter: &F,
    nis: Option<f64>,
    taken: bool,
) -> Said<N> {
    let covariance = filter.covariance();
    Said {
        mean: filter.mean().map(Into::into),
        deviation: std::array::from_fn(|i| covariance.get(i, i).into().sqrt()),
        nis,
        taken,
    }
}

/// The one policy of all corrections here, with bounds that may decline nothing.
pub type Picky<T> = (Gate<T>, OnNeed<T>);

/// Declines nothing.
pub fn takes_all<T: Number>() -> Picky<T> {
    (Gate { nis: T::of(f64::INFINITY) }, OnNeed { fraction: T::of(0.0) })
}

/// Nothing for a while, and one in three missing after it.
pub fn missing(sample: usize) -> bool {
    (100..120).contains(&sample) || (sample > 120 && sample.is_multiple_of(3))
}

#[inline(never)]
pub fn correct<T, F, D, const N: usize, const M: usize>(
    device: &D,
    filter: &mut F,
    y: &[T; M],
    policy: &Picky<T>,
) -> Result<Innovation<T, M>, FilterError>
where
    T: Number,
    F: Filter<T, N>,
    D: Device<T, N, M>,
{
    filter.update_where(device.sensor(), y, device.noise(), policy)
}

/// The other sensor: the first state.
fn first<T: Number, const N: usize>() -> LinearMeasurement<T, N, 1> {
    LinearMeasurement { matrix: Mat::from_fn(|_, j| T::of(if j == 0 { 1.0 } else { 0.0 })) }
}

#[inline(never)]
pub fn correct_by_event<T: Number, F: Filter<T, N>, const N: usize>(filter: &mut F, y: T, deviation: T) {
    filter.update(&first(), &[y], &Covariance::from_standard_deviations([deviation])).unwrap();
}

/// An event about the state before the last step, by looking back over that step.
///
/// Around the filter's own path the state then was x̂₋ + F⁻¹·(x − f(x̂₋)): what is constant in it is brought to
/// the side of the measurement.
#[inline(never)]
fn correct_looking_back<T: Number, F: Filter<T, N>, const N: usize>(
    filter: &mut F,
    (before, transition): (&[T; N], &Mat<T, N, N>),
    y: T,
    deviation: T,
) {
    let past = Delayed { measurement: first(), back: Lu::of(transition).unwrap().inverse() };
    let constant = before[0] - past.back.times_vector(filter.mean())[0];
    filter.update(&past, &[y - constant], &Covariance::from_standard_deviations([deviation])).unwrap();
}

/// Runs a filter along a recording.
pub fn follow<T, F, D, const N: usize, const M: usize>(
    device: &D,
    mut filter: F,
    recording: &Recording<N, M>,
    how: &Corrections,
) -> Trace<N>
where
    T: Number,
    F: Filter<T, N> + Copy,
    D: Device<T, N, M>,
{
    let policy = (Gate { nis: T::of(how.gate * M as f64) }, OnNeed { fraction: T::of(how.need) });
    let mut decimation = Decimation::every(NonZeroU32::new(how.every).unwrap());
    let deviation = device.start().1[0] * T::of(EVENT);
    let mut trace = vec![];
    for sample in 0..SAMPLES {
        let before = *filter.mean();
        if sample > 0 {
            let link = device.advance(&mut filter, sample).unwrap();
            if how.events == Events::LookingBack && event(sample - 1) {
                let y = T::of(recording.events[sample - 1]);
                correct_looking_back(&mut filter, (&before, &link.transition), y, deviation);
            }
        }
        let y = narrow(&recording.signal[sample]);
        let (mut nis, mut taken) = (None, false);
        if decimation.due() && !(how.missing)(sample) {
            if M > 1 && how.sequential {
                let sequence =
                    filter.update_present(device.sensor(), &y, [true; M], device.noise(), &policy).unwrap();
                (nis, taken) = (Some(sequence.nis.into()), sequence.taken.iter().all(|taken| *taken));
            } else {
                let innovation = correct(device, &mut filter, &y, &policy).unwrap();
                (nis, taken) = (Some(innovation.nis.into()), innovation.taken);
            }
        }
        if how.events == Events::InTime && event(sample) {
            correct_by_event(&mut filter, T::of(recording.events[sample]), deviation);
        }
        trace.push(said(&filter, nis, taken));
    }
    trace
}
