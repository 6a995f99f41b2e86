//! Studies: the same bytes by every way, and what is refused.

use crate::folders::{files, table};
use kalmems::progress::{Progress, Silent};
use kalmems::recording::{Hints, RecordingLayout, SampledRecording, TimeSource};
use kalmems::results::{Output, RunInfo, Work, write_simulation};
use kalmems::rigs::published;
use kalmems::simulate::ComputedRecording;
use kalmems::study::{JournalError, Shard, StudyError, StudyOptions, StudyPlan, Summary};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs;
use std::num::NonZero;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};
use tempfile::TempDir;

/// The shipped simulation, short.
fn experiment() -> String {
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/shared_scanner/simulation.toml");
    let mut text = fs::read_to_string(example).unwrap();
    for (long, short) in [
        ("duration = \"60 ms\"", "duration = \"2 ms\""),
        ("integration_rate = \"10 MHz\"", "integration_rate = \"1 MHz\""),
        (
            "angle = \"1e-4 rad\", rate = \"0 rad/s\" } # from",
            "angle = \"0.1 rad\", rate = \"0 rad/s\" } # from",
        ),
        ("skip = \"45 ms\"", "skip = \"0.5 ms\""),
    ] {
        assert!(text.contains(long), "{long}");
        text = text.replace(long, short);
    }
    text
}

const STUDY: &str = r#"
name = "short"
experiment = "experiment.toml"
repeats = 2
seed = 4

[truth]
"device.shared_scanner.resonator.stiffness" = "1.10e-4 N m"

[[vary]]
key = "device.shared_scanner.resonator.stiffness"
applies_to = "told"
grid = { from = "1.097e-4 N m", to = "1.103e-4 N m", points = 3 }

[[vary]]
key = "device.shared_scanner.readout.offset"
applies_to = "truth"
normal = { mean = "6.3945 V", sd = "5 mV" }

[[figure]]
metric = "errors.angle.rmse_deg"
against = "stiffness"
"#;

struct Folder(TempDir);

/// The results of a study in a folder.
fn write(plan: &StudyPlan, journals: &[PathBuf], out: &Path) -> Result<Summary, StudyError> {
    let output = Output::begin(out, &plan.work())?;
    let summary = plan.write_results(journals, &output)?;
    output.commit()?;
    Ok(summary)
}

impl Folder {
    fn with(study: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("experiment.toml"), experiment()).unwrap();
        fs::write(folder.path().join("study.toml"), study).unwrap();
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn plan(&self) -> Result<StudyPlan, StudyError> {
        StudyPlan::load(published(), &self.path("study.toml"))
    }

    /// Runs a shard with so many threads; its journal.
    fn run(
        &self,
        out: &str,
        shard: &str,
        threads: usize,
        progress: &dyn Progress,
    ) -> Result<PathBuf, StudyError> {
        let options = StudyOptions { shard: shard.parse()?, threads: NonZero::new(threads), force: false };
        self.plan()?.run_all(&self.path(out), options, progress).map(|progressed| progressed.journal)
    }

    /// The whole study, and every file of its results.
    fn results(&self, out: &str, threads: usize) -> BTreeMap<String, Vec<u8>> {
        let journal = self.run(out, "1/1", threads, &Silent).unwrap();
        self.written(out, &[journal])
    }

    fn written(&self, out: &str, journals: &[PathBuf]) -> BTreeMap<String, Vec<u8>> {
        let plan = StudyPlan::from_journal(published(), &journals[0]).unwrap();
        write(&plan, journals, &self.path(out)).unwrap();
        files(&self.path(out))
    }

    /// What is wrong with the study, without the folder's name.
    fn refused(&self) -> String {
        let refused = self.run("refused", "1/1", 1, &Silent).unwrap_err().to_string();
        assert!(!self.path("refused.journal").exists());
        refused.replace(&format!("{}/", self.0.path().display()), "")
    }
}

/// Stops after so many runs.
struct After(AtomicU64);

impl Progress for After {
    fn begin(&self, _: &str, _: u64) {}

    fn reached(&self, done: u64) -> ControlFlow<()> {
        if done >= self.0.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

/// A journal whose last run says something else in its last digit, with a checksum that is right.
fn with_another_figure(journal: &str) -> String {
    let (before, last) = journal.trim_end().rsplit_once('\n').unwrap();
    let (body, _) = last.rsplit_once(",\"checksum\":\"").unwrap();
    let place = body.rfind(|c: char| c.is_ascii_digit()).unwrap();
    let digit = if &body[place..=place] == "1" { "2" } else { "1" };
    let body = format!("{}{digit}{}", &body[..place], &body[place + 1..]);
    let digest = Sha256::digest(&body);
    let checksum = digest.iter().take(8).fold(String::new(), |all, byte| format!("{all}{byte:02x}"));
    format!("{before}\n{body},\"checksum\":\"{checksum}\"}}\n")
}

#[test]
fn threads_interruptions_and_shards_change_no_byte() {
    let folder = Folder::with(STUDY);
    let one = folder.results("one", 1);
    let names: Vec<&str> = one.keys().map(String::as_str).collect();
    assert!(
        names.contains(&"results.csv") && names.contains(&"figures/1_errors_angle_rmse_deg.svg"),
        "{names:?}"
    );
    assert_eq!(folder.results("three", 3), one);

    // Stopped after two runs, with a third half written.
    let stopped = folder.run("stopped", "1/1", 1, &After(AtomicU64::new(2))).unwrap_err();
    assert!(matches!(stopped, StudyError::Interrupted { done: 2.., total: 6, .. }), "{stopped}");
    let path = folder.path("stopped.journal");
    let journal = fs::read_to_string(&path).unwrap();
    let kept = journal.lines().count();
    let last = journal.lines().last().unwrap();
    fs::write(&path, format!("{journal}{}", &last[..last.len() / 2])).unwrap();
    let options = StudyOptions { shard: Shard::WHOLE, threads: None, force: false };
    let progressed = folder.plan().unwrap().run_all(&folder.path("stopped"), options, &Silent).unwrap();
    assert!(progressed.torn);
    assert_eq!((progressed.before + 1, progressed.runs), (kept as u64, 6));
    assert!(fs::read_to_string(&path).unwrap().starts_with(&journal));
    assert_eq!(folder.written("stopped", &[path]), one);

    // In shards, named in any order, and one of them twice; what is not whole, with other figures or of another study is refused.
    let shards = ["3/4", "1/4", "4/4", "2/4"].map(|shard| folder.run("parts", shard, 2, &Silent).unwrap());
    assert_eq!(folder.written("parts", &shards), one);
    let join = |journals: &[PathBuf]| {
        let plan = StudyPlan::from_journal(published(), &journals[0]).unwrap();
        write(&plan, journals, &folder.path("refused")).unwrap_err()
    };
    let gap = join(&shards[..3]);
    assert!(matches!(gap, StudyError::Gap { missing: 2, total: 6, first: 1, .. }), "{gap}");
    assert!(gap.to_string().contains("name the journal of shard 2/4"), "{gap}");
    let twice = [&shards[..], &shards[..1]].concat();
    assert_eq!(folder.written("parts", &twice), one);
    let altered = folder.path("altered.journal");
    fs::write(&altered, with_another_figure(&fs::read_to_string(&shards[0]).unwrap())).unwrap();
    assert!(matches!(join(&[&shards[..], &[altered]].concat()), StudyError::Overlap { index: 2, .. }));
    let other = Folder::with(&STUDY.replace("seed = 4", "seed = 5"));
    let foreign = other.run("parts", "2/4", 1, &Silent).unwrap();
    assert!(matches!(join(&[shards[0].clone(), foreign]), StudyError::Different { .. }));
    assert!(!folder.path("refused").exists());
}

/// Pictures and comments can change without a run being made again; what figures follow from cannot.
#[test]
fn a_journal_is_that_of_one_study() {
    let folder = Folder::with(STUDY);
    folder.run("out", "1/1", 2, &Silent).unwrap();
    let journal = fs::read(folder.path("out.journal")).unwrap();
    let pictures = STUDY.replace("errors.angle.rmse_deg", "errors.angle.largest_deg");
    fs::write(folder.path("study.toml"), format!("# other pictures\n{pictures}")).unwrap();
    folder.run("out", "1/1", 2, &Silent).unwrap();
    assert_eq!(fs::read(folder.path("out.journal")).unwrap(), journal);

    fs::write(folder.path("study.toml"), STUDY.replace("1.097e-4", "1.096e-4")).unwrap();
    let refused = folder.run("out", "1/1", 2, &Silent).unwrap_err();
    assert!(matches!(refused, StudyError::Journal(JournalError::Other { .. })), "{refused}");
    fs::write(folder.path("study.toml"), STUDY).unwrap();
    fs::write(folder.path("experiment.toml"), experiment().replace("5.71 pF", "5.72 pF")).unwrap();
    assert!(matches!(
        folder.run("out", "1/1", 2, &Silent),
        Err(StudyError::Journal(JournalError::Other { .. }))
    ));
    assert_eq!(fs::read(folder.path("out.journal")).unwrap(), journal);
    let force = StudyOptions { shard: Shard::WHOLE, threads: None, force: true };
    folder.plan().unwrap().run_all(&folder.path("out"), force, &Silent).unwrap();
    assert_ne!(fs::read(folder.path("out.journal")).unwrap(), journal);

    // A damaged line is no half-written one, and a file that is no journal is never overwritten.
    let text = fs::read_to_string(folder.path("out.journal")).unwrap();
    fs::write(
        folder.path("out.journal"),
        text.replacen("\"consistency.mean_nis\":\"", "\"consistency.mean_nis\":\"9", 1),
    )
    .unwrap();
    let damaged = folder.run("out", "1/1", 2, &Silent).unwrap_err();
    assert!(matches!(damaged, StudyError::Journal(JournalError::Damaged { line: 2, .. })), "{damaged}");
    fs::write(folder.path("out.journal"), "years of work\n").unwrap();
    let foreign = folder.plan().unwrap().run_all(&folder.path("out"), force, &Silent).unwrap_err();
    assert!(matches!(foreign, StudyError::Journal(JournalError::NoJournal { .. })), "{foreign}");
    assert_eq!(fs::read_to_string(folder.path("out.journal")).unwrap(), "years of work\n");
}

#[test]
fn repeats_differ_and_draws_are_those_of_the_table() {
    let folder = Folder::with(STUDY);
    let rows = table(&folder.results("out", 2), "results.csv");
    assert_eq!(rows.len(), 6);
    let distinct = |name: &str| {
        rows.iter().map(|row| row[name].as_str()).collect::<std::collections::BTreeSet<_>>().len()
    };
    assert_eq!((distinct("seed"), distinct("offset_V"), distinct("errors.angle.rmse_deg")), (6, 6, 6));
    assert_eq!((distinct("point"), distinct("repeat"), distinct("stiffness_N_m")), (3, 2, 3));
    assert_eq!(rows[2]["stiffness_N_m"], "0.00011");
    let offsets = rows.iter().map(|row| row["offset_V"].parse::<f64>().unwrap());
    assert!(offsets.into_iter().all(|offset| (offset - 6.3945).abs() < 0.025));
    // The wrong stiffness is told to the filter and not to the simulation: it shows.
    let nis = |i: usize| rows[i]["consistency.mean_nis"].parse::<f64>().unwrap();
    assert!(nis(0) > 1.5 * nis(2) && nis(4) > 1.5 * nis(2), "{} {} {}", nis(0), nis(2), nis(4));
}

#[test]
fn a_run_that_fails_is_a_row_and_the_study_goes_on() {
    let vary = "[[vary]]\nkey = \"estimate.skip\"\nvalues = [\"0.5 ms\", \"1.9 ms\", \"0.6 ms\"]\n";
    let folder = Folder::with(&format!("name = \"fails\"\nexperiment = \"experiment.toml\"\n{vary}"));
    let journal = folder.run("out", "1/1", 2, &Silent).unwrap();
    let plan = folder.plan().unwrap();
    let summary = write(&plan, &[journal], &folder.path("out")).unwrap();
    assert_eq!((summary.runs, summary.failed(), summary.rows), (3, 1, 3));
    let rows = table(&files(&folder.path("out")), "results.csv");
    assert!(
        rows[1]["error"].contains("expected more than the settling time of 0.0019 s"),
        "{}",
        rows[1]["error"]
    );
    assert_eq!((rows[1]["skip_s"].as_str(), rows[1]["verdict"].as_str()), ("0.0019", ""));
    assert!(rows[0]["error"].is_empty() && !rows[2]["errors.angle.rmse_deg"].is_empty());
}

/// A filter sees of a simulated device what it would see of a file of it.
#[test]
fn what_is_not_written_is_read_as_if_it_were() {
    let folder = Folder::with(STUDY);
    let adc = "adc = { bits = 10, low = \"-1 V\", high = \"1 V\" }\n";
    let text = experiment().replace("[simulate.drive.sine]", &format!("[simulate.drive.sine]\n# {adc}"));
    let text = text.replace("seed = 1\n", &format!("seed = 1\n{adc}"));
    let experiment = published().parse(&text, &folder.path("experiment.toml")).unwrap();
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let info = || RunInfo { started: SystemTime::UNIX_EPOCH, took: Duration::ZERO };
    let out = folder.path("simulated");
    let output = Output::begin(&out, &Work::named("simulate", "simulated")).unwrap();
    write_simulation(
        &experiment,
        published().rig(&experiment).unwrap(),
        &*simulation,
        &output,
        info,
        &Silent,
    )
    .unwrap();
    output.commit().unwrap();
    let unwritten = ComputedRecording::of(&*simulation, &Silent).unwrap();
    let layout = |columns: &[&str]| RecordingLayout {
        clock: TimeSource::Column("time_s".to_owned()),
        segment_column: None,
        columns: Some(columns.iter().map(|&column| column.to_owned()).collect()),
        declared: Vec::new(),
        hints: Hints::default(),
        nominal_rate_hz: None,
        origin: None,
        restarts: None,
    };
    for (file, layout, ours) in [
        ("recording.csv", layout(&["cap_V", "drive_V"]), ComputedRecording::recorded as fn(&_, &_) -> _),
        ("reference.csv", layout(&["angle_rad", "rate_rad_per_s"]), ComputedRecording::truth),
    ] {
        let read = SampledRecording::read(&out.join(file), &layout).unwrap();
        let ours: SampledRecording = ours(&unwritten, &layout).unwrap();
        assert_eq!(ours.source().file, file);
        assert_eq!(ours.columns(), read.columns());
        assert_eq!(ours.segments(), read.segments());
        assert_eq!(ours.diagnosis(), read.diagnosis());
        if file == "recording.csv" {
            assert!(!read.diagnosis().is_empty(), "a clipped signal is found");
        }
    }
    // What is true cannot be had from what is recorded.
    assert!(unwritten.recorded(&layout(&["angle_rad"])).is_err());
}

#[test]
fn what_is_wrong_is_named_with_its_line() {
    let stiffness = "key = \"device.shared_scanner.resonator.stiffness\"\n";
    for (was, is, message) in [
        (
            stiffness,
            "key = \"device.shared_scanner.resonator.stifness\"\n",
            "study.toml:11: vary[0].key: unknown key `stifness`; did you mean `stiffness`?",
        ),
        (
            stiffness,
            "key = \"device.shared_scaner.resonator.stiffness\"\n",
            "study.toml:11: vary[0].key: unknown key `shared_scaner`; did you mean `shared_scanner`?",
        ),
        (
            stiffness,
            "key = \"recording[0].role\"\n",
            "study.toml:11: vary[0].key: there is no list `recording`",
        ),
        ("points = 3", "points = 1", "study.toml:13: vary[0].grid: `1` points are no grid"),
        (
            "1.097e-4 N m\", to = \"1.103e-4 N m",
            "1 V\", to = \"2 V",
            "study.toml:13: vary[0].grid: `1 V` has the dimension",
        ),
        ("1.097e-4 N m", "-1.097e-4 N m", "study.toml:13: vary[0].grid: `-1.097e-4 N m` is not above 0"),
        ("told", "tolld", "study.toml:12: vary[0].applies_to: unknown word `tolld`; did you mean `told`?"),
        ("applies_to = \"told\"\n", "", "study.toml:11: vary[0].key: the key stands in `[truth]` already"),
        (
            "stiffness\" = \"1.10e-4 N m\"",
            "stiffnes\" = \"1.10e-4 N m\"",
            "study.toml:8: truth.\"device.shared_scanner.resonator.stiffnes\": unknown key `stiffnes`; did you mean `stiffness`?",
        ),
        (
            "stiffness\" = \"1.10e-4 N m\"",
            "stiffness\" = \"3 V\"",
            "study.toml:8: truth.\"device.shared_scanner.resonator.stiffness\": `3 V` has the dimension",
        ),
        (
            "against = \"stiffness\"",
            "against = \"stifness\"",
            "study.toml:22: figure[0].against: unknown word `stifness`; did you mean `stiffness`?",
        ),
        ("experiment.toml", "experimnt.toml", "study.toml:3: experiment: there is no file `experimnt.toml`"),
        ("repeats = 2", "repeats = 0", "study.toml:4: repeats: `0` is below 1"),
        ("seed = 4", "sed = 4", "study.toml:5: sed: unknown key `sed`; did you mean `seed`?"),
        (
            "key = \"device.shared_scanner.readout.offset\"",
            "key = \"simulate.seed\"",
            "use `repeats` instead",
        ),
    ] {
        assert!(STUDY.contains(was), "{was}");
        let refused = Folder::with(&STUDY.replace(was, is)).refused();
        assert!(refused.contains(message), "{is}:\n{refused}\n{message}");
    }
    let nothing = Folder::with("name = \"a\"\nexperiment = \"experiment.toml\"\n").refused();
    assert!(nothing.contains("vary: the key is missing; add a table headed `[[vary]]`"), "{nothing}");
    assert!(matches!("4/3".parse::<Shard>(), Err(StudyError::Shard { .. })));
}

/// A metric that is not there costs a picture and no run.
#[test]
fn an_unknown_metric_is_a_note() {
    let folder = Folder::with(&STUDY.replace("errors.angle.rmse_deg", "errors.angle.rms_deg"));
    let journal = folder.run("out", "1/1", 2, &Silent).unwrap();
    let summary = write(&folder.plan().unwrap(), &[journal], &folder.path("out")).unwrap();
    assert!(summary.notes[0].contains("did you mean `errors.angle.rmse_deg`?"), "{:?}", summary.notes);
    assert!(!folder.path("out/figures").exists());
}

/// A map shows the medians over two keys, each colour where results.csv has its value.
#[test]
fn two_keys_make_a_map() {
    let two = "\n[[vary]]\nkey = \"device.shared_scanner.readout.offset\"\nname = \"offset\"\napplies_to = \"told\"\n\
               values = [\"6.3945 V\", \"6.45 V\"]\n";
    let (head, tail) =
        STUDY.split_once("\n[[vary]]\nkey = \"device.shared_scanner.readout.offset\"").unwrap();
    let (_, figure) = tail.split_once("[[figure]]").unwrap();
    let study = format!("{head}{two}\n[[figure]]{figure}over = \"offset\"\nlevel = 1.0\n");
    let folder = Folder::with(&study);
    let journal = folder.run("out", "1/1", 2, &Silent).unwrap();
    let results = folder.written("out", std::slice::from_ref(&journal));
    let mut medians: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for row in table(&results, "results.csv") {
        medians.entry(row["point"].clone()).or_default().push(row["errors.angle.rmse_deg"].parse().unwrap());
    }
    assert_eq!(medians.len(), 6);
    let medians = medians.values().map(|pair| pair[0].midpoint(pair[1]));
    let (low, high) = medians.fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
    // The line is where the medians pass the level, and nowhere else.
    let svg_at = |level: f64| {
        fs::write(folder.path("study.toml"), study.replace("level = 1.0", &format!("level = {level:?}")))
            .unwrap();
        let out = folder.path("level");
        write(&folder.plan().unwrap(), std::slice::from_ref(&journal), &out).unwrap();
        fs::read_to_string(out.join("figures/1_errors_angle_rmse_deg.svg")).unwrap()
    };
    let pieces = |svg: &str| svg.matches("stroke-linejoin").count();
    let (below, between, above) = (svg_at(0.9 * low), svg_at(low.midpoint(high)), svg_at(1.1 * high));
    assert!(between.contains("angle rmse is"), "{between}");
    assert_eq!(pieces(&below), pieces(&above));
    assert_eq!(pieces(&between), pieces(&above) + 1);

    for (was, is, note) in [
        ("over = \"offset\"", "over = \"stiffness\"", "figure[0]: `against` and `over` are the same"),
        (
            "values = [\"6.3945 V\", \"6.45 V\"]",
            "values = [\"6.3945 V\"]",
            "`offset` has no two values side by side",
        ),
    ] {
        assert!(study.contains(was));
        let folder = Folder::with(&study.replace(was, is));
        let journal = folder.run("out", "1/1", 2, &Silent).unwrap();
        let summary = write(&folder.plan().unwrap(), &[journal], &folder.path("out")).unwrap();
        assert!(summary.notes[0].contains(note), "{:?}", summary.notes);
    }
}

/// Without `[simulate]` the recordings stay and what the filters are told varies.
#[test]
fn a_recording_can_be_studied() {
    let folder = Folder::with(
        "name = \"told\"\nexperiment = \"written/experiment.toml\"\n[[vary]]\nkey = \"device.shared_scanner.resonator.stiffness\"\n\
         values = [\"1.10e-4 N m\", \"1.103e-4 N m\"]\n",
    );
    let experiment = published().load(&folder.path("experiment.toml")).unwrap();
    let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
    let info = || RunInfo { started: SystemTime::UNIX_EPOCH, took: Duration::ZERO };
    let output = Output::begin(&folder.path("written"), &Work::named("simulate", "written")).unwrap();
    write_simulation(
        &experiment,
        published().rig(&experiment).unwrap(),
        &*simulation,
        &output,
        info,
        &Silent,
    )
    .unwrap();
    output.commit().unwrap();
    let rows = table(&folder.results("out", 2), "results.csv");
    let nis = |i: usize| rows[i]["consistency.mean_nis"].parse::<f64>().unwrap();
    assert!(rows.len() == 2 && nis(1) > 1.5 * nis(0), "{} {}", nis(0), nis(1));
    // The recording is part of the study.
    let csv = fs::read_to_string(folder.path("written/recording.csv")).unwrap();
    fs::write(folder.path("written/recording.csv"), csv + "\n").unwrap();
    fs::remove_dir_all(folder.path("out")).unwrap();
    assert!(matches!(
        folder.run("out", "1/1", 1, &Silent),
        Err(StudyError::Journal(JournalError::Other { .. }))
    ));
}

/// Of three settling times one leaves nothing to judge: its runs fail.
#[test]
fn figures_mark_runs_without_an_estimate_and_lead_to_their_settings() {
    let vary = "[[vary]]\nkey = \"estimate.skip\"\nvalues = [\"0.5 ms\", \"1.9 ms\", \"0.6 ms\"]\n\
                [[vary]]\nkey = \"estimate.process_noise.angular_acceleration\"\nname = \"density\"\n\
                values = [\"1e6 rad^2/s^3\", \"1e7 rad^2/s^3\"]\n";
    let figure = "[[figure]]\nmetric = \"errors.angle.rmse_deg\"\nagainst = \"skip\"\n";
    let folder = Folder::with(&format!(
        "name = \"lost\"\nexperiment = \"experiment.toml\"\n{vary}{figure}{figure}over = \"density\"\n"
    ));
    let journal = folder.run("out", "1/1", 2, &Silent).unwrap();
    let summary = write(&folder.plan().unwrap(), &[journal], &folder.path("out")).unwrap();
    assert_eq!((summary.failed(), summary.without_estimate), (2, 2));
    let written = files(&folder.path("out"));
    let text = |name: &str| String::from_utf8(written[name].clone()).unwrap();
    let page = text("report.html");
    // Each run is a row with its settings; every point and cell leads to one, those without a value to the first that failed.
    for run in 0..6 {
        assert!(page.contains(&format!("<tr id=\"run-{run}\"")), "{run}");
        let led_to = page.matches(&format!("<a href=\"#run-{run}\"")).count();
        assert_eq!(led_to, 2, "once from the lines or their crosses, once from the map: {run}");
    }
    let failed =
        "aria-label=\"skip 1.9 ms, density 1e6 rad²/s³: no estimate; 1 of 1 without an estimate (run 2)\"";
    assert_eq!(page.matches(failed).count(), 2, "{page}");
    for figure in ["figures/1_errors_angle_rmse_deg.svg", "figures/2_errors_angle_rmse_deg.svg"] {
        let svg = text(figure);
        assert!(svg.contains("data-label=\"lost lock or failed\"") && !svg.contains("<a "), "{figure}");
    }
    assert!(text("figures/2_errors_angle_rmse_deg.svg").contains("2 of 6 cells have no value and are grey."));
}
