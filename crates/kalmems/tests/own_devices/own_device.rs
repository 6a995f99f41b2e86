//! A device of one's own: curves from files, several channels, identification, and what is refused.

use crate::parts::same_bits_in_a_stream;
use kalmems::config::Experiment;
use kalmems::diagnose::likeliest;
use kalmems::identify::Identification;
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use kalmems::workflow::{Outcome, estimate_computed};
use std::fmt::Write as _;
use std::path::Path;

/// A mirror whose capacitance is read through two amplifiers, of which one is slow, and that two electrodes drive.
const MIRROR: &str = r#"
name = "mirror"
[device.equations.states]
theta = "rad"
omega = "rad/s"
[device.equations.inputs]
left = "V"
right = "V"
[device.equations.parameters]
J = "1e-13 kg m^2"
k = "4e-6 N m"
b = "4e-11 N m s"
slope = "2 pF/rad"
gain = "0.5 V/pF"
[device.equations.let]
C = "slope*theta"
[device.equations.derivative]
theta = "omega"
omega = "(0.5*slope*(left^2 - right^2) - b*omega - k*theta)/J"
[device.equations.lag]
slow = { of = "gain*C in V", time = "20[us]" }
[device.equations.measure]
fast = "gain*C in V"
filtered = "slow in V"
[device.equations.noise]
fast = "1e-6[V^2]"
filtered = "1e-8[V^2]"
[estimate]
skip = "2 ms"
[[estimate.filter]]
name = "both"
method = "ekf"
start = { theta = "0 rad", omega = "0 rad/s" }
start_sd = { theta = "0.01 rad", omega = "50 rad/s" }
[[estimate.filter]]
name = "fast alone"
method = "ekf"
channels = ["fast"]
start = { theta = "0 rad", omega = "0 rad/s" }
start_sd = { theta = "0.01 rad", omega = "50 rad/s" }
"#;

const RECORDING: &str = r#"
[[recording]]
role = "test"
file = "recording.csv"
clock = { column = "time_s" }
channels = { left = "left_V", right = "right_V", fast = "fast_V", filtered = "filtered_V" }
[recording.reference]
file = "reference.csv"
channels = { theta = "theta_rad" }
"#;

fn parse(text: &str, folder: &Path) -> Result<Experiment, String> {
    published().parse(text, &folder.join("experiment.toml")).map_err(|error| error.to_string())
}

/// Splitmix64: numbers that do not depend on each other, summed to normal ones.
fn noise(seed: &mut u64) -> f64 {
    let mut uniform = || {
        *seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (*seed ^ (*seed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

/// The mirror by another integrator: steps of 0.1 us by the exact solution of the oscillator under a held force, and of the pole.
fn record(folder: &Path, rows: usize, missing: std::ops::Range<usize>) {
    let (j, k, b, slope, gain): (f64, f64, f64, f64, f64) = (1e-13, 4e-6, 4e-11, 2e-12, 0.5e12);
    let (interval, parts) = (2e-6, 20);
    let h: f64 = interval / f64::from(parts);
    let decay: f64 = b / (2.0 * j);
    let rate = (k / j - decay * decay).sqrt();
    let (sine, cosine) = (rate * h).sin_cos();
    let shrink = (-decay * h).exp();
    let left = |t: f64| 20.0 + 3.0 * (6.3e3 * t).sin();
    let right = |t: f64| 18.0 + 2.0 * (5.1e3 * t).cos();
    let (mut theta, mut omega, mut slow, mut seed) = (0.0_f64, 0.0_f64, 0.0_f64, 7_u64);
    let mut recording = "time_s,left_V,right_V,fast_V,filtered_V\n".to_owned();
    let mut reference = "time_s,theta_rad\n".to_owned();
    for row in 0..rows {
        let t = row as f64 * interval;
        let fast = gain * slope * theta + 1e-3 * noise(&mut seed);
        let filtered = slow + 1e-4 * noise(&mut seed);
        // The slow channel comes with every fifth sample, and the first input is missing for a while.
        let filtered = if row % 5 == 0 { format!("{filtered:.9}") } else { String::new() };
        let left_text = if missing.contains(&row) { String::new() } else { format!("{:.9}", left(t)) };
        writeln!(recording, "{t:.7},{left_text},{:.9},{fast:.9},{filtered}", right(t)).unwrap();
        writeln!(reference, "{t:.7},{theta:.12e}").unwrap();
        for part in 0..parts {
            let middle = t + (f64::from(part) + 0.5) * h;
            let force = 0.5 * slope * (left(middle).powi(2) - right(middle).powi(2));
            let rest = force / k;
            let before = theta;
            let (x, v) = (theta - rest, omega);
            theta = rest + shrink * (x * cosine + (v + decay * x) / rate * sine);
            omega = shrink * (v * cosine - (decay * v + k / j * x) / rate * sine);
            let seen = gain * slope * 0.5 * (before + theta);
            slow = seen + (slow - seen) * (-h / 20e-6_f64).exp();
        }
    }
    std::fs::write(folder.join("recording.csv"), recording).unwrap();
    std::fs::write(folder.join("reference.csv"), reference).unwrap();
}

fn estimated(experiment: &Experiment) -> Outcome {
    kalmems::workflow::estimate(published(), experiment, &Silent).unwrap()
}

/// Root mean square error, and the share within three standard deviations, of a state by each filter.
fn errors(outcome: &Outcome, state: &str) -> Vec<(f64, f64)> {
    let values = &outcome.recordings[0].segments[0].values;
    values.iter().map(|errors| (errors[state].rmse, errors[state].within_three_sigma.unwrap())).collect()
}

#[test]
fn two_inputs_and_two_channels_of_which_one_is_slow_are_taken_together() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), 8000, 3000..3040);
    let experiment = parse(&format!("{MIRROR}{RECORDING}"), folder.path()).unwrap();
    let outcome = estimated(&experiment);
    let [(both, within), (alone, _)] = errors(&outcome, "theta")[..] else { panic!("two filters") };
    // What is missing of an input is its sine, so that nothing of it is seen.
    assert!(within > 0.99, "{within}");
    // The slow channel has a hundredth of the variance at a fifth of the samples: twenty times the information.
    assert!(both < 0.5 * alone, "{both:e} {alone:e}");
    let trajectory = &outcome.recordings[0].segments[0].estimate.trajectories[0];
    assert_eq!(trajectory.counts.drive_from_sine, 40);
    assert_eq!(trajectory.further.len(), 1);
    assert!((0.9..1.1).contains(&trajectory.consistency(trajectory.scored(2e-3)).unwrap().mean_nis));
}

#[test]
fn a_curve_from_a_file_stands_for_the_law_that_it_was_computed_from() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), 4000, 0..0);
    let law = MIRROR.replace("C = \"slope*theta\"", "C = \"slope*theta*(1 + (theta/0.02[rad])^2)\"");
    let curve = MIRROR.replace("C = \"slope*theta\"", "C = \"C_of(theta)\"").replace(
        "[estimate]\n",
        "[device.equations.tables]\nC_of = { file = \"curves/C.csv\", x = \"angle_mrad\", y = \"C_fF\" }\n[estimate]\n",
    );
    std::fs::create_dir(folder.path().join("curves")).unwrap();
    let mut table = "angle_mrad,C_fF\n".to_owned();
    for k in -200..=200 {
        let theta = f64::from(k) * 1e-4;
        let farads = 2e-12 * theta * (1.0 + (theta / 0.02).powi(2));
        writeln!(table, "{},{}", theta * 1e3, farads * 1e15).unwrap();
    }
    std::fs::write(folder.path().join("curves/C.csv"), table).unwrap();
    let of = |text: &str| estimated(&parse(&format!("{text}{RECORDING}"), folder.path()).unwrap());
    let (law, from_file) = (of(&law), of(&curve));
    let means = |outcome: &Outcome| {
        outcome.recordings[0].segments[0].estimate.trajectories[0].state("theta").unwrap().mean.clone()
    };
    let (law, from_file) = (means(&law), means(&from_file));
    let largest = law.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let apart = law.iter().zip(&from_file).map(|(a, b)| (a - b).abs()).fold(0.0_f64, f64::max);
    // A cubic is reproduced by the spline; what is left is the rounding of the file.
    assert!(apart < 1e-9 * largest, "{apart:e} of {largest:e}");
    // Files that the device names move with the experiment.
    let experiment = parse(&format!("{curve}{RECORDING}"), folder.path()).unwrap();
    let moved = experiment.with_files(&|file| Path::new("..").join(file)).to_toml().unwrap();
    assert!(moved.contains("file = \"../curves/C.csv\""), "{moved}");
}

/// A sensitivity that depends on the bias of an electrode, as a law and as a table of two variables in a file, whose rows are in no order.
#[test]
fn a_surface_from_a_file_stands_for_the_law_that_it_was_computed_from() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), 3000, 0..0);
    let law = MIRROR.replace("C = \"slope*theta\"", "C = \"slope*theta*(1 + (left/60[V])^3)\"");
    let surface = MIRROR.replace("C = \"slope*theta\"", "C = \"C_of(theta, left)\"").replace(
        "[estimate]\n",
        "[device.equations.tables]\nC_of = { file = \"C.csv\", x = \"angle_mrad\", y = \"bias_V\", z = \"C_fF\" }\n[estimate]\n",
    );
    let mut points = Vec::new();
    for (row, column) in (0..9).flat_map(|row| (0..9).map(move |column| (row, column))) {
        let (theta, left) = (0.01 * f64::from(row - 4), 4.0 * f64::from(column) - 4.0);
        points.push(format!("{},{left},{}\n", theta * 1e3, 2e3 * theta * (1.0 + (left / 60.0).powi(3))));
    }
    let all = points.len();
    let shuffled: String = (0..all).map(|k| points[k * 23 % all].as_str()).collect();
    std::fs::write(folder.path().join("C.csv"), format!("angle_mrad,bias_V,C_fF\n{shuffled}")).unwrap();
    let of = |text: &str| estimated(&parse(&format!("{text}{RECORDING}"), folder.path()).unwrap());
    let means = |text: &str| {
        let outcome = of(text);
        outcome.recordings[0].segments[0].estimate.trajectories[0].state("theta").unwrap().mean.clone()
    };
    let (law, from_file) = (means(&law), means(&surface));
    let largest = law.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let apart = law.iter().zip(&from_file).map(|(a, b)| (a - b).abs()).fold(0.0_f64, f64::max);
    assert!(apart < 1e-9 * largest, "{apart:e} of {largest:e}");

    points.truncate(all - 1);
    std::fs::write(folder.path().join("C.csv"), format!("angle_mrad,bias_V,C_fF\n{}", points.concat()))
        .unwrap();
    let why = parse(&format!("{surface}{RECORDING}"), folder.path()).and_then(|experiment| {
        let rig = published().rig(&experiment).unwrap();
        rig.wanted(&experiment).map(|_| ()).map_err(|why| why.to_string())
    });
    assert!(why.as_ref().unwrap_err().contains("there is no value at 0.04 and 28"), "{why:?}");
}

/// What no reference can know is said before anything is read: the recording here is none.
#[test]
fn a_reference_of_a_parameter_is_refused_before_the_recording_is_read() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("recording.csv"), "nothing\n").unwrap();
    std::fs::write(folder.path().join("reference.csv"), "time_s,k_N_per_m\n0,1\n").unwrap();
    let recording = RECORDING.replace("theta = \"theta_rad\"", "k = \"k_N_per_m\"");
    let experiment = parse(&format!("{MIRROR}{recording}"), folder.path()).unwrap();
    let why = kalmems::workflow::estimate(published(), &experiment, &Silent).unwrap_err().to_string();
    assert!(
        why.contains("`k` is not a channel of this reference; known are `theta`, `omega` and `slow`"),
        "{why}"
    );
}

/// The comb resonator of the example, simulated with a seed, told with parameters that are wrong.
fn with_wrong_numbers(seed: u64, further_noise: &str) -> (Experiment, ComputedRecording) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/comb_resonator/simulation.toml");
    let text = std::fs::read_to_string(&file).unwrap().replace("seed = 1", &format!("seed = {seed}"));
    let text = text.replace("signal = \"1e-6[V^2]\"", &format!("signal = \"1e-6[V^2]\"\n{further_noise}"));
    let experiment = published().parse(&text, &file).unwrap();
    let rig = published().rig(&experiment).unwrap();
    let simulation = rig.simulate(&experiment).unwrap();
    let simulated = ComputedRecording::of(simulation.as_ref(), &Silent).unwrap();
    (described(&experiment, simulation.as_ref()), simulated)
}

/// What is sought, what is told of it, and what is true.
const SOUGHT: [(&str, &str, &str, f64); 3] = [
    ("k", "4.7374 N/m", "4.80 N/m", 4.7374),
    ("b", "3.0159e-7 N s/m", "3.6e-7 N s/m", 3.0159e-7),
    ("force", "2.96e-9 N/V^2", "2.7e-9 N/V^2", 2.96e-9),
];

/// What is identified of `parameters` from a recording of this seed, of an experiment with these changes of its text.
fn identified(seed: u64, changes: &[(&str, &str, &str)], parameters: &str) -> Identification {
    // The filter's process noise acts on the device as well: a filter with more than its device claims larger errors than it makes.
    let (told, simulated) = with_wrong_numbers(seed, NOISE_OF_RATE);
    identified_from((&told, &simulated, usize::MAX), changes, parameters)
}

const NOISE_OF_RATE: &str = "v = \"1e-7[m^2/s^3]\"";

/// The same of no more than so many rows.
fn identified_from(
    (told, simulated, rows): (&Experiment, &ComputedRecording, usize),
    changes: &[(&str, &str, &str)],
    parameters: &str,
) -> Identification {
    let folder = tempfile::tempdir().unwrap();
    let layout = published().rig(told).unwrap().layout(told, 0).unwrap();
    let recording: SampledRecording = simulated.recorded(&layout).unwrap();
    let segment = &recording.segments()[0];
    let mut csv = "time_s,drive_V,signal_V\n".to_owned();
    let column = |name: &str| recording.column(name).unwrap().of(segment).to_vec();
    let (drive, signal) = (column("drive_V"), column("signal_V"));
    for k in 0..drive.len().min(rows) {
        writeln!(csv, "{},{},{}", segment.time.at(k), drive[k], signal[k]).unwrap();
    }
    std::fs::write(folder.path().join("recording.csv"), csv).unwrap();
    let mut text = told.to_toml().unwrap();
    for (name, right, wrong) in changes {
        text = text.replace(&format!("{name} = \"{right}\""), &format!("{name} = \"{wrong}\""));
    }
    text += &format!("\n[identify]\nparameters = [{parameters}]\n");
    let experiment = parse(&text, folder.path()).unwrap();
    likeliest(published(), &experiment, &Silent).unwrap()
}

/// How many standard errors each of the sought numbers is off.
fn off(seed: u64) -> [f64; 3] {
    let wrong = SOUGHT.map(|(name, right, wrong, _)| (name, right, wrong));
    let found = identified(seed, &wrong, "\"k\", \"b\", \"force\"");
    assert!(found.undetermined.is_empty() && found.warnings.is_empty(), "{found:?}");
    // What was found stands in the experiment, and the estimate with it passes.
    let device = found.experiment.to_toml().unwrap();
    assert!(!device.contains("4.80 N/m"), "{device}");
    std::array::from_fn(|i| {
        let of = &found.parameters[i];
        (of.value - SOUGHT[i].3) / of.standard_error
    })
}

#[test]
fn parameters_with_wrong_stated_values_are_identified_from_one_recording() {
    for off in off(11) {
        assert!(off.abs() < 4.0, "{off}");
    }
}

/// Told to 1e-9 and wrong by 20 %: the recording cannot speak against it. Told to 10 %: it does, and the prior adds nothing to a recording that
/// knows the number to a ten-thousandth.
#[test]
fn what_is_stated_of_a_number_is_its_prior_distribution() {
    let with = |value: &str, uncertainty: &str| {
        let told = format!("{value} N s/m{uncertainty}");
        let found = identified(12, &[("b", "3.0159e-7 N s/m", &told)], "\"b\"");
        let says = found.notes.iter().any(|note| note.contains("enters as its prior distribution"));
        assert_eq!(says, !uncertainty.is_empty(), "{:?}", found.notes);
        found.parameters[0].clone()
    };
    let (alone, vague) = (with("3.6e-7", ""), with("3.6e-7", " ± 10 %"));
    assert!((alone.value - 3.0159e-7).abs() < 4.0 * alone.standard_error, "{alone:?}");
    assert!((vague.value - alone.value).abs() < 0.01 * alone.standard_error, "{alone:?} {vague:?}");
    // What is known far better than a recording tells stays where it is; where the innovations contradict it, it has no interval.
    let (right, wrong) = (with("3.0159e-7", " ± 1e-7 %"), with("3.6e-7", " ± 1e-7 %"));
    assert!(
        (right.value / 3.0159e-7 - 1.0).abs() < 1e-6 && right.standard_error < 1e-8 * 3.0e-7,
        "{right:?}"
    );
    assert!((wrong.value / 3.6e-7 - 1.0).abs() < 1e-6 && wrong.standard_error.is_infinite(), "{wrong:?}");
}

/// An amplifier that inverts, told as one that does not, is found with its sign.
#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_a_sensitivity_with_the_wrong_sign_is_found_with_the_right_one() {
    let inverted = [("sensitivity", "0.2 V/um", "-0.21 V/um")];
    let found = identified(14, &inverted, "\"sensitivity\"");
    let sensitivity = &found.parameters[0];
    assert!((sensitivity.value - 0.2e6).abs() < 4.0 * sensitivity.standard_error, "{sensitivity:?}");
    assert!(found.undetermined.is_empty(), "{:?}", found.undetermined);
}

/// A readout of a volt, of which a short recording tells little.
const MUCH_NOISE: (&str, &str) = ("signal = \"1e-6[V^2]\"", "signal = \"1[V^2]\"");

/// What a short recording does not determine, the one that is proposed determines as well as it says: the printed table is simulated and
/// identified from.
#[test]
fn a_proposed_recording_determines_a_parameter_as_well_as_it_says() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/comb_resonator/simulation.toml");
    let text = std::fs::read_to_string(&file)
        .unwrap()
        .replace(MUCH_NOISE.0, &format!("{}\n{NOISE_OF_RATE}", MUCH_NOISE.1));
    let recorded = |text: &str| {
        let experiment = published().parse(text, &file).unwrap();
        let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
        let simulated = ComputedRecording::of(simulation.as_ref(), &Silent).unwrap();
        (described(&experiment, simulation.as_ref()), simulated)
    };
    let (told, simulated) = recorded(&text);
    let wrong = [("b", "3.0159e-7 N s/m", "3.6e-7 N s/m")];
    let short = identified_from((&told, &simulated, 5_200), &wrong, "\"b\", \"k\"");
    println!("{:?}\n{:?}\n{}", short.parameters, short.undetermined, short.notes.join("\n"));
    assert!(short.undetermined.iter().any(|one| one.what == "parameters.b"), "{:?}", short.undetermined);
    let note = short.notes.iter().find(|note| note.contains("another recording would determine")).unwrap();
    let promised = note.split_once("parameters.b` to ").unwrap().1.split_once(" %").unwrap().0;
    let promised: f64 = promised.parse::<f64>().unwrap() / 100.0;
    let (_, simulate) = note.split_once("\n\n").unwrap();
    let mut document: toml::Table = text.parse().unwrap();
    document.extend(simulate.parse::<toml::Table>().unwrap());
    let (told, simulated) = recorded(&toml::to_string(&document).unwrap());
    let found = identified_from((&told, &simulated, usize::MAX), &wrong, "\"b\", \"k\"");
    let (b, claimed) = (&found.parameters[0], found.parameters[0].standard_error / 3.0159e-7);
    assert!((0.7..1.4).contains(&(claimed / promised)), "{claimed} for {promised}");
    assert!((b.value / 3.0159e-7 - 1.0).abs() < 4.0 * promised, "{b:?}");
}

/// 40 seeds that nothing was chosen by: of 120 intervals of 95 % at least 106 hold the truth (a probability of 0.3 % of fewer if
/// they are right), and the errors are as large as they claim.
#[test]
#[ignore = "2 minutes in a release build"]
fn slow_identified_parameters_have_the_standard_errors_that_they_claim() {
    let all: Vec<f64> = (1000..1040).flat_map(off).collect();
    let covered = all.iter().filter(|off| off.abs() < 1.96).count();
    let square = all.iter().map(|off| off * off).sum::<f64>() / all.len() as f64;
    println!(
        "{covered} of {} intervals hold the truth; mean square of error over standard error {square:.2}",
        all.len()
    );
    assert!(covered >= 106, "{covered}");
    // chi-square of 120 degrees, two-sided at 1e-3, correlated in threes at most: of 40.
    assert!((0.45..1.9).contains(&square), "{square}");
}

#[test]
fn a_key_that_an_own_device_lacks_is_reported_with_what_to_write() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), 2000, 0..0);
    let text = format!("{MIRROR}{RECORDING}");
    let cases = [
        ("unknown state in start", text.replace("start = { theta = \"0 rad\"", "start = { phi = \"0 rad\"")),
        (
            "no start_sd of a state",
            text.replace("start_sd = { theta = \"0.01 rad\", omega", "start_sd = { omega"),
        ),
        ("no noise of a measurement", text.replace("fast = \"1e-6[V^2]\"\n", "")),
        ("unknown channel", text.replace("channels = [\"fast\"]", "channels = [\"quick\"]")),
        ("a lock-in", text.replacen("method = \"ekf\"", "method = \"lock_in\"", 1)),
        (
            "no measurement in the recording",
            text.replace("fast = \"fast_V\", filtered = \"filtered_V\"", "left = \"left_V\"").replacen(
                "left = \"left_V\", ",
                "",
                1,
            ),
        ),
        (
            "a drive for two inputs",
            format!(
                "{MIRROR}[simulate]\nduration = \"1 ms\"\nsampling_rate = \"1 MHz\"\nintegration_rate = \"1 MHz\"\nstart = {{}}\n[simulate.drive.constant]\nvoltage = \"1 V\"\n"
            ),
        ),
        ("nothing to identify", format!("{text}[identify]\n")),
        ("an unknown parameter to identify", format!("{text}[identify]\nparameters = [\"q\"]\n")),
    ];
    let mut told = String::new();
    for (what, text) in cases {
        let said = parse(&text, folder.path()).and_then(|experiment| {
            let rig = published().rig(&experiment).map_err(|error| error.to_string())?;
            if what.contains("identify") {
                let named =
                    experiment.identify.as_ref().is_some_and(|identify| !identify.parameters.is_empty());
                let found = if named {
                    likeliest(published(), &experiment, &Silent)
                } else {
                    rig.identify(&experiment, &Silent)
                };
                return found.map(|_| ()).map_err(|error| error.to_string());
            }
            if experiment.recordings.is_empty() {
                return rig.simulate(&experiment).map(|_| ()).map_err(|error| error.to_string());
            }
            kalmems::workflow::estimate(published(), &experiment, &Silent)
                .map(|_| ())
                .map_err(|error| error.to_string())
        });
        let said = said.expect_err(what).replace(&folder.path().display().to_string(), "");
        writeln!(told, "{what}:\n{said}\n").unwrap();
    }
    insta::assert_snapshot!(told);
}

#[test]
fn an_unwritten_simulation_is_estimated_as_a_recording() {
    let (experiment, simulated) = with_wrong_numbers(3, "");
    let outcome = estimate_computed(published(), &experiment, &simulated, &Silent).unwrap();
    for (_, within) in errors(&outcome, "x") {
        assert!(within > 0.99, "{within}");
    }
}

#[test]
fn samples_that_arrive_are_estimated_to_the_last_bit_as_those_of_a_recording() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/comb_resonator/experiment.toml");
    let text = std::fs::read_to_string(&file).unwrap().replace("smooth = true\n", "")
        + "\n[stream]\nrate = \"400 kHz\"\n[stream.input.text]\ncolumns = [\"time_s\", \"drive_V\", \"signal_V\"]\n";
    let experiment = published().parse(&text, &file).unwrap();
    let rig = published().rig(&experiment).unwrap();
    let path = experiment.resolve(&experiment.recording(0).unwrap().file);
    let recording = SampledRecording::read(&path, &rig.layout(&experiment, 0).unwrap()).unwrap();
    let (_, summary) = same_bits_in_a_stream(&experiment, &recording, (&std::fs::read(&path).unwrap(), 4000));
    assert_eq!((summary.estimated, summary.not_estimated), (12_000, 0));
}

#[test]
fn what_a_lag_adds_starts_settled_behind_the_states_that_are_stated() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path(), 2000, 0..0);
    let text = MIRROR.replace("theta = \"0 rad\", omega", "theta = \"3 mrad\", omega");
    let experiment = parse(&format!("{text}{RECORDING}"), folder.path()).unwrap();
    let rig = published().rig(&experiment).unwrap();
    let file = experiment.resolve(&experiment.recording(0).unwrap().file);
    let mut recording = SampledRecording::read(&file, &rig.layout(&experiment, 0).unwrap()).unwrap();
    // Without a correction at the first sample, where both channels are missing.
    for column in ["fast_V", "filtered_V"] {
        recording = recording.what_if(column, |_, values| values[0] = f64::NAN);
    }
    let estimate = rig.estimate(&experiment, 0, &recording, &Silent).unwrap().swap_remove(0);
    let slow = estimate.trajectories[0].state("slow").unwrap();
    // gain * slope * theta, and the same of the deviation of theta.
    assert!((slow.mean[0] - 0.5e12 * 2e-12 * 3e-3).abs() < 1e-12, "{}", slow.mean[0]);
    assert!((slow.sd[0] - 0.5e12 * 2e-12 * 0.01).abs() < 1e-9, "{}", slow.sd[0]);
}
