//! A source as a project: what tools make of it.

use super::export::{example, request};
use kalmems::export::{ExportRequest, Exported, SourceLanguage};
use kalmems::rigs::published;
use kalmems::source::source;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

const SCANNER: &str = "shared_scanner/microcontroller.toml";

/// The project of a filter of the scanner below this folder, with a test of itself or without.
fn project(target: SourceLanguage, samples: usize, folder: &Path) -> Exported {
    let wanted = ExportRequest { samples, ..request(target, "EKF") };
    let exported = source(published(), &example(SCANNER), &wanted).unwrap().into_project(target).unwrap();
    for (name, text) in &exported.files {
        let place = folder.join(name);
        fs::create_dir_all(place.parent().unwrap()).unwrap();
        fs::write(&place, text).unwrap();
        let is_header = place.extension().is_some_and(|ending| ending == "h");
        assert!(!text.contains('@') || is_header, "{name}: {text}");
    }
    exported
}

/// Runs a tool in a folder; `false` where it is not installed.
fn ran(folder: &Path, tool: &str, arguments: &[&str]) -> bool {
    let Ok(ran) = Command::new(tool).args(arguments).current_dir(folder).output() else {
        println!("SKIPPED: there is no {tool}");
        return false;
    };
    let said = String::from_utf8_lossy(&ran.stdout) + String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{tool} {arguments:?}: {said}");
    true
}

#[test]
fn cmake_and_meson_build_a_project_in_c_and_run_its_test() {
    for samples in [300, 0] {
        let folder = tempfile::tempdir().unwrap();
        project(SourceLanguage::C, samples, folder.path());
        if ran(folder.path(), "cmake", &["-B", "built", "-DCMAKE_C_FLAGS=-Wall -Wextra -Wpedantic -Werror"]) {
            ran(folder.path(), "cmake", &["--build", "built"]);
            let mut test = vec!["--test-dir", "built", "--output-on-failure"];
            if samples > 0 {
                test.push("--no-tests=error");
            }
            ran(folder.path(), "ctest", &test);
        }
        if ran(folder.path(), "meson", &["setup", "--werror", "meson_built"]) {
            ran(folder.path(), "meson", &["test", "-C", "meson_built"]);
        }
    }
}

/// As another project has it: a folder below its own.
#[test]
fn a_project_in_c_is_part_of_another_one() {
    let folder = tempfile::tempdir().unwrap();
    project(SourceLanguage::C, 0, &folder.path().join("filter"));
    let main = "#include \"scanner_filter.h\"\nint main(void)\n{\n    scanner_filter_t filter;\n    scanner_filter_start(&filter);\n    return 0;\n}\n";
    fs::write(folder.path().join("main.c"), main).unwrap();
    fs::write(
        folder.path().join("CMakeLists.txt"),
        "cmake_minimum_required(VERSION 3.13)\nproject(other C)\nadd_subdirectory(filter)\nadd_executable(other main.c)\n\
         target_link_libraries(other PRIVATE kalmems_scanner_filter)\n",
    )
    .unwrap();
    if ran(folder.path(), "cmake", &["-B", "built"]) {
        ran(folder.path(), "cmake", &["--build", "built"]);
        ran(folder.path(), "./built/other", &[]);
    }
}

#[test]
fn cargo_builds_a_project_in_rust_and_runs_its_test() {
    let folder = tempfile::tempdir().unwrap();
    project(SourceLanguage::Rust, 300, folder.path());
    ran(folder.path(), "cargo", &["test", "--quiet", "--offline", "--all-targets", "--target-dir", "built"]);
    let tests = fs::read_to_string(folder.path().join("tests/self_test.rs")).unwrap();
    assert!(tests.contains("#[test]"));
}

/// A host in the place of the converter: the interrupt comes while the loop is away for longer than the ring lasts, and while it reads.
const HOST: &str = r#"
#include "scanner_filter.h"
#include <stdio.h>
void sample_arrives(const float numbers[4]);
unsigned filter_samples(scanner_filter_t *filter);
int main(void)
{
    static scanner_filter_t ringed, direct;
    unsigned k, taken = 0U, given = 0U, round;
    scanner_filter_start(&ringed);
    scanner_filter_start(&direct);
    for (round = 1U; round < 100U; round++) {
        for (k = 0U; k < round; k++) {
            const float drive = 30.0F + (float)(given % 7U);
            const float numbers[4] = {drive, drive, drive, 2.0F + 0.001F * (float)(given % 5U)};
            sample_arrives(numbers);
            given++;
        }
        taken += filter_samples(&ringed);
    }
    /* The samples that were lost last are behind the next one. */
    {
        const float numbers[4] = {30.0F, 30.0F, 30.0F, 2.0F};
        sample_arrives(numbers);
        taken += filter_samples(&ringed);
        given++;
    }
    given = 0U;
    {
        const float gap = scanner_filter_value(&direct, SCANNER_FILTER_STATES);
        for (round = 1U; round < 100U; round++) {
            for (k = 0U; k < round; k++) {
                const float drive = 30.0F + (float)(given % 7U);
                const float signal = 2.0F + 0.001F * (float)(given % 5U);
                (void)scanner_filter_step(&direct, k < 64U ? drive : gap, k < 64U ? drive : gap, k < 64U ? drive : gap, k < 64U ? signal : gap);
                given++;
            }
        }
        (void)scanner_filter_step(&direct, 30.0F, 30.0F, 30.0F, 2.0F);
        given++;
    }
    if (taken != given || ringed.missing != direct.missing) {
        return 1;
    }
    for (k = 0U; k < SCANNER_FILTER_STATES; k++) {
        if (ringed.state.mean[k] != direct.state.mean[k]) {
            return 2;
        }
    }
    return 0;
}
"#;

#[test]
fn samples_from_an_interrupt_are_those_of_the_loop_and_lost_ones_are_gaps() {
    let folder = tempfile::tempdir().unwrap();
    project(SourceLanguage::C, 0, folder.path());
    fs::write(folder.path().join("host.c"), HOST).unwrap();
    let warnings = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-Isrc"];
    let sources = ["example/interrupt.c", "src/scanner_filter.c"];
    let host = [&warnings[..], &["-DWITHOUT_MAIN", "-o", "host", "host.c"], &sources].concat();
    if ran(folder.path(), "gcc", &host) {
        ran(folder.path(), "./host", &[]);
    }
    for processor in ["cortex-m0plus", "cortex-m4"] {
        let processor = format!("-mcpu={processor}");
        let target = ["-ffreestanding", &processor, "-mthumb", "-c", "-o", "object.o", sources[0]];
        ran(folder.path(), "arm-none-eabi-gcc", &[&warnings[..], &target].concat());
    }
}

/// Builds a unit of FMI, checks its description, and simulates it over samples of time, drive and signal; without FMPy it says that it is skipped.
const SIMULATE: &str = r#"
import os
import shutil
import sys
try:
    import fmpy
    from fmpy.build import build_platform_binary
    import numpy
except ImportError:
    print("SKIPPED: there is no FMPy")
    sys.exit(0)
build_platform_binary(os.path.abspath("fmu"), all_warnings=True)
unit = shutil.make_archive("unit", "zip", "fmu")
description = fmpy.read_model_description(unit, validate=True)
samples = numpy.genfromtxt("samples", dtype=[("time", "f8"), ("u_drive", "f8"), ("y_signal", "f8")])
interval = float(description.coSimulation.fixedInternalStepSize)
outputs = [v.name for v in description.modelVariables if v.causality == "output"]
assert outputs == ["angle_rad", "rate_rad_per_s", "angle_rad_variance", "rate_rad_per_s_variance", "signal_status"], outputs
found = fmpy.simulate_fmu(unit, stop_time=len(samples) * interval, step_size=interval, output_interval=interval, input=samples, output=outputs)
for row in list(found)[1:]:
    print(repr(float(row["angle_rad"])), repr(float(row["angle_rad_variance"])), int(row["signal_status"]))
"#;

/// Samples of the recording in a unit of FMI and in the filter itself.
#[test]
fn a_unit_of_fmi_is_the_filter() {
    let folder = tempfile::tempdir().unwrap();
    project(SourceLanguage::C, 0, folder.path());
    let recording = example(SCANNER).resolve("recording.csv".as_ref());
    let text = fs::read_to_string(recording).unwrap();
    let rows: Vec<[f64; 2]> = (text.lines().skip(1).take(300))
        .map(|line| {
            let numbers: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            [numbers[1], numbers[2]]
        })
        .collect();
    let mut samples = String::new();
    let mut given = String::new();
    for (k, [drive, signal]) in rows.iter().enumerate() {
        let before = rows[k.saturating_sub(1)][0];
        writeln!(samples, "{:e} {drive:e} {signal:e}", 1e-6 * k as f64).unwrap();
        writeln!(given, "{before:e} {:e} {drive:e} {signal:e}", 0.5 * (before + drive)).unwrap();
    }
    fs::write(folder.path().join("samples"), samples).unwrap();
    fs::write(folder.path().join("simulate.py"), SIMULATE).unwrap();
    let Ok(simulated) = Command::new("python3").arg("simulate.py").current_dir(folder.path()).output() else {
        return println!("SKIPPED: there is no python3");
    };
    let said = String::from_utf8(simulated.stdout).unwrap();
    assert!(simulated.status.success(), "{said} {}", String::from_utf8_lossy(&simulated.stderr));
    if said.contains("SKIPPED") {
        return println!("{said}");
    }
    // Lines of the tools are none of numbers.
    let said: Vec<Vec<f64>> =
        said.lines().filter_map(|line| line.split(' ').map(|word| word.parse().ok()).collect()).collect();
    assert!(ran(
        folder.path(),
        "gcc",
        &["-O2", "-Isrc", "-o", "run", "example/main.c", "src/scanner_filter.c"]
    ));
    fs::write(folder.path().join("given"), given).unwrap();
    let given = fs::File::open(folder.path().join("given")).unwrap();
    let direct = Command::new(folder.path().join("run")).stdin(given).output().unwrap();
    let direct = String::from_utf8(direct.stdout).unwrap();
    let angles: Vec<f64> =
        direct.lines().map(|line| line.split(' ').next().unwrap().parse().unwrap()).collect();
    assert_eq!((said.len(), angles.len()), (rows.len(), rows.len()));
    let size = angles.iter().fold(0.0_f64, |size, angle| size.max(angle.abs()));
    for (found, angle) in said.iter().zip(&angles) {
        // The drive of the unit has passed through an interpolation.
        assert!((found[0] - angle).abs() < 1e-6 * size, "{found:?} and {angle}");
        assert!(found[1] > 0.0 && found[2] == 0.0, "{found:?}");
    }
}

#[test]
fn a_source_with_a_detector_has_no_project() {
    let wanted = request(SourceLanguage::C, "Hybrid");
    let exported = source(published(), &example("threshold_scanner/as_published.toml"), &wanted).unwrap();
    let refused = exported.into_project(SourceLanguage::C).unwrap_err().to_string();
    assert!(refused.contains("leave `--project` out"), "{refused}");
}
