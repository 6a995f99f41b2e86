//! Tables I and II: what the instrument is, and what follows from it.

use super::bench::{AccelerometerBench, INTERVAL_S};
use super::published::{device, noise};
use crate::program::{
    Check, CheckTolerance, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, SeedSpread,
    ValueOrigin,
};
use kalmems_core::{Covariance, HeldEtdrk4, Measurement, NoiseDensity, Observability, Process};
use kalmems_figures::significant;
use kalmems_figures::{ColumnHead, TextTable};
use kalmems_models::constants::STANDARD_GRAVITY;

/// The instrument.
pub static TABLE_I: ItemHead = ItemHead {
    key: "table-i",
    title: "the instrument, and what follows from it",
    kind: ItemKind::Table,
    places: &[
        PaperPlace { paper: "Z", label: "Table I", page: "page 18" },
        PaperPlace { paper: "Z", label: "Equation 5-4", page: "page 53" },
        PaperPlace { paper: "Z", label: "Equation 5-5", page: "page 53" },
    ],
    origin: ValueOrigin::Computed,
};

/// The noise.
pub static TABLE_II: ItemHead = ItemHead {
    key: "table-ii",
    title: "the noise of the filter's model",
    kind: ItemKind::Table,
    places: &[PaperPlace { paper: "Z", label: "Table II", page: "page 52" }],
    origin: ValueOrigin::Computed,
};

/// Computes both.
pub fn run(_: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let filled = [AccelerometerBench::new(4.0)?, AccelerometerBench::new(1.0)?];
    Ok(vec![table_i(&filled), table_ii(&filled[0])])
}

fn table_i(benches: &[AccelerometerBench; 2]) -> Item {
    let [four, _] = benches;
    let mass = &four.closed.device.mass;
    let [slow, fast] = mass.eigenvalues(mass.spring);
    let exact = SeedSpread::exact;
    let damping_ratio = mass.damping_ratio(mass.spring);
    let mut table = TextTable::new(
        "What follows from Table I, by the permittivity in the gap",
        [
            ColumnHead::text("quantity"),
            ColumnHead::number("ε_r = 4 (Table I)", ""),
            ColumnHead::number("ε_r = 1 (air)", ""),
        ],
    );
    let mut row = |name: &str, of: &dyn Fn(&AccelerometerBench) -> f64| {
        table.push([name.to_owned(), significant(of(&benches[0])), significant(of(&benches[1]))]);
    };
    row("spring that the carrier takes, N/m", &|bench| bench.open().closed.device.electrostatic_spring(0.0));
    row("spring that carrier and bias take, N/m", &|bench| bench.closed.device.electrostatic_spring(0.0));
    row("readout, V/m", &|bench| bench.closed.readout.sensitivity());
    row("bias for 10 g at v_F = V_B/2, V", &|bench| bench.closed.device.bias);
    row("static pull-in of the open loop, g", &|bench| pull_in_g(bench));
    row("displacement at 1 g, open loop, nm", &|bench| 1e9 * at_one_g(&bench.open()));
    row("displacement at 1 g, closed loop, nm", &|bench| 1e9 * at_one_g(bench));
    let film = 2.0 * 1.78e-5 * 0.42 * 1.2e-3_f64.powi(3) * 1.55e-3;
    Item::new(&TABLE_I)
        .check(Check::value("slower eigenvalue", "rad/s", device::EIGENVALUES[0], exact(slow.0), CheckTolerance::digit(10.0)))
        .check(Check::value("faster eigenvalue", "rad/s", device::EIGENVALUES[1], exact(fast.0), CheckTolerance::digit(10.0)))
        .check(Check::value("rank of the observation matrix", "", 2.0, exact(rank(four)), CheckTolerance::COUNT))
        .check(Check::claim(
            "the device is under-damped",
            "\"we will consider the under-damped situation\" (page 13)",
            format!("damping ratio {damping_ratio:.2}: over-damped, as Figure 8 shows"),
            "a damping ratio below 1",
            damping_ratio < 1.0,
        ))
        .check(Check::claim(
            "equation 2-13 gives Table I's damping of 7e-4 kg/s",
            "b = 2·µ·E·W³·L/d₀²",
            format!(
                "{:.1e} with d₀² (in kg·m/s), {:.2} kg/s with d₀³, as the units want it",
                film / 2.3e-6_f64.powi(2),
                film / 2.3e-6_f64.powi(3)
            ),
            "within 10 %",
            (film / 2.3e-6_f64.powi(3) / 7e-4 - 1.0).abs() < 0.1,
        ))
        .check(Check::claim(
            "the open loop holds less than 5 g",
            format!("unstable at {} g (Table III)", device::PULL_IN_G),
            format!("pulled in from {:.1} g (ε_r 4) or {:.0} g (ε_r 1) on", pull_in_g(four), pull_in_g(&benches[1])),
            "pull-in below the printed acceleration",
            pull_in_g(four) < device::PULL_IN_G,
        ))
        .remark(
            "A gap of air has a relative permittivity of 1; with Table I's 4 everything electrostatic is four times as \
             strong. Both are kept. The damping is Table I's, as a measured value.",
        )
        .table(table)
}

/// Of the two states, sampled.
fn rank(bench: &AccelerometerBench) -> f64 {
    let device = bench.closed.device;
    let process = HeldEtdrk4::new(device, INTERVAL_S, &NoiseDensity::none(), (&[0.0; 2], &[0.0; 2]));
    let (_, transition) = process.linearize(&[0.0; 2], &[0.0; 2]);
    let (_, observation) = bench.closed.readout.linearize(&[0.0; 2]);
    let mut seen = Observability::new([1e-10, 1e-6]);
    for _ in 0..2 {
        seen.observe(&observation, &Covariance::from_variances([bench.hardware().noise_variance]));
        seen.advance(&transition);
    }
    f64::from(u8::try_from(seen.rank(1e-12)).unwrap_or(u8::MAX))
}

fn pull_in_g(bench: &AccelerometerBench) -> f64 {
    let held = bench.open().closed.device.static_pull_in(0.0);
    held.map_or(f64::NAN, |held| held.acceleration / STANDARD_GRAVITY)
}

/// How far 1 g moves the mass, slowly, in m.
fn at_one_g(bench: &AccelerometerBench) -> f64 {
    bench.closed.displacement(1e2).size() * STANDARD_GRAVITY
}

fn table_ii(bench: &AccelerometerBench) -> Item {
    let mass = &bench.closed.device.mass;
    let weight = mass.mass * STANDARD_GRAVITY;
    let brownian = (2.0 * bench.hardware().force_density).sqrt() / weight;
    let per_g = weight / mass.spring * bench.closed.readout.sensitivity();
    let (stated_q, stated_r) = (noise::Q.sqrt() / weight, noise::R.sqrt() / per_g);
    Item::new(&TABLE_II)
        .check(Check::value(
            "Brownian noise that is simulated, against 4·k_B·T·b",
            "µg/√Hz",
            1e6 * device::BROWNIAN_G,
            SeedSpread::exact(1e6 * brownian),
            CheckTolerance::digit(100.0),
        ))
        .check(Check::value(
            "the same, against √Q of Table II",
            "µg/√Hz",
            1e6 * device::BROWNIAN_G,
            SeedSpread::exact(1e6 * stated_q),
            CheckTolerance::digit(100.0),
        ))
        .check(Check::value(
            "electronic noise that is simulated, against √R of Table II",
            "g",
            device::ELECTRONIC_G,
            SeedSpread::exact(stated_r),
            CheckTolerance::digit(0.01),
        ))
        .check(Check::claim(
            "the Brownian noise lies between 10 and 100 µg/√Hz",
            "section 3.1.1",
            format!("{:.1} µg/√Hz at 300 K", 1e6 * brownian),
            "between them",
            brownian > 10e-6 && brownian < 100e-6,
        ))
        .remark(format!(
            "Table II's Q and R carry the units of amplitudes, N and V. As the square of a force and of a voltage they are \
             {:.0} µg and {:.3} g (at the {:.2} mV/g of a device whose plates do not pull): the second is the 0.02 g that the \
             thesis states, the first is a third of its 500 µg. Here Q is the density of a force, two-sided, and R the \
             variance of a sample.",
            1e6 * stated_q,
            stated_r,
            1e3 * per_g
        ))
}
