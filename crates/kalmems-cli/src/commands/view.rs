//! `kalmems view`: past results of a folder in the browser of this machine.

mod answer;
mod listing;
mod policy;
mod request;
mod token;

use crate::args::ViewArguments;
use crate::tell::tell;
use crate::{CommandEnding, interrupt, print};
use answer::{HttpAnswer, Status};
use request::{Deadline, Request, RequestError};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io;
use std::net::{Ipv4Addr, SocketAddrV4, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// Connections at one time; a browser opens six.
const MOST_CONNECTIONS: usize = 32;
/// Bytes of an answer that a reader has to take in a second, beyond those that it takes within the patience for a request.
const SLOWEST: u64 = 1 << 20;
/// How long what comes behind a refusal is read.
const LEFTOVER: Duration = Duration::from_secs(1);
/// How often it is looked whether to end.
const PULSE: Duration = Duration::from_millis(50);

/// What is served, and to whom.
struct Site {
    /// The folder, every link on the way to it followed.
    folder: PathBuf,
    /// What the first step of every address must be.
    token: String,
    /// What stands in its place for the files of one result, of which a page may know.
    of_results: Mutex<BTreeMap<String, Vec<OsString>>>,
    port: u16,
    /// How long a request may take to come, and an answer to be taken, longer by a second for each so many bytes.
    patience: Duration,
    slowest: u64,
    connections: AtomicUsize,
}

impl Site {
    fn new(folder: PathBuf, token: String, port: u16) -> Self {
        let (of_results, connections) = (Mutex::default(), AtomicUsize::new(0));
        let (patience, slowest) = (request::PATIENCE, SLOWEST);
        Self { folder, token, of_results, port, patience, slowest, connections }
    }

    /// The token of the files of the result in a folder below, by its steps; a new one where it was not asked for yet.
    fn token_of(&self, result: &[OsString]) -> Option<String> {
        let mut known = self.of_results.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((token, _)) = known.iter().find(|(_, own)| *own == result) {
            return Some(token.clone());
        }
        let token = token::random().ok()?;
        known.insert(token.clone(), result.to_vec());
        Some(token)
    }

    /// The steps to the result whose files this token is of.
    fn result_of(&self, token: &str) -> Option<Vec<OsString>> {
        let known = self.of_results.lock().unwrap_or_else(PoisonError::into_inner);
        known.iter().find(|(own, _)| token::is_same(token, own)).map(|(_, result)| result.clone())
    }
}

pub fn run(arguments: &ViewArguments) -> Result<(), CommandEnding> {
    let wrong = |what: &str, e: &dyn std::fmt::Display| CommandEnding::Wrong(format!("{what}: {e}"));
    let named = arguments.folder.display().to_string();
    let folder = arguments.folder.canonicalize().map_err(|e| wrong(&named, &e))?;
    if !folder.is_dir() {
        return Err(wrong(&named, &"expected a folder with results, such as `out`; found a file"));
    }
    let place = SocketAddrV4::new(Ipv4Addr::LOCALHOST, arguments.port);
    let listener = TcpListener::bind(place).map_err(|e| wrong(&format!("port {}", arguments.port), &e))?;
    let port = listener.local_addr().map_err(|e| wrong("the port", &e))?.port();
    let token = token::random().map_err(|e| wrong("no random numbers from the system", &e))?;
    let site = Arc::new(Site::new(folder, token, port));
    print(&format!("http://127.0.0.1:{port}/{}/\n", site.token))?;
    tell!("the results in {named}, for the browsers of this machine; Ctrl-C ends it");
    serve(&listener, &site, &interrupt::requested).map_err(|e| wrong("cannot serve", &e))
}

/// Answers requests until `stop` says so.
fn serve(listener: &TcpListener, site: &Arc<Site>, stop: &dyn Fn() -> bool) -> io::Result<()> {
    let stopped = Arc::new(AtomicBool::new(false));
    let accepting = {
        let (listener, site, stopped) = (listener.try_clone()?, Arc::clone(site), Arc::clone(&stopped));
        thread::Builder::new().spawn(move || {
            // What comes on the way to the end, the call that wakes this thread too, is not answered.
            for connection in listener.incoming().take_while(|_| !stopped.load(Ordering::Relaxed)) {
                match connection {
                    Ok(connection) => take(connection, &site),
                    // Such as too many open files: nothing that a pause could make worse.
                    Err(_) => thread::sleep(PULSE),
                }
            }
        })?
    };
    while !stop() && !accepting.is_finished() {
        thread::sleep(PULSE);
    }
    stopped.store(true, Ordering::Relaxed);
    // The thread waits for a connection.
    drop(TcpStream::connect(listener.local_addr()?));
    let _ = accepting.join();
    Ok(())
}

/// Answers a connection on a thread of its own, where there are not too many of them.
fn take(connection: TcpStream, site: &Arc<Site>) {
    let place = Place::among(site);
    if connection.set_nodelay(true).is_err() {
        return;
    }
    let Some(place) = place else {
        // Here the next connection waits: for one that is silent no longer than this.
        refuse(&connection, Status::TooManyConnections, PULSE);
        return;
    };
    // Where no thread can be made, the connection is closed.
    let _ = thread::Builder::new().spawn(move || answer(&connection, &place));
}

/// One of the places for connections, free again when this is dropped.
struct Place(Arc<Site>);

impl Place {
    fn among(site: &Arc<Site>) -> Option<Self> {
        let before = site.connections.fetch_add(1, Ordering::Relaxed);
        let place = Self(Arc::clone(site));
        (before < MOST_CONNECTIONS).then_some(place)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.connections.fetch_sub(1, Ordering::Relaxed);
    }
}

fn answer(connection: &TcpStream, Place(site): &Place) {
    match Request::read(Deadline::after(connection, site.patience)) {
        Ok(request) => {
            let is_head = request.is_head;
            let answer = answer_to(&request, site);
            let patience = site.patience + Duration::from_secs(answer.length() / site.slowest);
            // Who closes the connection early has what it wanted.
            let _ = answer.send(Deadline::after(connection, patience), is_head);
        }
        Err(RequestError::Refused(status)) => refuse(connection, status, LEFTOVER),
        Err(RequestError::Gone) => {}
    }
}

fn refuse(connection: &TcpStream, status: Status, patience: Duration) {
    let _ = HttpAnswer::refusal(status).send(Deadline::after(connection, patience), false);
    let _ = connection.shutdown(std::net::Shutdown::Write);
    // A connection that is closed with unread bytes in it is reset, and what was answered is lost.
    let mut rest = Deadline::after(connection, patience);
    let _ = io::copy(&mut io::Read::take(&mut rest, request::MOST as u64), &mut io::sink());
}

/// What is answered to a request that is well-formed.
fn answer_to(request: &Request, site: &Site) -> HttpAnswer {
    // A name that leads here from elsewhere is that of a page elsewhere, which wants to read what is here. The port of the scheme is left out.
    let names = ["127.0.0.1", "localhost"];
    let mut own: Vec<String> = names.iter().map(|name| format!("{name}:{}", site.port)).collect();
    own.extend(names.iter().filter(|_| site.port == 80).map(|name| (*name).to_owned()));
    if !own.iter().any(|own| own.eq_ignore_ascii_case(&request.host)) {
        return HttpAnswer::refusal(Status::WrongHost);
    }
    let Some((first, rest)) = request.path.split_first() else {
        return HttpAnswer::refusal(Status::WrongToken);
    };
    let Some(first) = first.to_str() else { return HttpAnswer::refusal(Status::WrongToken) };
    if let Some(result) = site.result_of(first) {
        // By itself a page could go wherever it says.
        if request.is_page {
            return HttpAnswer::refusal(Status::NotFound);
        }
        let names: Vec<OsString> = result.into_iter().chain(rest.iter().cloned()).collect();
        return HttpAnswer::file(&site.folder, &names, request.range).for_result(&request.host, first);
    }
    if !token::is_same(first, &site.token) {
        return HttpAnswer::refusal(Status::WrongToken);
    }
    match rest {
        [name] if name.is_empty() => HttpAnswer::page(listing::page(&site.folder)),
        names if names.last().is_some_and(is_page) => framed(request, site, names),
        names => HttpAnswer::file(&site.folder, names, request.range),
    }
}

/// Whether a file is a page by its name.
fn is_page(name: &OsString) -> bool {
    Path::new(name).extension().is_some_and(|ending| ending == "html")
}

/// A page that shows another one in a frame from which it can neither read the pages around it nor go anywhere.
fn framed(request: &Request, site: &Site, names: &[OsString]) -> HttpAnswer {
    let depth = match HttpAnswer::depth_of(&site.folder, names) {
        Ok(depth) => depth,
        Err(status) => return HttpAnswer::refusal(status),
    };
    let (result, within) = names.split_at(depth);
    let Some(token) = site.token_of(result) else { return HttpAnswer::refusal(Status::TooManyConnections) };
    let title = names.last().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let within: Vec<String> = within.iter().map(|step| listing::encoded(step)).collect();
    HttpAnswer::frame(&request.host, &token, &within.join("/"), &title)
}

#[cfg(test)]
mod tests;
