//! `kalmems diagnose`.

use crate::args::DiagnoseArguments;
use crate::progress::Bar;
use crate::tell::tell;
use crate::{Ending, print};
use kalmems::diagnose::{diagnose, pasted};
use kalmems::results::create_file;
use kalmems::rigs::Workbench;
use std::io::Write;

pub fn run(workbench: &Workbench, arguments: &DiagnoseArguments) -> Result<(), Ending> {
    let wrong = |e: &dyn std::fmt::Display| Ending::Wrong(e.to_string());
    let experiment = workbench.load(&arguments.experiment).map_err(|e| wrong(&e))?;
    if let Some(to) = &arguments.write
        && to.parent().unwrap_or(to.as_ref()) != arguments.experiment.parent().unwrap_or(to.as_ref())
    {
        let why =
            "`--write` expects a file in the folder of the experiment, from which its paths count".to_owned();
        return Err(Ending::Wrong(why));
    }
    // Before the work: what stands there is refused after it as well.
    if let Some(to) = arguments.write.as_ref().filter(|to| to.exists() && !arguments.force) {
        let why =
            format!("`{}` is there already; give another path, or --force to keep it beside", to.display());
        return Err(Ending::Wrong(why));
    }
    let bar = Bar::default();
    let found = diagnose(workbench, &experiment, arguments.filter.as_deref(), &bar)
        .map_err(|e| if e.is_interruption() { Ending::Interrupted } else { wrong(&e) })?;
    drop(bar);
    if arguments.json {
        let json = serde_json::to_string_pretty(&found).map_err(|e| wrong(&e))?;
        print(&(json + "\n"))?;
    } else {
        print(&found.to_text())?;
    }
    let Some(to) = &arguments.write else { return Ok(()) };
    let text = found.causes.first().filter(|cause| !cause.edits.is_empty());
    let Some(text) = text.and_then(|cause| pasted(&experiment, cause)) else {
        tell!("nothing is written: no cause was found that the experiment could say");
        return Ok(());
    };
    let mut file = create_file(to, |_| false, arguments.force).map_err(|e| wrong(&e))?;
    file.write_all(text.as_bytes())
        .map_err(|e| Ending::Wrong(format!("cannot write {}: {e}", to.display())))?;
    tell!("the experiment with the first cause: {}", to.display());
    Ok(())
}
