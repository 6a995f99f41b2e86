//! Errors of several parts of a segment as those of the whole.
//!
//! Counts are added, and mean squares weighed by what they are means of. A turning point at which one part ends and the next
//! one begins is in neither.

use super::{AngleErrors, Claim, MotionErrors, ValueErrors};
use kalmems_core::Portable;

/// The mean of two, each of so many.
fn mean((a, of_a): (f64, usize), (b, of_b): (f64, usize)) -> f64 {
    let n = (of_a + of_b) as f64;
    if n > 0.0 { a * (of_a as f64 / n) + b * (of_b as f64 / n) } else { a }
}

/// The root mean square of two, each of so many.
fn rms((a, of_a): (f64, usize), (b, of_b): (f64, usize)) -> f64 {
    mean((a * a, of_a), (b * b, of_b)).sqrt()
}

/// The same of what may be missing.
fn of_both(
    a: (Option<f64>, usize),
    b: (Option<f64>, usize),
    both: fn((f64, usize), (f64, usize)) -> f64,
) -> Option<f64> {
    match (a.0, b.0) {
        (Some(x), Some(y)) => Some(both((x, a.1), (y, b.1))),
        (x, y) => x.or(y),
    }
}

/// What is claimed of the errors of both.
fn claim_of_both(own: Option<Claim>, later: Option<Claim>) -> Option<Claim> {
    match (own, later) {
        (Some(own), Some(later)) => Some(own.pooled(later)),
        (own, later) => own.or(later),
    }
}

/// The mean of two angles in degrees of a cycle of `cycle` degrees.
fn mean_angle(a: (Option<f64>, usize), b: (Option<f64>, usize)) -> Option<f64> {
    let (Some(x), Some(y)) = (a.0, b.0) else { return a.0.or(b.0) };
    let apart = y - x;
    Some(mean((x, a.1), (x + apart - 360.0 * (apart / 360.0).round(), b.1)))
}

impl AngleErrors {
    fn pool(&mut self, later: &Self) {
        let swing = |e: &Self| 100.0 * e.rmse_deg / e.rmse_percent_of_peak_to_peak;
        let largest_swing = swing(self).max(swing(later));
        self.rmse_deg = rms((self.rmse_deg, self.samples), (later.rmse_deg, later.samples));
        self.rmse_percent_of_peak_to_peak = 100.0 * self.rmse_deg / largest_swing;
        self.largest_deg = self.largest_deg.max(later.largest_deg);
        self.claim = claim_of_both(self.claim, later.claim);
        self.within_three_sigma = self.claim.map(|claim| claim.within);
        self.samples += later.samples;
    }
}

impl MotionErrors {
    /// Takes those of a later part in. Series for plots are kept of the first part alone.
    pub fn pool(&mut self, later: &Self) {
        let (samples, others) = (self.angle.samples, later.angle.samples);
        let peaks = |e: &Self, x: Option<f64>| (x, e.peaks);
        let [a, b] = [&*self, later].map(|e| peaks(e, e.peak_phase_rmse_deg));
        let peak_phase = of_both(a, b, rms);
        let [a, b] = [&*self, later].map(|e| peaks(e, e.phase_shift_reference_deg));
        let shift_reference = mean_angle(a, b);
        let [a, b] = [&*self, later].map(|e| peaks(e, e.phase_shift_estimate_deg));
        let shift_estimate = mean_angle(a, b);
        self.peak_phase_rmse_deg = peak_phase;
        self.phase_shift_reference_deg = shift_reference;
        self.phase_shift_estimate_deg = shift_estimate;
        self.peaks += later.peaks;
        self.peaks_without_partner += later.peaks_without_partner;
        let both = |a: Option<f64>, b: Option<f64>, both| of_both((a, samples), (b, others), both);
        self.cycle_phase_rmse_deg = both(self.cycle_phase_rmse_deg, later.cycle_phase_rmse_deg, rms);
        self.amplitude_rmse_deg = both(self.amplitude_rmse_deg, later.amplitude_rmse_deg, rms);
        self.amplitude_reference_deg =
            both(self.amplitude_reference_deg, later.amplitude_reference_deg, mean);
        self.sign_disagrees |= later.sign_disagrees;
        self.reference_lag = self.reference_lag.or(later.reference_lag);
        self.angle.pool(&later.angle);
        for (own, later) in self.other_angles.iter_mut().zip(&later.other_angles) {
            own.pool(later);
        }
    }
}

impl ValueErrors {
    /// Takes those of a later part in. Scale factor and offset, which belong to a line through all samples, are those of the
    /// first part no more, and left out.
    pub fn pool(&mut self, later: &Self) {
        let of = |e: &Self, x: f64| (x, e.samples);
        // The root mean square of the reference, from its ratio to that of the error.
        let signal = |e: &Self| e.snr_db.map(|db| e.rmse * 10_f64.portable_powf(db / 20.0));
        let signals = of_both((signal(self), self.samples), (signal(later), later.samples), rms);
        self.bias = mean(of(self, self.bias), of(later, later.bias));
        self.rmse = rms(of(self, self.rmse), of(later, later.rmse));
        self.largest = self.largest.max(later.largest);
        self.snr_db =
            signals.map(|signal| 20.0 * (signal / self.rmse).portable_log10()).filter(|db| db.is_finite());
        self.scale_factor = None;
        self.offset = None;
        self.claim = claim_of_both(self.claim, later.claim);
        self.within_three_sigma = self.claim.map(|claim| claim.within);
        self.samples += later.samples;
    }
}

#[cfg(test)]
mod tests {
    use super::{mean_angle, rms};

    #[test]
    fn parts_pool_to_the_whole() {
        // √((3²·2 + 6²·1)/3)
        assert!((rms((3.0, 2), (6.0, 1)) - 18_f64.sqrt()).abs() < 1e-12);
        // 350° and 20°, one of each: 5° the short way round.
        assert!((mean_angle((Some(350.0), 1), (Some(20.0), 1)).unwrap() - 365.0).abs() < 1e-12);
        assert_eq!(mean_angle((None, 0), (Some(20.0), 1)), Some(20.0));
    }
}
