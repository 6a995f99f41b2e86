//! Reads a file from its first byte to its last.

use super::findings::Findings;
use super::pass::Pass;
use super::plan::{Plan, unreadable};
use super::request::Request;
use super::rows::Rows;
use super::{Clock, FindingKind, ReadError, Recording};
use std::ops::ControlFlow;
use std::path::Path;

/// How many rows are read between two reports of progress.
const ROWS_PER_REPORT: usize = 1 << 16;

/// Called with the bytes read and the bytes in all.
pub(crate) type Progress<'a> = &'a mut dyn FnMut(u64, u64) -> ControlFlow<()>;

/// Reads the whole file; the recording is there even where a finding is fatal, for it to be looked at.
pub(crate) fn read(path: &Path, request: &Request, progress: Progress) -> Result<Recording, ReadError> {
    let file = || path.display().to_string();
    if let Clock::Rate { rate_hz, start_s } = *request.clock
        && !(rate_hz > 0.0 && rate_hz.is_finite() && start_s.is_finite())
    {
        return Err(ReadError::Clock { file: file(), rate_hz, start_s });
    }
    let failed = |source| ReadError::Io { file: file(), source };
    let mut rows = Rows::open(path).map_err(failed)?;
    let mut findings = Findings::default();
    let plan = match rows.next().map_err(failed)? {
        Some(header) => Plan::of(header.cells, header.line, request, &mut findings),
        None => Err(unreadable(FindingKind::Empty, 1, "the file is empty".to_owned())),
    }
    .map_err(|findings| ReadError::Unusable { file: file(), findings })?;
    let mut pass = Pass::new(plan, findings);
    let mut count = 0_usize;
    while let Some(row) = rows.next().map_err(failed)? {
        pass.take(&row);
        count += 1;
        if count.is_multiple_of(ROWS_PER_REPORT) {
            let (done, total) = rows.progress();
            if progress(done, total).is_break() {
                return Err(ReadError::Interrupted { file: file() });
            }
        }
    }
    let (done, total) = rows.progress();
    if progress(done, total).is_break() {
        return Err(ReadError::Interrupted { file: file() });
    }
    Ok(pass.finish(rows.into_source(), request.clock))
}
