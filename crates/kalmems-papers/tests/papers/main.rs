//! What the papers print, and what becomes of it.

mod misprints;
mod reproduction;
