//! Makes the pictures and tables of the book and the README again.
//!
//!     cargo run --release --example figures

use kalmems::figures::{Axis, Figure, Panel, Series, SeriesRole};
use kalmems::progress::Silent;
use kalmems::results::{
    Metrics, Output, RunInfo, Work, WriteOptions, outlook_figures, summary_table, write_estimate,
};
use kalmems::rigs::published;
use kalmems::workflow;
use kalmems_core::{Covariance, Euler, Nodes, NoiseDensity, Process, Rk4};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;
use std::time::{Duration, SystemTime};

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folder = root.join("book/src/figures");
    std::fs::create_dir_all(&folder)?;

    let (figure, table) = integrator_growth();
    std::fs::write(folder.join("integrator_growth.svg"), figure.to_svg())?;
    std::fs::write(folder.join("integrator_growth.md"), table)?;

    for (file, figures) in
        [("experiment", &["motion", "angle_error"][..]), ("stiffness_state", &["phase_error"])]
    {
        let experiment = published().load(&root.join(format!("examples/shared_scanner/{file}.toml")))?;
        let outcome = workflow::estimate(published(), &experiment, &Silent)?;
        let metrics = Metrics::of(&outcome);
        let staged = tempfile::tempdir()?;
        let results = staged.path().join("results");
        let info = RunInfo { started: SystemTime::UNIX_EPOCH, took: Duration::ZERO };
        let output =
            Output::begin(&results, &Work::of_file("estimate", experiment.path(), experiment.files()))?;
        write_estimate(&outcome, &metrics, &output, WriteOptions::default(), info, &|| false)?;
        output.commit()?;
        for name in figures {
            let to = folder.join(format!("shared_scanner_{name}.svg"));
            std::fs::copy(results.join(format!("figures/{name}.svg")), to)?;
        }
        if file == "stiffness_state" {
            let table = summary_table(&metrics, false).to_text();
            std::fs::write(folder.join("shared_scanner_estimators.txt"), table)?;
        }
    }

    let experiment = published().load(&root.join("examples/shared_scanner/simulation.toml"))?;
    for figure in outlook_figures(&published().rig(&experiment)?.outlook(&experiment)?) {
        std::fs::write(folder.join(format!("shared_scanner_{}.svg", figure.id)), figure.to_svg())?;
    }
    println!("written to {}", folder.display());
    Ok(())
}

/// The device of Chen et al. 2020, Table II.
const RESONATOR: TorsionalResonator<f64> =
    TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 };

/// The rate at which a free oscillation of 2 ms grows (above 0) or decays, with three integrators over the
/// sampling rate.
fn integrator_growth() -> (Figure, String) {
    let comb = GaussianComb { nominal: 0.0, angular_width: 0.2, bias: 0.0 };
    let free = ParametricScanner { resonator: RESONATOR, comb, carrier_mean_square: 0.0 };
    let physics = -RESONATOR.damping / (2.0 * RESONATOR.inertia);
    let mut points = [Vec::new(), Vec::new(), Vec::new()];
    let mut table = String::from(
        "| sampling rate | explicit Euler | RK4 | exact | physics |\n|---:|---:|---:|---:|---:|\n",
    );
    for (rate_hz, shown) in [
        (500e3, true),
        (700e3, false),
        (1e6, true),
        (2e6, false),
        (4e6, false),
        (7e6, false),
        (10e6, true),
        (14e6, false),
        (18.5e6, true),
        (25e6, false),
        (40e6, true),
    ] {
        let h = 1.0 / rate_hz;
        let euler = Euler::new(free, h, Covariance::zero());
        let rk4 = Rk4::new(free, h, &NoiseDensity::none(), (&[0.0; 2], &0.0));
        let exact = RESONATOR.exact(h, 0.0);
        let rates = [
            growth(|x| euler.step(x, &0.0), h),
            growth(|x| rk4.step(x, &Nodes::held(0.0)), h),
            growth(|x| exact.step(x, &[0.0]), h),
        ];
        for (points, rate) in points.iter_mut().zip(rates) {
            points.push((rate_hz, rate));
        }
        if shown {
            let [euler, rk4, exact] = rates;
            let _ = writeln!(
                table,
                "| {} MHz | {euler:+.0} /s | {rk4:+.0} /s | {exact:+.0} /s | {physics:+.0} /s |",
                rate_hz / 1e6
            );
        }
    }
    let caption = "The rate at which a free oscillation grows, above 0, or decays.";
    let [euler, rk4, exact] = points;
    let panel = Panel::new(Axis::new("sampling rate", "Hz").log(), Axis::new("growth rate", "1/s"))
        .with(Series::line(
            "physics: −b/2J",
            SeriesRole::Reference,
            exact.iter().map(|(x, _)| (*x, physics)).collect::<Vec<_>>(),
        ))
        .with(Series::line("explicit Euler", SeriesRole::Model, euler))
        .with(Series::points("RK4", SeriesRole::Estimate, rk4))
        .with(Series::line("exact", SeriesRole::Estimate, exact));
    (Figure::new("integrator_growth", "A free oscillation, integrated", caption).with(panel), table)
}

fn growth(step: impl Fn(&[f64; 2]) -> [f64; 2], h: f64) -> f64 {
    let mut x = [0.15, 0.0];
    let start = RESONATOR.energy(x[0], x[1]);
    let mut time = 0.0;
    while time < 2e-3 {
        x = step(&x);
        time += h;
    }
    (RESONATOR.energy(x[0], x[1]) / start).ln() / 2.0 / time
}
