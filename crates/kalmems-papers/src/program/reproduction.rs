//! What there is to reproduce, and the run that does it.

use super::{Item, ItemHead, PartWork, ReproduceError};
use crate::progress::Progress;
use serde::Serialize;

/// A source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Paper {
    /// Its short name in citations, such as `S`.
    pub key: &'static str,
    /// Authors, title, year.
    pub citation: &'static str,
}

/// All that a rig's papers show and that can be set beside ours.
#[derive(Debug)]
pub struct PaperProgram {
    /// The device in a few words.
    pub title: &'static str,
    /// The papers.
    pub papers: &'static [Paper],
    /// What a reader must know of how ours was computed, and what is left out.
    pub premises: &'static [&'static str],
    /// What is computed together, in the order of the report.
    pub parts: &'static [ProgramPart],
}

/// Items that are computed together.
#[derive(Debug)]
pub struct ProgramPart {
    /// What they are.
    pub heads: &'static [&'static ItemHead],
    /// Computes one item for each head.
    pub run: fn(&PartWork) -> Result<Vec<Item>, ReproduceError>,
}

impl ItemHead {
    fn is_called(&self, asked: &str) -> bool {
        asked.eq_ignore_ascii_case(self.key) || self.places.iter().any(|place| place.is_called(asked))
    }
}

/// How much is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Effort {
    /// Few seeds: about a minute.
    Quick,
    /// As many as the figures deserve.
    Full,
}

/// What is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReproductionSettings {
    /// One table or figure, such as `Table III` or `D Figure 5.9`; all where there is none.
    pub only: Option<String>,
    /// How much is computed.
    pub effort: Effort,
    /// The first seed of the noise.
    pub seed: u64,
    /// How many threads compute; the results do not depend on it.
    pub threads: usize,
}

/// A run: what the papers say beside what was computed.
#[derive(Clone, Debug)]
pub struct Reproduction {
    /// The rig.
    pub rig: &'static str,
    /// What there is to reproduce.
    pub program: &'static PaperProgram,
    /// What was asked for.
    pub settings: ReproductionSettings,
    /// In the order of the program.
    pub items: Vec<Item>,
}

/// Computes the program of a rig, or the item that is asked for.
pub fn reproduce(
    rig: &'static str,
    program: &'static PaperProgram,
    settings: ReproductionSettings,
    progress: &dyn Progress,
) -> Result<Reproduction, ReproduceError> {
    let is_wanted = |head: &ItemHead| settings.only.as_ref().is_none_or(|asked| head.is_called(asked));
    let heads = || program.parts.iter().flat_map(|part| part.heads);
    if let Some(asked) = &settings.only
        && !heads().any(|head| is_wanted(head))
    {
        let known =
            heads().flat_map(|head| head.places).map(|p| format!("{} {}", p.paper, p.label)).collect();
        return Err(ReproduceError::NoSuchItem { asked: asked.clone(), known });
    }
    let work = PartWork { effort: settings.effort, seed: settings.seed, threads: settings.threads, progress };
    let mut items = Vec::new();
    for part in program.parts.iter().filter(|part| part.heads.iter().any(|head| is_wanted(head))) {
        items.extend((part.run)(&work)?.into_iter().filter(|item| is_wanted(item.head)));
    }
    Ok(Reproduction { rig, program, settings, items })
}
