//! What comes from outside and is hostile, or too large.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn run(folder: &Path, arguments: &[&OsStr]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kalmems"))
        .current_dir(folder)
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

/// A device of equations whose measurement is a curve, with a filter, for a recording of this role.
fn experiment(measure: &str, more: &str) -> String {
    format!(
        r#"name = "oscillator"
[device.equations]
states = {{ x = "um", v = "um/s" }}
inputs = {{ drive = "V" }}
derivative = {{ x = "v", v = "force*drive - w0/50*v - w0^2*x" }}
measure = {{ signal = "{measure}" }}
noise = {{ signal = "1e-4[V^2]", v = "0.1[um^2/s^3]" }}
[device.equations.parameters]
w0 = "1916 rad/s"
force = "1e3 um/s^2/V"
gain = "1 V/um"
[[recording]]
file = "recording.csv"
clock = {{ rate = "10 kHz" }}
channels = {{ drive = "drive_V", signal = "signal_V" }}
{more}
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = {{ x = "0 um", v = "0 um/s" }}
start_sd = {{ x = "1 um", v = "1e3 um/s" }}
"#
    )
}

/// ESC, which begins commands of a terminal, and the letter that turns the direction of those behind it.
#[cfg(unix)]
#[test]
fn a_path_that_commands_a_terminal_is_shown_with_the_numbers_of_its_letters() {
    let folder = tempfile::tempdir().unwrap();
    let name = "a\u{1b}[2Jb\u{202e}c";
    let inner = folder.path().join(name);
    fs::create_dir(&inner).unwrap();
    let of_example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner");
    fs::copy(of_example.join("recording.csv"), inner.join(format!("{name}.csv"))).unwrap();
    let stream = fs::read_to_string(of_example.join("stream.toml")).unwrap();
    fs::write(inner.join("stream.toml"), stream).unwrap();
    let at = |file: &str| inner.join(file).into_os_string();
    let (recording, none) = (at(&format!("{name}.csv")), at("none.toml"));
    let option = OsStr::new(&format!("--{name}")).to_owned();
    for (command, code) in [
        // Its recording is not there.
        (vec![OsStr::new("estimate"), &at("stream.toml")], 1),
        (vec![OsStr::new("inspect"), &recording], 0),
        (vec![OsStr::new("stream"), &none], 1),
        (vec![OsStr::new("compare"), &none, &recording], 1),
        (vec![OsStr::new("estimate"), &option], 2),
    ] {
        let output = run(folder.path(), &command);
        assert_eq!(output.status.code(), Some(code), "{command:?}");
        let shown = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        assert!(!shown.contains(['\u{1b}', '\u{202e}']), "{command:?} {shown:?}");
        assert!(shown.contains("\\u{202e}"), "{command:?} {shown:?}");
    }
}

/// A missing sample would be waited for with all later ones in memory.
#[test]
fn a_stream_that_waits_for_too_many_samples_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let of_example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner");
    let stream = fs::read_to_string(of_example.join("stream.toml")).unwrap();
    fs::write(folder.path().join("s.toml"), stream.replace("wait = 32 ", "wait = 1000001 ")).unwrap();
    let output = run(folder.path(), &["stream", "s.toml"].map(OsStr::new));
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("stream.wait: found 1000001 samples; expected at most 1000000"), "{said}");
}

/// The file ends in words, which a table that is read to its end is refused for.
#[test]
fn a_curve_of_too_many_points_is_refused_before_it_is_read_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let tables = "role = \"test\"\n[device.equations.tables]\nC = { file = \"C.csv\", x = \"x_um\", y = \"C_V\" }\n[estimate]\nskip = \"0.1 s\"";
    fs::write(folder.path().join("e.toml"), experiment("C(x)", tables)).unwrap();
    for (rows, expected) in [(1_100_000, "more than 1048576 rows"), (1000, "`words` is no number")] {
        let points = (0..rows).fold(String::new(), |text, k| text + &format!("{k},{k}\n"));
        fs::write(folder.path().join("C.csv"), format!("x_um,C_V\n{points}words,0\n")).unwrap();
        let output = run(folder.path(), &["estimate", "e.toml", "--out", "out"].map(OsStr::new));
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(1) && said.contains(expected), "{said}");
    }
}

/// Runs the command in `folder` with at most so much memory.
#[cfg(target_os = "linux")]
fn limited(folder: &Path, limit_kb: u32, arguments: &str) -> Output {
    let script = format!("ulimit -v {limit_kb}; exec \"$0\" {arguments}");
    Command::new("sh")
        .current_dir(folder)
        .args(["-c", &script, env!("CARGO_BIN_EXE_kalmems")])
        .env_remove("RUST_BACKTRACE")
        .output()
        .unwrap()
}

/// Whatever the limit of the shell: a result, or an error that says how much memory was refused, and never a crash.
#[cfg(target_os = "linux")]
#[test]
fn a_limit_of_memory_is_an_error_with_its_size() {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner");
    let small = tempfile::tempdir().unwrap();
    let study = fs::read_to_string(example.join("study.toml")).unwrap();
    let simulation = example.join("simulation.toml").canonicalize().unwrap();
    let study = study.replace("points = 7", "points = 2").replace("repeats = 3", "repeats = 1");
    let study = study.replace("\"simulation.toml\"", &format!("{simulation:?}"));
    fs::write(small.path().join("study.toml"), study).unwrap();
    // Below that the system cannot load the program.
    let loaded_kb = (20_000..).step_by(1000).find(|kb| limited(&example, *kb, "--version").status.success());
    for (command, least) in [
        ("estimate experiment.toml --quiet --out OUT", 3),
        ("identify ring_down.toml --quiet --out OUT", 1),
        ("study SMALL/study.toml --threads 2 --quiet --out OUT", 2),
        ("stream stream.toml --from recording.csv --report OUT", 2),
    ] {
        let mut ends = Vec::new();
        for more_kb in [1000, 3000, 6000, 10_000, 20_000, 40_000, 90_000, 180_000, 300_000] {
            let limit_kb = loaded_kb.unwrap() + more_kb;
            let folder = tempfile::tempdir().unwrap();
            let out = folder.path().join("out");
            let place = |path: &Path| path.to_str().unwrap().to_owned();
            let command = command.replace("OUT", &place(&out)).replace("SMALL", &place(small.path()));
            let output = limited(&example, limit_kb, &command);
            let told = String::from_utf8_lossy(&output.stderr);
            let code = output.status.code();
            match code {
                Some(0) => {}
                Some(1) => {
                    assert!(told.contains("memory"), "{command} {limit_kb} kB: {told}");
                    assert!(!out.exists(), "{command} {limit_kb} kB: half a result");
                }
                _ => panic!("{command} {limit_kb} kB: {:?} {told}", output.status),
            }
            ends.push(code);
        }
        let refused = ends.iter().filter(|code| **code == Some(1)).count();
        assert!(refused >= least && ends.last() == Some(&Some(0)), "{command}: {ends:?}");
    }
}
