//! Which columns of a file are read, as its header says.

use super::clock_unit::ClockUnit;
use super::compensation::{self, TargetCompensation};
use super::error::hint;
use super::findings::{FindingPlace, Findings};
use super::request::{ColumnSelection, ReadRequest};
use super::scale::ColumnScale;
use super::{DeclaredColumn, Finding, FindingKind as Kind, RecordingColumn, TimeSource, reading};
use crate::units::{ColumnHeader, Unit, UnitError};
use kalmems_formats::{self as formats, Instant, TableDescription, TableEvidence, TimeKind, TimeUnit};
use std::collections::BTreeMap;

/// A column that is being read.
pub(super) struct TargetColumn {
    /// Its position in the header.
    pub(super) index: usize,
    pub(super) header: ColumnHeader,
    pub(super) scale: ColumnScale,
    /// The ends of the range of the instrument in SI, where the settings state it: no value is at them or beyond.
    pub(super) range: Option<(f64, f64)>,
    /// Which of the columns of numbers in a block it is.
    pub(super) slot: usize,
    /// Its values in SI, as far as they are kept; as they were measured.
    pub(super) values: Vec<f64>,
    /// What it is compensated for where it is given away.
    pub(super) compensation: Option<TargetCompensation>,
    /// Of the temperature of other columns: the range of their curves in K.
    pub(super) curve_range: Option<[f64; 2]>,
    /// Whether it is read only because other columns are compensated with it.
    pub(super) is_hidden: bool,
}

impl TargetColumn {
    fn new(index: usize, name: &str, names: &[String]) -> Self {
        Self::of(index, ColumnHeader::parse_among(name, names.iter().map(String::as_str)))
    }

    fn of(index: usize, header: ColumnHeader) -> Self {
        let scale = ColumnScale::of(header.unit);
        Self {
            index,
            scale,
            header,
            range: None,
            slot: 0,
            values: Vec::new(),
            compensation: None,
            curve_range: None,
            is_hidden: false,
        }
    }

    /// A column of the file as the settings say.
    fn declared(
        index: usize,
        names: &[String],
        declared: &DeclaredColumn,
        line: usize,
        findings: &mut Findings,
    ) -> Self {
        let mut target = Self::new(index, names.get(index).map_or("", String::as_str), names);
        let Some(reading) = &declared.reading else { return target };
        let place = FindingPlace { column: Some(index), segment: None, line };
        findings.add(Kind::Stated, place, || reading::words(reading, &target.header));
        if let Some((text, stated)) = &reading.unit
            && target.header.unit.is_some_and(|unit| unit != *stated)
        {
            findings.add(Kind::OtherUnit, place, || {
                format!("the file says `{}` and the settings say `{text}`", target.header.unit_text)
            });
        }
        let applied = reading::apply(reading, &target.header)
            .and_then(|(header, scale)| Ok((reading::range(reading, &header)?, header, scale)));
        if let Some(Err(why)) = &reading.compensation {
            findings.add(Kind::Contradiction, place, || why.clone());
        }
        match applied {
            Ok(applied) => (target.range, target.header, target.scale) = applied,
            Err(why) => findings.add(Kind::Contradiction, place, || why),
        }
        declared.column.clone_into(&mut target.header.column);
        target
    }
}

/// What the header tells.
pub(super) struct ReadingPlan {
    /// The line of the header.
    pub(super) line: usize,
    pub(super) names: Vec<String>,
    /// Whether messages may show cells: not those of a text that may have been meant for something else.
    pub(super) shows_cells: bool,
    pub(super) clock: Option<TargetColumn>,
    /// What the clock counts, and where its times are to count from, where that is not for the file to say.
    pub(super) clock_unit: ClockUnit,
    pub(super) origin: Option<Instant>,
    pub(super) segment_column: Option<usize>,
    pub(super) targets: Vec<TargetColumn>,
}

impl ReadingPlan {
    /// Finds the columns in the header. What cannot be found is a finding, and the rest is read all the same;
    /// an error is a header whose columns cannot even be told.
    pub(super) fn of(
        file: &TableDescription,
        time_kind: &dyn Fn(usize) -> Option<TimeKind>,
        line: usize,
        request: &ReadRequest,
        findings: &mut Findings,
    ) -> Result<Self, Vec<Finding>> {
        let names: Vec<String> = file.columns.iter().map(|column| column.name.trim().to_owned()).collect();
        if names.is_empty() {
            return Err(unreadable(Kind::Empty, line, "the file is empty".to_owned()));
        }
        // Below a date stand dates.
        let is_date =
            |(column, name): (usize, &String)| time_kind(column).is_some() && formats::is_value(name);
        if names.iter().all(|name| formats::is_value(name)) || names.iter().enumerate().any(is_date) {
            let example = formats::example_names(names.len());
            let detail = format!(
                "the first line holds numbers and no names, which `format = {{ kind = \"csv\", columns = {example} }}` would give"
            );
            return Err(unreadable(Kind::NoHeader, line, detail));
        }
        if let [only] = names.as_slice()
            && let Some(separator) = only.chars().find(|c| matches!(c, ';' | '\t' | '|'))
        {
            let detail = format!("the names are separated by {separator:?}");
            return Err(unreadable(Kind::Separator, line, detail));
        }
        let declared = |name: &str, is_clock: bool| {
            request.declared.iter().find(|known| known.column == name && known.is_clock() == is_clock)
        };
        let find = |name: &str, by_name: bool, findings: &mut Findings| {
            let found = find(name, by_name, &names);
            let place = |column| FindingPlace { column, segment: None, line };
            match found.as_slice() {
                [] => findings.add_absent(
                    name,
                    line,
                    format!("there is no such column{}", why_absent(name, &names, file)),
                ),
                [_] => {}
                [first, ..] => findings.add(Kind::DuplicateColumn, place(Some(*first)), || {
                    format!("{} columns have this name", found.len())
                }),
            }
            found.first().copied()
        };
        let of_declared = |known: &DeclaredColumn, findings: &mut Findings| {
            let index = find(&known.column, known.reading.is_some(), findings)?;
            Some(TargetColumn::declared(index, &names, known, line, findings))
        };
        let target = |name: &str, is_clock: bool, findings: &mut Findings| match declared(name, is_clock) {
            Some(known) => of_declared(known, findings),
            None => Some(TargetColumn::new(find(name, false, findings)?, name, &names)),
        };
        let clock = match request.clock {
            TimeSource::Column(name) => target(name, true, findings),
            TimeSource::Rate { .. } => None,
        };
        let segment_column = request.segment_column.and_then(|name| find(name, false, findings));
        let targets: Vec<TargetColumn> = match request.columns {
            ColumnSelection::Named(wanted) => {
                wanted.iter().filter_map(|name| target(name, false, findings)).collect()
            }
            ColumnSelection::AllBut(unwanted) => {
                let taken =
                    |i: usize| clock.as_ref().is_some_and(|c| c.index == i) || segment_column == Some(i);
                let rest =
                    names.iter().enumerate().filter(|(i, name)| !taken(*i) && !unwanted.contains(name));
                let first = |i: usize, name| !names.iter().take(i).any(|other| other == name);
                rest.map(|(i, name)| {
                    // Looked up as well, once for each name, to find those that come twice.
                    if first(i, name) {
                        find(name, false, findings);
                    }
                    TargetColumn::new(i, name, &names)
                })
                .collect()
            }
        };
        let known = |name: &str| declared(name, false);
        let targets = compensation::with_what_compensates(targets, line, known, of_declared, findings);
        let named = matches!(request.columns, ColumnSelection::Named(_));
        let place = |target: &TargetColumn| FindingPlace { column: Some(target.index), segment: None, line };
        for target in targets.iter().filter(|target| target.header.unit.is_none()) {
            let known = declared(&target.header.column, false);
            let needed = named && known.is_none_or(|known| known.usual_unit.is_some());
            let kind = if needed { Kind::UnknownUnit } else { Kind::NoUnit };
            findings.add(kind, place(target), || unit_detail(&target.header.column, known));
        }
        let mut clock_unit = ClockUnit { unit: TimeUnit::SECOND, calendar: false };
        if let Some(clock) = &clock {
            let known = declared(&clock.header.column, true);
            match ClockUnit::of(&clock.header, clock.scale, time_kind(clock.index)) {
                Some(unit) => clock_unit = unit,
                None => findings.add(Kind::TimeUnit, place(clock), || match clock.header.unit {
                    None => unit_detail(&clock.header.column, known),
                    Some(_) => format!("`{}` is no time", clock.header.unit_text),
                }),
            }
        }
        let origin = request.origin;
        let shows_cells = file.evidence != TableEvidence::Nothing;
        let mut plan = Self { line, names, shows_cells, clock, clock_unit, origin, segment_column, targets };
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

    /// The columns that are given away, with values of all columns as they were measured.
    pub(super) fn columns(&self, mut values: Vec<Vec<f64>>) -> Vec<RecordingColumn> {
        compensation::compensate(&self.targets, &mut values);
        let all = self.targets.iter().zip(values).filter(|(target, _)| !target.is_hidden);
        all.map(|(target, values)| RecordingColumn::new(target.header.clone(), values)).collect()
    }

    /// What is to be read.
    pub(super) fn wanted(&self) -> Vec<formats::WantedColumn> {
        let mut wanted = Vec::new();
        wanted.extend(self.clock.iter().map(|clock| formats::WantedColumn::Time {
            column: clock.index,
            unit: self.clock_unit.unit,
            origin: self.origin,
        }));
        for target in &self.targets {
            if target.slot == wanted.len() {
                wanted.push(formats::WantedColumn::Number {
                    column: target.index,
                    power: target.scale.power(),
                });
            }
        }
        wanted.extend(self.segment_column.map(|column| formats::WantedColumn::Label { column }));
        wanted
    }
}

/// The positions of a name. Where `by_name` it may stand there with a unit that the format keeps apart: `cap_V` is `cap`.
fn find(wanted: &str, by_name: bool, names: &[String]) -> Vec<usize> {
    let by_name = by_name && !names.iter().any(|name| name == wanted);
    let is_it = |name: &str| if by_name { without_unit(name) == Some(wanted) } else { name == wanted };
    names.iter().enumerate().filter(|(_, name)| is_it(name)).map(|(index, _)| index).collect()
}

/// A name without the unit that it ends with, where it does.
fn without_unit(name: &str) -> Option<&str> {
    let ColumnHeader { unit_text, .. } = ColumnHeader::parse(name);
    let ending = Some(unit_text.as_str()).filter(|unit| !unit.is_empty())?;
    name.strip_suffix(ending)?.strip_suffix('_')
}

/// Why a file does not have a column, and what there is instead.
fn why_absent(wanted: &str, names: &[String], file: &TableDescription) -> String {
    // Formats that keep units apart leave them out of the name here.
    let is_it = |name: &str| {
        let name = name.rsplit('/').next().unwrap_or(name);
        name == wanted || without_unit(wanted) == Some(name)
    };
    if let Some(left_out) = file.left_out.iter().find(|left_out| is_it(&left_out.name)) {
        return format!(": `{}` of the file is left out ({})", left_out.name, left_out.why);
    }
    let tells_names = match file.evidence {
        TableEvidence::Format | TableEvidence::Arrays => true,
        TableEvidence::Rows => names.len() > 1,
        TableEvidence::Nothing => false,
    };
    if tells_names {
        return format!(" ({})", hint(wanted, names.iter().map(String::as_str)));
    }
    // It may be a file that was not meant, with what is nobody's business.
    " (its first line is no line of names of several columns with numbers below; expected a line such as `time_s,cap_V` and rows of \
     numbers)"
        .to_owned()
}

/// The findings of a file whose columns cannot even be told.
pub(super) fn unreadable(kind: Kind, line: usize, detail: String) -> Vec<Finding> {
    let mut findings = Findings::default();
    findings.add(kind, FindingPlace { column: None, segment: None, line }, || detail);
    findings.list(&[], &[])
}

/// Why a name has no unit, with the unit that was probably meant, and what to write in the settings that name the column.
fn unit_detail(column: &str, known: Option<&DeclaredColumn>) -> String {
    let mut detail = match column.rsplit_once('_').map(|(name, ending)| (name, ending, Unit::parse(ending))) {
        Some((_, "degC", _)) => {
            "degrees Celsius count from another zero than K, so that no factor converts them".to_owned()
        }
        Some((name, ending, Err(UnitError::Unknown { suggestion: Some(unit), .. }))) => {
            format!("`{ending}` is no unit (did you mean `{name}_{unit}`?)")
        }
        Some((_, ending, Err(_))) => format!("`{ending}` is no unit"),
        // As in `x_per_m`, where nothing stands before `per`.
        Some((_, _, Ok(_))) | None => "the name ends with no unit".to_owned(),
    };
    if let Some(way_out) = known.and_then(reading::way_out) {
        detail += &format!(": {way_out}");
    }
    detail
}
