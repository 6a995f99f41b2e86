//! How an interferogram is brought to an end.

use kalmems_core::Portable;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// The weight of an interferogram over u = |x|/L, the path difference over its largest one.
///
/// A truncated interferogram has lines with feet; a weight that falls towards the end lowers these and widens the
/// line. With a boxcar the line is sin(2π·ν·L)/(2π·ν·L).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Apodisation {
    /// 1.
    Boxcar,
    /// 1 − u.
    Triangular,
    /// 0.54 + 0.46·cos(π·u) (Happ and Genzel, Infrared Physics 1, 39, 1961).
    HappGenzel,
    /// Norton and Beer's weak one (Journal of the Optical Society of America 66, 259, 1976; corrected in 67, 419, 1977).
    NortonBeerWeak,
    /// Their medium one.
    NortonBeerMedium,
    /// Their strong one.
    NortonBeerStrong,
    /// 0.42323 + 0.49755·cos(π·u) + 0.07922·cos(2π·u) (Harris, Proceedings of the IEEE 66, 51, 1978).
    #[serde(rename = "blackman_harris_3")]
    BlackmanHarris3,
    /// The same with four terms (Harris, 1978).
    #[serde(rename = "blackman_harris_4")]
    BlackmanHarris4,
}

impl Apodisation {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Boxcar,
        Self::Triangular,
        Self::HappGenzel,
        Self::NortonBeerWeak,
        Self::NortonBeerMedium,
        Self::NortonBeerStrong,
        Self::BlackmanHarris3,
        Self::BlackmanHarris4,
    ];

    /// The weight at u = |x|/L; 0 beyond the end.
    pub fn weight(self, u: f64) -> f64 {
        let u = u.abs();
        if u > 1.0 || u.is_nan() {
            return 0.0;
        }
        let rest = 1.0 - u * u;
        let cosine = |order: f64| (order * PI * u).portable_cos();
        match self {
            Self::Boxcar => 1.0,
            Self::Triangular => 1.0 - u,
            Self::HappGenzel => 0.54 + 0.46 * cosine(1.0),
            Self::NortonBeerWeak => 0.384_093 - 0.087_577 * rest + 0.703_484 * rest.powi(2),
            Self::NortonBeerMedium => 0.152_442 - 0.136_176 * rest + 0.983_734 * rest.powi(2),
            Self::NortonBeerStrong => 0.045_335 + 0.554_883 * rest.powi(2) + 0.399_782 * rest.powi(4),
            Self::BlackmanHarris3 => 0.423_23 + 0.497_55 * cosine(1.0) + 0.079_22 * cosine(2.0),
            Self::BlackmanHarris4 => {
                0.358_75 + 0.488_29 * cosine(1.0) + 0.141_28 * cosine(2.0) + 0.011_68 * cosine(3.0)
            }
        }
    }

    /// The full width of a line at half its height, in units of 1/L, from the transform of the weight.
    pub fn line_width(self) -> f64 {
        const STEPS: usize = 2000;
        // Simpson's rule; the weight is smooth.
        let line = |nu: f64| {
            let sum: f64 = (0..=STEPS)
                .map(|i| {
                    let factor = if i == 0 || i == STEPS {
                        1.0
                    } else if i % 2 == 1 {
                        4.0
                    } else {
                        2.0
                    };
                    let u = i as f64 / STEPS as f64;
                    factor * self.weight(u) * (2.0 * PI * nu * u).portable_cos()
                })
                .sum();
            sum / (3.0 * STEPS as f64)
        };
        let half = line(0.0) / 2.0;
        let (mut inside, mut outside) = (0.0_f64, 2.0_f64);
        for _ in 0..60 {
            let middle = inside.midpoint(outside);
            if line(middle) > half { inside = middle } else { outside = middle }
        }
        inside + outside
    }
}

#[cfg(test)]
mod tests {
    use super::Apodisation;

    /// Full widths at half height in units of that of the boxcar, 1.2067/(2·L): 1.2, 1.4 and 1.6 is how Norton and Beer
    /// chose their three; 1.77/(2·L) for the triangle.
    #[test]
    fn weights_begin_at_one_and_widths_are_the_published_ones() {
        for apodisation in Apodisation::ALL {
            assert!((apodisation.weight(0.0) - 1.0).abs() < 1e-12, "{apodisation:?}");
            assert_eq!(apodisation.weight(1.001), 0.0);
            assert_eq!(apodisation.weight(-0.4), apodisation.weight(0.4));
        }
        let boxcar = Apodisation::Boxcar.line_width();
        assert!((boxcar - 1.206_709 / 2.0).abs() < 1e-5, "{boxcar}");
        assert!((Apodisation::Triangular.line_width() - 1.771_78 / 2.0).abs() < 1e-4);
        for (apodisation, width) in [
            (Apodisation::NortonBeerWeak, 1.2),
            (Apodisation::NortonBeerMedium, 1.4),
            (Apodisation::NortonBeerStrong, 1.6),
        ] {
            let found = apodisation.line_width() / boxcar;
            assert!((found - width).abs() < 0.01, "{apodisation:?}: {found}");
        }
    }
}
