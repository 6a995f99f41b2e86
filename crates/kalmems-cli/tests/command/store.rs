//! Nobody's file is lost, whatever a run writes to and whenever it is killed.

use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A laboratory's folder: two experiments and what they read.
struct Laboratory(tempfile::TempDir);

/// The rows of the recording.
const ROWS: usize = 4_000;

impl Laboratory {
    fn new() -> Self {
        let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner");
        let text = |name: &str| fs::read_to_string(examples.join(name)).unwrap();
        let replaced = |text: String, was: &str, is: &str| {
            assert!(text.contains(was), "{was}");
            text.replace(was, is)
        };
        let lab = Self(tempfile::tempdir().unwrap());
        for name in ["recording.csv", "reference.csv"] {
            let rows: Vec<String> = text(name).lines().take(ROWS).map(str::to_owned).collect();
            lab.put(name, &(rows.join("\n") + "\n"));
        }
        let experiment = replaced(text("experiment.toml"), "skip = \"8 ms\"", "skip = \"1 ms\"");
        lab.put("other.toml", &experiment);
        lab.put("experiment.toml", &experiment);
        for name in
            ["ring_down.toml", "ring_down_recording.csv", "ring_down_reference.csv", "still_recording.csv"]
        {
            lab.put(name, &text(name));
        }
        let stream = replaced(text("stream.toml"), "skip = \"8 ms\"", "skip = \"1 ms\"");
        lab.put("stream.toml", &stream);
        let simulation = replaced(text("simulation.toml"), "duration = \"60 ms\"", "duration = \"3 ms\"");
        let simulation = replaced(simulation, "skip = \"45 ms\"", "skip = \"0.5 ms\"");
        lab.put("simulation.toml", &simulation);
        lab.put(
            "study.toml",
            "name = \"start\"\nexperiment = \"simulation.toml\"\n[[vary]]\nkey = \"simulate.start.angle\"\n\
             values = [\"0.05 rad\", \"0.1 rad\"]\n",
        );
        lab
    }

    fn at(&self, path: &str) -> PathBuf {
        self.0.path().join(path)
    }

    fn put(&self, path: &str, content: &str) {
        let path = self.at(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_kalmems"));
        command.current_dir(self.0.path()).args(arguments).stdin(Stdio::null());
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    fn good(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {told}");
        told
    }

    /// What a run that must be refused says.
    fn refused(&self, arguments: &[&str]) -> String {
        let before = files(self.0.path());
        let output = self.run(arguments);
        let told = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {told}");
        assert!(files(self.0.path()) == before, "{arguments:?} changed something: {told}");
        told
    }
}

/// All below a folder that is no folder, with its content; a link by where it leads.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let (mut found, mut folders) = (BTreeMap::new(), vec![folder.to_owned()]);
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            let name = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
            if path.is_symlink() {
                found.insert(name, fs::read_link(&path).unwrap().into_os_string().into_encoded_bytes());
            } else if path.is_dir() {
                folders.push(path);
            } else {
                found.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    found
}

#[test]
fn files_that_the_user_put_into_a_result_refuse_the_next_run() {
    let lab = Laboratory::new();
    lab.good(&["estimate", "experiment.toml", "--out", "out"]);
    for stranger in ["mynotes.txt", "figures/own.png", "raw/measure.csv"] {
        lab.put(&format!("out/{stranger}"), "mine");
        for force in [&[][..], &["--force"]] {
            let told = lab.refused(&[&["estimate", "experiment.toml", "--out", "out"], force].concat());
            assert!(told.contains(stranger.split('/').next().unwrap()) && told.contains("--out"), "{told}");
        }
        fs::remove_file(lab.at("out").join(stranger)).unwrap();
        let _ = fs::remove_dir(lab.at("out/raw"));
    }
    lab.good(&["estimate", "experiment.toml", "--out", "out"]);
}

#[test]
fn a_result_is_never_put_over_what_the_run_reads() {
    let lab = Laboratory::new();
    for name in ["experiment.toml", "recording.csv", "reference.csv"] {
        fs::create_dir_all(lab.at("D")).unwrap();
        fs::copy(lab.at(name), lab.at("D").join(name)).unwrap();
    }
    let told = lab.refused(&["estimate", "D/experiment.toml", "--out", "D"]);
    assert!(told.contains("--out D/estimate"), "{told}");
    lab.good(&["simulate", "simulation.toml", "--out", "S"]);
    for force in [&[][..], &["--force"]] {
        let told = lab.refused(&[&["estimate", "S/experiment.toml", "--out", "S"], force].concat());
        assert!(told.contains("is read by this run"), "{told}");
    }
    lab.good(&["estimate", "S/experiment.toml", "--out", "S/estimate"]);
}

#[test]
fn an_earlier_result_with_other_settings_is_kept_and_another_experiments_refuses() {
    let lab = Laboratory::new();
    let told = lab.good(&["estimate", "experiment.toml", "--out", "out"]);
    assert!(!told.contains("kept"), "{told}");
    let first = files(&lab.at("out"));
    lab.good(&["estimate", "experiment.toml", "--out", "out"]);
    assert!(!lab.at("out.previous").exists());
    let edited = fs::read_to_string(lab.at("experiment.toml")).unwrap().replace("1e8 rad^2", "1e7 rad^2");
    lab.put("experiment.toml", &edited);
    let told = lab.good(&["estimate", "experiment.toml", "--out", "out"]);
    assert!(told.contains("kept in") && told.contains("out.previous"), "{told}");
    let kept = files(&lab.at("out.previous"));
    assert!(first["metrics.json"] == kept["metrics.json"] && first["report.html"] == kept["report.html"]);
    assert!(first["metrics.json"] != files(&lab.at("out"))["metrics.json"]);
    let told = lab.refused(&["estimate", "other.toml", "--out", "out"]);
    assert!(told.contains("`estimate` of `../experiment.toml`"), "{told}");
    let second = files(&lab.at("out"));
    lab.good(&["estimate", "other.toml", "--out", "out", "--force"]);
    // One earlier result of an experiment is kept.
    assert!(second["metrics.json"] == files(&lab.at("out.previous"))["metrics.json"]);
    assert!(!lab.at("out.previous-2").exists());
}

#[cfg(unix)]
#[test]
fn a_picture_replaces_nothing_that_the_program_did_not_make() {
    let lab = Laboratory::new();
    let inspect = |path: &'static str| ["inspect", "recording.csv", "--svg", path];
    lab.good(&inspect("a.svg"));
    lab.good(&inspect("a.svg"));
    lab.put("theirs.svg", "a picture of somebody's");
    lab.put("there.txt", "a file");
    std::os::unix::fs::symlink(lab.at("there.txt"), lab.at("link.svg")).unwrap();
    for path in ["theirs.svg", "link.svg", "/dev/null"] {
        lab.refused(&inspect(path));
    }
    // Nobody writes to the pipe, so that it cannot be among the files that are compared.
    assert!(Command::new("mkfifo").arg(lab.at("fifo.svg")).status().unwrap().success());
    for force in [&[][..], &["--force"]] {
        let output = lab.run(&[&inspect("fifo.svg"), force].concat());
        assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    }
    fs::remove_file(lab.at("fifo.svg")).unwrap();
    lab.good(&[&inspect("theirs.svg"), &["--force"][..]].concat());
    assert_eq!(fs::read_to_string(lab.at("theirs.svg.previous")).unwrap(), "a picture of somebody's");
}

#[test]
fn a_file_system_that_refuses_writing_is_reported() {
    let lab = Laboratory::new();
    if cfg!(target_os = "linux") {
        let told = lab.refused(&["estimate", "experiment.toml", "--out", "/proc/kalmems/out"]);
        assert!(told.contains("cannot write /proc/kalmems/out"), "{told}");
    }
}

/// On a file system of 256 kB, which only a system's owner can make.
#[cfg(target_os = "linux")]
#[test]
fn a_file_system_that_is_full_keeps_the_earlier_result() {
    let lab = Laboratory::new();
    fs::create_dir(lab.at("disk")).unwrap();
    let disk = lab.at("disk");
    let mount = Command::new("mount").args(["-t", "tmpfs", "-o", "size=2m", "none"]).arg(&disk).output();
    if !mount.is_ok_and(|mount| mount.status.success()) {
        eprintln!("skipped: no file system can be mounted here");
        return;
    }
    let wanted = ["estimate", "experiment.toml", "--no-trajectories", "--out", "disk/out"];
    lab.good(&wanted);
    let before = files(&lab.at("disk/out"));
    // Room for part of the next result alone.
    let room = 100 << 10;
    let free =
        2 * (1 << 20) - before.values().map(|content| content.len().next_multiple_of(4096)).sum::<usize>();
    fs::write(lab.at("disk/ballast"), vec![0; free.saturating_sub(room)]).unwrap();
    let output = lab.run(&wanted);
    let after = (files(&lab.at("disk/out")), whole(&lab.at("disk/out")), staging(&lab.at("disk")));
    assert!(Command::new("umount").arg(&disk).status().unwrap().success());
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("cannot write"), "{told}");
    assert!(after.0 == before && after.1, "the earlier result was touched");
    assert_eq!(after.2, 0, "something is left");
}

/// Whether a result has all of its files, as listed, and no others.
fn whole(folder: &Path) -> bool {
    let mut there = files(folder);
    let Some(list) = there.remove("manifest.toml") else { return false };
    let list: toml::Table = String::from_utf8(list).unwrap().parse().unwrap();
    if let Some(run) = there.get_mut("run.toml") {
        // The list leaves the timing out, so that it is the same for two runs of the same input.
        let (mut timing, text) = (false, String::from_utf8(run.clone()).unwrap());
        let kept = text.split_inclusive('\n').filter(|line| {
            timing = if line.starts_with('[') { line.starts_with("[timing") } else { timing };
            !timing || line.split('=').nth(1).is_none_or(|number| number.trim().parse::<f64>().is_err())
        });
        *run = kept.collect::<String>().into_bytes();
    }
    let sums = |bytes: &Vec<u8>| {
        let digits =
            |byte: u8| [byte >> 4, byte & 15].map(|digit| char::from_digit(digit.into(), 16).unwrap());
        Sha256::digest(bytes).iter().flat_map(|byte| digits(*byte)).collect::<String>()
    };
    let there: BTreeMap<&str, String> =
        there.iter().map(|(name, bytes)| (name.as_str(), sums(bytes))).collect();
    let listed = list["files"].as_table().unwrap();
    let listed: BTreeMap<&str, String> =
        listed.iter().map(|(name, sum)| (name.as_str(), sum.as_str().unwrap().to_owned())).collect();
    there == listed
}

/// How many folders of unfinished results there are.
fn staging(folder: &Path) -> usize {
    fs::read_dir(folder)
        .unwrap()
        .filter(|entry| entry.as_ref().unwrap().file_name().to_string_lossy().starts_with(".kalmems-"))
        .count()
}

/// A sequence of numbers that look as if by chance: the multiplier of Knuth's MMIX.
struct Chance(u64);

impl Chance {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end
    }
}

/// The commands that are killed, each into a folder of its own, and what of their output identifies them.
const COMMANDS: [&[&str]; 5] = [
    &["estimate", "experiment.toml", "--out", "results/estimate"],
    &["simulate", "simulation.toml", "--out", "results/simulate"],
    &["identify", "ring_down.toml", "--out", "results/identify"],
    &["study", "study.toml", "--threads", "1", "--out", "results/study"],
    &[
        "stream",
        "stream.toml",
        "--from",
        "recording.csv",
        "--lines",
        "results/lines.csv",
        "--state",
        "results/state",
    ],
];

fn killed_at_any_moment(kills: u64) {
    let (lab, mut chance) = (Laboratory::new(), Chance(20_261_122));
    fs::create_dir(lab.at("results")).unwrap();
    lab.put("results/mynotes.txt", "mine");
    lab.put("disk/keep.txt", "mine too");
    let took: Vec<Duration> = COMMANDS
        .iter()
        .map(|command| {
            let since = Instant::now();
            lab.good(command);
            since.elapsed()
        })
        .collect();
    let own = files(lab.0.path()).into_iter().filter(|(name, _)| !name.starts_with("results/"));
    let own: BTreeMap<String, Vec<u8>> = own.collect();
    let (mut ended, mut refused) = (0, 0);
    for kill in 0..kills {
        let which = usize::try_from(chance.below(COMMANDS.len() as u64)).unwrap();
        // Every third run says something else than the one before.
        let noise = ["1.92e-4", "1.93e-4"][usize::from(chance.below(3) == 0)];
        for name in ["experiment.toml", "stream.toml"] {
            let text = String::from_utf8(own[name].clone()).unwrap();
            lab.put(name, &text.replace("1.92e-4", noise));
        }
        let folder = lab.at(COMMANDS[which][COMMANDS[which].len() - 1]);
        let stranger = folder.join("mine.csv");
        let with_stranger = which < 4 && chance.below(4) == 0 && folder.is_dir();
        if with_stranger {
            fs::write(&stranger, "mine").unwrap();
        }
        if which == 4 && chance.below(2) == 0 {
            let _ = fs::remove_file(lab.at("results/state"));
        }
        let before = files(&folder.parent().unwrap().join("estimate"));
        let mut child = lab.command(COMMANDS[which]);
        let mut child = child.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let most = u64::try_from(took[which].as_micros()).unwrap();
        std::thread::sleep(Duration::from_micros(chance.below(most + most / 5)));
        let _ = child.kill();
        let status = child.wait().unwrap();
        ended += u64::from(status.success());
        refused += u64::from(status.code() == Some(1));
        let told = format!("kill {kill} of {:?}, {status}", COMMANDS[which]);
        if with_stranger {
            assert!(!status.success(), "{told}");
            assert_eq!(fs::read(&stranger).unwrap(), b"mine", "{told}");
            fs::remove_file(&stranger).unwrap();
        }
        for entry in fs::read_dir(lab.at("results")).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() && !name.starts_with('.') {
                assert!(whole(&path), "{told}: {name} is not whole");
            }
        }
        for command in &COMMANDS[..4] {
            let target = lab.at(command[command.len() - 1]);
            assert!(target.is_dir(), "{told}: {} is gone", target.display());
        }
        assert!(
            which == 0 || files(&lab.at("results/estimate")) == before,
            "{told}: another's result was touched"
        );
        assert!(staging(&lab.at("results")) <= 1, "{told}: more than one unfinished result");
        assert_eq!(fs::read(lab.at("results/mynotes.txt")).unwrap(), b"mine", "{told}");
        let mut now = files(lab.0.path());
        now.retain(|name, _| {
            !name.starts_with("results/") && name != "experiment.toml" && name != "stream.toml"
        });
        assert!(
            own.iter()
                .filter(|(name, _)| now.contains_key(*name))
                .all(|(name, content)| now[name] == *content)
        );
        assert_eq!(now.len() + 2, own.len(), "{told}: files came or went");
    }
    // What the last one left goes with the next that ends.
    lab.good(COMMANDS[1]);
    assert_eq!(staging(&lab.at("results")), 0);
    eprintln!("{kills} kills: {ended} came too late, {refused} runs were refused");
    assert!(ended + refused < kills * 9 / 10, "hardly any run was killed");
}

#[test]
fn a_run_that_is_killed_at_any_moment_leaves_whole_results_and_nothing_of_others() {
    killed_at_any_moment(25);
}

#[test]
#[ignore = "slow: 300 runs"]
fn slow_a_run_that_is_killed_at_any_moment_leaves_whole_results_and_nothing_of_others() {
    killed_at_any_moment(300);
}
