//! The spectrum file: interferograms, and where the mirror was.

use crate::ApplicationFile;
use crate::config::FileColumns;
use crate::config::FileFormat;
use crate::config::Quantity;
use crate::config::Source;
use crate::config::kinds::{Angle, Frequency, Length, Ratio, Time, Wavenumber};
use crate::config::{Clock, ColumnChoice, ConfigError, ConfigFault, Key, Name};
use crate::config::{NotNegative, Positive};
use crate::recording::RecordingLayout;
use crate::spectrum::Apodisation;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What a spectrum is computed from, as one TOML file says.
///
/// Two are equal if they say the same, whatever file they came from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["interferogram"] }, { "required": ["light"] }]))]
pub struct SpectrumFile {
    /// A name; results go to a folder of this name unless another is given.
    pub name: Name,
    /// What the spectrum is of, in free text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// The experiment file of the position's estimate, relative to the folder of this file: a recalibration is then told
    /// as what to write there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub experiment: Option<PathBuf>,
    /// The recorded interferograms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interferogram: Option<Interferogram>,
    /// In their place: a light whose interferograms are simulated along a known motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light: Option<Light>,
    /// How the path difference of each sample is known.
    pub path: PathDifference,
    /// How a spectrum is made of them.
    pub transform: SpectrumTransform,
    /// Lines whose places and heights are wanted.
    #[serde(rename = "line", default, skip_serializing_if = "Vec::is_empty")]
    pub lines: Vec<SpectrumLine>,
    /// How well the path is known, for the budget of the wavenumbers' errors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub errors: Option<PathErrors>,
    /// What the spectrum should be. Only the comparison reads it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<SpectrumReference>,
    #[serde(skip)]
    source: Source,
}

/// Recorded interferograms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Interferogram {
    /// The file, relative to the folder of the spectrum file.
    #[schemars(example = &"interferogram.csv")]
    pub file: PathBuf,
    /// How the file is written, where that cannot be told from it: `{ kind = "csv", separator = ";", decimal = "," }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// The columns of the detector, whose numbers need no unit. With a known step each is one scan; along a trajectory each is cut into scans.
    #[schemars(length(min = 1), example = vec!["detector_1"])]
    pub columns: Vec<ColumnChoice>,
    /// When the samples were taken, on the clock of the trajectory; not needed where the step is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock: Option<Clock>,
}

/// How the path difference is known.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[allow(clippy::large_enum_variant)] // there are a few of them in a description, and none in a loop
pub enum PathDifference {
    /// It grows by this much from one sample to the next.
    Step(Quantity<Length, Positive>),
    /// Samples are taken at the fringes of a reference laser.
    Laser(ReferenceLaser),
    /// It follows from the position of the mirror over time.
    Trajectory(PathTrajectory),
}

/// A laser whose fringes say when to sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReferenceLaser {
    /// Its wavenumber in the medium of the path.
    pub wavenumber: Quantity<Wavenumber, Positive>,
    /// Samples per fringe: 2 at both zero crossings.
    pub samples_per_fringe: Quantity<Ratio, Positive>,
}

/// The position of the mirror over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PathTrajectory {
    /// The file, such as a `trajectory_ekf.csv` of `kalmems estimate`; relative to the folder of the spectrum file.
    #[schemars(example = &"trajectory_ekf.csv")]
    pub file: PathBuf,
    /// How the file is written, where that cannot be told from it: `{ kind = "csv", separator = ";", decimal = "," }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// When its samples were taken.
    pub clock: Clock,
    /// The column of the position.
    #[schemars(example = &"position_m")]
    pub column: ColumnChoice,
    /// By how much the path changes for each unit of the position; 2 if left out, for a mirror that sends the light back.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path_per_position: Option<Quantity<Ratio, Positive>>,
    /// How much later than the motion the detector shows it, beyond what the trajectory's clock shows; 0 s if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay: Option<Quantity<Time>>,
}

/// From interferograms to a spectrum.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpectrumTransform {
    /// How samples at unequal path differences are transformed; `weighted` if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub method: Option<TransformMethod>,
    /// How an interferogram is brought to an end.
    pub apodisation: Apodisation,
    /// What is done about its phase.
    pub phase: PhaseCorrection,
    /// The largest path difference that is used; as far as all scans reach if left out, where the step is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub largest_path_difference: Option<Quantity<Length, Positive>>,
    /// The path difference on the short side, of an interferogram along a trajectory with Mertz's correction; as on the
    /// long one if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub short_path_difference: Option<Quantity<Length, Positive>>,
    /// How many values for each one that the path difference resolves, 1 to 64; 8 if left out.
    #[schemars(range(min = 1, max = 64))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zero_filling: Option<u32>,
    /// The wavenumbers that are wanted; all if left out, where a fast transform gives them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub band: Option<WavenumberBand>,
    /// The position of the mirror at which the path difference is 0; searched if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zero_path: Option<Quantity<Length>>,
    /// Which scans are used; `both` if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub directions: Option<Directions>,
    /// Whether scans are laid over each other before they are added; `common` if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub registration: Option<Registration>,
}

/// How samples at unequal path differences become a spectrum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TransformMethod {
    /// A sum over the samples as they are, each with its share of the path.
    #[default]
    Weighted,
    /// Interpolated to equal path differences, then a fast transform.
    Resampled,
}

/// What is done about the phase of an interferogram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PhaseCorrection {
    /// It is symmetric: the real part at the zero path.
    None,
    /// The magnitude, which needs no phase; noise does not average out in it.
    Power,
    /// Mertz's correction by the phase of the double-sided part.
    Mertz,
}

/// Which way the mirror goes in the scans that are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Directions {
    /// Either.
    #[default]
    Both,
    /// Positions grow.
    Forward,
    /// Positions fall.
    Backward,
}

/// How scans are laid over each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Registration {
    /// All have one zero path.
    #[default]
    Common,
    /// Each has its own, where it fits the others best.
    Each,
}

/// Wavenumbers from one to another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WavenumberBand {
    /// The lowest.
    pub from: Quantity<Wavenumber, NotNegative>,
    /// The highest.
    pub to: Quantity<Wavenumber, Positive>,
}

/// A line whose place and height are wanted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpectrumLine {
    /// Where it is looked for.
    pub wavenumber: Quantity<Wavenumber, Positive>,
    /// How far from there; as far as the path difference resolves if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub within: Option<Quantity<Wavenumber, Positive>>,
    /// Whether it is a dip; `false` if left out.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub absorption: bool,
    /// Where it really is, such as a laser's wavenumber: the positions are then recalibrated by it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub known: Option<Quantity<Wavenumber, Positive>>,
    /// The standard deviation of that; 0 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub known_sd: Option<Quantity<Wavenumber, NotNegative>>,
}

/// How well the path is known. What is left out counts as known exactly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PathErrors {
    /// The standard deviation of positions, as of errors that are independent from sample to sample.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_sd: Option<Quantity<Length, NotNegative>>,
    /// The relative standard deviation of the scale of positions: of a gain, an amplitude, a laser's wavenumber.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale_sd: Option<Quantity<Ratio, NotNegative>>,
    /// The standard deviation of the delay.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_sd: Option<Quantity<Time, NotNegative>>,
    /// How far the detector's clock may be too fast or slow, relative; both start together.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock_skew: Option<Quantity<Ratio, NotNegative>>,
    /// Half the angle of the cone that the light fills in the interferometer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_angle: Option<Quantity<Angle, NotNegative>>,
}

/// What a spectrum should be: exactly one of `trajectory` and `spectrum`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpectrumReference {
    /// The wavenumbers that are compared; all if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub band: Option<WavenumberBand>,
    /// The true positions: the spectrum along them is the ideal one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trajectory: Option<PathTrajectory>,
    /// A spectrum by another instrument or program, compared after one common scale.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spectrum: Option<ReferenceSpectrum>,
}

/// A spectrum in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReferenceSpectrum {
    /// The file, relative to the folder of the spectrum file.
    #[schemars(example = &"single_channel.csv")]
    pub file: PathBuf,
    /// How the file is written, where that cannot be told from it: `{ kind = "csv", separator = ";", decimal = "," }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// The column of the wavenumbers: `wavenumber_per_m` or `wavenumber_per_cm`, or one of any name with its unit,
    /// `{ column = "nu", unit = "1/cm" }`.
    #[schemars(example = &"wavenumber_per_m")]
    pub wavenumber: ColumnChoice,
    /// The column of the values, whose numbers need no unit.
    #[schemars(example = &"single_channel_1")]
    pub column: ColumnChoice,
}

/// A light, and a detector instead of a recorded one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// The true motion of the mirror.
    pub trajectory: PathTrajectory,
    /// The position at which the path difference is 0.
    pub zero_path: Quantity<Length>,
    /// Lines and bands, at least one.
    #[schemars(length(min = 1))]
    pub sources: Vec<LightSource>,
    /// Samples of the detector per second.
    pub rate: Quantity<Frequency, Positive>,
    /// When the detector begins; with the trajectory if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<Quantity<Time>>,
    /// When it samples; throughout if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bursts: Option<DetectorBursts>,
    /// The standard deviation of the detector's white noise, in the unit of the heights; 0 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<Quantity<Ratio, NotNegative>>,
    /// The seed of that noise; 1 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u32>,
    /// How much faster the detector's clock is than that of the trajectory, relative; both start together; 0 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock_skew: Option<Quantity<Ratio>>,
    /// The corner frequency of a low-pass stage of first order before the sampling; none if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub low_pass: Option<Quantity<Frequency, Positive>>,
}

/// A line, or a band of Gaussian shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightSource {
    /// Its middle.
    pub wavenumber: Quantity<Wavenumber, Positive>,
    /// What it adds to the interferogram at the zero path.
    pub height: Quantity<Ratio>,
    /// Half its width where it has fallen to 1/e; a line without width if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub width: Option<Quantity<Wavenumber, Positive>>,
}

/// When a detector samples that does not sample always.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DetectorBursts {
    /// How long each lasts.
    pub duration: Quantity<Time, Positive>,
    /// From the beginning of one to that of the next.
    pub period: Quantity<Time, Positive>,
    /// How many there are.
    pub count: u32,
}

/// Values for each resolved one.
const ZERO_FILLING: std::ops::RangeInclusive<u32> = 1..=64;

impl ApplicationFile for SpectrumFile {
    const TITLE: &'static str = "A kalmems spectrum";

    fn with_source(self, source: Source) -> Self {
        Self { source, ..self }
    }

    fn check(&self) -> Result<(), ConfigError> {
        self.check_keys().map_err(|(key, why)| self.error(key, ConfigFault::Value { why }))
    }
}

impl SpectrumFile {
    /// What no single key can be blamed for.
    fn check_keys(&self) -> Result<(), (Key, String)> {
        let along = matches!(self.path, PathDifference::Trajectory(_));
        match (&self.interferogram, &self.light) {
            (Some(_), Some(_)) => refuse("light", "found `interferogram` as well; expected one of the two")?,
            (None, None) => refuse("interferogram", "is missing; expected `[interferogram]`, or `[light]`")?,
            (Some(interferogram), None) => {
                if interferogram.columns.is_empty() {
                    refuse(
                        "interferogram.columns",
                        "found none; expected at least one, such as `[\"detector_1\"]`",
                    )?;
                }
                if along && interferogram.clock.is_none() {
                    refuse(
                        "interferogram.clock",
                        "is missing; a path from a trajectory needs the samples' times",
                    )?;
                }
            }
            (None, Some(light)) => {
                if !along {
                    refuse("path", "found no trajectory; a simulated light is seen along one")?;
                }
                if light.sources.is_empty() {
                    refuse("light.sources", "found none; expected at least one line or band")?;
                }
            }
        }
        let transform = &self.transform;
        if let Some(found) = transform.zero_filling.filter(|n| !ZERO_FILLING.contains(n)) {
            refuse("transform.zero_filling", &format!("found {found}; expected 1 to 64"))?;
        }
        let weighted = along && transform.method.unwrap_or_default() == TransformMethod::Weighted;
        let of_a_trajectory = "has no meaning where the step is known and there is no trajectory; remove it";
        let wrong = [
            (
                along && transform.largest_path_difference.is_none(),
                "transform.largest_path_difference",
                "is missing; along a trajectory it says what a scan is, such as `\"0.95 mm\"`",
            ),
            (
                weighted && transform.phase == PhaseCorrection::Mertz,
                "transform.phase",
                "Mertz's correction needs equal steps; write `method = \"resampled\"`",
            ),
            (
                weighted && transform.band.is_none(),
                "transform.band",
                "is missing; expected one such as `{ from = \"1500 1/cm\", to = \"2100 1/cm\" }`",
            ),
            (!along && transform.method.is_some(), "transform.method", of_a_trajectory),
            (!along && transform.zero_path.is_some(), "transform.zero_path", of_a_trajectory),
            (!along && transform.directions.is_some(), "transform.directions", of_a_trajectory),
            (
                !along && transform.short_path_difference.is_some(),
                "transform.short_path_difference",
                of_a_trajectory,
            ),
        ];
        if let Some((_, key, why)) = wrong.into_iter().find(|(is_wrong, ..)| *is_wrong) {
            refuse(key, why)?;
        }
        let reference = self.reference.as_ref();
        if let Some(reference) = reference {
            match (&reference.trajectory, &reference.spectrum) {
                (Some(_), Some(_)) | (None, None) => {
                    refuse("reference", "expected exactly one of `trajectory` and `spectrum`")?;
                }
                (Some(_), None) if !along => {
                    refuse("reference.trajectory", "the path is none of a trajectory")?;
                }
                _ => {}
            }
        }
        self.check_bands()?;
        self.check_files()
    }

    /// Bands begin below where they end.
    fn check_bands(&self) -> Result<(), (Key, String)> {
        let reference = self.reference.as_ref();
        let bands = [("transform.band", self.transform.band.as_ref())];
        let bands = bands.into_iter().chain([("reference.band", reference.and_then(|r| r.band.as_ref()))]);
        for (key, band) in bands.filter_map(|(key, band)| Some((key, band?))) {
            if band.from.si() >= band.to.si() {
                refuse(key, &format!("`{}` is not below `{}`", band.from.text(), band.to.text()))?;
            }
        }
        Ok(())
    }

    /// What is said of the columns of each file goes together.
    fn check_files(&self) -> Result<(), (Key, String)> {
        let reference = self.reference.as_ref();
        let path = match &self.path {
            PathDifference::Trajectory(trajectory) => Some(trajectory.in_file()),
            PathDifference::Step(_) | PathDifference::Laser(_) => None,
        };
        let spectrum = reference.and_then(|reference| reference.spectrum.as_ref());
        let truth = reference.and_then(|reference| reference.trajectory.as_ref());
        for (key, file) in [
            ("interferogram", self.interferogram.as_ref().map(Interferogram::in_file)),
            ("path.trajectory", path),
            ("light.trajectory", self.light.as_ref().map(|light| light.trajectory.in_file())),
            ("reference.trajectory", truth.map(PathTrajectory::in_file)),
            ("reference.spectrum", spectrum.map(ReferenceSpectrum::in_file)),
        ] {
            if let Some(Err((_, why))) = file.map(|file| file.check()) {
                refuse(key, &why)?;
            }
        }
        Ok(())
    }

    /// A file that it names: relative to its own folder.
    pub fn resolve(&self, file: &Path) -> PathBuf {
        self.source.path.parent().unwrap_or(Path::new("")).join(file)
    }

    /// The files that a run reads because of it, itself among them; see [`Source::files`].
    pub fn files(&self) -> Vec<PathBuf> {
        self.source.files()
    }

    /// An error at a key, with its line.
    pub fn error(&self, key: impl Into<Key>, fault: ConfigFault) -> ConfigError {
        self.source.error_at(key.into(), fault)
    }
}

fn refuse(key: &str, why: &str) -> Result<(), (Key, String)> {
    Err((Key::from(key), why.to_owned()))
}

impl PathTrajectory {
    /// How to read its file.
    pub fn layout(&self) -> RecordingLayout {
        self.in_file().layout(None)
    }

    fn in_file(&self) -> FileColumns<'_> {
        let columns = vec![("column", &self.column, Some("m"))];
        FileColumns::new(self.format.as_ref(), &self.clock, columns)
    }

    /// By how much the path changes for each unit of the position.
    pub fn path_per_position(&self) -> f64 {
        self.path_per_position.as_ref().map_or(2.0, Quantity::si)
    }

    /// How much later than the motion the detector shows it, in s.
    pub fn delay_s(&self) -> f64 {
        self.delay.as_ref().map_or(0.0, Quantity::si)
    }
}

impl Interferogram {
    /// How to read its columns; without a clock samples count as one per second.
    pub fn layout(&self) -> RecordingLayout {
        self.in_file().layout(None)
    }

    fn in_file(&self) -> FileColumns<'_> {
        let columns = self.columns.iter().map(|column| ("columns", column, None)).collect();
        FileColumns { format: self.format.as_ref(), clock: self.clock.as_ref(), columns, segments: None }
    }
}

impl ReferenceSpectrum {
    /// How to read its columns.
    pub fn layout(&self) -> RecordingLayout {
        self.in_file().layout(None)
    }

    fn in_file(&self) -> FileColumns<'_> {
        let columns = vec![("wavenumber", &self.wavenumber, Some("1/cm")), ("column", &self.column, None)];
        FileColumns { format: self.format.as_ref(), columns, ..FileColumns::default() }
    }
}

impl WavenumberBand {
    /// Lowest and highest in 1/m.
    pub fn per_m(&self) -> [f64; 2] {
        [self.from.si(), self.to.si()]
    }
}
