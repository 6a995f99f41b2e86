//! What arguments state of a recording.

use crate::CommandEnding;
use kalmems::inspect::StatedTime;
use kalmems::recording::{FindingKind, ReadError};
use kalmems::units::{Value, kind};

/// A column of times with its unit.
pub fn stated_time(stated: Option<&(String, String)>) -> Result<Option<StatedTime>, CommandEnding> {
    let Some((column, unit)) = stated else { return Ok(None) };
    StatedTime::new(column, unit).map(Some).ok_or_else(|| {
        CommandEnding::Wrong(format!(
            "`--time {column}={unit}`: found `{unit}`; expected a unit of time, such as `s`, `ms`, `us` or `ns`"
        ))
    })
}

/// A rate of samples in Hz.
pub fn rate_hz(stated: Option<&str>) -> Result<Option<f64>, CommandEnding> {
    let Some(text) = stated else { return Ok(None) };
    let rate = Value::parse(text).and_then(|value| value.of_kind(&kind::FREQUENCY));
    match rate {
        Ok(rate) if rate > 0.0 => Ok(Some(rate)),
        Ok(_) => {
            Err(CommandEnding::Wrong(format!("`--rate {text}`: expected a rate above 0, such as `1 MHz`")))
        }
        Err(error) => Err(CommandEnding::Wrong(format!("`--rate {text}`: {error}"))),
    }
}

/// Why a recording was not read, with the arguments that state what its message asks for.
pub fn unread(error: &ReadError) -> CommandEnding {
    let asks = match error {
        ReadError::Format { .. } => true,
        ReadError::Unusable { findings, .. } => {
            findings.iter().any(|one| matches!(one.kind, FindingKind::NoHeader | FindingKind::Separator))
        }
        _ => false,
    };
    let stated = if asks {
        "\nFor this command `--format`, `--group`, `--columns`, `--header-line`, `--separator` and `--decimal` state what `format` does."
    } else {
        ""
    };
    CommandEnding::Wrong(format!("{error}{stated}"))
}
