//! What messages tell the user to write is typed back as it is printed, to `inspect` and to `new`.

use super::columns::{PLAIN, done, example, run, said};
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Output;

/// The text between two words of a message, the last time that the first of them stands there.
fn between<'a>(message: &'a str, before: &str, after: &str) -> Option<&'a str> {
    let (_, rest) = message.rsplit_once(before)?;
    rest.split_once(after).map(|(text, _)| text)
}

/// The arguments for what a message says to write, as pairs of an option and its value.
fn typed(message: &str) -> Vec<(&'static str, String)> {
    if let Some(group) = between(message, "write `group` as one of `", "`") {
        return vec![("--group", group.to_owned())];
    }
    if let Some(rate) =
        between(message, "such as `--rate \"", "\"`").or_else(|| between(message, "{ rate = \"", "\" }`"))
    {
        return vec![("--rate", rate.to_owned())];
    }
    let Some(format) = between(message, "`format = {", "}`") else { return Vec::new() };
    let table: toml::Table = toml::from_str(&format!("format = {{{format}}}")).unwrap();
    let keys = table["format"].as_table().unwrap();
    let plain = |value: &toml::Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let option = |(key, value): (&String, &toml::Value)| match key.as_str() {
        "columns" => {
            let names: Vec<String> = value.as_array().unwrap().iter().map(plain).collect();
            Some(("--columns", names.join(",")))
        }
        "header_line" => Some(("--header-line", plain(value))),
        "separator" => Some(("--separator", plain(value))),
        // With other keys it says again how the file was taken.
        "kind" if keys.len() == 1 => Some(("--format", plain(value))),
        "kind" => None,
        other => panic!("{other}: {message}"),
    };
    keys.iter().filter_map(option).collect()
}

/// Rows of so many numbers without names, the first of them the time.
fn bare(columns: u32) -> String {
    (0..50_u32).fold(String::new(), |text, row| {
        let cells = (1..columns).map(|column| format!(",{}", (row * column) % 7));
        text + &format!("{}", f64::from(row) / 1000.0) + &cells.collect::<String>() + "\n"
    })
}

/// Files whose first message asks for something, with a word of that message.
fn files() -> Vec<(&'static str, Vec<u8>, &'static str)> {
    let fixture = |name: &str| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../kalmems-formats/tests/fixtures");
        std::fs::read(folder.join(name)).unwrap()
    };
    let few_digits = (0..50)
        .fold("time_unix_s,cap_V\n".to_owned(), |text, row| text + &format!("1.73234e+09,{}\n", row * 3 % 7));
    vec![
        ("two.csv", bare(2).into(), "columns = "),
        ("three.csv", bare(3).into(), "columns = "),
        ("four.csv", bare(4).into(), "columns = "),
        // Numbers of counters between blanks, below a comment.
        (
            "four.txt",
            b"# Created at 2021-04-23\n14378659 0.19 -0.19 0.01\n14378664 -0.03 -0.09 0.2\n".into(),
            "columns = ",
        ),
        ("plain.npy", fixture("plain.npy"), "columns = "),
        ("matrix.mat", fixture("matrix.mat"), "columns = "),
        ("several.h5", fixture("several.h5"), "write `group`"),
        ("text.h5", b"time_s,cap_V\n0,1\n1,2\n2,4\n".into(), "kind = \"csv\" }"),
        ("several.csv", fixture("several.h5"), "kind = \"hdf5\" }"),
        ("marks.csv", b"a,b;c\n1,2;3\n2,3;4\n".into(), "separator = "),
        ("titles.csv", b"a title of a file\nleft,right\nupper,lower\n1,2\n3,4\n".into(), "header_line = "),
        ("few_digits.csv", few_digits.into(), "clock = { rate = "),
        ("no_time.csv", b"drive_V,cap_V\n0,1\n1,2\n2,4\n".into(), "--rate"),
    ]
}

/// Whether a file was read: by `new` as well where only the device is not known.
fn is_read(output: &Output) -> bool {
    output.status.success()
        || output.status.code() == Some(2) && said(output).contains("the device is not known")
}

/// Types what the messages of a command say until it reads a file; all that was typed.
fn follow(command: &str, file: &str, asked: &str) -> BTreeSet<&'static str> {
    let (mut arguments, mut options) = (vec![command.to_owned(), file.to_owned()], BTreeSet::new());
    for round in 0..4 {
        let output = run(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        if is_read(&output) {
            return options;
        }
        let all = |output: &Output| format!("{}{}", String::from_utf8_lossy(&output.stdout), said(output));
        let mut message = all(&output);
        // The command that it names says why.
        if let Some(named) = between(&message, "`kalmems inspect ", "` says why") {
            message = all(&run(&["inspect", named]));
        }
        assert!(round > 0 || command == "new" || message.contains(asked), "{file}: {message}");
        let pairs = typed(&message);
        assert!(!pairs.is_empty(), "{command} {file} {arguments:?}: {message}");
        for (option, value) in pairs {
            assert!(options.insert(option), "{option} again: {message}");
            arguments.extend([option.to_owned(), value]);
        }
    }
    panic!("{arguments:?} is refused")
}

#[test]
fn every_remedy_of_a_message_is_taken_as_it_is_printed() {
    let folder = tempfile::tempdir().unwrap();
    let mut typed_for = [BTreeSet::new(), BTreeSet::new()];
    for (name, bytes, asked) in files() {
        let file = folder.path().join(name).to_str().unwrap().to_owned();
        std::fs::write(&file, bytes).unwrap();
        for (command, options) in ["inspect", "new"].into_iter().zip(&mut typed_for) {
            // What `inspect` reads without a clock is nothing to type for.
            if command == "new" || asked != "--rate" {
                options.extend(follow(command, &file, asked));
            }
        }
    }
    let all = ["--columns", "--format", "--group", "--header-line", "--rate", "--separator"];
    assert!(typed_for[1].iter().eq(&all), "{typed_for:?}");
    assert!(typed_for[0].iter().eq(&all), "{typed_for:?}");
}

/// The line of the experiment file, too, is taken as it is printed, and `new` writes the same one.
#[test]
fn the_line_for_the_experiment_file_names_as_many_columns_as_there_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (text, rows) = example();
    let (_, body) = rows.split_once('\n').unwrap();
    std::fs::write(path("recording.csv"), body).unwrap();
    let clock = "clock = { column = \"time_s\" }\nchannels = { drive = \"ch1_V\", signal = \"ch2_V\" }";
    let text = text.replace(PLAIN, clock);
    std::fs::write(path("experiment.toml"), &text).unwrap();
    let estimate = ["estimate", &path("experiment.toml"), "--out", &path("out")];
    let refused = run(&estimate);
    assert_eq!(refused.status.code(), Some(1));
    let message = said(&refused);
    let line = format!("format = {{{}}}", between(&message, "`format = {", "}`").unwrap());
    std::fs::write(path("experiment.toml"), text.replace(clock, &format!("{line}\n{clock}"))).unwrap();
    done(&estimate);
    let names = "time_s,ch1_V,ch2_V";
    let channels = ["--channel", "drive=ch1_V", "--channel", "signal=ch2_V"];
    let new = ["new", &path("recording.csv"), "--columns", names, "--device", "shared_scanner"];
    assert!(done(&[&new[..], &channels].concat()).contains(&line), "{line}");
}

/// A stated rate takes the place of times with too few digits, in the experiment file as well.
#[test]
fn new_takes_a_rate_in_place_of_times_that_cannot_be_used_as_inspect_does() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("few_digits.csv").to_str().unwrap().to_owned();
    let rows = (0..2000)
        .fold("time_unix_s,cap_V\n".to_owned(), |text, row| text + &format!("1.73234e+09,{}\n", row * 3 % 7));
    std::fs::write(&path, rows).unwrap();
    let rate = ["--rate", "200 Hz"];
    assert!(done(&[&["inspect", &path][..], &rate].concat()).contains("9.995 s  200 Hz"));
    let written = done(&[&["new", &path, "--device", "accelerometer"][..], &rate].concat());
    assert!(written.contains("\nclock = { rate = \"200 Hz\" }\n"), "{written}");
    // Times that can be used are kept, and the rate is what they are held against.
    let steady = (0..2000).fold("time_s,cap_V\n".to_owned(), |text, row| {
        text + &format!("{},{}\n", f64::from(row) * 0.005, row * 3 % 7)
    });
    std::fs::write(&path, steady).unwrap();
    let written = done(&[&["new", &path, "--device", "accelerometer"][..], &rate].concat());
    assert!(written.contains("\nclock = { column = \"time_s\", rate = \"200 Hz\" }\n"), "{written}");
}
