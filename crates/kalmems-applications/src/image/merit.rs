//! How good an image is.

use super::picture::Picture;
use kalmems_core::Portable;

/// The peak signal-to-noise ratio in dB of a picture against the true one, where white is 1 and black 0:
/// −10·log₁₀ of the mean square of the difference, over the pixels that both have. Infinite where none differs; `None`
/// where there is nothing to compare.
///
/// It depends on what is in the picture: a fine texture loses more by the same shift than a coarse one.
pub fn psnr_db(picture: &Picture, truth: &Picture) -> Option<f64> {
    let pairs = pairs(picture, truth)?;
    let (sum, count) = pairs.fold((0.0, 0_usize), |(sum, n), (a, b)| (sum + (a - b) * (a - b), n + 1));
    (count > 0).then(|| -10.0 * (sum / count as f64).portable_log10())
}

fn pairs<'a>(a: &'a Picture, b: &'a Picture) -> Option<impl Iterator<Item = (f64, f64)> + 'a> {
    let pairs = a.values().iter().copied().zip(b.values().iter().copied());
    (a.size() == b.size()).then(|| pairs.filter(|(a, b)| a.is_finite() && b.is_finite()))
}

/// Side of the windows over which structure is compared, in pixels.
const WINDOW: usize = 8;

/// The structural similarity of two pictures whose white is 1: 1 if they are equal.
///
/// The mean over windows of 8 × 8 pixels, four apart, of (2μ₁μ₂ + c₁)(2σ₁₂ + c₂)/((μ₁² + μ₂² + c₁)(σ₁² + σ₂² + c₂)) with
/// c₁ = 0.01² and c₂ = 0.03² (Wang, Bovik, Sheikh and Simoncelli, IEEE Trans. Image Process. 13, 600, 2004, (13), with flat
/// windows). Empty pixels are left out; `None` where no window has two pixels to compare.
pub fn structural_similarity(picture: &Picture, truth: &Picture) -> Option<f64> {
    let [width, height] = picture.size();
    if truth.size() != [width, height] {
        return None;
    }
    let (mut sum, mut windows) = (0.0, 0_usize);
    for top in (0..height).step_by(WINDOW / 2) {
        for left in (0..width).step_by(WINDOW / 2) {
            let part = [picture, truth].map(|p| p.crop([left, top], [WINDOW, WINDOW]));
            if let Some(similarity) = pairs(&part[0], &part[1]).and_then(similarity) {
                sum += similarity;
                windows += 1;
            }
        }
    }
    (windows > 0).then(|| sum / windows as f64)
}

fn similarity(pairs: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    const C1: f64 = 1e-4;
    const C2: f64 = 9e-4;
    let (mut n, mut m, mut s) = (0.0, [0.0; 2], [0.0; 3]);
    for (a, b) in pairs {
        n += 1.0;
        m = [m[0] + a, m[1] + b];
        s = [s[0] + a * a, s[1] + b * b, s[2] + a * b];
    }
    if n < 2.0 {
        return None;
    }
    let [a, b] = m.map(|sum| sum / n);
    let [aa, bb, ab] = [s[0] / n - a * a, s[1] / n - b * b, s[2] / n - a * b];
    Some((2.0 * a * b + C1) * (2.0 * ab + C2) / ((a * a + b * b + C1) * (aa + bb + C2)))
}

/// The blur along x, in pixels: over how many pixels the mean of the rows rises from 10 % to 90 % of its whole rise.
///
/// For the picture of one upright edge, dark on the left. `None` where it does not rise through both.
pub fn edge_width(picture: &Picture) -> Option<f64> {
    let [width, height] = picture.size();
    let profile: Vec<f64> = (0..width)
        .map(|column| {
            let values = (0..height).map(|row| picture.at(column, row)).filter(|v| v.is_finite());
            let (sum, count) = values.fold((0.0, 0_usize), |(sum, n), v| (sum + v, n + 1));
            sum / count as f64
        })
        .collect();
    let (first, last) = (*profile.first()?, *profile.last()?);
    let crossing = |part: f64| {
        let level = first + part * (last - first);
        let index = profile.windows(2).position(|pair| pair[0] < level && pair[1] >= level)?;
        let (low, high) = (profile[index], profile[index + 1]);
        Some(index as f64 + (level - low) / (high - low))
    };
    Some(crossing(0.9)? - crossing(0.1)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(values: &[f64]) -> Picture {
        Picture::new([values.len(), 1], values.to_vec()).unwrap()
    }

    #[test]
    fn a_tenth_everywhere_is_20_db() {
        let (a, b) = (picture(&[0.0, 0.5, f64::NAN]), picture(&[0.1, 0.4, 0.9]));
        assert!((psnr_db(&a, &b).unwrap() - 20.0).abs() < 1e-9);
        assert_eq!(psnr_db(&a, &a), Some(f64::INFINITY));
        assert_eq!(psnr_db(&a, &picture(&[0.0])), None);
    }

    /// In one window: the formula by hand for variances of 0.25 and means of ½, the one turned about.
    #[test]
    fn similarity_is_one_of_equals_and_minus_one_of_opposites() {
        let (a, b) = (picture(&[0.0, 1.0, 0.0, 1.0]), picture(&[1.0, 0.0, 1.0, 0.0]));
        assert!((structural_similarity(&a, &a).unwrap() - 1.0).abs() < 1e-12);
        let opposite = (-0.5 + 9e-4) / (0.5 + 9e-4);
        assert!((structural_similarity(&a, &b).unwrap() - opposite).abs() < 1e-12);
    }

    #[test]
    fn a_straight_rise_is_four_fifths_of_its_length() {
        let ramp: Vec<f64> = (0..40).map(|k| ((f64::from(k) - 10.0) / 20.0).clamp(0.0, 1.0)).collect();
        assert!((edge_width(&picture(&ramp)).unwrap() - 16.0).abs() < 1e-9);
        assert_eq!(edge_width(&picture(&[1.0, 1.0, 0.0])), None);
    }
}
