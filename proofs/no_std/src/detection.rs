//! Crossings in a sine, in a stream and over a slice, each a late measurement of an angle.

use core::f64::consts::TAU;
use core::hint::black_box;
use kalmems_core::detect::{
    CubicFit, Detector, HoldLevel, SlopeKernel, Threshold, angle_at, angle_variance, peaks,
};
use kalmems_core::update::Gate;
use kalmems_core::{Covariance, Ekf, Filter, Mat, Scalar};

/// Samples of the signal.
const LENGTH: usize = 1000;

/// How far after a sample the sine is zero, in samples.
const LATE: f64 = 0.25;

/// The largest error of a crossing's time, in samples, or of the filter's angle, in rad.
pub fn crossings_that_were_found() -> Option<f64> {
    let double = found::<f64>()?;
    let single = f64::from(found::<f32>()?);
    Some(if single > double { single } else { double })
}

fn found<T: Scalar>() -> Option<T> {
    let of = |value: f64| T::of(black_box(value));
    let signal: [T; LENGTH] =
        core::array::from_fn(|k| (of(TAU / 200.0) * (T::of(k as f64) - of(LATE))).sin() * of(50.0));
    let kernel = SlopeKernel::<T, 12>::new(black_box(4.0)).ok()?;
    let hold = HoldLevel { deviations: 2.0, samples: 300 };
    let threshold = Threshold::for_false_alarms(&kernel, 0.1, black_box(1e-4), 40, Some(hold)).ok()?;
    let fit = CubicFit::<T, 20>::new(black_box(8.0)).ok()?;
    let mut detector = Detector::<T, 12, 40, 100>::new(kernel, threshold, of(0.01));
    let free = Mat([[of(0.0), of(1.0)], [of(0.0), of(0.0)]]);
    let mut filter = Ekf::new([of(0.0); 2], Covariance::from_variances([of(1.0); 2]));
    let mut worst = of(0.0);
    let mut count = 0_usize;
    for sample in signal {
        let Some(detection) = detector.push(sample) else { continue };
        let Some(crossing) = detector.crossing(&fit, of(0.0)) else { continue };
        let nearest = (detection.index + 100) / 200 * 200;
        let error = T::of(detection.index as f64 - nearest as f64 - LATE) + crossing.displacement;
        worst = T::select(worst.lt(error.abs()), error.abs(), worst);
        let r = Covariance::from_variances([angle_variance(crossing.timing_variance, of(1.0), of(1.0))]);
        let past =
            angle_at(&free, T::of(Detector::<T, 12, 40, 100>::LOOK_AHEAD as f64) - crossing.displacement);
        filter.update_where(&past, &[of(0.0)], &r, &Gate { nis: of(9.0) }).ok()?;
        count += 1;
    }
    let mut slopes = [of(0.0); LENGTH];
    kernel.responses(&signal, &mut slopes);
    let batch = peaks(&slopes, 40, threshold).count();
    (count > 2 && batch >= count && filter.mean()[0].abs().lt(of(1e-6))).then_some(worst)
}
