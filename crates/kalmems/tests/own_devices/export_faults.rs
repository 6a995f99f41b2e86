//! What an exported filter does where its signal has faults: it says so, and estimates on as soon as the signal is good again.

use super::export::{compiled, example, request};
use kalmems::export::{ExportRequest, SourceLanguage};
use kalmems::rigs::published;
use kalmems::source::source;
use std::fmt::Write as _;
use std::fs;
use std::process::Command;

/// A program that says of each sample the angle, its claimed variance, the status, and how often the filter has begun again.
const PROGRAM: &str = r#"
#include "scanner_filter.h"
#include <stdio.h>
int main(void)
{
    scanner_filter_t filter;
    float u[3], y;
    scanner_filter_start(&filter);
    while (scanf("%f %f %f %f", &u[0], &u[1], &u[2], &y) == 4) {
        (void)scanner_filter_step(&filter, u[0], u[1], u[2], y);
        printf("%.9g %.9g %d %u\n", (double)scanner_filter_value(&filter, 0U), (double)scanner_filter_variance(&filter, 0U),
               (int)scanner_filter_status(&filter, 0U), filter.begun);
    }
    return 0;
}
"#;

/// The same behind a storm of numbers with any bits: infinities, numbers without a leading one and what is none, in functions in any order.
const STORM: &str = r"
    union { unsigned bits; float value; } any[4];
    unsigned chance = 1U, k, i;
    for (k = 0U; k < 300000U; k++) {
        for (i = 0U; i < 4U; i++) {
            chance ^= chance << 13;
            chance ^= chance >> 17;
            chance ^= chance << 5;
            any[i].bits = chance;
        }
        switch (chance % 4U) {
        case 0U: (void)scanner_filter_predict(&filter, any[0].value, any[1].value, any[2].value); break;
        case 1U: (void)scanner_filter_update_signal(&filter, any[3].value); break;
        default: (void)scanner_filter_step(&filter, any[0].value, any[1].value, any[2].value, any[3].value); break;
        }
        if (!(scanner_filter_value(&filter, 0U) - scanner_filter_value(&filter, 0U) == 0.0F)) {
            return 1;
        }
    }
";

/// The statuses of the header.
const FOLLOWING: f64 = 1.0;
const LEFT_OUT: f64 = 2.0;
const SIGN_UNSURE: f64 = 4.0;
const LOST: f64 = 5.0;

/// Where the faults begin, behind the settling time of 8000 samples.
const FAULT: usize = 12_000;
/// Samples of a cycle of the motion.
const CYCLE: usize = 64;

/// The columns of the recording and the true angle.
fn recorded() -> [Vec<f64>; 3] {
    let folder = example("shared_scanner/microcontroller.toml").resolve("".as_ref());
    let column = |file: &str, name: &str| -> Vec<f64> {
        let text = fs::read_to_string(folder.join(file)).unwrap();
        let place = text.lines().next().unwrap().split(',').position(|own| own == name).unwrap();
        text.lines().skip(1).map(|line| line.split(',').nth(place).unwrap().parse().unwrap()).collect()
    };
    [
        column("recording.csv", "drive_V"),
        column("recording.csv", "cap_V"),
        column("reference.csv", "angle_rad"),
    ]
}

/// What the program says of each sample from the fourth on.
struct Said(Vec<[f64; 4]>);

impl Said {
    fn of(program: &std::path::Path, drive: &[f64], signal: &[f64]) -> Self {
        let mut input = String::new();
        for k in 3..signal.len() - 2 {
            let pair = |away: usize| drive[k - 1 - away] + drive[k + away];
            let middle = (150.0 * pair(0) - 25.0 * pair(1) + 3.0 * pair(2)) / 256.0;
            let _ = writeln!(input, "{:e} {middle:e} {:e} {:e}", drive[k - 1], drive[k], signal[k]);
        }
        let given = program.with_file_name("given");
        fs::write(&given, input).unwrap();
        let ran = Command::new(program).stdin(fs::File::open(given).unwrap()).output().unwrap();
        let numbers =
            |line: &str| -> Vec<f64> { line.split(' ').map(|word| word.parse().unwrap()).collect() };
        let text = String::from_utf8(ran.stdout).unwrap();
        Self(text.lines().map(|line| numbers(line).try_into().unwrap()).collect())
    }

    /// The root mean square of the error of the angle over these samples of the recording.
    fn error(&self, angle: &[f64], rows: std::ops::Range<usize>) -> f64 {
        let count = rows.len() as f64;
        let square = |k: usize| {
            let own = self.0[k - 3][0] - angle[k];
            own * own
        };
        (rows.map(square).sum::<f64>() / count).sqrt()
    }

    /// The same up to the sign, which a filter that has begun again does not know.
    fn error_of_either_sign(&self, angle: &[f64], rows: std::ops::Range<usize>) -> f64 {
        let mirrored: Vec<f64> = angle.iter().map(|angle| -angle).collect();
        self.error(angle, rows.clone()).min(self.error(&mirrored, rows))
    }

    fn statuses(&self, rows: std::ops::Range<usize>) -> impl Iterator<Item = f64> {
        rows.map(|k| self.0[k - 3][2])
    }
}

/// The program of the exported filter, with this behind its start and these arguments of the compiler; none without a compiler.
fn program(folder: &std::path::Path, first: &str, flags: &[&str]) -> Option<std::path::PathBuf> {
    let experiment = example("shared_scanner/microcontroller.toml");
    let mut exported = source(published(), &experiment, &request(SourceLanguage::C, "EKF")).unwrap();
    let (_, main) = exported.files.iter_mut().find(|(name, _)| name == "main.c").unwrap();
    *main = PROGRAM.replace("    while (", &format!("{first}    while ("));
    compiled(&exported.files, folder, flags)?;
    Some(folder.join("program"))
}

#[test]
fn a_fault_is_said_at_once_and_does_not_outlast_itself() {
    let folder = tempfile::tempdir().unwrap();
    let Some(program) = program(folder.path(), "", &[]) else { return };
    let [drive, signal, angle] = recorded();
    let clean = Said::of(&program, &drive, &signal);
    assert!(clean.statuses(9000..23_000).all(|status| status == FOLLOWING));
    for (name, samples, value) in [
        ("a rail of 500 us", 500, 5.0),
        ("an outlier", 1, signal[FAULT] + 0.5),
        ("a finite glitch", 1, 1e4),
        ("2000 missing samples", 2000, f64::NAN),
    ] {
        let mut faulty = signal.clone();
        faulty[FAULT..FAULT + samples].fill(value);
        let said = Said::of(&program, &drive, &faulty);
        assert!(said.statuses(FAULT..FAULT + samples).all(|status| status == LEFT_OUT), "{name}");
        // Behind a burst some samples are suspect; behind a gap the numbers of the device, which are wrong here, have had their time.
        let again = FAULT + samples + 6 * CYCLE;
        let rows = again..again + 10 * CYCLE;
        let [found, without] = [&said, &clean].map(|one| one.error(&angle, rows.clone()));
        println!("{name}: {:.3} mrad rms afterwards, {:.3} without it", 1e3 * found, 1e3 * without);
        assert!(found < 1.1 * without, "{name}: {found:e} and {without:e}");
        assert!(said.statuses(rows.clone()).all(|status| status == FOLLOWING), "{name}");
        assert_eq!(said.0.last().unwrap()[3], 0.0, "{name} makes it begin again");
    }
}

/// The signal is the same for the mirrored motion: the sign is kept by the state from before.
#[test]
fn a_signal_that_is_none_for_long_is_lost_and_found_again_with_its_sign() {
    let folder = tempfile::tempdir().unwrap();
    let Some(program) = program(folder.path(), "", &[]) else { return };
    let [drive, signal, angle] = recorded();
    let clean = Said::of(&program, &drive, &signal);
    for (samples, value) in [(1500, 0.0), (2000, 0.0), (3000, 0.0), (4000, 0.0), (6000, 0.0), (4000, 5.0)] {
        let mut faulty = signal.clone();
        faulty[FAULT..FAULT + samples].fill(value);
        let said = Said::of(&program, &drive, &faulty);
        let lost = (FAULT..24_000).position(|k| said.statuses(k..k + 1).any(|status| status == LOST));
        // A burst is survived for 1.34 ms.
        assert!((1300..1400).contains(&lost.unwrap()), "{lost:?}");
        let rows = 23_000..23_900;
        let [found, without] = [&said, &clean].map(|one| one.error(&angle, rows.clone()));
        println!(
            "{samples} samples of {value} V: {:.3} mrad rms at the end, {:.3} without them",
            1e3 * found,
            1e3 * without
        );
        assert!(found < 1.1 * without, "{samples} of {value}: {found:e} and {without:e}");
        // A filter that has begun again as at its start settles for 8000 samples.
        let settled = 23_850..23_900;
        assert!(said.statuses(settled).all(|status| status == FOLLOWING), "{samples} of {value}");
        assert_eq!(said.0.last().unwrap()[3], 0.0, "{samples} of {value}");
    }
}

/// Devices whose phase or parameters a start could not know.
#[test]
fn filters_of_several_examples_go_on_after_a_loss_of_their_signal() {
    for (file, filter, samples) in [
        ("tuning_fork/experiment.toml", "EKF with parameters", 2000),
        ("comb_resonator/experiment.toml", "EKF with parameters", 1600),
        ("accelerometer/experiment.toml", "EKF", 400),
    ] {
        let wanted = ExportRequest { verify: true, ..request(SourceLanguage::C, filter) };
        let mut exported = source(published(), &example(file), &wanted).unwrap();
        let trial = exported.trial.take().unwrap();
        let name = exported.files[0].0.strip_suffix(".h").unwrap().to_owned();
        let (_, main) = exported.files.iter_mut().find(|(name, _)| name == "main.c").unwrap();
        // The structure is as large as is said.
        let size = exported.cost.unwrap().bytes;
        let sized = format!("    if (sizeof filter != {size}U) {{\n        return 9;\n    }}\n    while (");
        *main = main.replace("    while (", &sized).replace("k + 1U < ", "k + 1U < 1U + ").replace(
            "    }\n    return 0;",
            &format!("        printf(\"%d\\n\", (int){name}_status(&filter, 0U));\n    }}\n    return 0;"),
        );
        let folder = tempfile::tempdir().unwrap();
        if compiled(&exported.files, folder.path(), &[]).is_none() {
            return;
        }
        let mut rows = trial.given.clone();
        let half = rows.len() / 2;
        let largest = rows.iter().fold(0.0_f64, |largest, row| largest.max(row.last().unwrap().abs()));
        rows[half..half + samples].iter_mut().for_each(|row| *row.last_mut().unwrap() = 10.0 * largest);
        let line = |row: &Vec<f64>| row.iter().map(|x| format!("{x:e}")).collect::<Vec<_>>().join(" ");
        let lines: Vec<String> = rows.iter().map(line).collect();
        let given = folder.path().join("given");
        fs::write(&given, lines.join("\n")).unwrap();
        let ran = Command::new(folder.path().join("program")).stdin(fs::File::open(given).unwrap()).output();
        let ran = ran.unwrap();
        assert!(ran.status.success(), "{file}: the size is not {size} bytes, {:?}", ran.status);
        let text = String::from_utf8(ran.stdout).unwrap();
        let said: Vec<Vec<f64>> =
            text.lines().map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect()).collect();
        let states = trial.states.len();
        assert!(said[half..half + samples].iter().any(|row| row[states] == LOST), "{file} is not lost");
        let mut worst = 0.0_f64;
        for (row, (expected, sd)) in said.iter().zip(&trial.expected).skip(said.len() - 300) {
            assert_eq!(row[states], FOLLOWING, "{file}");
            let apart = (0..states).map(|k| (row[k] - expected[k]).abs() / sd[k]);
            worst = apart.fold(worst, f64::max);
        }
        println!(
            "{file}, {filter}: {worst:.2} claimed standard deviations from the estimate without the loss"
        );
        assert!(worst < 1.5, "{file}: {worst}");
    }
}

/// Time goes on with the last drive: the motion is not mirrored by a wait.
#[test]
fn a_drive_that_is_missing_turns_no_sign_without_a_word() {
    let folder = tempfile::tempdir().unwrap();
    let Some(program) = program(folder.path(), "", &[]) else { return };
    let [drive, signal, angle] = recorded();
    let clean = Said::of(&program, &drive, &signal);
    for missing in [1, 8, 16, 24, 32, 100, 2000] {
        let mut faulty = drive.clone();
        faulty[FAULT..FAULT + missing].fill(f64::NAN);
        let said = Said::of(&program, &faulty, &signal);
        let rows = 20_000..23_900;
        let [found, without] = [&said, &clean].map(|one| one.error(&angle, rows.clone()));
        println!("{missing}: {:.3} mrad rms at the end, {:.3} without it", 1e3 * found, 1e3 * without);
        let unsure = said.statuses(rows).all(|status| status == SIGN_UNSURE);
        assert!(unsure || found < 1.1 * without, "{missing}: {found:e} and {without:e}");
        assert!(missing > 100 || !unsure, "{missing}");
    }
}

/// Whatever a filter is handed, it keeps finite states and does nothing that C leaves undefined, and follows the signal when that is good again.
#[test]
fn a_storm_of_any_numbers_leaves_a_filter_that_begins_again() {
    let folder = tempfile::tempdir().unwrap();
    let sanitised = ["-fsanitize=undefined,address", "-fno-sanitize-recover=all"];
    let Some(program) = program(folder.path(), STORM, &sanitised) else { return };
    let [drive, signal, angle] = recorded();
    let said = Said::of(&program, &drive, &signal);
    let rows = 22_000..23_900;
    let found = said.error_of_either_sign(&angle, rows.clone());
    println!("{:.3} mrad rms at the end, begun again {} times", 1e3 * found, said.0.last().unwrap()[3]);
    assert!(found < 1e-3 && said.statuses(rows).all(|status| status == SIGN_UNSURE), "{found:e}");
}
