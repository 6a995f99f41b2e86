//! What is told of a stream itself while it runs: its connection, its stretches and its health.

use super::shared::{Shared, StreamCounts, StreamEnd, StreamNotice};
use crate::evaluate::InnovationTest;
use crate::recording::Finding;
use serde::Serialize;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Something that happened to the stream.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum StreamEvent {
    /// The connection broke, and is tried again.
    Disconnected(StreamEnd),
    /// It is there again.
    Reconnected {
        /// How often it was tried.
        attempts: u64,
        /// How long it was not there, in s.
        after_s: f64,
    },
    /// The clock, or the count of the frames, went back.
    ClockBack {
        /// The time of the last sample before, in s.
        #[serde(skip_serializing_if = "Option::is_none")]
        from_s: Option<f64>,
        /// The time of the first sample after, in s.
        #[serde(skip_serializing_if = "Option::is_none")]
        to_s: Option<f64>,
    },
    /// A stretch of samples began that does not go on from the one before; the estimate begins anew.
    NewStretch {
        /// When it began, in s.
        time_s: f64,
        /// The time of the last sample before, in s.
        after_s: f64,
    },
    /// The samples of a stretch cannot be estimated.
    NotEstimated {
        /// When it began, in s.
        time_s: f64,
        /// Why.
        why: String,
    },
    /// A stretch is estimated after all, from a later sample on.
    EstimateBegins {
        /// The time of that in s.
        time_s: f64,
        /// Samples before it that are not estimated.
        not_estimated: u64,
    },
    /// The estimates of the first samples have taken longer than the samples last: they will fall behind.
    TooSlow {
        /// The time of the newest estimate in s.
        time_s: f64,
        /// The rate of the samples, as the experiment states it.
        rate_hz: f64,
        /// The rate at which they can be estimated here.
        sustained_hz: f64,
    },
    /// The estimates are behind the samples: these come faster than they are estimated.
    Behind {
        /// The time of the newest estimate in s.
        time_s: f64,
        /// By how much it is behind, in s.
        lag_s: f64,
    },
    /// They are not any more.
    CaughtUp {
        /// The time of the newest estimate in s.
        time_s: f64,
    },
    /// For 50 cycles of the motion the signal has had nothing at its harmonics but noise: zero phases and crossings are not
    /// told until it has.
    NoiseOnly {
        /// When these cycles ended, in s.
        time_s: f64,
    },
    /// The signal has something else than noise again.
    NoiseOnlyOver {
        /// When, in s.
        time_s: f64,
    },
    /// The samples show that a column is clipped, repeats another column, or has a value that stays; once for each in a stretch.
    InputCheck {
        /// The time of the newest sample when it became known, in s.
        time_s: f64,
        /// What was found, of the samples until then.
        #[serde(flatten)]
        found: Finding,
    },
    /// How the stream fares.
    Health(Box<Health>),
}

impl From<StreamNotice> for StreamEvent {
    fn from(notice: StreamNotice) -> Self {
        match notice {
            StreamNotice::Disconnected(broken) => Self::Disconnected(broken),
            StreamNotice::Reconnected { attempts, after_s } => Self::Reconnected { attempts, after_s },
            StreamNotice::ClockBack { times_s } => Self::ClockBack {
                from_s: times_s.map(|[from_s, _]| from_s),
                to_s: times_s.map(|[_, to_s]| to_s),
            },
        }
    }
}

/// How a stream fares.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Health {
    /// The time of day, in s since 1970.
    pub unix_s: f64,
    /// How long it has run, in s.
    pub running_s: f64,
    /// Whether the connection is there.
    pub connected: bool,
    /// How long nothing has come, in s; none where nothing ever came.
    pub silent_s: Option<f64>,
    /// Samples received per second since the last such line.
    pub rate_hz: f64,
    /// The longest time from the arrival of a sample to its estimate since then, or by which an estimate was behind the sample's own time, in s;
    /// none where there were no estimates.
    pub lag_s: Option<f64>,
    /// The time of the newest estimate in s.
    pub time_s: Option<f64>,
    /// Samples of which some filter has an estimate.
    pub estimated: u64,
    /// Samples of which none has.
    pub not_estimated: u64,
    /// Stretches so far: 1, and one more for each new beginning.
    pub stretches: u64,
    /// What was received, and what the way has made of it.
    #[serde(flatten)]
    pub received: StreamCounts,
    /// Samples that were found clipped, of all columns.
    pub clipped: u64,
    /// Samples whose value stays while those around them move, of all columns.
    pub staying: u64,
    /// Whether the signal is only noise, as far as that is known.
    pub noise_only: bool,
    /// How each answer fares.
    pub filters: Vec<FilterHealth>,
}

/// How a filter fares.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FilterHealth {
    /// The answer, by its key.
    pub estimator: String,
    /// Whether it follows the motion.
    pub lock: LockState,
    /// The mean NIS of the last samples over which it is watched.
    pub mean_nis: Option<f64>,
    /// Whether that is an alarm.
    pub alarm: bool,
    /// Whether zero phases are not told, as the motion that it follows may be noise.
    pub motion_in_noise: bool,
    /// Samples that it rejected as outliers since the stretch began.
    pub rejected: u64,
    /// Whether it takes all samples, as too many were rejected.
    pub gate_is_open: bool,
    /// The error of its integration steps over the last 4096 samples, in claimed standard deviations; absent if they are exact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub step_error: Option<f64>,
    /// The tests of its innovations that fail, over the last 10⁶ of them at most.
    pub failing: Vec<InnovationTest>,
}

/// Whether a filter follows the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LockState {
    /// It does, as far as its signal tells.
    Held,
    /// It has lost the signal.
    Lost,
    /// It has stopped.
    Stopped,
}

/// Says when health is to be told, by the time of day and not by samples.
pub(super) struct Heartbeat {
    every: Option<Duration>,
    begun: Instant,
    last: Instant,
    received: u64,
    lag: Option<Duration>,
}

impl Heartbeat {
    pub(super) fn new(every: Option<Duration>) -> Self {
        let now = Instant::now();
        Self { every, begun: now, last: now, received: 0, lag: None }
    }

    /// Some estimates took so long at most.
    pub(super) fn lagged(&mut self, longest: Duration) {
        self.lag = self.lag.max(Some(longest));
    }

    /// What is known of the way, where it is time to tell it; what is known of the estimates is to be put in.
    pub(super) fn beat(&mut self, shared: &Shared) -> Option<Health> {
        (self.last.elapsed() >= self.every?).then(|| self.measure(shared))
    }

    /// What is known of the way since the last time.
    pub(super) fn measure(&mut self, shared: &Shared) -> Health {
        let since = self.last.elapsed();
        let received = shared.counts();
        let new = received.order.passed.saturating_sub(self.received);
        let (connected, silent_s) = shared.silence();
        let lag_s = self.lag.take().map(|lag| lag.as_secs_f64());
        self.last = Instant::now();
        self.received = received.order.passed;
        let day = SystemTime::now().duration_since(UNIX_EPOCH);
        Health {
            unix_s: day.map_or(f64::NAN, |since| since.as_secs_f64()),
            running_s: self.begun.elapsed().as_secs_f64(),
            connected,
            silent_s,
            rate_hz: new as f64 / since.as_secs_f64(),
            lag_s,
            time_s: None,
            estimated: 0,
            not_estimated: 0,
            stretches: 0,
            received,
            clipped: 0,
            staying: 0,
            noise_only: false,
            filters: Vec::new(),
        }
    }
}
