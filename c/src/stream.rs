//! Estimates of samples while they arrive.

use crate::error::{Failure, KalmemsError, guarded, or, or_null};
use crate::experiment::KalmemsExperiment;
use crate::text::{at_or_none, owned};
use crate::watch::Watch;
use kalmems::rigs::published;
use kalmems::stream::{PushedStream, StreamError};
use std::collections::{HashMap, VecDeque};
use std::ffi::{CString, c_char};
use std::fmt::Write as _;
use std::path::PathBuf;
use std::ptr::null;
use std::sync::mpsc::RecvTimeoutError;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// A stream that is being estimated on a thread of its own. One thread may push samples while another polls estimates.
pub struct KalmemsStream {
    stream: PushedStream,
    lines: Mutex<Lines>,
    /// Columns of a sample that is pushed as numbers.
    width: usize,
    summary: Mutex<Option<CString>>,
}

/// What came out, and the part of it that was not polled.
#[derive(Default)]
struct Lines {
    rest: Vec<u8>,
    ready: VecDeque<Item>,
    /// The names of the columns of each filter.
    names: HashMap<String, Vec<CString>>,
    last: Option<Kept>,
}

/// What a line says.
enum Item {
    Estimate { filter: String, time_s: f64, numbers: Vec<f64> },
    Event { of: String, json: String },
}

/// What the last item refers to.
struct Kept {
    of: CString,
    json: Option<CString>,
    names: Vec<*const c_char>,
    numbers: Vec<f64>,
}

/// An estimate or an event of a stream; its texts and numbers are valid until the next poll of it.
#[repr(C)]
pub struct KalmemsStreamItem {
    /// `sizeof(KalmemsStreamItem)`, set by the caller: no later version of the library writes more.
    pub struct_size: usize,
    /// The filter as a key, such as `ekf`; `event` or `health` of what happened to the stream or the motion.
    pub of: *const c_char,
    /// What happened as JSON; null of an estimate.
    pub json: *const c_char,
    /// The time of an estimate in s.
    pub time_s: f64,
    /// The names of its numbers with their units, such as `angle_rad` and `angle_sd_rad`.
    pub names: *const *const c_char,
    /// Its numbers; what is not known is not a number.
    pub numbers: *const f64,
    /// How many there are.
    pub count: usize,
}

/// What a poll has come to.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KalmemsPoll {
    /// It failed; the error says why.
    Failed = -1,
    /// Nothing is there yet.
    Nothing = 0,
    /// There is an item.
    Item = 1,
    /// The stream has ended, and all was polled.
    End = 2,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Begins to estimate samples as the table `stream` of an experiment says; null with an error where that cannot be. With a file as `state` the stream
/// goes on from what an earlier one has left there, and leaves its own; null is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_stream_open(
    experiment: *const KalmemsExperiment,
    state: *const c_char,
    error: *mut *mut KalmemsError,
) -> *mut KalmemsStream {
    let made = guarded(|| {
        // SAFETY: as the crate says of all functions.
        let (experiment, state) =
            unsafe { (experiment.as_ref(), at_or_none(state, "the file of the state")?) };
        let experiment = experiment.ok_or_else(|| Failure::null("the experiment"))?;
        let ready =
            experiment.given().prepare(published(), &Watch::new(None, std::ptr::null_mut()))?.experiment;
        let width = ready.stream.as_ref().map_or(0, |stream| stream.input.columns().len());
        let stream = PushedStream::begin(published(), ready, state.map(PathBuf::from))
            .map_err(|error| Failure::estimation(&error))?;
        let (lines, summary) = (Mutex::default(), Mutex::default());
        Ok(Box::into_raw(Box::new(KalmemsStream { stream, lines, width, summary })))
    });
    or_null(made, error)
}

/// Hands bytes over as an instrument sends them, in pieces of any length; waits while 64 pieces wait already. `false` with an error once the stream has
/// ended, the reason of which a poll says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_stream_push(
    stream: *const KalmemsStream,
    bytes: *const u8,
    count: usize,
    error: *mut *mut KalmemsError,
) -> bool {
    let pushed = guarded(|| {
        // SAFETY: null or a stream of this library; there are as many bytes as their count says.
        let stream = unsafe { stream.as_ref() }.ok_or_else(|| Failure::null("the stream"))?;
        if bytes.is_null() && count > 0 {
            return Err(Failure::null("the bytes"));
        }
        // SAFETY: not null, and there are as many as their count says.
        let piece = if count == 0 { &[] } else { unsafe { std::slice::from_raw_parts(bytes, count) } };
        stream.push(piece.to_vec())
    });
    or(pushed, false, error)
}

/// Hands samples over as numbers, row after row with the columns of `stream.input.text` in their order; what is not a number is missing. Every number
/// keeps its last digit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_stream_push_rows(
    stream: *const KalmemsStream,
    numbers: *const f64,
    rows: usize,
    columns: usize,
    error: *mut *mut KalmemsError,
) -> bool {
    let pushed = guarded(|| {
        // SAFETY: null or a stream of this library.
        let stream = unsafe { stream.as_ref() }.ok_or_else(|| Failure::null("the stream"))?;
        if columns != stream.width {
            return Err(Failure::argument(&format!(
                "{columns} columns; the stream consists of {}",
                stream.width
            )));
        }
        let count = rows.checked_mul(columns).filter(|count| *count == 0 || !numbers.is_null());
        let count = count.ok_or_else(|| Failure::null("the array of samples"))?;
        // SAFETY: not null, and there are as many as rows and columns say.
        let all = if count == 0 { &[] } else { unsafe { std::slice::from_raw_parts(numbers, count) } };
        let mut text = String::with_capacity(20 * count);
        for row in all.chunks_exact(columns.max(1)) {
            for (place, number) in row.iter().enumerate() {
                text.push_str(if place > 0 { "," } else { "" });
                if !number.is_nan() {
                    // A string takes all that is written.
                    let _ = write!(text, "{number:?}");
                }
            }
            text.push('\n');
        }
        stream.push(text.into_bytes())
    });
    or(pushed, false, error)
}

impl KalmemsStream {
    fn push(&self, piece: Vec<u8>) -> Result<bool, Failure> {
        let why = || {
            Failure::argument(
                "the stream takes no samples any more; poll it for the reason, or open another one",
            )
        };
        if self.stream.push(piece) { Ok(true) } else { Err(why()) }
    }

    /// Waits for the end of the work.
    fn end(&self) -> Result<(), Failure> {
        let Some(ended) = self.stream.end() else { return Ok(()) };
        let summary = match ended {
            Ok(Ok(summary)) => summary,
            Ok(Err(StreamError::Config(error))) => return Err(error.into()),
            Ok(Err(StreamError::Read(error))) => return Err(error.into()),
            Ok(Err(StreamError::Estimate(error))) => return Err(error.into()),
            Ok(Err(error)) => return Err(Failure::estimation(&error)),
            Err(_) => return Err(Failure::estimation(&"the stream ended unexpectedly")),
        };
        let json = serde_json::to_string(&summary).map_err(|error| Failure::estimation(&error))?;
        *locked(&self.summary) = Some(owned(&json));
        Ok(())
    }
}

/// Says that no more samples come, after which polls give what is left and then the end. Null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_stream_close(stream: *const KalmemsStream) {
    // SAFETY: null or a stream of this library.
    if let Some(stream) = unsafe { stream.as_ref() } {
        stream.stream.close();
    }
}

/// The next estimate or event, put where `item` points; waits for it no longer than `timeout_s`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_stream_poll(
    stream: *const KalmemsStream,
    timeout_s: f64,
    item: *mut KalmemsStreamItem,
    error: *mut *mut KalmemsError,
) -> KalmemsPoll {
    let polled = guarded(|| {
        // SAFETY: as the crate says of all functions; the first number of an item of any version is its size.
        let (stream, size) = unsafe { (stream.as_ref(), item.cast::<usize>().as_ref()) };
        let stream = stream.ok_or_else(|| Failure::null("the stream"))?;
        let size = *size.ok_or_else(|| Failure::null("the place for the item"))?;
        if size < size_of::<KalmemsStreamItem>() {
            let least = size_of::<KalmemsStreamItem>();
            let why = format!(
                "`struct_size` of the item is {size}; set it to sizeof(KalmemsStreamItem), {least} or more"
            );
            return Err(Failure::argument(&why));
        }
        // SAFETY: not null, and as large as that.
        let place = unsafe { &mut *item };
        let mut lines = locked(&stream.lines);
        if lines.ready.is_empty() {
            let wait = Duration::try_from_secs_f64(timeout_s).unwrap_or_default();
            match stream.stream.lines(wait) {
                Ok(more) => lines.take(&more),
                Err(RecvTimeoutError::Timeout) => return Ok(KalmemsPoll::Nothing),
                Err(RecvTimeoutError::Disconnected) => {
                    return stream.end().map(|()| KalmemsPoll::End);
                }
            }
        }
        Ok(lines.put(place))
    });
    or(polled, KalmemsPoll::Failed, error)
}

impl Lines {
    /// Takes what came; a line that has not ended waits.
    fn take(&mut self, more: &[u8]) {
        self.rest.extend_from_slice(more);
        let end = self.rest.iter().rposition(|byte| *byte == b'\n').map_or(0, |place| place + 1);
        let whole: Vec<u8> = self.rest.drain(..end).collect();
        for line in String::from_utf8_lossy(&whole).lines() {
            self.read(line);
        }
    }

    fn read(&mut self, line: &str) {
        if let Some(names) = line.strip_prefix("# ") {
            // The filter, the time, and the names of its numbers.
            let mut names = names.split(',');
            if let (Some(filter), Some(_)) = (names.next(), names.next()) {
                self.names.insert(filter.to_owned(), names.map(owned).collect());
            }
            return;
        }
        let Some((of, rest)) = line.split_once(',') else { return };
        if of == "event" || of == "health" {
            self.ready.push_back(Item::Event { of: of.to_owned(), json: rest.to_owned() });
            return;
        }
        let mut cells = rest.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN));
        let time_s = cells.next().unwrap_or(f64::NAN);
        self.ready.push_back(Item::Estimate { filter: of.to_owned(), time_s, numbers: cells.collect() });
    }

    /// Puts the next item where the caller wants it.
    fn put(&mut self, place: &mut KalmemsStreamItem) -> KalmemsPoll {
        let Some(item) = self.ready.pop_front() else { return KalmemsPoll::Nothing };
        let (kept, time_s) = match item {
            Item::Event { of, json } => {
                let json = Some(owned(&json));
                (Kept { of: owned(&of), json, names: Vec::new(), numbers: Vec::new() }, f64::NAN)
            }
            Item::Estimate { filter, time_s, mut numbers } => {
                let named = self.names.get(&filter).map_or(&[][..], Vec::as_slice);
                numbers.truncate(named.len());
                let pointers = named.iter().take(numbers.len()).map(|name| name.as_ptr()).collect();
                (Kept { of: owned(&filter), json: None, names: pointers, numbers }, time_s)
            }
        };
        let kept = self.last.insert(kept);
        *place = KalmemsStreamItem {
            struct_size: place.struct_size,
            of: kept.of.as_ptr(),
            json: kept.json.as_ref().map_or(null(), |json| json.as_ptr()),
            time_s,
            names: kept.names.as_ptr(),
            numbers: kept.numbers.as_ptr(),
            count: kept.numbers.len(),
        };
        KalmemsPoll::Item
    }
}

/// What came of the stream as JSON, with counts and health; null before a poll has come to its end. The text is the stream's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_stream_summary(stream: *const KalmemsStream) -> *const c_char {
    // SAFETY: null or a stream of this library.
    let stream = unsafe { stream.as_ref() };
    stream
        .map_or(null(), |stream| locked(&stream.summary).as_ref().map_or(null(), |summary| summary.as_ptr()))
}

/// Stops a stream where it is and frees it, with what its items refer to; null is nothing. No other thread may use it any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_stream_free(stream: *mut KalmemsStream) {
    if stream.is_null() {
        return;
    }
    // SAFETY: it came from `Box::into_raw`.
    let stream = unsafe { Box::from_raw(stream) };
    stream.stream.stop();
    // The state is in its file when this returns.
    drop(stream.stream.end());
}
