//! Where the path difference is zero.

/// The sample nearest to the zero path difference: the largest deviation from the mean, which is where all
/// wavenumbers are in phase. `None` where there is no finite sample.
pub fn zero_path(interferogram: &[f64]) -> Option<usize> {
    let finite = || interferogram.iter().enumerate().filter(|(_, y)| y.is_finite());
    let count = finite().count();
    let mean = finite().map(|(_, y)| y).sum::<f64>() / count.max(1) as f64;
    finite().max_by(|a, b| (a.1 - mean).abs().total_cmp(&(b.1 - mean).abs())).map(|(k, _)| k)
}

#[cfg(test)]
mod tests {
    use super::zero_path;

    #[test]
    fn the_centre_is_found_of_either_sign_and_on_an_offset() {
        for (sign, offset) in [(1.0, 0.0), (-1.0, 0.0), (1.0, 40.0), (-1.0, -7.0)] {
            let burst =
                |k: i32| (-(f64::from(k - 321) / 9.0).powi(2)).exp() * (f64::from(k - 321) * 0.9).cos();
            let y: Vec<f64> = (0..700).map(|k| offset + sign * burst(k)).collect();
            assert_eq!(zero_path(&y), Some(321));
        }
        assert_eq!(zero_path(&[f64::NAN]), None);
        assert_eq!(zero_path(&[f64::NAN, 3.0]), Some(1));
    }
}
