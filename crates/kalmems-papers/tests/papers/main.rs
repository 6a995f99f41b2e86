//! What the papers print, and what becomes of it.

mod gates;
mod misprints;
mod reproduction;
