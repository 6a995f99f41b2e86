//! Samples of a recording as tables in source code.

use super::SourceLanguage;
use std::fmt::Write as _;

/// Drive and signal, from the first sample on.
#[derive(Clone, Debug, Default)]
pub struct ExportSamples {
    /// The drive in V at each sample.
    pub drive: Vec<f64>,
    /// The drive in V in the middle of the interval that ends at each sample; at the first the drive itself.
    pub middle: Vec<f64>,
    /// The signal in V at each sample.
    pub signal: Vec<f64>,
}

impl ExportSamples {
    /// A file with the tables, in f32.
    pub fn to_source(&self, target: SourceLanguage, heading: &[String]) -> String {
        let tables = [
            ("DRIVE_V", "The drive in V at each sample.", &self.drive),
            (
                "MIDDLE_V",
                "The drive in V in the middle of the interval that ends at each sample.",
                &self.middle,
            ),
            ("SIGNAL_V", "The signal in V at each sample.", &self.signal),
        ];
        let count = self.signal.len();
        let mut text = match target {
            SourceLanguage::Rust => "//! Samples of a recording, to try a filter with.\n\n".to_owned(),
            SourceLanguage::C => "/*\n".to_owned(),
        };
        for line in heading {
            let _ = match target {
                SourceLanguage::Rust => writeln!(text, "// {line}"),
                SourceLanguage::C => writeln!(text, " * {}", line.replace("*/", "* /")),
            };
        }
        text += match target {
            SourceLanguage::Rust => "",
            SourceLanguage::C => " */\n",
        };
        for (name, what, values) in tables {
            let (open, suffix, close) = match target {
                SourceLanguage::Rust => (
                    format!(
                        "\n/// {what}\n#[cfg_attr(target_os = \"none\", unsafe(link_section = \".table\"))]\npub static {name}: [f32; {count}] = [\n"
                    ),
                    "",
                    "];\n",
                ),
                SourceLanguage::C => {
                    (format!("\n/* {what} */\nstatic const float {name}[{count}] = {{\n"), "F", "};\n")
                }
            };
            text += &open;
            for row in values.chunks(8) {
                #[allow(clippy::cast_possible_truncation)] // rounding to f32 is what is wanted
                let row: Vec<String> = row.iter().map(|v| format!("{:?}{suffix}", *v as f32)).collect();
                let _ = writeln!(text, "    {},", row.join(", "));
            }
            text += close;
        }
        text
    }
}
