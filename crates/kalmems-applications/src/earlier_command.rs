//! Which command makes a file that is missing, by where results are written.

use std::fs;
use std::path::{Component, Path, PathBuf};

/// The end of the name of an experiment that a simulation wrote.
const SIMULATED: &str = "-simulated";

/// Files that are looked at for the name of an experiment.
const MOST_FILES: usize = 500;

/// The command, or both, that make a file below `out`, in a sentence; `None` where the place of the file does not say it. The experiment is
/// looked for in the folder from which the path leads to the file, and in those beside it.
pub(super) fn earlier_command(path: &Path) -> Option<String> {
    let plain = plain(path);
    let parts: Vec<String> =
        plain.components().map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
    let out = parts.iter().rposition(|part| part == "out")?;
    let below: Vec<&str> = parts.get(out + 1..)?.iter().map(String::as_str).collect();
    let (command, name) = match below.as_slice() {
        ["simulated", name, _] => ("simulate", *name),
        ["identified", name, _] => ("identify", *name),
        [name, file] if file.starts_with("trajectory_") || file.contains("_trajectory_") => {
            ("estimate", *name)
        }
        _ => return None,
    };
    if let Some(found) = experiment(path, name)
        && (command == "simulate" || found.has_recording)
    {
        return Some(format!("`kalmems {command} {}` makes it", plain_text(&found.path)));
    }
    if let Some(simulated) = name.strip_suffix(SIMULATED)
        && let Some(found) = experiment(path, simulated)
    {
        let out = plain.ancestors().nth(below.len())?;
        let of = out.join("simulated").join(simulated).join("experiment.toml");
        return Some(format!(
            "`kalmems simulate {}` and then `kalmems {command} {}` make it",
            plain_text(&found.path),
            plain_text(&of)
        ));
    }
    Some(format!("`kalmems {command}` makes it from the experiment with the name `{name}`"))
}

/// An experiment file.
struct FoundExperiment {
    path: PathBuf,
    has_recording: bool,
}

/// The experiment of this name in the folder that a path begins with, or in one beside it.
fn experiment(path: &Path, name: &str) -> Option<FoundExperiment> {
    let folder: PathBuf = path.components().take_while(|part| *part != Component::ParentDir).collect();
    let beside = folder.parent().into_iter().filter_map(|parent| fs::read_dir(parent).ok());
    let mut folders: Vec<PathBuf> = beside.flatten().flatten().map(|entry| entry.path()).collect();
    folders.sort();
    let files = [folder].into_iter().chain(folders).filter_map(|folder| fs::read_dir(folder).ok()).flat_map(
        |entries| {
            let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
            files.sort();
            files
        },
    );
    let files = files.filter(|file| file.extension().is_some_and(|extension| extension == "toml"));
    files.take(MOST_FILES).find_map(|path| {
        let text = fs::read_to_string(&path).ok()?;
        let document: toml::Table = text.parse().ok()?;
        let is_meant = document.get("name").and_then(toml::Value::as_str) == Some(name)
            && document.contains_key("device");
        is_meant.then(|| FoundExperiment { path, has_recording: document.contains_key("recording") })
    })
}

/// A path without steps back, where they leave a folder of it.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir if plain.file_name().is_some() => _ = plain.pop(),
            Component::CurDir => {}
            part => plain.push(part),
        }
    }
    plain
}

fn plain_text(path: &Path) -> String {
    plain(path).display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_result_that_is_missing_names_the_commands_that_make_it() {
        let folder = tempfile::tempdir().unwrap();
        let at = folder.path();
        fs::create_dir_all(at.join("examples/mirror")).unwrap();
        fs::create_dir_all(at.join("examples/stage")).unwrap();
        let write = |file: &str, text: &str| fs::write(at.join(file), text).unwrap();
        write("examples/mirror/two.toml", "name = \"two-lines\"\n[device.x]\n[simulate]\n");
        write("examples/mirror/spectrum.toml", "name = \"two-lines\"\n");
        write("examples/stage/experiment.toml", "name = \"stage\"\n[device.x]\n[[recording]]\n");
        let of = |file: &str| {
            earlier_command(&at.join("examples/mirror").join(file))
                .map(|sentence| sentence.replace(&at.display().to_string(), "."))
        };
        assert_eq!(
            of("../../out/simulated/two-lines/reference.csv").unwrap(),
            "`kalmems simulate ./examples/mirror/two.toml` makes it"
        );
        assert_eq!(
            of("../../out/two-lines-simulated/trajectory_ekf.csv").unwrap(),
            "`kalmems simulate ./examples/mirror/two.toml` and then `kalmems estimate ./out/simulated/two-lines/experiment.toml` make it"
        );
        assert_eq!(
            of("../../out/stage/test1_trajectory_ekf.csv").unwrap(),
            "`kalmems estimate ./examples/stage/experiment.toml` makes it"
        );
        assert_eq!(
            of("../../out/other/trajectory_ekf.csv").unwrap(),
            "`kalmems estimate` makes it from the experiment with the name `other`"
        );
        assert_eq!(of("recording.csv"), None);
        assert_eq!(of("../../out/intensity.csv"), None);
    }
}
