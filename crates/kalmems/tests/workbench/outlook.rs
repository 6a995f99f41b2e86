//! What is said of the scanner before a recording, and the pictures of it.

use kalmems::figures::Shape;
use kalmems::outlook::Outlook;
use kalmems::results::outlook_figures;
use kalmems::rigs::published;
use std::path::Path;
use std::sync::OnceLock;

const FILE: &str = "examples/shared_scanner/simulation.toml";

fn outlook_of(change: impl Fn(&str) -> String) -> Outlook {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let toml = change(&std::fs::read_to_string(root.join(FILE)).unwrap());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("experiment.toml");
    std::fs::write(&path, toml).unwrap();
    let experiment = published().load(&path).unwrap();
    published().rig(&experiment).unwrap().outlook(&experiment).unwrap()
}

/// That of the file as it is.
fn example() -> &'static Outlook {
    static EXAMPLE: OnceLock<Outlook> = OnceLock::new();
    EXAMPLE.get_or_init(|| outlook_of(str::to_owned))
}

fn values(outlook: &Outlook, name: &str) -> Vec<f64> {
    outlook.fact(name).unwrap_or_else(|| panic!("nothing is said of {name}")).values.clone()
}

fn near(found: f64, expected: f64, by: f64) {
    assert!((found - expected).abs() <= by, "{found}, expected {expected}");
}

/// The published 0 to 60 V: 4.5 times too shallow; b below about 1.3e-12 would do.
#[test]
fn a_device_that_cannot_oscillate_is_reported_with_the_missing_voltage() {
    let outlook = outlook_of(|toml| toml.replace("\"90 V\"", "\"30 V\""));
    println!("{}", outlook.to_text());
    assert!(
        outlook
            .to_text()
            .contains("cannot oscillate at this drive: the pump depth is 4.5 times below threshold")
    );
    near(values(&outlook, "pump_depth_over_threshold")[0], 1.0 / 4.5, 0.003);
    let needed = values(&outlook, "needed_factor_volts_hz_damping");
    near(needed[3], 5.95e-12 / 4.5, 0.02e-12);
    // The depth goes with the square of the voltage, but for the resonance that it raises.
    near(needed[0], values(&outlook, "pump_depth_over_threshold")[0].powf(-0.5), 0.01);
    assert!(values(&outlook, "growth_rate_per_s")[0] < 0.0);
    assert!(outlook.response.is_none() && outlook.start.is_some());
    // The numbers of the map agree: nothing grows at factor 1, something does at 1.05 times what is needed.
    let map = &outlook.start.as_ref().unwrap().map;
    let best = |factor: f64| {
        let row = map.factor.partition_point(|f| *f <= factor) - 1;
        map.growth_rate[row].iter().copied().fold(f64::NEG_INFINITY, f64::max)
    };
    assert!(best(1.0) < 0.0 && best(0.97 * needed[0]) < 0.0 && best(1.05 * needed[0]) > 0.0);
}

/// 90 V + 90 V sin at 31.35 kHz: what an independent simulation found, and what the device is.
#[test]
fn a_device_that_oscillates_is_described() {
    let outlook = example();
    println!("{}", outlook.to_text());
    near(
        values(outlook, "mechanical_resonance_hz")[0],
        (1.10e-4_f64 / 1.15e-14).sqrt() / std::f64::consts::TAU,
        1e-6,
    );
    let quality = values(outlook, "quality_and_decay_s");
    near(quality[0], (1.10e-4_f64 * 1.15e-14).sqrt() / 5.95e-12, 1e-9);
    near(values(outlook, "steady_deg_at_hz")[0], 8.9, 0.05);
    near(values(outlook, "steady_deg_at_hz")[1], 31_350.0, 1e-6);
    let [time, amplitude] = values(outlook, "start_up_s_and_deg")[..] else { panic!() };
    near(amplitude, 8.9, 0.05);
    assert!((0.02..0.06).contains(&time), "{time}");
    let sweeps = &outlook.response.as_ref().unwrap().sweeps;
    let down = |hz: f64| {
        let nearest =
            sweeps.down.iter().min_by(|a, b| (a.drive_hz - hz).abs().total_cmp(&(b.drive_hz - hz).abs()));
        nearest.unwrap().amplitude.to_degrees()
    };
    // Points lie up to 4 Hz beside, and the amplitude changes by up to 0.045 deg per Hz.
    for (hz, degrees) in [(31_220.0, 14.2), (31_350.0, 8.9), (31_480.0, 3.7)] {
        near(down(hz), degrees, 0.2);
    }
    // Sweeping down holds on from below the tongue to the end of the motion.
    let [low, high] = values(outlook, "hysteresis_hz")[..] else { panic!() };
    assert!((31_195.0..31_220.0).contains(&low) && (31_220.0..31_245.0).contains(&high), "{low} {high}");
    assert!(outlook.to_text().contains("The sign of the motion is not observable"));
    // A drive beside the tongue is told by how much it misses.
    let beside = outlook_of(|toml| toml.replace("31.35 kHz", "31.7 kHz").replace("5.95e-12", "1e-11"));
    let growth = &beside.fact("growth_rate_per_s").unwrap();
    assert!(
        growth.values[0] < 0.0 && growth.text.contains("above the frequencies that start"),
        "{}",
        growth.text
    );
}

/// A square wave far below the resonance, whose 9th harmonic pumps: four and a half cycles of the motion in each of its
/// periods. It grows as Meissner's equation has it (two stiffnesses in turn, solved exactly), and starts in the time that
/// follows.
#[test]
fn a_high_harmonic_that_pumps_is_followed() {
    let (inertia, damping) = (1.15e-14, 5.95e-12);
    let decay = 0.5 * damping / inertia;
    // C₀/θ₀² is what a V² adds.
    let rates = [0.0_f64, 480.0].map(|volts| {
        let stiffness = 1.10e-4 + 5.71e-12 / 0.2_f64.powi(2) * (volts.powi(2) + 18.0);
        (stiffness / inertia - decay * decay).sqrt()
    });
    let growth_at = |drive_hz: f64| {
        let [(s, c), (s2, c2)] = rates.map(|rate| (0.5 * rate / drive_hz).sin_cos());
        let trace = 2.0 * c * c2 - (rates[0] / rates[1] + rates[1] / rates[0]) * s * s2;
        (0.5 * trace.abs()).max(1.0).acosh() * drive_hz - decay
    };
    let best_hz = 2.0 * rates[0].midpoint(rates[1]) / std::f64::consts::TAU / 9.0;
    let drive_hz = (-100..=100)
        .map(|i| best_hz * (1.0 + 1e-4 * f64::from(i)))
        .max_by(|a, b| growth_at(*a).total_cmp(&growth_at(*b)))
        .unwrap();
    let outlook = outlook_of(|toml| {
        let (before, rest) = toml.split_once("[simulate.drive.sine]").unwrap();
        let (_, after) = rest.split_once("\n\n").unwrap();
        let levels = "low = \"0 V\"\nhigh = \"480 V\"\nduty_cycle = \"50 %\"";
        format!("{before}[simulate.drive.square]\n{levels}\nfrequency = \"{drive_hz} Hz\"\n\n{after}")
    });
    println!("{}", outlook.to_text());
    let growth = values(&outlook, "growth_rate_per_s")[0];
    near(growth, growth_at(drive_hz), 0.01 * growth);
    let [time_s, amplitude_deg] = values(&outlook, "start_up_s_and_deg")[..] else {
        panic!("a time and an angle")
    };
    near(time_s, (amplitude_deg.to_radians() / 1e-6).ln() / growth, 0.1 * time_s);
}

#[test]
fn without_a_drive_the_device_alone_is_described() {
    let outlook = outlook_of(|toml| {
        let (device, rest) = toml.split_once("[simulate]").unwrap();
        let (_, estimate) = rest.split_once("# For `kalmems estimate`").unwrap();
        let recording = "[[recording]]\nrole = \"test\"\nfile = \"a.csv\"\nclock = { rate = \"2 MHz\" }\n\
                         channels = { drive = \"drive_V\", signal = \"cap_V\" }\n#";
        format!("{device}{recording}{estimate}")
    });
    assert!(outlook.fact("drive").unwrap().text.contains("[simulate]"));
    assert!(outlook.response.is_none() && outlook.start.is_none());
    // Twice the samples, √2 less.
    near(values(&outlook, "basis")[0], 2e6, 0.0);
    let at_9 = outlook.information.iter().find(|i| (i.amplitude.to_degrees() - 9.0).abs() < 1e-9).unwrap();
    near(at_9.phase_sd.to_degrees(), 0.037 / 2.0_f64.sqrt(), 0.0004);
}

/// Every figure has its data, and can be drawn.
#[test]
fn the_pictures_show_the_data() {
    let outlook = example();
    let figures = outlook_figures(outlook);
    let ids: Vec<&str> = figures.iter().map(|figure| figure.id.as_str()).collect();
    assert_eq!(ids, ["response", "stability", "information"]);
    let map = figures[1].panels[0].series.iter().find_map(|series| match series.shape() {
        Shape::Map(grid) => Some(grid),
        _ => None,
    });
    assert_eq!(map.unwrap().values, outlook.start.as_ref().unwrap().map.growth_rate);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("outlook");
    std::fs::create_dir_all(&folder).unwrap();
    for figure in &figures {
        let svg = figure.to_svg();
        assert!(roxmltree::Document::parse(&svg).is_ok() && !svg.contains("no data"), "{}", figure.id);
        std::fs::write(folder.join(format!("{}.svg", figure.id)), svg).unwrap();
    }
    assert!(figures[1].to_svg().contains("data-level=\"0e0\""));
}
