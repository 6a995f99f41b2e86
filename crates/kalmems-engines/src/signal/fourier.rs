//! The Fourier transform of real samples.

use realfft::RealFftPlanner;
use realfft::num_complex::Complex64;

/// Σ y\[k\]·e^(−2πi·jk/n) of n samples, for j from 0 to n/2. The samples are overwritten.
///
/// For any n: all transforms of the workspace are this one, since each crate that calls the library has all of its lengths compiled anew.
pub fn fourier_transform(samples: &mut [f64]) -> Vec<Complex64> {
    fourier_transform_by(&mut RealFftPlanner::new(), samples)
}

/// The same by a planner that remembers the tables of earlier lengths, which take as long to compute as a transform.
pub(crate) fn fourier_transform_by(planner: &mut RealFftPlanner<f64>, samples: &mut [f64]) -> Vec<Complex64> {
    let plan = planner.plan_fft_forward(samples.len());
    let mut lines = plan.make_output_vec();
    // The lengths are the plan's own, and nothing else is refused.
    let _ = plan.process(samples, &mut lines);
    lines
}
