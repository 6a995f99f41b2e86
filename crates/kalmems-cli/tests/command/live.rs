//! A stream that runs for days: files that follow each other, what watches it, and what it says of its own speed.
#![cfg(unix)]

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn example(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../examples/shared_scanner")
        .join(file)
        .canonicalize()
        .unwrap()
}

/// The example with these lines in `[stream]`, in a folder.
fn streaming(folder: &Path, lines: &str) -> PathBuf {
    let text = fs::read_to_string(example("stream.toml")).unwrap();
    assert!(text.contains("every = 10"));
    let experiment = folder.join("stream.toml");
    fs::write(&experiment, text.replace("every = 10", &format!("{lines}\nevery = 10"))).unwrap();
    experiment
}

fn kalmems(experiment: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kalmems"));
    command.arg("stream").arg(experiment).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Waits until something is so.
fn wait_until(what: &str, is_so: impl Fn() -> bool) {
    let begun = Instant::now();
    while !is_so() {
        assert!(begun.elapsed() < Duration::from_secs(60), "{what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
}

/// The files of a folder that are completed, by their names in order of time, and then the present one.
fn series(folder: &Path, stem: &str, present: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = (fs::read_dir(folder).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.file_name().unwrap().to_str().unwrap().starts_with(&format!("{stem}-")))
        .collect();
    // `x-T.txt` is before `x-T-2.txt`.
    files.sort_by_key(|path| {
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let mut parts = name.splitn(3, '-').skip(1).map(str::to_owned);
        (parts.next().unwrap(), parts.next().map_or(1, |number| number.parse::<u32>().unwrap()))
    });
    files.push(folder.join(present));
    files
}

#[test]
fn files_that_follow_each_other_hold_together_what_one_holds_and_each_says_how_to_read_it() {
    let folder = tempfile::tempdir().unwrap();
    let recording = example("recording.csv");
    let whole = kalmems(&example("stream.toml")).arg("--from").arg(&recording).output().unwrap();
    let whole = String::from_utf8(whole.stdout).unwrap();
    let output = kalmems(&example("stream.toml"))
        .current_dir(folder.path())
        .arg("--from")
        .arg(&recording)
        .args(["--lines", "l.txt", "--frames", "f.bin", "--rotate-size", "200 kB"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let files = series(folder.path(), "l", "l.txt");
    assert!(files.len() > 3, "{files:?}");
    let mut lines = Vec::new();
    for path in &files {
        let text = fs::read_to_string(path).unwrap();
        assert!(text.starts_with("# ekf,time_s,angle_rad") && text.ends_with('\n'), "{path:?}");
        assert!(text.len() < 300_000, "{path:?}");
        lines.extend(
            text.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect::<Vec<_>>(),
        );
    }
    assert!(lines.iter().map(String::as_str).eq(whole.lines().filter(|line| !line.starts_with('#'))));
    let files = series(folder.path(), "f", "f.bin");
    assert!(files.len() > 2, "{files:?}");
    for path in &files {
        let bytes = fs::read(path).unwrap();
        let mut rest = &bytes[..];
        while !rest.is_empty() {
            assert!(rest.starts_with(b"kmEs") || rest.starts_with(b"kmZp"), "{path:?}");
            rest = &rest[8 + 8 * usize::from(u16::from_le_bytes([rest[6], rest[7]]))..];
        }
    }
    for (option, value, expected) in [
        ("--rotate-size", "5", "expected a size of 1 kB or more such as `100 MB`"),
        ("--rotate-every", "1 ms", "expected a time of 1 s or more such as `1 h`"),
        ("--rotate-every", "1 V", "1 V"),
    ] {
        let output = kalmems(&example("stream.toml")).args([option, value]).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(
            output.status.code() == Some(1) && said.contains(option) && said.contains(expected),
            "{said}"
        );
    }
}

#[test]
fn a_pause_that_is_longer_than_the_time_of_a_file_is_followed_by_the_next_file_and_no_line_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = fs::read(example("recording.csv")).unwrap();
    let half = bytes.split(|byte| *byte == b'\n').take(12_001).map(|line| line.len() + 1).sum::<usize>();
    let whole =
        kalmems(&example("stream.toml")).arg("--from").arg(example("recording.csv")).output().unwrap();
    let whole = String::from_utf8(whole.stdout).unwrap();
    let mut child = kalmems(&example("stream.toml"))
        .current_dir(folder.path())
        .args(["--lines", "l.txt", "--to", "mcap://m.mcap", "--rotate-every", "1 s"])
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    input.write_all(&bytes[..half]).unwrap();
    let estimates = |path: &PathBuf| {
        let text = fs::read_to_string(path).unwrap();
        text.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect::<Vec<_>>()
    };
    let files = || series(folder.path(), "l", "l.txt");
    wait_until("estimates of the first half", || {
        let found = || files().iter().flat_map(estimates).filter(|line| line.starts_with("ekf,")).count();
        folder.path().join("l.txt").exists() && found() >= 1199
    });
    let before = files().len();
    std::thread::sleep(Duration::from_millis(1100));
    assert_eq!(files().len(), before, "a file is completed when the next line comes");
    input.write_all(&bytes[half..]).unwrap();
    drop(input);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    // Two, or more where the estimates themselves take longer than a second.
    let files = files();
    assert!(files.len() > before, "{files:?}");
    let all: Vec<String> = files.iter().flat_map(estimates).collect();
    // Which lines stand between those of an estimator depends on how many samples come at once.
    for begins in ["ekf,", "ekf_lagged,"] {
        let own = all.iter().map(String::as_str).filter(|line| line.starts_with(begins));
        assert!(own.eq(whole.lines().filter(|line| line.starts_with(begins))), "{begins}");
    }
    let is_passage = |line: &&str| line.starts_with("event,{\"event\":\"zero_phase\",");
    let count = all.iter().map(String::as_str).filter(is_passage).count();
    assert_eq!(count, whole.lines().filter(is_passage).count());
    assert!(files.iter().all(|path| fs::read_to_string(path).unwrap().starts_with("# ekf,time_s,angle_rad")));
    assert!(series(folder.path(), "m", "m.mcap").len() > 1);
}

/// An oscillator whose rates are those of `tools/stream_day.py` times a factor; its samples come without times.
fn oscillator(folder: &Path, factor: f64) -> PathBuf {
    let (w, force, rate) = (factor * 1916.0, factor * factor * 1e3, factor * 1e4);
    let text = format!(
        r#"name = "oscillator"
[device.equations]
states = {{ x = "um", v = "um/s" }}
inputs = {{ drive = "V" }}
derivative = {{ x = "v", v = "force*drive - w/50*v - w^2*x" }}
measure = {{ signal = "gain*x in V" }}
noise = {{ signal = "1e-4[V^2]", v = "{}[um^2/s^3]" }}
[device.equations.parameters]
w = "{w} rad/s"
force = "{force} um/s^2/V"
gain = "1 V/um"
[[recording]]
role = "test"
file = "none.csv"
clock = {{ rate = "{rate} Hz" }}
channels = {{ drive = "drive_V", signal = "signal_V" }}
[stream]
rate = "{rate} Hz"
[stream.input.text]
columns = ["drive_V", "signal_V"]
[estimate]
skip = "{} s"
[[estimate.filter]]
name = "EKF"
method = "ekf"
start = {{ x = "0 um", v = "0 um/s" }}
start_sd = {{ x = "1 um", v = "{} um/s" }}
"#,
        0.1 * factor.powi(3),
        0.1 / factor,
        1e3 * factor,
    );
    let path = folder.join("oscillator.toml");
    fs::write(&path, text).unwrap();
    path
}

/// Memory, times and errors of a million samples, each as that tool wants them of a day.
#[test]
fn a_million_samples_take_constant_memory_and_do_not_drift() {
    let day = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tools/stream_day.py");
    let mut python = Command::new("python3");
    let Ok(run) = python.arg(day).arg(env!("CARGO_BIN_EXE_kalmems")).args(["--seconds", "100"]).output()
    else {
        println!("skipped: python3 is not installed");
        return;
    };
    let [told, failed] = [&run.stdout, &run.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    assert!(run.status.success(), "{told}{failed}");
}

/// The events of a name of a stream from a connection, with the exit code.
fn events_from_tcp(experiment: &Path, bytes: &[u8], name: &str) -> (Option<i32>, Vec<serde_json::Value>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp://{}", listener.local_addr().unwrap());
    let child = kalmems(experiment).args(["--from", &address]).spawn().unwrap();
    let mut connection = listener.accept().unwrap().0;
    let bytes = [bytes, b"# end\n"].concat();
    let sender = std::thread::spawn(move || connection.write_all(&bytes).map(|()| connection));
    let output = child.wait_with_output().unwrap();
    let sent = sender.join().unwrap();
    let lines = String::from_utf8(output.stdout).unwrap();
    let events = lines.lines().filter_map(|line| line.strip_prefix("event,"));
    let events = events.map(|event| serde_json::from_str::<serde_json::Value>(event).unwrap());
    let found = events.filter(|event| event["event"] == name).collect();
    assert!(sent.is_ok(), "{}", String::from_utf8_lossy(&output.stderr));
    (output.status.code(), found)
}

/// Samples of 1 GHz, which no machine estimates, of 100 Hz, and of the example, whose recording is 24 ms long. There are so many of them that
/// the trial, 25 ms of work, is over before they are on a machine of ten times the speed, too.
#[test]
fn a_stream_says_at_its_beginning_that_its_samples_come_faster_than_they_can_be_estimated() {
    let folder = tempfile::tempdir().unwrap();
    for (factor, expected) in [(1e5, 1), (1e-2, 0)] {
        let motion = |k: f64, gain: f64, phase: f64| gain * (std::f64::consts::TAU * 0.03 * k - phase).cos();
        let row =
            |k: i32| format!("{},{}\n", motion(f64::from(k), 1.0, 0.0), motion(f64::from(k), 7e-3, 0.5));
        let rows = (0..400_000).fold(String::new(), |text, k| text + &row(k));
        let (code, events) = events_from_tcp(&oscillator(folder.path(), factor), rows.as_bytes(), "too_slow");
        assert!(matches!(code, Some(0 | 6)), "{code:?}");
        assert_eq!(events.len(), expected, "{factor} {events:?}");
        for event in events {
            let sustained_hz = event["sustained_hz"].as_f64().unwrap();
            assert!(event["rate_hz"] == 1e9 && sustained_hz < 1e9, "{event}");
        }
    }
    let recording = fs::read(example("recording.csv")).unwrap();
    let (code, events) = events_from_tcp(&example("stream.toml"), &recording, "too_slow");
    assert_eq!(code, Some(0));
    let [event] = &events[..] else { panic!("{events:?}") };
    assert_eq!(event["rate_hz"], 1e6);
    assert!(event["time_s"].as_f64().is_some_and(|time_s| time_s < 0.024), "{event}");
    // Those of the piston mirror's example can, but for what other work on the machine holds up.
    let recording = fs::read(example("../piston_mirror/recording.csv")).unwrap();
    let holds = || {
        ["too_slow", "behind"].into_iter().all(|name| {
            let (code, events) = events_from_tcp(&example("../piston_mirror/stream.toml"), &recording, name);
            assert_eq!(code, Some(0));
            events.is_empty()
        })
    };
    assert!((0..4).any(|_| holds()));
}

/// A hang-up completes the files; the experiment is not read again, and no sample is lost.
#[test]
fn a_hangup_begins_the_next_file_and_ends_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = streaming(folder.path(), "");
    let bytes = fs::read(example("recording.csv")).unwrap();
    let half = bytes.split(|byte| *byte == b'\n').take(12_001).map(|line| line.len() + 1).sum::<usize>();
    let mut child = kalmems(&experiment)
        .current_dir(folder.path())
        .args(["--lines", "l.txt", "--to", "mcap://m.mcap", "--json"])
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    input.write_all(&bytes[..half]).unwrap();
    let count = |path: &Path| {
        let text = fs::read_to_string(path).unwrap_or_default();
        text.lines().filter(|line| line.starts_with("ekf,")).count()
    };
    let lines = folder.path().join("l.txt");
    wait_until("estimates of the first half", || count(&lines) >= 1199);
    fs::write(&experiment, "this is no experiment").unwrap();
    signal(&child, "-HUP");
    std::thread::sleep(Duration::from_millis(200));
    // As logrotate does.
    input.write_all(&bytes[half..half + 50_000]).unwrap();
    wait_until("the next file", || series(folder.path(), "l", "l.txt").len() == 2 && count(&lines) > 0);
    fs::rename(&lines, folder.path().join("l-20991231T000000Z.txt")).unwrap();
    fs::write(&lines, "").unwrap();
    signal(&child, "-HUP");
    std::thread::sleep(Duration::from_millis(200));
    input.write_all(&bytes[half + 50_000..]).unwrap();
    drop(input);
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{said}");
    let summary: serde_json::Value = serde_json::from_str(&said[said.find('{').unwrap()..]).unwrap();
    assert_eq!((&summary["estimated"], &summary["interrupted"]), (&24_001.into(), &false.into()));
    let files = series(folder.path(), "l", "l.txt");
    assert_eq!(files.len(), 3, "{files:?}");
    assert_eq!(files.iter().map(|path| count(path)).sum::<usize>(), 2401);
    assert_eq!(series(folder.path(), "m", "m.mcap").len(), 3);
}

#[test]
fn a_service_is_ready_shows_the_watchdog_that_it_lives_and_says_when_it_stops() {
    let folder = tempfile::tempdir().unwrap();
    let (path, metrics) = (folder.path().join("notify"), folder.path().join("kalmems.prom"));
    let socket = UnixDatagram::bind(&path).unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    let next = || {
        let mut bytes = [0; 4096];
        let count = socket.recv(&mut bytes).unwrap();
        String::from_utf8(bytes[..count].to_vec()).unwrap()
    };
    let child = kalmems(&example("stream.toml"))
        .args(["--from", "listen://127.0.0.1:0", "--metrics"])
        .arg(&metrics)
        .env("NOTIFY_SOCKET", &path)
        .env("WATCHDOG_USEC", "400000")
        .spawn()
        .unwrap();
    assert_eq!(next(), "READY=1");
    // No samples come, and it is alive.
    let mut last = Instant::now();
    for beat in 0..10 {
        let told = next();
        assert!(told.starts_with("WATCHDOG=1\nSTATUS=not connected, 0 samples"), "{told}");
        assert!(beat == 0 || last.elapsed() < Duration::from_millis(400), "{:?}", last.elapsed());
        last = Instant::now();
    }
    signal(&child, "-TERM");
    let told = loop {
        let told = next();
        if !told.starts_with("WATCHDOG") {
            break told;
        }
    };
    assert_eq!(told, "STOPPING=1");
    assert_eq!(child.wait_with_output().unwrap().status.code(), Some(130));
    assert!(fs::read_to_string(&metrics).unwrap().contains("\nkalmems_stream_connected 0\n"));
}

/// The text format of Prometheus: a line of a name, labels and a number, all of a name behind its type.
#[test]
fn metrics_hold_what_health_holds_and_are_complete_at_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let metrics = folder.path().join("kalmems.prom");
    let output = kalmems(&example("stream.toml"))
        .arg("--from")
        .arg(example("recording.csv"))
        .arg("--metrics")
        .arg(&metrics)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let text = fs::read_to_string(&metrics).unwrap();
    let (mut values, mut name) = (BTreeMap::new(), "");
    for line in text.lines() {
        if let Some(announced) = line.strip_prefix("# TYPE ") {
            name = announced.strip_suffix(" untyped").unwrap();
            continue;
        }
        let (sample, value) = line.rsplit_once(' ').unwrap();
        assert_eq!(sample.split('{').next(), Some(name), "{line}");
        assert!(values.insert(sample.to_owned(), value.parse::<f64>().unwrap()).is_none(), "{line}");
    }
    let value = |name: &str| values.get(&format!("kalmems_stream_{name}")).copied();
    assert_eq!(
        (value("estimated"), value("passed"), value("dropped")),
        (Some(24_001.0), Some(24_001.0), Some(0.0))
    );
    assert_eq!(value("filter_lock{estimator=\"ekf\",lock=\"held\"}"), Some(1.0));
    assert!(
        value("filter_mean_nis{estimator=\"ekf\"}").is_some_and(|nis| (0.3..3.0).contains(&nis)),
        "{text}"
    );
    assert!(value("unix_s").is_some_and(|unix_s| unix_s > 1.7e9), "{text}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// Of the example one sample of five, 12.8 in a cycle of the motion, with one step from each to the next.
#[test]
fn a_stream_states_what_its_integration_steps_add_to_its_errors() {
    let folder = tempfile::tempdir().unwrap();
    let recording = fs::read_to_string(example("recording.csv")).unwrap();
    let is_taken = |(k, _): &(usize, &str)| *k == 0 || k % 5 == 1;
    let rows: Vec<&str> = recording.lines().enumerate().filter(is_taken).map(|(_, line)| line).collect();
    fs::write(folder.path().join("recording.csv"), rows.join("\n") + "\n").unwrap();
    let text = fs::read_to_string(example("stream.toml")).unwrap();
    let text = text.replace("rate = \"1 MHz\"", "rate = \"200 kHz\"");
    let text = text.replace("method = \"ekf\"", "method = \"ekf\"\nsteps = 1");
    let experiment = folder.path().join("stream.toml");
    fs::write(&experiment, text).unwrap();
    let run = |further: &[&str]| {
        let mut command = kalmems(&experiment);
        command.current_dir(folder.path()).args(["--from", "recording.csv", "--lines", "l.txt", "--force"]);
        let output = command.args(further).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stderr).unwrap()
    };
    let said = run(&["--metrics", "metrics.prom"]);
    assert!(
        said.contains("`ekf`: the integration step, 1 from each sample to the next, adds an error of"),
        "{said}"
    );
    let metrics = fs::read_to_string(folder.path().join("metrics.prom")).unwrap();
    assert!(metrics.contains("kalmems_stream_filter_step_error{estimator=\"ekf\"} "), "{metrics}");
    let json = run(&["--json"]);
    let summary: serde_json::Value = serde_json::from_str(&json[json.find('{').unwrap()..]).unwrap();
    let found = &summary["step_errors"]["ekf"];
    assert!(found["error"].as_f64().unwrap() > 0.05 && found["steps_per_sample"] == 1, "{summary}");
    // That of the same samples in a file.
    let mut command = Command::new(env!("CARGO_BIN_EXE_kalmems"));
    command.current_dir(folder.path()).args(["estimate", "stream.toml", "--json", "--out", "estimated"]);
    let metrics: serde_json::Value = serde_json::from_slice(&command.output().unwrap().stdout).unwrap();
    assert_eq!(&metrics["recordings"][0]["segments"][0]["estimators"][0]["step_errors"], found);
}

/// A client that connected, sent samples and is silent holds a listener for the idle limit and no longer.
#[test]
fn a_listener_leaves_a_silent_client_after_the_idle_limit() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = streaming(folder.path(), "idle = \"0.3 s\"\nreconnect = \"60 s\"");
    let mut child = kalmems(&experiment).args(["--json", "--from", "listen://127.0.0.1:0"]).spawn().unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    let address = line.trim().rsplit(' ').next().unwrap();
    let bytes = fs::read(example("recording.csv")).unwrap();
    let half = bytes.split(|byte| *byte == b'\n').take(12_001).map(|line| line.len() + 1).sum::<usize>();
    let output = child.stdout.take().unwrap();
    let lines = std::thread::spawn(move || std::io::read_to_string(output).unwrap());
    let mut silent = TcpStream::connect(address).unwrap();
    silent.write_all(&bytes[..half]).unwrap();
    let mut other = TcpStream::connect(address).unwrap();
    other.write_all(&[&bytes[half..], b"# end\n"].concat()).unwrap();
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{rest}");
    let summary: serde_json::Value = serde_json::from_str(&rest[rest.find('{').unwrap()..]).unwrap();
    assert_eq!((&summary["estimated"], &summary["received"]["breaks"]), (&24_001.into(), &1.into()));
    let lines = lines.join().unwrap();
    assert!(lines.contains("\"event\":\"disconnected\",\"why\":\"no sample came for 0.3 s\""), "{rest}");
    drop(silent);
}

/// Without an idle limit as well, a client that never sends a sample holds a listener for ten seconds.
#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_a_listener_leaves_a_client_that_is_silent_from_the_beginning() {
    let mut child = kalmems(&example("stream.toml"))
        .args(["--json", "--from", "listen://127.0.0.1:0"])
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    let address = line.trim().rsplit(' ').next().unwrap();
    let silent = TcpStream::connect(address).unwrap();
    let begun = Instant::now();
    let mut other = TcpStream::connect(address).unwrap();
    other.write_all(&[&fs::read(example("recording.csv")).unwrap()[..], b"# end\n"].concat()).unwrap();
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{rest}");
    assert!((9..60).contains(&begun.elapsed().as_secs()), "{:?}", begun.elapsed());
    let summary: serde_json::Value = serde_json::from_str(&rest[rest.find('{').unwrap()..]).unwrap();
    assert_eq!((&summary["estimated"], &summary["received"]["turned_away"]), (&24_001.into(), &1.into()));
    drop(silent);
}

/// Samples that wait in the system are behind by their own time, though this program reads them late and estimates them at once.
#[test]
fn estimates_that_a_slow_reader_holds_up_are_behind_by_the_times_of_the_samples() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = streaming(folder.path(), "heartbeat = \"0.1 s\"");
    let text = fs::read_to_string(&experiment).unwrap();
    fs::write(&experiment, text.replace("every = 10", "every = 1")).unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp://{}", listener.local_addr().unwrap());
    let mut child = kalmems(&experiment).args(["--from", &address]).spawn().unwrap();
    let (mut connection, _) = listener.accept().unwrap();
    let bytes = fs::read(example("recording.csv")).unwrap();
    let sender = std::thread::spawn(move || {
        connection.write_all(&[&bytes[..], b"# end\n"].concat()).unwrap();
        connection
    });
    let mut output = BufReader::new(child.stdout.take().unwrap());
    let (mut line, mut count) = (String::new(), 0);
    while count < 6000 {
        line.clear();
        assert!(output.read_line(&mut line).unwrap() > 0);
        count += usize::from(line.starts_with("ekf,"));
    }
    std::thread::sleep(Duration::from_millis(1500));
    let mut rest = String::new();
    output.read_to_string(&mut rest).unwrap();
    sender.join().unwrap();
    let ended = child.wait_with_output().unwrap();
    let said = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(0), "{said}");
    let events = || rest.lines().filter_map(|line| serde_json::from_str(line.strip_prefix("event,")?).ok());
    let named = |name: &str| -> Vec<serde_json::Value> {
        events().filter(|event: &serde_json::Value| event["event"] == name).collect()
    };
    let behind = named("behind");
    let [behind] = &behind[..] else { panic!("{behind:?}") };
    assert!(behind["lag_s"].as_f64().unwrap() > 0.25, "{behind}");
    let lags = named("health");
    let lag_s = lags.iter().filter_map(|health| health["lag_s"].as_f64()).fold(0.0, f64::max);
    assert!((1.4..30.0).contains(&lag_s), "{lags:?}");
    // Half of the samples were estimated behind the pause.
    let half = said.lines().find(|line| line.contains("from arrival to estimate")).unwrap();
    let half = half.split("half within ").nth(1).unwrap().split(' ').next().unwrap();
    assert!(half.parse::<f64>().unwrap() > 1e6, "{said}");
}

/// A client that sends what is no sample, however much and however often, holds a listener no longer than one that is silent.
#[test]
fn a_listener_leaves_a_client_that_sends_garbage_without_an_end() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = streaming(folder.path(), "idle = \"0.5 s\"\nreconnect = \"60 s\"");
    let mut child = kalmems(&experiment).args(["--json", "--from", "listen://127.0.0.1:0"]).spawn().unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    let address = line.trim().rsplit(' ').next().unwrap().to_owned();
    let output = child.stdout.take().unwrap();
    let lines = std::thread::spawn(move || std::io::read_to_string(output).unwrap());
    let bytes = fs::read(example("recording.csv")).unwrap();
    let half = bytes.split(|byte| *byte == b'\n').take(12_001).map(|line| line.len() + 1).sum::<usize>();
    let mut one = TcpStream::connect(&address).unwrap();
    one.write_all(&bytes[..half]).unwrap();
    // Without a pause, and often.
    for (garbage, pause) in [(&b"garbage\n"[..].repeat(8192), 0), (&b"garbage\n".to_vec(), 20)] {
        let begun = Instant::now();
        while one.write_all(garbage).is_ok() {
            assert!(begun.elapsed() < Duration::from_secs(30), "{pause}");
            std::thread::sleep(Duration::from_millis(pause));
        }
        one = TcpStream::connect(&address).unwrap();
    }
    one.write_all(&[&bytes[half..], b"# end\n"].concat()).unwrap();
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(0), "{rest}");
    let summary: serde_json::Value = serde_json::from_str(&rest[rest.find('{').unwrap()..]).unwrap();
    assert_eq!(summary["estimated"], 24_001, "{rest}");
    assert!(lines.join().unwrap().contains("no sample came for "));
}

/// On a file system of 128 kB, which only a system's owner can make.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_ends_a_stream_with_the_file_and_the_cause_whatever_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let disk = folder.path().join("disk");
    fs::create_dir(&disk).unwrap();
    for (option, name, is_full) in [
        ("--lines", "l.txt", false),
        ("--frames", "f.bin", false),
        ("--to", "m.mcap", false),
        ("--state", "s.json", true),
        ("--report", "r.html", false),
        ("--metrics", "m.prom", true),
    ] {
        let mount =
            Command::new("mount").args(["-t", "tmpfs", "-o", "size=128k", "none"]).arg(&disk).output();
        if !mount.is_ok_and(|mount| mount.status.success()) {
            eprintln!("skipped: no file system can be mounted here");
            return;
        }
        if is_full {
            fs::write(disk.join("ballast"), vec![0; 32 * 4096]).unwrap();
        }
        let path = disk.join(name).to_str().unwrap().to_owned();
        let place = if option == "--to" { format!("mcap://{path}") } else { path.clone() };
        let output = kalmems(&example("stream.toml"))
            .arg("--from")
            .arg(example("recording.csv"))
            .args([option, &place])
            .output();
        assert!(Command::new("umount").arg(&disk).status().unwrap().success());
        let output = output.unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        // Metrics are looked at while a stream runs, and it goes on without them.
        assert_eq!(output.status.code(), Some(i32::from(option != "--metrics")), "{option}: {said}");
        let told = said.lines().find(|line| line.starts_with("error: ") || line.starts_with("warning: "));
        assert!(
            told.is_some_and(|told| told.contains(&path) && told.contains("No space left")),
            "{option}: {said}"
        );
    }
}

#[test]
fn the_origin_of_times_stands_before_all_else_in_lines_frames_and_datagrams() {
    let folder = tempfile::tempdir().unwrap();
    let recording = fs::read_to_string(example("recording.csv")).unwrap();
    let mut csv = "time_s,drive_V,cap_V\n".to_owned();
    for (k, line) in recording.lines().skip(1).take(12_000).enumerate() {
        csv += &format!("1700000000.{:06},{}\n", 250_000 + k, line.split_once(',').unwrap().1);
    }
    let path = folder.path().join("recording.csv");
    fs::write(&path, csv).unwrap();
    let viewer = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    viewer.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
    let output = kalmems(&example("stream.toml"))
        .current_dir(folder.path())
        .arg("--from")
        .arg(&path)
        .args(["--lines", "l.txt", "--frames", "f.bin", "--rotate-size", "100 kB", "--to"])
        .arg(format!("udp-json://{}", viewer.local_addr().unwrap()))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    for path in series(folder.path(), "l", "l.txt") {
        let text = fs::read_to_string(&path).unwrap();
        let first = text.lines().find(|line| !line.starts_with('#')).unwrap();
        assert!(first.starts_with("origin,1700000000.25"), "{path:?}: {first}");
    }
    let frames = series(folder.path(), "f", "f.bin");
    assert!(frames.len() > 1, "{frames:?}");
    for path in frames {
        let bytes = fs::read(&path).unwrap();
        let number = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
        assert!(bytes.starts_with(b"kmOr\0\0\x02\0"), "{path:?}");
        assert_eq!([number(8), number(16)], [1_700_000_000.0, 0.25], "{path:?}");
    }
    let mut datagram = [0; 2000];
    let count = viewer.recv(&mut datagram).unwrap();
    let first: serde_json::Value = serde_json::from_slice(&datagram[..count]).unwrap();
    assert_eq!(first["origin_s"], 1_700_000_000.25);
}

/// What systemd does with an exit code, by the lines of a unit with `Restart=on-failure`.
fn is_restarted(unit: &str, code: i32) -> bool {
    let codes = |key: &str| {
        let line = unit.lines().find_map(|line| line.strip_prefix(key)).unwrap();
        line.split_whitespace().map(|code| code.parse::<i32>().unwrap()).collect::<Vec<_>>()
    };
    let is_success = code == 0 || codes("SuccessExitStatus=").contains(&code);
    !is_success && !codes("RestartPreventExitStatus=").contains(&code)
}

/// A stream that another start can mend is started again, and one that ended as it should, or always ends so, is not.
#[test]
fn the_unit_that_is_shipped_starts_a_stream_again_by_the_exit_codes_of_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let unit = fs::read_to_string(example("../service/kalmems-stream.service")).unwrap();
    assert!(unit.lines().any(|line| line == "Restart=on-failure"));
    let still = folder.path().join("still.csv");
    let recording = fs::read_to_string(example("recording.csv")).unwrap();
    let rows = recording.lines().skip(1).map(|line| {
        let mut cells = line.split(',');
        format!("{},0,{}\n", cells.next().unwrap(), cells.nth(1).unwrap())
    });
    fs::write(&still, rows.collect::<String>()).unwrap();
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let (example_file, recording) = (example("stream.toml"), example("recording.csv"));
    let none = folder.path().join("none.toml");
    for (experiment, from, more, expected) in [
        (&example_file, recording.to_str().unwrap(), "--json", (0, false)),
        (&none, recording.to_str().unwrap(), "--json", (1, false)),
        (&example_file, recording.to_str().unwrap(), "--jason", (2, false)),
        (&example_file, &format!("tcp://{free}"), "--json", (4, true)),
        (&example_file, still.to_str().unwrap(), "--json", (6, true)),
    ] {
        let output = kalmems(experiment).args(["--from", from, more]).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        let code = output.status.code().unwrap();
        assert_eq!((code, is_restarted(&unit, code)), expected, "{from} {said}");
    }
    // As `systemctl stop` ends it.
    let mut child = kalmems(&example_file).args(["--from", "listen://127.0.0.1:0"]).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stderr.take().unwrap()).read_line(&mut line).unwrap();
    signal(&child, "-TERM");
    let code = child.wait().unwrap().code().unwrap();
    assert_eq!((code, is_restarted(&unit, code)), (130, false));
}

/// What the book shows of it is in it.
#[test]
fn the_unit_that_is_shipped_starts_a_stream() {
    let folder = tempfile::tempdir().unwrap();
    let unit = fs::read_to_string(example("../service/kalmems-stream.service")).unwrap();
    let book = fs::read_to_string(example("../../book/src/live.md")).unwrap();
    let shown = book.split("    [Service]\n").nth(1).unwrap().split("\n\n").next().unwrap();
    assert!(shown.lines().count() > 8, "{shown}");
    for line in shown.lines() {
        assert!(unit.lines().any(|own| own.trim() == line.trim()), "{line}");
    }
    let whole = unit.replace("\\\n", " ");
    let mut command = whole.lines().find_map(|line| line.strip_prefix("ExecStart=")).unwrap().to_owned();
    for (from, to) in [
        ("/usr/local/bin/kalmems", env!("CARGO_BIN_EXE_kalmems")),
        ("/etc/kalmems/stream.toml", example("stream.toml").to_str().unwrap()),
        ("tcp://instrument:4000", example("recording.csv").to_str().unwrap()),
        ("/var/lib/kalmems", folder.path().to_str().unwrap()),
    ] {
        assert!(command.contains(from), "{command}");
        command = command.replace(from, to);
    }
    let output = Command::new("sh").args(["-c", &command]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    for name in ["state.json", "stream.mcap", "stream.prom"] {
        assert!(fs::metadata(folder.path().join(name)).unwrap().len() > 100, "{name}");
    }
}
