//! Random numbers of another kind than the library's.

/// Xorshift with a multiplication at its end (Vigna 2016, xorshift64*), behind it Box and Muller's transformation.
pub struct Chance {
    state: u64,
    spare: Option<f64>,
}

impl Chance {
    pub fn new(seed: u64) -> Self {
        let mut chance =
            Self { state: seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x2545_f491_4f6c_dd1d, spare: None };
        for _ in 0..16 {
            chance.uniform();
        }
        chance
    }

    /// Above 0 and below 1.
    pub fn uniform(&mut self) -> f64 {
        self.state ^= self.state >> 12;
        self.state ^= self.state << 25;
        self.state ^= self.state >> 27;
        let bits = self.state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11;
        (bits as f64 + 0.5) / (1_u64 << 53) as f64
    }

    /// Of mean 0 and variance 1.
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        let (sine, cosine) = (std::f64::consts::TAU * self.uniform()).sin_cos();
        self.spare = Some(radius * sine);
        radius * cosine
    }

    /// Between these two.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }
}
