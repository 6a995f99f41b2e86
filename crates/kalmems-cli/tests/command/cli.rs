//! The program as a user meets it: exit codes, messages, files.

use kalmems::rigs::published;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn kalmems() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kalmems"));
    command.current_dir(root());
    command
}

fn run(arguments: &[&str]) -> Output {
    kalmems().args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

const EXAMPLE: &str = "examples/shared_scanner/experiment.toml";
const TRUE: &str = "examples/shared_scanner/true_stiffness.toml";

/// Every file below a folder, by its name there.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
                found.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    found
}

#[test]
fn the_same_command_twice_writes_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let results = ["a", "b"].map(|name| {
        let out = folder.path().join(name);
        let output = run(&["estimate", EXAMPLE, "--out", out.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let mut files = files(&out);
        // Dates and durations are in one table of one file.
        let run = text(&files["run.toml"]);
        let start = run.find("[timing]").unwrap();
        let end = run.find("[[input]]").unwrap();
        files.insert("run.toml".to_owned(), format!("{}{}", &run[..start], &run[end..]).into_bytes());
        files
    });
    let names: Vec<&String> = results[0].keys().collect();
    assert!(names.iter().any(|name| *name == "report.html") && names.len() == 11, "{names:?}");
    assert_eq!(results[0].keys().collect::<Vec<_>>(), results[1].keys().collect::<Vec<_>>());
    for (name, bytes) in &results[0] {
        assert!(bytes == &results[1][name], "{name} differs");
    }
}

/// Every command ends in a page of the same build, which begins with a verdict.
#[test]
fn pages_of_commands_without_a_folder_are_written_and_compared_runs_stand_in_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let page = |name: &str, arguments: &[&str]| {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let html = std::fs::read_to_string(path(name)).unwrap();
        assert!(html.contains("id=\"figure-data\"") && html.contains("How it was made"), "{name}");
        html
    };
    let recording = "examples/shared_scanner/recording.csv";
    let html = page("inspect.html", &["inspect", recording, "--report", &path("inspect.html")]);
    assert!(html.contains("can be used as it is"));
    for (name, experiment) in [("a", EXAMPLE), ("b", TRUE)] {
        assert_eq!(run(&["estimate", experiment, "--out", &path(name)]).status.code(), Some(0));
    }
    let compare = ["compare", &path("a"), &path("b"), "--report", &path("compare.html")];
    let html = page("compare.html", &compare);
    for part in [
        "<td role=\"cell\" data-head=\"run\" class=\"text\">a</td>",
        "doubtful",
        "a: ekf",
        "b: ekf",
        "kalmems help overconfident",
    ] {
        assert!(html.contains(part), "{part}");
    }
    // It is replaced by another one, and a stranger's file is not.
    assert_eq!(page("compare.html", &compare), html);
    std::fs::write(path("compare.html"), "mine").unwrap();
    assert_eq!(run(&compare).status.code(), Some(1));
    let refused = run(&["compare", &path("a"), "examples/shared_scanner", "--report", &path("c.html")]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).contains("expected the folder of a result"), "{}", text(&refused.stderr));
}

#[test]
fn the_readme_shows_what_the_command_prints() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let output = run(&["estimate", EXAMPLE, "--out", out.to_str().unwrap()]);
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let printed = text(&output.stdout);
    let (answer, table) = printed.split_once("\n\n").unwrap();
    assert!(readme.contains(answer), "not in README.md: {answer}");
    // All but the last column, the time per step.
    for line in table.lines().take_while(|line| !line.is_empty()) {
        let (kept, _) = line.trim_end().rsplit_once("  ").unwrap();
        assert!(readme.contains(kept.trim_end()), "not in README.md: {kept}");
    }
}

#[test]
fn strict_reports_a_doubtful_filter_by_its_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    let output = run(&["estimate", EXAMPLE, "--strict", "--out", out]);
    assert_eq!(output.status.code(), Some(3));
    assert!(text(&output.stderr).contains("the verdict is `doubtful` or worse for: EKF, UKF"));
    // With the true stiffness and as much process noise as there is, which is none.
    let toml = std::fs::read_to_string(root().join(TRUE)).unwrap().replace("1e8 rad^2/s^3", "1e4 rad^2/s^3");
    let path = folder.path().join("experiment.toml");
    let toml =
        toml.replace("file = \"", &format!("file = \"{}/", root().join("examples/shared_scanner").display()));
    std::fs::write(&path, toml).unwrap();
    let fine = folder.path().join("fine");
    let output = run(&["estimate", path.to_str().unwrap(), "--strict", "--out", fine.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
}

#[test]
fn json_is_what_the_metrics_file_has() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let output = run(&["estimate", EXAMPLE, "--json", "--out", out.to_str().unwrap()]);
    assert_eq!(output.stdout, std::fs::read(out.join("metrics.json")).unwrap());
    let metrics: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(metrics["recordings"][0]["segments"][0]["estimators"][1]["key"], "ekf");
}

#[test]
fn usage_is_2_and_help_is_0() {
    assert_eq!(run(&["estimate"]).status.code(), Some(2));
    assert_eq!(run(&["guess"]).status.code(), Some(2));
    assert_eq!(run(&["--help"]).status.code(), Some(0));
    assert_eq!(run(&["--version"]).status.code(), Some(0));
}

#[test]
fn a_schema_is_json_and_of_what_is_asked_for() {
    for (asked, key) in [
        (&["schema"][..], "device"),
        (&["schema", "experiment"], "device"),
        (&["schema", "study"], "vary"),
        (&["schema", "image"], "intensity"),
        (&["schema", "gyro"], "gyroscope"),
    ] {
        let output = run(asked);
        let schema: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(schema["properties"][key].is_object(), "{asked:?}");
    }
    assert_eq!(run(&["schema"]).stdout, run(&["schema", "experiment"]).stdout);
    assert_eq!(run(&["schema", "recording"]).status.code(), Some(2));
}

/// What the circuit is to a filter stands in the outlook as words and as numbers.
#[test]
fn inspect_reports_the_error_without_poles_and_delay() {
    const CIRCUIT: &str = "examples/shared_scanner/circuit.toml";
    let output = run(&["inspect", CIRCUIT]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let words = text(&output.stdout);
    assert!(words.contains("What a filter has to know of the circuit"), "{words}");
    assert!(words.contains("Poles and delay are needed (0.38° permitted)"), "{words}");
    let output = run(&["inspect", CIRCUIT, "--json"]);
    let outlook: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let facts = outlook["topics"].as_array().unwrap().iter().flat_map(|t| t["facts"].as_array().unwrap());
    let facts: Vec<_> = facts.collect();
    let first = |name: &str| {
        let fact = facts.iter().find(|f| f["name"] == name).unwrap_or_else(|| panic!("{name} is missing"));
        fact["values"][0].as_f64().unwrap()
    };
    let costs = ["cost_of_affine_deg", "cost_of_poles_deg", "cost_of_poles_and_delay_deg"].map(first);
    assert!(costs[0] > 1.0 && costs[1] < costs[0] && costs[1] > 0.38 && costs[2].abs() < 0.05, "{costs:?}");
    // A device without a circuit says nothing of one.
    let plain = run(&["inspect", "examples/shared_scanner/simulation.toml"]);
    assert!(!text(&plain.stdout).contains("know of the circuit"));
}

/// The example with its text changed, in a folder of its own; the message and what is left there.
fn broken(change: impl Fn(&mut String, &mut String)) -> (Option<i32>, String, Vec<String>) {
    let (output, left) = with_changes(change);
    assert!(output.stdout.is_empty(), "{}", text(&output.stdout));
    (output.status.code(), text(&output.stderr), left)
}

/// What the program says of the example with its text changed, and what it leaves in its folder.
fn with_changes(change: impl Fn(&mut String, &mut String)) -> (Output, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let source = root().join("examples/shared_scanner");
    let mut toml = std::fs::read_to_string(source.join("experiment.toml")).unwrap();
    let mut csv: String = std::fs::read_to_string(source.join("recording.csv")).unwrap();
    change(&mut toml, &mut csv);
    std::fs::write(folder.path().join("experiment.toml"), toml).unwrap();
    std::fs::write(folder.path().join("recording.csv"), csv).unwrap();
    std::fs::copy(source.join("reference.csv"), folder.path().join("reference.csv")).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_kalmems"))
        .current_dir(folder.path())
        .args(["estimate", "experiment.toml", "--out", "results"])
        .output()
        .unwrap();
    let mut left: Vec<String> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .filter(|name| !["experiment.toml", "recording.csv", "reference.csv"].contains(&name.as_str()))
        .collect();
    left.sort();
    (output, left)
}

/// Replaces the cell in a column of a row, counted from 1 below the header.
fn cell(csv: &mut String, row: usize, column: usize, value: &str) {
    let mut lines: Vec<String> = csv.lines().map(str::to_owned).collect();
    let mut cells: Vec<&str> = lines[row].split(',').collect();
    cells[column] = value;
    lines[row] = cells.join(",");
    *csv = lines.join("\n") + "\n";
}

#[test]
fn bad_input_is_named_and_leaves_nothing() {
    type Change = fn(&mut String, &mut String);
    let cases: [(&str, Change); 22] = [
        ("an unknown key", |toml, _| *toml = toml.replace("stiffness =", "stifness =")),
        ("a wrong dimension", |toml, _| *toml = toml.replace("5.71 pF", "5.71 pV")),
        ("a start at zero", |toml, _| *toml = toml.replace("0.05 rad\"", "0 rad\"")),
        ("an unknown state", |toml, _| *toml = toml.replace("start_sd = { angle", "start_sd = { angel")),
        ("a missing recording", |toml, _| *toml = toml.replace("\"recording.csv\"", "\"recordin.csv\"")),
        ("a missing reference", |toml, _| *toml = toml.replace("\"reference.csv\"", "\"referenc.csv\"")),
        ("a missing column", |toml, _| *toml = toml.replace("\"cap_V\"", "\"cap_v\"")),
        ("a device without a rig", |toml, _| {
            let start = toml.find("[device").unwrap();
            let end = toml.find("[[recording]]").unwrap();
            let other = "[device.piston_mirror]\n";
            *toml = format!("{}{other}{}", &toml[..start], &toml[end..]);
        }),
        ("a time for a voltage", |toml, _| *toml = toml.replace("\"drive_V\"", "\"time_s\"")),
        ("a rate for an angle", |toml, _| *toml = toml.replace("\"angle_rad\"", "\"rate_rad_per_s\"")),
        ("text for a number", |_, csv| cell(csv, 9000, 2, "unplugged")),
        ("time that stands still", |_, csv| cell(csv, 9000, 0, "0.008998")),
        ("times in no order", |_, csv| {
            let mut lines: Vec<&str> = csv.lines().collect();
            lines[1..].reverse();
            *csv = lines.join("\n") + "\n";
        }),
        ("a row without time", |_, csv| cell(csv, 9000, 0, "")),
        ("an unknown unit", |toml, csv| {
            *toml = toml.replace("\"cap_V\"", "\"cap_vlt\"");
            *csv = csv.replace("cap_V", "cap_vlt");
        }),
        ("a name that comes twice", |_, csv| {
            *csv = csv.replace("time_s,drive_V,cap_V", "time_s,drive_V,drive_V");
        }),
        ("another separator", |_, csv| *csv = csv.replace(',', "/")),
        ("a segment that comes back", |toml, csv| {
            *toml = toml.replace("clock = {", "segments = { column = \"record\" }\nclock = {");
            let label = |row: usize| ["record", "a", "b", "a"][usize::from(row > 0) + row / 10_000];
            let lines: Vec<String> =
                csv.lines().enumerate().map(|(row, line)| format!("{},{line}", label(row))).collect();
            *csv = lines.join("\n");
        }),
        ("saturation", |_, csv| {
            let clipped = |line: &str| match line.rsplit_once(',') {
                Some((rest, cap)) if cap.parse().is_ok_and(|cap: f64| cap > 1.5) => format!("{rest},1.5\n"),
                _ => format!("{line}\n"),
            };
            *csv = csv.lines().map(clipped).collect();
        }),
        ("a row too short", |_, csv| *csv = csv.replacen("0.000007,", "", 1)),
        ("an empty file", |_, csv| csv.clear()),
        ("a header alone", |_, csv| *csv = "time_s,drive_V,cap_V\n".to_owned()),
    ];
    let mut report = String::new();
    for (name, change) in cases {
        let (code, message, left) = broken(change);
        assert_eq!((code, left.as_slice()), (Some(1), &[][..]), "{name}: {message}");
        report += &format!("## {name}\n{message}\n");
    }
    insta::assert_snapshot!(report);
}

#[test]
fn what_can_be_used_all_the_same_is_noted() {
    type Change = fn(&mut String);
    let cases: [(&str, Change); 7] = [
        ("time that goes back", |csv| cell(csv, 9000, 0, "0.001")),
        ("a missing cell", |csv| cell(csv, 9000, 2, "")),
        ("not a number", |csv| cell(csv, 9000, 2, "NaN")),
        ("infinite", |csv| cell(csv, 9000, 2, "-inf")),
        ("a gap", |csv| {
            let kept = csv.lines().enumerate().filter(|(row, _)| !(9000..9004).contains(row));
            *csv = kept.map(|(_, line)| line).collect::<Vec<_>>().join("\n");
        }),
        ("irregular time", |csv| cell(csv, 9000, 0, "0.0089993")),
        ("a blank line", |csv| *csv = csv.replacen("0.000009,", "\n0.000009,", 1)),
    ];
    let mut report = String::new();
    for (name, change) in cases {
        let (output, left) = with_changes(|_, csv| change(csv));
        assert_eq!((output.status.code(), left), (Some(0), vec!["results".to_owned()]), "{name}");
        let said = text(&output.stdout);
        let notes: Vec<&str> =
            said.lines().filter(|l| l.contains("recording.csv: line") || l.contains("KF: ")).collect();
        report += &format!("## {name}\n{}\n\n", notes.join("\n"));
    }
    insta::assert_snapshot!(report);
}

#[test]
fn every_broken_experiment_file_ends_with_1_and_writes_nothing() {
    let folder = root().join("crates/kalmems/tests/experiments/broken");
    let mut count = 0;
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let work = tempfile::tempdir().unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_kalmems"))
            .current_dir(work.path())
            .arg("estimate")
            .arg(&path)
            .output()
            .unwrap();
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{}: {message}", path.display());
        assert!(message.starts_with(&format!("error: {}", path.display())), "{message}");
        assert_eq!(std::fs::read_dir(work.path()).unwrap().count(), 0);
        count += 1;
    }
    assert!(count >= 20, "{count}");
}

#[test]
fn a_result_of_another_input_is_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    assert_eq!(run(&["estimate", EXAMPLE, "--out", out]).status.code(), Some(0));
    assert_eq!(run(&["estimate", EXAMPLE, "--out", out]).status.code(), Some(0));
    let output = run(&["estimate", TRUE, "--out", out]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("--force"), "{}", text(&output.stderr));
    assert_eq!(run(&["estimate", TRUE, "--out", out, "--force"]).status.code(), Some(0));
    assert!(Path::new(&format!("{out}.previous/report.html")).exists());
    let output = run(&["estimate", TRUE, "--out", folder.path().to_str().unwrap(), "--force"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("holds `out`"), "{}", text(&output.stderr));
}

#[test]
fn inspect_describes_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let svg = folder.path().join("channels.svg");
    let recording = "examples/shared_scanner/recording.csv";
    let output = run(&["inspect", recording, "--svg", svg.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    insta::assert_snapshot!(text(&output.stdout));
    assert!(std::fs::read_to_string(&svg).unwrap().starts_with("<svg"));
    let output = run(&["inspect", recording, "--json"]);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["rows"], 24_001);
    // At this one the library that reads it panics, which is told as what it is.
    let output = run(&["inspect", "crates/kalmems-formats/tests/fixtures/dictionary.parquet"]);
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("damaged Parquet at column") && !said.contains("panicked"), "{said}");

    let output = run(&["inspect", "nowhere.csv"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("nowhere.csv"));
}

/// 300 MB that are never in a file, and that never fit the memory that may be used.
#[test]
#[ignore = "slow"]
#[cfg(target_os = "linux")]
fn slow_a_long_pipe_is_inspected_in_bounded_memory() {
    use std::io::Write as _;
    let mut child = kalmems()
        .args(["inspect", "/dev/stdin"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut pipe = child.stdin.take().unwrap();
    pipe.write_all(b"time_s,drive_V,cap_V\n").unwrap();
    let mut written = 0;
    let mut rows = 0_u32;
    while written < 300_000_000 {
        let mut text = String::new();
        for k in rows..rows + 10_000 {
            let time = f64::from(k) * 1e-6;
            let drive = 90.0 * (f64::from(k) * 0.19).sin();
            text += &format!("{time},{drive},{}\n", drive * drive / 4096.0);
        }
        rows += 10_000;
        written += text.len();
        pipe.write_all(text.as_bytes()).unwrap();
    }
    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap();
    drop(pipe);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stdout).contains(&format!("{rows} rows")), "{}", text(&output.stdout));
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    let kilobytes: u64 = peak.trim().trim_end_matches(" kB").parse().unwrap();
    println!("peak of {kilobytes} kB");
    assert!(kilobytes <= 100_000, "{peak}");
}

#[test]
fn inspect_predicts_the_motion_of_a_device() {
    let folder = tempfile::tempdir().unwrap();
    let toml = std::fs::read_to_string(root().join("examples/shared_scanner/simulation.toml")).unwrap();
    let path = folder.path().join("weak.toml");
    std::fs::write(&path, toml.replace("\"90 V\"", "\"30 V\"")).unwrap();
    let path = path.to_str().unwrap();
    let outputs = ["a", "b"].map(|name| {
        let out = folder.path().join(name);
        let output = run(&["inspect", path, "--json", "--out", out.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert_eq!(output.stdout, std::fs::read(out.join("outlook.json")).unwrap());
        assert!(text(&std::fs::read(out.join("outlook.txt")).unwrap()).contains("4.5 times below threshold"));
        let mut files = files(&out);
        files.remove("run.toml");
        files
    });
    let names: Vec<&String> = outputs[0].keys().collect();
    assert!(names.contains(&&"figures/stability.svg".to_owned()), "{names:?}");
    assert_eq!(outputs[0], outputs[1]);
    // Of a recording there is one picture, and no folder.
    let output = run(&["inspect", "examples/shared_scanner/recording.csv", "--out", "x"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("--svg"));
}

/// A recording long enough to be interrupted while it is worked on.
#[cfg(unix)]
#[test]
fn an_interruption_leaves_nothing_behind() {
    use std::io::Write;
    let folder = tempfile::tempdir().unwrap();
    let source = root().join("examples/shared_scanner");
    let toml = std::fs::read_to_string(source.join("experiment.toml")).unwrap();
    let start = toml.find("[recording.reference]").unwrap();
    let end = toml.find("[estimate]").unwrap();
    let toml = format!("{}{}", &toml[..start], &toml[end..]);
    let toml = toml.replace("clock = {", "segments = { column = \"record\" }\nclock = {");
    std::fs::write(folder.path().join("experiment.toml"), toml).unwrap();
    let rows = std::fs::read_to_string(source.join("recording.csv")).unwrap();
    let mut file =
        std::io::BufWriter::new(std::fs::File::create(folder.path().join("recording.csv")).unwrap());
    writeln!(file, "record,time_s,drive_V,cap_V").unwrap();
    for record in 0..80 {
        for line in rows.lines().skip(1) {
            writeln!(file, "{record},{line}").unwrap();
        }
    }
    file.flush().unwrap();
    for wait_ms in [0, 300, 1000] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_kalmems"))
            .current_dir(folder.path())
            .args(["estimate", "experiment.toml", "--out", "results"])
            .stderr(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        // Until there is something that could be left behind, which takes longer on a busy machine.
        let since = std::time::Instant::now();
        while std::fs::read_dir(folder.path()).unwrap().count() < 3 && since.elapsed().as_secs() < 60 {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        std::thread::sleep(std::time::Duration::from_millis(wait_ms));
        // The impatient press twice, both by one process, so that a busy machine does not make two requests of them. It may have ended by the second.
        let twice = format!("kill -INT {0} && {{ kill -INT {0}; true; }}", child.id());
        let interrupted = Command::new("sh").args(["-c", &twice]).stderr(Stdio::null()).status().unwrap();
        assert!(interrupted.success(), "it had ended before it was interrupted");
        let status = child.wait().unwrap();
        assert_eq!(status.code(), Some(130));
        let mut left: Vec<_> =
            std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["experiment.toml", "recording.csv"]);
    }
}

const SIMULATION: &str = "examples/shared_scanner/simulation.toml";

/// The example with its text changed, simulated in a folder of its own.
fn simulated(change: impl Fn(&mut String), arguments: &[&str]) -> (Output, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let mut toml = std::fs::read_to_string(root().join(SIMULATION)).unwrap();
    change(&mut toml);
    std::fs::write(folder.path().join("experiment.toml"), toml).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_kalmems"))
        .current_dir(folder.path())
        .args(["simulate", "experiment.toml", "--out", "result"])
        .args(arguments)
        .output()
        .unwrap();
    (output, folder)
}

#[test]
fn a_simulation_is_the_same_bytes_and_can_be_estimated() {
    let short = |toml: &mut String| *toml = toml.replace("60 ms", "2 ms");
    let written = |arguments: &[&str]| {
        let (output, folder) = simulated(short, arguments);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let mut files = files(&folder.path().join("result"));
        let run = text(&files["run.toml"]);
        let (start, end) = (run.find("[timing]").unwrap(), run.find("[experiment]").unwrap());
        files.insert("run.toml".to_owned(), format!("{}{}", &run[..start], &run[end..]).into_bytes());
        files
    };
    let (first, again, other) = (written(&[]), written(&[]), written(&["--seed", "2"]));
    assert_eq!(
        first.keys().collect::<Vec<_>>(),
        ["experiment.toml", "manifest.toml", "recording.csv", "reference.csv", "report.html", "run.toml"]
    );
    for (name, bytes) in &first {
        assert!(bytes == &again[name], "{name} differs");
        let of_noise = ["manifest.toml", "recording.csv", "report.html", "run.toml"].contains(&name.as_str());
        assert_eq!(bytes == &other[name], !of_noise, "{name}");
    }
    assert!(text(&other["run.toml"]).contains("seed = 2"));

    // The whole example; the estimate takes what was written as it is.
    let folder = tempfile::tempdir().unwrap();
    let [there, estimate] = ["simulation", "estimate"].map(|name| folder.path().join(name));
    let output = run(&["simulate", SIMULATION, "--out", there.to_str().unwrap()]);
    insta::assert_snapshot!(text(&output.stdout));
    let experiment = there.join("experiment.toml");
    let arguments = ["estimate", experiment.to_str().unwrap(), "--out", estimate.to_str().unwrap(), "--json"];
    let output = run(&arguments);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let metrics: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let ekf = &metrics["recordings"][0]["segments"][0]["estimators"][0];
    // White noise of the stated variance on the model itself: the filter cannot but be consistent.
    assert_eq!(ekf["verdict"], "consistent", "{ekf}");
}

#[test]
fn inspect_reports_a_device_that_cannot_oscillate() {
    let published = |toml: &mut String| *toml = toml.replace("90 V", "30 V").replace("60 ms", "2 ms");
    let (output, _folder) = simulated(published, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let expected = "cannot oscillate at this drive: the pump depth is 4.5 times below threshold\n";
    assert!(text(&output.stdout).starts_with(expected), "{}", text(&output.stdout));
}

#[test]
fn a_simulation_that_cannot_be_made_is_named_and_leaves_nothing() {
    type Change = fn(&mut String);
    let from = |toml: &str| toml.find("[simulate.drive").unwrap()..toml.find("# For `kalmems").unwrap();
    let recorded =
        "[simulate.drive.recorded]\nfile = \"drive.csv\"\nclock = { column = \"time_s\" }\ncolumn = ";
    let cases: [(&str, Change); 6] = [
        ("no simulation", |toml| *toml = std::fs::read_to_string(root().join(EXAMPLE)).unwrap()),
        ("a start at zero", |toml| {
            *toml = toml.replace("\"1e-4 rad\", rate = \"0 rad/s\" } #", "\"0 rad\", rate = \"0 rad/s\" } #");
        }),
        ("an unknown state", |toml| {
            *toml = toml.replace(
                "start = { angle = \"1e-4 rad\", rate = \"0 rad/s\" } #",
                "start = { angel = \"1e-4 rad\" } #",
            );
        }),
        ("a carrier in a computed drive", |toml| {
            *toml = toml.replace("included_in_drive = false", "included_in_drive = true");
        }),
        ("a device that explodes", |toml| {
            *toml = toml.replace("10 MHz", "20 kHz").replace("1 MHz", "20 kHz");
        }),
        ("uneven rates", |toml| *toml = toml.replace("10 MHz", "10.5 MHz")),
    ];
    let mut report = String::new();
    let mut note = |name: &str, output: &Output, folder: &Path| {
        assert_eq!(output.status.code(), Some(1), "{name}: {}", text(&output.stderr));
        assert!(!folder.join("result").exists() && output.stdout.is_empty(), "{name}");
        report += &format!("## {name}\n{}\n", text(&output.stderr));
    };
    for (name, change) in cases {
        let (output, folder) = simulated(change, &[]);
        note(name, &output, folder.path());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "{name}");
    }
    for (name, drive) in [
        ("a drive too short", "time_s,drive_V\n0,90\n0.001,90\n0.002,90\n"),
        ("a drive with a hole", "time_s,drive_V\n0,90\n0.03,\n0.06,90\n"),
        ("a drive that is a time", "time_s,drive_s\n0,90\n0.03,90\n0.06,90\n"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let mut toml = std::fs::read_to_string(root().join(SIMULATION)).unwrap();
        let column = drive.split(['\n', ',']).nth(1).unwrap();
        toml.replace_range(from(&toml), &format!("{recorded}\"{column}\"\n"));
        std::fs::write(folder.path().join("experiment.toml"), toml).unwrap();
        std::fs::write(folder.path().join("drive.csv"), drive).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_kalmems"))
            .current_dir(folder.path())
            .args(["simulate", "experiment.toml", "--out", "result"])
            .output()
            .unwrap();
        note(name, &output, folder.path());
    }
    insta::assert_snapshot!(report);
}

/// The drive of a simulation, recorded at 1 MHz and simulated again, moves the mirror as the sine itself did.
#[test]
fn a_recorded_drive_moves_the_device_as_its_sine_did() {
    let short =
        |toml: &mut String| *toml = toml.replace("60 ms", "2 ms").replace("\"1e-4 rad\"", "\"0.15 rad\"");
    let (output, first) = simulated(short, &[]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let (output, second) = simulated(
        |toml| {
            short(toml);
            let range = toml.find("[simulate.drive").unwrap()..toml.find("# For `kalmems").unwrap();
            let file = first.path().join("result/recording.csv");
            let drive = format!(
                "[simulate.drive.recorded]\nfile = \"{}\"\nclock = {{ column = \"time_s\" }}\ncolumn = \"drive_V\"\n",
                file.display()
            );
            toml.replace_range(range, &drive);
        },
        &[],
    );
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let angles = |folder: &tempfile::TempDir| -> Vec<f64> {
        let csv = std::fs::read_to_string(folder.path().join("result/reference.csv")).unwrap();
        csv.lines().skip(1).map(|line| line.split(',').nth(1).unwrap().parse().unwrap()).collect()
    };
    let (sine, recorded) = (angles(&first), angles(&second));
    assert_eq!((sine.len(), recorded.len()), (2001, 2001));
    let worst = sine.iter().zip(&recorded).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // The cubic is off by 5 mV between samples of 180 V.
    assert!(worst > 0.0 && worst.to_degrees() < 0.001, "{}", worst.to_degrees());
}

#[cfg(feature = "papers")]
#[test]
fn reproduce_computes_what_is_asked_for_and_names_what_there_is() {
    let work = tempfile::tempdir().unwrap();
    let out = work.path().join("out");
    let only =
        |label: &str| run(&["reproduce", "shared_scanner", "--only", label, "--out", out.to_str().unwrap()]);
    let output = only("Equation 79");
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(
        text(&output.stdout).contains("does not reproduce; two sampling intervals"),
        "{}",
        text(&output.stdout)
    );
    let names: Vec<String> = files(&out).into_keys().collect();
    assert_eq!(
        names,
        ["manifest.toml", "report.html", "reproduction.json", "run.toml", "tables/target-sampling.csv"]
    );
    let output = only("Table IX");
    assert_eq!(output.status.code(), Some(1));
    assert!(
        text(&output.stderr).contains("`Table IX` is not among what is reproduced; there is: S Equation 7")
    );
    let output = run(&["reproduce", "gyroscope"]);
    assert_eq!(output.status.code(), Some(1));
    let said = text(&output.stderr);
    assert!(said.contains("nothing is published of a rig `gyroscope`; there is: "), "{said}");
    let rigs = ["accelerometer", "micro_stage", "piston_mirror", "shared_scanner", "threshold_scanner"];
    assert!(rigs.iter().all(|rig| said.contains(rig)), "{said}");
}

const RING_DOWN: &str = "examples/shared_scanner/ring_down.toml";

/// The example from end to end: what was simulated is found within its intervals, what cannot be found is named, the
/// experiment that is written can be estimated, and the same command gives the same bytes.
#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_parameters_are_identified_and_used() {
    let folder = tempfile::tempdir().unwrap();
    let identified = ["a", "b"].map(|name| {
        let out = folder.path().join(name);
        let output = run(&["identify", RING_DOWN, "--json", "--out", out.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let mut files = files(&out);
        let run = text(&files.remove("run.toml").unwrap());
        assert!(run.contains("command = \"identify\"") && run.contains("sha256"));
        (text(&output.stdout), files)
    });
    assert_eq!(identified[0], identified[1]);
    let (json, files) = &identified[0];
    assert_eq!(json.as_bytes(), &files["identification.json"]);
    for figure in ["ring_down_fit", "ring_down_residuals", "capacitance_profile", "circuit_gain", "noise"] {
        assert!(files.contains_key(&format!("figures/{figure}.svg")), "{figure}");
    }
    let json: serde_json::Value = serde_json::from_str(json).unwrap();
    let truth = [
        ("stiffness k", 1.10e-4),
        ("damping b", 5.95e-12),
        ("nominal capacitance C0", 5.71e-12),
        ("angular width theta0", 0.2),
        ("circuit gain a", -0.3574e12),
        ("circuit offset b", 6.3945),
        ("noise variance R", 1.92e-4),
    ];
    for (name, value) in truth {
        let found = json["parameters"].as_array().unwrap().iter().find(|p| p["name"] == name).unwrap();
        let number = |key: &str| found[key].as_f64().unwrap();
        let errors = (number("value") - value) / number("standard_error");
        assert!(errors.abs() < 4.0, "{name} is {errors} standard errors off");
        assert!(number("standard_error") < 0.1 * value.abs(), "{name}");
    }
    for what in ["bias capacitance C_b", "inertia J", "a, b and C_b apart"] {
        assert!(json["undetermined"].as_array().unwrap().iter().any(|u| u["what"] == what), "{what}");
    }
    // What is written can be estimated. The noise was identified from few samples: the mean NIS is off by as much as
    // the variance is, beside its own spread of √(2/16 000).
    let variance =
        json["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "noise variance R").unwrap();
    let doubt = variance["standard_error"].as_f64().unwrap() / variance["value"].as_f64().unwrap();
    let estimated = |experiment: &str, code: i32| {
        let out = folder.path().join("estimate");
        let output = run(&["estimate", experiment, "--json", "--force", "--out", out.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(code), "{}", text(&output.stderr));
        let metrics: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let ekf = &metrics["recordings"][0]["segments"][0]["estimators"][0];
        [&ekf["errors"]["angle"]["rmse_deg"], &ekf["consistency"]["mean_nis"]].map(serde_json::Value::as_f64)
    };
    // As believed the filter loses the signal and does not find it again: there is no estimate that could have an error.
    assert_eq!(estimated(RING_DOWN, 1)[0], None);
    let identified = estimated(folder.path().join("a/experiment.toml").to_str().unwrap(), 0);
    let [after, mean_nis] = identified.map(Option::unwrap);
    println!("angle RMSE {after:.4} deg as identified, mean NIS {mean_nis:.3}");
    assert!(after < 0.02, "{after}");
    assert!((mean_nis - 1.0).abs() < 4.0 * doubt.hypot((2.0 / 16_000_f64).sqrt()), "{mean_nis} {doubt}");
}

/// What is missing, or double, is named with its key, and nothing is written.
#[test]
fn an_identification_that_cannot_be_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let source = std::fs::read_to_string(root().join(RING_DOWN)).unwrap();
    let examples = root().join("examples/shared_scanner");
    let attempt = |change: &dyn Fn(&str) -> String| {
        let file = folder.path().join("experiment.toml");
        let absolute = |name: &str| format!("file = \"{}/{name}", examples.display());
        let placed = change(&source.replace("file = \"", &absolute("")));
        std::fs::write(&file, placed).unwrap();
        let out = folder.path().join("out");
        let output = run(&["identify", file.to_str().unwrap(), "--out", out.to_str().unwrap()]);
        assert!(!out.exists());
        assert_eq!(output.status.code(), Some(1));
        text(&output.stderr)
    };
    for (change, message) in [
        (("[identify.ring_down]\n", "[identify.ring_downs]\n"), "did you mean `ring_down`?"),
        (("bias = \"23.76 V\"", "bias = \"23.76 Hz\""), "identify.ring_down.bias"),
        (("current_signal = ", "curent_signal = "), "needs `current_signal`"),
        (("\"zero_drive\"", "\"ring_down\""), "second recording of its role"),
    ] {
        let stderr = attempt(&|text: &str| text.replace(change.0, change.1));
        assert!(stderr.contains(message), "{stderr}");
    }
    let none = attempt(&|text: &str| {
        ["ring_down", "steady_state", "zero_drive"].iter().fold(text.to_owned(), |text, role| {
            text.replace(&format!("role = \"{role}\""), "role = \"gyro\"")
        })
    });
    assert!(none.contains("no recording has the role `ring_down`, `steady_state` or `zero_drive`"), "{none}");
}

/// A recording of this many rows: the scanner's, again and again, and the experiment for it.
pub fn long_recording(folder: &Path, rows: usize, reference: bool) -> PathBuf {
    let text =
        |file: &str| std::fs::read_to_string(root().join("examples/shared_scanner").join(file)).unwrap();
    // 20 000 rows are 627 cycles of the drive.
    let repeat = |file: &str| {
        let text = text(file);
        let mut lines = text.lines();
        let mut long = format!("{}\n", lines.next().unwrap());
        let all: Vec<&str> = lines.map(|line| line.split_once(',').unwrap().1).collect();
        for (k, cells) in all[all.len() - 20_000..].iter().cycle().take(rows).enumerate() {
            long += &format!("{}.{:06},{cells}\n", k / 1_000_000, k % 1_000_000);
        }
        std::fs::write(folder.join(file), long).unwrap();
    };
    repeat("recording.csv");
    let experiment = folder.join("experiment.toml");
    let mut toml = text("experiment.toml");
    if reference {
        repeat("reference.csv");
    } else {
        let (from, to) = (toml.find("[recording.reference]").unwrap(), toml.find("[estimate]").unwrap());
        toml.replace_range(from..to, "");
    }
    std::fs::write(&experiment, toml).unwrap();
    experiment
}

#[test]
fn a_long_recording_in_parts_gives_the_trajectories_of_one_in_memory() {
    use kalmems::progress::Silent;
    use kalmems::{results::Metrics, workflow};
    let folder = tempfile::tempdir().unwrap();
    let path = long_recording(folder.path(), workflow::LONG + 5_000, true);
    let out = folder.path().join("out");
    let output = run(&["estimate", path.to_str().unwrap(), "--json", "--out", out.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let parts: serde_json::Value = serde_json::from_str(&text(&output.stdout)).unwrap();
    let outcome = workflow::estimate(published(), &published().load(&path).unwrap(), &Silent).unwrap();
    let whole = serde_json::to_value(Metrics::of(&outcome)).unwrap();
    let of = |value: &serde_json::Value, filter: usize, path: &str| {
        value["recordings"][0]["segments"][0]["estimators"][filter].pointer(path).unwrap().clone()
    };
    for (i, trajectory) in outcome.recordings[0].segments[0].estimate.trajectories.iter().enumerate() {
        let csv = std::fs::read_to_string(out.join(format!("trajectory_{}.csv", trajectory.key))).unwrap();
        let angles: Vec<u64> = csv
            .lines()
            .skip(1)
            .map(|line| line.split(',').nth(1).unwrap().parse::<f64>().unwrap().to_bits())
            .collect();
        assert_eq!(angles.len(), trajectory.time_s.len());
        assert!(angles.iter().zip(&trajectory.states[0].mean).all(|(a, b)| *a == b.to_bits()), "{i}");
        for (field, tolerance) in [
            ("/errors/angle/rmse_deg", 1e-9),
            ("/errors/angle/samples", 0.0),
            ("/errors/peak_phase_rmse_deg", 0.01),
        ] {
            let [a, b] = [&parts, &whole].map(|v| of(v, i, field).as_f64().unwrap());
            assert!((a / b - 1.0).abs() <= tolerance, "{field}: {a} {b}");
        }
        assert_eq!(of(&parts, i, "/counts"), of(&whole, i, "/counts"));
        let [a, b] = [&parts, &whole].map(|v| of(v, i, "/consistency"));
        if a.is_object() {
            let [a, b] = [a, b].map(|v| v["mean_nis"].as_f64().unwrap());
            assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        }
    }
    assert!(out.join("figures/course.svg").is_file() && out.join("report.html").is_file());
    crate::report_samples::agrees(&out, &outcome);
}

#[cfg(unix)]
#[test]
fn a_pipe_is_estimated_as_it_comes() {
    let folder = tempfile::tempdir().unwrap();
    let path = long_recording(folder.path(), 150_000, false);
    let piped = folder.path().join("piped.toml");
    let toml = std::fs::read_to_string(&path).unwrap().replace("\"recording.csv\"", "\"/dev/stdin\"");
    std::fs::write(&piped, toml).unwrap();
    let estimate = |experiment: &Path, name: &str, input: Stdio| {
        let out = folder.path().join(name);
        let output = kalmems()
            .args(["estimate", experiment.to_str().unwrap(), "--out", out.to_str().unwrap()])
            .stdin(input)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        std::fs::read(out.join("trajectory_ekf.csv")).unwrap()
    };
    let mut writer =
        Command::new("cat").arg(folder.path().join("recording.csv")).stdout(Stdio::piped()).spawn().unwrap();
    let piped = estimate(&piped, "piped", writer.stdout.take().unwrap().into());
    writer.wait().unwrap();
    assert!(piped == estimate(&path, "file", Stdio::null()), "the trajectories differ");
}

const STREAM: &str = "examples/shared_scanner/stream.toml";

/// The lines of estimates of one answer of a stream.
fn estimates<'a>(lines: &'a str, key: &str) -> Vec<&'a str> {
    lines.lines().filter(|line| line.split(',').next() == Some(key)).collect()
}

#[test]
fn samples_come_from_a_file_a_pipe_or_a_connection() {
    use std::io::{BufRead, BufReader, Write};
    let recording = root().join("examples/shared_scanner/recording.csv");
    let from_file = run(&["stream", STREAM, "--from", recording.to_str().unwrap()]);
    let said = text(&from_file.stderr);
    assert_eq!(from_file.status.code(), Some(0), "{said}");
    assert!(
        said.contains("24001 samples estimated")
            && said.contains("from arrival to estimate, which waits for the next 2 samples:"),
        "{said}"
    );
    let lines = text(&from_file.stdout);
    assert!(lines.contains("\nevent,{\"event\":\"zero_phase\""), "{said}");
    let same = |other: &str| {
        for key in ["ekf", "ekf_lagged"] {
            assert_eq!(estimates(&lines, key).len(), 2401);
            assert!(estimates(&lines, key) == estimates(other, key), "{key}");
        }
    };

    let piped = kalmems().args(["stream", STREAM]).stdin(std::fs::File::open(&recording).unwrap()).output();
    same(&text(&piped.unwrap().stdout));

    let folder = tempfile::tempdir().unwrap();
    let [to_lines, to_frames] = ["lines.csv", "frames.bin"].map(|name| folder.path().join(name));
    let outputs = ["--lines", to_lines.to_str().unwrap(), "--frames", to_frames.to_str().unwrap()];
    let mut child = kalmems()
        .args(["stream", STREAM, "--from", "listen://127.0.0.1:0"])
        .args(outputs)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    let address = line.trim().rsplit(' ').next().unwrap();
    let mut connection = std::net::TcpStream::connect(address).unwrap();
    connection.write_all(&std::fs::read(&recording).unwrap()).unwrap();
    connection.write_all(b"# end\n").unwrap();
    drop(connection);
    std::io::Read::read_to_string(&mut said, &mut line).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{line}");
    same(&std::fs::read_to_string(&to_lines).unwrap());
    // A frame is its beginning, two counts and 1 + 2·5 numbers, or the 4 of a zero phase that is to come.
    let (frames, zeros) = (std::fs::read(&to_frames).unwrap(), lines.matches("zero_phase_ahead").count());
    assert!((500..504).contains(&zeros), "{zeros}");
    assert_eq!(frames.len(), 2 * 2401 * (4 + 2 + 2 + 8 * 11) + zeros * (4 + 2 + 2 + 8 * 4));
    let mut rest = &frames[..];
    let (mut estimates, mut ahead) = (0, Vec::new());
    while !rest.is_empty() {
        let count = usize::from(u16::from_le_bytes([rest[6], rest[7]]));
        let numbers = rest[8..8 + 8 * count].chunks(8);
        let numbers: Vec<f64> =
            numbers.map(|number| f64::from_le_bytes(number.try_into().unwrap())).collect();
        match &rest[..4] {
            b"kmEs" => estimates += 1,
            b"kmZp" => ahead.push(numbers),
            other => panic!("{other:?}"),
        }
        rest = &rest[8 + 8 * count..];
    }
    assert_eq!((estimates, ahead.len()), (2 * 2401, zeros));
    // The same as in the lines: when, how surely, which way, told when.
    let told = lines.lines().filter(|line| line.contains("zero_phase_ahead"));
    for (line, frame) in told.zip(ahead) {
        let event: serde_json::Value = serde_json::from_str(&line["event,".len()..]).unwrap();
        let way = if event["rising"] == true { 1.0 } else { -1.0 };
        let number = |key: &str| event[key].as_f64().unwrap();
        // JSON is read to the last digit but one.
        for (a, b) in frame.iter().zip([number("time_s"), number("sd_s"), way, number("told_s")]) {
            assert!((a - b).abs() <= 1e-15 * b.abs(), "{a} {b}");
        }
    }
}

/// The samples of the example's recording as frames, and the example with a table of these.
#[cfg(target_os = "linux")]
fn frames(folder: &Path) -> (PathBuf, Vec<u8>) {
    let text = std::fs::read_to_string(root().join(STREAM)).unwrap();
    let lines = "[stream.input.text]\ncolumns = [\"time_s\", \"drive_V\", \"cap_V\"]";
    let fields = "[stream.input.frames]\nsync = \"a55a\"\n\
                  fields = [\"u16 sequence\", \"f64 time_s\", \"f64 drive_V\", \"f64 cap_V\"]";
    assert!(text.contains(lines));
    let experiment = folder.join("frames.toml");
    std::fs::write(&experiment, text.replace(lines, fields)).unwrap();
    let recording = std::fs::read_to_string(root().join("examples/shared_scanner/recording.csv")).unwrap();
    let mut frames = Vec::new();
    for (k, line) in recording.lines().skip(1).enumerate() {
        frames.extend_from_slice(&[0xa5, 0x5a]);
        frames.extend_from_slice(&u16::try_from(k).unwrap().to_le_bytes());
        for cell in line.split(',') {
            frames.extend_from_slice(&cell.parse::<f64>().unwrap().to_le_bytes());
        }
    }
    (experiment, frames)
}

/// A pseudo-terminal is a serial device to whoever opens it: nothing of a byte may be taken for a key such as Ctrl-C or Ctrl-S, a
/// line's end be changed, or anything echoed, and that the other end is closed is a connection that broke.
#[cfg(target_os = "linux")]
#[test]
fn samples_come_from_a_serial_device() {
    use std::io::Read;
    use std::os::fd::AsRawFd;
    let Ok((mut instrument, device)) = serial2::SerialPort::pair() else {
        eprintln!("SKIPPED: there are no pseudo-terminals here");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let (experiment, frames) = frames(folder.path());
    let (experiment, file) = (experiment.to_str().unwrap(), folder.path().join("frames.bin"));
    std::fs::write(&file, &frames).unwrap();
    let from_file = text(&run(&["stream", experiment, "--from", file.to_str().unwrap()]).stdout);

    let path = std::fs::read_link(format!("/proc/self/fd/{}", device.as_raw_fd())).unwrap();
    // As a terminal is that somebody types at; the program has to change that.
    let typed_at = Command::new("stty").arg("-F").arg(&path).arg("sane").status();
    if !typed_at.is_ok_and(|status| status.success()) {
        eprintln!("SKIPPED in part: there is no `stty`, so that the device begins as one for bytes");
    }
    let mut child = kalmems()
        .args(["stream", experiment, "--baud", "921600", "--json", "--from", path.to_str().unwrap()])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The program opens the device before it says anything, and asks for bytes at once.
    let configured = || Ok::<bool, std::io::Error>(device.get_configuration()?.get_baud_rate()? == 921_600);
    let begun = std::time::Instant::now();
    while !configured().unwrap() {
        assert!(begun.elapsed().as_secs() < 60, "the rate of the device was not set");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let mut output = child.stdout.take().unwrap();
    let lines = std::thread::spawn(move || {
        let mut lines = String::new();
        output.read_to_string(&mut lines).map(|_| lines)
    });
    instrument.set_write_timeout(std::time::Duration::from_mins(1)).unwrap();
    instrument.write_all(&frames).unwrap();
    // What the terminal holds is lost when it is closed. It holds less than this, of which nothing is a frame.
    instrument.write_all(&vec![0; 1 << 16]).unwrap();
    // Nothing is sent back to the instrument.
    instrument.set_read_timeout(std::time::Duration::from_millis(1)).unwrap();
    assert!(instrument.read(&mut [0; 64]).is_err());
    drop((instrument, device));
    let lines = lines.join().unwrap().unwrap();
    let ended = child.wait_with_output().unwrap();
    let said = text(&ended.stderr);
    assert_eq!(ended.status.code(), Some(4), "{said}");
    assert!(said.contains("broke after 24001 samples, at 0.024 s"), "{said}");
    let summary: serde_json::Value = serde_json::from_str(&said[said.find('{').unwrap()..]).unwrap();
    assert_eq!(summary["estimated"], 24_001);
    for key in ["ekf", "ekf_lagged"] {
        assert_eq!(estimates(&lines, key).len(), 2401, "{key}");
        assert!(estimates(&lines, key) == estimates(&from_file, key), "{key}");
    }
    assert_eq!(summary["received"]["dropped"], 0);
}

#[cfg(not(target_os = "linux"))]
#[test]
fn samples_come_from_a_serial_device() {
    eprintln!("SKIPPED: pseudo-terminals are opened on Linux alone");
}

#[test]
fn a_stream_reports_crossings_of_a_threshold_beside_the_estimates() {
    let recording = root().join("examples/threshold_scanner/recording.csv");
    let example = "examples/threshold_scanner/stream.toml";
    let output = run(&["stream", example, "--from", recording.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let lines = text(&output.stdout);
    assert_eq!(estimates(&lines, "hybrid").len(), 1201);
    // Twice in a cycle of 1.6 ms, 24 ms long.
    let crossings = lines.lines().filter(|line| line.starts_with("event,{\"event\":\"crossing\""));
    assert!((28..=31).contains(&crossings.count()), "{lines}");
}

#[cfg(unix)]
#[test]
fn an_interrupted_stream_gives_what_it_has() {
    use std::io::{BufRead, BufReader, Write};
    let mut child = kalmems()
        .args(["stream", STREAM])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    let bytes = std::fs::read(root().join("examples/shared_scanner/recording.csv")).unwrap();
    let writer = std::thread::spawn(move || {
        input.write_all(&bytes).unwrap();
        input.flush().unwrap();
        input
    });
    // The samples wait for no end: estimates are there while the input is open.
    let mut output = BufReader::new(child.stdout.take().unwrap());
    let (mut line, mut count) = (String::new(), 0);
    while count < 2400 {
        line.clear();
        output.read_line(&mut line).unwrap();
        count += usize::from(line.starts_with("ekf,"));
    }
    let input = writer.join().unwrap();
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    let mut rest = String::new();
    std::io::Read::read_to_string(&mut output, &mut rest).unwrap();
    let ended = child.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(130), "{}", text(&ended.stderr));
    // What was smoothed a little later has come to its end as well.
    assert!(estimates(&rest, "ekf_lagged").len() >= 10, "{rest}");
    drop(input);
}

/// The example with these lines in `[stream]`, in a folder of its own.
fn streaming(folder: &Path, lines: &str) -> String {
    let text = std::fs::read_to_string(root().join(STREAM)).unwrap();
    let experiment = folder.join("stream.toml");
    std::fs::write(&experiment, text.replace("every = 10", &format!("{lines}\nevery = 10"))).unwrap();
    experiment.to_str().unwrap().to_owned()
}

/// Starts a stream from a connection that this test accepts.
fn from_tcp(experiment: &str) -> (std::process::Child, std::net::TcpListener) {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp://{}", listener.local_addr().unwrap());
    let child = kalmems()
        .args(["stream", experiment, "--json", "--from", &address])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    (child, listener)
}

/// Sends bytes, waits until they were taken, and resets the connection.
fn reset_after(connection: std::net::TcpStream, bytes: &[u8], taken: impl FnOnce()) {
    use std::io::Write;
    let mut connection = connection;
    connection.write_all(bytes).unwrap();
    taken();
    socket2::SockRef::from(&connection).set_linger(Some(std::time::Duration::ZERO)).unwrap();
}

/// Reads lines until so many estimates of a key have come; what was read.
fn until(output: &mut impl std::io::BufRead, key: &str, count: usize) -> String {
    let (mut all, mut found) = (String::new(), 0);
    while found < count {
        let from = all.len();
        assert!(output.read_line(&mut all).unwrap() > 0, "{all}");
        found += usize::from(all[from..].starts_with(key));
    }
    all
}

fn summary(said: &str) -> serde_json::Value {
    serde_json::from_str(&said[said.find('{').unwrap()..]).unwrap()
}

#[test]
fn a_connection_that_is_reset_ends_with_4_and_what_came_is_estimated() {
    use std::io::{BufReader, Read};
    let bytes = std::fs::read(root().join("examples/shared_scanner/recording.csv")).unwrap();
    // Half the samples, the last in the middle of its line.
    let half = bytes.split(|byte| *byte == b'\n').take(12_001).map(|line| line.len() + 1).sum::<usize>() + 7;
    let (mut child, listener) = from_tcp(STREAM);
    let mut output = BufReader::new(child.stdout.take().unwrap());
    let mut lines = String::new();
    reset_after(listener.accept().unwrap().0, &bytes[..half], || lines = until(&mut output, "ekf,", 1200));
    output.read_to_string(&mut lines).unwrap();
    let ended = child.wait_with_output().unwrap();
    let said = text(&ended.stderr);
    assert_eq!(ended.status.code(), Some(4), "{said}");
    assert!(said.contains("broke after 12000 samples, at 0.011999 s"), "{said}");
    let summary = summary(&said);
    assert_eq!((&summary["estimated"], &summary["received"]["cut_off"]), (&12_000.into(), &1.into()));
    assert_eq!(summary["broken"]["samples"], 12_000);
    assert_eq!(estimates(&lines, "ekf_lagged").len(), 1200);
}

/// The kernel closes the connection of a sender that was killed as that of one that ends.
#[test]
fn a_connection_that_is_closed_without_the_end_mark_ends_with_4_and_is_tried_again_where_that_is_wanted() {
    use std::io::Write;
    let folder = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(root().join("examples/shared_scanner/recording.csv")).unwrap();
    // At the end of a line, and within one.
    for behind in [0, 7] {
        let half = bytes.split(|byte| *byte == b'\n').take(12_001).map(|line| line.len() + 1).sum::<usize>()
            + behind;
        let (child, listener) = from_tcp(STREAM);
        listener.accept().unwrap().0.write_all(&bytes[..half]).unwrap();
        let ended = child.wait_with_output().unwrap();
        let said = text(&ended.stderr);
        assert_eq!(ended.status.code(), Some(4), "{said}");
        assert!(
            said.contains("broke after 12000 samples") && said.contains("without the end mark"),
            "{said}"
        );
        assert_eq!(summary(&said)["estimated"], 12_000);
    }
    let experiment = streaming(folder.path(), "reconnect = \"20 s\"");
    let place =
        |lines: usize| bytes.split(|byte| *byte == b'\n').take(lines).map(|l| l.len() + 1).sum::<usize>();
    let (child, listener) = from_tcp(&experiment);
    listener.accept().unwrap().0.write_all(&bytes[..place(12_001)]).unwrap();
    listener.accept().unwrap().0.write_all(&[&bytes[place(12_001)..], b"# end\n"].concat()).unwrap();
    let ended = child.wait_with_output().unwrap();
    let said = text(&ended.stderr);
    assert_eq!(ended.status.code(), Some(0), "{said}");
    assert_eq!(
        (&summary(&said)["estimated"], &summary(&said)["received"]["breaks"]),
        (&24_001.into(), &1.into())
    );
}

#[test]
fn a_server_that_is_not_there_is_waited_for_where_that_is_wanted_and_ends_with_4_otherwise() {
    use std::io::Write;
    let folder = tempfile::tempdir().unwrap();
    let place = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let address = format!("tcp://{place}");
    let refused = run(&["stream", STREAM, "--from", &address]);
    assert_eq!(refused.status.code(), Some(4), "{}", text(&refused.stderr));
    let experiment = streaming(folder.path(), "reconnect = \"30 s\"");
    let child = kalmems()
        .args(["stream", &experiment, "--from", &address])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(300));
    let listener = std::net::TcpListener::bind(place).unwrap();
    let bytes = std::fs::read(root().join("examples/shared_scanner/recording.csv")).unwrap();
    listener.accept().unwrap().0.write_all(&[&bytes[..], b"# end\n"].concat()).unwrap();
    let ended = child.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(0), "{}", text(&ended.stderr));
    assert!(text(&ended.stderr).contains("24001 samples estimated"), "{}", text(&ended.stderr));
}

/// Whoever looks whether a port is open, or speaks another protocol, is not the sender.
#[test]
fn a_listener_serves_the_next_client_behind_one_that_sends_no_sample() {
    use std::io::{BufRead, BufReader, Read, Write};
    let mut child = kalmems()
        .args(["stream", STREAM, "--json", "--from", "listen://127.0.0.1:0"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    let address = line.trim().rsplit(' ').next().unwrap();
    drop(std::net::TcpStream::connect(address).unwrap());
    let mut other = std::net::TcpStream::connect(address).unwrap();
    other.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
    drop(other);
    let mut sender = std::net::TcpStream::connect(address).unwrap();
    let bytes = std::fs::read(root().join("examples/shared_scanner/recording.csv")).unwrap();
    sender.write_all(&[&bytes[..], b"# end\n"].concat()).unwrap();
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{rest}");
    let summary = summary(&rest);
    assert_eq!((&summary["estimated"], &summary["received"]["turned_away"]), (&24_001.into(), &2.into()));
}

/// A listener whose client closes the connection without an end mark, in the middle of a frame: what came is estimated, the half frame is counted, and
/// the next client goes on where one may come.
#[test]
fn a_client_of_a_listener_that_closes_in_the_middle_of_a_frame_has_broken_off() {
    use std::io::{BufRead, BufReader, Read, Write};
    let folder = tempfile::tempdir().unwrap();
    let (experiment, frames) = frames(folder.path());
    let text = std::fs::read_to_string(&experiment).unwrap();
    // A frame has 28 bytes.
    let half = 28 * 12_000 + 13;
    for (line, code, came) in [("", 4, 12_000), ("reconnect = \"20 s\"", 0, 24_000)] {
        std::fs::write(&experiment, text.replace("every = 10", &format!("{line}\nevery = 10"))).unwrap();
        let mut child = kalmems()
            .args(["stream", experiment.to_str().unwrap(), "--json", "--from", "listen://127.0.0.1:0"])
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = BufReader::new(child.stderr.take().unwrap());
        let mut first = String::new();
        said.read_line(&mut first).unwrap();
        let address = first.trim().rsplit(' ').next().unwrap();
        std::net::TcpStream::connect(address).unwrap().write_all(&frames[..half]).unwrap();
        if code == 0 {
            let mut next = std::net::TcpStream::connect(address).unwrap();
            next.write_all(&[&frames[28 * 12_001..], b"# end\n"].concat()).unwrap();
        }
        let mut rest = String::new();
        said.read_to_string(&mut rest).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(code), "{rest}");
        let summary = summary(&rest);
        let received = &summary["received"];
        assert_eq!((&summary["estimated"], &received["cut_off"]), (&came.into(), &1.into()), "{rest}");
        assert_eq!(summary["broken"]["samples"] == 12_000, code == 4, "{rest}");
        assert_eq!(received["breaks"], 1, "{rest}");
    }
}

/// A stream of the example with each row changed; the exit code, the lines, and what was said.
fn streamed(change: impl Fn(usize, &str) -> String) -> (Option<i32>, String, String) {
    streamed_by(STREAM, change)
}

/// The same by another experiment file.
fn streamed_by(experiment: &str, change: impl Fn(usize, &str) -> String) -> (Option<i32>, String, String) {
    let folder = tempfile::tempdir().unwrap();
    let recording = std::fs::read_to_string(root().join("examples/shared_scanner/recording.csv")).unwrap();
    let rows = recording
        .lines()
        .enumerate()
        .map(|(row, line)| if row == 0 { line.to_owned() } else { change(row, line) });
    let path = folder.path().join("samples.csv");
    std::fs::write(&path, rows.collect::<Vec<_>>().join("\n") + "\n").unwrap();
    let output = run(&["stream", experiment, "--json", "--from", path.to_str().unwrap()]);
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

/// A line with another cell.
fn with_cell(line: &str, place: usize, cell: &str) -> String {
    let cells = line.split(',').enumerate().map(|(at, own)| if at == place { cell } else { own });
    cells.collect::<Vec<_>>().join(",")
}

#[test]
fn a_stream_whose_filter_cannot_begin_at_its_first_samples_begins_at_later_ones() {
    let (code, lines, said) = streamed(|row, line| match row {
        1500 => with_cell(&with_cell(line, 1, ""), 2, ""),
        row if row <= 3000 => with_cell(line, 1, "0"),
        _ => line.to_owned(),
    });
    assert_eq!(code, Some(0), "{said}");
    let events = |name: &str| lines.matches(&format!("\"event\":\"{name}\"")).count();
    assert_eq!((events("not_estimated"), events("estimate_begins"), events("stopped")), (1, 1, 0), "{said}");
    let summary = summary(&said);
    let left_out = summary["not_estimated"].as_u64().unwrap();
    assert!((1500..=3072).contains(&left_out), "{said}");
    assert_eq!(summary["estimated"].as_u64().unwrap() + left_out, 24_001);
    assert_eq!(summary["ends_with_estimate"], true);
}

/// The drive is off at first, and a sample is missing meanwhile: at the beginning, and behind a long gap.
#[cfg(unix)]
#[test]
fn a_bad_beginning_costs_the_same_rows_in_memory_in_parts_and_in_a_stream_and_behind_a_gap_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let recording = std::fs::read_to_string(root().join("examples/shared_scanner/recording.csv")).unwrap();
    // The recording repeats after so many rows.
    let rows: Vec<&str> = recording.lines().skip(1).take(20_000).collect();
    let (first, second) = (24_000, 75_000);
    let mut csv = "time_s,drive_V,cap_V\n".to_owned();
    for k in 0..first + second {
        let (since, micro) = if k < first { (k, k) } else { (k - first, k + 50_000) };
        let [drive, signal] = [1, 2].map(|place| rows[k % rows.len()].split(',').nth(place).unwrap());
        let cells = match since {
            1500 => ",".to_owned(),
            0..3000 => format!("0,{signal}"),
            _ => format!("{drive},{signal}"),
        };
        csv += &format!("{}.{:06},{cells}\n", micro / 1_000_000, micro % 1_000_000);
    }
    let path = folder.path().join("recording.csv");
    std::fs::write(&path, csv).unwrap();
    let toml = std::fs::read_to_string(root().join(STREAM)).unwrap().replace("every = 10", "every = 1");
    let experiment = |name: &str, file: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, toml.replace("\"recording.csv\"", &format!("\"{file}\""))).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (whole, piped) = (experiment("whole.toml", "recording.csv"), experiment("piped.toml", "/dev/stdin"));
    // Times and angles of the estimates.
    let numbers = |line: &str, from: usize| -> Vec<u64> {
        line.split(',')
            .skip(from)
            .take(2)
            .map(|cell| cell.parse::<f64>().unwrap_or(f64::NAN).to_bits())
            .collect()
    };
    let estimated = |experiment: &str| {
        let out = folder.path().join(experiment.replace('/', "_"));
        let output = kalmems()
            .args(["estimate", experiment, "--out", out.to_str().unwrap()])
            .stdin(std::fs::File::open(&path).unwrap())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let of = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
        let files = [of("trajectory_ekf.csv"), of("stretch_2_trajectory_ekf.csv")];
        files.iter().flat_map(|csv| csv.lines().skip(1).map(|line| numbers(line, 0))).collect::<Vec<_>>()
    };
    let in_memory = estimated(&whole);
    let streamed = run(&["stream", &whole, "--from", path.to_str().unwrap(), "--json"]);
    assert_eq!(streamed.status.code(), Some(0), "{}", text(&streamed.stderr));
    let lines = text(&streamed.stdout);
    let streamed: Vec<_> = estimates(&lines, "ekf").into_iter().map(|line| numbers(line, 1)).collect();
    // All but the rows without a drive and 1024 more at most, of each stretch.
    let left_out = first + second - in_memory.len();
    assert!((2 * 1500..=2 * (3000 + 1024)).contains(&left_out), "{left_out}");
    assert!(in_memory == streamed, "{} in memory, {} in a stream", in_memory.len(), streamed.len());
    assert!(in_memory == estimated(&piped), "in parts");
}

#[test]
fn a_filter_of_a_stream_that_stops_is_started_again_and_lines_without_numbers_say_why() {
    let folder = tempfile::tempdir().unwrap();
    let unscented = folder.path().join("stream.toml");
    let example = std::fs::read_to_string(root().join(STREAM)).unwrap();
    std::fs::write(&unscented, example.replace("\"ekf\"", "\"ukf\"\nalpha = 1e-6\nbeta = 0")).unwrap();
    let unscented = unscented.to_str().unwrap();
    // A signal that is no signal while the filter settles, and a drive that is none then and later. Points so near to each other turn a large
    // drive into a covariance that is not definite, from which no further points can be drawn.
    for (experiment, why, row, place, cell) in [
        (STREAM, "state", 101, 2, "1e200"),
        (STREAM, "state", 101, 1, "1e100"),
        (STREAM, "state", 15_001, 1, "1e100"),
        (unscented, "the state covariance is not positive definite", 15_001, 1, "1e6"),
    ] {
        let (code, lines, said) =
            streamed_by(
                experiment,
                |at, line| {
                    if at == row { with_cell(line, place, cell) } else { line.to_owned() }
                },
            );
        assert_eq!(code, Some(0), "{said}");
        let of = |name: &str| format!("event,{{\"event\":\"{name}\"");
        let stops =
            lines.lines().filter(|line| line.starts_with(&of("stopped")) && line.contains("\"ekf\"")).count();
        assert!(lines.lines().any(|line| line.starts_with(&of("stopped")) && line.contains(why)), "{lines}");
        let again =
            lines.lines().filter(|line| line.contains("started_again") && line.contains("\"ekf\"")).count();
        assert_eq!((stops, again), (1, 1), "{row} {cell}: {said}");
        let all = estimates(&lines, "ekf");
        assert_eq!(all.len(), 2401);
        let blank = |line: &&&str| line.split(',').nth(2) == Some("");
        let without = all.iter().filter(blank).count();
        assert!((1..200).contains(&without), "{row} {cell}: {without}");
        assert!(all.iter().filter(blank).all(|line| line.ends_with(",stopped")));
        assert!(all.last().unwrap().split(',').skip(2).all(|cell| cell.parse::<f64>().is_ok()));
        let summary = summary(&said);
        assert!(summary["not_estimated"].as_u64().unwrap() >= 10 * (without as u64 - 1));
        assert_eq!(summary["stopped"], 1, "{row} {cell}");
    }
}

#[test]
fn a_stream_that_ends_without_an_estimate_ends_with_6() {
    // The signal is missing from the middle on to the end, and the drive is no number.
    let (code, lines, said) =
        streamed(|row, line| if row > 12_000 { with_cell(line, 1, "1e200") } else { line.to_owned() });
    assert_eq!(code, Some(6), "{said}");
    assert!(estimates(&lines, "ekf").last().unwrap().ends_with(",stopped"));
    assert_eq!(summary(&said[..])["ends_with_estimate"], false);
}

/// The filter has lost the signal at the end, and gives numbers all the same.
#[test]
fn a_stream_whose_filter_has_lost_the_motion_ends_with_6_and_says_so() {
    let (code, lines, said) = streamed(|_, line| with_cell(line, 1, "0"));
    assert_eq!(code, Some(6), "{said}");
    assert!(said.contains("error: no filter follows the motion at the end of the stream"), "{said}");
    let lines = estimates(&lines, "ekf");
    assert_eq!(lines.len(), 2401);
    for line in lines {
        let cells: Vec<&str> = line.split(',').take(4).skip(1).collect();
        assert!(cells.iter().all(|cell| cell.parse::<f64>().is_ok_and(f64::is_finite)), "{line}");
    }
    let summary = summary(&said);
    assert_eq!((&summary["estimated"], &summary["ends_with_estimate"]), (&24_001.into(), &false.into()));
}

/// Rows whose drive is unknown at missing samples, as it is no steady sine: of a recording that consists of them alone, and before good ones.
#[test]
fn a_beginning_that_is_refused_is_an_error_of_estimate_and_a_stream_goes_on_behind_it() {
    let refused = |row: usize, line: &str| match row % 700 {
        350 => with_cell(&with_cell(line, 1, ""), 2, ""),
        _ => with_cell(line, 1, &format!("{:.3}", (row % 3000) as f64 / 300.0)),
    };
    let folder = tempfile::tempdir().unwrap();
    let recording = std::fs::read_to_string(root().join("examples/shared_scanner/recording.csv")).unwrap();
    let rows = recording.lines().enumerate().take(12_001);
    let rows = rows.map(|(row, line)| if row == 0 { line.to_owned() } else { refused(row, line) });
    let rows = rows.collect::<Vec<_>>().join("\n") + "\n";
    std::fs::write(folder.path().join("recording.csv"), rows).unwrap();
    let experiment = folder.path().join("stream.toml");
    std::fs::copy(root().join(STREAM), &experiment).unwrap();
    let out = folder.path().join("out");
    let output = run(&["estimate", experiment.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    let why = "the drive `drive_V` is not known at ";
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains(why) && !out.exists(), "{}", text(&output.stderr));
    let (code, lines, said) =
        streamed(|row, line| if row <= 12_000 { refused(row, line) } else { line.to_owned() });
    assert_eq!(code, Some(0), "{said}");
    let first = lines.lines().find(|line| line.contains("\"event\":\"not_estimated\"")).unwrap();
    assert!(first.contains(why), "{first}");
    assert_eq!(lines.matches("\"event\":\"estimate_begins\"").count(), 1, "{said}");
    let summary = summary(&said);
    // As a start is tried again 1024 rows later at first, and 65 536 at most.
    let estimated = summary["estimated"].as_u64().unwrap();
    assert!((24_001 - 12_000 - 1024..=24_001 - 12_000).contains(&estimated), "{said}");
    assert_eq!(summary["not_estimated"].as_u64().unwrap() + estimated, 24_001);
    assert_eq!(summary["ends_with_estimate"], true);
}

/// Two faults within 20 ms, and good rows behind them or not.
#[test]
fn the_exit_code_of_a_stream_with_two_faults_is_that_of_its_end() {
    type Change = fn(usize, &str) -> String;
    let cases: [(&str, i32, Change); 5] = [
        ("a spike, then silence", 0, |row, line| match row {
            1000 => with_cell(line, 2, "1000"),
            1040..1540 => with_cell(line, 2, ""),
            _ => line.to_owned(),
        }),
        ("an absurd drive, then damaged lines", 0, |row, line| match row {
            1000 => with_cell(line, 1, "1e100"),
            1900..1903 => format!("?{line}"),
            _ => line.to_owned(),
        }),
        ("a wrong time, then the drive off with a sample missing", 0, |row, line| match row {
            12_000 => with_cell(line, 0, "1e4"),
            13_000 => with_cell(&with_cell(line, 1, ""), 2, ""),
            12_040..14_040 => with_cell(line, 1, "0"),
            _ => line.to_owned(),
        }),
        ("a spike, then an absurd drive to the end", 6, |row, line| match row {
            12_000 => with_cell(line, 2, "1000"),
            12_040.. => with_cell(line, 1, "1e200"),
            _ => line.to_owned(),
        }),
        ("silence, then the drive off to the end", 6, |row, line| match row {
            5000..5500 => with_cell(line, 2, ""),
            5540.. => with_cell(line, 1, "0"),
            _ => line.to_owned(),
        }),
    ];
    for (name, expected, change) in cases {
        let (code, _, said) = streamed(change);
        assert_eq!(code, Some(expected), "{name}: {said}");
        assert_eq!(summary(&said)["ends_with_estimate"], expected == 0, "{name}");
    }
}

#[test]
fn outputs_of_a_stream_that_are_one_file_or_its_input_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let recording = std::fs::read(root().join("examples/shared_scanner/recording.csv")).unwrap();
    std::fs::write(path("r.csv"), &recording).unwrap();
    for outputs in [
        ["--lines", &path("x"), "--frames", &path("x")],
        ["--lines", &path("r.csv"), "--force", "--json"],
        ["--lines", &path("y"), "--state", &path("./y")],
        ["--lines", &path("z"), "--to", &format!("mcap://{}", path("z"))],
    ] {
        let refused = run(&[&["stream", STREAM, "--from", &path("r.csv")], &outputs[..]].concat());
        assert_eq!(refused.status.code(), Some(1), "{outputs:?}");
        assert!(text(&refused.stderr).contains("name one file"), "{}", text(&refused.stderr));
    }
    assert!(
        std::fs::read(path("r.csv")).unwrap() == recording
            && std::fs::read_dir(folder.path()).unwrap().count() == 1
    );
}

#[test]
fn a_reader_that_goes_ends_a_stream_that_has_no_other_output_and_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let recording = root().join("examples/shared_scanner/recording.csv");
    let frames = folder.path().join("frames.bin");
    let ended = |more: &[&str]| {
        let mut child = kalmems()
            .args(["stream", STREAM, "--lines", "-", "--from", recording.to_str().unwrap()])
            .args(more)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let ended = child.wait_with_output().unwrap();
        assert!(
            text(&ended.stderr).contains("nobody reads standard output any more"),
            "{}",
            text(&ended.stderr)
        );
        ended.status.code()
    };
    assert_eq!(ended(&[]), Some(141));
    assert_eq!(ended(&["--frames", frames.to_str().unwrap()]), Some(0));
    assert!(std::fs::metadata(&frames).unwrap().len() > 2 * 2401 * 96);
}

#[cfg(target_os = "linux")]
#[test]
fn one_frame_with_a_wrong_time_is_left_out_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let (experiment, frames) = frames(folder.path());
    let path = folder.path().join("frames.bin");
    let wrong = [(0, 1e6), (0, -3.0), (5000, 0.0025), (5000, 1e6), (20_000, f64::NAN), (20_000, -3.0)];
    for (at, time_s) in wrong {
        let mut frames = frames.clone();
        frames[28 * at + 4..28 * at + 12].copy_from_slice(&f64::to_le_bytes(time_s));
        std::fs::write(&path, &frames).unwrap();
        let output =
            run(&["stream", experiment.to_str().unwrap(), "--json", "--from", path.to_str().unwrap()]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{said}");
        let summary = summary(&said);
        let received = &summary["received"];
        let wrong = received["misplaced"].as_u64().unwrap() + received["without_time"].as_u64().unwrap();
        assert_eq!((wrong, &summary["estimated"]), (1, &24_000.into()), "{time_s}: {said}");
        assert_eq!(summary["not_estimated"], 0, "{time_s}: {said}");
    }
}

#[test]
fn a_connection_that_is_there_again_goes_on() {
    use std::io::{BufReader, Read, Write};
    let folder = tempfile::tempdir().unwrap();
    let experiment = streaming(folder.path(), "reconnect = \"20 s\"");
    let bytes = std::fs::read(root().join("examples/shared_scanner/recording.csv")).unwrap();
    let place =
        |lines: usize| bytes.split(|byte| *byte == b'\n').take(lines).map(|l| l.len() + 1).sum::<usize>();
    let (mut child, listener) = from_tcp(&experiment);
    let mut output = BufReader::new(child.stdout.take().unwrap());
    let mut lines = String::new();
    let accept = || listener.accept().unwrap().0;
    reset_after(accept(), &bytes[..place(12_001) + 7], || lines = until(&mut output, "ekf,", 1200));
    // A thousand samples are gone; then it ends in order.
    accept().write_all(&[&bytes[place(13_001)..], b"# end\n"].concat()).unwrap();
    output.read_to_string(&mut lines).unwrap();
    let ended = child.wait_with_output().unwrap();
    let said = text(&ended.stderr);
    assert_eq!(ended.status.code(), Some(0), "{said}");
    let received = &summary(&said)["received"];
    for (what, count) in
        [("breaks", 1), ("reconnections", 1), ("cut_off", 1), ("dropped", 1000), ("passed", 23_001)]
    {
        assert_eq!(received[what], count, "{what}: {said}");
    }
    assert!(lines.contains("event,{\"event\":\"disconnected\",\"why\":"), "{lines}");
    assert!(lines.contains("event,{\"event\":\"reconnected\",\"attempts\":1"), "{lines}");

    // A file cannot be opened again, which is said.
    let recording = root().join("examples/shared_scanner/recording.csv");
    let output = run(&["stream", &experiment, "--from", recording.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stderr).contains("is read once: `reconnect` is for"), "{}", text(&output.stderr));
}

#[cfg(unix)]
#[test]
fn a_silent_stream_reports_its_health_and_an_interruption_ends_it_with_130() {
    use std::io::{BufRead, BufReader};
    let folder = tempfile::tempdir().unwrap();
    let experiment = streaming(folder.path(), "heartbeat = \"0.1 s\"");
    let pipe = folder.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp://{}", listener.local_addr().unwrap());
    // Nobody connects, nobody sends, nobody opens the other end.
    for (from, signal) in [
        ("listen://127.0.0.1:0", "-INT"),
        (&address, "-INT"),
        ("-", "-TERM"),
        (pipe.to_str().unwrap(), "-INT"),
    ] {
        let mut child = kalmems()
            .args(["stream", &experiment, "--from", from])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let input = child.stdin.take().unwrap();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        output.read_line(&mut line).unwrap();
        assert!(
            line.starts_with("event,{\"event\":\"health\"") && line.contains("\"silent_s\":null"),
            "{line}"
        );
        let begun = std::time::Instant::now();
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        let code = child.wait().unwrap().code();
        let took_s = begun.elapsed().as_secs_f64();
        assert_eq!(code, Some(130), "{from}");
        // A second, and some for a machine that does other work.
        assert!(took_s < 3.0, "{from}: {took_s} s");
        drop(input);
    }
}

/// `kalmems … 2>&1 | head` closes both outputs early.
#[test]
fn a_command_whose_outputs_are_closed_ends_as_with_open_ones() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let row = |k: i32| format!("{:.6}", (0.6 * f64::from(k)).cos() / f64::from(1 + k * k));
    let rows: Vec<String> = (-512..512).map(row).collect();
    std::fs::write(path("i.csv"), format!("detector_1\n{}\n", rows.join("\n"))).unwrap();
    let spectrum = "name = \"s\"\n[interferogram]\nfile = \"i.csv\"\ncolumns = [\"detector_1\"]\n[path]\nstep = \"0.5 um\"\n\
                    [transform]\napodisation = \"boxcar\"\nphase = \"power\"\n";
    std::fs::write(path("s.toml"), spectrum).unwrap();
    let recording = "examples/shared_scanner/recording.csv";
    let simulation = "examples/shared_scanner/simulation.toml";
    for (arguments, code) in [
        (&["schema"][..], 0),
        (&["inspect", recording], 0),
        (&["inspect", EXAMPLE, "--out", &path("outlook")], 0),
        (&["simulate", simulation, "--out", &path("simulated")], 0),
        (&["spectrum", &path("s.toml"), "--out", &path("spectrum")], 0),
        (&["stream", STREAM, "--from", recording, "--frames", &path("FRAMES")], 0),
        (&["estimate", &path("none.toml"), "--out", &path("none")], 1),
        (&["estimate"], 2),
    ] {
        let with = |arguments: &[&str], open: bool| {
            let mut command = kalmems();
            command.args(arguments);
            let (reader, writer) = std::io::pipe().unwrap();
            if open {
                command.stdout(Stdio::null()).stderr(Stdio::null());
            } else {
                command.stdout(writer.try_clone().unwrap()).stderr(writer);
            }
            drop(reader);
            command.status().unwrap().code()
        };
        let named = |frames: &str| -> Vec<String> {
            arguments.iter().map(|argument| argument.replace("FRAMES", frames)).collect()
        };
        for (frames, open) in [("open", true), ("closed", false)] {
            let arguments = named(frames);
            let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
            assert_eq!(with(&arguments, open), Some(code), "{arguments:?}, open: {open}");
        }
    }
    let frames = ["open", "closed"].map(|name| std::fs::read(path(name)).unwrap());
    assert!(!frames[0].is_empty() && frames[0] == frames[1]);
    assert!(folder.path().join("spectrum/figures/spectrum.svg").is_file());
}

/// The digits of a text that stand in a row, the most.
fn most_digits(text: &str) -> usize {
    text.split(|c: char| !c.is_ascii_digit()).map(str::len).max().unwrap_or(0)
}

#[test]
fn very_large_and_very_small_numbers_have_an_exponent_in_what_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("experiment.toml");
    for (file, from, to, command) in [
        ("shared_scanner/experiment.toml", "skip = \"8 ms\"", "skip = \"1e300 s\"", "estimate"),
        ("shared_scanner/experiment.toml", "\"1.92e-4 V^2\"", "\"1e300 V^2\"", "inspect"),
        ("shared_scanner/experiment.toml", "\"1.15e-14 kg m^2\"", "\"1e-300 kg m^2\"", "inspect"),
        ("shared_scanner/simulation.toml", "\"31.35 kHz\"", "\"1e300 Hz\"", "inspect"),
        ("micro_stage/simulation.toml", "\"1700 Hz\"", "\"1e300 Hz\"", "inspect"),
        ("micro_stage/simulation.toml", "\"1.2 V\"", "\"1e-300 V\"", "inspect"),
        ("piston_mirror/experiment.toml", "\"0.151 aF/sqrt(Hz)\"", "\"1e300 aF/sqrt(Hz)\"", "inspect"),
    ] {
        let example = root().join("examples").join(file);
        let text_of = std::fs::read_to_string(&example).unwrap();
        assert!(text_of.contains(from), "{file}: {from}");
        let absolute = format!("file = \"{}/", example.parent().unwrap().display());
        std::fs::write(&path, text_of.replace("file = \"", &absolute).replace(from, to)).unwrap();
        let out = folder.path().join("out");
        let out = ["--out", out.to_str().unwrap()];
        let out = if command == "estimate" { &out[..] } else { &[] };
        let output = run(&[&[command, path.to_str().unwrap()][..], out].concat());
        let said = format!("{}{}", text(&output.stdout), text(&output.stderr));
        assert!(most_digits(&said) < 18, "{to}: {said}");
        if command == "estimate" {
            assert!(said.contains("the settling time of 1e300 s"), "{said}");
        }
    }
}
