//! How likely a recording is under an accelerometer of other parameters.

use super::super::data::AccelerometerSegment;
use super::super::settings::AccelerometerHardware;
use super::super::varied_instrument::{Factors, VariedInstrument};
use kalmems_core::riccati::RiccatiError;
use kalmems_core::{FilterError, FixedGain, Innovation, Mat, NotAScale, Scalar, Scales};

/// The places of the unknowns: each is the logarithm of a factor of what the experiment says.
pub mod unknown {
    /// Of k.
    pub const SPRING: usize = 0;
    /// Of b, and with it of the density of the Brownian force.
    pub const DAMPING: usize = 1;
    /// Of m.
    pub const MASS: usize = 2;
    /// Of the variance of a sample.
    pub const NOISE: usize = 3;
    /// Of the root mean square of the acceleration.
    pub const ACCELERATION: usize = 4;
    /// Of the bandwidth of the acceleration.
    pub const BANDWIDTH: usize = 5;
    /// How many.
    pub const COUNT: usize = 6;
}
use unknown::{ACCELERATION, BANDWIDTH, COUNT, DAMPING, MASS, NOISE, SPRING};

/// Why there is no likelihood at some parameters.
#[derive(Debug, thiserror::Error)]
pub enum LikelihoodError {
    /// A state has no size.
    #[error("{0}")]
    Scale(NotAScale),
    /// No Kalman filter settles.
    #[error("{0}")]
    Unsettled(RiccatiError),
    /// A step is refused.
    #[error("{0}")]
    Refused(FilterError),
}

/// A recording, and the instrument about whose parameters it is asked.
#[derive(Clone, Copy, Debug)]
pub struct Likelihood<'a> {
    /// What the experiment says of the instrument.
    pub hardware: &'a AccelerometerHardware,
    /// The recording, sampled evenly.
    pub data: &'a AccelerometerSegment<'a>,
    /// Samples at the start that are followed and not counted.
    pub forgotten: usize,
}

/// A share of its standard deviation that the start of a filter may still have.
const FORGOTTEN: f64 = 0.01;

impl Likelihood<'_> {
    /// Takes the settled filter of the instrument with these factors through the recording: each counted sample with
    /// its innovation and the acceleration in m/s². Returns the standard deviation that the filter claims of the
    /// acceleration.
    ///
    /// The gain is that in which the Kalman filter settles, so that Σ ln p(y | past) is the exact likelihood of all that
    /// comes after the start is forgotten. T is a number with its derivatives where those are wanted: the equations of
    /// Riccati are solved in it too. The acceleration is a state, so that nothing needs to be known of it but its size
    /// and bandwidth; the feedback is an input.
    #[inline]
    pub fn follow<T: Scalar>(
        &self,
        logs: &[T; COUNT],
        each: &mut impl FnMut(&Innovation<T, 1>, T),
    ) -> Result<T, LikelihoodError> {
        let (VariedInstrument { process, readout, .. }, mut filter) =
            settled(self.hardware, logs, self.data.interval_s)?;
        let size = Scales::natural(&self.hardware.sensed).map_err(LikelihoodError::Scale)?.sizes()[2];
        for (k, y) in self.data.signal.iter().enumerate() {
            if k > 0 {
                filter
                    .predict(&process, &T::of(self.data.feedback(k - 1)))
                    .map_err(LikelihoodError::Refused)?;
            }
            if !y.is_finite() {
                continue;
            }
            let innovation = filter.update(&readout, &[T::of(*y)]).map_err(LikelihoodError::Refused)?;
            if k >= self.forgotten {
                each(&innovation, filter.mean()[2] * T::of(size));
            }
        }
        Ok(filter.filtered_covariance().get(2, 2).sqrt() * T::of(size))
    }
}

/// The instrument, and the filter in which it settles.
fn settled<T: Scalar>(
    hardware: &AccelerometerHardware,
    logs: &[T; COUNT],
    interval_s: f64,
) -> Result<(VariedInstrument<T>, FixedGain<T, 4, 1>), LikelihoodError> {
    let factors = Factors {
        spring: logs[SPRING].exp(),
        damping: logs[DAMPING].exp(),
        mass: logs[MASS].exp(),
        noise: logs[NOISE].exp(),
        acceleration: logs[ACCELERATION].exp(),
        bandwidth: logs[BANDWIDTH].exp(),
    };
    let varied = VariedInstrument::of(hardware, &factors, interval_s).map_err(LikelihoodError::Scale)?;
    let filter = FixedGain::steady_state([T::of(0.0); 4], &varied.at_rest());
    Ok((varied, filter.map_err(LikelihoodError::Unsettled)?))
}

/// The samples after which a settled filter that starts at rest has forgotten that it did.
///
/// Its error moves with F·(I − K·H). The start is as wrong as the acceleration is large by what is known of it: what is
/// left of that must be small against what the filter claims, of the acceleration and of the innovation alike.
pub fn forgotten_after(hardware: &AccelerometerHardware, interval_s: f64) -> Result<usize, LikelihoodError> {
    const BLOCK: usize = 64;
    const BLOCKS: usize = 4096;
    let (varied, filter) = settled(hardware, &[0.0; COUNT], interval_s)?;
    let point = varied.at_rest();
    let (gain, h) = (filter.gain(), &point.observation);
    let left = Mat::<f64, 4, 4>::from_fn(|i, j| f64::from(u8::from(i == j)) - gain.0[i][0] * h.0[0][j]);
    let step = point.transition.times(&left);
    let block = (0..BLOCK).fold(Mat::identity(), |product, _| step.times(&product));
    // The displacement that the acceleration brings about at rest is uncertain by as much as the spring gives way.
    let (device, prior) = (&hardware.sensed.device, &hardware.sensed.prior);
    let spring = device.softened_spring(0.0).abs().max(1e-3 * device.mass.spring);
    let displacement = device.mass.mass * prior.rms / spring;
    let sizes = [displacement, displacement * prior.rate, prior.rms, prior.rms * prior.rate];
    let scales = Scales::natural(&hardware.sensed).map_err(LikelihoodError::Scale)?;
    let mut error = Mat(scales.scale_state(&sizes).map(|size| [size]));
    let claimed = filter.filtered_covariance().standard_deviation(2);
    let innovation = filter.predicted_covariance().transformed(h).get(0, 0) + hardware.noise_variance;
    for passed in 1..=BLOCKS {
        error = block.times(&error);
        let seen: f64 = (0..4).map(|i| (h.0[0][i] * error.0[i][0]).abs()).sum();
        if error.0[2][0].abs() < FORGOTTEN * claimed && seen < FORGOTTEN * innovation.sqrt() {
            return Ok(passed * BLOCK);
        }
    }
    Ok(BLOCKS * BLOCK)
}
