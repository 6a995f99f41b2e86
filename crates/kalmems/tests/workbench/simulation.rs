//! Simulation of the shared-electrode scanner: against a finer integration, against two theories of when it
//! oscillates, and against the amplitudes that were found independently.

use kalmems::simulate::{
    Drive, Simulator, Stability, SweepPoint, SweepSettings, floquet_exponent, start_up, stepped_sweep,
};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};

/// Chen et al., shared electrodes, 2020, Table II.
const SCANNER: ParametricScanner<f64> = ParametricScanner {
    resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
    comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
    carrier_mean_square: 18.0,
};

fn sine(volts: f64, frequency_hz: f64) -> Drive {
    Drive::Sine { offset: volts, amplitude: volts, frequency_hz, phase_rad: 0.0 }
}

/// From rest at 8.9° as from a motion in full swing, the whole state is compared.
#[test]
fn a_microsecond_is_short_enough() {
    let start = [0.144, 5800.0];
    let mut coarse = Simulator::new(SCANNER, sine(90.0, 31_350.0), 1e6, start);
    let mut fine = Simulator::new(SCANNER, sine(90.0, 31_350.0), 1e8, start);
    let mut worst = 0.0_f64;
    for _ in 0..4000 {
        coarse.step();
        for _ in 0..100 {
            fine.step();
        }
        assert!((coarse.time_s() - fine.time_s()).abs() < 1e-15);
        worst = worst.max((coarse.state()[0] - fine.state()[0]).abs());
    }
    println!("RK4 at 1 MHz against 100 MHz over 4 ms: {:.5} deg", worst.to_degrees());
    assert!(worst.to_degrees() < 0.01);
    // A tenth of the rate is not: the comparison sees errors.
    let mut hasty = Simulator::new(SCANNER, sine(90.0, 31_350.0), 1e5, start);
    for _ in 0..400 {
        hasty.step();
    }
    assert!((hasty.state()[0] - fine.state()[0]).abs().to_degrees() > 0.1);
}

/// A square wave whose jumps lie anywhere between the steps loses no order: 4 times the steps, 256 times closer.
#[test]
fn jumps_of_the_drive_are_met() {
    let drive = Drive::Square { low: 0.0, high: 120.0, frequency_hz: 31_347.0, duty: 0.37 };
    let end = |rate_hz: f64, steps: usize| {
        let mut simulator = Simulator::new(SCANNER, drive.clone(), rate_hz, [0.1, 0.0]);
        for _ in 0..steps {
            simulator.step();
        }
        simulator.state()[0]
    };
    let exact = end(32e6, 32_000);
    let (coarse, fine) = ((end(5e5, 500) - exact).abs(), (end(2e6, 2000) - exact).abs());
    println!("{coarse:e} {fine:e}");
    assert!(coarse / fine > 100.0, "{coarse:e} {fine:e}");
}

/// The largest growth rate over drive frequencies near twice the resonance, by integration over one period.
fn best_growth(scanner: ParametricScanner<f64>, volts: f64) -> f64 {
    let resonance = Stability::of(&scanner, &sine(volts, 31e3)).unwrap().resonance_hz;
    (-8..=8)
        .map(|i| 2.0 * resonance * (1.0 + 5e-5 * f64::from(i)))
        .map(|f| floquet_exponent(scanner, &sine(volts, f), 64).unwrap())
        .fold(f64::NEG_INFINITY, f64::max)
}

/// With the published device and its 0 to 60 V the pump is 4.5 times too shallow.
#[test]
fn the_published_tables_do_not_oscillate() {
    let stability = Stability::of(&SCANNER, &sine(30.0, 31_150.0)).unwrap();
    let factor = stability.threshold() / stability.pump_depth;
    assert!((factor - 4.5).abs() < 0.05, "{factor}");
    assert!(stability.tongue_hz().is_none());
    assert_eq!(
        stability.to_string(),
        "cannot oscillate at this drive: the pump depth is 4.5 times below threshold"
    );
    assert!(best_growth(SCANNER, 30.0) < 0.0);
    assert!(start_up(SCANNER, &sine(30.0, 2.0 * stability.resonance_hz), 1e-3, 1e6, 0.02).is_none());

    // The factor itself, by integration: with the damping that many times smaller it is at its threshold.
    let damped = |times: f64| {
        let resonator =
            TorsionalResonator { damping: SCANNER.resonator.damping / times, ..SCANNER.resonator };
        best_growth(ParametricScanner { resonator, ..SCANNER }, 30.0)
    };
    let (mut below, mut above) = (1.0, 20.0);
    while above - below > 1e-3 {
        let middle = 0.5 * (below + above);
        if damped(middle) < 0.0 { below = middle } else { above = middle }
    }
    println!("factor {factor:.4} from Mathieu's equation, {below:.4} from Floquet's exponents");
    assert!((factor / below - 1.0).abs() < 0.005, "{factor} {below}");
    // With b = 1e-12 N m s it oscillates.
    assert!(damped(5.95) > 0.0);
}

/// Growth rates over the whole tongue and beside it: the theory to first order in the depth against integration.
#[test]
fn mathieu_and_floquet_agree_over_the_tongue() {
    let drive = |f| sine(90.0, f);
    let stability = Stability::of(&SCANNER, &drive(31_350.0)).unwrap();
    let [low, high] = stability.tongue_hz().unwrap();
    println!("tongue {low:.1} to {high:.1} Hz");
    for i in 0..=20 {
        let f = 31_150.0 + 22.5 * f64::from(i);
        let exact = floquet_exponent(SCANNER, &drive(f), 64).unwrap();
        // The next order is the depth, 2 %, of the largest rate, 500/s: 10/s; at an edge the root is steep, so that
        // frequencies are compared there.
        let near_edge = [low, high].iter().any(|edge| (f - edge).abs() < 12.0);
        let ours = stability.growth_rate(f);
        assert!(near_edge || (ours - exact).abs() < 10.0, "{f}: {ours} {exact}");
    }
    for (edge, inwards) in [(low, 1.0), (high, -1.0)] {
        assert!(floquet_exponent(SCANNER, &drive(edge + 4.0 * inwards), 64).unwrap() > 0.0);
        assert!(floquet_exponent(SCANNER, &drive(edge - 4.0 * inwards), 64).unwrap() < 0.0);
    }
    // A small motion grows as fast as that.
    let f = 2.0 * stability.resonance_hz;
    let mut simulator = Simulator::new(SCANNER, drive(f), 64.0 * f, [1e-9, 0.0]);
    let mut largest_by = |periods: usize| {
        let mut largest = 0.0_f64;
        for step in 0..periods * 64 {
            simulator.step();
            if step >= (periods - 4) * 64 {
                largest = largest.max(simulator.state()[0].abs());
            }
        }
        largest
    };
    let (early, late) = (largest_by(400), largest_by(300));
    let grown = (late / early).ln() * f / 300.0;
    let exact = floquet_exponent(SCANNER, &drive(f), 64).unwrap();
    assert!((grown / exact - 1.0).abs() < 0.01, "{grown} {exact}");
}

/// A drive at the resonance itself pumps with its second harmonic; one without an offset at twice the resonance
/// does not pump at all.
#[test]
fn which_part_of_the_drive_pumps() {
    let no_offset = |f| Drive::Sine { offset: 0.0, amplitude: 160.0, frequency_hz: f, phase_rad: 0.0 };
    let at_twice = Stability::of(&SCANNER, &no_offset(31_400.0)).unwrap();
    assert_eq!((at_twice.harmonic, at_twice.pump_depth), (1, 0.0));
    assert!(at_twice.to_string().contains("no component near twice the resonance"), "{at_twice}");
    assert!(floquet_exponent(SCANNER, &no_offset(2.0 * at_twice.resonance_hz), 128).unwrap() < 0.0);
    let at_once = Stability::of(&SCANNER, &no_offset(15_700.0)).unwrap();
    assert_eq!(at_once.harmonic, 2);
    let [low, high] = at_once.tongue_hz().unwrap();
    for (f, starts) in [(at_once.resonance_hz, true), (low - 10.0, false), (high + 10.0, false)] {
        let exponent = floquet_exponent(SCANNER, &no_offset(f), 128).unwrap();
        assert_eq!(exponent > 0.0, starts, "{f}: {exponent}");
    }
    // A square wave: component by Fourier, threshold by integration.
    let square = |f| Drive::Square { low: 0.0, high: 90.0, frequency_hz: f, duty: 0.5 };
    let stability = Stability::of(&SCANNER, &square(31_200.0)).unwrap();
    let f = 2.0 * stability.resonance_hz;
    let exact = floquet_exponent(SCANNER, &square(f), 64).unwrap();
    assert!((stability.growth_rate(f) - exact).abs() < 5.0, "{} {exact}", stability.growth_rate(f));
}

fn amplitude_at(points: &[SweepPoint], drive_hz: f64) -> f64 {
    points.iter().find(|p| (p.drive_hz - drive_hz).abs() < 1.0).unwrap().amplitude.to_degrees()
}

/// Sweeps of 90 V + 90 V sin: amplitudes, and where they end, as an independent simulation had them.
#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_the_amplitude_depends_on_where_the_sweep_came_from() {
    let settings = SweepSettings {
        offset: 90.0,
        amplitude: 90.0,
        periods: 3000,
        steps_per_period: 48,
        disturbance: 1e-6,
    };
    let grid = |i: i32| 31_100.0 + 10.0 * f64::from(i);
    let down = stepped_sweep(SCANNER, (0..=50).rev().map(grid), &settings);
    let up = stepped_sweep(SCANNER, (0..=50).map(grid), &settings);
    for f in [31_480.0, 31_350.0, 31_220.0] {
        println!("{f}: down {:.2}, up {:.2} deg", amplitude_at(&down, f), amplitude_at(&up, f));
    }
    // To the digits given; near the end of the branch the amplitude changes by 0.02 deg per Hz.
    for (drive_hz, degrees) in [(31_220.0, 14.2), (31_350.0, 8.9), (31_480.0, 3.7)] {
        assert!((amplitude_at(&down, drive_hz) - degrees).abs() < 0.1, "{drive_hz}");
    }
    // Within the tongue there is one steady motion, whichever way it is come by; below it, sweeping down holds on to
    // one that sweeping up does not find.
    for f in [31_280.0, 31_350.0, 31_420.0, 31_480.0] {
        assert!((amplitude_at(&up, f) - amplitude_at(&down, f)).abs() < 0.01, "{f}");
    }
    let [low, high] = Stability::of(&SCANNER, &sine(90.0, 31_350.0)).unwrap().tongue_hz().unwrap();
    for point in up.iter().filter(|p| p.drive_hz < low) {
        assert!(point.amplitude < 1e-4, "{point:?}");
    }
    assert!(amplitude_at(&down, 31_210.0) > 13.0 && low > 31_230.0);
    assert!(amplitude_at(&down, 31_190.0) < 0.01);
    for point in up.iter().chain(&down).filter(|p| p.drive_hz > high + 15.0) {
        assert!(point.amplitude < 1e-4, "{point:?}");
    }
}

/// From a thousandth of its final amplitude the motion takes as long as its growth rate says.
#[test]
fn the_start_of_the_oscillation_takes_the_time_of_its_growth_rate() {
    let drive = sine(90.0, 31_350.0);
    let begun = |displacement: f64| start_up(SCANNER, &drive, displacement, 2e6, 0.12).unwrap();
    let (near, far) = (begun(1e-4), begun(1e-6));
    assert!((near.amplitude.to_degrees() - 8.9).abs() < 0.05, "{near:?}");
    let rate = floquet_exponent(SCANNER, &drive, 64).unwrap();
    let longer = far.time_s - near.time_s;
    println!("start-up {:.2} ms from 1e-6 rad, {:.2} ms from 1e-4", 1e3 * far.time_s, 1e3 * near.time_s);
    // A factor of 100 in displacement, to within a cycle of the motion.
    assert!((longer - 100_f64.ln() / rate).abs() < 2.0 / 31_350.0, "{longer} {}", 100_f64.ln() / rate);
}
