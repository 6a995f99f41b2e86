//! What may happen to the numbers of a channel.

/// The standard deviation of a channel's numbers from one to the next: that of its noise, where it is not much slower than the samples.
pub fn noise(values: &[f64]) -> f64 {
    let second = |w: &[f64]| w[0] - 2.0 * w[1] + w[2];
    let sum: f64 = values.windows(3).map(|w| second(w).powi(2)).sum();
    (sum / (6.0 * values.len() as f64)).sqrt()
}

/// A line of 50 Hz, or of two periods in the recording where that is shorter than two periods of 50 Hz.
pub fn hum(values: &mut [f64], times: &[f64], size: f64, seed: u64) {
    let long_s = times[times.len() - 1] - times[0];
    let hz = if long_s > 0.04 { 50.0 } else { 2.0 / long_s };
    add_line(values, times, hz, size, seed as f64);
}

/// A sine of so many standard deviations of the noise.
pub fn add_line(values: &mut [f64], times: &[f64], hz: f64, size: f64, phase: f64) {
    let amplitude = size * noise(values);
    for (value, time) in values.iter_mut().zip(times) {
        *value += amplitude * (std::f64::consts::TAU * hz * time + phase).sin();
    }
}

/// Twenty samples that are off by so many standard deviations of the noise.
pub fn spikes(values: &mut [f64], _: &[f64], size: f64, seed: u64) {
    let (height, count) = (size * noise(values), values.len());
    for k in 0..20 {
        let place = count / 3 + (k * 7919 + 31 * usize::try_from(seed).unwrap()) % (count / 2);
        values[place] += if k % 2 == 0 { height } else { -height };
    }
}

/// A factor that is one by this part too large.
pub fn scaled(values: &mut [f64], _: &[f64], size: f64, _: u64) {
    for value in values {
        *value *= 1.0 + size;
    }
}

/// What is shown comes so many samples later.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a place among the samples
pub fn late(values: &mut [f64], _: &[f64], size: f64, _: u64) {
    let before = values.to_vec();
    for (k, value) in values.iter_mut().enumerate() {
        let place = (k as f64 - size).max(0.0);
        let whole = place as usize;
        let next = before[(whole + 1).min(before.len() - 1)];
        *value = before[whole] + place.fract() * (next - before[whole]);
    }
}
