//! `kalmems view`: past results of a folder in the browser of this machine.

mod answer;
mod listing;
mod request;
mod token;

use crate::args::ViewArguments;
use crate::tell::tell;
use crate::{CommandEnding, interrupt, print};
use answer::{HttpAnswer, Status};
use request::{Request, RequestError};
use std::io;
use std::net::{Ipv4Addr, SocketAddrV4, TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

/// Connections at one time; a browser opens six.
const MOST_CONNECTIONS: usize = 32;
/// How long a connection may be silent.
const SILENCE: Duration = Duration::from_secs(15);
/// How often it is looked whether to end.
const PULSE: Duration = Duration::from_millis(50);

/// What is served, and to whom.
struct Site {
    /// The folder, every link on the way to it followed.
    folder: PathBuf,
    /// What the first step of every address must be.
    token: String,
    port: u16,
    connections: AtomicUsize,
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
    let site = Arc::new(Site { folder, token, port, connections: AtomicUsize::new(0) });
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
    let is_ready = connection.set_read_timeout(Some(SILENCE)).is_ok()
        && connection.set_write_timeout(Some(SILENCE)).is_ok()
        && connection.set_nodelay(true).is_ok();
    if !is_ready {
        return;
    }
    let Some(place) = place else {
        // Here the next connection waits: for one that is silent no longer than this.
        if connection.set_read_timeout(Some(PULSE)).is_ok() {
            refuse(&connection, Status::TooManyConnections);
        }
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
    match Request::read(connection) {
        Ok(request) => {
            let is_head = request.is_head;
            // Who closes the connection early has what it wanted.
            let _ = answer_to(&request, site).send(connection, is_head);
        }
        Err(RequestError::Refused(status)) => refuse(connection, status),
        Err(RequestError::Gone) => {}
    }
}

fn refuse(connection: &TcpStream, status: Status) {
    let _ = HttpAnswer::refusal(status).send(connection, false);
    let _ = connection.shutdown(std::net::Shutdown::Write);
    // A connection that is closed with unread bytes in it is reset, and what was answered is lost.
    let _ = io::copy(&mut io::Read::take(connection, request::MOST as u64), &mut io::sink());
}

/// What is answered to a request that is well-formed.
fn answer_to(request: &Request, site: &Site) -> HttpAnswer {
    // A name that leads here from elsewhere is that of a page elsewhere, which wants to read what is here.
    let own = [format!("127.0.0.1:{}", site.port), format!("localhost:{}", site.port)];
    if !own.iter().any(|own| own.eq_ignore_ascii_case(&request.host)) {
        return HttpAnswer::refusal(Status::WrongHost);
    }
    let Some((first, rest)) = request.path.split_first() else {
        return HttpAnswer::refusal(Status::WrongToken);
    };
    if !token::is_same(first, &site.token) {
        return HttpAnswer::refusal(Status::WrongToken);
    }
    match rest {
        [name] if name.is_empty() => HttpAnswer::page(listing::page(&site.folder)),
        names => HttpAnswer::file(&site.folder, names, request.range),
    }
}

#[cfg(test)]
mod tests;
