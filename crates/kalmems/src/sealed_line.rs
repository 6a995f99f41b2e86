//! Lines of JSON with a checksum of themselves, as journals and the states of streams have them.

use serde::{Serialize, de::DeserializeOwned};
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::io;

const CHECKSUM: &str = ",\"checksum\":\"";

/// A JSON object on a line of its own, with its checksum as the last entry.
pub(crate) fn sealed_line<T: Serialize>(content: &T) -> io::Result<String> {
    let json = serde_json::to_string(content)?;
    let body = json.strip_suffix('}').unwrap_or(&json);
    Ok(format!("{body}{CHECKSUM}{}\"}}\n", checksum(body)))
}

/// What such a line holds, its checksum compared.
pub(crate) fn checked<T: DeserializeOwned>(line: &[u8]) -> Result<T, String> {
    let text = std::str::from_utf8(line).map_err(|_| "it is no text".to_owned())?;
    let (body, rest) = text.rsplit_once(CHECKSUM).ok_or("it has no checksum")?;
    if rest.strip_suffix("\"}") != Some(&checksum(body)) {
        return Err("its checksum is another one".to_owned());
    }
    serde_json::from_str(&format!("{body}}}")).map_err(|_| "it is not what this version writes".to_owned())
}

fn checksum(body: &str) -> String {
    let digest = Sha256::digest(body);
    hex(digest.get(..8).unwrap_or_default())
}

/// Bytes as hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}
