//! Samples that arrive, as a table.

use super::connection::{Connection, Received, RetriedConnection};
use super::decode::{Decoder, StreamSample};
use super::latency::ArrivalTimes;
use super::order::{Order, OrderSettings, OrderedEvent};
use super::recent::RecentSamples;
use super::shared::{Shared, StreamEnd, StreamNotice};
use super::state::StreamState;
use crate::config::StreamFormat;
use crate::recording::names_a_time;
use kalmems_formats::{
    Block, CellFault, CellFinding, Column, Digest, FormatError, Instant, Table, TableDescription,
    TableEvidence, TimeKind, TimeReader, WantedColumn,
};
use std::collections::VecDeque;
use std::time::Duration;

/// Bytes that are read at once at most.
const PIECE: usize = 1 << 16;

/// What a table of samples that arrive needs to know beside their format.
pub(super) struct LiveSettings {
    /// For how many later samples one is waited for.
    pub wait: usize,
    /// The place of the time among the numbers. It tells samples apart whose frames do not count.
    pub time: Option<usize>,
    /// The interval between samples in s.
    pub interval_s: f64,
    /// The most missing samples that rows stand for where there are no times.
    pub longest_gap: u64,
    /// For how long a connection that broke is tried again, and how long one may be silent.
    pub patience: [Option<Duration>; 2],
}

/// A table whose rows are the samples of a connection in order; a block holds what has arrived.
pub(super) struct LiveTable {
    link: RetriedConnection,
    piece: Box<[u8]>,
    description: TableDescription,
    format: StreamFormat,
    decoder: Decoder,
    order: Order,
    /// Which of the numbers each column of a block is.
    wanted: Vec<usize>,
    ready: WaitingSamples,
    arrivals: ArrivalTimes,
    shared: Shared,
    /// Where another run is to go on from what is given.
    recent: Option<RecentSamples>,
    /// Rows that were given.
    rows: u64,
    bytes: u64,
    ended: bool,
    /// Where the times count from, where another run has said it.
    origin: Option<Instant>,
    /// Until when samples were taken by another run, and how many of them have come again.
    taken_s: Option<f64>,
    passed_over: u64,
    interval_s: f64,
}

/// Samples in order that wait to be asked for.
struct WaitingSamples {
    samples: VecDeque<StreamSample>,
    /// Rows that do not go on from those before them, and how many are missing between; where no times tell it.
    breaks: VecDeque<(u64, u64)>,
    /// Rows so far, those that were given included.
    rows: u64,
    /// The place of the time among the numbers, in s, and the time of the last sample.
    time: Option<usize>,
    last_s: Option<f64>,
    shared: Shared,
}

impl WaitingSamples {
    fn put(&mut self, next: OrderedEvent) {
        let sample = match next {
            OrderedEvent::Sample(sample) => sample,
            OrderedEvent::Restart { missing, back } => {
                // Times tell it themselves.
                if self.time.is_none() {
                    self.breaks.push_back((self.rows, missing));
                    if back {
                        self.shared.notice(StreamNotice::ClockBack { times_s: None });
                    }
                }
                return;
            }
        };
        if let Some(now_s) = self.time.and_then(|place| sample.numbers.get(place).copied()) {
            if let Some(last_s) = self.last_s.filter(|last_s| now_s < *last_s) {
                self.shared.notice(StreamNotice::ClockBack { times_s: Some([last_s, now_s]) });
            }
            self.last_s = Some(now_s);
        }
        self.rows += 1;
        self.samples.push_back(sample);
    }
}

impl LiveTable {
    /// The samples of this connection.
    pub(super) fn new(
        connection: Box<dyn Connection>,
        format: &StreamFormat,
        settings: &LiveSettings,
        (arrivals, shared): (ArrivalTimes, Shared),
    ) -> Self {
        let names = format.columns();
        let what = match format {
            StreamFormat::Text { .. } => "lines of numbers separated by commas",
            StreamFormat::Frames { .. } => "frames",
        };
        let LiveSettings { wait, time, interval_s, longest_gap, patience } = *settings;
        let order = OrderSettings {
            wait,
            bits: format.sequence_bits(),
            time: time.map(|time| (time, interval_s)),
            longest_gap,
        };
        let ready = WaitingSamples {
            samples: VecDeque::new(),
            breaks: VecDeque::new(),
            rows: 0,
            time,
            last_s: None,
            shared: shared.clone(),
        };
        Self {
            link: RetriedConnection::new(connection, patience),
            piece: vec![0; PIECE].into_boxed_slice(),
            description: TableDescription {
                format: "stream",
                recognised: format!("{what}, as the experiment says"),
                columns: names.iter().map(|name| Column::new(name)).collect(),
                rows: None,
                evidence: TableEvidence::Format,
                left_out: Vec::new(),
                protection: String::new(),
            },
            decoder: Decoder::new(format, &vec![0; names.len()]),
            format: format.clone(),
            order: Order::new(order),
            wanted: Vec::new(),
            ready,
            arrivals,
            shared,
            recent: None,
            rows: 0,
            bytes: 0,
            ended: false,
            origin: None,
            taken_s: None,
            passed_over: 0,
            interval_s,
        }
    }

    /// Keeps the last samples that it gives.
    pub(super) fn keep(&mut self, recent: RecentSamples) {
        self.recent = Some(recent);
    }

    /// Begins with the samples that another run left, and passes over those that it took.
    pub(super) fn go_on(&mut self, left: &StreamState) {
        let names: Vec<String> = self.description.columns.iter().map(|column| column.name.clone()).collect();
        left.samples(&names).into_iter().for_each(|sample| self.ready.put(OrderedEvent::Sample(sample)));
        self.origin = Some(left.origin());
        self.taken_s = self.ready.time.map(|_| left.acknowledged_s());
    }

    /// Waits for bytes and takes them, or for what happens to the connection.
    fn receive(&mut self) -> Result<(), FormatError> {
        let received = self.link.receive(&mut self.piece)?;
        if self.shared.is_stopped() {
            self.end();
        }
        match received {
            Received::Bytes(count) => self.take(count),
            Received::Nothing => {}
            Received::TurnedAway => {
                self.decoder.cut_off();
                self.shared.turned_away();
            }
            Received::Broken(why) => {
                self.decoder.cut_off();
                self.shared.notice(StreamNotice::Disconnected(self.broken(why)));
            }
            Received::Again { attempts, after_s } => {
                self.order.interrupt(&mut |next| self.ready.put(next));
                self.shared.notice(StreamNotice::Reconnected { attempts, after_s });
            }
            Received::Over(why) => {
                self.shared.broke(self.broken(why));
                self.end();
            }
            Received::End => self.end(),
        }
        self.shared.received(self.order.counts(), self.decoder.damage(), self.passed_over);
        self.arrivals.note_arrivals(self.rows + self.ready.samples.len() as u64);
        Ok(())
    }

    /// Takes so many bytes that came.
    fn take(&mut self, count: usize) {
        let (time, half) = (self.ready.time, 0.5 * self.interval_s);
        let until_s = self.taken_s.map(|taken_s| taken_s + half);
        let (order, ready, passed_over) = (&mut self.order, &mut self.ready, &mut self.passed_over);
        let mut any = false;
        self.decoder.take(&self.piece[..count], &mut |sample| {
            any = true;
            let time_s = time.and_then(|place| sample.numbers.get(place).copied());
            if until_s.zip(time_s).is_some_and(|(until_s, time_s)| time_s < until_s) {
                *passed_over += 1;
            } else {
                order.take(sample, &mut |next| ready.put(next));
            }
        });
        self.bytes += count as u64;
        if any {
            self.link.hear();
            self.shared.heard(self.ready.last_s);
        }
        if self.decoder.is_ended() {
            self.end();
        }
    }

    fn end(&mut self) {
        self.decoder.cut_off();
        self.order.finish(&mut |next| self.ready.put(next));
        self.ended = true;
    }

    /// What broke, with where it did.
    fn broken(&self, why: String) -> StreamEnd {
        StreamEnd { why, samples: self.order.counts().passed, time_s: self.ready.last_s }
    }
}

impl Table for LiveTable {
    fn description(&self) -> &TableDescription {
        &self.description
    }

    fn want(&mut self, wanted: &[WantedColumn]) -> Result<(), FormatError> {
        let mut powers = vec![0; self.description.columns.len()];
        self.wanted.clear();
        for wanted in wanted {
            match *wanted {
                WantedColumn::Number { column, power } => {
                    self.wanted.push(column);
                    if let Some(own) = powers.get_mut(column) {
                        *own = power;
                    }
                }
                WantedColumn::Time { column, .. } => self.wanted.push(column),
                WantedColumn::Label { .. } => {
                    return Err(FormatError::Unsupported {
                        format: "stream",
                        what: "a column of segments".to_owned(),
                        remedy: "samples that arrive are one record: leave `segments` of the recording out"
                            .to_owned(),
                    });
                }
            }
        }
        self.decoder = Decoder::new(&self.format, &powers);
        if let Some((column, unit, origin)) = WantedColumn::time(wanted, self.description.format)? {
            let origin = self.origin.or(origin);
            let times = match self.time_kind(column) {
                Some(_) => TimeReader::of_iso(origin),
                None => TimeReader::new(unit, origin),
            };
            self.decoder = Decoder::new(&self.format, &powers).with_times(column, times);
        }
        Ok(())
    }

    fn read(&mut self, block: &mut Block) -> Result<(), FormatError> {
        block.clear(self.wanted.len(), 0);
        while self.ready.samples.is_empty() && !self.ended {
            self.receive()?;
        }
        block.lines.push((0, self.rows + 1));
        while block.rows < block.capacity {
            let Some(sample) = self.ready.samples.pop_front() else { break };
            while self.ready.breaks.front().is_some_and(|(row, _)| *row <= self.rows) {
                block.breaks.extend(self.ready.breaks.pop_front().map(|(_, missing)| (block.rows, missing)));
            }
            for (i, column) in self.wanted.iter().enumerate() {
                let number = sample.numbers.get(*column).copied().unwrap_or(f64::NAN);
                block.numbers[i].push(number);
                if !number.is_finite() {
                    let (row, line) = (block.rows, self.rows + 1);
                    let fault = CellFault { row, line, column: Some(*column), fault: CellFinding::Missing };
                    block.faults.push(fault);
                }
            }
            block.rows += 1;
            self.rows += 1;
            let used = match &self.recent {
                Some(recent) => recent.push(sample.numbers),
                None => Some(sample.numbers),
            };
            if let Some(numbers) = used {
                self.decoder.reuse(numbers);
            }
        }
        if let Some(times) = self.decoder.times() {
            block.set_times(times);
        }
        Ok(())
    }

    /// Where the name of the clock says no unit, lines hold dates and times as text.
    fn time_kind(&self, column: usize) -> Option<TimeKind> {
        let name = &self.description.columns.get(column)?.name;
        let text = matches!(self.format, StreamFormat::Text { .. });
        (text && self.ready.time == Some(column) && !names_a_time(name)).then_some(TimeKind::Calendar)
    }

    fn progress(&self) -> (u64, u64) {
        (self.bytes, 0)
    }

    /// What arrived is not kept, and has no digest.
    fn digest(&mut self) -> Option<Digest> {
        Some(Digest { sha256: String::new(), bytes: self.bytes })
    }
}
