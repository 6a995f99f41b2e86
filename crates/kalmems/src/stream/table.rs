//! Samples that arrive, as a table.

use super::decode::{Damage, Decoder, Sample};
use super::latency::Arrivals;
use super::order::{Order, OrderCounts};
use super::state::State;
use crate::config::StreamFormat;
use crate::recording::names_a_time;
use kalmems_formats::{
    Block, CellFault, Column, Description, Digest, Fault, FormatError, Instant, Table, TimeKind, TimeReader,
    Wanted,
};
use std::collections::VecDeque;
use std::io::{ErrorKind, Read};
use std::sync::{Arc, Mutex, PoisonError};

/// Bytes that are read at once at most.
const PIECE: usize = 1 << 16;

/// What has been counted on the way, as the reading thread has it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct WayCounts {
    /// What the way has made of the samples.
    #[serde(flatten)]
    pub order: OrderCounts,
    /// Lines that are no samples.
    pub damaged_lines: u64,
    /// Bytes between frames.
    pub damaged_bytes: u64,
    /// Samples that an earlier run had acknowledged.
    pub passed_over: u64,
}

/// The counts, for both threads.
#[derive(Clone, Debug, Default)]
pub struct SharedCounts(Arc<Mutex<WayCounts>>);

impl SharedCounts {
    /// As they are now.
    pub fn now(&self) -> WayCounts {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self, order: OrderCounts, damage: Damage, passed_over: u64) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) =
            WayCounts { order, damaged_lines: damage.lines, damaged_bytes: damage.bytes, passed_over };
    }
}

/// A table whose rows are the samples of an input in order; a block holds what has arrived.
pub struct LiveTable {
    input: Box<dyn Read + Send>,
    piece: Box<[u8]>,
    description: Description,
    format: StreamFormat,
    decoder: Decoder,
    order: Order,
    /// Which of the numbers each column of a block is.
    wanted: Vec<usize>,
    ready: VecDeque<Sample>,
    arrivals: Arrivals,
    counts: SharedCounts,
    rows: u64,
    bytes: u64,
    ended: bool,
    /// The place of the time among the numbers, and until when samples were taken by another run.
    taken: Option<(usize, f64)>,
    time: Option<usize>,
    /// Where the times count from, where another run has said it.
    origin: Option<Instant>,
    interval_s: f64,
    /// Samples that another run took.
    passed_over: u64,
}

impl LiveTable {
    /// The samples of this input. `wait` is for how many later samples one is waited for; the column of the time, by its
    /// place, tells samples apart whose frames do not count, `interval_s` apart.
    pub fn new(
        input: Box<dyn Read + Send>,
        format: &StreamFormat,
        (wait, time, interval_s): (usize, Option<usize>, f64),
        (arrivals, counts): (Arrivals, SharedCounts),
    ) -> Self {
        let names = format.columns();
        let what = match format {
            StreamFormat::Text { .. } => "lines of numbers separated by commas",
            StreamFormat::Frames { .. } => "frames",
        };
        Self {
            input,
            piece: vec![0; PIECE].into_boxed_slice(),
            description: Description {
                format: "stream",
                recognised: format!("{what}, as the experiment says"),
                columns: names.iter().map(|name| Column::new(name)).collect(),
                rows: None,
            },
            decoder: Decoder::new(format, &vec![0; names.len()]),
            format: format.clone(),
            order: Order::new(wait, format.sequence_bits(), time.map(|time| (time, interval_s))),
            wanted: Vec::new(),
            ready: VecDeque::new(),
            arrivals,
            counts,
            rows: 0,
            bytes: 0,
            ended: false,
            taken: None,
            time,
            origin: None,
            interval_s,
            passed_over: 0,
        }
    }

    /// Begins with the samples that another run left, and passes over those that it took.
    pub(super) fn go_on(&mut self, left: &State) {
        let names: Vec<String> = self.description.columns.iter().map(|column| column.name.clone()).collect();
        self.ready.extend(left.samples(&names));
        self.origin = Some(left.origin());
        self.taken = self.time.map(|time| (time, left.acknowledged_s()));
    }

    /// Waits for bytes, and takes them.
    fn receive(&mut self) -> Result<(), FormatError> {
        let count = match self.input.read(&mut self.piece) {
            Ok(count) => count,
            Err(e) if e.kind() == ErrorKind::Interrupted => return Ok(()),
            // A connection that breaks is an end of the input like others.
            Err(e) if matches!(e.kind(), ErrorKind::ConnectionReset | ErrorKind::BrokenPipe) => 0,
            Err(e) => return Err(e.into()),
        };
        let (order, ready) = (&mut self.order, &mut self.ready);
        let (taken, half, passed_over) = (self.taken, 0.5 * self.interval_s, &mut self.passed_over);
        let mut each = |sample: Sample| {
            let time_s = |place: usize| sample.numbers.get(place).copied().unwrap_or(f64::NAN);
            if taken.is_some_and(|(place, until_s)| time_s(place) < until_s + half) {
                *passed_over += 1;
            } else {
                order.take(sample, &mut |sample| ready.push_back(sample));
            }
        };
        if count == 0 {
            self.decoder.finish(&mut each);
            order.finish(&mut |sample| ready.push_back(sample));
            self.ended = true;
        } else {
            self.decoder.take(&self.piece[..count], &mut each);
            self.bytes += count as u64;
        }
        self.counts.tell(self.order.counts(), self.decoder.damage(), self.passed_over);
        self.arrivals.tell(self.rows + self.ready.len() as u64);
        Ok(())
    }
}

impl Table for LiveTable {
    fn description(&self) -> &Description {
        &self.description
    }

    fn want(&mut self, wanted: &[Wanted]) -> Result<(), FormatError> {
        let mut powers = vec![0; self.description.columns.len()];
        self.wanted.clear();
        for wanted in wanted {
            match *wanted {
                Wanted::Number { column, power } => {
                    self.wanted.push(column);
                    if let Some(own) = powers.get_mut(column) {
                        *own = power;
                    }
                }
                Wanted::Time { column, .. } => self.wanted.push(column),
                Wanted::Label { .. } => {
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
        if let Some((column, unit, origin)) = Wanted::time(wanted, self.description.format)? {
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
        while self.ready.is_empty() && !self.ended {
            self.receive()?;
        }
        block.lines.push((0, self.rows + 1));
        while block.rows < block.capacity {
            let Some(sample) = self.ready.pop_front() else { break };
            for (i, column) in self.wanted.iter().enumerate() {
                let number = sample.numbers.get(*column).copied().unwrap_or(f64::NAN);
                block.numbers[i].push(number);
                if !number.is_finite() {
                    let (row, line) = (block.rows, self.rows + 1);
                    let fault = CellFault { row, line, column: Some(*column), fault: Fault::Missing };
                    block.faults.push(fault);
                }
            }
            block.rows += 1;
            self.rows += 1;
        }
        if let Some(times) = self.decoder.times() {
            block.tell_times(times);
        }
        Ok(())
    }

    /// Where the name of the clock says no unit, lines hold dates and times as text.
    fn time_kind(&self, column: usize) -> Option<TimeKind> {
        let name = &self.description.columns.get(column)?.name;
        let text = matches!(self.format, StreamFormat::Text { .. });
        (text && self.time == Some(column) && !names_a_time(name)).then_some(TimeKind::Calendar)
    }

    fn progress(&self) -> (u64, u64) {
        (self.bytes, 0)
    }

    /// What arrived is not kept, and has no digest.
    fn digest(&mut self) -> Option<Digest> {
        Some(Digest { sha256: String::new(), bytes: self.bytes })
    }
}
