//! What a command tells on a terminal: as much as a reader takes in, each verdict and warning with the way to its explanation, and
//! what to run next.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kalmems")).current_dir(root()).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// What stands behind `kalmems help ` in a text, up to the end of its code.
fn topics(text: &str) -> BTreeSet<String> {
    let behind = text.match_indices("`kalmems help ").map(|(at, found)| &text[at + found.len()..]);
    behind.filter_map(|rest| rest.split_once('`').map(|(topic, _)| topic.to_owned())).collect()
}

fn estimated(experiment: &str, out: &Path) -> (String, String) {
    let output = run(&["estimate", experiment, "--out", out.to_str().unwrap()]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    (text(&output.stdout), text(&output.stderr))
}

#[test]
fn each_filter_that_fails_has_one_paragraph_and_the_report_has_all() {
    let folder = tempfile::tempdir().unwrap();
    let (said, hints) = estimated("examples/micro_stage/as_published.toml", folder.path());
    let failures: Vec<&str> = said.lines().filter(|line| line.starts_with("FAILURE: ")).collect();
    // Three filters over four segments.
    assert_eq!(failures.len(), 3, "{said}");
    for failure in &failures {
        assert!(failure.contains(" more; `kalmems help overconfident`)"), "{failure}");
        assert!(failure.chars().count() <= 140, "{failure}");
    }
    // The worst of the four: the largest error relative to the claim.
    let worst = "bias-on, test1: EKF, trusting the drive: failed: errors of the rate 54.2 times the claim (";
    assert!(failures[2].contains(worst), "{failures:#?}");
    assert!(hints.contains("kalmems diagnose examples/micro_stage/as_published.toml"), "{hints}");
    let report = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    // One box for all failures, with each of them in a fold, in units that fit.
    assert!(report.contains("and 887 ns too late") && report.contains("a line at 1.6276 kHz"));
    assert_eq!(report.matches("<b>Failure</b>").count(), 1);
    assert!(report.matches("<div class=\"notice failure\">").count() >= 20);
}

#[test]
fn every_verdict_and_warning_leads_to_an_explanation_on_the_terminal_and_in_the_report() {
    let folder = tempfile::tempdir().unwrap();
    for (place, experiment) in [
        "shared_scanner/experiment",
        "shared_scanner/true_stiffness",
        "accelerometer/experiment",
        "threshold_scanner/experiment",
    ]
    .into_iter()
    .enumerate()
    {
        let out = folder.path().join(place.to_string());
        let (said, hints) = estimated(&format!("examples/{experiment}.toml"), &out);
        assert!(hints.contains("what the verdicts mean: kalmems help verdict"), "{hints}");
        let named = topics(&said);
        assert!(!named.is_empty(), "{said}");
        for topic in &named {
            let help = run(&["help", topic]);
            assert!(help.status.success() && text(&help.stdout).contains("Book: "), "{experiment}: {topic}");
        }
        let report = std::fs::read_to_string(out.join("report.html")).unwrap();
        for notice in report.split("<div class=\"notice ").skip(1) {
            let notice = notice.split("</div>").next().unwrap();
            if notice.starts_with("failure") || notice.starts_with("warning") {
                let target = notice.split("href=\"#").nth(1).and_then(|rest| rest.split('"').next());
                let target = target.unwrap_or_else(|| panic!("{experiment}: no link: {notice}"));
                assert!(report.contains(&format!("id=\"{target}\"")), "{experiment}: {target}");
            }
        }
        assert!(report.contains("What a verdict means</h3>"), "{experiment}");
    }
}

#[test]
fn an_experiment_that_only_simulates_is_refused_by_estimate_with_the_command_that_makes_its_recording() {
    let output = run(&["estimate", "examples/shared_scanner/simulation.toml"]);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        said.contains("the file has a table `[simulate]`: `kalmems simulate` with it makes a recording"),
        "{said}"
    );
}

#[test]
fn the_filter_that_is_exported_without_a_choice_is_not_the_least_accurate_and_the_others_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let output = run(&[
        "export",
        "examples/shared_scanner/microcontroller.toml",
        "--target",
        "c",
        "--out",
        out.to_str().unwrap(),
    ]);
    let said = text(&output.stderr);
    assert!(said.contains("the filter `EKF`, one step each 1 µs"), "{said}");
    assert!(said.contains("other filters of the file, for `--filter`: `Euler EKF`"), "{said}");
}

#[test]
fn a_step_that_takes_longer_than_the_budget_is_refused_with_what_would_take_less() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let export = |more: &[&str]| {
        let experiment = "examples/shared_scanner/microcontroller.toml";
        let first = ["export", experiment, "--target", "c", "--filter", "EKF", "--json", "--force", "--out"];
        run(&[&first[..], &[out.to_str().unwrap()], more].concat())
    };
    let mut found = Vec::new();
    for cpu in ["cortex-m4f", "cortex-m7", "cortex-m0plus", "rv32imfc"] {
        let said = export(&["--cpu", cpu, "--project"]);
        let json: serde_json::Value = serde_json::from_slice(&said.stdout).unwrap();
        found.push(json["instructions"].as_f64().unwrap());
    }
    // Counted by QEMU: 581, 583, 36880 and 578.
    for (found, counted) in found.iter().zip([581.0, 583.0, 36880.0, 578.0]) {
        assert!((found / counted - 1.0).abs() < 0.2, "{found} and {counted}");
    }
    assert!(out.join("CMakeLists.txt").exists() && out.join("src/scanner_filter.c").exists());
    let limits = ["--cpu", "rv32imfc", "--clock", "100 MHz", "--budget"];
    let refused = export(&[&limits[..], &["1 us"]].concat());
    let said = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1));
    assert!(said.contains("--budget: a step takes about 11") && said.contains("`steady_state`"), "{said}");
    assert!(export(&[&limits[..], &["20 us"]].concat()).status.success());
}

#[test]
fn every_topic_in_the_list_has_a_text_that_names_chapters_and_topics_that_are_there() {
    let list = text(&run(&["help", "topics"]).stdout);
    let names: Vec<&str> = list
        .lines()
        .filter_map(|line| line.trim().strip_prefix("kalmems help ")?.split_whitespace().next())
        .collect();
    assert!(names.len() >= 16, "{list}");
    for name in
        names.iter().filter(|name| name.starts_with(|c: char| c.is_ascii_lowercase()) && **name != "device")
    {
        let said = text(&run(&["help", name]).stdout);
        assert!(said.contains("Book: "), "{name}");
        for topic in topics(&said) {
            assert!(names.contains(&topic.as_str()), "{name} names {topic}");
        }
    }
}

#[test]
fn a_ring_down_of_an_amplifier_that_inverts_is_refused_with_the_resistance_to_write() {
    let folder = tempfile::tempdir().unwrap();
    let example = |name: &str| root().join("examples/shared_scanner").join(name);
    let rows = std::fs::read_to_string(example("ring_down_recording.csv")).unwrap();
    let mut turned = String::new();
    // Enough cycles, and as few as a test needs.
    for line in rows.lines().take(6000) {
        turned += &match line
            .rsplit_once(',')
            .and_then(|(before, volts)| Some((before, volts.parse::<f64>().ok()?)))
        {
            Some((before, volts)) => format!("{before},{}\n", -volts),
            None => format!("{line}\n"),
        };
    }
    std::fs::write(folder.path().join("turned.csv"), turned).unwrap();
    let text = std::fs::read_to_string(example("ring_down.toml")).unwrap();
    let (device, _) = text.split_once("# Simulated by").unwrap();
    let recording = "[[recording]]\nrole = \"ring_down\"\nfile = \"turned.csv\"\nclock = { column = \"time_s\" }\nchannels = { current_signal = \"vo1_V\" }\n\
         [identify.ring_down]\nbias = \"23.76 V\"\nfeedback_resistance = \"17.86 kohm\"\n";
    let experiment = folder.path().join("turned.toml");
    std::fs::write(&experiment, format!("{device}{recording}")).unwrap();
    let out = folder.path().join("out");
    let output = run(&["identify", experiment.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    let said = text_of(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("write `feedback_resistance = \"-17860 ohm\"`"), "{said}");
}

fn text_of(output: &Output) -> String {
    text(&output.stderr) + &text(&output.stdout)
}

/// In a copy of a folder of the examples that holds its experiment files alone.
fn in_a_copy(of: &str, arguments: &[&str]) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("examples").join(of);
    std::fs::create_dir_all(&copy).unwrap();
    for entry in std::fs::read_dir(root().join("examples").join(of)).unwrap() {
        let file = entry.unwrap().path();
        if file.extension().is_some_and(|extension| extension == "toml") {
            std::fs::copy(&file, copy.join(file.file_name().unwrap())).unwrap();
        }
    }
    Command::new(env!("CARGO_BIN_EXE_kalmems")).current_dir(folder.path()).args(arguments).output().unwrap()
}

#[test]
fn a_file_that_another_command_makes_is_named_with_that_command() {
    let output = in_a_copy("piston_mirror", &["spectrum", "examples/piston_mirror/two_lines_spectrum.toml"]);
    let said = text(&output.stderr);
    assert!(
        said.contains("there is no file `examples/piston_mirror/../../out/simulated/two-lines/"),
        "{said}"
    );
    assert!(said.contains("`kalmems simulate examples/piston_mirror/two_lines.toml` makes it"), "{said}");
    let output = in_a_copy("shared_scanner", &["estimate", "examples/shared_scanner/recording.csv"]);
    let said = text(&output.stderr);
    assert!(said.contains("there is no such file"), "{said}");
    let recording = root().join("examples/shared_scanner/recording.csv").display().to_string();
    let said = text(&run(&["estimate", &recording]).stderr);
    assert!(
        said.contains(&format!("if it is a recording, `kalmems new {recording}` describes it")),
        "{said}"
    );
}

#[test]
fn an_identification_prints_numbers_in_the_units_of_the_experiment() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("identified").display().to_string();
    let output = run(&["identify", "examples/comb_resonator/experiment.toml", "--out", &out]);
    let printed = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    for shown in [" nN/V²", " N/m ", " nN s/m", " 1/m²", " µs", "the estimate of `x` changes by 1.1 µm rms"]
    {
        assert!(printed.contains(shown), "{shown}: {printed}");
    }
    assert!(!printed.contains("^-"), "{printed}");
}

#[test]
fn a_start_of_a_simulation_is_asked_for_without_the_states_of_another_device() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mirror.toml").display().to_string();
    let template = text(&run(&["new", "--device", "accelerometer"]).stdout);
    let line = template.lines().find(|line| line.starts_with("start = { displacement")).unwrap();
    std::fs::write(&file, template.replacen(line, "start = \"1 m\"", 1)).unwrap();
    let said = text(&run(&["simulate", &file]).stderr);
    assert!(said.contains("add the table `[simulate.start]` with a value for each name"), "{said}");
    assert!(said.contains("`kalmems help device NAME` lists") && !said.contains("angle"), "{said}");
}

#[test]
fn without_a_reference_nothing_speaks_of_errors() {
    let folder = tempfile::tempdir().unwrap();
    let example = root().join("examples/shared_scanner");
    std::fs::copy(example.join("recording.csv"), folder.path().join("recording.csv")).unwrap();
    let file = std::fs::read_to_string(example.join("experiment.toml")).unwrap();
    let (before, after) = file.split_once("[recording.reference]").unwrap();
    let (_, after) = after.split_once("\n[").unwrap();
    let experiment = folder.path().join("experiment.toml");
    std::fs::write(&experiment, format!("{before}[{after}")).unwrap();
    let (said, _) = estimated(experiment.to_str().unwrap(), &folder.path().join("out"));
    assert!(!said.contains("RMSE") && said.contains("mean NIS"), "{said}");
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    assert!(!page.contains("and the reference.") && !page.contains("largest angle error"));
    let metrics = std::fs::read_to_string(folder.path().join("out/metrics.json")).unwrap();
    let metrics: serde_json::Value = serde_json::from_str(&metrics).unwrap();
    let answer = metrics["answer"][0].as_str().unwrap();
    assert_eq!(said.lines().next(), Some(answer));
    // No line ends between ± and its number.
    assert!(page.contains(&answer.replace("± ", "±\u{a0}")), "{answer}");
}

#[cfg(unix)]
#[test]
fn long_work_shows_its_stage_on_a_terminal_of_80_columns() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = root().join("examples/vibrating_gyroscope/experiment.toml");
    let arguments = format!("estimate {} --out out", experiment.display());
    let Some((succeeded, said)) = super::new::on_a_terminal(&arguments, "", folder.path()) else { return };
    assert!(succeeded, "{said}");
    let drawn: Vec<&str> = said.split(['\r', '\n']).filter(|line| line.contains(" left")).collect();
    assert!(!drawn.is_empty(), "{said}");
    for line in drawn {
        let seen =
            line.split('\u{1b}').map(|part| part.split_once(['m', 'K', 'A']).map_or(part, |(_, seen)| seen));
        let seen: String = seen.collect();
        assert!(seen.chars().count() <= 80, "{seen}");
    }
}
