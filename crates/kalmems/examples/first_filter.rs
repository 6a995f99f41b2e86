//! The first filter of the book: the angle of a scanner from a recording of its drive and its signal.
//!
//!     cargo run --release --example first_filter

// ANCHOR: filter
use kalmems_core::{Covariance, Ekf, Filter, Nodes, NoiseDensity, Rk4};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let comb = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
    let resonator = TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 };
    let scanner = ParametricScanner { resonator, comb, carrier_mean_square: 18.0 };
    let readout = DemodulatedComb { comb, gain: -0.3574e12, offset: 6.3945 };
    let pushes = NoiseDensity::none().on::<1>(1e8); // rad²/s³: how far the model is trusted
    let process = Rk4::new(scanner, 1e-6, &pushes, (&[0.0, 0.0], &0.0));
    let mut filter = Ekf::new([0.05, 0.0], Covariance::from_standard_deviations([0.15, 15e3]));

    let mut before = 90.0;
    for row in csv::Reader::from_path("examples/shared_scanner/recording.csv")?.deserialize() {
        let [_, drive, signal]: [f64; 3] = row?;
        let volts = Nodes { start: before, middle: f64::midpoint(before, drive), end: drive };
        filter.predict(&process, &volts)?;
        filter.update(&readout, &[signal], &Covariance::from_variances([1.92e-4]))?;
        before = drive;
    }
    let (angle, sd) = (filter.mean()[0], filter.covariance().standard_deviation(0));
    println!("{:.3}° ± {:.3}°", angle.to_degrees(), sd.to_degrees());
    Ok(())
}
// ANCHOR_END: filter
