//! Filters whose signal is none of their device for a while: sign and phase are kept, in C, in Rust and in the rehearsal alike.

use super::cases::{Case, cases};
use super::compilers::{compile, folder, has, run, write};
use super::{GCC, OF_SD, text_of};
use kalmems_equations::{EmitDigits, EmitLanguage, EmitRequest, EmitWatch, StepMethod, TestSample};
use std::fs;

/// Where the signal is lost, behind the settling time.
const LOSS: usize = 1200;
/// How long a filter remembers: its gate opens after 27 samples, and it is lost after 25 more.
const MEMORY: u32 = 200;

/// The statuses of the header.
const FOLLOWING: f64 = 1.0;
const LEFT_OUT: f64 = 2.0;
const LOST: f64 = 5.0;
const SATURATED: f64 = 6.0;

/// What a program says of each sample: the values, the status of the first measurement, and how often the filter has begun again.
struct Answers {
    values: Vec<Vec<f64>>,
    status: Vec<f64>,
    begun: f64,
}

impl Answers {
    fn of(rows: Vec<Vec<f64>>) -> Self {
        let begun = *rows.last().unwrap().last().unwrap();
        let states = rows[0].len() - 2;
        let status = rows.iter().map(|row| row[states]).collect();
        Self { values: rows.into_iter().map(|row| row[..states].to_vec()).collect(), status, begun }
    }
}

/// The filter in C and in Rust, where there are compilers.
fn answers(case: &Case, request: &EmitRequest, samples: &[TestSample]) -> Vec<(&'static str, Answers)> {
    let mut all = Vec::new();
    let name = &request.name;
    for (language, compiler) in [(EmitLanguage::C, "gcc"), (EmitLanguage::Rust, "rustc")] {
        if !has(compiler) {
            continue;
        }
        let emitted = case.device.emit(request, language).unwrap();
        let folder = folder(&format!("{name}_{compiler}"));
        write(&folder, &emitted.files);
        let main = |name: &str| emitted.files.iter().find(|(file, _)| file == name).unwrap().1.clone();
        if language == EmitLanguage::C {
            let says = format!(
                "printf(\"%d %u\\n\", (int){name}_status(&filter, 0U), filter.begun);\n    }}\n    return 0;"
            );
            let program =
                main("main.c").replace("k + 1U < ", "k + 1U < 1U + ").replace("    }\n    return 0;", &says);
            fs::write(folder.join("main.c"), program).unwrap();
            compile(
                &folder,
                compiler,
                &[&GCC[..], &["-o", "program", "main.c", &format!("{name}.c")]].concat(),
            );
        } else {
            let program = main("main.rs").replace(
                "println!(\"{}\", values.join(\" \"));",
                "println!(\"{} {} {}\", values.join(\" \"), filter.status(0).unwrap() as u8, filter.begun);",
            );
            fs::write(folder.join("main.rs"), program).unwrap();
            let arguments = ["--edition=2024", "-Dwarnings", "-Copt-level=1", "-o", "program", "main.rs"];
            compile(&folder, compiler, &arguments);
        }
        all.push((compiler, Answers::of(run(&folder, "program", &[], &text_of(samples, &emitted.files)))));
    }
    all
}

/// The largest difference over the last hundred samples in standard deviations of the library's filter.
fn apart(case: &Case, request: &EmitRequest, [one, other]: [&[Vec<f64>]; 2], sd: &[Vec<f64>]) -> f64 {
    let periods = case.device.periods(&request.parameters).unwrap();
    let mut worst = 0.0_f64;
    for k in one.len() - 100..one.len() {
        for (i, sd) in sd[k].iter().enumerate() {
            let difference = one[k][i] - other[k][i];
            let period = periods.iter().find(|(state, _)| *state == i).map(|(_, period)| *period);
            let difference = period.map_or(difference, |p| difference - p * (difference / p).round()).abs();
            worst = if difference.is_finite() { worst.max(difference / sd) } else { f64::INFINITY };
        }
    }
    worst
}

#[test]
fn sign_and_phase_are_kept_through_a_loss_of_the_signal() {
    for (name, length) in [
        ("shared_scanner", 60),
        ("shared_scanner", 150),
        ("comb_resonator", 100),
        ("piston_mirror", 90),
        ("two_axes", 100),
    ] {
        let case = cases().into_iter().find(|case| case.name == name).unwrap();
        let mut request = case.variant(StepMethod::RungeKutta, false);
        request.name = format!("lost_{name}_{length}");
        request.watch = EmitWatch { rejects: true, settling: 1000, memory: MEMORY, largest_nis: 28.0 };
        request.mirrored = name == "shared_scanner";
        (request.digits, request.rehearsal) = (EmitDigits::Double, Vec::new());
        let (mut samples, sd) = case.samples(&request, 11);
        let clean: Vec<Vec<f64>> = samples.iter().map(|sample| sample.expected.clone()).collect();
        for sample in &mut samples[LOSS..LOSS + length] {
            sample.measured.fill(0.0);
        }
        let all = answers(&case, &request, &samples);
        for (language, said) in &all {
            let found = apart(&case, &request, [&said.values, &clean], &sd);
            println!(
                "{name}, {length} samples, {language}: {found:.2} sd from what it is without; status {}, begun again {} times",
                said.status.last().unwrap(),
                said.begun
            );
            assert!(said.status[LOSS..LOSS + length].contains(&LOST), "{name} is not lost");
        }
        for (language, said) in &all {
            let found = apart(&case, &request, [&said.values, &clean], &sd);
            assert!(found < 1.0 && said.begun == 0.0, "{name}, {language}: {found} sd");
            assert_eq!(*said.status.last().unwrap(), FOLLOWING, "{name}, {language}");
            // The rehearsal goes the same way, where the filter claims to follow the signal.
            for (k, sample) in samples.iter_mut().enumerate() {
                sample.expected.clone_from(&said.values[k]);
                let claim = if said.status[k] == FOLLOWING { 1.0 } else { 0.0 };
                sample.expected_sd = sd[k].iter().map(|sd| claim * sd).collect();
            }
            request.rehearsal.clone_from(&samples);
            let (_, share) = case.device.emit(&request, EmitLanguage::C).unwrap().apart.unwrap();
            println!("{name}, {language}: {share:.1e} sd from the rehearsal");
            assert!(share < OF_SD, "{name}, {language}: {share}");
        }
    }
}

#[test]
fn a_sample_at_an_end_of_its_range_is_a_gap_and_says_so() {
    let case = cases().into_iter().find(|case| case.name == "shared_scanner").unwrap();
    let mut request = case.variant(StepMethod::RungeKutta, false);
    request.name = "ranged".to_owned();
    request.watch = EmitWatch { rejects: true, settling: 1000, memory: MEMORY, largest_nis: 28.0 };
    let (mut samples, _) = case.samples(&request, 11);
    samples.truncate(LOSS + 100);
    let most = samples.iter().fold(f64::NEG_INFINITY, |most, sample| most.max(sample.measured[0]));
    request.measures[0].range = Some([-10.0, most + 1e-3]);
    let mut gap = samples.clone();
    samples[LOSS].measured[0] = most + 1e-3;
    gap[LOSS].measured[0] = f64::NAN;
    for ((language, said), (_, of_gap)) in
        answers(&case, &request, &samples).iter().zip(answers(&case, &request, &gap))
    {
        assert_eq!(said.values, of_gap.values, "{language}");
        assert_eq!([said.status[LOSS - 1], said.status[LOSS]], [FOLLOWING, SATURATED], "{language}");
        assert_eq!([of_gap.status[LOSS], *said.status.last().unwrap()], [LEFT_OUT, FOLLOWING], "{language}");
    }
}
