//! A file of whichever format, recognised by what it begins with.

use crate::source::{ReadSeek, SharedFile};
use crate::{Arrays, CsvHints, FormatError, Result, Table, csv, limits};
use std::path::Path;

/// A format that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Text, a row a line.
    Csv,
    /// One NumPy array.
    Npy,
    /// A zip file of NumPy arrays.
    Npz,
    /// Apache Parquet.
    Parquet,
    /// HDF5, and MAT files from version 7.3 on.
    Hdf5,
    /// MAT files of version 4 to 7.
    Mat,
    /// Technical data management streaming, of LabVIEW.
    Tdms,
    /// Sound: RIFF, RF64 and BW64.
    Wav,
}

impl Format {
    /// All, and the names that they have in an experiment file.
    pub const ALL: [(&'static str, Self); 8] = [
        ("csv", Self::Csv),
        ("npy", Self::Npy),
        ("npz", Self::Npz),
        ("parquet", Self::Parquet),
        ("hdf5", Self::Hdf5),
        ("mat", Self::Mat),
        ("tdms", Self::Tdms),
        ("wav", Self::Wav),
    ];

    /// The format of a name, as an experiment file has it.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(known, _)| *known == name).map(|(_, format)| *format)
    }

    /// Its name, as an experiment file has it.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, format)| *format == self).map_or("", |(name, _)| name)
    }

    /// What a file name's ending promises; nothing where it is used for several formats.
    fn of_ending(name: &str) -> Option<Self> {
        let ending = Path::new(name).extension()?.to_str()?.to_ascii_lowercase();
        Some(match ending.as_str() {
            "csv" | "tsv" => Self::Csv,
            "npy" => Self::Npy,
            "npz" => Self::Npz,
            "parquet" | "pq" => Self::Parquet,
            "h5" | "hdf5" | "hdf" | "he5" => Self::Hdf5,
            "tdms" => Self::Tdms,
            "wav" | "wave" | "rf64" | "bw64" => Self::Wav,
            "mat" => Self::Mat,
            _ => return None,
        })
    }
}

/// What an experiment file says of a file beyond its path.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Hints {
    /// Which format it is, whatever it looks like.
    pub format: Option<Format>,
    /// Where the table is in a file of several: a group or dataset of HDF5 (`/rig/run_1`), a group of TDMS, a struct or
    /// matrix of a MAT file, an array of an NPZ file.
    pub group: Option<String>,
    /// The names of the columns, in their order, where the file has none: 2-D arrays and WAV.
    pub columns: Option<Vec<String>>,
    /// How text is written.
    pub csv: CsvHints,
    /// Arrays in memory that stand instead of the file: it is not opened, and need not be there.
    pub arrays: Option<Arrays>,
}

/// Opens a table.
///
/// A file that is no regular one, such as a pipe, cannot be looked at twice and is read as text.
pub fn open(path: &Path, hints: &Hints) -> Result<Box<dyn Table>> {
    if let Some(arrays) = &hints.arrays {
        return Ok(arrays.table());
    }
    if !std::fs::metadata(path)?.is_file() {
        return csv::open_csv(path, hints);
    }
    let source = SharedFile::open(path)?;
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    match recognise(&source, name, hints)? {
        Format::Csv => csv::open_csv(path, hints),
        format => open_binary(format, source, hints),
    }
}

/// Opens a table that is not a file on its own, such as bytes in memory. The ending of `name` counts as a file's does.
pub fn open_reader(file: impl ReadSeek + 'static, name: &str, hints: &Hints) -> Result<Box<dyn Table>> {
    let source = SharedFile::new(Box::new(file))?;
    match recognise(&source, name, hints)? {
        Format::Csv => csv::from_reader(source.into_file()?, hints),
        format => open_binary(format, source, hints),
    }
}

fn open_binary(format: Format, source: SharedFile, hints: &Hints) -> Result<Box<dyn Table>> {
    let table = open_as(format, source, hints)?;
    // Names that a reader had no use for.
    let known = |name: &&String| table.description().columns.iter().any(|column| column.name == **name);
    if let Some(name) = hints.columns.iter().flatten().find(|name| !known(name)) {
        let names: Vec<String> =
            table.description().columns.iter().map(|column| format!("`{}`", column.name)).collect();
        let what = format!("a name `{name}` for a file with names of its own ({})", limits::list(&names));
        let remedy = "name a column as the file does where it is used, with its unit, such as \
                      `{ column = \"Ucap\", unit = \"V\" }`, and write in `columns` nothing that the file does not have";
        return Err(FormatError::unsupported(table.description().format, what, remedy));
    }
    Ok(table)
}

#[allow(clippy::needless_pass_by_value)] // where no reader is built
fn open_as(format: Format, source: SharedFile, hints: &Hints) -> Result<Box<dyn Table>> {
    match format {
        #[cfg(feature = "npy")]
        Format::Npy => crate::npy::open_npy(source, hints),
        #[cfg(feature = "npy")]
        Format::Npz => crate::npy::open_npz(source, hints),
        #[cfg(feature = "parquet")]
        Format::Parquet => crate::parquet::open(source, hints),
        #[cfg(feature = "hdf5")]
        Format::Hdf5 => crate::hdf5::open(source, hints),
        // From version 7.3 on they are HDF5.
        #[cfg(feature = "hdf5")]
        Format::Mat if hdf5_begin(&source)?.is_some() => crate::hdf5::open(source, hints),
        #[cfg(feature = "mat")]
        Format::Mat => crate::mat::open(source, hints),
        #[cfg(feature = "tdms")]
        Format::Tdms => crate::tdms::open(source, hints),
        #[cfg(feature = "wav")]
        Format::Wav => crate::wav::open(source, hints),
        #[allow(unreachable_patterns)] // where all are built
        _ => {
            let what = "a format that this program was built without";
            Err(FormatError::unsupported(format.name(), what, "build it with all features"))
        }
    }
}

/// As much as is looked at.
const BEGINNING: usize = 4096;

/// Which format a file is: what the experiment file says, or what it begins with where its name does not contradict.
fn recognise(source: &SharedFile, name: &str, hints: &Hints) -> Result<Format> {
    if let Some(format) = hints.format {
        return Ok(format);
    }
    let mut beginning = vec![0; BEGINNING];
    let count = source.read_some(0, &mut beginning)?;
    beginning.truncate(count);
    let found = of_content(source, &beginning)?;
    match (found, Format::of_ending(name)) {
        (RecognizedContent::Known(format, _), None) => Ok(format),
        (RecognizedContent::Known(format, _), Some(promised)) if format == promised => Ok(format),
        // Version 7.3 keeps the ending and is HDF5 inside.
        (RecognizedContent::Known(Format::Hdf5, _), Some(Format::Mat)) => Ok(Format::Hdf5),
        (RecognizedContent::Known(format, begins), Some(promised)) => {
            let kind = format!("write `format = {{ kind = \"{}\" }}` if it is that", format.name());
            let found = format!("named as {} and begins as {begins}", promised.name());
            Err(FormatError::not_recognised(found, format!("the two to agree: rename the file, or {kind}")))
        }
        (RecognizedContent::Text, None | Some(Format::Csv)) => Ok(Format::Csv),
        (RecognizedContent::Text, Some(promised)) => {
            let name = promised.name();
            let remedy = "if it is text with a row a line, write `format = { kind = \"csv\" }`";
            let expected = format!("what {name} begins with; {remedy}");
            Err(FormatError::not_recognised(format!("named as {name} and begins as text"), expected))
        }
        (RecognizedContent::Other(what), _) => Err(FormatError::not_recognised(what, READABLE)),
        (RecognizedContent::Unknown, _) => {
            let what = format!("begins with {}", excerpt(&beginning));
            let what = by_ending(name).map_or(what.clone(), |of| format!("{what}; by its name it is {of}"));
            Err(FormatError::not_recognised(what, READABLE))
        }
    }
}

/// What files begin with that are no text, from a place on, and what messages call them.
const KNOWN: [(usize, &[u8], Format, &str); 8] = [
    (0, b"\x93NUMPY", Format::Npy, "NPY"),
    (0, b"PK\x03\x04", Format::Npz, "a zip file"),
    (0, b"PK\x05\x06", Format::Npz, "a zip file"),
    (0, b"TDSm", Format::Tdms, "TDMS"),
    (8, b"WAVE", Format::Wav, "WAV"),
    (0, b"PAR1", Format::Parquet, "Parquet"),
    (124, b"\0\x01IM", Format::Mat, "MAT 5"),
    (124, b"\x01\0MI", Format::Mat, "MAT 5"),
];

enum RecognizedContent {
    Known(Format, &'static str),
    Text,
    /// What it is, and what to do with it.
    Other(&'static str),
    Unknown,
}

const READABLE: &str = "a file of CSV, NPY, NPZ, Parquet, HDF5, MAT 4 to 7.3, TDMS or WAV";

/// What is packed or stored otherwise, and what to do with it.
const OTHERS: [(&[u8], &str); 8] = [
    (b"\x1f\x8b", "begins as gzip: unpack it first"),
    (b"\x28\xb5\x2f\xfd", "begins as zstd: unpack it first"),
    (b"\xfd7zXZ\0", "begins as xz: unpack it first"),
    (b"BZh", "begins as bzip2: unpack it first"),
    (b"TDSh", "begins as the index of a TDMS file: name the `.tdms` file itself"),
    (b"RIFX", "begins as RIFX, sound with its bytes swapped: convert it to RIFF"),
    (b"PARE", "begins as Parquet with an encrypted end: write it unencrypted"),
    (b"ARROW1\0", "begins as Arrow IPC: write it as Parquet"),
];

/// A kind of file by any of these bytes, each from a place on, and what to do with it.
type KnownBeginning = (&'static [(usize, &'static [u8])], &'static str);

/// Texts that stand instead of a file, and files of instruments in formats of their own: what they begin with, and what to export in
/// the place of them.
const BEGINNINGS: [KnownBeginning; 8] = [
    (
        &[(0, b"version https://git-lfs.github.com/spec/")],
        "is a pointer of Git LFS, not the file itself: fetch it with `git lfs pull`",
    ),
    (&[(0, b"/annex/objects/")], "is a pointer of git-annex, not the file: fetch it with `git annex get`"),
    (
        &[(2, b":WFM#")],
        "is a Tektronix `.wfm`: save it as CSV on the oscilloscope (File, Save As, Waveform, .csv), or convert it with TekScope",
    ),
    (
        &[(0, b":WFMP"), (0, b":CURV")],
        "is a Tektronix `.isf`: save it as CSV on the oscilloscope (File, Save As, Waveform, .csv)",
    ),
    (
        &[(11, b"WAVEDESC"), (0, b"WAVEDESC")],
        "is a LeCroy `.trc`: save the trace as Excel or MathCad text on the oscilloscope (File, Save Waveform), or as MATLAB",
    ),
    (
        &[(0, b"AG10"), (0, b"AG01"), (0, b"AG03")],
        "is a Keysight `.bin`: save it as CSV or HDF5 on the oscilloscope (Save, Format)",
    ),
    (&[(0, b"RG01"), (0, b"RG03")], "is a Rigol `.bin`: save it as CSV on the oscilloscope (Storage, CSV)"),
    (&[(0, b"\xa5\xa5")], "is a Rigol `.wfm`: save it as CSV on the oscilloscope (Storage, CSV)"),
];

/// The same by the ending of a name, of files whose content says nothing.
const ENDINGS: [(&str, &str); 8] = [
    ("wfm", "a waveform in the format of Tektronix, Rigol or Rohde & Schwarz: save it as CSV there"),
    ("trc", "a trace in the format of LeCroy: save it as text or MATLAB there (File, Save Waveform)"),
    ("isf", "a waveform in the format of Tektronix: save it as CSV there (File, Save As, Waveform)"),
    (
        "bin",
        "numbers without a header (Siglent, Rigol, Keysight, loggers): save it as CSV, or write it as NPY with its rate in the experiment",
    ),
    ("set", "settings of an oscilloscope, which hold no samples: save the waveform as CSV"),
    ("psdata", "a session of PicoScope: save it as CSV or MATLAB (File, Save As)"),
    ("wdf", "a waveform of Yokogawa: save it as CSV or MATLAB there"),
    ("sqlite", "a database: write the table as CSV or Parquet"),
];

/// What to do with a file by the ending of its name, where nothing in it is known.
fn by_ending(name: &str) -> Option<&'static str> {
    let ending = Path::new(name).extension()?.to_str()?.to_ascii_lowercase();
    ENDINGS.iter().find(|(known, _)| *known == ending).map(|(_, what)| *what)
}

fn of_content(source: &SharedFile, beginning: &[u8]) -> Result<RecognizedContent> {
    let at = |place: usize, magic: &[u8]| beginning.get(place..).is_some_and(|rest| rest.starts_with(magic));
    let text = is_text(beginning);
    let begins = |begin: &KnownBeginning| begin.0.iter().any(|(place, magic)| at(*place, magic));
    if let Some((_, what)) = BEGINNINGS.iter().find(|known| begins(known)) {
        return Ok(RecognizedContent::Other(what));
    }
    let known = KNOWN.iter().find(|(place, magic, ..)| !text && at(*place, magic));
    if let Some((_, _, format, name)) = known {
        return Ok(RecognizedContent::Known(*format, name));
    }
    if hdf5_begin(source)?.is_some() {
        return Ok(RecognizedContent::Known(Format::Hdf5, "HDF5"));
    }
    #[cfg(feature = "mat")]
    if !text && crate::mat::begins_as_four(beginning) {
        return Ok(RecognizedContent::Known(Format::Mat, "MAT 4"));
    }
    if let Some((_, what)) = OTHERS.iter().find(|(magic, _)| at(0, magic) && (!text || magic.len() > 3)) {
        return Ok(RecognizedContent::Other(what));
    }
    if text {
        return Ok(RecognizedContent::Text);
    }
    Ok(RecognizedContent::Unknown)
}

/// Where an HDF5 file begins: anything of 512, 1024, 2048, … bytes may stand before it.
pub(crate) fn hdf5_begin(source: &SharedFile) -> Result<Option<u64>> {
    let mut place = 0;
    while place < source.length() {
        let mut magic = [0; 8];
        if source.read_some(place, &mut magic)? == 8 && magic == *b"\x89HDF\r\n\x1a\n" {
            return Ok(Some(place));
        }
        place = if place == 0 { 512 } else { place * 2 };
    }
    Ok(None)
}

/// Text holds no control characters but white space. UTF-16 says so in its first two bytes; it is for the reader of
/// text to judge.
fn is_text(beginning: &[u8]) -> bool {
    beginning.starts_with(b"\xff\xfe")
        || beginning.starts_with(b"\xfe\xff")
        || !beginning.iter().any(|byte| *byte < 32 && !matches!(byte, b'\t' | b'\n' | b'\r' | 0x0c | 0x1a))
}

/// The first bytes, which tell formats apart; no more, as it may be a file that was not meant.
fn excerpt(beginning: &[u8]) -> String {
    let shown = &beginning[..beginning.len().min(4)];
    format!("`{}`", shown.escape_ascii())
}
