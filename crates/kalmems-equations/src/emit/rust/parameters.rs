//! Parameters that a program may change, in Rust.

use crate::emit::crc;
use std::fmt::Write as _;

/// The structure, with what tells whether it is whole; of each parameter the field, the unit and the value.
pub(super) fn types(parameters: &[(String, String, f64)], experiment: u32) -> String {
    let mut text = "\n/// Parameters that may change while the program runs, in SI, and what tells whether they are whole.\n\
                    #[derive(Clone, Copy, Debug)]\npub struct Parameters {\n    version: u32,\n    experiment: u32,\n"
        .to_owned();
    for (field, unit, _) in parameters {
        let _ = write!(text, "    /// {unit}\n    pub {field}: f64,\n");
    }
    text += "    crc: u32,\n}\n\nimpl Default for Parameters {\n    fn default() -> Self {\n        \
             let mut parameters = Self { version: 0, experiment: 0, crc: 0,";
    for (field, _, value) in parameters {
        let _ = write!(text, " {field}: {value:?},");
    }
    text + " };\n        parameters.seal();\n        parameters\n    }\n}\n" + &sealed(parameters, experiment)
}

/// Version, experiment and checksum of parameters.
fn sealed(parameters: &[(String, String, f64)], experiment: u32) -> String {
    let fields: Vec<String> = parameters.iter().map(|(field, ..)| field.clone()).collect();
    let size = 8 * (1 + fields.len());
    let mut text = format!(
        "\nimpl Parameters {{\n    /// What the names of the parameters are known by.\n    pub const VERSION: u32 = 0x{:08X};\n    \
         /// What the experiment is known by.\n    pub const EXPERIMENT: u32 = 0x{experiment:08X};\n    /// How many bytes they are.\n    \
         pub const SIZE: usize = {};\n\n    fn sum(&self) -> u32 {{\n        let bytes = self.to_bytes();\n        \
         crc32(bytes.split_at({size}).0)\n    }}\n\n    /// Writes version, experiment and checksum, before parameters that have changed go to a memory.\n    \
         pub fn seal(&mut self) {{\n        self.version = Self::VERSION;\n        self.experiment = Self::EXPERIMENT;\n        \
         self.crc = self.sum();\n    }}\n\n    /// Whether parameters from a memory are as they were sealed, and of this list and experiment.\n    \
         pub fn are_whole(&self) -> bool {{\n        \
         self.version == Self::VERSION && self.experiment == Self::EXPERIMENT && self.crc == self.sum()\n    }}\n\n    \
         /// The bytes for a memory, those of C on a processor whose low bytes come first.\n    pub fn to_bytes(&self) -> [u8; Self::SIZE] {{\n        \
         let mut bytes = [0; Self::SIZE];\n        bytes[..4].copy_from_slice(&self.version.to_le_bytes());\n        \
         bytes[4..8].copy_from_slice(&self.experiment.to_le_bytes());\n",
        crc::version(&fields),
        size + 4
    );
    let places = (1..).map(|place| 8 * place).zip(&fields);
    for (at, field) in places.clone() {
        let _ =
            writeln!(text, "        bytes[{at}..{}].copy_from_slice(&self.{field}.to_le_bytes());", at + 8);
    }
    let _ = write!(
        text,
        "        bytes[{size}..].copy_from_slice(&self.crc.to_le_bytes());\n        bytes\n    }}\n\n    /// What was kept as these bytes; ask whether it is whole.\n    \
         pub fn from_bytes(bytes: &[u8; Self::SIZE]) -> Self {{\n        let word = |at: usize| core::array::from_fn(|k| bytes[at + k]);\n        \
         let number = |at: usize| core::array::from_fn(|k| bytes[at + k]);\n        Self {{\n            version: u32::from_le_bytes(word(0)),\n            \
         experiment: u32::from_le_bytes(word(4)),\n"
    );
    for (at, field) in places {
        let _ = writeln!(text, "            {field}: f64::from_le_bytes(number({at})),");
    }
    let _ = write!(text, "            crc: u32::from_le_bytes(word({size})),\n        }}\n    }}\n}}\n\n");
    text + crc::IN_RUST
}
