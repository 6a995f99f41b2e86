//! Which residuals of a fit are none of its noise.

/// Standard deviations that noise does not reach once in ten million times.
const FAR: f64 = 5.33;

/// The median of the absolute value of a standard normal number.
const MEDIAN: f64 = 0.674_489_750_196_082;

/// The largest share of residuals that may be outliers; where more are, the fit is what is wrong.
const MOST: f64 = 0.1;

/// Which residuals, each over the standard deviation that is stated for it, are outliers: more than 5.33 standard deviations off, by what is
/// stated or by their median, where that is larger. What is not a number is none. `None` where there are too many of them.
pub fn outliers(residuals: &[f64]) -> Option<Vec<bool>> {
    outliers_of_stated(residuals, 1.0)
}

/// The same where this standard deviation is stated for all residuals; where none is, 0.
pub fn outliers_of_stated(residuals: &[f64], stated: f64) -> Option<Vec<bool>> {
    let mut sizes: Vec<f64> = residuals.iter().filter(|r| r.is_finite()).map(|r| r.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let median = sizes.get(sizes.len() / 2)?;
    let bound = FAR * (median / MEDIAN).max(stated);
    let found: Vec<bool> = residuals.iter().map(|r| r.abs() > bound).collect();
    let count = found.iter().filter(|is_out| **is_out).count();
    (count as f64 <= MOST * sizes.len() as f64).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::outliers;

    #[test]
    fn what_is_far_by_the_stated_and_by_the_measured_noise_is_an_outlier() {
        let mut residuals: Vec<f64> = (0..100).map(|k| (f64::from(k) * 0.7).sin() * 0.9).collect();
        residuals[7] = -6.0;
        residuals[8] = f64::NAN;
        let found = outliers(&residuals).unwrap();
        assert!(found[7] && found.iter().filter(|out| **out).count() == 1);
        // Of noise that is larger than stated they are none.
        let larger: Vec<f64> = residuals.iter().map(|r| 10.0 * r).collect();
        assert!(!outliers(&larger).unwrap()[3]);
        // A fifth of them is no set of outliers.
        assert_eq!(
            outliers(&(0..100).map(|k| if k % 5 == 0 { 90.0 } else { 1.0 }).collect::<Vec<_>>()),
            None
        );
    }
}
