//! Every command ends within a second of a signal, whatever it does at the time.
#![cfg(unix)]

use std::fs::OpenOptions;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").canonicalize().unwrap()
}

/// How long a command may take to end: a second, and what a busy machine takes to start and end processes.
const MOST: Duration = Duration::from_millis(1500);

fn start(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_kalmems"))
        .current_dir(folder)
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Ends a command by a signal after it has worked for a while, and finds that it ends in time.
fn ends(what: &str, mut child: Child, signal: &str, codes: &[i32]) {
    std::thread::sleep(Duration::from_millis(700));
    assert_eq!(child.try_wait().unwrap(), None, "{what} had ended before it was interrupted");
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
    let sent = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            assert!(codes.iter().any(|code| status.code() == Some(*code)), "{what} {signal}: {status}");
            return;
        }
        if sent.elapsed() > MOST {
            let _ = child.kill();
            let _ = child.wait();
            panic!("{what} goes on after {signal}");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// The files of an example in a folder of its own.
fn copied(example: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(examples().join(example)).unwrap() {
        let path = entry.unwrap().path();
        std::fs::copy(&path, folder.path().join(path.file_name().unwrap())).unwrap();
    }
    folder
}

/// Puts a pipe in a file's place whose other end says nothing, and keeps that end open.
fn silent(path: &Path) -> std::fs::File {
    std::fs::remove_file(path).unwrap();
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
    OpenOptions::new().read(true).write(true).open(path).unwrap()
}

#[test]
fn a_command_that_waits_for_a_silent_pipe_ends_within_a_second_of_a_signal() {
    for (example, pipe, arguments) in [
        ("shared_scanner", "recording.csv", &["estimate", "experiment.toml", "--out", "out"][..]),
        ("shared_scanner", "reference.csv", &["estimate", "experiment.toml", "--out", "out"]),
        ("shared_scanner", "recording.csv", &["inspect", "recording.csv"]),
        ("shared_scanner", "ring_down_recording.csv", &["identify", "ring_down.toml", "--out", "out"]),
        ("shared_scanner", "image_intensity.csv", &["image", "image.toml", "--out", "out"]),
        ("shared_scanner", "image_trajectory.csv", &["image", "image.toml", "--out", "out"]),
        ("gyroscope", "rest.csv", &["calibrate", "gyro", "calibration.toml", "--out", "out"]),
        ("gyroscope", "vibrometer.csv", &["calibrate", "gyro", "calibration.toml", "--out", "out"]),
    ] {
        for signal in ["-INT", "-TERM"] {
            let folder = copied(example);
            let _other_end = silent(&folder.path().join(pipe));
            ends(&format!("{arguments:?}"), start(folder.path(), arguments), signal, &[130]);
        }
    }
    // What has been written is what a stream has.
    for signal in ["-INT", "-TERM"] {
        let folder = copied("shared_scanner");
        let child = start(folder.path(), &["stream", "stream.toml", "--lines", "lines.jsonl"]);
        ends("stream", child, signal, &[0, 130]);
    }
}

#[test]
fn a_spectrum_that_waits_for_a_silent_pipe_ends_within_a_second_of_a_signal() {
    let folder = copied("piston_mirror");
    let spectrum = folder.path().join("two_lines_spectrum.toml");
    let text = std::fs::read_to_string(&spectrum).unwrap();
    std::fs::write(&spectrum, text.replace("../../out/simulated/two-lines/reference.csv", "reference.csv"))
        .unwrap();
    let _other_end = silent(&folder.path().join("reference.csv"));
    for signal in ["-INT", "-TERM"] {
        let arguments = ["spectrum", "two_lines_spectrum.toml", "--out", "out"];
        ends("spectrum", start(folder.path(), &arguments), signal, &[130]);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_stream_of_a_silent_serial_device_ends_within_a_second_of_a_signal() {
    use std::os::fd::AsRawFd;
    let Ok((_instrument, device)) = serial2::SerialPort::pair() else {
        eprintln!("SKIPPED: there are no pseudo-terminals here");
        return;
    };
    let folder = copied("shared_scanner");
    let path = std::fs::read_link(format!("/proc/self/fd/{}", device.as_raw_fd())).unwrap();
    let arguments = ["stream", "stream.toml", "--baud", "921600", "--from", path.to_str().unwrap()];
    for signal in ["-INT", "-TERM"] {
        ends("stream", start(folder.path(), &arguments), signal, &[130]);
    }
}

#[test]
fn a_command_that_computes_ends_within_a_second_of_a_signal() {
    let folder = copied("shared_scanner");
    let simulation = folder.path().join("simulation.toml");
    let toml = std::fs::read_to_string(&simulation).unwrap();
    let long: String =
        toml.lines()
            .map(|line| {
                if line.starts_with("duration") {
                    "duration = \"200 s\"\n".into()
                } else {
                    format!("{line}\n")
                }
            })
            .collect();
    std::fs::write(&simulation, long).unwrap();
    for arguments in [
        &["simulate", "simulation.toml", "--out", "out"][..],
        &["study", "study.toml", "--out", "out", "--threads", "1"],
        #[cfg(feature = "papers")]
        &["reproduce", "shared_scanner", "--out", "out", "--threads", "1"],
    ] {
        for signal in ["-INT", "-TERM"] {
            ends(&format!("{arguments:?}"), start(folder.path(), arguments), signal, &[130]);
        }
    }
}
