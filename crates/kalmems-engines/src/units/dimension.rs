//! Physical dimensions as exponents of the SI base units, and of the angle.

use std::fmt;

/// The symbols behind the exponents of a [`Dimension`], in its order.
const SYMBOLS: [&str; 6] = ["kg", "m", "s", "A", "K", "rad"];

/// Exponents of kg, m, s, A, K and rad, in halves: a noise density in V/√Hz has half an exponent.
///
/// The angle is counted although the SI calls it dimensionless: it keeps rad/s apart from Hz.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Dimension {
    halves: [i16; 6],
}

impl Dimension {
    /// No dimension: a ratio.
    pub const NONE: Self = Self { halves: [0; 6] };

    /// From whole exponents of kg, m, s, A, K and rad.
    pub const fn of(exponents: [i16; 6]) -> Self {
        let mut halves = [0; 6];
        let mut i = 0;
        while i < 6 {
            halves[i] = 2 * exponents[i];
            i += 1;
        }
        Self { halves }
    }

    /// From exponents in halves, as a noise density has them.
    pub const fn of_halves(halves: [i16; 6]) -> Self {
        Self { halves }
    }

    /// The dimension of a product.
    #[must_use]
    pub const fn times(self, other: Self) -> Self {
        let mut halves = self.halves;
        let mut i = 0;
        while i < 6 {
            halves[i] = halves[i].saturating_add(other.halves[i]);
            i += 1;
        }
        Self { halves }
    }

    /// The dimension raised to half of `halves`; `None` where the exponent would not be a whole half.
    pub fn to_half_power(self, halves: i16) -> Option<Self> {
        let mut result = self;
        for e in &mut result.halves {
            let doubled = e.checked_mul(halves)?;
            if doubled % 2 != 0 {
                return None;
            }
            *e = doubled / 2;
        }
        Some(result)
    }

    /// As the ending of a column name: `rad_per_s`, `kg_m2_per_s3`; `1` for a ratio.
    pub(super) fn header(self) -> String {
        let mut words = Vec::new();
        for above in [true, false] {
            for (halves, symbol) in
                self.halves.iter().zip(SYMBOLS).filter(|(h, _)| (**h > 0) == above && **h != 0)
            {
                if !above {
                    words.push("per".to_owned());
                }
                let halves = halves.unsigned_abs();
                words.push(match (halves % 2, halves / 2) {
                    (0, 1) => symbol.to_owned(),
                    (0, whole) => format!("{symbol}{whole}"),
                    (_, 0) => format!("rt{symbol}"),
                    (_, whole) => format!("{symbol}{whole}_rt{symbol}"),
                });
            }
            if above && words.is_empty() {
                words.push("1".to_owned());
            }
        }
        words.join("_")
    }

    /// The same without the angle: N·m and N·m/rad become one.
    #[must_use]
    pub const fn without_angle(self) -> Self {
        let mut halves = self.halves;
        halves[5] = 0;
        Self { halves }
    }
}

impl fmt::Display for Dimension {
    /// In base units, such as `kg m^2 s^-2`; `1` for a ratio.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut first = true;
        for (halves, symbol) in self.halves.iter().zip(SYMBOLS) {
            if *halves == 0 {
                continue;
            }
            if !first {
                f.write_str(" ")?;
            }
            first = false;
            match *halves {
                2 => f.write_str(symbol)?,
                h if h % 2 == 0 => write!(f, "{symbol}^{}", h / 2)?,
                h => write!(f, "{symbol}^({h}/2)")?,
            }
        }
        if first { f.write_str("1") } else { Ok(()) }
    }
}
