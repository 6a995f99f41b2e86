//! Sixty mistakes as of units and signs in the text of a driven resonator with two pick-offs, of which half are set aside by a seed: what is changed to have a
//! diagnosis name more of them is judged by those alone.

use super::advice::diagnosed;
use super::filters;
use crate::side_by_side::side_by_side;
use kalmems::diagnose::DiagnosisFinding;
use kalmems::simulate::WhiteNoise;
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2, TAU};
use std::fmt::Write as _;
use tempfile::TempDir;

const RESONATOR: &str = r#"
name = "resonator"
[device.equations]
states = { x = "m", v = "m/s" }
inputs = { drive = "V" }
interpolation = "linear"
derivative = { x = "v", v = "(alpha*drive - k*x - b*v)/m" }
measure = { y = "c*x in V", z = "e*v in V" }
noise = { y = "ny", z = "nz", v = "q" }
[device.equations.parameters]
m = "1e-6 kg"
k = "25 N/m"
b = "2.5e-4 N s/m"
alpha = "1e-3 N/V"
c = "2e4 V/m"
e = "5 V s/m"
ny = "1e-4 V^2"
nz = "1e-4 V^2"
q = "1e-4 m^2/s^3"
[[recording]]
role = "test"
file = "recording.csv"
clock = { column = "time_s" }
channels = { drive = "drive_V", y = "y_V", z = "z_V" }
[estimate]
skip = "5 ms"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = { x = "0 m", v = "0 m/s" }
start_sd = { x = "1e-4 m", v = "1 m/s" }
"#;

const NUMBERS: [(&str, f64, &str); 8] = [
    ("m", 1e-6, "kg"),
    ("k", 25.0, "N/m"),
    ("b", 2.5e-4, "N s/m"),
    ("alpha", 1e-3, "N/V"),
    ("c", 2e4, "V/m"),
    ("e", 5.0, "V s/m"),
    ("ny", 1e-4, "V^2"),
    ("nz", 1e-4, "V^2"),
];

/// The kinds were written down first, and then of which numbers they are: what is mistaken and by which factor.
const DEGREES: f64 = 57.295_779_513_082_32;
const FACTORS: [(&str, f64); 51] = [
    ("c", 1e-3),
    ("c", 1e3),
    ("e", 1e-3),
    ("e", 1e3),
    ("alpha", 1e-3),
    ("alpha", 1e3),
    ("c", 1e-6),
    ("c", 1e6),
    ("k", 1e-3),
    ("k", 1e3),
    ("m", 1e3),
    ("m", 1e-3),
    ("b", 1e3),
    ("b", 1e-3),
    ("k", -1.0),
    ("alpha", -1.0),
    ("e", -1.0),
    ("c", -1.0),
    ("b", -1.0),
    ("c", DEGREES),
    ("c", 1.0 / DEGREES),
    ("e", DEGREES),
    ("e", 1.0 / DEGREES),
    ("alpha", DEGREES),
    ("alpha", 1.0 / DEGREES),
    ("k", TAU * TAU),
    ("k", 1.0 / (TAU * TAU)),
    ("b", TAU),
    ("b", 1.0 / TAU),
    ("e", TAU),
    ("e", 1.0 / TAU),
    ("ny", 1e6),
    ("nz", 1e6),
    ("ny", 1e-6),
    ("nz", 1e-6),
    ("ny", 2.0),
    ("nz", 0.5),
    ("ny", 0.5),
    ("nz", 2.0),
    ("c", 10.0),
    ("e", 0.1),
    ("alpha", 10.0),
    ("k", 0.1),
    ("b", 10.0),
    ("m", 10.0),
    ("alpha", SQRT_2),
    ("alpha", FRAC_1_SQRT_2),
    ("c", SQRT_2),
    ("e", FRAC_1_SQRT_2),
    ("alpha", 9.806_65),
    ("alpha", 1.0 / 9.806_65),
];

/// Mistakes of what was recorded: what stands in the place of the channels or of the interpolation, and a word of the cause.
const OF_CHANNELS: [(&str, &str, &str); 9] = [
    ("y = \"y_V\", z = \"z_V\"", "y = \"z_V\", z = \"y_V\"", "exchanged"),
    ("y = \"y_V\"", "y = { column = \"y_V\", scale = -1 }", "y_V|parameters.c"),
    ("z = \"z_V\"", "z = { column = \"z_V\", scale = -1 }", "z_V|parameters.e"),
    (
        "drive = \"drive_V\"",
        "drive = { column = \"drive_V\", scale = -1 }",
        "drive's column|parameters.alpha",
    ),
    (
        "drive = \"drive_V\"",
        "drive = { column = \"drive_V\", scale = 1000 }",
        "drive's column|parameters.alpha",
    ),
    (
        "drive = \"drive_V\"",
        "drive = { column = \"drive_V\", scale = 0.001 }",
        "drive's column|parameters.alpha",
    ),
    ("y = \"y_V\"", "y = { column = \"y_V\", scale = 1000 }", "y_V|parameters.c"),
    ("z = \"z_V\"", "z = { column = \"z_V\", scale = 0.001 }", "z_V|parameters.e"),
    ("\"linear\"", "\"hold\"", "input between samples|time of the drive"),
];

/// A text with a mistake, what it is, and words of which one has to be in the name of the cause.
struct Mistake {
    text: String,
    what: String,
    names: Vec<String>,
}

fn mistakes() -> Vec<Mistake> {
    let of_number = |(name, factor): &(&str, f64)| {
        let (_, value, unit) = NUMBERS.iter().find(|(own, ..)| own == name).unwrap();
        let line = |value: f64| format!("\n{name} = \"{value:e} {unit}\"");
        let written = RESONATOR.lines().find(|line| line.starts_with(&format!("{name} = \""))).unwrap();
        // What drives it is scaled alike by its column.
        let of_drive = if *name == "alpha" { vec!["drive's column".to_owned()] } else { Vec::new() };
        Mistake {
            text: RESONATOR.replace(&format!("\n{written}"), &line(value * factor)),
            what: format!("{name} times {factor:.3e}"),
            names: [vec![format!("parameters.{name}")], of_drive].concat(),
        }
    };
    let of_channel = |(right, wrong, names): &(&str, &str, &str)| Mistake {
        text: RESONATOR.replace(right, wrong),
        what: (*wrong).to_owned(),
        names: names.split('|').map(str::to_owned).collect(),
    };
    FACTORS.iter().map(of_number).chain(OF_CHANNELS.iter().map(of_channel)).collect()
}

/// A recording of the true device, by steps of Runge and Kutta that are an eighth of the interval.
fn recorded(seed: u64) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (mut chance, mut state) = (WhiteNoise::new(seed, 3), [0.0_f64; 2]);
    let (interval_s, steps) = (2e-5, 8);
    let drive = |time_s: f64| 1.0 + (TAU * 500.0 * time_s).sin() + 0.7 * (TAU * 1130.0 * time_s).sin();
    let mut recording = "time_s,drive_V,y_V,z_V\n".to_owned();
    for k in 0..3000 {
        let time_s = f64::from(k) * interval_s;
        let [y, z] = [2e4 * state[0] + 1e-2 * chance.sample(), 5.0 * state[1] + 1e-2 * chance.sample()];
        writeln!(recording, "{time_s:e},{:e},{y:e},{z:e}", drive(time_s)).unwrap();
        let (from, to) = (drive(time_s), drive(time_s + interval_s));
        for step in 0..steps {
            let h = interval_s / f64::from(steps);
            let rate = |[x, v]: [f64; 2], part: f64| {
                let drive = from + (to - from) * (f64::from(step) + part) / f64::from(steps);
                [v, (1e-3 * drive - 25.0 * x - 2.5e-4 * v) / 1e-6]
            };
            let beside = |by: f64, slope: [f64; 2]| [state[0] + by * slope[0], state[1] + by * slope[1]];
            let a = rate(state, 0.0);
            let b = rate(beside(0.5 * h, a), 0.5);
            let c = rate(beside(0.5 * h, b), 0.5);
            let d = rate(beside(h, c), 1.0);
            state = std::array::from_fn(|i| state[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
        }
        state[1] += (1e-4 * interval_s).sqrt() * chance.sample();
    }
    std::fs::write(folder.path().join("recording.csv"), recording).unwrap();
    folder
}

/// Whether a diagnosis names a mistake, alone or among those that the recording cannot tell apart.
fn is_named(mistake: &Mistake, seed: u64) -> bool {
    let folder = recorded(seed);
    let found = diagnosed(&mistake.text, &folder);
    let names: Vec<&str> = found.causes.iter().map(|cause| cause.name.as_str()).collect();
    let is_named = found.finding == DiagnosisFinding::Explained
        && names.iter().any(|own| mistake.names.iter().any(|name| own.contains(name.as_str())));
    if !is_named {
        let closest: Vec<&str> = found.closest.iter().map(|cause| cause.name.as_str()).collect();
        println!("{}: {:?} {names:?}, closest {closest:?}", mistake.what, found.finding);
    }
    is_named
}

#[test]
fn the_right_resonator_passes_and_there_are_sixty_mistakes() {
    let folder = recorded(300);
    assert!(filters(RESONATOR, &folder)[0].passes());
    let all = mistakes();
    assert!(all.len() == 60 && all.iter().all(|mistake| mistake.text != RESONATOR));
}

#[test]
#[ignore = "60 diagnoses"]
fn slow_four_of_five_mistakes_that_were_set_aside_are_named() {
    let all = mistakes();
    let mut chance = WhiteNoise::new(20_261_129, 5);
    let mut order: Vec<(f64, usize)> = (0..all.len()).map(|place| (chance.sample(), place)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let places: Vec<usize> = order.into_iter().map(|(_, place)| place).collect();
    let named = side_by_side(&places, |place| is_named(&all[*place], 310 + *place as u64));
    let (seen, aside) = named.split_at(all.len() / 2);
    for (half, named) in [("seen", seen), ("set aside", aside)] {
        let count = named.iter().filter(|named| **named).count();
        let (n, part) = (named.len() as f64, count as f64 / named.len() as f64);
        // Wilson's interval of 95 %.
        let z = 1.96_f64;
        let (middle, half_width) = (
            (part + z * z / (2.0 * n)) / (1.0 + z * z / n),
            z / (1.0 + z * z / n) * (part * (1.0 - part) / n + z * z / (4.0 * n * n)).sqrt(),
        );
        println!(
            "{half}: {count} of {n} named; 95 % interval {:.0} to {:.0} %",
            100.0 * (middle - half_width),
            100.0 * (middle + half_width)
        );
        assert!(part >= 0.8, "{half}: {count} of {n}");
    }
}
