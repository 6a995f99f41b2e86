//! Every way to correct with the device's own sensor.

use crate::devices::{Device, Number};
use crate::filters::{Cell, every_filter};
use crate::follow::{Corrections, PLAIN, Trace, correct, follow, missing, narrow, said, takes_all};
use crate::judge::{apart, error, least_ratio, nis_excess, taken, worst_error};
use crate::recording::{Noise, Recording, SAMPLES, simulate};
use kalmems_core::{Covariance, Ekf, Filter, FilterError};
use std::marker::PhantomData;

/// Outliers of the sensor: every 25th sample from the 50th on, when the filter has settled.
fn outlier(sample: usize) -> bool {
    sample >= 50 && sample.is_multiple_of(25)
}

const GATED: Corrections = Corrections { gate: 9.0, ..PLAIN };
const ON_NEED: Corrections = Corrections { need: 0.3, ..PLAIN };
const DECIMATED: Corrections = Corrections { every: 4, ..PLAIN };
const GAPS: Corrections = Corrections { missing, ..PLAIN };
const ALL_OF_IT: Corrections = Corrections { gate: 9.0, need: 0.02, every: 2, missing, ..PLAIN };

struct Updates<'a, D, T, const N: usize, const M: usize> {
    device: &'a D,
    clean: Vec<Recording<N, M>>,
    /// With outliers, and otherwise without noise that could be mistaken for one.
    spoilt: Vec<Recording<N, M>>,
    /// What the extended filter makes of the clean ones.
    extended: Vec<Trace<N>>,
    number: PhantomData<T>,
}

/// Every filter on this device, corrected in every way; `exact` simulates what `device` filters.
pub fn check<T, D, E, const N: usize, const M: usize>(exact: &E, device: &D)
where
    T: Number,
    D: Device<T, N, M>,
    E: Device<f64, N, M>,
{
    let clean: Vec<_> = (0..SEEDS).map(|seed| simulate(exact, seed, Noise::Gaussian)).collect();
    let spoilt = (0..SEEDS).map(|seed| spoil(exact, simulate(exact, 100 + seed, Noise::Bounded))).collect();
    let (mean, deviations) = *device.start();
    let ekf = Ekf::new(mean, Covariance::from_standard_deviations(deviations));
    let extended = clean.iter().map(|recording| follow(device, ekf, recording, &PLAIN)).collect();
    every_filter(device.start(), &mut Updates { device, clean, spoilt, extended, number: PhantomData });
}

const SEEDS: u64 = 10;

/// Adds 60 standard deviations of the noise to one component, up and down in turn.
fn spoil<const N: usize, const M: usize>(
    device: &impl Device<f64, N, M>,
    mut recording: Recording<N, M>,
) -> Recording<N, M> {
    let size = 60.0 * device.noise().standard_deviation(0);
    for (index, sample) in (0..SAMPLES).filter(|sample| outlier(*sample)).enumerate() {
        recording.signal[sample][0] += if index % 2 == 0 { size } else { -size };
    }
    recording
}

impl<T, D, const N: usize, const M: usize> Updates<'_, D, T, N, M>
where
    T: Number,
    D: Device<T, N, M>,
{
    fn follow<F: Filter<T, N> + Copy>(&self, filter: F, how: &Corrections) -> Vec<Trace<N>> {
        self.clean.iter().map(|recording| follow(self.device, filter, recording, how)).collect()
    }

    fn honest(&self, name: &str, traces: &[Trace<N>]) {
        for (trace, recording) in traces.iter().zip(&self.clean) {
            let worst = worst_error(trace, recording);
            assert!(worst < 6.0, "{name}: {worst} σ");
        }
    }

    fn consistent(name: &str, traces: &[Trace<N>]) {
        let excess = nis_excess(traces, M);
        assert!(excess.abs() < 4.0, "{name}: mean NIS {excess} standard deviations off");
    }

    fn plain<F: Filter<T, N> + Copy>(&self, name: &str, filter: F) -> Vec<Trace<N>> {
        let plain = self.follow(filter, &PLAIN);
        self.honest(name, &plain);
        Self::consistent(name, &plain);
        // The same algebra in another form differs by rounding; another way to bend a line, by the curvature. Of that
        // there is more where the model itself is uncertain.
        let same = ["Ekf", "SquareRootEkf", "SchmidtEkf"].contains(&name);
        let digits = if T::of(1.0 + 1e-12) == T::of(1.0) { (1e-2, 1e-3) } else { (1e-8, 1e-9) };
        let bent = if N > 2 { (1.0, 0.2) } else { (0.2, 0.05) };
        for (trace, extended) in plain.iter().zip(&self.extended) {
            let (means, deviations) = apart(trace, extended);
            let allowed = if same { digits } else { bent };
            assert!(means < allowed.0 && deviations < allowed.1, "{name}: {means} σ, {deviations}");
        }
        plain
    }

    fn gated<F: Filter<T, N> + Copy>(&self, name: &str, filter: F) {
        for recording in &self.spoilt {
            let with = follow(self.device, filter, recording, &GATED);
            for (sample, said) in with.iter().enumerate() {
                assert_eq!(said.taken, !outlier(sample), "{name}: sample {sample}, NIS {:?}", said.nis);
            }
            let worst = worst_error(&with, recording);
            assert!(worst < 6.0, "{name}: {worst} σ with a gate");
            let without = worst_error(&follow(self.device, filter, recording, &PLAIN), recording);
            assert!(without > 6.0, "{name}: {without} σ without a gate");
        }
    }

    /// Fewer corrections leave more uncertainty, and the error within it.
    fn fewer<F: Filter<T, N> + Copy>(&self, name: &str, filter: F, plain: &[Trace<N>]) {
        for (kind, how) in
            [("on need", ON_NEED), ("decimated", DECIMATED), ("gaps", GAPS), ("all", ALL_OF_IT)]
        {
            let name = format!("{name}, {kind}");
            let traces = self.follow(filter, &how);
            self.honest(&name, &traces);
            for (trace, plain) in traces.iter().zip(plain) {
                let (some, ratio) = (taken(trace), least_ratio(trace, plain));
                assert!(some > 10 && some < SAMPLES * 4 / 5, "{name}: {some} taken");
                assert!(ratio > 0.99, "{name}: a deviation {ratio} of that with all samples");
            }
            if how.need == 0.0 {
                Self::consistent(&name, &traces);
            }
        }
    }

    /// One by one, linear sensors say what they say together.
    fn sequential<F: Filter<T, N> + Copy>(&self, name: &str, filter: F, plain: &[Trace<N>]) {
        let traces = self.follow(filter, &Corrections { sequential: true, ..PLAIN });
        let name = format!("{name}, sequential");
        self.honest(&name, &traces);
        Self::consistent(&name, &traces);
        // Two that are not linear are linearised each at its own mean.
        let allowed = (0.05, 0.02);
        for (trace, plain) in traces.iter().zip(plain) {
            let (means, deviations) = apart(trace, plain);
            assert!(means < allowed.0 && deviations < allowed.1, "{name}: {means} σ, {deviations}");
        }
    }

    /// A number that is none is refused, and leaves no trace.
    fn refused<F: Filter<T, N> + Copy>(&self, name: &str, mut filter: F) {
        for sample in 0..20 {
            if sample > 0 {
                self.device.advance(&mut filter, sample).unwrap();
            }
            let mut y = narrow(&self.clean[0].signal[sample]);
            let before = (*filter.mean(), filter.covariance());
            let kept = y[M - 1];
            y[M - 1] = T::of(f64::NAN);
            let refused = correct(self.device, &mut filter, &y, &takes_all()).map(|_| ());
            assert_eq!(refused, Err(FilterError::NonFiniteMeasurement), "{name}");
            assert!((*filter.mean(), filter.covariance()) == before, "{name}");
            y[M - 1] = kept;
            correct(self.device, &mut filter, &y, &takes_all()).unwrap();
        }
        assert!(error(&said(&filter, None, true), &self.clean[0].truth[19]) < 5.0, "{name}");
    }
}

impl<T, D, const N: usize, const M: usize> Cell<T, N> for Updates<'_, D, T, N, M>
where
    T: Number,
    D: Device<T, N, M>,
{
    fn run<F: Filter<T, N> + Copy>(&mut self, name: &str, start: F) {
        let plain = self.plain(name, start);
        self.gated(name, start);
        self.fewer(name, start, &plain);
        if M > 1 {
            self.sequential(name, start, &plain);
        }
        self.refused(name, start);
    }
}
