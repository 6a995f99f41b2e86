//! The page that lists the results of a folder.

use kalmems::figures::escaped;
use kalmems::recording::Instant;
use kalmems::results::{RUN_FILE, StoredResult};
use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Results that are listed.
const MOST: usize = 2000;
/// Bytes of a file that is read for what it says of its result.
const MOST_BYTES: u64 = 32 << 20;

const STYLE: &str = "\
:root { color-scheme: light dark; --ink: #222; --faint: #5c5c5c; --line: #ddd; --link: #005a8c; --ok: #00694e; --warning: #7a4f00; --failure: #b00020 }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e4e4; --faint: #adadad; --line: #3a3d42; --link: #7cc4f0; --ok: #5fd3ae; --warning: #f0b95a; --failure: #ff8a96 } }
body { margin: 0 auto; max-width: 72rem; padding: 1.5rem 1rem; color: var(--ink); font: 16px/1.5 system-ui, 'DejaVu Sans', sans-serif; overflow-wrap: anywhere }
h1 { font-size: 1.4rem } a { color: var(--link) } .faint { color: var(--faint) }
ul { list-style: none; padding: 0 } li { border-top: 1px solid var(--line); padding: .6rem 0 } h2 { font-size: 1rem; margin: 0 } p { margin: .1rem 0 }
.passes { color: var(--ok) } .doubtful { color: var(--warning) } .failed { color: var(--failure) }";

/// The results in a folder, the newest first, with their verdicts and links to their reports.
pub fn page(folder: &Path) -> String {
    let mut found: Vec<ListedResult> = (StoredResult::within(folder, MOST).into_iter())
        .map(|(place, result)| ListedResult::of(folder, &place, result))
        .collect();
    found.sort_by_key(|one| std::cmp::Reverse(one.started));
    let name = escaped(&folder.display().to_string());
    let count = match found.len() {
        0 => "No result of kalmems is in this folder.".to_owned(),
        MOST => format!("The first {MOST} results that were found; choose a folder further down for others."),
        1 => "One result.".to_owned(),
        count => format!("{count} results, the newest first."),
    };
    let items: String = found.iter().map(ListedResult::html).collect();
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <link rel=\"icon\" href=\"data:,\"><title>Results in {name}</title><style>{STYLE}</style></head>\n\
         <body><main><h1>Results in {name}</h1><p class=\"faint\">{count}</p><ul>\n{items}</ul></main></body></html>\n"
    )
}

/// What is said of a result.
struct ListedResult {
    /// Its name, and the address of its folder as seen from the page.
    name: String,
    address: String,
    result: StoredResult,
    started: Option<u64>,
    /// The verdict on each filter, where there are any.
    verdicts: Vec<(String, String)>,
}

impl ListedResult {
    fn of(folder: &Path, place: &Path, result: StoredResult) -> Self {
        let own = folder.join(place);
        let steps: Vec<String> =
            place.components().map(|step| step.as_os_str().to_string_lossy().into_owned()).collect();
        let name = match steps.as_slice() {
            [] => folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
            steps => steps.join("/"),
        };
        let address =
            place.components().flat_map(|step| [encoded(step.as_os_str()), "/".to_owned()]).collect();
        let verdicts = text_of(&own, "metrics.json", &result).map_or_else(Vec::new, |text| verdicts(&text));
        let started = text_of(&own, RUN_FILE, &result).and_then(|text| started(&text));
        Self { name, address, result, started, verdicts }
    }

    fn html(&self) -> String {
        let name = escaped(&self.name);
        let heading = if self.result.files.contains("report.html") {
            format!("<a href=\"{}report.html\">{name}</a>", self.address)
        } else {
            name
        };
        let verdicts: Vec<String> = (self.verdicts.iter())
            .map(|(filter, verdict)| {
                format!(
                    "{}: <b class=\"{}\">{}</b>",
                    escaped(filter),
                    class_of(verdict),
                    escaped(&verdict.replace('_', " "))
                )
            })
            .collect();
        let verdicts =
            if verdicts.is_empty() { String::new() } else { format!("<p>{}</p>", verdicts.join(", ")) };
        let when = self.started.map(|seconds| format!(", {}", utc(seconds))).unwrap_or_default();
        let made = format!(
            "<code>{}</code> of <code>{}</code>{when}",
            escaped(&self.result.command),
            escaped(&self.result.of)
        );
        let files: Vec<String> = (self.result.files.iter())
            .map(|file| {
                let address: Vec<String> = file.split('/').map(|step| encoded(step.as_ref())).collect();
                format!("<a href=\"{}{}\">{}</a>", self.address, address.join("/"), escaped(file))
            })
            .collect();
        format!(
            "<li><h2>{heading}</h2>{verdicts}<p class=\"faint\">{made}</p><details><summary class=\"faint\">{} files</summary><p>{}</p></details></li>\n",
            files.len(),
            files.join(", ")
        )
    }
}

/// A file of a result as text, where it has one that is no larger than such files are.
fn text_of(folder: &Path, name: &str, result: &StoredResult) -> Option<String> {
    let path = folder.join(name);
    let is_file = path.symlink_metadata().is_ok_and(|there| there.is_file());
    if !result.files.contains(name) || !is_file {
        return None;
    }
    let mut text = String::new();
    File::open(path).ok()?.take(MOST_BYTES).read_to_string(&mut text).ok()?;
    Some(text)
}

/// The worst verdict on each filter, in the order of the filters.
fn verdicts(metrics: &str) -> Vec<(String, String)> {
    let Ok(metrics) = serde_json::from_str::<Value>(metrics) else { return Vec::new() };
    let (mut order, mut of): (Vec<String>, BTreeMap<String, String>) = (Vec::new(), BTreeMap::new());
    let each = |value: &Value, key: &str| value[key].as_array().cloned().unwrap_or_default();
    for recording in each(&metrics, "recordings") {
        for estimator in each(&recording, "segments").iter().flat_map(|segment| each(segment, "estimators")) {
            // A filter that claims nothing has no grade.
            let verdict = estimator["grade"].as_str().or(estimator["verdict"].as_str());
            let (Some(name), Some(verdict)) = (estimator["name"].as_str(), verdict) else { continue };
            if !of.contains_key(name) {
                order.push(name.to_owned());
            }
            let worst = of.entry(name.to_owned()).or_default();
            if worst.is_empty() || rank(verdict) > rank(worst) {
                verdict.clone_into(worst);
            }
        }
    }
    order.into_iter().filter_map(|name| of.remove(&name).map(|verdict| (name, verdict))).collect()
}

/// How bad a verdict is.
fn rank(verdict: &str) -> u8 {
    match verdict {
        "no_claim" => 0,
        "passes" => 1,
        "passes_with_remarks" => 2,
        "doubtful" => 3,
        _ => 4,
    }
}

fn class_of(verdict: &str) -> &'static str {
    ["", "passes", "passes", "doubtful", "failed"][usize::from(rank(verdict))]
}

/// The last second that has a date of four digits for its year.
const LAST_S: u64 = 253_402_300_799;

/// When the run began, by its record; in seconds since 1970. A record with a time that no run can have began has none.
fn started(run: &str) -> Option<u64> {
    let line = run.lines().find_map(|line| line.strip_prefix("started_unix_s = "))?;
    line.parse().ok().filter(|seconds| *seconds <= LAST_S)
}

/// A time as date and time of day in UTC.
fn utc(seconds: u64) -> String {
    let time = i64::try_from(seconds).ok().and_then(|seconds| Instant::of_seconds(seconds).to_utc());
    let time = time.unwrap_or_default();
    let part = |range| time.get(range).unwrap_or_default();
    format!("{} {} UTC", part(0..10), part(11..16))
}

/// A step of a path as a part of an address.
pub fn encoded(step: &OsStr) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte);
    (step.as_encoded_bytes().iter().copied())
        .map(|byte| if is_plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_of_the_calendar() {
        let at = utc;
        assert_eq!(at(0), "1970-01-01 00:00 UTC");
        // GNU date: date -u -d @1709208000, @1735689599 and @4107542399.
        assert_eq!(at(1_709_208_000), "2024-02-29 12:00 UTC");
        assert_eq!(at(1_735_689_599), "2024-12-31 23:59 UTC");
        assert_eq!(at(4_107_542_399), "2100-02-28 23:59 UTC");
        assert_eq!(at(LAST_S), "9999-12-31 23:59 UTC");
        for record in ["9223372036854775000", "253402300800", "-1", "1e3"] {
            assert_eq!(started(&format!("started_unix_s = {record}\n")), None, "{record}");
        }
    }

    #[test]
    fn the_worst_verdict_on_a_filter_is_told() {
        let metrics = r#"{"recordings":[{"segments":[
            {"estimators":[{"name":"UKF","grade":"passes"},{"name":"EKF","grade":"doubtful"},{"name":"Model","verdict":"no_claim"}]},
            {"estimators":[{"name":"UKF","grade":"passes"},{"name":"EKF","grade":"no_estimate"},{"name":"Model","verdict":"astray"}]}]}]}"#;
        let own = |(filter, verdict): (&str, &str)| (filter.to_owned(), verdict.to_owned());
        assert_eq!(
            verdicts(metrics),
            [("UKF", "passes"), ("EKF", "no_estimate"), ("Model", "astray")].map(own)
        );
        assert!(verdicts("{").is_empty() && verdicts("[]").is_empty());
    }
}
