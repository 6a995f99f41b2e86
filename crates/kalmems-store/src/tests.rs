//! What the store keeps, refuses and clears.

use super::*;
use std::collections::BTreeSet;
use std::fs;

/// A laboratory's folder with an experiment file.
struct Laboratory(tempfile::TempDir);

impl Laboratory {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("experiment.toml"), "name = \"a\"").unwrap();
        fs::write(folder.path().join("other.toml"), "name = \"b\"").unwrap();
        Self(folder)
    }

    fn at(&self, path: &str) -> PathBuf {
        self.0.path().join(path)
    }

    fn begin(&self, file: &str, target: &str, force: bool) -> Result<Output, OutputError> {
        let work = Work::of_file("estimate", &self.at(file), vec![self.at("recording.csv")]).forced(force);
        Output::begin(&self.at(target), &work)
    }

    /// A run of an experiment that says this.
    fn run(&self, file: &str, says: &str, force: bool) -> Result<EarlierResult, OutputError> {
        let output = self.begin(file, "scan", force)?;
        fill(&output, says);
        output.commit()
    }

    /// All files in the folder, without the experiments, with their contents.
    fn files(&self) -> BTreeMap<String, String> {
        let mut files = BTreeMap::new();
        let mut folders = vec![self.0.path().to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                let name = path.strip_prefix(self.0.path()).unwrap().to_string_lossy().into_owned();
                if path.is_dir() {
                    folders.push(path);
                } else if !["experiment.toml", "other.toml"].contains(&name.as_str()) {
                    files.insert(name, fs::read_to_string(path).unwrap());
                }
            }
        }
        files
    }

    fn names(&self) -> Vec<String> {
        self.files().into_keys().collect()
    }
}

fn fill(output: &Output, says: &str) {
    let timing = format!("input = \"{says}\"\n[timing]\ntook_s = {}\n", output.sealed.as_ptr() as usize);
    output.write("figures/motion.svg", |w| writeln!(w, "picture of {says}")).unwrap();
    output.write("metrics.json", |w| writeln!(w, "{says}")).unwrap();
    output.write(RUN_FILE, |w| w.write_all(timing.as_bytes())).unwrap();
}

const RESULT: [&str; 4] =
    ["scan/figures/motion.svg", "scan/manifest.toml", "scan/metrics.json", "scan/run.toml"];

#[test]
fn a_result_is_there_whole_or_not_at_all() {
    let lab = Laboratory::new();
    let output = lab.begin("experiment.toml", "scan", false).unwrap();
    output.write(RUN_FILE, |w| writeln!(w, "a = 1")).unwrap();
    assert!(!lab.at("scan").exists());
    drop(output);
    assert!(lab.names().is_empty());
    drop(lab.begin("experiment.toml", "out/of/nothing", false).unwrap());
    assert!(!lab.at("out").exists());
    assert_eq!(lab.run("experiment.toml", "first", false).unwrap(), EarlierResult::default());
    assert_eq!(lab.names(), RESULT);
}

#[test]
fn the_same_result_is_replaced_and_another_of_the_same_experiment_is_kept() {
    let lab = Laboratory::new();
    for _ in 0..3 {
        assert_eq!(lab.run("experiment.toml", "first", false).unwrap(), EarlierResult::default());
        assert_eq!(lab.names(), RESULT);
    }
    for says in ["second", "third", "fourth"] {
        let earlier = lab.run("experiment.toml", says, false).unwrap().earlier;
        assert_eq!(earlier.unwrap().file_name().unwrap(), "scan.previous");
        let metrics: BTreeSet<String> =
            lab.names().into_iter().filter(|name| name.ends_with("metrics.json")).collect();
        let kept = ["scan", "scan.previous"].map(|folder| format!("{folder}/metrics.json"));
        assert_eq!(metrics, BTreeSet::from(kept));
    }
    let files = lab.files();
    assert_eq!(files["scan/metrics.json"], "fourth\n");
    assert_eq!(files["scan.previous/metrics.json"], "third\n");
}

#[test]
fn an_earlier_result_that_was_changed_or_is_of_another_experiment_is_not_removed_for_a_later_one() {
    let lab = Laboratory::new();
    lab.run("experiment.toml", "first", false).unwrap();
    lab.run("experiment.toml", "second", false).unwrap();
    fs::write(lab.at("scan.previous/metrics.json"), "corrected by hand").unwrap();
    lab.run("experiment.toml", "third", false).unwrap();
    lab.run("other.toml", "fourth", true).unwrap();
    lab.run("other.toml", "fifth", false).unwrap();
    let files = lab.files();
    let said = |folder: &str| files[&format!("{folder}/metrics.json")].as_str();
    assert_eq!((said("scan"), said("scan.previous")), ("fifth\n", "fourth\n"));
    assert_eq!((said("scan.previous-2"), said("scan.previous-3")), ("corrected by hand", "third\n"));
}

#[test]
fn a_folder_that_has_the_name_of_the_earlier_result_is_left_alone() {
    let lab = Laboratory::new();
    lab.run("experiment.toml", "first", false).unwrap();
    fs::create_dir(lab.at("scan.previous")).unwrap();
    fs::write(lab.at("scan.previous/thesis.tex"), "years").unwrap();
    let kept = lab.run("experiment.toml", "second", false).unwrap().earlier.unwrap();
    assert_eq!(kept.file_name().unwrap(), "scan.previous-2");
    assert_eq!(lab.files()["scan.previous/thesis.tex"], "years");
}

#[test]
fn the_result_of_another_experiment_is_replaced_by_force_alone_and_kept() {
    let lab = Laboratory::new();
    lab.run("experiment.toml", "first", false).unwrap();
    let error = lab.run("other.toml", "second", false).unwrap_err();
    assert!(
        matches!(&error, OutputError::OtherWork { was, is, .. }
            if was == "`estimate` of `../experiment.toml`" && is == "`estimate` of `../other.toml`"),
        "{error}"
    );
    assert_eq!(lab.files()["scan/metrics.json"], "first\n");
    lab.run("other.toml", "second", true).unwrap();
    assert_eq!(lab.files()["scan.previous/metrics.json"], "first\n");
}

#[test]
fn what_the_program_did_not_write_refuses_the_run_before_it_begins_even_with_force() {
    for stranger in ["mynotes.txt", "figures/own.png", "raw/measure.csv", "raw", ".hidden"] {
        let lab = Laboratory::new();
        lab.run("experiment.toml", "first", false).unwrap();
        let path = lab.at("scan").join(stranger);
        if stranger == "raw" {
            fs::create_dir(path).unwrap();
        } else {
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "mine").unwrap();
        }
        let before = lab.files();
        for force in [false, true] {
            let error = lab.begin("experiment.toml", "scan", force).unwrap_err();
            let OutputError::Stranger { file, .. } = &error else { panic!("{error}") };
            assert!(stranger.starts_with(file.as_str()), "{file}");
        }
        assert_eq!(lab.files(), before);
    }
}

#[test]
fn a_folder_without_a_manifest_is_never_touched() {
    for (name, unlisted) in [("thesis.tex", false), (RUN_FILE, true)] {
        let lab = Laboratory::new();
        fs::create_dir(lab.at("scan")).unwrap();
        fs::write(lab.at("scan").join(name), "years of work").unwrap();
        for force in [false, true] {
            match lab.begin("experiment.toml", "scan", force).unwrap_err() {
                OutputError::Foreign { file, .. } => assert!(!unlisted && file == name),
                OutputError::Unlisted { .. } => assert!(unlisted),
                error => panic!("{error}"),
            }
        }
        assert_eq!(lab.names(), [format!("scan/{name}")]);
    }
}

#[test]
fn a_file_that_was_changed_is_the_users_and_kept_by_force() {
    let lab = Laboratory::new();
    lab.run("experiment.toml", "first", false).unwrap();
    fs::write(lab.at("scan/metrics.json"), "corrected by hand").unwrap();
    let error = lab.run("experiment.toml", "first", false).unwrap_err();
    assert!(matches!(&error, OutputError::Changed { file, .. } if file == "metrics.json"), "{error}");
    assert_eq!(lab.files()["scan/metrics.json"], "corrected by hand");
    lab.run("experiment.toml", "first", true).unwrap();
    assert_eq!(lab.files()["scan.previous/metrics.json"], "corrected by hand");
    assert_eq!(lab.files()["scan/metrics.json"], "first\n");
    // What the user removed is not missed.
    fs::remove_file(lab.at("scan/figures/motion.svg")).unwrap();
    assert_eq!(lab.run("experiment.toml", "first", false).unwrap(), EarlierResult::default());
}

#[test]
fn a_target_that_holds_an_input_is_refused_even_with_force() {
    let lab = Laboratory::new();
    let begin = |file: &str, input: &str, target: &str, force: bool| {
        let work = Work::of_file("estimate", &lab.at(file), vec![lab.at(input)]).forced(force);
        Output::begin(&lab.at(target), &work)
    };
    fs::create_dir(lab.at("scan")).unwrap();
    fs::write(lab.at("scan/recording.csv"), "1,2").unwrap();
    fs::copy(lab.at("experiment.toml"), lab.at("scan/experiment.toml")).unwrap();
    for force in [false, true] {
        for (file, input) in
            [("experiment.toml", "scan/recording.csv"), ("scan/experiment.toml", "recording.csv")]
        {
            let error = begin(file, input, "scan", force).unwrap_err();
            let OutputError::Input { instead, .. } = &error else { panic!("{error}") };
            assert_eq!(*instead, lab.at("scan/estimate"));
        }
        // The folder of the experiment itself, named in another way.
        assert!(matches!(begin("experiment.toml", "none", "scan/..", force), Err(OutputError::Input { .. })));
    }
    assert!(begin("scan/experiment.toml", "scan/recording.csv", "scan/estimate", false).is_ok());
    assert_eq!(lab.files()["scan/recording.csv"], "1,2");
}

#[test]
fn a_second_run_into_the_same_target_is_refused_with_the_name_of_the_first() {
    let lab = Laboratory::new();
    let first = lab.begin("experiment.toml", "scan", false).unwrap();
    assert!(matches!(lab.begin("experiment.toml", "scan", true), Err(OutputError::Busy { .. })));
    // Into another target beside it there may be one, and it leaves the first alone.
    let second = lab.begin("experiment.toml", "other", false).unwrap();
    fill(&second, "second");
    second.commit().unwrap();
    fill(&first, "first");
    first.commit().unwrap();
    assert_eq!(lab.files()["scan/metrics.json"], "first\n");
}

#[cfg(unix)]
#[test]
fn links_are_followed_to_the_target_and_never_replaced() {
    use std::os::unix::fs::symlink;
    let lab = Laboratory::new();
    fs::create_dir(lab.at("disk")).unwrap();
    symlink(lab.at("disk"), lab.at("scan")).unwrap();
    lab.run("experiment.toml", "first", false).unwrap();
    lab.run("experiment.toml", "second", false).unwrap();
    assert!(lab.at("scan").is_symlink());
    assert_eq!(lab.files()["disk/metrics.json"], "second\n");
    assert_eq!(lab.files()["disk.previous/metrics.json"], "first\n");
    // A file of the result that was replaced by a link is changed; what the link leads to is not.
    fs::write(lab.at("mine"), "second\n").unwrap();
    fs::remove_file(lab.at("disk/metrics.json")).unwrap();
    symlink(lab.at("mine"), lab.at("disk/metrics.json")).unwrap();
    assert!(matches!(lab.run("experiment.toml", "second", false), Err(OutputError::Changed { .. })));
    lab.run("experiment.toml", "second", true).unwrap();
    assert_eq!(lab.files()["mine"], "second\n");
    symlink(lab.at("nowhere"), lab.at("loose")).unwrap();
    for target in ["loose", "mine", "/dev/null"] {
        assert!(
            matches!(lab.begin("experiment.toml", target, true), Err(OutputError::NoFolder { .. })),
            "{target}"
        );
    }
}

/// Where a run can die.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Death {
    InTheMiddle,
    Complete,
    Marked,
    Exchanged,
    BetweenTheSteps,
    AfterBothSteps,
}

#[test]
fn what_a_dead_run_left_is_finished_or_cleared_by_the_next() {
    use Death::{AfterBothSteps, BetweenTheSteps, Complete, Exchanged, InTheMiddle, Marked};
    for death in [InTheMiddle, Complete, Marked, Exchanged, BetweenTheSteps, AfterBothSteps] {
        for next in ["scan", "other"] {
            let lab = Laboratory::new();
            lab.run("experiment.toml", "first", false).unwrap();
            let output = lab.begin("experiment.toml", "scan", false).unwrap();
            fill(&output, "second");
            die(output, death);
            let published = matches!(death, Exchanged | BetweenTheSteps | AfterBothSteps);
            if death == BetweenTheSteps {
                assert!(!lab.at("scan").exists());
            } else {
                let there = if published { "second\n" } else { "first\n" };
                assert_eq!(lab.files()["scan/metrics.json"], there, "{death:?}");
            }
            let output = lab.begin("experiment.toml", next, false).unwrap();
            let (there, earlier) = if published { ("second\n", Some("first\n")) } else { ("first\n", None) };
            let files = lab.files();
            assert_eq!(files["scan/metrics.json"], there, "{death:?}");
            let kept = files.get("scan.previous/metrics.json").map(String::as_str);
            assert_eq!(kept, earlier, "{death:?}");
            drop(output);
            let left: Vec<String> = lab.names().into_iter().filter(|name| name.starts_with('.')).collect();
            assert!(left.is_empty(), "{death:?}: {left:?}");
        }
    }
}

/// The earlier result says the same as the new one, and the run died while it was being removed.
#[test]
fn a_result_that_was_half_removed_by_a_dead_run_is_removed_by_the_next_and_not_kept() {
    for removed in 0..=RESULT.len() {
        let lab = Laboratory::new();
        lab.run("experiment.toml", "first", false).unwrap();
        let output = lab.begin("experiment.toml", "scan", false).unwrap();
        fill(&output, "first");
        die(output, Death::Exchanged);
        let staging = lab.at(".kalmems-scan.staging");
        let marker = fs::read_to_string(staging.join("marker")).unwrap();
        fs::write(staging.join("marker"), marker.replace("keep", "remove")).unwrap();
        // In the order in which they are removed: the list last.
        for name in ["figures/motion.svg", "metrics.json", RUN_FILE, MANIFEST].iter().take(removed) {
            fs::remove_file(staging.join("result").join(name)).unwrap();
        }
        if removed == RESULT.len() {
            fs::remove_dir(staging.join("result/figures")).unwrap();
        }
        drop(lab.begin("experiment.toml", "other", false).unwrap());
        assert_eq!(lab.names(), RESULT, "{removed}");
        assert!(!lab.at("scan.previous").exists() && !staging.exists(), "{removed}");
    }
}

/// Ends a run as a process does that is killed.
fn die(output: Output, death: Death) {
    let (place, staging) = (output.place.clone(), output.place.with_file_name(".kalmems-scan.staging"));
    let manifest = Manifest::new(output.command, output.of.clone(), output.sealed.borrow().clone());
    if death != Death::InTheMiddle {
        output.staging.write_manifest(&manifest).unwrap();
    }
    if !matches!(death, Death::InTheMiddle | Death::Complete) {
        let new = sealed::checksum(&staging.join("result").join(MANIFEST)).unwrap();
        let marker = format!("{{\"result\":\"{new}\",\"earlier\":\"keep\"}}");
        fs::write(staging.join("marker"), marker).unwrap();
    }
    let (result, old) = (staging.join("result"), staging.join("old"));
    match death {
        Death::InTheMiddle | Death::Complete | Death::Marked => {}
        Death::Exchanged => {
            fs::rename(&place, staging.join("between")).unwrap();
            fs::rename(&result, &place).unwrap();
            fs::rename(staging.join("between"), &result).unwrap();
        }
        Death::BetweenTheSteps => fs::rename(&place, &old).unwrap(),
        Death::AfterBothSteps => {
            fs::rename(&place, &old).unwrap();
            fs::rename(&result, &place).unwrap();
        }
    }
    output.staging.die();
}

#[test]
fn a_file_that_somebody_put_into_a_dead_runs_folder_stays() {
    let lab = Laboratory::new();
    let output = lab.begin("experiment.toml", "scan", false).unwrap();
    fill(&output, "first");
    die(output, Death::InTheMiddle);
    fs::write(lab.at(".kalmems-scan.staging/result/mine.txt"), "mine").unwrap();
    // Nothing is lost, and the run says where it stumbles.
    assert!(lab.begin("experiment.toml", "scan", false).is_err());
    assert_eq!(lab.files()[".kalmems-scan.staging/result/mine.txt"], "mine");
    assert!(lab.begin("experiment.toml", "other", false).is_ok());
}

#[test]
fn an_empty_folder_of_a_run_that_died_before_its_lock_goes_with_the_next_run_beside_it() {
    let lab = Laboratory::new();
    let (empty, filled) = (lab.at(".kalmems-dead.staging"), lab.at(".kalmems-other.staging"));
    fs::create_dir(&empty).unwrap();
    fs::create_dir(&filled).unwrap();
    fs::write(filled.join("mine.txt"), "mine").unwrap();
    lab.run("experiment.toml", "first", false).unwrap();
    assert!(!empty.exists());
    assert_eq!(fs::read(filled.join("mine.txt")).unwrap(), b"mine");
}

#[test]
fn what_is_put_into_a_target_while_a_run_is_at_work_is_left_alone() {
    let lab = Laboratory::new();
    lab.run("experiment.toml", "first", false).unwrap();
    let output = lab.begin("experiment.toml", "scan", false).unwrap();
    fill(&output, "second");
    fs::write(lab.at("scan/mynotes.txt"), "mine").unwrap();
    let error = output.commit().unwrap_err();
    assert!(matches!(&error, OutputError::Taken { result, .. } if result.ends_with("scan.new")), "{error}");
    let files = lab.files();
    assert_eq!(files["scan/mynotes.txt"], "mine");
    assert_eq!(files["scan/metrics.json"], "first\n");
    assert_eq!(files["scan.new/metrics.json"], "second\n");
}

#[test]
fn a_file_is_found_from_a_folder_that_is_not_there_yet() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    fs::create_dir_all(root.join("a/b")).unwrap();
    fs::write(root.join("a/r.csv"), "").unwrap();
    let seen = |from: &str| way_from(&root.join(from), &root.join("a/r.csv")).unwrap();
    assert_eq!(seen("out/identified"), Path::new("../../a/r.csv"));
    assert_eq!(seen("a/b/c"), Path::new("../../r.csv"));
    assert_eq!(seen("a"), Path::new("r.csv"));
    assert!(way_from(&root.join("a"), &root.join("none.csv")).is_none());
}
