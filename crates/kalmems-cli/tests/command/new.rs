//! `kalmems new`: the way from a recording to an answer that the book shows, and what is refused.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

fn run(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kalmems")).current_dir(folder).args(arguments).output().unwrap()
}

fn recording() -> String {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    root.join("examples/shared_scanner/recording.csv").display().to_string()
}

/// The commands of the book's first chapter, and what it says of them.
#[test]
fn a_recording_leads_to_an_answer_that_passes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let made =
        run(&["new", &recording(), "--device", "shared_scanner", "--write", "my_scanner.toml"], folder);
    let said = String::from_utf8(made.stderr).unwrap();
    assert!(made.status.success(), "{said}");
    for sentence in [
        "`cap_V` is the channel `signal`, by its name: a swing of a steady size, its strongest line 461.91 mV at 31.35 kHz.",
        "`drive_V` is the channel `drive`, by its name: a swing of a steady size, its strongest line 90 V at 31.35 kHz.",
        "A steady motion: the signal is at 31.35 kHz, the drive at 31.35 kHz.",
        "estimate it with: kalmems estimate my_scanner.toml",
    ] {
        assert!(said.contains(sentence), "{said}");
    }
    // What a laboratory believes of its own device.
    let path = folder.join("my_scanner.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(
        text.contains("stiffness = \"1.10e-4 N m\"") && text.contains("noise_variance = \"from_recording\"")
    );
    std::fs::write(&path, text.replace("stiffness = \"1.10e-4 N m\"", "stiffness = \"1.1033e-4 N m\""))
        .unwrap();

    let first = run(&["estimate", "my_scanner.toml", "--out", "first", "--json"], folder);
    let metrics: serde_json::Value = serde_json::from_slice(&first.stdout).unwrap();
    let noise = &metrics["noise_from_recording"][0];
    assert_eq!(noise["key"], "device.shared_scanner.readout.noise_variance");
    assert_eq!(noise["filter"], "EKF, stiffness as a state");
    let found: f64 = noise["written"].as_str().unwrap().strip_suffix(" V^2").unwrap().parse().unwrap();
    assert!((found / 1.92e-4 - 1.0).abs() < 0.03, "{noise}");
    // What was used stands in the result.
    let used = std::fs::read_to_string(folder.join("first/run.toml")).unwrap();
    assert!(!used.contains("from_recording"), "{used}");

    let diagnosed = run(&["diagnose", "my_scanner.toml", "--write", "mended.toml"], folder);
    let said = String::from_utf8(diagnosed.stdout).unwrap();
    assert!(diagnosed.status.success() && said.contains("resonator.stiffness = \"1.100"), "{said}");
    for (file, code) in [("my_scanner.toml", Some(3)), ("mended.toml", Some(0))] {
        let judged = run(&["estimate", file, "--strict", "--out", &format!("out_{file}")], folder);
        assert_eq!(judged.status.code(), code, "{file}: {}", String::from_utf8_lossy(&judged.stdout));
    }
}

#[test]
fn all_devices_are_listed_and_a_template_is_simulated() {
    let folder = tempfile::tempdir().unwrap();
    let listed = String::from_utf8(run(&["new", "--list"], folder.path()).stdout).unwrap();
    for device in
        ["shared_scanner", "threshold_scanner", "micro_stage", "accelerometer", "piston_mirror", "equations"]
    {
        assert!(listed.lines().any(|line| line.starts_with(&format!("{device}: "))), "{listed}");
    }
    let printed = run(&["new", "--device", "threshold_scanner"], folder.path());
    let text = String::from_utf8(printed.stdout).unwrap();
    assert!(text.starts_with("name = \"my_threshold_scanner\""), "{text}");
    std::fs::write(folder.path().join("planned.toml"), text).unwrap();
    let simulated = run(&["simulate", "planned.toml", "--out", "planned"], folder.path());
    assert!(simulated.status.success(), "{}", String::from_utf8_lossy(&simulated.stderr));
}

#[test]
fn nothing_is_replaced_and_what_is_missing_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("mine.toml"), "mine").unwrap();
    std::fs::write(folder.join("scope.csv"), "time_s,CH1_V,CH2_V\n0,1,2\n1e-6,2,1\n2e-6,1,2\n").unwrap();
    let recording = recording();
    for (arguments, why, code) in [
        (vec!["new", "--device", "piston_mirror", "--write", "mine.toml"], "exists already", 1),
        (vec!["new", "--device", "mirror"], "expected one of `shared_scanner`", 1),
        (
            vec!["new", "scope.csv", "--device", "shared_scanner"],
            "state which, such as `--channel drive=CH1_V`",
            1,
        ),
        (
            vec!["new", &recording, "--device", "shared_scanner", "--further", "rest=a.csv"],
            "found the role `rest`",
            1,
        ),
        (vec!["new", &recording], "add `--device NAME`, such as `--device shared_scanner`", 2),
        (
            vec!["new", "scope.csv", "--device", "shared_scanner", "--time", "CH1_V=V"],
            "expected a unit of time, such as `s`",
            1,
        ),
        (
            vec!["new", "scope.csv", "--device", "shared_scanner", "--time", "t=s"],
            "has no column `t` with times; its other columns are `time_s`, `CH1_V` and `CH2_V`",
            1,
        ),
        (
            vec!["new", "--device", "shared_scanner", "--value", "comb.width=1 m"],
            "found the number `comb.width`; the device has `resonator.inertia`",
            1,
        ),
        (
            vec!["new", "--device", "shared_scanner", "--value", "comb.angular_width=1 m"],
            "expected an angle",
            1,
        ),
    ] {
        let output = run(&arguments, folder);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(code) && said.contains(why), "{arguments:?}: {said}");
    }
    assert_eq!(std::fs::read_to_string(folder.join("mine.toml")).unwrap(), "mine");
}

/// Without a device the columns are described, and each device whose channels they may be has a command that runs as printed.
#[test]
fn without_a_device_the_columns_are_described_and_the_commands_that_name_one_run() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::copy(recording(), folder.join("my recording.csv")).unwrap();
    let output = run(&["new", "my recording.csv"], folder);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{said}");
    for sentence in [
        "`time_s` is the time, as its name begins with it and ends with a unit of time.",
        "It has 24001 samples at 1 MHz, 24 ms.",
        "`drive_V` seems to be the drive, by its name: a swing of a steady size, its strongest line 90 V at 31.35 kHz.",
        "`cap_V` seems to be the signal, by its name: a swing of a steady size, its strongest line 461.91 mV at 31.35 kHz.",
        "A steady motion: the signal is at 31.35 kHz, the drive at 31.35 kHz.",
        "piston_mirror: `signal` (the measured capacitance, in F)",
    ] {
        assert!(said.contains(sentence), "{said}");
    }
    let commands: Vec<&str> = said
        .lines()
        .filter_map(|line| line.trim().strip_prefix("kalmems new ").filter(|line| line.contains("--device")))
        .collect();
    assert!(commands.len() >= 4, "{said}");
    for command in commands {
        let words =
            command.replace("'my recording.csv'", "RECORDING").replace("'my recording.toml'", "TARGET");
        let words: Vec<&str> = words.split(' ').collect();
        let words = words.iter().map(|word| match *word {
            "RECORDING" => "my recording.csv",
            "TARGET" => "my recording.toml",
            word => word,
        });
        let arguments: Vec<&str> = ["new"].into_iter().chain(words).chain(["--force"]).collect();
        let made = run(&arguments, folder);
        assert!(made.status.success(), "{command}: {}", String::from_utf8_lossy(&made.stderr));
    }
    // Of columns that no name tells, the command takes each once.
    std::fs::write(folder.join("scope.csv"), "time_s,CH1_V,CH2_V\n0,1,2\n1e-6,2,1\n2e-6,1,2\n").unwrap();
    let said = String::from_utf8(run(&["new", "scope.csv"], folder).stderr).unwrap();
    assert!(
        said.contains(
            "--device shared_scanner --channel drive=CH1_V --channel signal=CH2_V --write scope.toml"
        ),
        "{said}"
    );
    let output = run(&["new", "scope.csv", "--json"], folder);
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["questions"][0]["meaning"], "device");
    assert_eq!(found["recordings"][0]["columns"][0]["seems"], "unknown");
    assert!(found["devices"].as_array().unwrap().iter().any(|fit| fit["name"] == "equations"), "{found}");
}

/// A number in which nothing of the order of its index is left (the finaliser of `MurmurHash3`).
const fn mixed(index: u32) -> u32 {
    let mut mixed = index.wrapping_mul(0x9E37_79B9);
    mixed = (mixed ^ (mixed >> 16)).wrapping_mul(0x85EB_CA6B);
    mixed = (mixed ^ (mixed >> 13)).wrapping_mul(0xC2B2_AE35);
    mixed ^ (mixed >> 16)
}

/// Rows of a scanner's recording in one CSV file, by what drive and signal do.
fn columns(path: &Path, header: &str, row: impl Fn(f64) -> (f64, f64)) {
    let mut text = format!("{header}\n");
    for k in 0..6000_u32 {
        let time = f64::from(k) * 1e-6;
        let (drive, signal) = row(time);
        let noise = f64::from(mixed(k) >> 8) / f64::from(1_u32 << 24) - 0.5;
        text += &format!("{time:.6},{drive:.6},{:.6}\n", signal + 0.01 * noise);
    }
    std::fs::write(path, text).unwrap();
}

/// Each of several recordings has columns of its own and the role of what it shows.
#[test]
fn further_recordings_have_their_own_columns_and_the_roles_of_what_they_show() {
    use std::f64::consts::TAU;
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::copy(recording(), folder.join("driven.csv")).unwrap();
    let swing = |t: f64| (TAU * 31e3 * t).sin();
    columns(&folder.join("decay.csv"), "t_s,excitation_V,out_V", |t| {
        (0.0, 0.5 * (-t / 2e-3).exp() * swing(t))
    });
    columns(&folder.join("rest.csv"), "time_s,drive_V,cap_V", |_| (0.0, 0.0));
    columns(&folder.join("chirp.csv"), "time_s,drive_V,cap_V", |t| {
        let drive = (TAU * (20e3 * t + 0.5 * 4e6 * t * t)).sin();
        (60.0 + 30.0 * drive, 0.2 * drive)
    });
    columns(&folder.join("other.csv"), "time_s,CH1_V,CH2_V", |t| (60.0 + 30.0 * swing(t), 0.4 * swing(t)));
    let files = ["driven.csv", "decay.csv", "rest.csv", "chirp.csv", "other.csv"];
    let mut arguments = vec!["new"];
    arguments.extend(files);
    arguments.extend(["--device", "shared_scanner", "--write", "new.toml"]);
    let asked = run(&arguments, folder);
    let said = String::from_utf8(asked.stderr).unwrap();
    assert!(
        said.contains("`other.csv`: `drive`, the voltage that drives the device, may be `CH1_V` and `CH2_V`"),
        "{said}"
    );
    arguments.extend(["--channel", "drive=CH1_V"]);
    let made = run(&arguments, folder);
    let said = String::from_utf8(made.stderr).unwrap();
    assert!(made.status.success(), "{said}");
    for sentence in [
        "A free decay: the signal is at 31 kHz, the drive is always 0 V.",
        "A sweep: the frequency of the drive goes from about",
    ] {
        assert!(said.contains(sentence), "{said}");
    }
    let experiment: toml::Table = std::fs::read_to_string(folder.join("new.toml")).unwrap().parse().unwrap();
    let recordings = experiment["recording"].as_array().unwrap();
    let found: Vec<[&str; 5]> = recordings
        .iter()
        .map(|one| {
            let text = |value: &'static str| one[value].as_str().unwrap();
            let channel = |name: &str| one["channels"][name].as_str().unwrap();
            [
                text("file"),
                text("role"),
                one["clock"]["column"].as_str().unwrap(),
                channel("drive"),
                channel("signal"),
            ]
        })
        .collect();
    assert_eq!(
        found,
        [
            ["driven.csv", "test", "time_s", "drive_V", "cap_V"],
            ["decay.csv", "ring_down", "t_s", "excitation_V", "out_V"],
            ["rest.csv", "zero_drive", "time_s", "drive_V", "cap_V"],
            ["chirp.csv", "sweep", "time_s", "drive_V", "cap_V"],
            ["other.csv", "steady_state", "time_s", "CH1_V", "CH2_V"],
        ]
    );
    // A role that is stated counts.
    let arguments = ["new", "driven.csv", "--further", "training=rest.csv", "--device", "shared_scanner"];
    let stated = String::from_utf8(run(&arguments, folder).stdout).unwrap();
    assert!(stated.contains("role = \"training\"\nname = \"training-2\"\nfile = \"rest.csv\""), "{stated}");
    // A decay without a column for the drive says why it is not used.
    let decay = std::fs::read_to_string(folder.join("decay.csv")).unwrap();
    let cells = decay
        .lines()
        .map(|line| line.split(',').collect::<Vec<_>>())
        .map(|cells| format!("{},{}\n", cells[0], cells[2]));
    std::fs::write(folder.join("undriven.csv"), cells.collect::<String>()).unwrap();
    let arguments =
        ["new", "driven.csv", "undriven.csv", "--device", "shared_scanner", "--write", "two.toml"];
    let said = String::from_utf8(run(&arguments, folder).stderr).unwrap();
    assert!(said.contains("It is not used, as it has no column for `drive`"), "{said}");
    let estimated = run(&["estimate", "two.toml", "--out", "two"], folder);
    assert!(estimated.status.success(), "{}", String::from_utf8_lossy(&estimated.stderr));
}

/// A column `t` is no time until somebody says its unit.
#[test]
fn a_time_without_a_unit_is_asked_for_with_the_rate_that_each_unit_means() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let text = std::fs::read_to_string(recording()).unwrap();
    std::fs::write(folder.join("plain.csv"), text.replacen("time_s", "t", 1)).unwrap();
    let refused = run(&["new", "plain.csv", "--device", "shared_scanner"], folder);
    let said = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(1), "{said}");
    for sentence in [
        "`t` may be the time, as it grows from 0 to 0.024 in steps of 1e-6; its name has no unit, such as `t_s`.",
        "`--time t=s` if the samples follow each other at 1 MHz",
        "`--time t=ms` if the samples follow each other at 1 GHz",
    ] {
        assert!(said.contains(sentence), "{said}");
    }
    let arguments =
        ["new", "plain.csv", "--device", "shared_scanner", "--time", "t=s", "--write", "plain.toml"];
    let made = run(&arguments, folder);
    let said = String::from_utf8(made.stderr).unwrap();
    assert!(made.status.success() && said.contains("It has 24001 samples at 1 MHz, 24 ms."), "{said}");
    let text = std::fs::read_to_string(folder.join("plain.toml")).unwrap();
    assert!(text.contains("clock = { column = \"t\", unit = \"s\" }"), "{text}");
    let estimated = run(&["estimate", "plain.toml", "--strict", "--out", "plain"], folder);
    assert!(estimated.status.success(), "{}", String::from_utf8_lossy(&estimated.stderr));
}

/// Numbers that no recording shows are options as well.
#[test]
fn a_number_of_the_device_is_stated_by_the_end_of_its_key() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "new",
        &recording(),
        "--device",
        "shared_scanner",
        "--value",
        "comb.angular_width=0.21 rad",
        "--value",
        "readout.gain=-0.36 V/pF",
    ];
    let made = run(&arguments, folder.path());
    let text = String::from_utf8(made.stdout).unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    assert!(
        text.contains("angular_width = \"0.21 rad\"") && text.contains("gain = \"-0.36 V/pF\""),
        "{text}"
    );
    let arguments = ["new", "--device", "threshold_scanner", "--value", "resonator.damping_ratio=0.007"];
    let text = String::from_utf8(run(&arguments, folder.path()).stdout).unwrap();
    assert!(text.contains("damping_ratio = 0.007"), "{text}");
}

/// What a command prints on a terminal of its own, with these answers; `script` of util-linux makes one. `None` where there is none.
pub(super) fn on_a_terminal(arguments: &str, answers: &str, folder: &Path) -> Option<(bool, String)> {
    let command = format!("{} {arguments}", env!("CARGO_BIN_EXE_kalmems").replace(' ', "\\ "));
    let script = Command::new("script")
        .current_dir(folder)
        .args(["-qec", &command, "/dev/null"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn();
    let Ok(mut script) = script else {
        println!("SKIPPED: there is no `script`");
        return None;
    };
    script.stdin.take().unwrap().write_all(answers.as_bytes()).unwrap();
    let output = script.wait_with_output().unwrap();
    Some((output.status.success(), String::from_utf8_lossy(&output.stdout).into_owned()))
}

#[test]
fn a_terminal_is_asked_for_device_times_columns_and_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let row = |k: u32| format!("{:.6},{},{}\n", f64::from(k) * 1e-6, 90 + k % 32, 0.1 * f64::from(k % 16));
    let rows: String = (0..3000).map(row).collect();
    std::fs::write(folder.path().join("scope.csv"), format!("t,CH1_V,CH2_V\n{rows}")).unwrap();
    // The unit of the times, the device, the drive; the inertia as it is, a wrong comb that is asked for again, and no more.
    let answers = "s\nshared_scanner\n1\n\n5 V\n5.6 pF\n";
    let Some((succeeded, said)) = on_a_terminal("new scope.csv --write new.toml", answers, folder.path())
    else {
        return;
    };
    for asked in [
        "What is its unit?",
        "1: s, so that the samples follow each other at 1 MHz",
        "`CH1_V` seems to be unknown",
        "Which device was recorded?",
        "Which column of scope.csv is `drive`, the voltage that drives the device?",
        "No recording shows the following numbers.",
        "resonator.inertia [1.15e-14 kg m^2]:",
        "expected a capacitance",
    ] {
        assert!(said.contains(asked), "{asked}: {said}");
    }
    assert!(succeeded, "{said}");
    let text = std::fs::read_to_string(folder.path().join("new.toml")).unwrap();
    assert!(text.contains("channels = { drive = \"CH1_V\", signal = \"CH2_V\" }"), "{text}");
    assert!(
        text.contains("nominal_capacitance = \"5.6 pF\"") && text.contains("inertia = \"1.15e-14 kg m^2\""),
        "{text}"
    );
}

/// What a page with a form needs to ask.
#[test]
fn open_questions_are_json_for_a_program_that_asks_and_an_answer_closes_one() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("scope.csv"), "time_s,CH1_V,CH2_V\n0,1,2\n1e-6,2,1\n2e-6,1,2\n").unwrap();
    let asked = |channels: &[&str]| {
        let mut arguments = vec!["new", "scope.csv", "--device", "shared_scanner", "--json"];
        for channel in channels {
            arguments.extend(["--channel", channel]);
        }
        let output = run(&arguments, folder);
        let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        (output.status.code(), told)
    };
    let (code, told) = asked(&[]);
    assert_eq!(code, Some(1));
    assert_eq!(told["questions"][0]["meaning"], "drive");
    assert_eq!(told["questions"][0]["candidates"], serde_json::json!(["CH1_V", "CH2_V"]));
    let (code, told) = asked(&["drive=CH2_V"]);
    assert_eq!((code, told["questions"].is_null()), (Some(0), true), "{told}");
}

/// A name of a file that turns the direction of the letters after it, where somebody at a terminal is asked for the rate of its samples.
#[cfg(target_os = "linux")]
#[test]
fn a_question_shows_what_a_name_does_to_a_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(recording()).unwrap();
    let rows: Vec<&str> = text.lines().map(|line| line.split_once(',').unwrap().1).collect();
    let name = "a\u{202e}b.csv";
    std::fs::write(folder.path().join(name), rows.join("\n")).unwrap();
    let command = format!("{} new {name} --device shared_scanner", env!("CARGO_BIN_EXE_kalmems"));
    let mut script = Command::new("script");
    script.args(["-qec", &command, "/dev/null"]).current_dir(folder.path());
    let Ok(mut child) = script.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn() else {
        eprintln!("skipped: `script` is not installed");
        return;
    };
    child.stdin.take().unwrap().write_all(b"1 MHz\n").unwrap();
    let output = child.wait_with_output().unwrap();
    let shown = String::from_utf8_lossy(&output.stdout);
    assert!(shown.contains("Its sampling rate, such as 1 MHz"), "{shown}");
    assert!(
        shown.contains("a\\u{202e}b.csv has no column of times") && !shown.contains('\u{202e}'),
        "{shown}"
    );
}
