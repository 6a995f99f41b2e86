//! Diagnoses of devices by their texts: single faults, two at once, and mistaken units and signs. The recordings are simulated here, by equations that
//! are written down a second time.

use super::coupled_devices::{chain, hysteretic_mirror, magnetic_mirror, microphone, pressure_sensor};
use super::further_devices::{
    comb_resonator, contact_switch, piston_mirror, threshold, tuning_fork, vibrating_gyroscope,
};
use super::step_errors::{Between, Device, accelerometer, ring, scanner, stage, thermal};
use kalmems::config::Experiment;
use kalmems::diagnose::{CauseReport, Diagnosis, DiagnosisFinding, Edit, diagnose};
use kalmems::evaluate::Grade;
use kalmems::progress::Silent;
use kalmems::results::Metrics;
use kalmems::rigs::published;
use kalmems::simulate::WhiteNoise;
use kalmems::workflow;
use std::collections::BTreeMap;
use std::path::Path;
use tempfile::TempDir;

#[path = "../trust/side_by_side.rs"]
mod side_by_side;
#[path = "../parts/signal_faults.rs"]
#[allow(dead_code)] // what other suites do to signals
mod signal_faults;

use side_by_side::side_by_side;
use signal_faults::{hum, late, scaled, spikes};

/// What is done to the text of the filters, and to the files of the recording.
struct Alterations<'a> {
    text: &'a dyn Fn(&str) -> String,
    files: &'a dyn Fn(&Path),
}

/// A recording of the device that the text describes, and an experiment whose filter has another text.
struct Recorded {
    _folder: TempDir,
    experiment: Experiment,
}

/// A device of these trials.
struct Subject {
    name: &'static str,
    text: fn() -> String,
    recorded: fn(u64, &Alterations) -> Recorded,
}

/// The true motion begins where the filter's claim of its start has it at random.
fn recorded<const N: usize, const M: usize>(
    device: Device<N, M>,
    samples: usize,
    seed: u64,
    altered: &Alterations,
) -> Recorded {
    let folder = tempfile::tempdir().unwrap();
    let mut chance = WhiteNoise::new(seed, 6);
    let start = std::array::from_fn(|i| device.start[i] + device.start_sd[i] * chance.sample());
    device.record_from(start, folder.path(), samples, seed);
    (altered.files)(folder.path());
    let text = (altered.text)(&device.text);
    Recorded { experiment: Device { text, ..device }.experiment(folder.path(), &[""]), _folder: folder }
}

/// The subject of this name: a device, and its number of samples.
macro_rules! subject {
    ($name:literal, $device:expr, $samples:literal) => {
        Subject {
            name: $name,
            text: || $device.text,
            recorded: |seed, altered| recorded($device, $samples, seed, altered),
        }
    };
}

const SUBJECTS: [Subject; 16] = [
    subject!("shared scanner", scanner(64.0, 1e4, Between::AsItIs), 30_000),
    subject!("threshold scanner", threshold(64.0), 8000),
    subject!("accelerometer", accelerometer(312.5e3), 12_000),
    subject!("micro-stage", Device { rate_hz: 1714.5 * 64.0, substeps: 13, ..stage() }, 8000),
    subject!("piston mirror", piston_mirror(64.0), 8000),
    subject!("comb resonator", comb_resonator(64.0), 8000),
    subject!("tuning fork", tuning_fork(32.0), 24_000),
    subject!(
        "thermal mirror",
        Device { rate_hz: 480.0 * 64.0, substeps: 13, skip_s: 0.05, ..thermal() },
        12_000
    ),
    subject!("vibrating gyroscope", vibrating_gyroscope(32.0), 16_000),
    subject!("contact switch", contact_switch(64.0), 4000),
    subject!("ring gyroscope", ring(), 8000),
    subject!("magnetic mirror", magnetic_mirror(), 8000),
    subject!("hysteretic mirror", hysteretic_mirror(), 8000),
    subject!("microphone", microphone(), 8000),
    subject!("chain of six", chain(), 8000),
    subject!("pressure sensor", pressure_sensor(), 8000),
];

fn subject(name: &str) -> &'static Subject {
    SUBJECTS.iter().find(|subject| subject.name == name).unwrap()
}

/// The text with a number of a section changed; `None` where there is no such number.
fn with_number(text: &str, (section, name): (&str, &str), change: &dyn Fn(f64) -> f64) -> Option<String> {
    let from = text.find(section)?;
    let key = format!("{name} = \"");
    let begins = |at: &usize| matches!(text.as_bytes()[at - 1], b' ' | b'\n' | b'{');
    let at = text[from..].match_indices(&key).map(|(at, _)| from + at).find(begins)? + key.len();
    let is_number = |c: char| c.is_ascii_digit() || matches!(c, '.' | 'e' | '-' | '+');
    let length = text[at..].find(|c| !is_number(c))?;
    let number: f64 = text[at..at + length].parse().ok()?;
    Some(format!("{}{:e}{}", &text[..at], change(number), &text[at + length..]))
}

/// The names of the parameters of a text.
fn parameters(text: &str) -> Vec<String> {
    let from = text.find("parameters").map_or(text.len(), |at| at + "parameters".len());
    let ends = if text[from..].starts_with(" = {") { "}" } else { "\n[" };
    let to = text[from..].find(ends).map_or(text.len(), |length| from + length);
    let parts = text[from..to].split(['\n', '{', ',']).filter_map(|part| part.split_once(" = \""));
    parts.map(|(name, _)| name.trim().to_owned()).filter(|name| !name.is_empty()).collect()
}

/// Changes the numbers of a column of a recording.
fn change_column(folder: &Path, column: usize, change: impl FnOnce(&mut [f64], &[f64])) {
    let path = folder.join("recording.csv");
    let text = std::fs::read_to_string(&path).unwrap();
    let mut rows: Vec<Vec<String>> =
        text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect();
    let numbers = |at: usize| rows[1..].iter().map(move |row| row[at].parse().unwrap_or(f64::NAN));
    let times: Vec<f64> = numbers(0).collect();
    let mut values: Vec<f64> = numbers(column).collect();
    change(&mut values, &times);
    for (row, value) in rows[1..].iter_mut().zip(values) {
        row[column] = if value.is_finite() { format!("{value:e}") } else { String::new() };
    }
    let lines: Vec<String> = rows.iter().map(|row| row.join(",")).collect();
    std::fs::write(path, lines.join("\n") + "\n").unwrap();
}

/// Leaves one in eight samples of the second signal, where there is one that is slower than the first.
fn thin(subject: &Subject, folder: &Path) {
    if subject.name == "pressure sensor" {
        change_column(folder, 3, |values, _| {
            values
                .iter_mut()
                .enumerate()
                .filter(|(k, _)| k % 8 != 0)
                .for_each(|(_, value)| *value = f64::NAN);
        });
    }
}

/// What is wrong.
#[derive(Clone)]
enum Fault {
    /// The filter's number of this section and name is larger by a part, or the noise smaller.
    Number(&'static str, String),
    /// The numbers of a column of the recording are others.
    Column(usize, fn(&mut [f64], &[f64], f64, u64), &'static str),
}

impl Fault {
    /// What a diagnosis has to name.
    fn name(&self) -> String {
        match self {
            Self::Number(section, name) => format!("{section}.{name}"),
            Self::Column(.., name) => (*name).to_owned(),
        }
    }

    /// The smallest and the largest size that are tried.
    fn sizes(&self) -> [f64; 2] {
        match self {
            Self::Number("noise", _) => [0.05, 20.0],
            Self::Number(..) => [1e-5, 0.5],
            Self::Column(1, ..) => [1e-3, 0.5],
            Self::Column(..) => [0.1, 50.0],
        }
    }

    fn in_text(&self, text: &str, size: f64) -> String {
        let Self::Number(section, name) = self else { return text.to_owned() };
        let change = |number: f64| {
            if *section == "noise" { number / (1.0 + size) } else { number * (1.0 + size) }
        };
        with_number(text, (section, name), &change).unwrap_or_else(|| panic!("{section}.{name}: {text}"))
    }

    fn in_files(&self, folder: &Path, size: f64, seed: u64) {
        if let Self::Column(column, change, _) = self {
            change_column(folder, *column, |values, times| change(values, times, size, seed));
        }
    }
}

/// A recording with these faults of these sizes.
fn faulty(subject: &Subject, faults: &[(&Fault, f64)], seed: u64) -> Recorded {
    let text =
        |text: &str| faults.iter().fold(text.to_owned(), |text, (fault, size)| fault.in_text(&text, *size));
    let files = |folder: &Path| {
        thin(subject, folder);
        for (fault, size) in faults {
            fault.in_files(folder, *size, seed);
        }
    };
    (subject.recorded)(seed, &Alterations { text: &text, files: &files })
}

/// All faults of a device that are tried: each parameter, each noise, and what may happen to a drive and to a signal.
fn faults_of(subject: &Subject) -> Vec<Fault> {
    let text = (subject.text)();
    let numbers = parameters(&text).into_iter().map(|name| Fault::Number("parameters", name));
    let mut faults: Vec<Fault> = numbers.collect();
    faults.push(Fault::Number("noise", "signal0".to_owned()));
    if text.contains("inputs") {
        faults.push(Fault::Column(1, scaled, "the scale of the drive's column"));
        faults.push(Fault::Column(1, late, "the time of the drive's column"));
    }
    faults.push(Fault::Column(2, hum, "a line of"));
    faults.push(Fault::Column(2, spikes, "samples of the signal"));
    faults
}

/// Whether the verdict of the filter is doubtful or worse; also where it refuses the recording.
fn is_seen(recorded: &Recorded) -> bool {
    let Ok(outcome) = workflow::estimate(published(), &without_reference(&recorded.experiment), &Silent)
    else {
        return true;
    };
    let metrics = Metrics::of(&outcome);
    let grade = metrics.estimators().next().and_then(|one| one.grade);
    grade.is_none_or(|grade| grade > Grade::PassesWithRemarks)
}

/// The same experiment without what a recording in a laboratory does not have.
fn without_reference(experiment: &Experiment) -> Experiment {
    let mut document: toml::Value = toml::Value::Table(experiment.to_toml().unwrap().parse().unwrap());
    document["recording"][0].as_table_mut().unwrap().remove("reference");
    published().parse(&toml::to_string(&document).unwrap(), experiment.path()).unwrap()
}

fn diagnosed(recorded: &Recorded) -> Option<Diagnosis> {
    diagnose(published(), &without_reference(&recorded.experiment), None, &Silent).ok()
}

/// The first size, of a factor of 2 between them, at which the verdicts of three recordings that judge nothing are doubtful, and half of that more;
/// `None` where they are not up to the largest.
fn visible_size(subject: &Subject, fault: &Fault) -> Option<f64> {
    let [from, to] = fault.sizes();
    let mut size = from;
    while size <= to {
        if (1..=3).all(|seed| is_seen(&faulty(subject, &[(fault, size)], seed))) {
            return Some(1.5 * size);
        }
        size *= 2.0;
    }
    None
}

/// Mean square errors of the first filter's states that have a reference.
fn squares(experiment: &Experiment) -> Option<BTreeMap<String, f64>> {
    let metrics = Metrics::of(&workflow::estimate(published(), experiment, &Silent).ok()?);
    let one = metrics.estimators().next()?;
    Some(one.values.iter().map(|(name, value)| ((*name).to_owned(), value.rmse.powi(2))).collect())
}

/// The experiment with these edits.
fn pasted(experiment: &Experiment, cause: &CauseReport) -> Option<Experiment> {
    let text = kalmems::diagnose::pasted(experiment, cause)?;
    published().parse(&text, experiment.path()).ok()
}

/// What diagnoses of recordings with one kind of fault come to.
struct Diagnosed {
    named: usize,
    of: usize,
    /// The largest ratio over the states of the error with what is pasted to that of the true model, root mean square over the recordings, and to what
    /// is left where the numbers are known as well as the lines state: no recording tells more.
    error_over: Option<[f64; 2]>,
}

/// The experiment with what a cause writes, each number so many of its stated standard deviations larger.
fn pasted_off(experiment: &Experiment, cause: &CauseReport, by: f64) -> Option<Experiment> {
    let edits = cause.edits.iter().map(|edit| {
        let to = edit.to.trim_matches('"');
        let length = to.find(|c: char| !(c.is_ascii_digit() || ".e-+".contains(c))).unwrap_or(to.len());
        let (Ok(number), Some(sd)) = (to[..length].parse::<f64>(), edit.sd) else { return edit.clone() };
        let moved = format!("{:e}{}", number * (1.0 + by * sd), &to[length..]);
        let to = if edit.to.starts_with('"') { format!("\"{moved}\"") } else { moved };
        Edit { to, ..edit.clone() }
    });
    pasted(experiment, &CauseReport { edits: edits.collect(), ..cause.clone() })
}

/// A finding with the causes that it names.
fn in_words(found: Option<&Diagnosis>) -> String {
    let Some(found) = found else { return "refused".to_owned() };
    let listed: Vec<&str> = found.causes.iter().map(|cause| cause.name.as_str()).collect();
    format!("{:?}: {}", found.finding, listed.join(", "))
}

const RECORDINGS: u64 = 5;

fn single(subject: &Subject, fault: &Fault, place: u64) -> Option<Diagnosed> {
    let name = fault.name();
    let Some(size) = visible_size(subject, fault) else {
        println!("{:20} {name:32} is not seen", subject.name);
        return None;
    };
    let (mut named, mut all) = (0, BTreeMap::new());
    let mut sums: BTreeMap<String, [f64; 3]> = BTreeMap::new();
    for seed in (0..RECORDINGS).map(|k| 3001 + 10 * place + k) {
        let recorded = faulty(subject, &[(fault, size)], seed);
        let found = diagnosed(&recorded);
        let cause = found.iter().flat_map(|found| &found.causes).find(|cause| cause.name.contains(&name));
        named += usize::from(cause.is_some());
        *all.entry(in_words(found.as_ref())).or_insert(0) += 1;
        let Some(cause) = cause.filter(|cause| {
            matches!(fault, Fault::Number(..)) && !cause.edits.is_empty() && cause.withheld.is_none()
        }) else {
            continue;
        };
        let right = squares(&faulty(subject, &[], seed).experiment);
        let with = [0.0, 1.0, -1.0].map(|by| {
            pasted_off(&recorded.experiment, cause, by).and_then(|experiment| squares(&experiment))
        });
        for (state, square) in right.into_iter().flatten() {
            let [of_pasted, above, below] = with.each_ref().map(|with| {
                with.as_ref().and_then(|with| with.get(&state)).copied().unwrap_or(f64::INFINITY)
            });
            let by_deviation = (0.5 * (above + below) - of_pasted).max(0.0);
            let sum = sums.entry(state).or_default();
            *sum = [sum[0] + of_pasted, sum[1] + square, sum[2] + square + by_deviation];
        }
    }
    let ratios = sums.values().map(|[pasted, right, known]| [pasted / right, pasted / known].map(f64::sqrt));
    let error_over = ratios.reduce(|most, ratio| [most[0].max(ratio[0]), most[1].max(ratio[1])]);
    let words: Vec<String> = all.iter().map(|(what, count)| format!("\n    {count}: {what}")).collect();
    let mended = error_over.map_or_else(String::new, |[right, known]| {
        format!(", error {right:.2} of the true model's, {known:.2} of what the lines state")
    });
    println!(
        "{:20} {name:32} {size:9.2e}: {named} of {RECORDINGS} named{mended}{}",
        subject.name,
        words.concat()
    );
    Some(Diagnosed { named, of: usize::try_from(RECORDINGS).unwrap(), error_over })
}

#[test]
#[ignore = "slow: twenty minutes on two processors in a release build"]
fn slow_single_faults_of_texts_are_named() {
    let kinds: Vec<(&Subject, Fault)> = SUBJECTS
        .iter()
        .flat_map(|subject| faults_of(subject).into_iter().map(move |fault| (subject, fault)))
        .collect();
    let places: Vec<(u64, &(&Subject, Fault))> = (0..).zip(&kinds).collect();
    let found = side_by_side(&places, |(place, (subject, fault))| single(subject, fault, *place));
    println!(
        "| device | kinds | not seen | named | largest error over the true model's | over what the lines state |\n|---|--:|--:|--:|--:|--:|"
    );
    for subject in &SUBJECTS {
        let own = || {
            kinds.iter().zip(&found).filter(|((of, _), _)| of.name == subject.name).map(|(_, found)| found)
        };
        let (named, of) = own().flatten().fold((0, 0), |(named, of), one| (named + one.named, of + one.of));
        let largest = [0, 1].map(|of| {
            own().flatten().filter_map(|one| one.error_over).map(|ratio| ratio[of]).fold(f64::NAN, f64::max)
        });
        let unseen = own().filter(|one| one.is_none()).count();
        let [right, known] = largest;
        println!(
            "| {} | {} | {unseen} | {named} of {of} | {right:.2} | {known:.2} |",
            subject.name,
            own().count()
        );
    }
    let found: Vec<&Diagnosed> = found.iter().flatten().collect();
    let (named, of) = found.iter().fold((0, 0), |(named, of), one| (named + one.named, of + one.of));
    let pasted: Vec<[f64; 2]> = found.iter().filter_map(|one| one.error_over).collect();
    let within = |of: usize| pasted.iter().filter(|ratio| ratio[of] <= 1.3).count();
    let mended = within(1);
    println!(
        "{named} of {of} named; of {} kinds the error of {} is within 1.3 of the true model's, and of {mended} within 1.3 of what is left \
         where the numbers are known as the lines state",
        pasted.len(),
        within(0)
    );
    assert!(100 * named >= 92 * of && 100 * mended >= 92 * pasted.len());
}

/// Pairs of faults of each device that are tried, and recordings of each.
const PAIRS: usize = 3;
const PAIR_RECORDINGS: u64 = 3;

#[test]
#[ignore = "slow: ten minutes on two processors in a release build"]
fn slow_two_faults_of_texts_are_named() {
    let pairs: Vec<(&Subject, usize)> =
        SUBJECTS.iter().flat_map(|subject| (0..PAIRS).map(move |pair| (subject, pair))).collect();
    let places: Vec<(u64, &(&Subject, usize))> = (0..).zip(&pairs).collect();
    let found = side_by_side(&places, |(place, (subject, pair))| {
        // Two parameters that are drawn by the place among the pairs, of those that are seen.
        let numbers =
            faults_of(subject).into_iter().filter(|fault| matches!(fault, Fault::Number("parameters", _)));
        let mut seen: Vec<(Fault, f64)> =
            numbers.filter_map(|fault| visible_size(subject, &fault).map(|size| (fault, size))).collect();
        if seen.len() < 2 {
            return (0, 0);
        }
        let mut chance = WhiteNoise::new(*place, 17);
        let mut drawn: Vec<(Fault, f64)> = Vec::new();
        for _ in 0..2 {
            let order: Vec<f64> = seen.iter().map(|_| chance.sample()).collect();
            let first = (0..order.len()).max_by(|a, b| order[*a].total_cmp(&order[*b])).unwrap();
            drawn.push(seen.swap_remove(first));
        }
        let both: Vec<(&Fault, f64)> = drawn.iter().map(|(fault, size)| (fault, *size)).collect();
        let names: Vec<String> = drawn.iter().map(|(fault, _)| fault.name()).collect();
        let (mut named, mut of) = (0, 0);
        for seed in (0..PAIR_RECORDINGS).map(|k| 5001 + 10 * place + k) {
            let recorded = faulty(subject, &both, seed);
            // Two errors may take each other off.
            if !is_seen(&recorded) {
                continue;
            }
            let found = diagnosed(&recorded);
            let causes: Vec<&str> =
                found.iter().flat_map(|found| &found.causes).map(|cause| cause.name.as_str()).collect();
            let has_both = |own: &&str| names.iter().all(|name| own.contains(name.as_str()));
            // Where each of them alone would explain it, as of a product, there is no telling that there are two.
            let each = names.iter().all(|name| causes.contains(&name.as_str()));
            let is_named = causes.iter().any(has_both) || each;
            of += 1;
            println!("{:20} {pair} {names:?} {is_named}: {}", subject.name, in_words(found.as_ref()));
            named += usize::from(is_named);
        }
        (named, of)
    });
    let (named, of) = found.iter().fold((0, 0), |(named, of), one| (named + one.0, of + one.1));
    println!("{named} of {of} pairs named");
    assert!(100 * named >= 75 * of, "{named} of {of}");
}

/// A mistake that is made in writing a text: the device, what is right in its text, what is written, and what a diagnosis has to name.
type Mistake = (&'static str, &'static str, &'static str, &'static str);

/// Kinds were chosen first, then what they do to each device, before any was diagnosed.
const MISTAKES: [Mistake; 60] = [
    // A prefix, a power of ten.
    ("comb resonator", "0.2 V/um", "0.2 V/mm", "parameters.sensitivity"),
    ("tuning fork", "4.7 pF", "4.7 nF", "parameters.feedback"),
    ("vibrating gyroscope", "0.2 V/um", "0.2 V/mm", "parameters.drive_gain"),
    ("vibrating gyroscope", "10 V/um", "10 V/mm", "parameters.sense_gain"),
    ("piston mirror", "1 V/pF", "1 V/fF", "parameters.gain"),
    ("piston mirror", "100 fF", "100 pF", "parameters.plate"),
    ("hysteretic mirror", "0.1 V/um", "0.1 V/mm", "parameters.gain"),
    ("microphone", "3 um", "30 um", "parameters.gap"),
    ("microphone", "1e9 ohm", "1e6 ohm", "parameters.R"),
    ("chain of six", "1 V/um", "1 V/mm", "parameters.gain"),
    ("pressure sensor", "10 ms", "10 us", "parameters.fill"),
    ("pressure sensor", "10 mV/K", "10 V/K", "parameters.sensor"),
    ("comb resonator", "4 us", "4 ms", "parameters.lag"),
    ("magnetic mirror", "100 ohm", "100 kohm", "parameters.R"),
    ("contact switch", "1.2 um", "12 um", "parameters.travel"),
    // g for kg.
    ("comb resonator", "1.2e-9 kg", "1.2e-6 kg", "parameters.m"),
    ("tuning fork", "6.6e-7 kg", "6.6e-4 kg", "parameters.m"),
    ("hysteretic mirror", "1e-6 kg", "1e-3 kg", "parameters.m"),
    ("accelerometer", "3.8e-9 kg", "3.8e-6 kg", "parameters.m"),
    ("chain of six", "1e-9 kg", "1e-6 kg", "parameters.m"),
    // Degrees for radians.
    ("shared scanner", "0.2 rad", "11.459 rad", "parameters.width"),
    ("thermal mirror", "2.5 V/rad", "0.04363 V/rad", "parameters.sensitivity"),
    ("magnetic mirror", "10 V/rad", "0.17453 V/rad", "parameters.gain"),
    ("magnetic mirror", "7.8957e-5 N m/rad", "4.5238e-3 N m/rad", "parameters.k"),
    ("threshold scanner", "600 rad/(s^2 V)", "34377 rad/(s^2 V)", "parameters.torque"),
    ("shared scanner", "1.1e-4 N m/rad", "6.3025e-3 N m/rad", "parameters.k"),
    // Without 2 pi, or with it twice.
    ("ring gyroscope", "47123.8898038469 rad/s", "7500 rad/s", "parameters.w"),
    ("micro-stage", "10772.52", "1714.5", "parameters.w"),
    ("threshold scanner", "3924.477 1/s", "624.6 1/s", "parameters.w"),
    ("vibrating gyroscope", "125.66 rad/s", "20 rad/s", "parameters.bandwidth"),
    ("comb resonator", "3.0159e-7 N s/m", "4.8e-8 N s/m", "parameters.b"),
    ("tuning fork", "0.1034 ms", "0.6497 ms", "parameters.leak"),
    ("contact switch", "251327.412 rad/s", "40000 rad/s", "parameters.w"),
    // Signs.
    ("shared scanner", "-0.3574 V/pF", "0.3574 V/pF", "parameters.gain"),
    ("comb resonator", "0.2 V/um", "-0.2 V/um", "parameters.sensitivity"),
    ("comb resonator", "4.7374 N/m", "-4.7374 N/m", "parameters.k"),
    ("hysteretic mirror", "1e-4 N/V", "-1e-4 N/V", "parameters.force"),
    ("magnetic mirror", "2e-6 N m/A", "-2e-6 N m/A", "parameters.field"),
    ("magnetic mirror", "3.9e-3 1/K", "-3.9e-3 1/K", "parameters.alpha"),
    ("micro-stage", "0.01 V s/m", "-0.01 V s/m", "parameters.gain"),
    ("micro-stage", "3782.5 m/(s^2 V)", "-3782.5 m/(s^2 V)", "parameters.force"),
    ("microphone", "1 Pa/V", "-1 Pa/V", "parameters.reference"),
    ("threshold scanner", "2.82 mV s/rad", "-2.82 mV s/rad", "parameters.gain"),
    ("vibrating gyroscope", "3.9e-8 N/V", "-3.9e-8 N/V", "parameters.force"),
    ("thermal mirror", "3.4e-15 kg m^2", "-3.4e-15 kg m^2", "parameters.J"),
    ("chain of six", "1e-7 N/V", "-1e-7 N/V", "parameters.force"),
    ("pressure sensor", "1e-5 V/Pa", "-1e-5 V/Pa", "parameters.gain"),
    // Peak for root mean square, half a factor, per cent.
    ("comb resonator", "2.96e-9 N/V^2", "5.92e-9 N/V^2", "parameters.force"),
    ("tuning fork", "9.2e-6 C/m", "1.301e-5 C/m", "parameters.coupling"),
    ("hysteretic mirror", "1e-4 N/V", "1.4142e-4 N/V", "parameters.force"),
    ("micro-stage", "5e-3", "0.5", "parameters.zeta"),
    ("pressure sensor", "2e-3 1/K", "0.2 1/K", "parameters.tempco"),
    ("microphone", "3 V", "6 V", "parameters.bias"),
    ("magnetic mirror", "3.9e-3 1/K", "0.39 1/K", "parameters.alpha"),
    // A noise as a standard deviation, in another unit, or single-sided for double-sided and squared twice.
    ("comb resonator", "signal0 = \"1e-6[V^2]\"", "signal0 = \"1e-12[V^2]\"", "noise.signal0"),
    ("hysteretic mirror", "signal0 = \"1e-6[V^2]\"", "signal0 = \"1e-9[V^2]\"", "noise.signal0"),
    ("ring gyroscope", "signal1 = \"4e-6[V^2]\"", "signal1 = \"4e-9[V^2]\"", "noise.signal1"),
    ("magnetic mirror", "signal0 = \"1e-6[V^2]\"", "signal0 = \"1e-3[V^2]\"", "noise.signal0"),
    // Channels that are exchanged.
    ("vibrating gyroscope", "", "", "exchanged"),
    ("pressure sensor", "", "", "exchanged"),
];

/// Exchanges the columns of two signals.
fn exchange(folder: &Path) {
    let path = folder.join("recording.csv");
    let text = std::fs::read_to_string(&path).unwrap();
    let exchanged = |line: &str| {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells.swap(2, 3);
        cells.join(",") + "\n"
    };
    let (names, rows) = text.split_once('\n').unwrap();
    std::fs::write(path, format!("{names}\n{}", rows.lines().map(exchanged).collect::<String>())).unwrap();
}

#[test]
#[ignore = "slow: five minutes on two processors in a release build"]
fn slow_mistakes_in_writing_a_text_are_named() {
    let places: Vec<(usize, &Mistake)> = MISTAKES.iter().enumerate().collect();
    let found = side_by_side(&places, |(place, (device, right, wrong, name))| {
        let subject = subject(device);
        let text = |text: &str| {
            assert!(right.is_empty() || text.contains(right), "{device}: {right}");
            if right.is_empty() { text.to_owned() } else { text.replacen(right, wrong, 1) }
        };
        let files = |folder: &Path| {
            thin(subject, folder);
            if right.is_empty() {
                exchange(folder);
            }
        };
        let recorded = (subject.recorded)(7001 + *place as u64, &Alterations { text: &text, files: &files });
        let (seen, found) = (is_seen(&recorded), diagnosed(&recorded));
        let is_named = found.iter().any(|found| found.finding == DiagnosisFinding::Explained)
            && found.iter().flat_map(|found| &found.causes).any(|cause| cause.name.contains(name));
        println!(
            "{device:20} {right} -> {wrong}: seen {seen}, named {is_named}: {}",
            in_words(found.as_ref())
        );
        (seen, is_named)
    });
    // Half of them are set aside: what is changed is judged by the other half.
    for (half, aside) in [("looked at", false), ("set aside", true)] {
        let own = found
            .iter()
            .enumerate()
            .filter(|(place, _)| is_set_aside(*place) == aside)
            .map(|(_, found)| found);
        let own: Vec<&(bool, bool)> = own.collect();
        let seen = own.iter().filter(|(seen, _)| *seen).count();
        println!(
            "{half}: {} of {seen} that are seen named, of {}",
            own.iter().filter(|(_, named)| *named).count(),
            own.len()
        );
    }
    let seen = found.iter().filter(|(seen, _)| *seen).count();
    let named = found.iter().filter(|(_, named)| *named).count();
    assert!(10 * named >= 8 * seen, "{named} of {seen}");
}

/// Whether a mistake is one of the half that a seed sets aside.
fn is_set_aside(place: usize) -> bool {
    WhiteNoise::new(place as u64, 23).sample() > 0.0
}
