//! A recording beside another one, which many experiments with the same files ask for.

use super::{ReadError, RecordingLayout, SampledRecording};
use crate::config::FilesBeside;
use std::fs::Metadata;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::SystemTime;

/// A recording as it was read.
struct BesideRecording {
    layout: RecordingLayout,
    version: Option<(u64, SystemTime)>,
    recording: Arc<SampledRecording>,
}

impl SampledRecording {
    /// What was read of the file before, where the file and the layout are still the same; else it is read, as by
    /// [`read_with`](Self::read_with), and kept.
    pub fn read_beside(
        (path, layout): (&Path, &RecordingLayout),
        beside: &FilesBeside,
        progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
    ) -> Result<Arc<Self>, ReadError> {
        let of = |file: Metadata| Some((file.len(), file.modified().ok()?));
        let version = path.metadata().ok().and_then(of);
        let before = beside.get(path).and_then(|before| before.downcast::<BesideRecording>().ok());
        let same = before
            .filter(|before| version.is_some() && before.version == version && before.layout == *layout);
        if let Some(before) = same {
            return Ok(before.recording.clone());
        }
        let recording = Arc::new(Self::read_with(path, layout, progress)?);
        let kept = BesideRecording { layout: layout.clone(), version, recording: recording.clone() };
        beside.put(path.to_owned(), Arc::new(kept));
        Ok(recording)
    }
}
