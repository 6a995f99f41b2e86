//! A bank of every filter, over devices that differ in their stiffness.

use crate::devices::{
    Device, Number, Stepped, angle, demodulated, resonator_of_stiffness, scanner_of_stiffness,
};
use crate::filters::{Cell, every_filter};
use crate::follow::narrow;
use crate::recording::{Noise, Recording, SAMPLES, simulate};
use kalmems_core::adapt::Bank;
use kalmems_core::{Filter, Measurement, Process};

struct Banks<'a, P: Process<T, N>, H, T: Number, const N: usize, const M: usize> {
    devices: &'a [Stepped<P, H, T, N, M>; 3],
    recordings: Vec<Recording<N, M>>,
}

/// Three devices, of which the second is simulated.
fn check<T, P, H, E, const N: usize, const M: usize>(exact: &E, devices: &[Stepped<P, H, T, N, M>; 3])
where
    T: Number,
    P: Process<T, N> + Copy,
    H: Measurement<T, N, M> + Copy,
    E: Device<f64, N, M>,
{
    let recordings = (400..403).map(|seed| simulate(exact, seed, Noise::Gaussian)).collect();
    every_filter(devices[1].start(), &mut Banks { devices, recordings });
}

impl<T, P, H, const N: usize, const M: usize> Cell<T, N> for Banks<'_, P, H, T, N, M>
where
    T: Number,
    P: Process<T, N> + Copy,
    H: Measurement<T, N, M> + Copy,
{
    fn run<F: Filter<T, N> + Copy>(&mut self, name: &str, start: F) {
        let processes = [0, 1, 2].map(|k| self.devices[k].process);
        let sensors = [0, 1, 2].map(|k| self.devices[k].sensor);
        let right = &self.devices[1];
        for recording in &self.recordings {
            let mut bank = Bank::<F, T, N, 3>::new([start; 3], [T::of(1.0); 3]);
            for sample in 0..SAMPLES {
                if sample > 0 {
                    bank.predict(&processes, &(right.input)(sample)).unwrap();
                }
                let y = narrow(&recording.signal[sample]);
                assert!(bank.update(&sensors, &y, &[right.noise; 3]).unwrap().taken, "{name}");
                if sample == 0 {
                    // One measurement of the same start says nothing of the stiffness.
                    assert!(bank.weights().iter().all(|w| ((*w).into() - 1.0 / 3.0).abs() < 1e-6), "{name}");
                }
            }
            let weight: f64 = bank.weights()[1].into();
            assert!(weight > 0.999, "{name}: {weight}");
            let mixture = bank.mixture();
            for i in 0..N {
                let error = mixture.mean[i].into() - recording.truth[SAMPLES - 1][i];
                let deviation: f64 = mixture.covariance.standard_deviation(i).into();
                assert!(error.abs() < 5.0 * deviation, "{name}: state {i}, {error} of {deviation}");
            }
        }
    }
}

const STIFFNESSES: [f64; 3] = [0.98, 1.0, 1.02];

#[test]
fn of_scanners() {
    let exact = scanner_of_stiffness(1.0, demodulated());
    check(&exact, &STIFFNESSES.map(|factor| scanner_of_stiffness::<f64, _, 1>(factor, demodulated())));
    check(&exact, &STIFFNESSES.map(|factor| scanner_of_stiffness::<f32, _, 1>(factor, demodulated())));
}

#[test]
fn of_resonators() {
    let exact = resonator_of_stiffness(1.0, angle());
    check(&exact, &STIFFNESSES.map(|factor| resonator_of_stiffness::<f64, _, 1>(factor, angle())));
}
