//! Makes the simulated records of `examples/gyroscope`, and the tables and the pictures of the book's chapter on
//! calibration, again.
//!
//!     cargo run --release --example gyroscope

use kalmems::applications::ApplicationFile;
use kalmems::applications::calibration::{
    GyroscopeCalibration, NoiseShare, NoiseStudy, OffAxisMotion, SimulatedInstrument, SimulatedUnit,
    Vibration, calibrate, calibration_figures,
};
use kalmems::diagnose::identify;
use kalmems::figures::{Axis, Figure, Panel, Series, SeriesRole};
use kalmems::progress::Silent;
use kalmems::results::{Metrics, Output, RunInfo, Work, WriteOptions, write_estimate};
use kalmems::rigs::published;
use kalmems::simulate::WhiteNoise;
use kalmems::workflow;
use kalmems_models::capacitance::TiltingPlate;
use kalmems_models::dynamics::TorsionalResonator;
use kalmems_models::inertial::{SampleClock, SpecificForce, Triad};
use std::error::Error;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::time::{Duration, SystemTime};

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let [examples, figures] = [root.join("examples/gyroscope"), root.join("book/src/figures")];
    three_axes(&examples)?;
    at_rest(&examples)?;
    fs::write(figures.join("calibration_off_axis.md"), off_axis())?;
    let shares = noise()?;
    fs::write(figures.join("calibration_noise.md"), noise_table(&shares))?;
    fs::write(figures.join("calibration_noise.svg"), noise_figure(&shares).to_svg())?;
    fs::write(figures.join("calibration_budget.svg"), budget_by_stage(&root)?.to_svg())?;
    of_inertial_unit(&root, &figures)
}

/// The pictures of each kind of record of `examples/inertial_unit`, by file, and the names that they have in the book.
const OF_UNIT: [(&str, &[[&str; 2]]); 3] = [
    ("unit.toml", &[["rest", "still"], ["allan", "allan"], ["positions", "positions"]]),
    ("table.toml", &[["rates-z", "rates"], ["temperature-gyroscope-bias-z", "temperature"]]),
    ("motion.toml", &[["turns-z", "turns"], ["sine-x", "sweep"]]),
];

fn of_inertial_unit(root: &Path, figures: &Path) -> Result<(), Box<dyn Error>> {
    for (file, names) in OF_UNIT {
        let unit = GyroscopeCalibration::load(&root.join("examples/inertial_unit").join(file))?;
        let drawn = calibration_figures(&calibrate(&unit, &Silent)?);
        for [id, name] in names {
            let figure = drawn.iter().find(|figure| figure.id == *id).ok_or("a picture is missing")?;
            fs::write(figures.join(format!("calibration_{name}.svg")), figure.to_svg())?;
        }
    }
    Ok(())
}

/// The budget of the scale factor by the stage, from the raw recordings of `examples/micro_stage` on: gaps and gains are identified, the rate
/// of the stage is estimated with them, and the gyroscope is calibrated by it.
fn budget_by_stage(root: &Path) -> Result<Figure, Box<dyn Error>> {
    let stated = published().load(&root.join("examples/micro_stage/as_published.toml"))?;
    let identified = identify(published(), &stated, &Silent)?.experiment;
    let outcome = workflow::estimate(published(), &identified, &Silent)?;
    let folder = tempfile::tempdir()?;
    let estimated = folder.path().join("micro_stage");
    let info = RunInfo { started: SystemTime::UNIX_EPOCH, took: Duration::ZERO };
    let output =
        Output::begin(&estimated, &Work::of_file("estimate", identified.path(), identified.files()))?;
    write_estimate(&outcome, &Metrics::of(&outcome), &output, WriteOptions::default(), info, &|| false)?;
    output.commit()?;
    let file = root.join("examples/gyroscope/by_stage.toml");
    let text = fs::read_to_string(&file)?.replace("../../out/micro_stage", &estimated.to_string_lossy());
    let found = calibrate(&GyroscopeCalibration::parse(&text, &file)?, &Silent)?;
    let budget = calibration_figures(&found).into_iter().find(|figure| figure.id == "budget-room-stage");
    budget.ok_or_else(|| "no budget of the scale factor by the stage".into())
}

/// A unit whose axes are some milliradians from square, in a case that is turned by some more.
fn unit() -> SimulatedUnit {
    let triad = Triad {
        x: [1.0137, 0.0041, -0.0062],
        y: [-0.0035, 0.9921, 0.0048],
        z: [0.0071, -0.0023, 1.0212],
        bias: [0.0312, -0.011, 0.004],
    };
    let gyroscopes = SimulatedInstrument {
        triad,
        noise: 1.745e-3,
        random_walk: 0.0,
        step: 1.064_225e-3,
        full_scale: 34.9,
    };
    let accelerometers =
        SimulatedInstrument { noise: 0.05, step: 4.8e-3, full_scale: 400.0, ..SimulatedInstrument::IDEAL };
    SimulatedUnit {
        clock: SampleClock { start: 3.3e-5, rate: 8000.0, skew: 3.1e-3 },
        gyroscopes,
        accelerometers: Some((
            accelerometers,
            SpecificForce { arm: [0.8e-3, -0.3e-3, 1.1e-3] },
            [0.0, 0.0, -9.81],
        )),
    }
}

/// Records about one axis after the other, with some of the others beside it.
fn three_axes(folder: &Path) -> Result<(), Box<dyn Error>> {
    let mut source = WhiteNoise::new(1, 0);
    let mut shown = String::from("record,gyro_x_rad_per_s,gyro_y_rad_per_s,gyro_z_rad_per_s");
    shown += ",force_x_m_per_s2,force_y_m_per_s2,force_z_m_per_s2\n";
    let mut known = String::from("record,time_s,x_rad_per_s,y_rad_per_s,z_rad_per_s\n");
    for (k, name) in ["x1", "y1", "z1", "x2", "y2", "z2"].iter().enumerate() {
        let main = if k < 3 { 14.0 } else { 20.0 };
        let mut amplitude = [0.1 * main; 3];
        amplitude[k % 3] = main;
        let vibration = Vibration { frequency_hz: 1700.0, amplitude, phase_rad: [0.3, 1.1, -0.9] };
        let [rates, forces] = unit().record(&vibration, 500, &mut source);
        for sample in 0..500 {
            shown += name;
            for (signals, digits) in [(&rates, 6), (&forces, 4)] {
                for values in signals.axes.iter().flatten() {
                    write!(shown, ",{:.digits$}", values[sample])?;
                }
            }
            shown.push('\n');
        }
        let times = (0..800).map(|sample| f64::from(sample) * 1e-5);
        let reference = vibration.reference(times, [true; 3], 2e-3, &mut source);
        for (sample, time) in reference.time_s.iter().enumerate() {
            write!(known, "{name},{time:.5}")?;
            for values in reference.axes.iter().flatten() {
                write!(known, ",{:.5}", values[sample])?;
            }
            known.push('\n');
        }
    }
    fs::write(folder.join("three_axes_unit.csv"), shown)?;
    fs::write(folder.join("three_axes_table.csv"), known)?;
    Ok(())
}

/// Three minutes at 100 Hz: white noise, steps of a converter, and a bias that walks.
fn at_rest(folder: &Path) -> Result<(), Box<dyn Error>> {
    let resting = Vibration { frequency_hz: 1.0, amplitude: [0.0; 3], phase_rad: [0.0; 3] };
    // The bias under vibration is 0.0312 rad/s.
    let mut gyroscopes = SimulatedInstrument { noise: 1.5e-3, random_walk: 1.2e-4, ..unit().gyroscopes };
    gyroscopes.triad.bias[1] += 39.0 * gyroscopes.step;
    let unit = SimulatedUnit {
        clock: SampleClock { rate: 100.0, ..unit().clock },
        gyroscopes,
        accelerometers: None,
    };
    let [rates, _] = unit.record(&resting, 18_000, &mut WhiteNoise::new(2, 0));
    let mut text = String::from("gyro_y_rad_per_s\n");
    for value in rates.axes[1].iter().flatten() {
        writeln!(text, "{value:.6}")?;
    }
    fs::write(folder.join("rest.csv"), text)?;
    Ok(())
}

/// The plates of the micro-stage (Chen, dissertation, 2018, Table A.1, its row 2A corrected).
fn plates() -> [(&'static str, TiltingPlate<f64>); 4] {
    let of = |w1: f64, w2: f64| TiltingPlate {
        w1,
        w2,
        w3: -0.2e-3,
        w4: 0.2e-3,
        gap: 19.2e-6,
        permittivity: 8.8542e-12,
    };
    [
        ("1A", of(-1.39e-3, -0.99e-3)),
        ("1B", of(0.475e-3, 0.795e-3)),
        ("2A", of(0.99e-3, 1.39e-3)),
        ("2B", of(-0.795e-3, -0.475e-3)),
    ]
}

fn off_axis() -> String {
    let [(_, outer), (_, inner), ..] = plates();
    // How far the small stators reach along the axis can be read in two ways.
    let narrow = TiltingPlate { w3: -0.16e-3, w4: 0.16e-3, ..inner };
    let mut table = String::from(
        "| off-axis motion | published | outer plates | inner plates, ±0.16 mm | inner plates, ±0.2 mm |\n|---|---|---|---|---|\n",
    );
    for (ratio, published) in [(0.01, 99.98), (0.1, 99.98), (0.5, 99.90)] {
        table += &format!("| {} % | {published:.2} % |", 100.0 * ratio);
        for plate in [&outer, &narrow, &inner] {
            let motion = OffAxisMotion { amplitude_rad: 3e-3, ratio, phase_rad: 0.7 };
            table += &format!(" {:.4} % |", 100.0 * motion.rejection(plate));
        }
        table.push('\n');
    }
    table
}

fn noise() -> Result<Vec<NoiseShare>, Box<dyn Error>> {
    let rate = TAU * 1714.5;
    let amplitude = |rate_of_change: f64| rate_of_change / (TAU * 1700.0);
    let study = NoiseStudy {
        channels: plates().into_iter().map(|(_, plate)| (plate, -2.407_52e7)).collect(),
        stage: TorsionalResonator { inertia: 1.0, damping: 2.0 * 0.005 * rate, stiffness: rate * rate },
        frequency_hz: 1700.0,
        training_rad: [14.6, 17.2, 20.1, 23.1].map(amplitude).to_vec(),
        test_rad: amplitude(20.0),
        rate_hz: 625e3,
        samples: 735,
        drive_variance: (3782.5_f64 * 3e-4).powi(2),
    };
    let levels = [1e-6, 3e-6, 1e-5, 3e-5, 1e-4];
    levels.iter().zip(1..).map(|(noise, seed)| Ok(study.run(*noise, 50, seed)?)).collect()
}

fn noise_table(shares: &[NoiseShare]) -> String {
    let mut table = String::from(
        "| noise of a sample | gaps alone | gains alone | both, as identified | filter |\n|---|---|---|---|---|\n",
    );
    for share in shares {
        let ppm = |part: f64| format!("{:.1} ppm", 1e6 * part);
        table += &format!(
            "| {:.0} µV | {} | {} | {} | {} |\n",
            1e6 * share.noise_v,
            ppm(share.by_gap),
            ppm(share.by_gain),
            ppm(share.by_both),
            ppm(share.by_filter)
        );
    }
    table
}

fn noise_figure(shares: &[NoiseShare]) -> Figure {
    let line = |label: &str, role: SeriesRole, of: fn(&NoiseShare) -> f64| {
        let points: Vec<(f64, f64)> = shares.iter().map(|s| (s.noise_v.powi(2), 1e6 * of(s))).collect();
        Series::line(label, role, points)
    };
    let panel = Panel::new(
        Axis::new("variance of the sensor noise", "V^2").log(),
        Axis::new("standard deviation of the scale factor", "ppm").log(),
    )
    .with(line("identified gaps, true gains", SeriesRole::Measured, |s| s.by_gap))
    .with(line("identified gains, true gaps", SeriesRole::Model, |s| s.by_gain))
    .with(line("both, as identified together", SeriesRole::Estimate, |s| s.by_both))
    .with(line("filter with the true model", SeriesRole::Bound, |s| s.by_filter));
    Figure::new("calibration-noise", "From sensor noise to the scale factor", "").with(panel)
}
