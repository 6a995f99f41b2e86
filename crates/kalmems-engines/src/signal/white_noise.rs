//! The noise of a signal beside its motion.

/// The variance of white noise by the fourth differences of samples, which a slow motion hardly changes; by the median of their sizes,
/// so that outliers do not either. `None` of fewer than 16 of them.
pub fn white_noise_variance(values: &[f64]) -> Option<f64> {
    let of = |w: &[f64]| (w[0] - 4.0 * w[1] + 6.0 * w[2] - 4.0 * w[3] + w[4]).abs();
    let mut sizes: Vec<f64> = values.windows(5).map(of).filter(|size| size.is_finite()).collect();
    if sizes.len() < 16 {
        return None;
    }
    let middle = sizes.len() / 2;
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    // The median of the size of a normal number is 0.6745 standard deviations; 1 + 16 + 36 + 16 + 1 = 70.
    Some((*median / 0.674_489_75).powi(2) / 70.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_tell_the_noise_beside_a_motion_and_outliers() {
        // Sums of twelve uniform numbers are nearly normal, with a variance of 1.
        let mut state = 3_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut noise = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let mut values: Vec<f64> =
            (0..20_000).map(|k| 5.0 * (0.05 * f64::from(k)).sin() + 0.02 * noise()).collect();
        for k in (0..values.len()).step_by(400) {
            values[k] += 3.0;
        }
        let variance = white_noise_variance(&values).unwrap();
        assert!((variance / 4e-4 - 1.0).abs() < 0.06, "{variance}");
        assert!(white_noise_variance(&values[..12]).is_none());
    }
}
