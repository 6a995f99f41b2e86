//! Which columns of a file are read, as its header says.

use super::clock_unit::ClockUnit;
use super::error::hint;
use super::findings::{Findings, Place};
use super::request::{Request, Wanted};
use super::scale::Scale;
use super::{Clock, Finding, FindingKind as Kind};
use crate::units::{Header, Unit, UnitError};
use kalmems_formats::{self as formats, Instant, TimeKind, TimeUnit};
use std::collections::BTreeMap;

/// A column that is being read.
pub(super) struct Target {
    /// Its position in the header.
    pub(super) index: usize,
    pub(super) header: Header,
    pub(super) scale: Scale,
    /// Which of the columns of numbers in a block it is.
    pub(super) slot: usize,
    /// Its values in SI, as far as they are kept.
    pub(super) values: Vec<f64>,
}

impl Target {
    fn new(index: usize, name: &str) -> Self {
        let header = Header::parse(name);
        Self { index, scale: Scale::of(header.unit), header, slot: 0, values: Vec::new() }
    }
}

/// What the header tells.
pub(super) struct Plan {
    /// The line of the header.
    pub(super) line: usize,
    pub(super) names: Vec<String>,
    pub(super) clock: Option<Target>,
    /// What the clock counts, and where its times are to count from, where that is not for the file to say.
    pub(super) clock_unit: ClockUnit,
    pub(super) origin: Option<Instant>,
    pub(super) segment_column: Option<usize>,
    pub(super) targets: Vec<Target>,
}

impl Plan {
    /// Finds the columns in the header. What cannot be found is a finding, and the rest is read all the same;
    /// an error is a header whose columns cannot even be told.
    pub(super) fn of(
        names: &[String],
        time_kind: &dyn Fn(usize) -> Option<TimeKind>,
        line: usize,
        request: &Request,
        findings: &mut Findings,
    ) -> Result<Self, Vec<Finding>> {
        let names: Vec<String> = names.iter().map(|name| name.trim().to_owned()).collect();
        if names.is_empty() {
            return Err(unreadable(Kind::Empty, line, "the file is empty".to_owned()));
        }
        if names.iter().all(|name| fast_float2::parse::<f64, _>(name).is_ok()) {
            return Err(unreadable(Kind::NoHeader, line, "the first line holds numbers".to_owned()));
        }
        if let [only] = names.as_slice()
            && let Some(separator) = only.chars().find(|c| matches!(c, ';' | '\t' | '|'))
        {
            let detail = format!("the names are separated by {separator:?}");
            return Err(unreadable(Kind::Separator, line, detail));
        }
        let mut find = |name: &str| find(name, &names, line, findings);
        let clock = match request.clock {
            Clock::Column(name) => find(name).map(|index| Target::new(index, name)),
            Clock::Rate { .. } => None,
        };
        let segment_column = request.segment_column.and_then(&mut find);
        let targets: Vec<Target> = match request.columns {
            Wanted::Named(wanted) => {
                wanted.iter().filter_map(|name| Some(Target::new(find(name)?, name))).collect()
            }
            Wanted::AllBut(unwanted) => {
                let taken =
                    |i: usize| clock.as_ref().is_some_and(|c| c.index == i) || segment_column == Some(i);
                let rest =
                    names.iter().enumerate().filter(|(i, name)| !taken(*i) && !unwanted.contains(name));
                let first = |i: usize, name| !names.iter().take(i).any(|other| other == name);
                rest.map(|(i, name)| {
                    // Looked up as well, once for each name, to find those that come twice.
                    if first(i, name) {
                        find(name);
                    }
                    Target::new(i, name)
                })
                .collect()
            }
        };
        let named = matches!(request.columns, Wanted::Named(_));
        let place = |target: &Target| Place { column: Some(target.index), segment: None, line };
        for target in targets.iter().filter(|target| target.header.unit.is_none()) {
            let kind = if named { Kind::UnknownUnit } else { Kind::NoUnit };
            findings.add(kind, place(target), || unit_detail(&target.header.column));
        }
        let mut clock_unit = ClockUnit { unit: TimeUnit::SECOND, calendar: false };
        if let Some(clock) = &clock {
            match ClockUnit::of(&clock.header, time_kind(clock.index)) {
                Some(unit) => clock_unit = unit,
                None => findings.add(Kind::TimeUnit, place(clock), || match clock.header.unit {
                    None => unit_detail(&clock.header.column),
                    Some(_) => format!("`{}` is no time", clock.header.unit_text),
                }),
            }
        }
        let origin = request.origin;
        let mut plan = Self { line, names, clock, clock_unit, origin, segment_column, targets };
        plan.number();
        Ok(plan)
    }

    /// Gives each column a slot of the blocks; one that is wanted twice is read once.
    fn number(&mut self) {
        let mut slots = BTreeMap::new();
        for target in self.clock.iter_mut().chain(&mut self.targets) {
            let next = slots.len();
            target.slot = *slots.entry(target.index).or_insert(next);
        }
    }

    /// What is to be read.
    pub(super) fn wanted(&self) -> Vec<formats::Wanted> {
        let mut wanted = Vec::new();
        wanted.extend(self.clock.iter().map(|clock| formats::Wanted::Time {
            column: clock.index,
            unit: self.clock_unit.unit,
            origin: self.origin,
        }));
        for target in &self.targets {
            if target.slot == wanted.len() {
                wanted.push(formats::Wanted::Number { column: target.index, power: target.scale.power() });
            }
        }
        wanted.extend(self.segment_column.map(|column| formats::Wanted::Label { column }));
        wanted
    }
}

/// The position of a name, the first where it comes twice.
fn find(wanted: &str, names: &[String], line: usize, findings: &mut Findings) -> Option<usize> {
    let mut places = names.iter().enumerate().filter(|(_, name)| *name == wanted).map(|(i, _)| i);
    let Some(index) = places.next() else {
        let near = hint(wanted, names.iter().map(String::as_str));
        findings.add_absent(wanted, line, format!("there is no such column ({near})"));
        return None;
    };
    let others = places.count();
    if others > 0 {
        findings.add(Kind::DuplicateColumn, Place { column: Some(index), segment: None, line }, || {
            format!("{} columns have this name", others + 1)
        });
    }
    Some(index)
}

/// The findings of a file whose columns cannot even be told.
pub(super) fn unreadable(kind: Kind, line: usize, detail: String) -> Vec<Finding> {
    let mut findings = Findings::default();
    findings.add(kind, Place { column: None, segment: None, line }, || detail);
    findings.list(&[], &[])
}

/// Why a name has no unit, with the unit that was probably meant.
fn unit_detail(column: &str) -> String {
    let Some((name, ending)) = column.rsplit_once('_') else {
        return "the name ends with no unit".to_owned();
    };
    match Unit::parse(ending) {
        Err(UnitError::Unknown { suggestion: Some(unit), .. }) => {
            format!("`{ending}` is no unit (did you mean `{name}_{unit}`?)")
        }
        Err(_) => format!("`{ending}` is no unit"),
        // As in `wavenumber_per_m`, where nothing stands before `per`.
        Ok(_) => "the name ends with no unit".to_owned(),
    }
}
