//! What is served, and what is refused.

use super::*;
use kalmems::results::{Output, Work};
use std::io::{Read, Write};
use std::path::Path;
use std::sync::mpsc::channel;

const TOKEN: &str = "0123456789abcdef";

/// A folder that is served until this is dropped.
struct Served {
    folder: tempfile::TempDir,
    port: u16,
    stopped: Arc<AtomicBool>,
    serving: Option<thread::JoinHandle<()>>,
}

impl Served {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        for name in ["first", "deeper/second & third"] {
            write_result(&folder.path().join(name));
        }
        std::fs::write(folder.path().join("diary.txt"), "of nobody else").unwrap();
        std::fs::write(folder.path().join("first/note.txt"), "beside a result").unwrap();
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let port = listener.local_addr().unwrap().port();
        let site = Arc::new(Site {
            folder: folder.path().canonicalize().unwrap(),
            token: TOKEN.to_owned(),
            port,
            connections: AtomicUsize::new(0),
        });
        let stopped = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&stopped);
        let serving = thread::spawn(move || {
            serve(&listener, &site, &|| stop.load(Ordering::Relaxed)).unwrap();
        });
        Self { folder, port, stopped, serving: Some(serving) }
    }

    /// What is answered to these bytes.
    fn raw(&self, request: &str) -> String {
        let mut connection = TcpStream::connect((Ipv4Addr::LOCALHOST, self.port)).unwrap();
        // A refusal may come before all of it is written.
        let _ = connection.write_all(request.as_bytes());
        let mut answer = Vec::new();
        let _ = connection.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    fn get(&self, path: &str, more: &str) -> String {
        self.raw(&format!("GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n{more}\r\n", self.port))
    }

    /// The answer to a path behind the token.
    fn own(&self, path: &str, more: &str) -> String {
        self.get(&format!("/{TOKEN}/{path}"), more)
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stopped.store(true, Ordering::Relaxed);
        if let Some(serving) = self.serving.take() {
            let _ = serving.join();
        }
    }
}

fn write_result(place: &Path) {
    let output = Output::begin(place, &Work::named("estimate", "scanner.toml")).unwrap();
    output.write("report.html", |w| w.write_all(b"<h1>report</h1>")).unwrap();
    output.write("report_samples.bin", |w| w.write_all(b"0123456789")).unwrap();
    output.write("figures/motion.svg", |w| w.write_all(b"<svg/>")).unwrap();
    let metrics = r#"{"recordings":[{"segments":[{"estimators":[{"name":"EKF","grade":"doubtful"}]}]}]}"#;
    output.write("metrics.json", |w| w.write_all(metrics.as_bytes())).unwrap();
    output.commit().unwrap();
}

fn status(answer: &str) -> &str {
    answer.split(' ').nth(1).unwrap_or(answer)
}

fn content(answer: &str) -> &str {
    answer.split_once("\r\n\r\n").map_or("", |(_, content)| content)
}

#[test]
fn results_are_listed_with_verdicts_and_their_files_are_served() {
    let served = Served::new();
    let listing = served.own("", "");
    assert_eq!(status(&listing), "200");
    for expected in [
        "<a href=\"first/report.html\">first</a>",
        "<a href=\"deeper/second%20%26%20third/report.html\">deeper/second &amp; third</a>",
        "EKF: <b class=\"doubtful\">doubtful</b>",
        "2 results",
        "default-src 'none'",
    ] {
        assert!(listing.contains(expected), "{expected}: {listing}");
    }
    let report = served.own("deeper/second%20%26%20third/report.html", "");
    assert_eq!((status(&report), content(&report)), ("200", "<h1>report</h1>"));
    assert!(report.contains("Content-Type: text/html; charset=utf-8\r\nContent-Length: 15\r\n"));
    assert_eq!(content(&served.own("first/figures/motion.svg", "")), "<svg/>");
    let head = served
        .raw(&format!("HEAD /{TOKEN}/first/report.html HTTP/1.1\r\nHost: localhost:{}\r\n\r\n", served.port));
    assert!(head.contains("Content-Length: 15\r\n") && content(&head).is_empty(), "{head}");
}

#[test]
fn pieces_of_a_file_are_served() {
    let served = Served::new();
    for (range, status_and_place, expected) in [
        ("bytes=2-4", ["206", "bytes 2-4/10"], "234"),
        ("bytes=8-", ["206", "bytes 8-9/10"], "89"),
        ("bytes=-3", ["206", "bytes 7-9/10"], "789"),
        ("bytes=4-400", ["206", "bytes 4-9/10"], "456789"),
    ] {
        let answer = served.own("first/report_samples.bin", &format!("Range: {range}\r\n"));
        assert_eq!((status(&answer), content(&answer)), (status_and_place[0], expected), "{range}");
        assert!(answer.contains(&format!("Content-Range: {}\r\n", status_and_place[1])), "{answer}");
    }
    for range in ["bytes=10-", "bytes=4-3", "bytes=-0", "bytes=0-1,4-5", "bytes", "bytes=a-b"] {
        assert_eq!(
            status(&served.own("first/report_samples.bin", &format!("Range: {range}\r\n"))),
            "416",
            "{range}"
        );
    }
}

#[test]
fn nothing_is_served_without_the_token() {
    let served = Served::new();
    for path in [
        "/",
        "/first/report.html",
        "/0123456789abcdee/",
        "/0123456789abcde/",
        "/0123456789abcdef0/",
        "/x/first/report.html",
    ] {
        assert_eq!(status(&served.get(path, "")), "403", "{path}");
    }
}

#[test]
fn only_files_of_results_within_the_folder_are_served() {
    let served = Served::new();
    let outside = tempfile::tempdir().unwrap();
    write_result(&outside.path().join("secret"));
    for path in [
        "diary.txt",
        "first/note.txt",
        "first",
        "first/",
        "first/figures",
        "first/manifest.toml",
        "nowhere/report.html",
        "first/../diary.txt",
        "first/%2e%2e/diary.txt",
        "..%2fsecret/report.html",
        "first/report.html/",
        "first//report.html",
    ] {
        assert_eq!(status(&served.own(path, "")), "404", "{path}");
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::symlink;
        let first = served.folder.path().join("first");
        symlink(outside.path().join("secret"), served.folder.path().join("link")).unwrap();
        assert_eq!(status(&served.own("link/report.html", "")), "404");
        // A file of the result that became a link since, and a folder of it.
        std::fs::remove_file(first.join("report.html")).unwrap();
        symlink(outside.path().join("secret/report.html"), first.join("report.html")).unwrap();
        assert_eq!(status(&served.own("first/report.html", "")), "404");
        std::fs::remove_dir_all(first.join("figures")).unwrap();
        symlink(outside.path().join("secret/figures"), first.join("figures")).unwrap();
        assert_eq!(status(&served.own("first/figures/motion.svg", "")), "404");
        assert!(!served.own("", "").contains("link/report.html"));
    }
}

#[test]
fn other_hosts_methods_and_bodies_are_refused() {
    let served = Served::new();
    let of = |text: &str| status(&served.raw(text)).to_owned();
    let own = format!("Host: 127.0.0.1:{}\r\n", served.port);
    for host in ["evil.example", "127.0.0.1", "127.0.0.1:1", "127.0.0.1.evil.example", ""] {
        assert_eq!(of(&format!("GET /{TOKEN}/ HTTP/1.1\r\nHost: {host}\r\n\r\n")), "421", "{host}");
    }
    assert_eq!(of(&format!("GET /{TOKEN}/ HTTP/1.1\r\n\r\n")), "421");
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "CONNECT", "TRACE"] {
        assert_eq!(of(&format!("{method} /{TOKEN}/ HTTP/1.1\r\n{own}\r\n")), "405", "{method}");
    }
    assert_eq!(of(&format!("GET /{TOKEN}/ HTTP/1.1\r\n{own}Content-Length: 5\r\n\r\nhello")), "413");
    assert_eq!(of(&format!("GET /{TOKEN}/ HTTP/1.1\r\n{own}X: {}\r\n\r\n", "a".repeat(9000))), "431");
    assert_eq!(of(&format!("GET /{TOKEN}/ HTTP/1.0\r\n{own}\r\n")), "505");
    assert_eq!(of("nonsense\r\n\r\n"), "400");
    // And goes on.
    assert_eq!(status(&served.own("", "")), "200");
}

#[test]
fn connections_have_a_bound_and_idle_ones_do_not_delay_the_end() {
    let served = Served::new();
    let idle: Vec<TcpStream> = (0..MOST_CONNECTIONS)
        .map(|_| TcpStream::connect((Ipv4Addr::LOCALHOST, served.port)).unwrap())
        .collect();
    let answer = loop {
        // Until all of them are taken.
        let answer = served.own("", "");
        if status(&answer) != "200" {
            break answer;
        }
    };
    assert_eq!(status(&answer), "503");
    drop(idle);
    while status(&served.own("", "")) != "200" {}
    let _idle = TcpStream::connect((Ipv4Addr::LOCALHOST, served.port)).unwrap();
    let (done, ended) = channel();
    thread::spawn(move || {
        drop(served);
        done.send(()).unwrap();
    });
    ended.recv_timeout(Duration::from_secs(2)).expect("it ends while a connection is open");
}
