//! A sensor of another size now and then: in time, looking back, and put in where it belongs.

use crate::devices::{Device, Number};
use crate::filters::{Cell, every_filter};
use crate::follow::{
    Corrections, Events, PLAIN, Picky, correct, correct_by_event, event, follow, narrow, said, takes_all,
};
use crate::judge::{apart, worst_error};
use crate::recording::{EVENT, Noise, Recording, SAMPLES, simulate};
use kalmems_core::update::{History, HistoryError, Replay};
use kalmems_core::{Filter, FilterError};
use std::marker::PhantomData;

struct Late<'a, D, T, const N: usize, const M: usize> {
    device: &'a D,
    recordings: Vec<Recording<N, M>>,
    number: PhantomData<T>,
}

/// Every filter on this device, with events.
pub fn check<T, D, E, const N: usize, const M: usize>(exact: &E, device: &D)
where
    T: Number,
    D: Device<T, N, M>,
    E: Device<f64, N, M>,
{
    let recordings = (200..203).map(|seed| simulate(exact, seed, Noise::Gaussian)).collect();
    every_filter(device.start(), &mut Late { device, recordings, number: PhantomData });
}

/// What a sample does, with the event about it where it has come.
struct Replayed<'a, D, T, const N: usize, const M: usize> {
    device: &'a D,
    deviation: T,
    policy: Picky<T>,
}

#[derive(Clone, Copy)]
struct Sample<T, const M: usize> {
    index: usize,
    signal: [T; M],
    event: Option<T>,
}

impl<T, F, D, const N: usize, const M: usize> Replay<F> for Replayed<'_, D, T, N, M>
where
    T: Number,
    F: Filter<T, N>,
    D: Device<T, N, M>,
{
    type Record = Sample<T, M>;
    type Error = FilterError;

    fn replay(&self, filter: &mut F, sample: &Sample<T, M>) -> Result<(), FilterError> {
        let Self { device, deviation, policy } = self;
        if sample.index > 0 {
            device.advance(filter, sample.index)?;
        }
        correct(*device, filter, &sample.signal, policy)?;
        if let Some(y) = sample.event {
            correct_by_event(filter, y, *deviation);
        }
        Ok(())
    }
}

const LATE: usize = 5;

impl<T, D, const N: usize, const M: usize> Cell<T, N> for Late<'_, D, T, N, M>
where
    T: Number,
    D: Device<T, N, M>,
{
    fn run<F: Filter<T, N> + Copy>(&mut self, name: &str, start: F) {
        for recording in &self.recordings {
            let plain = follow(self.device, start, recording, &PLAIN);
            let in_time =
                follow(self.device, start, recording, &Corrections { events: Events::InTime, ..PLAIN });
            let looking_back =
                follow(self.device, start, recording, &Corrections { events: Events::LookingBack, ..PLAIN });
            for (kind, trace) in [("in time", &in_time), ("looking back", &looking_back)] {
                let worst = worst_error(trace, recording);
                assert!(worst < 6.0, "{name}, {kind}: {worst} σ");
            }
            // What is known of the first state grows with each event, and only with it.
            assert!(plain[..10] == in_time[..10], "{name}");
            for sample in (0..SAMPLES).filter(|sample| event(*sample)) {
                let ratio = in_time[sample].deviation[0] / plain[sample].deviation[0];
                assert!(ratio < 0.97, "{name}: {ratio} at sample {sample}");
            }
            // Between the event and its arrival they differ; afterwards only by the noise of one step.
            let arrived = |trace: &[_]| -> Vec<_> {
                trace.iter().enumerate().filter(|(k, _)| !event(*k)).map(|(_, said)| *said).collect()
            };
            let (means, deviations) = apart(&arrived(&looking_back), &arrived(&in_time));
            assert!(means < 0.02 && deviations < 0.005, "{name}: {means} σ, {deviations}");

            let deviation = self.device.start().1[0] * T::of(EVENT);
            let replay = Replayed { device: self.device, deviation, policy: takes_all() };
            let mut history = History::<F, Replayed<'_, D, T, N, M>, 8>::new(start, replay);
            for (index, expected) in in_time.iter().enumerate() {
                let signal = narrow(&recording.signal[index]);
                history.push(Sample { index, signal, event: None }).unwrap();
                if index >= LATE && event(index - LATE) {
                    let y = T::of(recording.events[index - LATE]);
                    history.amend(LATE, |sample| sample.event = Some(y)).unwrap();
                }
                // Nothing new about a sample after the event, which is processed from where the event has led.
                if index >= LATE + 2 && event(index - LATE - 2) {
                    history.amend(3, |_| ()).unwrap();
                }
                // To the bit as if it had come in time, once it has come.
                if !(0..LATE).any(|ago| index >= ago && event(index - ago)) {
                    let found = said(history.filter(), expected.nis, expected.taken);
                    assert!(found == *expected, "{name}: sample {index}");
                }
            }
            let too_old = history.amend(8, |_| ());
            assert_eq!(too_old, Err(HistoryError::TooOld { age: 8, kept: 8 }), "{name}");
        }
    }
}
