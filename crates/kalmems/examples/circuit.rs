//! Makes the pictures and tables of the book's chapter on the circuit again. Everything is computed, nothing measured.
//!
//!     cargo run --release --example circuit

use kalmems::circuit::{
    Adequacy, AdequacySettings, AmplitudeDetector, Bands, Circuit, CircuitSpectrum, DriveRejection,
    Excitation, HighPass, ReducedCircuit, SineMotion,
};
use kalmems::figures::{Axis, Figure, Panel, Series, SeriesRole};
use kalmems::simulate::Drive;
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::circuit::{SquareLaw, Transimpedance};
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

/// Chen et al., shared electrodes, 2020, Table II.
const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
const SCANNER: ParametricScanner<f64> = ParametricScanner {
    resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
    comb: COMB,
    carrier_mean_square: 18.0,
};

/// Table I, with a drive that moves the device.
const EXCITATION: Excitation =
    Excitation { offset: 90.0, amplitude: 90.0, drive_hz: 31_350.0, carrier: 6.0, carrier_hz: 500e3 };

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../book/src/figures");
    std::fs::create_dir_all(&folder)?;
    let (rejection, orders) = rejection()?;
    let figures = [spectra()?, rejection, models()?, cost()?];
    for figure in &figures {
        std::fs::write(folder.join(format!("{}.svg", figure.id)), figure.to_svg())?;
        if std::env::args().any(|argument| argument == "--svg") {
            std::fs::write(std::env::temp_dir().join(format!("{}.svg", figure.id)), figure.to_svg())?;
        }
    }
    std::fs::write(folder.join("circuit_orders.md"), orders)?;
    println!("written to {}", folder.display());
    Ok(())
}

/// Table I; parasitic capacitance and detector are assumed.
fn circuit(order: usize) -> Result<Circuit, Box<dyn Error>> {
    Ok(Circuit {
        transimpedance: Transimpedance { feedback_resistance: 17.86e3, parasitic_capacitance: 5e-12 },
        amplifier_bandwidth_hz: None,
        high_pass: HighPass::new(order, 482e3).ok_or("no such order")?,
        detector: AmplitudeDetector::SquareLaw(SquareLaw { linear: 1.0, square: 0.5 }),
        low_pass_hz: [40.8e3, 41.1e3],
        noise_density: 0.0,
    })
}

fn motion(degrees: f64) -> SineMotion {
    SineMotion { amplitude_rad: degrees.to_radians(), phase_rad: 0.7 }
}

/// The lines of the four stages, a stick each.
fn spectra() -> Result<Figure, Box<dyn Error>> {
    let bands = Bands::of(&circuit(4)?, &EXCITATION, &COMB, &motion(8.0));
    let detected = bands.detected.ok_or("a square-law detector has lines")?;
    let output = bands.output.ok_or("a square-law detector has lines")?;
    let mut figure = Figure::new("circuit_spectra", "Lines of the four stages", "");
    for (name, lines) in
        [("V_o1", &bands.amplified), ("V_o2", &bands.passed), ("V_o3", &detected), ("y_cap", &output)]
    {
        let x = Axis::new("frequency", "Hz").between(-2e4, 1.2e6);
        let mut panel = Panel::new(x, Axis::new(name, "V").log().between(1e-4, 20.0)).sharing_x();
        let groups = [
            (0, "n·f_dr", SeriesRole::Input),
            (1, "f_c ± n·f_dr", SeriesRole::Measured),
            (2, "2·f_c ± n·f_dr", SeriesRole::Estimate),
        ];
        for (carrier, label, role) in groups {
            panel = sticks(panel, lines, carrier, label, role);
        }
        figure = figure.with(panel);
    }
    Ok(figure)
}

fn sticks(mut panel: Panel, lines: &CircuitSpectrum, carrier: i32, label: &str, role: SeriesRole) -> Panel {
    let above = lines.lines().into_iter().filter(|line| line.carrier == carrier && line.amplitude > 1e-4);
    for (i, line) in above.enumerate() {
        let label = if i == 0 { label } else { "" };
        panel = panel.with(Series::line(
            label,
            role,
            [(line.frequency_hz, 1e-4), (line.frequency_hz, line.amplitude)],
        ));
    }
    panel
}

/// Drive and motion in the output over the order of the high-pass.
fn rejection() -> Result<(Figure, String), Box<dyn Error>> {
    let mut table = String::from(
        "| order | drive in y_cap | motion at 8° in y_cap | delay of the high-pass | lowest cut-off for 80 dB |\n\
         |---:|---:|---:|---:|---:|\n",
    );
    let (mut drive, mut moving) = (Vec::new(), Vec::new());
    for order in 1..=8 {
        let circuit = circuit(order)?;
        let alone = |excitation: &Excitation, degrees: f64| {
            let bands = Bands::of(&circuit, excitation, &COMB, &motion(degrees));
            bands.output.map_or(f64::NAN, |lines| lines.amplitude(0, 1))
        };
        let undriven = Excitation { offset: 0.0, amplitude: 0.0, ..EXCITATION };
        let (of_drive, of_motion) = (alone(&EXCITATION, 0.0), alone(&undriven, 8.0));
        let delay_s = ReducedCircuit::of(&circuit, &undriven, &COMB, &motion(5.0)).front_delay_s;
        let cutoff = EXCITATION.drive_hz * (1e8_f64 - 1.0).powf(0.5 / f64::from(u8::try_from(order)?));
        drive.push((order as f64, of_drive));
        moving.push((order as f64, of_motion));
        writeln!(
            table,
            "| {order} | {of_drive:.2e} V | {of_motion:.3} V | {:.2} µs | {:.0} kHz |",
            delay_s * 1e6,
            cutoff / 1e3
        )?;
    }
    let side_band_hz = EXCITATION.carrier_hz - EXCITATION.drive_hz;
    let demand =
        DriveRejection { drive_hz: EXCITATION.drive_hz, side_band_hz, rejection_db: 80.0, loss_db: 3.0 };
    let found = demand.design()?;
    writeln!(
        table,
        "\nFor 80 dB of rejection and a loss of at most 3 dB the design gives order {} with a cut-off from {:.0} to {:.0} kHz.",
        found.order,
        found.cutoff_hz[0] / 1e3,
        found.cutoff_hz[1] / 1e3
    )?;
    let panel = Panel::new(
        Axis::new("order of the high-pass at 482 kHz", ""),
        Axis::new("line at f_dr in y_cap", "V").log(),
    )
    .with(Series::points("motion, 8°", SeriesRole::Estimate, moving.clone()))
    .with(Series::line("", SeriesRole::Estimate, moving))
    .with(Series::points("drive, 90 V", SeriesRole::Input, drive.clone()))
    .with(Series::line("", SeriesRole::Input, drive));
    Ok((Figure::new("circuit_rejection", "What of the drive comes through", "").with(panel), table))
}

/// What four models leave of the output, over the amplitude.
fn models() -> Result<Figure, Box<dyn Error>> {
    let circuit = circuit(4)?;
    let mut left = [const { Vec::new() }; 4];
    for i in 2..=32 {
        let degrees = 0.5 * f64::from(i);
        let reduced = ReducedCircuit::of(&circuit, &EXCITATION, &COMB, &motion(degrees));
        let all = [reduced.affine, reduced.with_poles, reduced.delayed, reduced.with_poles_and_delay];
        for (points, model) in left.iter_mut().zip(all) {
            points.push((degrees, 100.0 * model.residual));
        }
    }
    let names = ["a·C + b", "C behind the poles", "C delayed", "C behind the poles, delayed"];
    let mut panel = Panel::new(Axis::new("amplitude", "deg"), Axis::new("left of y_cap", "%").log());
    for (name, points) in names.into_iter().zip(left) {
        panel = panel.with(Series::line(name, SeriesRole::Other, points));
    }
    Ok(Figure::new("circuit_models", "What a model of the circuit leaves unexplained", "").with(panel))
}

/// What a filter is wrong by that leaves the poles out.
fn cost() -> Result<Figure, Box<dyn Error>> {
    let circuit = circuit(4)?;
    let amplitude = || Axis::new("amplitude", "deg");
    let mut phase = Panel::new(amplitude(), Axis::new("behind by", "deg"));
    let mut angle = Panel::new(amplitude(), Axis::new("angle RMSE", "deg").log()).sharing_x();
    for (q, name) in [(1e4, "q = 1e4 rad²/s³"), (1e6, "q = 1e6 rad²/s³"), (1e8, "q = 1e8 rad²/s³")] {
        let setting = AdequacySettings {
            acceleration_density: q,
            noise_variance: 1.92e-4,
            carrier: EXCITATION.carrier,
            carrier_hz: EXCITATION.carrier_hz,
            permitted_phase_deg: 0.38,
        };
        let (mut behind, mut wrong) = (Vec::new(), Vec::new());
        for i in 0..=10 {
            let frequency_hz = 31_220.0 + 25.0 * f64::from(i);
            let drive = Drive::Sine { offset: 90.0, amplitude: 90.0, frequency_hz, phase_rad: 0.0 };
            let found = Adequacy::of(&circuit, &SCANNER, (&drive, [0.25, 0.0]), &setting)?;
            behind.push((found.amplitude_deg, found.affine.phase_deg));
            wrong.push((found.amplitude_deg, found.affine.angle_rmse_deg));
        }
        phase = phase.with(Series::points(name, SeriesRole::Other, behind));
        angle = angle.with(Series::points(name, SeriesRole::Other, wrong));
    }
    let title = "A filter that takes y_cap for a·C + b";
    Ok(Figure::new("circuit_affine_cost", title, "").with(phase).with(angle))
}
