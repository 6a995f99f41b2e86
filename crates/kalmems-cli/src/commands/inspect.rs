//! `kalmems inspect`.

use crate::args::InspectArguments;
use crate::progress::Bar;
use crate::{Ending, print};
use kalmems::estimate::Progress;
use kalmems::inspect::inspect_with;
use kalmems::recording::ReadError;

pub fn run(arguments: &InspectArguments) -> Result<(), Ending> {
    let bar = Bar::default();
    let mut started = false;
    let inspection = inspect_with(&arguments.recording, &mut |done, total| {
        if !started {
            bar.begin("reading", total);
            started = true;
        }
        bar.reached(done)
    })
    .map_err(|e| match e {
        ReadError::Interrupted { .. } => Ending::Interrupted,
        e => Ending::Wrong(e.to_string()),
    })?;
    drop(bar);
    if let Some(path) = &arguments.png {
        kalmems::results::draw_inspection(&inspection, path).map_err(|e| Ending::Wrong(e.to_string()))?;
    }
    if arguments.json {
        let json = serde_json::to_string_pretty(&inspection).map_err(|e| Ending::Wrong(e.to_string()))?;
        print(&(json + "\n"))
    } else {
        print(&inspection.to_text())
    }
}
