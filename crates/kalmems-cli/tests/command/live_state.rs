//! A stream that is killed, another one that wants its state meanwhile, and samples that were changed on their way.
#![cfg(unix)]

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

fn example(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner").join(file)
}

/// A stream of the example that goes on from a state, whose samples come through a pipe.
fn stream(experiment: &Path, more: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kalmems"));
    command.arg("stream").arg(experiment).args(more);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

fn ended(mut child: Child, bytes: &[u8]) -> Output {
    let mut input = child.stdin.take().unwrap();
    let bytes = bytes.to_owned();
    // One that is refused reads nothing.
    let sender = std::thread::spawn(move || drop(input.write_all(&bytes)));
    let output = child.wait_with_output().unwrap();
    sender.join().unwrap();
    output
}

/// What a process writes, line by line, while it lives.
fn followed(child: &mut Child) -> (Arc<Mutex<Vec<String>>>, JoinHandle<()>) {
    let lines = Arc::new(Mutex::new(Vec::new()));
    let (kept, output) = (lines.clone(), BufReader::new(child.stdout.take().unwrap()));
    let reader = std::thread::spawn(move || {
        output.lines().map_while(Result::ok).for_each(|line| kept.lock().unwrap().push(line));
    });
    (lines, reader)
}

/// The estimates among some lines: by their times, to the bit, the rest of the line.
fn estimates<'a>(lines: impl Iterator<Item = &'a str>) -> BTreeMap<u64, String> {
    let own = lines.filter_map(|line| line.strip_prefix("ekf,"));
    own.map(|line| line.split_once(',').unwrap())
        .map(|(time, rest)| (time.parse::<f64>().unwrap().to_bits(), rest.to_owned()))
        .collect()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The estimates of every tenth sample: those of the stream that was killed and of the one that goes on are the same samples as those of one
/// stream, and a third one is refused as long as the first one lives, and not after that.
#[test]
fn a_state_belongs_to_one_stream_until_that_is_killed_and_every_tenth_sample_stays_every_tenth() {
    let folder = tempfile::tempdir().unwrap();
    let (experiment, state) = (example("stream.toml"), folder.path().join("state.json"));
    let with_state = ["--state", state.to_str().unwrap()];
    let bytes = fs::read(example("recording.csv")).unwrap();
    let whole = ended(stream(&experiment, &[]), &bytes);
    assert_eq!(whole.status.code(), Some(0), "{}", text(&whole.stderr));
    let whole = estimates(text(&whole.stdout).lines());

    let mut first = stream(&experiment, &with_state);
    let mut input = first.stdin.take().unwrap();
    let (lines, reader) = followed(&mut first);
    let acknowledged = || {
        let lines = lines.lock().unwrap();
        let told = lines.iter().rev().find_map(|line| line.strip_prefix("acknowledged,"));
        told.map_or(0.0, |time| time.parse::<f64>().unwrap())
    };
    // 7001 rows at once, and then some at a time, until a state stands behind them.
    let rows: Vec<&[u8]> = bytes.split_inclusive(|byte| *byte == b'\n').collect();
    input.write_all(&rows[..7001].concat()).unwrap();
    let begun = Instant::now();
    for row in rows[7001..20_004].chunks(13) {
        input.write_all(&row.concat()).unwrap();
        if acknowledged() > 9e-3 {
            break;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    while acknowledged() <= 9e-3 {
        assert!(begun.elapsed() < Duration::from_secs(60), "nothing is acknowledged");
        std::thread::sleep(Duration::from_millis(5));
    }

    let refused = ended(stream(&experiment, &with_state), &bytes);
    let said = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(said.contains("state.json") && said.contains("another stream goes on from it"), "{said}");

    first.kill().unwrap();
    first.wait().unwrap();
    drop(input);
    reader.join().unwrap();
    let kept: serde_json::Value = serde_json::from_slice(&fs::read(&state).unwrap()).unwrap();
    let acknowledged_s = f64::from_bits(kept["acknowledged"].as_u64().unwrap());
    let second = ended(stream(&experiment, &with_state), &bytes);
    assert_eq!(second.status.code(), Some(0), "{}", text(&second.stderr));
    let mut both = estimates(lines.lock().unwrap().iter().map(String::as_str));
    both.retain(|time, _| f64::from_bits(*time) <= acknowledged_s);
    let second = estimates(text(&second.stdout).lines());
    assert!(second.keys().all(|time| f64::from_bits(*time) > acknowledged_s) && !both.is_empty());
    both.extend(second);
    let times = |of: &BTreeMap<u64, String>| of.keys().copied().map(f64::from_bits).collect::<Vec<_>>();
    assert_eq!(times(&both), times(&whole));
    for (time, line) in &both {
        let numbers =
            |line: &str| -> Vec<f64> { line.split(',').map(|x| x.parse().unwrap_or(f64::NAN)).collect() };
        let (found, expected) = (numbers(line), numbers(&whole[time]));
        // The angle and its standard deviation.
        assert!((found[0] - expected[0]).abs() <= 1e-6 * expected[1], "{found:?} {expected:?}");
    }
}

/// CRC-32 as in Ethernet, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum: u32, _| (sum >> 1) ^ (0xedb8_8320 * (sum & 1)))
    })
}

/// The example as frames with a checksum; a bit of every thousandth is another one, each at its own place.
#[test]
fn frames_in_which_a_bit_was_flipped_are_counted_and_the_others_estimated() {
    let folder = tempfile::tempdir().unwrap();
    let told = fs::read_to_string(example("stream.toml")).unwrap();
    let columns = "[stream.input.text]\ncolumns = [\"time_s\", \"drive_V\", \"cap_V\"]";
    let frames = "[stream.input.frames]\nsync = \"a55a\"\ncrc = \"crc32\"\nfields = [\"u32 sequence\", \"f64 time_s\", \"f32 drive_V\", \"f32 cap_V\"]";
    assert!(told.contains(columns));
    let experiment = folder.path().join("stream.toml");
    fs::write(&experiment, told.replace(columns, frames)).unwrap();
    let recording = fs::read_to_string(example("recording.csv")).unwrap();
    let (mut bytes, mut flipped) = (Vec::new(), 0);
    for (k, line) in (0_u32..).zip(recording.lines().skip(1)) {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        #[allow(clippy::cast_possible_truncation)] // what an instrument sends
        let [drive, signal] = [cells[1] as f32, cells[2] as f32];
        let mut content = k.to_le_bytes().to_vec();
        content.extend(cells[0].to_le_bytes());
        content.extend(drive.to_le_bytes());
        content.extend(signal.to_le_bytes());
        let check = crc32(&content);
        if k % 1000 == 500 {
            let bit = 37 * flipped % (8 * content.len());
            content[bit / 8] ^= 1 << (bit % 8);
            flipped += 1;
        }
        bytes.extend([0xa5, 0x5a]);
        bytes.extend(content);
        bytes.extend(check.to_le_bytes());
    }
    let lines = folder.path().join("lines.txt");
    let output = ended(stream(&experiment, &["--lines", lines.to_str().unwrap(), "--json"]), &bytes);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let summary: serde_json::Value = serde_json::from_slice(&output.stderr).unwrap();
    let received = &summary["received"];
    assert!(flipped >= 20);
    assert_eq!(received["damaged_frames"], flipped, "{received}");
    assert_eq!(received["dropped"], flipped, "{received}");
    let others = recording.lines().count() - 1 - flipped;
    assert_eq!(summary["estimated"], others, "{summary}");
}
