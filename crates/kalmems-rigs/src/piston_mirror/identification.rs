//! The series of the capacitance from a table of distances and capacitances.

use super::device::PistonMirror;
use super::metamodel::{Metamodel, fit_table};
use super::plates::COEFFICIENTS;
use crate::config::{CapacitanceTable, ConfigFault, Experiment, Key, Quantity, RecordingRole};
use crate::fit::DerivedNumber;
use crate::identify::{Entries, Identification, Identified, IdentifyError, Material};
use crate::table_file::read_table;
use crate::units::kind;
use kalmems_figures::{Axis, Figure, Panel, Series, SeriesRole};

/// Fits the series to the table that the experiment names, its degree by cross-validation (see [`fit_table`]).
pub fn identify(experiment: &Experiment) -> Result<Identification, IdentifyError> {
    let Some(table) = experiment.identify.as_ref().and_then(|identify| identify.capacitance_table.as_ref())
    else {
        let remedy = "name the numbers that are sought, such as `parameters = [\"readout.noise_density\"]`, or a table of capacitances as \
                      `capacitance_table = { file = \"capacitances.csv\", distance = \"distance_mm\", capacitance = \"C_fF\" }`"
            .to_owned();
        return Err(experiment.error("identify.parameters", ConfigFault::MissingKey { remedy }).into());
    };
    let CapacitanceTable { file, distance, capacitance } = table;
    let read = read_table(experiment, file, &[distance, capacitance])?;
    let distances = read.column_of(distance, &kind::LENGTH)?.values.as_slice();
    let capacitances = read.column_of(capacitance, &kind::CAPACITANCE)?.values.as_slice();
    let mut device = (*experiment.device::<PistonMirror>()?).clone();
    let name = file.display().to_string();
    let found = fit_table(distances, capacitances, device.capacitance.reference_distance.si())
        .map_err(|why| IdentifyError::Unfit { recording: name.clone(), why: why.to_string() })?;
    let mut identification = Identification::begun("piston_mirror", experiment);
    write(experiment, &mut device, &found, (&mut identification, &name))?;
    identification.notes = notes(&found, &name);
    identification.figures = vec![residuals(&found, (distances, capacitances))];
    identification.materials = vec![Material {
        name,
        role: RecordingRole::Training,
        time_s: Vec::new(),
        interval_s: 0.0,
        signal: Vec::new(),
        angle: Vec::new(),
        sources: vec![read.source().clone()],
        diagnosis: read.diagnosis().to_vec(),
    }];
    Ok(identification)
}

/// Puts the coefficients and the ends of the table into the device's table.
fn write(
    experiment: &Experiment,
    device: &mut PistonMirror,
    found: &Metamodel,
    (to, file): (&mut Identification, &str),
) -> Result<(), IdentifyError> {
    let wrong = |key: &str, why: String| {
        let key = Key::from("device").child("piston_mirror").child("capacitance").child(key);
        experiment.error(key, ConfigFault::Value { why })
    };
    let (plates, covariance) = &found.above;
    let coefficient = |k: usize| DerivedNumber {
        value: plates.coefficients[k],
        deviation: covariance.standard_deviation(k),
    };
    let degree = written_degree(found);
    let series = &mut device.capacitance;
    let zero = Quantity::of(0.0, "F").map_err(|why| wrong("coefficients", why))?;
    series.coefficients = vec![zero; degree + 1];
    let names: Vec<String> = (0..=degree).map(|k| format!("capacitance.coefficients[{k}]")).collect();
    let mut entries = Entries::with_all_digits();
    for (k, (name, place)) in names.iter().zip(&mut series.coefficients).enumerate() {
        entries.set(experiment, (name, place), coefficient(k), "F")?;
        let words = format!("coefficient of (d_r/d)^{k}");
        to.parameters.push(Identified::gaussian(&words, coefficient(k), "F", file));
    }
    let [nearest, farthest] = found.range_m;
    let length = |key: &str, metres: f64| Quantity::of(metres, "m").map_err(|why| wrong(key, why));
    series.nearest = Some(length("nearest", nearest)?);
    series.farthest = Some(length("farthest", farthest)?);
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    entries.correlate_all(&names, &|i, j| covariance.get(i, j));
    to.experiment.set_device(device.clone());
    entries.write(&mut to.experiment);
    Ok(())
}

/// One degree more than the one that predicts as well as any, where there is one.
fn written_degree(found: &Metamodel) -> usize {
    (found.degree + 1).min(COEFFICIENTS - 1)
}

fn notes(found: &Metamodel, file: &str) -> Vec<String> {
    let nanometres = |metres: f64| format!("{:.3} nm", 1e9 * metres);
    let [nearest, farthest] = found.range_m.map(|end| 1e3 * end);
    let errors =
        found.degrees.iter().map(|of| format!("{}: {}", of.degree, nanometres(of.cross_validated_m)));
    vec![
        format!(
            "{file}: a series of degree {} in the inverse distance predicts the table from {nearest:.4} to {farthest:.4} mm as well as any; its \
             largest error is that of a distance of {}. Written is degree {}, so that the noise of the table is all that is uncertain of it",
            found.degree,
            nanometres(found.worst_m),
            written_degree(found),
        ),
        format!(
            "{file}: root mean square error at distances that the fit had not seen, by degree: {}",
            errors.collect::<Vec<_>>().join(", ")
        ),
    ]
}

/// What the series leaves of the table, as the error of a distance.
fn residuals(found: &Metamodel, (distances, capacitances): (&[f64], &[f64])) -> Figure {
    let points = distances.iter().zip(capacitances).map(|(distance, capacitance)| {
        let off = found.above.0.capacitance(*distance) - capacitance;
        (*distance, off / found.above.0.slope(*distance).abs())
    });
    let panel = Panel::new(Axis::new("distance", "m"), Axis::new("error of the distance", "m"));
    let title = "The series less the table";
    let caption = "The error of the capacitance at each row of the table, as the error of a distance that would be read from it.";
    Figure::new("capacitance_table", title, caption).with(panel.with(Series::points(
        "each row",
        SeriesRole::Measured,
        points.collect::<Vec<_>>(),
    )))
}
