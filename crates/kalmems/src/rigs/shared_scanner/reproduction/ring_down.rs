//! The ring-down: decay, and the capacitance over the angle.

use super::bench::{Bench, SAMPLING_HZ};
use super::failed;
use super::published::{s_table_i, s_table_ii};
use crate::fit::{ByDual, FitSettings, Law, fit};
use crate::identify::fit_free_decay;
use crate::report::{Axis, Figure, Panel, Role, Series};
use crate::reproduce::{Check, Effort, Head, Item, Kind, Origin, Place, ReproduceError, Spread, Work};
use crate::simulate::{Drive, Simulator, WhiteNoise};
use kalmems_core::{Measurement, Over};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::readout::DemodulatedComb;
use std::f64::consts::TAU;

/// Decay and capacitance.
pub static HEAD: Head = Head {
    key: "ring-down",
    title: "ring-down, its fit, and the capacitance over the angle",
    kind: Kind::Figure,
    places: &[
        Place { paper: "S", label: "Figure 7", page: "section IV-A" },
        Place { paper: "D", label: "Figure 5.6", page: "page 96" },
        Place { paper: "D", label: "Figure 5.7", page: "page 98" },
    ],
    origin: Origin::Measured,
};

/// Where the free oscillation starts: 12° at rest.
const START: [f64; 2] = [0.2094, 0.0];
/// The optical sensor's noise here, in rad; the papers state none.
const OPTICAL_NOISE: f64 = 1e-4;
/// What is recorded of one ring-down.
struct Record {
    time_s: Vec<f64>,
    /// By the optical sensor, in rad.
    angle: Vec<f64>,
    /// The demodulated signal in V.
    signal: Vec<f64>,
}

/// What a ring-down gives.
#[derive(Clone, Copy)]
struct Found {
    /// k in N·m.
    stiffness: f64,
    /// b in N·m·s.
    damping: f64,
    /// C₀ in F, θ₀ in rad, and C_b in F, which is known only as far as the circuit's offset is.
    comb: GaussianComb<f64>,
}

/// The signal over the optical angle: [C₀, θ₀, C_b].
struct Profile<'a> {
    record: &'a Record,
    readout: DemodulatedComb<f64>,
    deviation: f64,
}

impl Law<3> for Profile<'_> {
    fn residuals<S: Over<f64>>(&self, [nominal, width, bias]: &[S; 3], each: &mut impl FnMut(S)) {
        let Self { record, readout, deviation } = self;
        for (angle, signal) in record.angle.iter().zip(&record.signal) {
            let overlap = (-(width.recip() * *angle).sq()).exp();
            let predicted = (overlap * *nominal + *bias) * readout.gain + readout.offset;
            each((predicted - *signal) * deviation.recip());
        }
    }
}

fn record(bench: &Bench, seed: u64, count: u32) -> Record {
    const STEPS: u32 = 4;
    let hardware = bench.hardware();
    let drive = Drive::Constant { level: s_table_i::BIAS_V };
    let mut simulator = Simulator::new(hardware.scanner, drive, SAMPLING_HZ * f64::from(STEPS), START);
    let (mut optical, mut readout) = (WhiteNoise::new(seed, 0), WhiteNoise::new(seed, 1));
    let mut record = Record { time_s: Vec::new(), angle: Vec::new(), signal: Vec::new() };
    for k in 0..count {
        record.time_s.push(f64::from(k) / SAMPLING_HZ);
        record.angle.push(simulator.state()[0] + OPTICAL_NOISE * optical.sample());
        let [clean] = hardware.readout.predict(simulator.state());
        record.signal.push(clean + hardware.noise_variance.sqrt() * readout.sample());
        for _ in 0..STEPS {
            simulator.step();
        }
    }
    record
}

fn find(bench: &Bench, record: &Record) -> Result<Found, ReproduceError> {
    let hardware = bench.hardware();
    let inertia = hardware.scanner.resonator.inertia;
    // The damped sine that the papers fit, to the motion's tail, where it is nearly one.
    let tail = record.time_s.len() / 2;
    let sine = fit_free_decay(&record.time_s[tail..], &record.angle[tail..])
        .map_err(|e| failed("the decay's damped sine")(e.into()))?;
    let natural = TAU * sine.natural_frequency_hz().value;
    let profile = Profile { record, readout: hardware.readout, deviation: hardware.noise_variance.sqrt() };
    let start = FitSettings::from_start([5e-12, 0.25, 1e-11]);
    let [nominal, angular_width, bias] =
        fit(&ByDual(profile), &start).map_err(|e| failed("the capacitance's profile")(e.into()))?.parameters;
    Ok(Found {
        stiffness: inertia * natural * natural,
        damping: 2.0 * inertia * sine.decay_rate().value,
        comb: GaussianComb { nominal, angular_width, bias },
    })
}

/// Records ring-downs and fits them.
pub fn run(work: &Work) -> Result<Vec<Item>, ReproduceError> {
    let bench = Bench::new()?;
    let (runs, samples) = match work.effort {
        Effort::Quick => (3, 8_000),
        Effort::Full => (12, 20_000),
    };
    let first_seed = work.seed;
    let found = work.map("ring-downs", (runs, u64::from(samples)), |index, _| {
        Some(find(&bench, &record(&bench, first_seed + index as u64, samples)))
    })?;
    let found: Vec<Found> = found.into_iter().collect::<Result<_, _>>()?;
    Ok(vec![item(&bench, &record(&bench, work.seed, samples), &found)])
}

fn item(bench: &Bench, record: &Record, found: &[Found]) -> Item {
    let over = |value: &dyn Fn(&Found) -> f64| Spread::of(found.iter().map(value));
    let k = bench.scanner().resonator.stiffness;
    let excess = over(&|f| f.stiffness / k).median - 1.0;
    let stiffness = over(&|f| 1e4 * f.stiffness);
    let damping = over(&|f| 1e12 * f.damping);
    let nominal = over(&|f| 1e12 * f.comb.nominal);
    Item::new(&HEAD)
        .check(Check::value("k of a damped sine", "1e-4 N m", s_table_ii::STIFFNESS, stiffness, 5e-3))
        .check(Check::value("b of a damped sine", "1e-12 N m s", s_table_ii::DAMPING, damping, 5e-3))
        .check(Check::value("C₀ of the profile", "pF", s_table_ii::NOMINAL_PF, nominal, 5e-3))
        .check(Check::value(
            "θ₀ of the profile",
            "rad",
            s_table_ii::ANGULAR_WIDTH,
            over(&|f| f.comb.angular_width),
            5e-3,
        ))
        .remark(format!(
            "The ring-down is that of the simulated device of S Table II under the bias of 23.76 V, so that this checks \
             the method: fits as the papers describe them give back what was put in. The bias pulls the mirror back; a \
             damped sine, which knows nothing of that, finds a stiffness {excess:.1e} of itself too large, of no weight \
             beside the printed three digits. The papers integrate the current V_o1; here the demodulated signal \
             is set against the optical angle, which has {:.1} mrad of noise (the papers state none).",
            OPTICAL_NOISE * 1e3
        ))
        .figure(decay(bench, record, found))
        .figure(capacitance(bench, record, found))
}

fn decay(bench: &Bench, record: &Record, found: &[Found]) -> Figure {
    let degrees = record.time_s.iter().zip(&record.angle).map(|(t, a)| (*t, a.to_degrees()));
    let mut envelope = Panel::new(Axis::new("time", "s"), Axis::new("angle", "deg")).with(Series::line(
        "optical sensor",
        Role::Measured,
        degrees,
    ));
    if let Some(first) = found.first() {
        let rate = 0.5 * first.damping / bench.scanner().resonator.inertia;
        for (label, sign) in [("fitted decay", 1.0), ("", -1.0)] {
            let line: Vec<(f64, f64)> = record
                .time_s
                .iter()
                .map(|t| (*t, (sign * START[0] * (-rate * t).exp()).to_degrees()))
                .collect();
            envelope = envelope.with(Series::line(label, Role::Model, line));
        }
    }
    Figure::new(
        "ring-down_decay",
        "Ring-down",
        "The free oscillation under the bias, and the decay that the fit's damping gives (S Figure 7a, D Figure 5.6).",
    )
    .with(envelope)
}

fn capacitance(bench: &Bench, record: &Record, found: &[Found]) -> Figure {
    let hardware = bench.hardware();
    let stride = (record.angle.len() / 600).max(1);
    let seen: Vec<(f64, f64)> = record
        .angle
        .iter()
        .zip(&record.signal)
        .step_by(stride)
        .map(|(angle, volts)| {
            let farad = (volts - hardware.readout.offset) / hardware.readout.gain;
            (angle.to_degrees(), farad)
        })
        .collect();
    let grid = || (-120..=120).map(|i| 0.2 * f64::from(i));
    let mut panel = Panel::new(Axis::new("angle", "deg"), Axis::new("capacitance", "F"))
        .with(Series::points("from the signal", Role::Measured, seen));
    if let Some(Found { comb, .. }) = found.first() {
        let gaussian: Vec<(f64, f64)> = grid().map(|a| (a, comb.capacitance(a.to_radians()))).collect();
        let quadratic: Vec<(f64, f64)> = grid()
            .filter(|a| a.abs() <= 12.0)
            .map(|a| (a, comb.capacitance(0.0) + 0.5 * comb.curvature_at_rest() * a.to_radians().powi(2)))
            .collect();
        panel = panel
            .with(Series::line("Gaussian (S equation 13)", Role::Model, gaussian))
            .with(Series::line("quadratic (S equation 15)", Role::Bound, quadratic));
    }
    Figure::new(
        "ring-down_capacitance",
        "Capacitance over the angle",
        "The signal turned into capacitance against the optical angle, and the fitted profile (S Figure 7b, D Figure \
         5.7). The quadratic that the papers' circuit analysis uses leaves it beyond a few degrees.",
    )
    .with(panel)
}
