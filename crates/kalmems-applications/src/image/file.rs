//! The image file: intensities and the trajectories along which they were taken.

use crate::ApplicationFile;
use crate::config::FileColumns;
use crate::config::FileFormat;
use crate::config::Positive;
use crate::config::Quantity;
use crate::config::Source;
use crate::config::kinds::Angle;
use crate::config::{Clock, ColumnChoice, ConfigError, ConfigFault, Key, Name};
use crate::recording::RecordingLayout;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What an image is put together from, as one TOML file says; none of it needs to know the device.
///
/// Two are equal if they say the same, whatever file they came from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Image {
    /// A name; results go to a folder of this name unless another is given.
    pub name: Name,
    /// What the image shows, in free text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// How the picture for the eye fills empty pixels; they stay empty if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fill: Option<Fill>,
    /// The intensities.
    pub intensity: Intensity,
    /// The axis to the right.
    pub x: ImageAxis,
    /// The axis downwards; without it, one line is scanned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub y: Option<ImageAxis>,
    #[serde(skip)]
    source: Source,
}

/// How empty pixels are filled in the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fill {
    /// With the mean of those of their eight neighbours that have samples.
    Neighbours,
}

/// The recording of the intensities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Intensity {
    /// The file, relative to the folder of the image file.
    #[schemars(example = &"intensity.csv")]
    pub file: PathBuf,
    /// How the file is written, where that cannot be told from it: `{ kind = "csv", separator = ";", decimal = "," }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// When the samples were taken, on the clock of the trajectories; their rates need not be equal.
    pub clock: Clock,
    /// The column, such as `intensity_1`.
    #[schemars(example = &"intensity_1")]
    pub column: ColumnChoice,
    /// The intensity, in SI units, that becomes black; the smallest mean of a pixel if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub black: Option<f64>,
    /// The intensity, in SI units, that becomes white; the largest mean of a pixel if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub white: Option<f64>,
}

/// An axis of the image, and the trajectory of its angle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ImageAxis {
    /// The file of the trajectory, such as a `trajectory_ekf.csv` of `kalmems estimate`.
    #[schemars(example = &"trajectory_ekf.csv")]
    pub file: PathBuf,
    /// How the file is written, where that cannot be told from it: `{ kind = "csv", separator = ";", decimal = "," }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// When its samples were taken.
    pub clock: Clock,
    /// The column of the angle.
    #[schemars(example = &"angle_rad")]
    pub column: ColumnChoice,
    /// The column of the standard deviation that its filter claims, such as `angle_sd_rad`: what the trajectory adds to the uncertainty of a
    /// sample's place is then part of the results.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"angle_sd_rad")]
    pub uncertainty: Option<ColumnChoice>,
    /// Pixels along the axis, 2 to 16384.
    #[schemars(range(min = 2, max = 16384), example = 400)]
    pub pixels: u32,
    /// The angle at the edge of the field of view; the largest of the trajectory if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_field: Option<Quantity<Angle, Positive>>,
    /// How far the axis is ahead of its trajectory in its cycle; 0 deg if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phase: Option<Quantity<Angle>>,
    /// How far from `phase`, to each side, the phase of the sharpest image is searched; not at all if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub search: Option<Quantity<Angle, Positive>>,
}

/// Pixels of an axis.
const PIXELS: std::ops::RangeInclusive<u32> = 2..=16_384;
/// A search over more than a quarter of a cycle to each side could turn the image over.
const WIDEST_SEARCH: f64 = std::f64::consts::FRAC_PI_2;

impl ApplicationFile for Image {
    const TITLE: &'static str = "A kalmems image";

    fn with_source(self, source: Source) -> Self {
        Self { source, ..self }
    }

    fn check(&self) -> Result<(), ConfigError> {
        let refuse = |key: Key, why: String| Err(self.error(key, ConfigFault::Value { why }));
        for (name, axis) in self.axes() {
            let key = |child| Key::from(name).child(child);
            if !PIXELS.contains(&axis.pixels) {
                let [least, most] = [PIXELS.start(), PIXELS.end()];
                let why = format!("found {}; expected {least} to {most} pixels, such as `400`", axis.pixels);
                return refuse(key("pixels"), why);
            }
            if let Some(search) = axis.search.as_ref().filter(|search| search.si() > WIDEST_SEARCH) {
                let why = format!("`{}` could turn the image over; expected up to `90 deg`", search.text());
                return refuse(key("search"), why);
            }
        }
        let files = self.axes().map(|(name, axis)| (name, axis.in_file()));
        for (name, file) in files.chain([("intensity", self.intensity.in_file())]) {
            if let Err((_, why)) = file.check() {
                return refuse(Key::from(name), why);
            }
        }
        let Intensity { black, white, .. } = &self.intensity;
        if let Some(odd) = [black, white].into_iter().flatten().find(|level| !level.is_finite()) {
            return refuse(
                Key::from("intensity"),
                format!("`{odd}` is no intensity; expected a finite number"),
            );
        }
        match (black, white) {
            (Some(black), Some(white)) if black == white => {
                let why = format!("`{white}` is black as well; expected two intensities");
                refuse(Key::from("intensity").child("white"), why)
            }
            _ => Ok(()),
        }
    }
}

impl Image {
    /// The axes that there are, by name.
    pub fn axes(&self) -> impl Iterator<Item = (&'static str, &ImageAxis)> {
        [("x", Some(&self.x)), ("y", self.y.as_ref())]
            .into_iter()
            .filter_map(|(name, axis)| Some((name, axis?)))
    }

    /// A file that it names: relative to the folder of the image file.
    pub fn resolve(&self, file: &Path) -> PathBuf {
        self.source.path.parent().unwrap_or(Path::new("")).join(file)
    }

    /// The files that a run reads because of it, itself among them; see [`Source::files`].
    pub fn files(&self) -> Vec<PathBuf> {
        self.source.files()
    }

    /// Takes a phase by hand instead of what the file says of an axis, `x` or `y`, and searches none for it.
    pub fn set_phase(&mut self, axis: &str, phase: &str) -> Result<(), String> {
        let found = match axis {
            "x" => Some(&mut self.x),
            _ => self.y.as_mut(),
        };
        let axis = found.ok_or_else(|| format!("the image has no axis {axis}"))?;
        axis.phase = Some(Quantity::parse(phase)?);
        axis.search = None;
        Ok(())
    }

    /// An error at a key, with its line.
    pub fn error(&self, key: impl Into<Key>, fault: ConfigFault) -> ConfigError {
        self.source.error_at(key.into(), fault)
    }
}

impl Intensity {
    /// How to read its file.
    pub fn layout(&self) -> RecordingLayout {
        self.in_file().layout(None)
    }

    fn in_file(&self) -> FileColumns<'_> {
        let columns = vec![("column", &self.column, Some("1"))];
        FileColumns::new(self.format.as_ref(), &self.clock, columns)
    }
}

impl ImageAxis {
    /// How to read its file.
    pub fn layout(&self) -> RecordingLayout {
        self.in_file().layout(None)
    }

    fn in_file(&self) -> FileColumns<'_> {
        let mut columns = vec![("column", &self.column, Some("rad"))];
        columns.extend(self.uncertainty.as_ref().map(|column| ("uncertainty", column, Some("rad"))));
        FileColumns::new(self.format.as_ref(), &self.clock, columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_number_or_a_list_should_be_is_said_in_words_of_this_program() {
        let of = |text: &str| Image::parse(text, Path::new("image.toml")).unwrap_err().to_string();
        let image = "name = \"a\"\n[intensity]\nfile = \"i.csv\"\nclock = { column = \"time_s\" }\ncolumn = \"i_1\"\n[x]\nfile = \
                     \"x.csv\"\nclock = { column = \"time_s\" }\ncolumn = \"angle_rad\"\npixels = ";
        assert_eq!(
            of(&format!("{image}\"400\"\n")),
            "image.toml:10: x.pixels: found the text `400`; expected a whole number of 0 or more, without quotes; write `pixels = 400`"
        );
        assert_eq!(
            of(&format!("{image}-4\n")),
            "image.toml:10: x.pixels: found the number `-4`; expected a whole number of 0 or more, without quotes; write `pixels = 400`"
        );
        assert_eq!(
            of(&format!("{image}[4]\n")),
            "image.toml:10: x.pixels: found a list; expected a whole number of 0 or more, without quotes; write `pixels = 400`"
        );
    }
}
