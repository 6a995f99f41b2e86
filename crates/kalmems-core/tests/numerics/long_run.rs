//! Many steps in `f32` from a start that is vague by 10¹⁴ against the measurement.

use kalmems_core::{
    Covariance, Filter, LinearMeasurement, LinearProcess, Mat, NoiseDensity, Scalar, SquareRootEkf,
};

/// Uniform noise of unit variance from a linear congruential generator (Knuth's MMIX constants).
struct Noise(u64);
impl Noise {
    #[allow(clippy::cast_possible_truncation)] // 24 of the upper bits
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let unit = ((self.0 >> 40) as f32 + 0.5) / 16_777_216.0;
        (unit - 0.5) * 12.0_f32.sqrt()
    }
}

/// A resonator of Q = 100, twenty samples a cycle, driven by noise, and a filter of it. At every step the
/// diagonal of its factor must be positive and finite. NIS must be 1 on average: its standard error over n
/// uncorrelated innovations is at most √(2/n).
fn run(steps: u32) {
    let w = std::f32::consts::TAU / 20.0;
    let process = LinearProcess::<f32, 2, 0>::exact(
        &Mat([[0.0, w], [-w, -w / 100.0]]),
        &Mat::zero(),
        &NoiseDensity::none().on::<1>(1e-5),
        1.0,
    );
    let position = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };
    let deviation = 1e-2;
    let r = Covariance::from_variances([deviation * deviation]);
    let mut filter =
        SquareRootEkf::new([0.0; 2], Covariance::from_variances([1e14 * deviation * deviation; 2]));
    let mut noise = Noise(1);
    let mut truth = [1.0_f32, 0.0];
    let mut nis = 0.0_f64;
    for step in 0..steps {
        let moved = process.transition.times_vector::<f32>(&truth);
        let (a, b) = (noise.next(), noise.next());
        let w = process.noise.root();
        truth = [moved[0] + w[(0, 0)] * a, moved[1] + w[(1, 0)] * a + w[(1, 1)] * b];
        filter.predict(&process, &[]).unwrap();
        let innovation = filter.update(&position, &[truth[0] + deviation * noise.next()], &r).unwrap();
        nis += f64::from(innovation.nis);
        let s = filter.factor();
        let definite = s[(0, 0)].gt(0.0) && s[(1, 1)].gt(0.0) && (s[(0, 0)] + s[(1, 1)]).is_finite();
        assert!(definite, "step {step}: {s:?}");
    }
    let mean = nis / f64::from(steps);
    assert!((mean - 1.0).abs() < 4.0 * (2.0 / f64::from(steps)).sqrt() + 1e-4, "NIS {mean}");
}

#[test]
fn a_hundred_thousand_steps() {
    run(100_000);
}

#[test]
#[ignore = "slow: cargo test --release --workspace -- --ignored slow_"]
fn slow_a_hundred_million_steps() {
    run(100_000_000);
}
