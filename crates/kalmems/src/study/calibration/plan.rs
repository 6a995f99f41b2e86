//! Which runs a calibration has, and what their truth is.

use super::super::axis::{AxisValue, StudyAxis};
use super::super::description::{AppliesTo, StudyDescription};
use super::super::error::RunError;
use super::super::plan::{RunStart, StudyRun};
use super::super::{StudyError, StudyPlan};
use super::device;
use super::prior::{self, DrawnDeviation};
use crate::config::{ConfigError, ConfigFault, Key, Source, read_source};
use crate::estimate::DeviceParameter;
use crate::rigs::Workbench;
use crate::stated_start::{leaves_start_sd_out, write_start_sds};
use std::num::NonZero;
use std::path::Path;
use toml::Table;

/// Runs at each point where neither the file nor the operator says how many.
const RUNS: u64 = 200;

/// The filters of a calibration, by their places in groups that hold the same as uncertain.
#[derive(Clone, Debug)]
pub(in super::super) struct Groups {
    parameters: &'static [DeviceParameter],
    filters: Vec<Vec<usize>>,
}

impl StudyPlan {
    /// Reads a study file, or an experiment file by itself, for a calibration: the truth of each run is drawn from what the
    /// filters hold as uncertain, and from what the study draws. So many runs at each point, or as many as the study has `repeats`;
    /// 200 of an experiment by itself.
    pub fn calibration(
        workbench: &Workbench,
        path: &Path,
        runs: Option<NonZero<u64>>,
    ) -> Result<Self, StudyError> {
        let file = Source::load(path)?;
        let runs = runs.map(NonZero::get);
        if file.text.parse::<Table>().is_ok_and(|table| table.contains_key("device")) {
            let mut study = Table::new();
            study.insert("name".to_owned(), workbench.parse(&file.text, path)?.name.to_string().into());
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            study.insert("experiment".to_owned(), name.into());
            let source = Source::of(&toml::to_string(&study).unwrap_or_default(), path)?;
            return Self::of(workbench, source, file, Some(runs.unwrap_or(RUNS)));
        }
        let experiment = Self::experiment_of(&file, path)?;
        let repeats = read_source::<StudyDescription>(&file)?.repeats;
        Self::of(workbench, file, experiment, Some(runs.unwrap_or(repeats)))
    }

    /// Whether the truth of its runs is drawn from what the filters hold as uncertain.
    pub fn is_calibration(&self) -> bool {
        self.calibration.is_some()
    }

    /// What the results are those of.
    pub(in super::super) fn command(&self) -> &'static str {
        if self.calibration.is_some() { "calibration" } else { "study" }
    }

    /// How many groups of filters there are at each point of the grid.
    pub(in super::super) fn groups_at_a_point(&self) -> u64 {
        self.calibration.as_ref().map_or(1, |groups| groups.filters.len() as u64)
    }

    /// The groups of filters; refused where nothing could be drawn.
    pub(in super::super) fn groups(&self) -> Result<Groups, StudyError> {
        if !self.simulated {
            let why = "a calibration simulates each of its runs; add the table `[simulate]`, such as `kalmems schema` describes";
            return Err(self
                .experiment
                .error_at(Key::from("simulate"), ConfigFault::MissingKey { remedy: why.to_owned() })
                .into());
        }
        let first = self.run(0);
        let settings: Vec<Option<&AxisValue>> = first.settings.iter().map(Some).collect();
        let mut told = self.patched(&[], &settings, AppliesTo::Told, None)?;
        let read = self.read(&told)?;
        let parameters = self.workbench.rig(&read)?.parameters(&read);
        write_start_sds(&mut told, &read, parameters)?;
        let refused = |(key, fault)| self.experiment.error_at(key, fault);
        let filters = prior::groups(&told, parameters).map_err(refused)?;
        for direction in read.directions()? {
            for (number, _) in &direction.steps {
                self.refuse_twice(&number.key)?;
            }
        }
        for group in &filters {
            let Some(filter) = group.first() else { continue };
            let priors = prior::priors(&told, parameters, *filter).map_err(refused)?;
            for prior in priors {
                for key in prior.keys(&told, parameters) {
                    self.refuse_twice(&key)?;
                }
                // What cannot be drawn once can never be.
                prior.draw((&mut told.clone(), &told), parameters, (0, 0)).map_err(refused)?;
            }
        }
        Ok(Groups { parameters, filters })
    }

    /// A key whose truth follows from a filter's prior may not be set by the study as well.
    fn refuse_twice(&self, key: &Key) -> Result<(), ConfigError> {
        let why = || ConfigFault::Value {
            why: format!(
                "the truth of `{key}` is drawn, from its uncertainty in the device's table or from the `start_sd` of the state that a filter \
                 has for it; leave it out here, or there"
            ),
        };
        if self.truth.iter().any(|(own, _)| own == key) {
            return Err(self.refuse(Key::from("truth").child(&key.to_string()), why()));
        }
        let varied = |axis: &StudyAxis| axis.applies_to == AppliesTo::Truth && axis.key == *key;
        match self.axes.iter().position(varied) {
            Some(place) => Err(self.refuse(Key::from("vary").index(place).child("key"), why())),
            None => Ok(()),
        }
    }

    /// What a run starts from, and what was drawn for it.
    pub(in super::super) fn ready_drawn(
        &self,
        groups: &Groups,
        run: &StudyRun,
        settings: &[Option<&AxisValue>],
    ) -> Result<(RunStart, Vec<DrawnDeviation>), RunError> {
        let mut told = self.patched(&[], settings, AppliesTo::Told, None)?;
        if leaves_start_sd_out(&mut told) {
            let read = self.read(&told)?;
            write_start_sds(&mut told, &read, groups.parameters)?;
        }
        let mut truth = self.patched(&self.truth, settings, AppliesTo::Truth, Some(run.seed))?;
        let refused = |(key, fault)| self.experiment.error_at(key, fault);
        let group = usize::try_from(run.point % self.groups_at_a_point()).unwrap_or(0);
        let filters = groups.filters.get(group).map_or(&[][..], Vec::as_slice);
        let mut priors = Vec::new();
        for (place, filter) in filters.iter().enumerate() {
            let own = prior::priors(&told, groups.parameters, *filter).map_err(refused)?;
            if place > 0 && own != priors {
                let why = "what the study varies of this filter makes it hold something else as uncertain than the filters that it was drawn \
                           with; vary it of all of them";
                let key = Key::from("estimate.filter").index(*filter).child("states");
                return Err(self.experiment.error_at(key, ConfigFault::Value { why: why.to_owned() }).into());
            }
            priors = own;
        }
        let tracked: Vec<Key> =
            priors.iter().flat_map(|prior| prior.keys(&told, groups.parameters)).collect();
        let seed = (self.description.seed, run.index);
        let directions = self.read(&told)?.directions()?;
        let mut drawn = device::draw(&mut truth, &directions, &tracked, seed).map_err(refused)?;
        for prior in priors {
            drawn.extend(prior.draw((&mut truth, &told), groups.parameters, seed).map_err(refused)?);
        }
        prior::only(&mut told, filters);
        let ready = self.simulation(&self.read(&truth)?, &self.read(&told)?)?;
        Ok((ready, drawn))
    }
}
