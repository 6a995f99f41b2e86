//! What the documentation says is there: its links, its commands, its keys, and the files that the help names.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// The names of what stands in a folder.
fn listed(folder: &str) -> BTreeSet<String> {
    let entries = fs::read_dir(root().join(folder)).unwrap();
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

/// The records of decisions, by their paths from the root, without their index.
fn decisions() -> Vec<String> {
    let names = listed("decisions").into_iter().filter(|name| name != "README.md");
    names.map(|name| format!("decisions/{name}")).collect()
}

/// The pages that readers are led through, by their paths from the root.
fn pages() -> Vec<String> {
    let mut pages: Vec<String> =
        ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md"].map(str::to_owned).into();
    let chapters = listed("book/src")
        .into_iter()
        .filter(|name| Path::new(name).extension().is_some_and(|ext| ext == "md"));
    pages.extend(chapters.map(|name| format!("book/src/{name}")));
    let examples = listed("examples").into_iter().map(|name| format!("examples/{name}/README.md"));
    pages.extend(examples.filter(|page| root().join(page).is_file()));
    pages
}

fn text(page: &str) -> String {
    fs::read_to_string(root().join(page)).unwrap()
}

/// The lines of a page outside of fenced blocks, and those inside.
fn lines(text: &str) -> impl Iterator<Item = (&str, bool)> {
    let mut fenced = false;
    text.lines().map(move |line| {
        let fence = line.trim_start().starts_with("```");
        if fence {
            fenced = !fenced;
        }
        (line, fenced || fence)
    })
}

/// The name by which a heading is linked.
fn anchor(heading: &str) -> String {
    let plain = heading.trim_start_matches('#').trim().to_lowercase();
    let kept = plain.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

fn anchors(text: &str) -> BTreeSet<String> {
    lines(text).filter(|(line, code)| !code && line.starts_with('#')).map(|(line, _)| anchor(line)).collect()
}

/// The targets of the links and pictures of a line.
fn links(line: &str) -> Vec<&str> {
    let ends = line.match_indices("](").map(|(at, _)| &line[at + 2..]);
    ends.filter_map(|rest| rest.split_once(')').map(|(target, _)| target)).collect()
}

#[test]
fn every_link_of_the_documentation_leads_to_a_page_and_a_heading() {
    let mut dead = Vec::new();
    let others = ["CHANGELOG.md", "decisions/README.md"].map(str::to_owned);
    for page in pages().into_iter().chain(decisions()).chain(others) {
        let whole = text(&page);
        for (line, _) in lines(&whole).filter(|(line, code)| !code && !line.starts_with("    ")) {
            for target in links(line) {
                if target.starts_with("https://") {
                    continue;
                }
                let (file, heading) = target.split_once('#').unwrap_or((target, ""));
                let beside = Path::new(&page).parent().unwrap();
                let at = if file.is_empty() { PathBuf::from(&page) } else { beside.join(file) };
                let found = root().join(&at);
                let there = found.exists()
                    && (heading.is_empty()
                        || anchors(&fs::read_to_string(&found).unwrap()).contains(heading));
                if !there {
                    dead.push(format!("{page}: {target}"));
                }
            }
        }
    }
    assert!(dead.is_empty(), "{dead:#?}");
}

#[test]
fn every_chapter_stands_in_the_summary() {
    let summary = text("book/src/SUMMARY.md");
    let chapters = pages().into_iter().filter_map(|page| page.strip_prefix("book/src/").map(str::to_owned));
    for chapter in chapters.filter(|chapter| chapter != "SUMMARY.md") {
        assert!(summary.contains(&format!("]({chapter})")), "{chapter}");
    }
}

#[test]
fn every_decision_has_its_four_parts_and_stands_in_the_index() {
    let index = text("decisions/README.md");
    for decision in decisions() {
        let name = decision.strip_prefix("decisions/").unwrap();
        assert_eq!(index.matches(&format!("]({name})")).count(), 1, "{decision}");
        let whole = text(&decision);
        let parts = ["# ", "**Context.** ", "**Decision.** ", "**Evidence.** ", "**What would change it.** "];
        let found = parts.map(|part| whole.lines().position(|line| line.starts_with(part)));
        assert!(found.is_sorted() && found.iter().all(Option::is_some), "{decision}: {found:?}");
    }
}

/// What a page shows of another file: its path from the page, with an anchor behind a colon where it is a part, and the text between the marks.
fn shown(page: &str) -> Vec<(String, String)> {
    let behind = page.split("<!-- from ").skip(1);
    behind
        .map(|rest| {
            let (path, rest) = rest.split_once(" -->").expect("a mark has an end");
            let (text, _) = rest.split_once("<!-- end -->").expect("what is shown has an end");
            let lines = text.lines().filter(|line| !line.starts_with("```"));
            (path.to_owned(), lines.collect::<Vec<_>>().join("\n").trim().to_owned())
        })
        .collect()
}

/// Pages are read where nothing includes files into them, so that tables which programs make stand in the pages themselves.
#[test]
fn what_the_book_shows_of_other_files_is_what_they_hold() {
    let mut count = 0;
    for page in pages() {
        let whole = text(&page);
        assert!(!whole.contains("{{#include"), "{page}: a viewer of Markdown shows no included files");
        for (path, shown) in shown(&whole) {
            count += 1;
            let (path, anchor) = path.split_once(':').unwrap_or((&path, ""));
            let at = root().join(&page).parent().unwrap().join(path);
            let file = fs::read_to_string(&at).unwrap_or_else(|e| panic!("{page}: {}: {e}", at.display()));
            let part =
                file.split_once(&format!("ANCHOR: {anchor}\n")).map_or(file.as_str(), |(_, rest)| rest);
            let part = part.split_once(&format!("// ANCHOR_END: {anchor}")).map_or(part, |(part, _)| part);
            assert_eq!(shown, part.trim(), "{page} shows another text than {path} has");
        }
    }
    assert!(count > 20, "{count}");
}

/// A command of a page: as the page has it, and the words behind `kalmems`.
struct Documented {
    line: String,
    words: Vec<String>,
}

/// The words of a command as a shell takes them; `None` of what needs more of a shell than quotes.
fn words(line: &str) -> Option<Vec<String>> {
    let (mut words, mut word, mut quoted) = (Vec::new(), String::new(), false);
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ' ' if !quoted => {
                if !word.is_empty() {
                    words.push(std::mem::take(&mut word));
                }
            }
            '|' | '<' | '>' | '&' | ';' | '$' | '…' if !quoted => return None,
            _ => word.push(c),
        }
    }
    if !word.is_empty() {
        words.push(word);
    }
    (!quoted).then_some(words)
}

/// The ways of calling the command.
const CALLS: [&str; 2] = ["cargo run --release -- ", "kalmems "];

/// The example that computes what a detector records, between two commands of a page.
const DETECTOR: &str = "cargo run --release -p kalmems-cli --example scan_object -- ";

/// The commands of a page in their order: indented lines, and whole inline code that begins with the name of the command and has more
/// than a name. What has a place for the reader's own, such as `FILE` or `DIR`, is left out.
fn commands(page: &str) -> Vec<Documented> {
    let whole = text(page);
    let mut found = Vec::new();
    let mut add = |line: &str| {
        let detector = line.strip_prefix(DETECTOR);
        let Some(rest) = detector.or_else(|| CALLS.iter().find_map(|call| line.strip_prefix(call))) else {
            return;
        };
        let Some(words) = words(rest) else { return };
        let is_placeholder =
            |name: &str| name.len() > 1 && name.chars().all(|c| c.is_ascii_uppercase() || c == '_');
        let is_own = |word: &String| {
            word.split(['/', '=', ':']).any(|part| is_placeholder(part.split('.').next().unwrap_or(part)))
        };
        let names_a_file = words.iter().any(|word| word.contains(['.', '/']));
        // What needs no file; others without one are the beginning of a command that a sentence is about.
        let needs_none =
            ["help", "new", "completions", "man", "reproduce", "schema"].contains(&words[0].as_str());
        if !words.iter().any(is_own) && (names_a_file || needs_none && words.len() > 1) {
            found.push(Documented { line: line.to_owned(), words });
        }
    };
    for (line, fenced) in lines(&whole) {
        match line.strip_prefix("    ") {
            Some(command) if !fenced => add(command.trim()),
            _ if fenced => {}
            _ => line.split('`').skip(1).step_by(2).for_each(|code| add(code.trim())),
        }
    }
    found
}

fn run(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kalmems")).current_dir(folder).args(arguments).output().unwrap()
}

/// Files that a command of the documentation makes: below `out`, or named behind an option that writes.
fn is_made(word: &str, page: &[Documented]) -> bool {
    let written = |one: &Documented| {
        let pairs = one.words.windows(2);
        pairs
            .filter(|pair| matches!(&*pair[0], "--write" | "--out" | "--svg"))
            .any(|pair| word.starts_with(&pair[1]))
    };
    word.starts_with("out/") || page.iter().any(written)
}

/// Each is a command with options that exist, and what it reads is in the project or made by another command of the page.
#[test]
fn every_command_of_the_documentation_is_one_and_its_files_are_there() {
    let mut wrong = Vec::new();
    let mut count = 0;
    for page in pages() {
        let commands = commands(&page);
        for Documented { line, words, .. } in &commands {
            count += 1;
            if line.starts_with(DETECTOR) {
                continue;
            }
            // Options are read before the help is shown.
            let mut arguments: Vec<&str> = words.iter().map(String::as_str).collect();
            if words[0] != "help" {
                arguments.push("--help");
                let output = run(&arguments, &root());
                if !output.status.success() {
                    wrong.push(format!("{page}: {line}: {}", String::from_utf8_lossy(&output.stderr)));
                }
            }
            let is_path = |word: &&String| {
                [".toml", ".csv", ".svg"].iter().any(|ending| word.ends_with(ending)) && !word.contains('=')
            };
            for word in words.iter().filter(is_path) {
                if !root().join(word).is_file() && !is_made(word, &commands) {
                    wrong.push(format!("{page}: {line}: `{word}` is not there"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(count > 80, "{count} commands were found");
}

/// All names of keys in a schema, at any depth.
fn keys(schema: &serde_json::Value, found: &mut BTreeSet<String>) {
    match schema {
        serde_json::Value::Object(map) => {
            if let Some(serde_json::Value::Object(properties)) = map.get("properties") {
                found.extend(properties.keys().cloned());
            }
            map.values().for_each(|value| keys(value, found));
        }
        serde_json::Value::Array(values) => values.iter().for_each(|value| keys(value, found)),
        _ => {}
    }
}

/// What a line of an experiment file begins with, `key = `; none of a line that is no such.
fn key(line: &str) -> Option<&str> {
    let (key, value) = line.split_once(" = ")?;
    let is_value =
        value.starts_with(['"', '[', '{', '-', 't', 'f']) || value.starts_with(|c: char| c.is_ascii_digit());
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || matches!(c, '_' | '.');
    (is_value && key.starts_with(|c: char| c.is_ascii_lowercase()) && key.chars().all(plain)).then_some(key)
}

/// Tables whose keys are names of the reader's own, or of the device: states, parameters, channels.
const OWN_NAMES: [&str; 12] = [
    "device.equations",
    "start",
    "start_sd",
    "states",
    "process_noise",
    "channels",
    "events",
    "vary",
    "correlation",
    "draw",
    "inputs",
    "electrodes",
];

#[test]
fn the_schemas_have_every_key_that_the_documentation_shows() {
    let mut known = BTreeSet::new();
    for of in ["experiment", "study", "image", "spectrum", "gyro"] {
        let output = run(&["schema", of], &root());
        keys(&serde_json::from_slice(&output.stdout).unwrap(), &mut known);
    }
    let mut names = BTreeSet::new();
    for device in
        ["shared_scanner", "threshold_scanner", "micro_stage", "accelerometer", "piston_mirror", "equations"]
    {
        let output = run(&["help", "device", device, "--json"], &root());
        let device: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        for group in ["channels", "references", "states", "process_noise", "parameters"] {
            names.extend(
                device[group].as_array().unwrap().iter().map(|one| one["name"].as_str().unwrap().to_owned()),
            );
        }
    }
    let mut wrong = Vec::new();
    // What is written like a key there is Python, which the tests of the package run.
    let is_of_python =
        |page: &String| page.starts_with("book/src/python") || page.starts_with("book/src/notebook");
    for page in pages().into_iter().filter(|page| !is_of_python(page)) {
        let (whole, mut own) = (text(&page), false);
        for (line, fenced) in lines(&whole) {
            let Some(code) = (if fenced { Some(line) } else { line.strip_prefix("    ") }) else {
                own = false;
                continue;
            };
            if let Some(table) = code.strip_prefix('[') {
                let table = table.trim_start_matches('[').split(']').next().unwrap_or_default();
                own = OWN_NAMES.iter().any(|name| table.contains(name));
                // Equations are shown in pieces, whose tables have their names there alone.
                own |= [
                    "states",
                    "inputs",
                    "parameters",
                    "let",
                    "functions",
                    "derivative",
                    "measure",
                    "noise",
                    "tables",
                ]
                .contains(&table);
            }
            let Some(key) = key(code.trim()).filter(|_| !own) else { continue };
            for part in key.split('.') {
                if !(known.contains(part) || names.contains(part)) {
                    wrong.push(format!("{page}: {}", code.trim()));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The names of the keys of a document, but for those that are names of the reader's own.
fn named_keys(document: &serde_json::Value, within: &str, found: &mut BTreeSet<String>) {
    match document {
        serde_json::Value::Object(map) => {
            for (key, value) in map {
                if !matches!(within, "parameters" | "values") {
                    found.insert(key.clone());
                }
                named_keys(value, key, found);
            }
        }
        serde_json::Value::Array(values) => values.iter().for_each(|value| named_keys(value, within, found)),
        _ => {}
    }
}

#[test]
#[ignore = "long: `.ci/run --all` runs it"]
fn long_the_book_has_every_key_that_json_output_has() {
    let page = text("book/src/json.md");
    let folder = tempfile::tempdir().unwrap();
    let out = |name: &str| folder.path().join(name).display().to_string();
    let scanner = "examples/shared_scanner";
    let (stiffness, simulation) =
        (format!("{scanner}/stiffness_state.toml"), format!("{scanner}/simulation.toml"));
    let recording = format!("{scanner}/recording.csv");
    let [experiment, ring_down, filter, image] =
        ["experiment", "ring_down", "microcontroller", "image"].map(|name| format!("{scanner}/{name}.toml"));
    let mut missing = Vec::new();
    for arguments in [
        vec!["estimate", &stiffness, "--json", "--out", &out("estimate")],
        vec!["simulate", &simulation, "--json", "--out", &out("simulate")],
        vec!["inspect", &recording, "--json"],
        vec!["new", &recording, "--device", "shared_scanner", "--json"],
        vec!["expand", &stiffness, "--json"],
        vec!["help", "device", "shared_scanner", "--json"],
        vec!["diagnose", &experiment, "--json"],
        vec!["inspect", &experiment, "--json"],
        vec!["identify", &ring_down, "--json", "--out", &out("identify")],
        vec!["export", &filter, "--target", "c", "--json", "--out", &out("export")],
        vec!["image", &image, "--json", "--out", &out("image")],
        vec![
            "calibrate",
            "gyro",
            "examples/gyroscope/calibration.toml",
            "--json",
            "--out",
            &out("calibrate"),
        ],
        vec!["compare", &out("estimate"), &out("estimate"), "--json", "--report", &out("compare.html")],
    ] {
        let output = run(&arguments, &root());
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        let mut keys = BTreeSet::new();
        named_keys(&serde_json::from_slice(&output.stdout).unwrap(), "", &mut keys);
        missing.extend(
            keys.into_iter()
                .filter(|key| !page.contains(&format!("`{key}`")) && !page.contains(&format!(".{key}`")))
                .map(|key| format!("{}: {key}", arguments[0])),
        );
    }
    assert!(missing.is_empty(), "{missing:#?}");
}

#[test]
fn the_help_names_files_that_are_there() {
    let help = |path: &[&str]| {
        let mut arguments = path.to_vec();
        arguments.push("--help");
        String::from_utf8(run(&arguments, &root()).stdout).unwrap()
    };
    let commands: Vec<String> = help(&[])
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty())
        .filter_map(|line| line.split_whitespace().next().map(str::to_owned))
        .collect();
    assert!(commands.len() > 15, "{commands:?}");
    let mut named = 0;
    for command in &commands {
        let texts = [help(&[command]), help(&[command, "gyro"])];
        for word in
            texts.iter().flat_map(|text| text.split(|c: char| c.is_whitespace() || matches!(c, '`' | ',')))
        {
            let word = word.trim_end_matches('.');
            if word.starts_with("examples/") {
                named += 1;
                assert!(root().join(word).is_file(), "{command} --help names {word}");
            }
        }
    }
    assert!(named > 8, "{named}");
}

/// A copy of what the commands read, without the code.
fn copied(folder: &Path) {
    for name in ["examples", "crates/kalmems/tests/experiments"] {
        let to = folder.join(name);
        fs::create_dir_all(&to).unwrap();
        copy(&root().join(name), &to);
    }
}

fn copy(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            if entry.file_name() != "target" && entry.file_name() != "out" {
                fs::create_dir_all(&target).unwrap();
                copy(&entry.path(), &target);
            }
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// Changes a file as the page tells the reader behind this command.
fn edit(page: &str, line: &str, folder: &Path) {
    let tutorial = "book/src/first_recording.md";
    if page == tutorial && line.ends_with("--write my_scanner.toml") {
        let (file, to) = (folder.join("my_scanner.toml"), "stiffness = \"1.1033e-4 N m\"");
        let before = fs::read_to_string(&file).unwrap();
        assert!(text(tutorial).contains(to));
        fs::write(&file, before.replace("stiffness = \"1.10e-4 N m\"", to)).unwrap();
    }
}

/// The commands that a command suggests on standard error, behind a colon.
fn suggestions(said: &str) -> Vec<Vec<String>> {
    said.lines()
        .filter_map(|line| line.split_once(": kalmems "))
        .filter_map(|(_, command)| words(command))
        .collect()
}

/// Runs every command of every page in the page's order, each page in a copy of its own, and every command that one of them suggests
/// next. An exit code of 3, which `--strict` gives, is an answer. `KALMEMS_PAGES` chooses pages, by a part of their paths.
#[test]
#[ignore = "slow: every command of the documentation, some minutes"]
fn slow_every_command_of_the_documentation_runs() {
    let (mut failed, mut suggested) = (Vec::new(), 0);
    let chosen = std::env::var("KALMEMS_PAGES").unwrap_or_default();
    for page in pages().into_iter().filter(|page| page.contains(&chosen)) {
        let commands = commands(&page);
        if commands.is_empty() {
            continue;
        }
        let folder = tempfile::tempdir().unwrap();
        copied(folder.path());
        let mut done: Vec<Vec<String>> = Vec::new();
        for Documented { line, words, .. } in commands {
            if done.contains(&words) {
                continue;
            }
            if line.starts_with(DETECTOR) {
                let file = |place: usize| folder.path().join(&words[place]);
                crate::image::scan_object::scan(&file(0), &file(1)).unwrap();
                continue;
            }
            let mut next = vec![words.clone()];
            while let Some(command) = next.pop() {
                if done.contains(&command) {
                    continue;
                }
                let arguments: Vec<&str> = command.iter().map(String::as_str).collect();
                let output = run(&arguments, folder.path());
                let said = String::from_utf8_lossy(&output.stderr);
                let as_run = command.join(" ");
                println!("{page}: kalmems {as_run}: {:?}", output.status.code());
                // Without a device `new` describes a recording and asks for the device.
                let asks = command[0] == "new" && !command.iter().any(|word| word.starts_with("--"));
                let is_answer =
                    matches!(output.status.code(), Some(0 | 3)) || asks && output.status.code() == Some(2);
                if !is_answer {
                    failed.push(format!("{page}: {line}: kalmems {as_run}: {said}"));
                }
                if command == words {
                    edit(&page, &line, folder.path());
                    let more = suggestions(&said);
                    suggested += more.len();
                    next.extend(more);
                }
                done.push(command);
            }
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
    assert!(suggested > 20 || !chosen.is_empty(), "{suggested}");
}

/// The experiment files of the examples that have a simulation.
fn simulations() -> Vec<String> {
    let mut found = Vec::new();
    for folder in fs::read_dir(root().join("examples")).unwrap() {
        let folder = folder.unwrap().path();
        for file in fs::read_dir(&folder).unwrap() {
            let file = file.unwrap().path();
            let is_toml = file.extension().is_some_and(|ending| ending == "toml");
            if is_toml && fs::read_to_string(&file).unwrap().contains("\n[simulate]\n") {
                found.push(file.strip_prefix(root()).unwrap().display().to_string());
            }
        }
    }
    found.sort();
    found
}

/// What `simulate` says to run next, for every example that has a simulation.
#[test]
#[ignore = "slow: simulates all examples, a minute"]
fn slow_what_simulate_suggests_runs_for_every_example() {
    let (mut failed, mut count) = (Vec::new(), 0);
    for file in simulations() {
        let folder = tempfile::tempdir().unwrap();
        copied(folder.path());
        let output = run(&["simulate", &file], folder.path());
        let said = String::from_utf8(output.stderr).unwrap();
        if !output.status.success() {
            failed.push(format!("simulate {file}: {said}"));
            continue;
        }
        let suggested =
            said.lines().filter_map(|line| line.split_once("with: kalmems ").map(|(_, command)| command));
        for command in suggested {
            count += 1;
            let arguments: Vec<String> = words(command).unwrap();
            let output = run(&arguments.iter().map(String::as_str).collect::<Vec<_>>(), folder.path());
            println!("{file}: kalmems {command}: {:?}", output.status.code());
            if !output.status.success() {
                failed
                    .push(format!("{file}: kalmems {command}: {}", String::from_utf8_lossy(&output.stderr)));
            }
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
    assert!(count >= 12, "{count} suggestions");
}
