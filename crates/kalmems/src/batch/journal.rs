//! What the journal of a batch holds: by which experiment it is, and a line for each recording that is estimated.

use crate::journal::{self, JournalWork, kind};
use crate::rows::ResultRow;
use serde::{Deserialize, Serialize};

/// The first line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct BatchHeader {
    /// What kind of file it is.
    kalmems: String,
    /// The version of the program.
    version: String,
    /// What tells the work on each recording from other work on it.
    digest: String,
}

/// A recording that is estimated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct BatchPiece {
    /// What tells it from recordings with other samples, in hexadecimal.
    pub(super) key: String,
    /// SHA-256 of the file of its trajectories.
    pub(super) trajectories: String,
    /// Whether a filter that is to be trusted in a segment is doubtful or worse.
    pub(super) doubtful: bool,
    pub(super) rows: Vec<ResultRow>,
}

/// Recordings that are estimated, by their keys.
pub(super) type BatchPieces = journal::JournalPieces<BatchHeader>;

impl BatchHeader {
    pub(super) fn new(digest: String) -> Self {
        Self { kalmems: kind::<Self>(), version: env!("CARGO_PKG_VERSION").to_owned(), digest }
    }
}

impl JournalWork for BatchHeader {
    type Piece = BatchPiece;
    type Key = String;
    const NAME: &'static str = "batch";

    fn kind(&self) -> &str {
        &self.kalmems
    }

    fn differs(&self, from: &Self) -> Option<String> {
        if self.version != from.version {
            return Some(format!("it was made by version {}, and this is {}", self.version, from.version));
        }
        (self.digest != from.digest)
            .then(|| "the experiment, or a file that it names, has changed".to_owned())
    }

    fn key(&self, piece: &BatchPiece) -> Result<String, String> {
        let is_one = piece.key.len() == 64 && piece.key.bytes().all(|byte| byte.is_ascii_hexdigit());
        if is_one { Ok(piece.key.clone()) } else { Err(format!("the recording `{}`", piece.key)) }
    }

    fn name(key: &String) -> String {
        format!("the recording {}", key.get(..12).unwrap_or(key))
    }
}
