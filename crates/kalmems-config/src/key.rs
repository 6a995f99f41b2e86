//! Where in an experiment file something stands: `device.shared_scanner.resonator.stiffness`.

use std::fmt;

/// The way from the top of the file to a key, such as `recording[0].channels.drive`; lists count from 0.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Key {
    steps: Vec<KeyStep>,
}

/// One step of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum KeyStep {
    /// An entry of a table.
    Name(String),
    /// An entry of a list, from 0.
    Index(usize),
}

impl Key {
    /// The same, one name further down.
    #[must_use]
    pub fn child(mut self, name: &str) -> Self {
        self.steps.push(KeyStep::Name(name.to_owned()));
        self
    }

    /// The same, one entry of a list further down.
    #[must_use]
    pub fn index(mut self, index: usize) -> Self {
        self.steps.push(KeyStep::Index(index));
        self
    }

    /// Puts a step before the others; a reader learns the way from its end.
    pub fn prepend(&mut self, step: KeyStep) {
        self.steps.insert(0, step);
    }

    /// From text as in messages, such as `recording[0].clock.rate`. `None` where it is no way to a key.
    pub fn parse(text: &str) -> Option<Self> {
        let mut key = Self::default();
        for part in text.split('.') {
            let mut pieces = part.split('[');
            let name = pieces.next().filter(|name| !name.is_empty() && !name.contains(']'))?;
            key.steps.push(KeyStep::Name(name.to_owned()));
            for piece in pieces {
                let digits = piece.strip_suffix(']')?;
                let plain = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
                key.steps.push(KeyStep::Index(digits.parse().ok().filter(|_| plain)?));
            }
        }
        Some(key)
    }

    /// The way from the root.
    pub fn steps(&self) -> &[KeyStep] {
        &self.steps
    }

    /// The name that it ends with; empty where it ends with an index, or is empty.
    pub fn last(&self) -> &str {
        match self.steps.last() {
            Some(KeyStep::Name(name)) => name,
            _ => "",
        }
    }

    /// As the header of a table: the same without the indices.
    pub(super) fn header(&self) -> Self {
        let names = self.steps.iter().filter(|step| matches!(step, KeyStep::Name(_)));
        Self { steps: names.cloned().collect() }
    }
}

impl From<&str> for Key {
    /// From names joined by dots: `simulate.drive.sine`.
    fn from(dotted: &str) -> Self {
        Self { steps: dotted.split('.').map(|name| KeyStep::Name(name.to_owned())).collect() }
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, step) in self.steps.iter().enumerate() {
            match step {
                KeyStep::Index(index) => write!(f, "[{index}]")?,
                KeyStep::Name(name) => {
                    let dot = if i == 0 { "" } else { "." };
                    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
                    if !name.is_empty() && name.chars().all(plain) {
                        write!(f, "{dot}{}", super::error::shown(name))?;
                    } else {
                        write!(f, "{dot}\"{}\"", super::error::shown(name))?;
                    }
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_written_as_in_the_file() {
        let key = Key::from("recording").index(2).child("channels").child("drive");
        assert_eq!(key.to_string(), "recording[2].channels.drive");
        assert_eq!(key.header().to_string(), "recording.channels.drive");
        assert_eq!(Key::parse("recording[2].channels.drive"), Some(key));
        for wrong in ["", "a..b", ".a", "a[", "a[]", "a[x]", "a[+1]", "a[1]b", "[0]", "a]"] {
            assert_eq!(Key::parse(wrong), None, "{wrong}");
        }
        assert_eq!(Key::from("simulate.drive").child("a b").to_string(), "simulate.drive.\"a b\"");
    }
}
