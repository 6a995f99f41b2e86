//! Complex numbers by size and angle, the same to the last bit on every platform.

use kalmems_core::Portable;
use realfft::num_complex::Complex64;

/// Size and angle of a complex number by [`Portable`]: those of `num_complex` are the platform's.
pub trait PortableComplex: Copy {
    /// Its size.
    fn portable_norm(self) -> f64;
    /// Its angle in rad between −π and π.
    fn portable_arg(self) -> f64;
    /// The number of this size and angle in rad.
    fn portable_polar(size: f64, angle: f64) -> Self;
    /// The number of size 1 and this angle in rad.
    fn portable_cis(angle: f64) -> Self {
        Self::portable_polar(1.0, angle)
    }
}

impl PortableComplex for Complex64 {
    fn portable_norm(self) -> f64 {
        self.re.portable_hypot(self.im)
    }

    fn portable_arg(self) -> f64 {
        self.im.portable_atan2(self.re)
    }

    fn portable_polar(size: f64, angle: f64) -> Self {
        let (sine, cosine) = angle.portable_sin_cos();
        Self::new(size * cosine, size * sine)
    }
}
