//! How far the noises of two channels are one.

/// Sums over samples of several channels.
pub struct CommonNoise {
    /// What is taken off each channel, so that a large level costs no digits.
    near: Vec<f64>,
    /// Of each pair of channels, the later one first: n, Σa, Σb, Σa², Σb², Σab over the samples that both have.
    pairs: Vec<[f64; 6]>,
}

impl CommonNoise {
    /// Of so many channels.
    pub fn new(channels: usize) -> Self {
        let pairs = channels * channels.saturating_sub(1) / 2;
        Self { near: vec![f64::NAN; channels], pairs: vec![[0.0; 6]; pairs] }
    }

    /// The next samples of each channel.
    pub fn take(&mut self, channels: &[&[f64]]) {
        for (near, values) in self.near.iter_mut().zip(channels) {
            if near.is_nan() {
                *near = values.iter().copied().find(|v| v.is_finite()).unwrap_or(f64::NAN);
            }
        }
        let pairs = (0..channels.len()).flat_map(|one| (0..one).map(move |other| (one, other)));
        for ((one, other), sums) in pairs.zip(&mut self.pairs) {
            for (a, b) in channels[one].iter().zip(channels[other]) {
                let (a, b) = (a - self.near[one], b - self.near[other]);
                if (a * b).is_finite() {
                    for (sum, term) in sums.iter_mut().zip([1.0, a, b, a * a, b * b, a * b]) {
                        *sum += term;
                    }
                }
            }
        }
    }

    /// The two channels with the largest correlation, the earlier one first.
    pub fn largest(&self) -> Option<(f64, usize, usize)> {
        let pairs = (0..self.near.len()).flat_map(|one| (0..one).map(move |other| (one, other)));
        let correlation =
            |[n, a, b, aa, bb, ab]: [f64; 6]| (ab - a * b / n) / ((aa - a * a / n) * (bb - b * b / n)).sqrt();
        let all = pairs.zip(&self.pairs).map(|((one, other), sums)| (correlation(*sums), other, one));
        // Of equal ones the first.
        all.reduce(|most, next| if next.0.abs() > most.0.abs() { next } else { most })
    }
}
