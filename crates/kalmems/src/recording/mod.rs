//! Recordings: sampled channels with units, and their diagnosis.
