//! What bounds the work on a description, whatever is written in it.

/// The longest text of one expression, in bytes.
pub(crate) const LONGEST_TEXT: usize = 1 << 16;
/// How deep brackets, signs and powers may be nested in one expression.
pub(crate) const DEEPEST_NESTING: usize = 64;
/// How many definitions may wait for one another.
pub(crate) const DEEPEST_DEFINITION: usize = 48;
/// How many names a description may define.
pub(crate) const MOST_NAMES: usize = 1000;
/// How many nodes a graph may have.
pub(crate) const MOST_NODES: usize = 100_000;
/// How many parts all nodes of a graph may have together.
pub(crate) const MOST_PARTS: usize = 1_000_000;
/// How many nodes may be gone over while a graph is made.
pub(crate) const MOST_VISITS: usize = 50_000_000;
/// How many points a curve or a surface may have: beyond that it is a recording.
pub(crate) const MOST_POINTS: usize = 1_000_000;
/// How many notices are kept.
pub(crate) const MOST_NOTICES: usize = 100;
/// How many terms of texts are read while a description is resolved; functions are read at each call.
pub(crate) const MOST_TERMS: usize = 2_000_000;
/// The largest exponent of a whole power.
pub(crate) const LARGEST_POWER: i32 = 1000;
