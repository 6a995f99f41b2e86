//! Values with units: how people write them, and SI inside.
//!
//! A value in an experiment file is text such as `"1.10e-4 N m"` or `"0.151 aF/sqrt(Hz)"`; a column of a
//! recording is called `name_unit`, such as `gyro_rad_per_s`. Both share one closed table of units, so that a
//! word means the same everywhere and an unknown one is refused instead of guessed.
//!
//! ```
//! use kalmems_units::{Value, kind};
//! let stiffness = Value::parse("1.10e-4 N m")?;
//! assert_eq!(stiffness.of_kind(&kind::STIFFNESS)?, 1.10e-4);
//! assert!(Value::parse("3 V")?.of_kind(&kind::STIFFNESS).is_err());
//! # Ok::<(), kalmems_units::UnitError>(())
//! ```

mod dimension;
mod header;
mod interner;
pub mod kind;
mod si_text;
mod uncertainty;
mod unit;
mod value;

pub use dimension::Dimension;
pub use header::ColumnHeader;
pub use interner::{Interner, name};
pub use kind::Kind;
pub use si_text::si_text;
pub use unit::{Unit, UnitError};
pub use value::{Value, number_length};
