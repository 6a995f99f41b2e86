//! Scans whose trajectories are wrong by a known phase.

use kalmems::applications::image::{
    AxisOscillation, AxisTrack, ImageScan, Lissajous, ScanAxis, TissueScene, TrackError,
};
use kalmems::simulate::WhiteNoise;

/// Half the field of view.
pub const HALF_FIELD_RAD: f64 = 0.15;

/// How far an axis has moved since its phase was calibrated, and how its image is recorded.
pub struct Recorded {
    pub scene: TissueScene,
    pub pixels: usize,
    /// Of x and y, in degrees.
    pub phases_deg: [f64; 2],
    /// The standard deviation of an intensity.
    pub noise: f64,
    pub seed: u64,
    pub rate_hz: f64,
    /// Of the trajectory, which has a clock of its own.
    pub trajectory_rate_hz: f64,
    pub duration_s: f64,
}

impl Recorded {
    /// Times and intensities.
    pub fn intensities(&self) -> (Vec<f64>, Vec<f64>) {
        let believed = Lissajous::published(self.rate_hz);
        let [x, y] = self.phases_deg.map(f64::to_radians);
        let real = Lissajous { x: believed.x.ahead_by(x), y: believed.y.ahead_by(y), ..believed };
        let mut noise = WhiteNoise::new(self.seed, 0);
        real.frame(self.duration_s)
            .map(|spot| (spot.time_s, self.scene.intensity(spot.position) + self.noise * noise.sample()))
            .unzip()
    }

    /// Times and angles of the trajectory of an axis, as it was calibrated. It lasts a little longer than the intensities,
    /// so that a search has something to move.
    pub fn trajectory(&self, axis: AxisOscillation) -> (Vec<f64>, Vec<f64>) {
        let lissajous = Lissajous { x: axis, y: axis, rate_hz: self.trajectory_rate_hz };
        let longer = self.duration_s + 20.0 / self.trajectory_rate_hz;
        let angle = |position: f64| (2.0 * position - 1.0) * HALF_FIELD_RAD;
        lissajous.frame(longer).map(|spot| (spot.time_s, angle(spot.position[0]))).unzip()
    }

    /// All of it.
    pub fn scan(&self) -> Result<ImageScan, TrackError> {
        let believed = Lissajous::published(self.rate_hz);
        let axis = |axis| {
            let (time_s, angle) = self.trajectory(axis);
            let track = AxisTrack::new(time_s, angle)?;
            Ok(ScanAxis { track, half_field_rad: HALF_FIELD_RAD, pixels: self.pixels })
        };
        let (time_s, intensity) = self.intensities();
        Ok(ImageScan { time_s, intensity, x: axis(believed.x)?, y: Some(axis(believed.y)?) })
    }
}
