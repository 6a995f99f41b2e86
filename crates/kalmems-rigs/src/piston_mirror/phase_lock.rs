//! The phase-locked loop as a filter of the loop that serves all.

use super::plates::COEFFICIENTS;
use kalmems_core::riccati::RiccatiError;
use kalmems_core::update::{Correction, Policy};
use kalmems_core::{
    Covariance, Ekf, Filter, FilterError, FixedGain, Innovation, Link, Mat, NumericMeasurement,
    NumericProcess,
};
use kalmems_models::dynamics::DriftingPhasor;
use kalmems_models::readout::PhasorDetector;

/// The gain in which the filter of the mixed signal settles; see [`PhasorDetector`].
///
/// It claims the covariance in which its error settles, which does not follow what is measured.
#[derive(Clone, Copy, Debug)]
pub struct PhaseLock {
    lock: FixedGain<f64, 5, 3>,
    detector: PhasorDetector<f64, COEFFICIENTS>,
    transition: Mat<f64, 5, 5>,
    noise: Covariance<f64, 5>,
}

impl PhaseLock {
    /// The loop for a motion at `mean`, from there, for samples with this noise in F².
    pub fn new(
        detector: PhasorDetector<f64, COEFFICIENTS>,
        process: &DriftingPhasor<f64>,
        mean: [f64; 5],
        noise_variance: f64,
    ) -> Result<Self, RiccatiError> {
        let point = detector.operating_point(process, &mean, noise_variance);
        let lock = FixedGain::steady_state(mean, &point)?;
        Ok(Self { lock, detector, transition: point.transition, noise: point.process_noise })
    }
}

/// Takes no correction.
struct Never;

impl Policy<f64, 5> for Never {
    fn take<const M: usize>(&self, _: &Innovation<f64, M>, _: &Correction<f64, 5>) -> bool {
        false
    }
}

impl Filter<f64, 5> for PhaseLock {
    fn mean(&self) -> &[f64; 5] {
        self.lock.mean()
    }

    fn covariance(&self) -> Covariance<f64, 5> {
        *self.lock.filtered_covariance()
    }

    fn predict_linked<P: NumericProcess<f64, 5>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<Link<f64, 5>, FilterError> {
        self.lock.predict(process, u)?;
        Ok(Link { transition: self.transition, noise: self.noise, taken: true })
    }

    fn update_where<H: NumericMeasurement<f64, 5, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[f64; M],
        r: &Covariance<f64, M>,
        _: &impl Policy<f64, 5>,
    ) -> Result<Innovation<f64, M>, FilterError> {
        const { assert!(M == 1, "the detector mixes one number") };
        let claimed = Ekf::new(*self.lock.mean(), *self.lock.predicted_covariance());
        let mut innovation = { claimed }.update_where(measurement, y, r, &Never)?;
        let [value, ..] = y[..] else { return Err(FilterError::NonFiniteMeasurement) };
        let mixed = self.detector.mixed(self.lock.mean(), value);
        self.lock.update(&self.detector, &mixed)?;
        innovation.taken = true;
        Ok(innovation)
    }
}
