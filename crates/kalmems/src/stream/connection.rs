//! Where samples come from, and what is done where that breaks.

use std::io::{self, ErrorKind, Read};
use std::time::{Duration, Instant};

/// A way to samples, which may be opened again where it breaks.
///
/// It is opened and read on a thread of its own, which looks now and then whether the stream is stopped: an opening or a read
/// that would take longer than some tenths of a second should return in between, the opening with `None` and the read with
/// [`ErrorKind::WouldBlock`]. One that does not is left behind when the stream is stopped.
pub trait Connection: Send {
    /// Opens it; `None` where nobody is there yet.
    ///
    /// A read of no bytes is the end of the stream, of a connection that [`reopens`](Self::reopens) a break as any error other than
    /// [`ErrorKind::WouldBlock`] and [`ErrorKind::Interrupted`]: the system closes the connection of a sender that was killed as that of
    /// one that has ended. There the end is what the sender says, by the end mark of its format.
    fn open(&mut self) -> io::Result<Option<Box<dyn Read + Send>>>;

    /// Whether it can be opened again; what was read of a file or a pipe does not come again.
    fn reopens(&self) -> bool {
        false
    }

    /// Whether anybody may connect: who sends no sample is not the sender, and the next one is served.
    fn is_listener(&self) -> bool {
        false
    }

    /// Whether samples come as they are taken, so that one that is estimated later is late.
    fn is_live(&self) -> bool {
        self.reopens()
    }
}

/// Something that is open already and cannot be opened again.
pub struct OpenedConnection(Option<Box<dyn Read + Send>>);

impl OpenedConnection {
    /// This.
    pub fn new(input: impl Read + Send + 'static) -> Self {
        Self(Some(Box::new(input)))
    }
}

impl Connection for OpenedConnection {
    fn open(&mut self) -> io::Result<Option<Box<dyn Read + Send>>> {
        Ok(self.0.take())
    }
}

/// How long is waited before a connection is tried again, at first; each time twice as long, up to the longest.
const FIRST_WAIT: Duration = Duration::from_millis(10);
const LONGEST_WAIT: Duration = Duration::from_secs(1);

/// How long a client of a listener has for its first sample.
const FIRST_SAMPLE: Duration = Duration::from_secs(10);

/// Why a connection broke whose other end closed it without an end mark.
const CLOSED: &str = "the sender closed the connection without the end mark `# end`";

/// How long the thread sleeps at once at most, so that it hears in time that the stream is stopped.
const NAP: Duration = Duration::from_millis(50);

/// What came of an attempt to receive something.
pub(super) enum Received {
    /// So many bytes.
    Bytes(usize),
    /// Nothing yet.
    Nothing,
    /// The connection broke, for this reason, and is tried again.
    Broken(String),
    /// A client of a listener went, or was sent away, without a sample.
    TurnedAway,
    /// It is there again, after so many attempts and so many seconds.
    Again { attempts: u64, after_s: f64 },
    /// It broke, for this reason, and is not tried any more.
    Over(String),
    /// The end.
    End,
}

/// A connection that is tried again where it breaks.
pub(super) struct RetriedConnection {
    connection: Box<dyn Connection>,
    reader: Option<Box<dyn Read + Send>>,
    /// For how long it is tried again, and how long it may be silent.
    reconnect: Option<Duration>,
    idle: Option<Duration>,
    /// How long was waited since it was opened or samples came last, and since when what came meanwhile is looked at. The time in which samples
    /// wait to be estimated does not count.
    silent: Duration,
    taken: Option<Instant>,
    /// Whether samples ever came, and over it.
    heard: bool,
    heard_now: bool,
    /// When it broke first since samples came last: one that breaks again before anything came over it was never there.
    silent_since: Option<Instant>,
    lost: Option<Lost>,
}

/// A connection that broke.
struct Lost {
    why: String,
    at: Instant,
    attempts: u64,
    wait: Duration,
    next: Instant,
}

impl RetriedConnection {
    /// It is tried again for so long where it breaks, as it does where no sample comes for so long.
    pub(super) fn new(connection: Box<dyn Connection>, [reconnect, idle]: [Option<Duration>; 2]) -> Self {
        Self {
            connection,
            reader: None,
            reconnect,
            idle,
            silent: Duration::ZERO,
            taken: None,
            heard: false,
            heard_now: false,
            silent_since: None,
            lost: None,
        }
    }

    /// Samples came.
    pub(super) fn hear(&mut self) {
        (self.heard, self.heard_now, self.silent_since) = (true, true, None);
        (self.silent, self.taken) = (Duration::ZERO, None);
    }

    /// Waits for bytes, some tenths of a second where the connection allows it. An error is that it could not be opened at all.
    pub(super) fn receive(&mut self, piece: &mut [u8]) -> io::Result<Received> {
        let Some(reader) = &mut self.reader else { return self.open() };
        let is_unheard = self.connection.is_listener() && !self.heard_now;
        if is_unheard && self.silent > FIRST_SAMPLE {
            return Ok(self.turn_away());
        }
        if self.connection.reopens() && self.idle.is_some_and(|idle| self.silent > idle) {
            return Ok(self.broke(format!("no sample came for {:.1} s", self.silent.as_secs_f64())));
        }
        let begun = self.taken.take().unwrap_or_else(Instant::now);
        let read = reader.read(piece);
        self.silent += begun.elapsed();
        let is_over = match &read {
            Ok(count) => *count == 0,
            Err(e) => !matches!(e.kind(), ErrorKind::Interrupted | ErrorKind::WouldBlock),
        };
        if is_unheard && is_over {
            return Ok(self.turn_away());
        }
        match read {
            Ok(0) if self.connection.reopens() => Ok(self.broke(CLOSED.to_owned())),
            Ok(0) => Ok(Received::End),
            Ok(count) => {
                self.taken = Some(Instant::now());
                Ok(Received::Bytes(count))
            }
            Err(_) if !is_over => Ok(Received::Nothing),
            // What could never be read is no connection that broke.
            Err(e) if !self.heard && !self.connection.reopens() => Err(e),
            Err(e) => Ok(self.broke(e.to_string())),
        }
    }

    fn turn_away(&mut self) -> Received {
        self.reader = None;
        Received::TurnedAway
    }

    fn broke(&mut self, why: String) -> Received {
        self.reader = None;
        if self.reconnect.is_none() || !self.connection.reopens() {
            return Received::Over(why);
        }
        let now = Instant::now();
        self.silent_since.get_or_insert(now);
        self.lost =
            Some(Lost { why: why.clone(), at: now, attempts: 0, wait: FIRST_WAIT, next: now + FIRST_WAIT });
        Received::Broken(why)
    }

    fn open(&mut self) -> io::Result<Received> {
        (self.silent, self.taken, self.heard_now) = (Duration::ZERO, None, false);
        let Some(lost) = &mut self.lost else {
            return match self.connection.open() {
                Ok(reader) => {
                    self.reader = reader;
                    Ok(Received::Nothing)
                }
                Err(e) if self.connection.reopens() => Ok(self.broke(e.to_string())),
                Err(e) => Err(e),
            };
        };
        let now = Instant::now();
        if now < lost.next {
            std::thread::sleep(NAP.min(lost.next - now));
            return Ok(Received::Nothing);
        }
        let opened = self.connection.open();
        lost.attempts += u64::from(!matches!(opened, Ok(None)));
        let refused = match opened {
            Ok(Some(reader)) => {
                let (attempts, after_s) = (lost.attempts, lost.at.elapsed().as_secs_f64());
                (self.reader, self.lost) = (Some(reader), None);
                return Ok(Received::Again { attempts, after_s });
            }
            Ok(None) => None,
            Err(e) => Some(e.to_string()),
        };
        let patience = self.reconnect.unwrap_or_default();
        if self.silent_since.unwrap_or(lost.at).elapsed() >= patience {
            let refused = refused.as_ref().map_or_else(String::new, |refused| format!(": {refused}"));
            let (why, patience_s) = (&lost.why, patience.as_secs_f64());
            return Ok(Received::Over(format!(
                "{why}; it was not there again within {patience_s} s{refused}"
            )));
        }
        if refused.is_some() {
            lost.wait = (2 * lost.wait).min(LONGEST_WAIT);
            lost.next = Instant::now() + lost.wait;
        }
        Ok(Received::Nothing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives a byte at the openings that are named, refuses at all others, and breaks after it.
    struct Loose {
        good: Vec<u64>,
        opened: u64,
    }

    struct OneByte(bool);

    impl Read for OneByte {
        fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
            if std::mem::replace(&mut self.0, true) {
                return Err(ErrorKind::ConnectionReset.into());
            }
            bytes[0] = b'x';
            Ok(1)
        }
    }

    impl Connection for Loose {
        fn open(&mut self) -> io::Result<Option<Box<dyn Read + Send>>> {
            self.opened += 1;
            if self.good.contains(&self.opened) {
                return Ok(Some(Box::new(OneByte(false))));
            }
            Err(ErrorKind::ConnectionRefused.into())
        }

        fn reopens(&self) -> bool {
            true
        }
    }

    #[test]
    fn a_broken_connection_is_tried_again_until_the_time_is_up() {
        let connection = Loose { good: vec![1, 3, 4], opened: 0 };
        let mut link = RetriedConnection::new(Box::new(connection), [Some(Duration::from_millis(400)), None]);
        let (mut bytes, mut again, mut broken) = (0, Vec::new(), 0);
        let begun = Instant::now();
        let why = loop {
            match link.receive(&mut [0; 4]).unwrap() {
                Received::Bytes(count) => {
                    bytes += count;
                    link.hear();
                }
                Received::Nothing => {}
                Received::Broken(why) => {
                    assert!(why.contains("reset"), "{why}");
                    broken += 1;
                }
                Received::TurnedAway => panic!("it does not listen"),
                Received::Again { attempts, after_s } => {
                    assert!(after_s >= 0.01);
                    again.push(attempts);
                }
                Received::Over(why) => break why,
                Received::End => panic!("no end was sent"),
            }
        };
        assert_eq!((bytes, again, broken), (3, vec![2, 1], 3));
        assert!(why.contains("reset") && why.contains("0.4 s") && why.contains("refused"), "{why}");
        let tried_s = begun.elapsed().as_secs_f64();
        assert!((0.4..3.0).contains(&tried_s), "{tried_s}");
    }

    /// Gives bytes without a pause.
    struct Flood;

    impl Read for Flood {
        fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
            Ok(bytes.len())
        }
    }

    impl Connection for Flood {
        fn open(&mut self) -> io::Result<Option<Box<dyn Read + Send>>> {
            Ok(Some(Box::new(Self)))
        }

        fn reopens(&self) -> bool {
            true
        }
    }

    #[test]
    fn bytes_without_a_sample_do_not_hold_a_connection_beyond_the_idle_limit() {
        let mut link = RetriedConnection::new(Box::new(Flood), [None, Some(Duration::from_millis(300))]);
        let (begun, mut bytes) = (Instant::now(), [0; 4]);
        let why = loop {
            match link.receive(&mut bytes).unwrap() {
                // A sample in the first half of the time, and none later.
                Received::Bytes(_) if begun.elapsed() < Duration::from_millis(200) => link.hear(),
                Received::Over(why) => break why,
                // Looking at what came takes a while, in which nothing is read.
                _ => std::thread::sleep(Duration::from_millis(1)),
            }
        };
        assert!(why.contains("no sample came for 0.3 s"), "{why}");
        let held_s = begun.elapsed().as_secs_f64();
        assert!((0.45..3.0).contains(&held_s), "{held_s}");
    }

    #[test]
    fn what_cannot_be_opened_again_is_over_when_it_breaks() {
        let mut link = RetriedConnection::new(
            Box::new(OpenedConnection::new(OneByte(false))),
            [Some(Duration::from_secs(9)), None],
        );
        assert!(matches!(link.receive(&mut [0; 4]).unwrap(), Received::Nothing));
        assert!(matches!(link.receive(&mut [0; 4]).unwrap(), Received::Bytes(1)));
        link.hear();
        assert!(matches!(link.receive(&mut [0; 4]).unwrap(), Received::Over(_)));
    }
}
