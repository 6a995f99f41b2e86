//! The source of a filter of any device for a microcontroller.

use crate::config::Experiment;
use crate::expand::expand;
use crate::export::{ExportError, ExportRequest, Exported};
use crate::rigs::Workbench;

/// The source of a filter: where its rig does not write one itself, that of the device's equations, with the numbers of its table.
///
/// # Errors
///
/// A filter that the source does not have, or not as the estimate has it.
pub fn source(
    workbench: &Workbench,
    experiment: &Experiment,
    request: &ExportRequest,
) -> Result<Exported, ExportError> {
    let rig = workbench.rig(experiment)?;
    match rig.export(experiment, request) {
        Err(ExportError::Device { .. }) => {}
        written => return written,
    }
    let expanded = expand(workbench, experiment)?;
    let own = workbench.parse(&expanded.text, experiment.path())?;
    // What is said of filters that are left out is of others.
    let notes = expanded.notes.iter().filter(|note| !note.starts_with("The filter `"));
    let request = ExportRequest { notes: notes.cloned().collect(), ..request.clone() };
    let of_equations = workbench.rig(&own)?.export(&own, &request);
    match of_equations {
        // Equations do not have it; the expansion says why.
        Err(ExportError::NoFilter { found, known }) => {
            let of_filter = |note: &&String| note.starts_with(&format!("The filter `{found}` was left out"));
            Err(match expanded.notes.iter().find(of_filter) {
                Some(why) => ExportError::Filter { filter: found, why: why.clone() },
                None => ExportError::NoFilter { found, known },
            })
        }
        of_equations => of_equations,
    }
}
