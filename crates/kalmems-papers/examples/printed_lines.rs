//! Makes the table of misprints in the book's chapter on the circuit again: each printed line beside the right one.
//!
//!     cargo run --release --example printed_lines

use kalmems_engines::circuit::{AmplitudeDetector, Circuit, Excitation, HighPass, SineMotion};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::circuit::{SquareLaw, Transimpedance};
use kalmems_papers::printed_lines;
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

/// Chen et al., shared electrodes, 2020, Table II.
const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };

/// The paper's own drive, and the carrier of Table I.
const EXCITATION: Excitation =
    Excitation { offset: 0.0, amplitude: 30.0, drive_hz: 31_350.0, carrier: 6.0, carrier_hz: 500e3 };

fn main() -> Result<(), Box<dyn Error>> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../book/src/figures/circuit_printed.md");
    std::fs::write(&file, table()?)?;
    println!("written to {}", file.display());
    Ok(())
}

/// The published lines beside the right ones, with Table I's circuit; its high-pass has one pole here, and the parasitic
/// capacitance and the detector are assumed.
fn table() -> Result<String, Box<dyn Error>> {
    let circuit = Circuit {
        transimpedance: Transimpedance { feedback_resistance: 17.86e3, parasitic_capacitance: 5e-12 },
        amplifier_bandwidth_hz: None,
        high_pass: HighPass::new(1, 482e3).ok_or("no such order")?,
        detector: AmplitudeDetector::SquareLaw(SquareLaw { linear: 1.0, square: 0.5 }),
        low_pass_hz: [40.8e3, 41.1e3],
        noise_density: 0.0,
    };
    let motion = SineMotion { amplitude_rad: 8.0_f64.to_radians(), phase_rad: 0.7 };
    let mut table = String::from(
        "| stage | line | equations | as printed | with the same C(θ) | with the Gaussian C(θ) |\n|---|---|---|---:|---:|---:|\n",
    );
    let volts = |value: f64| if value.abs() < 5e-7 { "0".to_owned() } else { format!("{value:.4} V") };
    for line in printed_lines(&circuit, &EXCITATION, &COMB, &motion) {
        writeln!(
            table,
            "| {} | {} | {} | {} | {} | {} |",
            line.stage,
            line.name,
            line.equations,
            volts(line.printed),
            volts(line.quadratic),
            volts(line.exact)
        )?;
    }
    Ok(table)
}
