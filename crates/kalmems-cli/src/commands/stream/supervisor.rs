//! What watches a stream from outside: systemd, which is told over its socket, and monitoring, which reads a file of metrics.

use crate::tell::line;
use kalmems::stream::{Health, Supervisor};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How often they hear of it, where the watchdog does not ask for more.
const EVERY: Duration = Duration::from_secs(1);

/// What each metric is called at its beginning.
const PREFIX: &str = "kalmems_stream";

/// What watches this stream, and how often it hears of it; none where nothing does.
pub fn open(metrics: Option<&Path>) -> io::Result<Option<(Duration, Supervisor)>> {
    let (service, every) =
        (Service::of_environment()?, watchdog().map_or(EVERY, |limit| EVERY.min(limit / 4)));
    if metrics.is_none() && service.is_none() {
        return Ok(None);
    }
    let mut file = metrics.map(|path| MetricsFile { path: path.to_owned(), is_refused: false });
    let tell = move |health: &Health| {
        if let Some(service) = &service {
            service.tell(&format!("WATCHDOG=1\nSTATUS={}", status(health)));
        }
        if let Some(file) = &mut file {
            file.write(health);
        }
    };
    Ok(Some((every, Box::new(tell))))
}

/// How long the watchdog waits for a sign of this process.
fn watchdog() -> Option<Duration> {
    let number = |name| std::env::var(name).ok()?.parse::<u64>().ok();
    let is_own = number("WATCHDOG_PID").is_none_or(|id| id == u64::from(std::process::id()));
    number("WATCHDOG_USEC").filter(|limit| is_own && *limit > 0).map(Duration::from_micros)
}

/// How the stream fares, in a line.
fn status(health: &Health) -> String {
    let lag = health.lag_s.map_or_else(String::new, |lag_s| format!(", {:.1} ms behind", lag_s * 1e3));
    let filters =
        health.filters.iter().map(|filter| format!("{} {:?}", filter.estimator, filter.lock).to_lowercase());
    let connected = if health.connected { "connected" } else { "not connected" };
    let filters: Vec<String> = filters.collect();
    format!(
        "{connected}, {} samples, {:.0} Hz{lag}; {}",
        health.estimated,
        health.rate_hz,
        filters.join(", ")
    )
}

/// The manager of services that has started this process and listens at a socket (`sd_notify`).
struct Service {
    #[cfg(unix)]
    socket: std::os::unix::net::UnixDatagram,
}

impl Service {
    /// The service manager that the environment names, which hears that the stream is ready.
    #[cfg(unix)]
    fn of_environment() -> io::Result<Option<Self>> {
        use std::os::unix::net::UnixDatagram;
        let Some(name) = std::env::var_os("NOTIFY_SOCKET").filter(|name| !name.is_empty()) else {
            return Ok(None);
        };
        let socket = UnixDatagram::unbound()?;
        // What does not listen is not waited for.
        socket.set_nonblocking(true)?;
        match name.to_str().and_then(|name| name.strip_prefix('@')) {
            #[cfg(target_os = "linux")]
            Some(name) => {
                use std::os::linux::net::SocketAddrExt;
                socket.connect_addr(&std::os::unix::net::SocketAddr::from_abstract_name(name)?)?;
            }
            #[cfg(not(target_os = "linux"))]
            Some(_) => return Ok(None),
            None => socket.connect(name)?,
        }
        let service = Self { socket };
        service.tell("READY=1");
        Ok(Some(service))
    }

    #[cfg(not(unix))]
    fn of_environment() -> io::Result<Option<Self>> {
        Ok(None)
    }

    fn tell(&self, state: &str) {
        #[cfg(unix)]
        let _ = self.socket.send(state.as_bytes());
        #[cfg(not(unix))]
        let _ = state;
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        self.tell("STOPPING=1");
    }
}

/// A file in the text format of Prometheus, which is replaced whole.
struct MetricsFile {
    path: PathBuf,
    /// Whether it could not be written and that was said.
    is_refused: bool,
}

impl MetricsFile {
    fn write(&mut self, health: &Health) {
        let mut new = self.path.clone().into_os_string();
        new.push(".new");
        let written = fs::write(&new, text(health)).and_then(|()| fs::rename(&new, &self.path));
        if let (Err(e), false) = (&written, self.is_refused) {
            line(format_args!("warning: the metrics in {} cannot be written: {e}", self.path.display()));
        }
        self.is_refused = written.is_err();
    }
}

/// All numbers of the state of a stream as metrics: those of a filter have its name as a label.
fn text(health: &Health) -> String {
    let mut metrics: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut put = |name: &str, labels: &str, value: &Value| {
        let value = match value {
            Value::Bool(value) => u64::from(*value).to_string(),
            Value::Number(value) => value.to_string(),
            Value::Array(values) => values.len().to_string(),
            _ => return,
        };
        let name = format!("{PREFIX}_{name}");
        let sample = format!("{name}{labels} {value}\n");
        metrics.entry(name).or_default().push(sample);
    };
    let all = serde_json::to_value(health).unwrap_or_default();
    for (key, value) in all.as_object().into_iter().flatten() {
        if key != "filters" {
            put(key, "", value);
            continue;
        }
        for filter in value.as_array().into_iter().flatten() {
            let label = format!("estimator={}", filter["estimator"]);
            let labels = format!("{{{label}}}");
            for (key, value) in filter.as_object().into_iter().flatten() {
                put(&format!("filter_{key}"), &labels, value);
            }
            put("filter_lock", &format!("{{{label},lock={}}}", filter["lock"]), &json!(1));
        }
    }
    let of =
        |(name, samples): (&String, &Vec<String>)| format!("# TYPE {name} untyped\n{}", samples.concat());
    metrics.iter().map(of).collect()
}
