//! The watch over the innovations of a filter: in Rust as it is written into a source and as a rehearsal runs it, and the same in C.

use super::c::float;
use super::error::EmitError;
use super::request::{EmitGain, EmitRequest};

/// The watch as a source in Rust has it.
#[allow(clippy::all, clippy::pedantic, dead_code)] // written for any compiler
mod rules {
    include!("rust/watch.rs");
    include!("rust/loss.rs");
}

pub(super) use rules::{Beginning, InnovationWatch, KeptRecord, LossOutcome, WatchRules, is_alike};

/// The text of it.
pub(super) const IN_RUST: &str = include_str!("rust/watch.rs");
/// The text of what a filter keeps through a loss of its signal.
pub(super) const LOSS_IN_RUST: &str = include_str!("rust/loss.rs");

/// Its types in C, with `@name@` and `@NAME@` where the filter's name stands.
const TYPES: &str = include_str!("c/watch.h");
/// Its functions in C.
const FUNCTIONS: &str = include_str!("c/watch.c");
/// What a filter keeps through a loss of its signal, in C.
const KEPT: &str = include_str!("c/loss.h");
/// What becomes of it.
const LOSS: &str = include_str!("c/loss.c");

/// The part of the memory for which a filter is lost before it begins again: about as long as a burst is that opens the gate.
const LOST: u32 = 8;

impl EmitRequest {
    /// How innovations are watched.
    pub(super) fn watch_rules(&self) -> WatchRules {
        #[allow(clippy::cast_possible_truncation)] // rounding to f32 is what is wanted
        let [largest_nis, forgets] =
            [self.watch.largest_nis, f64::from(self.watch.memory).recip()].map(|value| value as f32);
        let (settling, lost) = (self.watch.settling, self.watch.memory.div_ceil(LOST));
        WatchRules { largest_nis, rejects: self.watch.rejects, settling, forgets, lost }
    }

    /// Whether a filter that has lost its signal begins again: one that takes every sample, and one whose gain does not change, forgets where it was.
    pub(super) fn begins_again(&self) -> bool {
        self.watch.rejects && self.gain == EmitGain::Covariance
    }

    fn named(&self, text: &str) -> String {
        text.replace("@name@", &self.name).replace("@NAME@", &self.name.to_uppercase())
    }

    /// The types of the watch in C.
    pub(super) fn watch_types(&self) -> String {
        self.named(TYPES)
    }

    /// The type of what is kept through a loss, in C; none of a filter that does not begin again.
    pub(super) fn kept_type(&self) -> String {
        if self.begins_again() { self.named(KEPT) } else { String::new() }
    }

    /// What becomes of a filter that has lost its signal, in C.
    pub(super) fn loss_functions(&self) -> String {
        let rules = self.watch_rules();
        let open = "filter->watch[k].open";
        let of_settled = match rules.settling {
            0 => open.to_owned(),
            settling => format!("filter->watch[k].seen >= {settling}U ? {open} : 0U"),
        };
        self.named(LOSS)
            .replace("@open_of_settled@", &of_settled)
            .replace("@settling@", &rules.settling.to_string())
            .replace("@longest@", &rules.longest().to_string())
            .replace("@agrees@", &rules.agrees(self.measures.len()).to_string())
            .replace("@unsuspected@", &rules::UNSUSPECTED.to_string())
            .replace("@lost@", &rules.lost.to_string())
    }

    /// Its functions in C.
    pub(super) fn watch_functions(&self) -> Result<String, EmitError> {
        let WatchRules { largest_nis, rejects, settling, forgets, .. } = self.watch_rules();
        let taken =
            if rejects { "settles || watch->open > 0U || (watch->suspect <= 2U && !beyond)" } else { "1" };
        Ok(self
            .named(FUNCTIONS)
            .replace("@LARGEST_NIS@", &float(largest_nis.into())?)
            .replace("@FORGETS@", &float(forgets.into())?)
            .replace(
                "@settles@",
                &if settling == 0 { "0".to_owned() } else { format!("watch->seen < {settling}U") },
            )
            .replace("@taken@", taken))
    }
}
