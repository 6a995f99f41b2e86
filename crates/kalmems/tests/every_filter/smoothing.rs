//! Smoothers around every filter.

use crate::devices::{Device, Number};
use crate::filters::{Cell, every_filter};
use crate::follow::{Corrections, PLAIN, Picky, Said, correct, follow, missing, narrow, said, takes_all};
use crate::judge::error;
use crate::recording::{Noise, Recording, SAMPLES, simulate};
use kalmems_core::smooth::{Backward, FixedLag, Smoothed, SmoothingCourse, smooth_interval};
use kalmems_core::{Filter, FilterError, StateTransition};
use std::marker::PhantomData;

struct Smoothing<'a, D, T, const N: usize, const M: usize> {
    device: &'a D,
    recordings: Vec<Recording<N, M>>,
    number: PhantomData<T>,
}

/// Smoothers around every filter on this device, over recordings with gaps.
pub fn check<T, D, E, const N: usize, const M: usize>(exact: &E, device: &D)
where
    T: Number,
    D: Device<T, N, M>,
    E: Device<f64, N, M>,
{
    let recordings = (300..305).map(|seed| simulate(exact, seed, Noise::Gaussian)).collect();
    every_filter(device.start(), &mut Smoothing { device, recordings, number: PhantomData });
}

struct Samples<'a, D, T, const N: usize, const M: usize> {
    device: &'a D,
    recording: &'a Recording<N, M>,
    policy: Picky<T>,
}

impl<T, F, D, const N: usize, const M: usize> SmoothingCourse<T, F, N> for Samples<'_, D, T, N, M>
where
    T: Number,
    F: Filter<T, N>,
    D: Device<T, N, M>,
{
    type Error = FilterError;

    fn samples(&self) -> usize {
        SAMPLES
    }

    fn advance(&mut self, filter: &mut F, sample: usize) -> Result<StateTransition<T, N>, FilterError> {
        self.device.advance(filter, sample)
    }

    fn correct(&mut self, filter: &mut F, sample: usize) -> Result<(), FilterError> {
        if missing(sample) {
            return Ok(());
        }
        let y = narrow(&self.recording.signal[sample]);
        correct(self.device, filter, &y, &self.policy).map(|_| ())
    }
}

fn smoothed_said<T: Number, const N: usize>(smoothed: &Smoothed<T, N>) -> Said<N> {
    let covariance = smoothed.covariance();
    Said {
        mean: smoothed.mean.map(Into::into),
        deviation: std::array::from_fn(|i| covariance.get(i, i).into().sqrt()),
        nis: None,
        taken: true,
    }
}

const LAG: usize = 8;

impl<T, D, const N: usize, const M: usize> Cell<T, N> for Smoothing<'_, D, T, N, M>
where
    T: Number,
    D: Device<T, N, M>,
{
    fn run<F: Filter<T, N> + Copy>(&mut self, name: &str, start: F) {
        // The squares of the errors in units of what the filter says: of the filter, at a lag, and of all data.
        let mut squares = [[0.0; N]; 3];
        for recording in &self.recordings {
            let filtered = follow(self.device, start, recording, &Corrections { missing, ..PLAIN });
            let mut samples = Samples { device: self.device, recording, policy: takes_all() };

            let mut interval = filtered.clone();
            let (mut checkpoints, mut block) = ([start; 20], [Backward::identity(); 16]);
            smooth_interval(&start, &mut samples, &mut checkpoints, &mut block, |sample, smoothed| {
                interval[sample] = smoothed_said(smoothed);
                Ok(())
            })
            .unwrap();

            // A filter inside a smoother is that filter, to the bit.
            let mut inside = FixedLag::<T, F, N, LAG>::new(start);
            let mut lagged = filtered.clone();
            for (sample, plain) in filtered.iter().enumerate() {
                if sample > 0 {
                    samples.advance(&mut inside, sample).unwrap();
                }
                samples.correct(&mut inside, sample).unwrap();
                assert!(said(&inside, plain.nis, plain.taken) == *plain, "{name}: sample {sample}");
                match inside.smoothed() {
                    Some(smoothed) => lagged[sample - LAG] = smoothed_said(&smoothed),
                    None => assert!(sample < LAG, "{name}"),
                }
            }
            // The newest, of which all data are known: the same from both smoothers.
            let digits = if T::of(1.0 + 1e-12) == T::of(1.0) { 1e-2 } else { 1e-9 };
            for lag in 0..=LAG {
                let (one, other) = (smoothed_said(&inside.lagged(lag).unwrap()), interval[SAMPLES - 1 - lag]);
                let apart = error(&Said { mean: one.mean, ..other }, &other.mean);
                assert!(apart < digits, "{name}: {apart} σ at lag {lag}");
            }

            for sample in 0..SAMPLES - LAG {
                let all = [filtered[sample], lagged[sample], interval[sample]];
                for (said, squares) in all.iter().zip(&mut squares) {
                    let worst = error(said, &recording.truth[sample]);
                    assert!(worst < 6.0, "{name}: {worst} σ at {sample}");
                    for (i, square) in squares.iter_mut().enumerate() {
                        let e = (said.mean[i] - recording.truth[sample][i]) / filtered[sample].deviation[i];
                        *square += e * e;
                    }
                }
                for i in 0..N {
                    let [filter, lag, interval] = all.map(|said| said.deviation[i]);
                    assert!(
                        lag < filter * 1.0001 && interval < lag * 1.0001,
                        "{name}: {filter} {lag} {interval}"
                    );
                }
            }
        }
        // Later data make the errors of the first two states smaller, as they make the variances.
        for i in 0..2 {
            assert!(squares[1][i] < squares[0][i], "{name}: {squares:?}");
            assert!(squares[2][i] < squares[1][i], "{name}: {squares:?}");
        }
    }
}
