//! What is no [`Filter`], or needs a device of its own: the linear filter, constant gains, considered states.

use crate::devices::{self, Device, Number, Stepped};
use crate::follow::{PLAIN, correct, follow, narrow, said, takes_all};
use crate::judge::{least_ratio, worst_error};
use crate::recording::{Noise, SAMPLES, simulate};
use kalmems_core::{
    Covariance, Ekf, Filter, FixedGain, Kalman, LinearMeasurement, LinearProcess, Measurement,
    OperatingPoint, Process, SchmidtEkf,
};

fn ekf<T: Number, const N: usize>((mean, deviations): &([T; N], [T; N])) -> Ekf<T, N> {
    Ekf::new(*mean, Covariance::from_standard_deviations(*deviations))
}

/// The linear filter is the extended one on linear models, to the bit; one sample in five missing.
fn kalman<T: Number, const M: usize>(
    exact: &impl Device<f64, 2, M>,
    device: &Stepped<LinearProcess<T, 2, 1>, LinearMeasurement<T, 2, M>, T, 2, M>,
) {
    for seed in 500..503 {
        let recording = simulate(exact, seed, Noise::Gaussian);
        let mut extended = ekf(&device.start);
        let mut linear = Kalman::new(*extended.mean(), extended.covariance());
        for sample in 0..SAMPLES {
            if sample > 0 {
                device.advance(&mut extended, sample).unwrap();
                linear.predict(&device.process, &(device.input)(sample)).unwrap();
            }
            if sample % 5 != 3 {
                let y = narrow(&recording.signal[sample]);
                let one = correct(device, &mut extended, &y, &takes_all()).unwrap();
                let other = linear.update(&device.sensor, &y, &device.noise).unwrap();
                assert_eq!(one.nis, other.nis);
            }
            assert_eq!((extended.mean(), extended.covariance()), (linear.mean(), *linear.covariance()));
        }
    }
}

#[test]
fn the_linear_filter_is_the_extended_one_on_linear_models() {
    kalman::<f64, 1>(&devices::resonator(devices::angle()), &devices::resonator(devices::angle()));
    kalman::<f32, 1>(&devices::resonator(devices::angle()), &devices::resonator(devices::angle()));
    let both = devices::angle_and_rate;
    kalman::<f64, 2>(&devices::resonator(both()), &devices::resonator(both()));
    kalman::<f32, 2>(
        &devices::resonator(devices::angle_and_rate()),
        &devices::resonator(devices::angle_and_rate()),
    );
}

/// When a constant gain has forgotten the start.
const SETTLED: usize = 150;

/// A gain for one operating point, optimal and three times as large: right in what it says of itself, once it has
/// settled.
fn fixed_gain<T, P, H, const M: usize>(
    exact: &impl Device<f64, 2, M>,
    device: &Stepped<P, H, T, 2, M>,
    operating_input: &P::Input,
) where
    T: Number,
    P: Process<T, 2>,
    H: Measurement<T, 2, M>,
{
    let mean = device.start.0;
    let zero = [T::of(0.0); 2];
    let point = OperatingPoint::of(&device.process, (&device.sensor, device.noise), (&zero, operating_input));
    let optimal = FixedGain::steady_state(mean, &point).unwrap();
    let hasty = FixedGain::from_gain(mean, optimal.gain().scaled(T::of(3.0)), &point).unwrap();
    for (name, start) in [("optimal", optimal), ("hasty", hasty)] {
        let covariance = start.filtered_covariance();
        let (mut squares, mut nis, mut n) = ([0.0; 2], 0.0, 0.0);
        for seed in 510..550 {
            let recording = simulate(exact, seed, Noise::Gaussian);
            let mut filter = start;
            let mut extended = ekf(&device.start);
            for sample in 0..SAMPLES {
                let y = narrow(&recording.signal[sample]);
                if sample > 0 {
                    device.advance(&mut extended, sample).unwrap();
                    filter.predict(&device.process, &(device.input)(sample)).unwrap();
                }
                correct(device, &mut extended, &y, &takes_all()).unwrap();
                let innovation = filter.update(&device.sensor, &y).unwrap();
                if sample >= SETTLED {
                    (nis, n) = (nis + innovation.nis.into(), n + 1.0);
                    for (i, square) in squares.iter_mut().enumerate() {
                        let e = filter.mean()[i].into() - recording.truth[sample][i];
                        let e = e / covariance.standard_deviation(i).into();
                        assert!(e.abs() < 6.0, "{name}: {e} σ in state {i} at {sample}");
                        *square += e * e;
                    }
                }
            }
            // The optimal gain settles where the filter does; the hasty one knows less.
            for i in 0..2 {
                let other: f64 = extended.covariance().standard_deviation(i).into();
                let ratio = covariance.standard_deviation(i).into() / other;
                assert!(if name == "optimal" { (ratio - 1.0).abs() < 0.05 } else { ratio > 1.1 }, "{ratio}");
            }
        }
        let excess = (nis / n - M as f64) / (2.0 * M as f64 / n).sqrt();
        // Hasty innovations are correlated, and their mean spreads more.
        assert!(excess.abs() < if name == "optimal" { 4.0 } else { 6.0 }, "{name}: {excess}");
        assert!(squares.iter().all(|s| (0.75..1.33).contains(&(s / n))), "{name}: {squares:?}");
    }
}

#[test]
fn constant_gains() {
    use devices::{angle, angle_and_rate, duffing, resonator, scanner};
    use kalmems_core::Nodes;
    fixed_gain::<f64, _, _, 1>(&resonator(angle()), &resonator(angle()), &[0.0]);
    fixed_gain::<f32, _, _, 1>(&resonator(angle()), &resonator(angle()), &[0.0]);
    fixed_gain::<f64, _, _, 2>(&resonator(angle_and_rate()), &resonator(angle_and_rate()), &[0.0]);
    fixed_gain::<f64, _, _, 1>(&duffing(angle()), &duffing(angle()), &Nodes::held(0.0));
    fixed_gain::<f64, _, _, 1>(&scanner(angle()), &scanner(angle()), &Nodes::held(110.0));
}

/// Gain and offset considered: never corrected, their uncertainty in what is said of the angle. A filter that takes
/// them as known is wrong by more than it says.
fn considered<T: Number>() {
    let (exact, device, known) = (
        devices::augmented::<f64>(),
        devices::augmented::<T>(),
        devices::scanner(devices::demodulated::<T>()),
    );
    let (mean, deviations) = device.start;
    let covariance = Covariance::from_standard_deviations(deviations);
    let start = SchmidtEkf::new(mean, covariance, [false, false, false, true, true]);
    let mut overconfident = 0;
    for seed in 520..526 {
        let recording = simulate(&exact, seed, Noise::Gaussian);
        let trace = follow(&device, start, &recording, &PLAIN);
        let worst = worst_error(&trace, &recording);
        assert!(worst < 6.0, "{worst} σ");
        for (sample, said) in trace.iter().enumerate() {
            assert_eq!(said.mean[3..], [0.0; 2]);
            // Random walks of 1/s from a deviation of 1.
            let expected = (1.0 + sample as f64 * 1e-6).sqrt();
            assert!(said.deviation[3..].iter().all(|d| (d / expected - 1.0).abs() < 1e-4), "{said:?}");
        }
        let estimated = follow(&device, ekf(&device.start), &recording, &PLAIN);
        let ratio = least_ratio(&trace, &estimated);
        assert!(ratio > 0.98, "{ratio}");

        let mut filter = ekf(&known.start);
        let mut worst = 0.0_f64;
        for sample in 0..SAMPLES {
            if sample > 0 {
                known.advance(&mut filter, sample).unwrap();
            }
            correct(&known, &mut filter, &narrow(&recording.signal[sample]), &takes_all()).unwrap();
            let said = said(&filter, None, true);
            let truth = recording.truth[sample];
            worst = worst.max(crate::judge::error(&said, &[truth[0], truth[1]]));
        }
        overconfident += usize::from(worst > 6.0);
    }
    assert!(overconfident >= 4, "{overconfident}");
}

#[test]
fn considered_states() {
    considered::<f64>();
    considered::<f32>();
}
