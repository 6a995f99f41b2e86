//! The circuit: its lines against a Fourier transform of its simulation, against closed forms, and what is made of it.

use kalmems::circuit::{
    Adequacy, AdequacyError, AdequacySettings, AmplitudeDetector, Bands, Circuit, CircuitKnowledge,
    CircuitLine, CircuitSpectrum, Complex, Demodulation, DesignError, DriveRejection, Excitation, HighPass,
    ReducedCircuit, SineMotion, Stages, comb_harmonics, run,
};
use kalmems::config::{ConfigError, Experiment};
use kalmems::rigs::published;
use kalmems::rigs::shared_scanner::device::SharedScanner;
use kalmems::signal::{PortableComplex, fit_sine_at};
use kalmems::simulate::Drive;
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::circuit::{DiodeEnvelope, SquareLaw, SynchronousDemodulator, Transimpedance};
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use realfft::RealFftPlanner;
use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::path::Path;

/// Chen et al., shared electrodes, 2020, Table II.
const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };

/// Table I; parasitic capacitance and detector are not published.
fn circuit(order: usize) -> Circuit {
    Circuit {
        transimpedance: Transimpedance { feedback_resistance: 17.86e3, parasitic_capacitance: 5e-12 },
        amplifier_bandwidth_hz: None,
        high_pass: HighPass::new(order, 482e3).unwrap(),
        detector: AmplitudeDetector::SquareLaw(SquareLaw { linear: 1.0, square: 0.5 }),
        low_pass_hz: [40.8e3, 41.1e3],
        noise_density: 0.0,
    }
}

const DRIVE_HZ: f64 = 31_350.0;

/// A record that holds whole cycles of every line: cycles of the motion, of the carrier, and samples.
const MOTION_CYCLES: u32 = 41;
const CARRIER_CYCLES: u32 = 1308;

fn excitation(offset: f64, amplitude: f64) -> Excitation {
    let duration_s = f64::from(MOTION_CYCLES) / (0.5 * DRIVE_HZ);
    let carrier_hz = f64::from(CARRIER_CYCLES) / duration_s;
    Excitation { offset, amplitude, drive_hz: DRIVE_HZ, carrier: 6.0, carrier_hz }
}

fn motion(degrees: f64) -> SineMotion {
    SineMotion { amplitude_rad: f64::to_radians(degrees), phase_rad: 0.7 }
}

/// The transforms of the four stages over one record, as coefficients of e^{j2πft}, and the distance of two bins.
fn transforms(
    circuit: &Circuit,
    excitation: &Excitation,
    motion: &SineMotion,
    samples: u32,
) -> ([Vec<Complex<f64>>; 4], f64) {
    let duration_s = f64::from(MOTION_CYCLES) / (0.5 * DRIVE_HZ);
    let rate_hz = f64::from(samples) / duration_s;
    let mut stages: [Vec<f64>; 4] = Default::default();
    run(circuit, excitation, (&COMB, motion), rate_hz, (samples / 2, samples), |_, at: &Stages| {
        for (values, value) in stages.iter_mut().zip(at.in_order()) {
            values.push(value);
        }
    });
    let plan = RealFftPlanner::<f64>::new().plan_fft_forward(samples as usize);
    let bins = stages.map(|mut values| {
        let mut bins = plan.make_output_vec();
        plan.process(&mut values, &mut bins).unwrap();
        bins.iter().map(|bin| bin / f64::from(samples)).collect()
    });
    (bins, 1.0 / duration_s)
}

fn bin_of(line: &CircuitLine, width_hz: f64) -> usize {
    let bin = line.frequency_hz / width_hz;
    assert!((bin - bin.round()).abs() < 1e-6, "{line} lies between two bins");
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a bin of the transform
    let whole = bin.round() as usize;
    whole
}

/// The worst relative error of amplitude, and of phase in degrees, of the lines of one stage within 60 dB of the
/// largest, and how many there are. Every bin that high must be a line, and every line that high a bin.
fn compare(name: &str, lines: &CircuitSpectrum, bins: &[Complex<f64>], width_hz: f64) -> (f64, f64, usize) {
    let amplitude = |bin: usize| if bin == 0 { 1.0 } else { 2.0 } * bins[bin].portable_norm();
    let largest = (0..bins.len()).map(amplitude).fold(0.0, f64::max);
    let listed = lines.lines_above(60.5);
    let (mut worst, mut turned) = (0.0_f64, 0.0_f64);
    let mut met = 0;
    for line in &listed {
        let bin = bin_of(line, width_hz);
        let error = line.amplitude / amplitude(bin) - 1.0;
        let phase = (Complex::portable_polar(1.0, line.phase_rad) / bins[bin]).portable_arg().to_degrees();
        if amplitude(bin) >= 1e-3 * largest {
            met += 1;
            worst = worst.max(error.abs());
            turned = turned.max(phase.abs());
            println!(
                "{name:6} {:>16} {:10.3} kHz {:.6} V {error:+.1e} {phase:+.2} deg",
                line.to_string(),
                line.frequency_hz / 1e3,
                line.amplitude
            );
        }
    }
    let high = (0..bins.len()).filter(|bin| amplitude(*bin) >= 1e-3 * largest).count();
    assert_eq!(high, met, "{name}: {high} bins within 60 dB of the largest, {met} lines");
    (worst, turned, met)
}

fn assert_lines_are_those_of_the_simulation(
    circuit: &Circuit,
    excitation: &Excitation,
    degrees: f64,
) -> usize {
    let motion = motion(degrees);
    let bands = Bands::of(circuit, excitation, &COMB, &motion);
    // 50 samples per cycle of the carrier.
    let (bins, width_hz) = transforms(circuit, excitation, &motion, 65_536);
    let stages = [Some(bands.amplified), Some(bands.passed), bands.detected, bands.output];
    let mut count = 0;
    for ((name, lines), bins) in ["V_o1", "V_o2", "V_o3", "y_cap"].into_iter().zip(stages).zip(&bins) {
        let Some(lines) = lines else { continue };
        let (worst, turned, met) = compare(name, &lines, bins, width_hz);
        println!(
            "{name}: {met} lines within 60 dB, worst amplitude {worst:.2e}, worst phase {turned:.2} deg"
        );
        assert!(worst < 0.02 && turned < 1.0, "{name}: {worst} {turned}");
        count += met;
    }
    count
}

/// Offset drive, large motion, a first-order high-pass that lets the drive through: the most lines.
#[test]
fn every_line_of_the_simulated_circuit_is_predicted() {
    let count = assert_lines_are_those_of_the_simulation(&circuit(1), &excitation(90.0, 90.0), 8.0);
    assert!(count > 35, "{count}");
    let count = assert_lines_are_those_of_the_simulation(&circuit(4), &excitation(90.0, 90.0), 14.0);
    assert!(count > 25, "{count}");
}

/// The paper's pure sine, an amplifier with a pole, and the synchronous demodulator.
#[test]
fn so_are_those_of_a_synchronous_demodulator() {
    let slow = Circuit {
        amplifier_bandwidth_hz: Some(1.5e6),
        detector: AmplitudeDetector::Synchronous(SynchronousDemodulator { phase: 0.4 }),
        ..circuit(2)
    };
    assert_lines_are_those_of_the_simulation(&slow, &excitation(0.0, 30.0), 8.0);
}

/// The series of the comb against sums over its cycle.
#[test]
fn the_harmonics_of_the_comb_are_those_of_a_sum() {
    for degrees in [0.0, 0.1, 3.0, 9.0, 15.0, 30.0] {
        let amplitude = f64::to_radians(degrees);
        let ours = comb_harmonics::<8>(&COMB, amplitude);
        for (n, ours) in ours.into_iter().enumerate() {
            let points = 256;
            let sum: f64 = (0..points)
                .map(|i| TAU * f64::from(i) / f64::from(points))
                .map(|psi| COMB.capacitance(amplitude * psi.sin()) * (2.0 * n as f64 * psi).cos())
                .sum();
            let expected = if n == 0 { 1.0 } else { 2.0 } * sum / f64::from(points);
            assert!((ours - expected).abs() < 1e-13 * COMB.nominal, "{degrees} {n}: {ours:e} {expected:e}");
        }
    }
}

fn assert_close(ours: f64, expected: f64, relative: f64, what: &str) {
    assert!((ours / expected - 1.0).abs() < relative, "{what}: {ours:e}, expected {expected:e}");
}

/// The published coefficients, corrected: with a capacitance of one harmonic, no drive and a high-pass that passes all,
/// V_o1 and V_o3 have closed forms in a_s, b_s, a_o3 and b_o3; r = ω_dr/ω_c is what the paper neglects.
#[test]
fn the_corrected_formulas_of_the_appendix() {
    let high_pass = HighPass::new(1, 1.0).unwrap();
    let circuit = Circuit { high_pass, ..circuit(1) };
    let excitation = excitation(0.0, 0.0);
    let (a_s, b_s, c_p, r) = (1.1e-12, 14.3e-12, 5e-12, excitation.drive_hz / excitation.carrier_hz);
    let volts_per_farad = TAU * excitation.carrier_hz * excitation.carrier * 17.86e3;
    let (a_o3, b_o3) = (volts_per_farad, 0.5 * volts_per_farad * volts_per_farad);
    let bands = Bands::of_harmonics(&circuit, &excitation, &[b_s, a_s], 0.7);
    let detected = bands.detected.unwrap();
    let all = b_s + c_p;
    let expected_first = [
        ((1, 0), volts_per_farad * all),
        ((1, 1), 0.5 * volts_per_farad * a_s * (1.0 + r)),
        ((1, -1), 0.5 * volts_per_farad * a_s * (1.0 - r)),
    ];
    for ((m, n), expected) in expected_first {
        assert_close(bands.amplified.amplitude(m, n), expected, 1e-9, "V_o1");
    }
    let mean = b_o3 * (0.5 * all * all + 0.25 * a_s * a_s * (1.0 + r * r));
    let expected_third = [
        ((0, 0), mean),
        ((0, 1), b_o3 * a_s * all),
        ((0, 2), 0.25 * b_o3 * a_s * a_s * (1.0 - r * r)),
        ((1, 0), a_o3 * all),
        ((1, 1), 0.5 * a_o3 * a_s * (1.0 + r)),
        ((1, -1), 0.5 * a_o3 * a_s * (1.0 - r)),
        ((2, 1), 0.5 * b_o3 * a_s * all * (2.0 + 2.0 * r) / 2.0),
        ((2, -1), 0.5 * b_o3 * a_s * all * (2.0 - 2.0 * r) / 2.0),
        ((2, 2), 0.125 * b_o3 * a_s * a_s * (1.0 + r).powi(2)),
    ];
    for ((m, n), expected) in expected_third {
        assert_close(detected.amplitude(m, n), expected, 1e-4, &format!("V_o3 {m} {n}"));
    }
}

/// The lines of the drive and of the motion in y_cap, with 90 V + 90 V sin: of the motion at 8° alone, and of the drive
/// alone.
fn in_output(order: usize) -> (f64, f64) {
    let of = |excitation: &Excitation, degrees: f64| {
        Bands::of(&circuit(order), excitation, &COMB, &motion(degrees)).output.unwrap().amplitude(0, 1)
    };
    (of(&excitation(90.0, 90.0), 0.0), of(&excitation(0.0, 0.0), 8.0))
}

/// A first-order high-pass at 482 kHz leaves the drive two thirds of the motion's line; found independently as 0.264 V and
/// 0.394 V. A fourth-order one leaves 0.00008 V.
#[test]
fn one_pole_does_not_keep_the_drive_out() {
    let (drive, moving) = in_output(1);
    println!("first order: drive {drive:.4} V, motion {moving:.4} V");
    assert!((drive - 0.264).abs() < 0.003 && (moving - 0.394).abs() < 0.001);
    let (drive, moving) = in_output(4);
    println!("fourth order: drive {drive:.6} V, motion {moving:.4} V");
    assert!((drive - 0.000_08).abs() < 0.000_01 && moving > 1000.0 * drive);
}

/// Behind a high-pass that lets all pass y is affine in C behind the poles, to what the square of C leaves, 0.3 to 1.1 %;
/// a delay leaves more, and more with the amplitude.
#[test]
fn the_poles_explain_what_a_delay_does_not() {
    let circuit = Circuit { high_pass: HighPass::new(1, 100.0).unwrap(), ..circuit(1) };
    let mut last = 0.0;
    for degrees in [3.0, 6.0, 9.0, 12.0, 15.0] {
        let reduced = ReducedCircuit::of(&circuit, &excitation(0.0, 0.0), &COMB, &motion(degrees));
        println!(
            "{degrees} deg: affine {:.2} %, delay {:.3} %, poles {:.3} %, lag {:.2} deg, {:.3} us",
            reduced.affine.residual * 100.0,
            reduced.delayed.residual * 100.0,
            reduced.with_poles.residual * 100.0,
            reduced.affine.lag_deg,
            reduced.delay_s * 1e6
        );
        assert!(reduced.with_poles.residual < 0.02 && reduced.delayed.residual > last);
        assert!((reduced.affine.lag_deg - 37.4).abs() < 0.3, "{}", reduced.affine.lag_deg);
        last = reduced.delayed.residual;
    }
    assert!(last > 0.07, "{last}");
}

/// The envelope's delay in a high-pass is the slope of its phase at the carrier.
#[test]
fn the_rest_is_the_delay_of_the_high_pass() {
    for order in [2, 4, 6] {
        let circuit = circuit(order);
        let reduced = ReducedCircuit::of(&circuit, &excitation(0.0, 0.0), &COMB, &motion(5.0));
        let carrier_hz = excitation(0.0, 0.0).carrier_hz;
        let turn = (circuit.high_pass.response(carrier_hz + 10.0)
            / circuit.high_pass.response(carrier_hz - 10.0))
        .portable_arg();
        let group_delay_s = -turn / (TAU * 20.0);
        println!(
            "order {order}: {:.3} us, group delay {:.3} us",
            reduced.front_delay_s * 1e6,
            group_delay_s * 1e6
        );
        assert_close(reduced.front_delay_s, group_delay_s, 0.05, "delay");
        assert!(reduced.with_poles_and_delay.residual < 0.02, "{reduced}");
    }
}

/// A diode's output follows the amplitude of what the high-pass lets through: nearly 1 of the carrier's.
#[test]
fn a_diode_gives_the_amplitude() {
    let diode = DiodeEnvelope {
        forward_drop: 0.0,
        series_resistance: 20.0,
        load_resistance: 10e3,
        load_capacitance: 1e-9,
    };
    let ideal = Circuit {
        high_pass: HighPass::new(1, 100.0).unwrap(),
        detector: AmplitudeDetector::Diode(diode),
        low_pass_hz: [200e3, 400e3],
        ..circuit(1)
    };
    let excitation = excitation(0.0, 0.0);
    let reduced = ReducedCircuit::of(&ideal, &excitation, &COMB, &motion(8.0));
    let volts_per_farad = TAU * excitation.carrier_hz * excitation.carrier * 17.86e3;
    let ratio = reduced.with_poles_and_delay.gain / volts_per_farad;
    println!("diode: {reduced}, {ratio:.3} of the amplitude");
    assert!((0.75..1.0).contains(&ratio), "{ratio}");
}

#[test]
fn designed_filters_meet_their_demands_and_no_lower_order_does() {
    let demand =
        DriveRejection { drive_hz: 31_350.0, side_band_hz: 468_650.0, rejection_db: 80.0, loss_db: 4.0 };
    let found = demand.design().unwrap();
    let decibels = |order: usize, cutoff: f64, hz: f64| {
        -20.0 * HighPass::new(order, cutoff).unwrap().response(hz).portable_norm().log10()
    };
    for cutoff in found.cutoff_hz {
        assert!(decibels(found.order, cutoff, demand.drive_hz) >= 80.0 - 1e-6);
        assert!(decibels(found.order, cutoff, demand.side_band_hz) <= 4.0 + 1e-6);
    }
    for i in 0..2000 {
        let cutoff = 200.0 * f64::from(i + 1);
        let both = decibels(found.order - 1, cutoff, demand.drive_hz) >= 80.0
            && decibels(found.order - 1, cutoff, demand.side_band_hz) <= 4.0;
        assert!(!both, "{cutoff}");
    }
    let impossible = DriveRejection { side_band_hz: 40e3, ..demand }.design().unwrap_err();
    assert!(matches!(impossible, DesignError::HighPass { order: 8, .. }), "{impossible}");

    let demand =
        Demodulation { signal_hz: 31_350.0, ripple_hz: 1e6, ripple_db: 30.0, loss_db: 1.5, lag_deg: 25.0 };
    let [low, high] = demand.design().unwrap().pole_hz;
    let circuit = |pole: f64| Circuit { low_pass_hz: [pole; 2], ..circuit(1) };
    for pole in [low, high] {
        let [signal, ripple] =
            [demand.signal_hz, demand.ripple_hz].map(|hz| circuit(pole).low_pass_response(hz));
        assert!(-20.0 * signal.portable_norm().log10() <= 1.5 + 1e-9);
        assert!(-0.5 * signal.portable_arg().to_degrees() <= 25.0 + 1e-9);
        assert!(-20.0 * ripple.portable_norm().log10() >= 30.0 - 1e-9);
    }
    let impossible = Demodulation { lag_deg: 1.0, ..demand }.design().unwrap_err();
    assert!(matches!(impossible, DesignError::LowPass { .. }), "{impossible}");
}

const SCANNER: ParametricScanner<f64> = ParametricScanner {
    resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
    comb: COMB,
    carrier_mean_square: 18.0,
};

fn sine(frequency_hz: f64) -> Drive {
    Drive::Sine { offset: 90.0, amplitude: 90.0, frequency_hz, phase_rad: 0.0 }
}

fn asked(acceleration_density: f64) -> AdequacySettings {
    AdequacySettings {
        acceleration_density,
        noise_variance: 1.92e-4,
        carrier: 6.0,
        carrier_hz: 500e3,
        permitted_phase_deg: 0.38,
    }
}

/// The published poles are not to be left out; poles and high-pass far away are.
#[test]
fn error_of_the_affine_model_of_the_circuit() {
    let published = circuit(4);
    let quick = Circuit {
        high_pass: HighPass::new(4, 100e3).unwrap(),
        detector: AmplitudeDetector::Synchronous(SynchronousDemodulator { phase: 0.0 }),
        low_pass_hz: [20e6, 20e6],
        ..published
    };
    let of = |circuit: &Circuit, q: f64| {
        Adequacy::of(circuit, &SCANNER, (&sine(31_350.0), [0.155, 0.0]), &asked(q)).unwrap()
    };
    let [low, high] = [1e4, 1e8].map(|q| of(&published, q));
    println!("{low}\n{high}");
    assert!((low.amplitude_deg - 8.92).abs() < 0.05, "{}", low.amplitude_deg);
    assert!(!low.is_adequate(CircuitKnowledge::Affine) && !high.is_adequate(CircuitKnowledge::Affine));
    // A filter that follows its signal is as late as the signal is, one that trusts its model less.
    assert!(high.affine.phase_deg.abs() > low.affine.phase_deg.abs());
    assert!(low.to_string().contains("is not adequate"));
    // A filter that follows its signal, but for the high-pass's delay of 1.16 µs, is 6.5° late; with it, right.
    println!("{:?} {:?}", high.poles, high.poles_and_delay);
    assert!((high.poles.phase_deg - 6.5).abs() < 0.7, "{:?}", high.poles);
    assert!(high.poles_and_delay.phase_deg.abs() < 0.05 * high.poles.phase_deg, "{:?}", high.poles_and_delay);
    assert_eq!(low.needed(), Some(CircuitKnowledge::PolesAndDelay));
    assert!(low.to_string().contains("and the delay besides"), "{low}");
    // A high-pass of one pole at 5 kHz delays nothing: there the poles will do.
    let prompt = Circuit { high_pass: HighPass::new(1, 5e3).unwrap(), ..quick };
    let poles_alone = of(&Circuit { low_pass_hz: published.low_pass_hz, ..prompt }, 1e4);
    println!("{poles_alone}");
    assert_eq!(poles_alone.needed(), Some(CircuitKnowledge::Poles));
    let fine = of(&quick, 1e4);
    println!("{fine}");
    assert_eq!(fine.needed(), Some(CircuitKnowledge::Affine), "{fine}");
    assert!(fine.affine.amplitude_deg.abs() < 0.1, "{fine}");
    let still = Adequacy::of(&published, &SCANNER, (&sine(33e3), [1e-4, 0.0]), &asked(1e4));
    assert!(matches!(still, Err(AdequacyError::NoMotion { .. })));
    let constant = Drive::Constant { level: 30.0 };
    assert_eq!(
        Adequacy::of(&published, &SCANNER, (&constant, [0.1, 0.0]), &asked(1e4)),
        Err(AdequacyError::NoSine)
    );
}

fn example(replaced: &[(&str, &str)]) -> Result<Experiment, ConfigError> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner/circuit.toml");
    let mut text = std::fs::read_to_string(&path).unwrap();
    for (from, to) in replaced {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    published().parse(&text, &path)
}

/// `kalmems simulate` through the circuit: its line at f_dr is the one that the lines predict, and its motion the same as
/// without the circuit.
#[test]
fn the_example_is_simulated_through_its_circuit() {
    let quiet = example(&[("seed = 1", "seed = 1\nnoise = false")]).unwrap();
    let (time_s, signal, angle, outlook) = simulated(&quiet);
    let last = time_s.len() - 2000;
    let line = fit_sine_at(&time_s[last..], &signal[last..], DRIVE_HZ).unwrap();
    let swing = fit_sine_at(&time_s[last..], &angle[last..], 0.5 * DRIVE_HZ).unwrap();
    let motion = SineMotion { amplitude_rad: swing.amplitude, phase_rad: swing.phase_rad + 0.25 * TAU };
    let excitation =
        Excitation { offset: 90.0, amplitude: 90.0, drive_hz: DRIVE_HZ, carrier: 6.0, carrier_hz: 500e3 };
    let lines = Bands::of(&circuit(4), &excitation, &COMB, &motion).output.unwrap();
    println!("{:.4} V, predicted {:.4} V", line.amplitude, lines.amplitude(0, 1));
    assert_close(line.amplitude, lines.amplitude(0, 1), 0.01, "line");
    let turned = Complex::portable_polar(1.0, line.phase_rad) / lines.coefficient(0, 1);
    assert!(turned.portable_arg().to_degrees().abs() < 1.0, "{}", turned.portable_arg().to_degrees());
    assert_close(line.offset, lines.amplitude(0, 0), 0.01, "mean");

    // The amplifier's noise: mixed down by the carrier from both sides of it, behind both poles.
    let (_, noisy, angle_again, _) = simulated(&example(&[]).unwrap());
    assert_eq!(angle, angle_again);
    let left: Vec<f64> = noisy.iter().zip(&signal).map(|(a, b)| a - b).collect();
    let mean = left.iter().sum::<f64>() / left.len() as f64;
    let variance = left.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / left.len() as f64;
    // Its square has a mean as well: b_d times the density over the band from the cut-off to half the rate.
    assert_close(mean, 0.5 * 1e-9 * (12.5e6 - 482e3), 0.1, "mean of the squared noise");
    let passed = Bands::of(&circuit(4), &excitation, &COMB, &motion).passed.amplitude(1, 0);
    let density = |hz: f64| {
        let of = |hz: f64| circuit(4).high_pass.response(hz).norm_sqr();
        1e-9 * (0.5 * passed).powi(2)
            * (of(500e3 + hz) + of(500e3 - hz))
            * circuit(4).low_pass_response(hz).norm_sqr()
    };
    let expected: f64 = (0..480).map(|i| 1e3 * density(1e3 * (f64::from(i) + 0.5))).sum();
    println!("noise {variance:.3e} V^2, expected {expected:.3e} V^2");
    // 4000 samples of a signal correlated over 8 µs: 5 % is one standard deviation.
    assert_close(variance, expected, 0.2, "noise");

    // What the file takes the readout for is what the command says of the circuit, at the steady amplitude of 8.92°.
    println!("{outlook}");
    assert!(outlook.contains("the poles are needed as states"), "{outlook}");
    let steady = SineMotion { amplitude_rad: 8.9235_f64.to_radians(), ..motion };
    let reduced = ReducedCircuit::of(&circuit(4), &excitation, &COMB, &steady).with_poles_and_delay;
    let device = quiet.device::<SharedScanner>().unwrap();
    assert_close(device.readout.gain.si(), reduced.gain, 0.01, "gain");
    assert!((device.readout.offset.si() - reduced.offset).abs() < 0.05, "{}", reduced.offset);
}

/// Times, signal, angles and outlook of a simulation.
fn simulated(experiment: &Experiment) -> (Vec<f64>, Vec<f64>, Vec<f64>, String) {
    let simulation = published().rig(experiment).unwrap().simulate(experiment).unwrap();
    let (mut time_s, mut signal, mut angle) = (Vec::new(), Vec::new(), Vec::new());
    simulation
        .run(&mut |sample| {
            time_s.push(sample.time_s);
            signal.push(sample.recorded[1]);
            angle.push(sample.truth[0]);
            ControlFlow::Continue(())
        })
        .unwrap();
    (time_s, signal, angle, simulation.outlook().unwrap())
}

#[test]
fn what_cannot_go_through_a_circuit_is_refused() {
    let said = |replaced: &[(&str, &str)]| match example(replaced) {
        Err(error) => error.to_string(),
        Ok(experiment) => match published().rig(&experiment).unwrap().simulate(&experiment) {
            Err(error) => error.to_string(),
            Ok(_) => "accepted".to_owned(),
        },
    };
    for (replaced, expected) in [
        (
            ("\"25 MHz\"", "\"10 MHz\""),
            "integration_rate: the circuit needs 50 steps per cycle of the carrier; write at least `25 MHz`",
        ),
        (("frequency = \"500 kHz\"\n", ""), "carrier.frequency"),
        (("order = 4", "order = 9"), "order: `9` is not 1 to 8; write the poles, such as `4`"),
        (("square = \"0.5 1/V\"", "square = \"0.5 V\""), "square"),
        (("detector.square_law", "detector.square_root"), "square_root"),
    ] {
        let message = said(&[replaced]);
        println!("{message}");
        assert!(message.contains(expected), "{message}");
    }
    let square = "[simulate.drive.square]\nlow = \"0 V\"\nhigh = \"90 V\"\nfrequency = \"31.35 kHz\"\nduty_cycle = 0.5";
    let sine = "[simulate.drive.sine]\noffset = \"90 V\"\namplitude = \"90 V\"\nfrequency = \"31.35 kHz\"";
    let message = said(&[(sine, square)]);
    assert!(message.contains("the derivative of the drive"), "{message}");
}
