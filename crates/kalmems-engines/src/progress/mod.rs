//! What long work tells, and how it is stopped.

mod interruption;
mod pace;
mod reader;
mod threads;

pub use interruption::Interruption;
pub use pace::Pace;
pub use reader::ReaderProgress;
pub use threads::{HAS_THREADS, each_on_threads, map_on_threads, processors};

use std::ops::ControlFlow;

/// Hears how far a piece of work has come, and may stop it.
///
/// ```
/// use kalmems_engines::progress::Progress;
/// use std::ops::ControlFlow;
/// /// Stops after a thousand units.
/// struct AThousand;
/// impl Progress for AThousand {
///     fn begin(&self, what: &str, total: u64) {
///         println!("{what}: {total}");
///     }
///     fn reached(&self, done: u64) -> ControlFlow<()> {
///         if done < 1000 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
///     }
/// }
/// assert!(AThousand.reached(1000).is_break());
/// ```
pub trait Progress {
    /// A new piece of work of this many units begins.
    fn begin(&self, what: &str, total: u64);

    /// So much of it is done. `Break` stops the work; nothing of it is kept.
    fn reached(&self, done: u64) -> ControlFlow<()>;
}

/// Says nothing and stops nothing.
#[derive(Clone, Copy, Debug)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _: &str, _: u64) {}

    fn reached(&self, _: u64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}
