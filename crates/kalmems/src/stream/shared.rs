//! What the thread that reads samples tells the one that estimates them.

use super::decode::Damage;
use super::order::OrderCounts;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// What has been counted on the way, as the reading thread has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct StreamCounts {
    /// What the way has made of the samples.
    #[serde(flatten)]
    pub order: OrderCounts,
    /// Lines that are no samples.
    pub damaged_lines: u64,
    /// Bytes between frames.
    pub damaged_bytes: u64,
    /// Frames whose checksum is another one.
    pub damaged_frames: u64,
    /// Lines and frames that the end of the stream or a break of the connection cut off; they are no samples.
    pub cut_off: u64,
    /// How often the clock, or the count of the frames, went back.
    pub steps_back: u64,
    /// Clients of a listener that went without a sample.
    pub turned_away: u64,
    /// How often a connection broke.
    pub breaks: u64,
    /// How often it was there again.
    pub reconnections: u64,
    /// Samples that an earlier run had acknowledged.
    pub passed_over: u64,
}

/// Why no more samples come, where that is not the orderly end of the stream.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct StreamEnd {
    /// Why.
    pub why: String,
    /// How many samples had been received.
    pub samples: u64,
    /// The time of the last of them in s, where they have times.
    pub time_s: Option<f64>,
}

/// Something that happened on the way.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum StreamNotice {
    /// The connection broke, and is tried again.
    Disconnected(StreamEnd),
    /// It is there again.
    Reconnected { attempts: u64, after_s: f64 },
    /// The clock went back between two samples, from one time in s to another where they have times.
    ClockBack { times_s: Option<[f64; 2]> },
}

/// How many notices wait at most; what there is more is counted all the same.
const NOTICES: usize = 1024;

/// What both threads know.
#[derive(Clone, Debug, Default)]
pub(super) struct Shared(Arc<Mutex<SharedState>>);

#[derive(Debug, Default)]
struct SharedState {
    counts: StreamCounts,
    notices: VecDeque<StreamNotice>,
    broken: Option<StreamEnd>,
    /// When bytes came last.
    heard: Option<Instant>,
    /// When the first samples were read, and the time of the last of them in s.
    first: Option<(Instant, f64)>,
    connected: bool,
    stopped: bool,
}

impl Shared {
    fn known(&self) -> MutexGuard<'_, SharedState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The counts as they are now.
    pub(super) fn counts(&self) -> StreamCounts {
        self.known().counts
    }

    /// Tells what was received now.
    pub(super) fn received(&self, order: OrderCounts, damage: Damage, passed_over: u64) {
        let mut known = self.known();
        let Damage { lines, bytes, frames, cut_off } = damage;
        known.counts = StreamCounts {
            order,
            damaged_lines: lines,
            damaged_bytes: bytes,
            damaged_frames: frames,
            cut_off,
            passed_over,
            ..known.counts
        };
    }

    /// Samples came, the last of them in order of this time in s.
    pub(super) fn heard(&self, last_s: Option<f64>) {
        let (mut known, now) = (self.known(), Instant::now());
        (known.heard, known.connected) = (Some(now), true);
        known.first = known.first.or(last_s.map(|last_s| (now, last_s)));
    }

    /// When the first samples were read, and the time of the last of them in s.
    pub(super) fn first(&self) -> Option<(Instant, f64)> {
        self.known().first
    }

    /// A client went without a sample.
    pub(super) fn turned_away(&self) {
        self.known().counts.turned_away += 1;
    }

    /// Tells what happened.
    pub(super) fn notice(&self, notice: StreamNotice) {
        let mut known = self.known();
        match &notice {
            StreamNotice::Disconnected(_) => {
                known.counts.breaks += 1;
                known.connected = false;
            }
            StreamNotice::Reconnected { .. } => {
                known.counts.reconnections += 1;
                known.connected = true;
            }
            StreamNotice::ClockBack { .. } => known.counts.steps_back += 1,
        }
        if known.notices.len() < NOTICES {
            known.notices.push_back(notice);
        }
    }

    /// What happened since the last call.
    pub(super) fn notices(&self) -> VecDeque<StreamNotice> {
        std::mem::take(&mut self.known().notices)
    }

    /// No more samples come, for this reason.
    pub(super) fn broke(&self, broken: StreamEnd) {
        let mut known = self.known();
        known.counts.breaks += 1;
        known.connected = false;
        known.broken = Some(broken);
    }

    /// Why no more samples come, where that is no orderly end.
    pub(super) fn broken(&self) -> Option<StreamEnd> {
        self.known().broken.clone()
    }

    /// Whether the connection is there, and how long nothing came over it, in s.
    pub(super) fn silence(&self) -> (bool, Option<f64>) {
        let known = self.known();
        (known.connected, known.heard.map(|heard| heard.elapsed().as_secs_f64()))
    }

    /// Asks the reading thread to end.
    pub(super) fn stop(&self) {
        self.known().stopped = true;
    }

    /// Whether it is to end.
    pub(super) fn is_stopped(&self) -> bool {
        self.known().stopped
    }
}
