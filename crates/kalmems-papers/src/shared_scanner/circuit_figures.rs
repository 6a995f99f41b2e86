//! The frequency bands of the circuit's stages.

use super::failed;
use super::published::{s_table_i, s_table_i_circuit};
use crate::circuit::{AmplitudeDetector, Bands, Circuit, CircuitSpectrum, Excitation, HighPass, SineMotion};
use crate::program::{Check, Item, ItemHead, ItemKind, PaperPlace, PartWork, ReproduceError, ValueOrigin};
use kalmems_figures::significant;
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::circuit::{SquareLaw, Transimpedance};

/// S Figures 3 and 4: the amplification stage.
pub static AMPLIFIED: ItemHead = ItemHead {
    key: "figure-4",
    title: "lines of the amplification stage, at rest and in motion",
    kind: ItemKind::Figure,
    places: &[
        PaperPlace { paper: "S", label: "Figure 3", page: "section II-C" },
        PaperPlace { paper: "S", label: "Figure 4", page: "section II-C" },
    ],
    origin: ValueOrigin::Measured,
};

/// S Figure 5: the demodulation.
pub static DEMODULATED: ItemHead = ItemHead {
    key: "figure-5",
    title: "lines after the envelope detector and the low-pass stages",
    kind: ItemKind::Figure,
    places: &[PaperPlace { paper: "S", label: "Figure 5", page: "section II-C" }],
    origin: ValueOrigin::Measured,
};

/// S Table II.
const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
/// A drive that moves the device, with the carrier of S Table I.
const EXCITATION: Excitation = Excitation {
    offset: 90.0,
    amplitude: 90.0,
    drive_hz: 31_350.0,
    carrier: s_table_i::CARRIER_V,
    carrier_hz: s_table_i_circuit::CARRIER_HZ,
};
const MOVING_DEG: f64 = 8.0;
/// Lines this many decibels below the largest still count.
const COUNTED_DB: f64 = 40.0;

/// The circuit of S Table I. Parasitic capacitance, detector and the order of the high-pass are not printed.
fn circuit(order: usize) -> Result<Circuit, ReproduceError> {
    let high_pass = HighPass::new(order, s_table_i_circuit::HIGH_PASS_HZ)
        .ok_or_else(|| failed("S Figure 4")(format!("no high-pass of order {order}").into()))?;
    Ok(Circuit {
        transimpedance: Transimpedance {
            feedback_resistance: s_table_i_circuit::FEEDBACK_OHM,
            parasitic_capacitance: 5e-12,
        },
        amplifier_bandwidth_hz: None,
        high_pass,
        detector: AmplitudeDetector::SquareLaw(SquareLaw { linear: 1.0, square: 0.5 }),
        low_pass_hz: s_table_i_circuit::LOW_PASS_HZ,
        noise_density: 0.0,
    })
}

fn motion(degrees: f64) -> SineMotion {
    SineMotion { amplitude_rad: degrees.to_radians(), phase_rad: 0.7 }
}

/// Both items.
pub fn run(_: &PartWork) -> Result<Vec<Item>, ReproduceError> {
    let circuit_4 = circuit(4)?;
    let at_rest = Bands::of(&circuit_4, &EXCITATION, &COMB, &motion(0.0));
    let moving = Bands::of(&circuit_4, &EXCITATION, &COMB, &motion(MOVING_DEG));
    Ok(vec![amplified(&at_rest, &moving), demodulated(&moving, &circuit(1)?)])
}

/// The side bands of the carrier, the larger one, in V.
fn side_band(lines: &CircuitSpectrum) -> f64 {
    lines.amplitude(1, 1).max(lines.amplitude(1, -1))
}

fn amplified(at_rest: &Bands, moving: &Bands) -> Item {
    let [still, swings] = [&at_rest.amplified, &moving.amplified].map(side_band);
    let carrier = moving.amplified.amplitude(1, 0);
    let elsewhere = moving
        .amplified
        .lines_above(COUNTED_DB)
        .iter()
        .filter(|line| {
            !(line.carrier == 0 && line.drive.abs() <= 2 || line.carrier == 1 && line.drive.abs() <= 1)
        })
        .count();
    Item::new(&AMPLIFIED)
        .check(Check::claim(
            "side bands of the carrier appear with the motion",
            "none at rest, clear at the largest motion",
            format!("{} V at rest, {} V at {MOVING_DEG}°", significant(still), significant(swings)),
            "none at rest, and more than a thousandth of the carrier with the motion",
            still < 1e-9 * carrier && swings > 1e-3 * carrier,
        ))
        .check(Check::claim(
            "within 40 dB of the largest line there is nothing but f_dr, 2·f_dr, f_c and f_c ± f_dr",
            "these bands alone",
            format!("{elsewhere} others"),
            "no other line",
            elsewhere == 0,
        ))
        .remark(
            "The drive here has an offset, without which the device does not move; the printed pure sine has no line \
             of the motion at f_dr in V_o1. C is the Gaussian with all its harmonics, and no quadratic. S equations 28 \
             and 30 give V_1 and V_3 constant parts; they cancel, as the derivative of a bounded charge has none.",
        )
        .figure(
            Figure::new("figure-4_lines", "V_o1 at rest and in motion", "Each line is a stick from the bottom to its amplitude.")
                .with(panel("at rest", &at_rest.amplified))
                .with(panel("8° of motion", &moving.amplified)),
        )
}

fn demodulated(moving: &Bands, first_order: &Circuit) -> Item {
    let mut item = Item::new(&DEMODULATED);
    let (Some(detected), Some(output)) = (&moving.detected, &moving.output) else { return item };
    let bands = [(0, 1), (0, 2), (1, 0), (1, 1), (2, 0)].map(|(c, n)| detected.amplitude(c, n));
    item = item.check(Check::claim(
        "the detector's lines lie at DC, f_dr, 2·f_dr and around f_c and 2·f_c",
        "these bands",
        format!(
            "f_dr {}, 2·f_dr {}, f_c {} V",
            significant(bands[0]),
            significant(bands[1]),
            significant(bands[2])
        ),
        "a line at each",
        bands.iter().all(|amplitude| *amplitude > 0.0),
    ));
    let ripple = output.lines().iter().filter(|l| l.carrier > 0).map(|l| l.amplitude).fold(0.0, f64::max);
    let [first, second] = [1, 2].map(|n| output.amplitude(0, n));
    item = item.check(Check::claim(
        "y_cap is the motion at f_dr and a constant",
        "f_dr and DC",
        format!(
            "f_dr {} V, 2·f_dr {} V, of the carrier {} V",
            significant(first),
            significant(second),
            significant(ripple)
        ),
        "all else is below a tenth of it",
        second < 0.1 * first && ripple < 0.1 * first,
    ));
    let still = Bands::of(first_order, &EXCITATION, &COMB, &motion(0.0)).output;
    let drive = still.map_or(f64::NAN, |lines| lines.amplitude(0, 1));
    item.remark(format!(
        "The order of the high-pass at 482 kHz is not printed; four poles were taken. One pole would leave {} V of drive \
         beside {} V of motion in y_cap.",
        significant(drive),
        significant(first)
    ))
    .figure(
        Figure::new("figure-5_lines", "V_o3 and y_cap, 8° of motion", "Each line is a stick from the bottom to its amplitude.")
            .with(panel("V_o3", detected))
            .with(panel("y_cap", output)),
    )
}

/// Sticks on a logarithmic axis.
fn panel(name: &str, lines: &CircuitSpectrum) -> Panel {
    const LEAST_V: f64 = 1e-4;
    let x = Axis::new("frequency", "Hz").between(-2e4, 1.16e6);
    let groups = [
        (0, "n·f_dr", SeriesRole::Input),
        (1, "f_c ± n·f_dr", SeriesRole::Measured),
        (2, "2·f_c ± n·f_dr", SeriesRole::Estimate),
    ];
    let mut panel = Panel::new(x, Axis::new(name, "V").log().between(LEAST_V, 30.0)).sharing_x();
    for (carrier, label, role) in groups {
        let above = lines.lines().into_iter().filter(|l| l.carrier == carrier && l.amplitude > LEAST_V);
        for (i, line) in above.enumerate() {
            let label = if i == 0 { label } else { "" };
            let stick = [(line.frequency_hz, LEAST_V), (line.frequency_hz, line.amplitude)];
            panel = panel.with(Series::line(label, role, stick));
        }
    }
    panel
}
