//! A bit that is turned anywhere in a file: what is under a checksum is refused, and what is not is counted.

use super::{fixture, group, named};
use kalmems_formats::{Block, FormatError, Hints, WantedColumn, open_reader};
use std::io::{Cursor, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// All that a file holds: its columns with the bits of their numbers, `None` where there is none, or their texts.
type Everything = Vec<(String, Vec<Option<u64>>, Vec<Vec<u8>>)>;

fn everything(bytes: &[u8], name: &str, hints: &Hints) -> Result<Everything, FormatError> {
    let count = open_reader(Cursor::new(bytes.to_vec()), name, hints)?.description().columns.len();
    let mut all = Vec::new();
    for column in 0..count {
        let mut table = open_reader(Cursor::new(bytes.to_vec()), name, hints)?;
        let described = table.description().columns[column].clone();
        let want = if described.text {
            WantedColumn::Label { column }
        } else {
            WantedColumn::Number { column, power: 0 }
        };
        table.want(&[want])?;
        let mut block = Block::with_capacity(512);
        let (mut numbers, mut texts) = (Vec::new(), Vec::new());
        loop {
            table.read(&mut block)?;
            if block.is_end() {
                break;
            }
            numbers.extend(block.numbers.iter().flatten().map(|n| (!n.is_nan()).then_some(n.to_bits())));
            texts.extend(block.labels.iter().flatten().map(|(_, text)| text.clone()));
        }
        all.push((described.name, numbers, texts));
    }
    Ok(all)
}

/// Random numbers that are the same in every run (G. Marsaglia, J. Stat. Softw. 8 (2003) 14).
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        usize::try_from(self.0 % limit as u64).unwrap()
    }
}

/// The packed variables of a MAT file, behind their tags.
fn packed_variables(bytes: &[u8]) -> Vec<Range<usize>> {
    let (mut at, mut ranges) = (128, Vec::new());
    while at < bytes.len() {
        let word = |place: usize| u32::from_le_bytes(bytes[place..place + 4].try_into().unwrap()) as usize;
        let end = at + 8 + word(at + 4);
        if word(at) == 15 {
            ranges.push(at + 8..end);
        }
        at = end;
    }
    ranges
}

/// The packed bytes of the members of a zip file.
fn members(bytes: &[u8]) -> Vec<Range<usize>> {
    let word = |place: usize, count: usize| {
        bytes[place..place + count].iter().rev().fold(0, |word, byte| word << 8 | usize::from(*byte))
    };
    let entries = (0..bytes.len() - 4).filter(|place| bytes[*place..].starts_with(b"PK\x01\x02"));
    let member = |entry: usize| {
        let header = word(entry + 42, 4);
        let start = header + 30 + word(header + 26, 2) + word(header + 28, 2);
        start..start + word(entry + 20, 4)
    };
    entries.map(member).collect()
}

/// All of an HDF5 file of the latest version: its metadata have checksums, and the chunks of this one as well.
fn all_of_it(bytes: &[u8]) -> Vec<Range<usize>> {
    std::iter::once(0..bytes.len()).collect()
}

/// The bytes of the only chunk, which is packed by zlib and has no other checksum than that of zlib.
fn packed_chunk(bytes: &[u8]) -> Vec<Range<usize>> {
    let start = bytes.windows(2).position(|pair| pair == b"\x78\x5e").unwrap();
    let (mut engine, mut unpacked) = (flate2::Decompress::new(true), vec![0; 24_000]);
    let status = engine.decompress(&bytes[start..], &mut unpacked, flate2::FlushDecompress::Finish).unwrap();
    assert_eq!((status, engine.total_out()), (flate2::Status::StreamEnd, 24_000));
    std::iter::once(start..start + usize::try_from(engine.total_in()).unwrap()).collect()
}

/// The bytes of the pages: between the beginning and the metadata at the end.
fn pages(bytes: &[u8]) -> Vec<Range<usize>> {
    let end = bytes.len() - 8;
    let length = u32::from_le_bytes(bytes[end..end + 4].try_into().unwrap()) as usize;
    std::iter::once(4..end - length).collect()
}

fn nothing(_: &[u8]) -> Vec<Range<usize>> {
    Vec::new()
}

/// A file, what the experiment says of it, and the bytes of it that are under a checksum.
type Protected = (&'static str, Hints, fn(&[u8]) -> Vec<Range<usize>>);

fn files() -> Vec<Protected> {
    let plain = Hints::default;
    let columns = ["time_s", "drive_V", "cap_V"];
    vec![
        ("sums.mat", plain(), packed_variables),
        ("packed.mat", plain(), packed_variables),
        ("stated.mat", plain(), packed_variables),
        ("sums.npz", plain(), members),
        ("deflated.npz", plain(), members),
        ("stored.npz", plain(), members),
        ("sums.h5", plain(), all_of_it),
        ("gzip.h5", plain(), packed_chunk),
        ("sums.parquet", plain(), pages),
        ("gzip.parquet", plain(), pages),
        ("variables.mat", plain(), nothing),
        ("differential/mat4_row.mat", plain(), nothing),
        ("columns.h5", plain(), nothing),
        ("struct73.mat", group("rig"), nothing),
        ("snappy.parquet", plain(), nothing),
        ("plain.npy", named(&columns), nothing),
        ("segments.tdms", plain(), nothing),
        ("i16.wav", plain(), nothing),
        ("csv/picoscope.csv", plain(), nothing),
    ]
}

/// What became of turned bits.
#[derive(Default)]
struct Outcomes {
    /// Bytes of the file under a checksum, and all.
    bytes: (usize, usize),
    refused: usize,
    same: usize,
    /// Read with other numbers: where nothing protects the bytes, and where a checksum does.
    unprotected: usize,
    silent: Vec<usize>,
}

fn turned((name, hints, protected): &Protected, flips: usize) -> Outcomes {
    let whole = std::fs::read(fixture(name)).unwrap();
    let protected = protected(&whole);
    let expected = everything(&whole, name, hints).unwrap();
    let under = protected.iter().map(Range::len).sum();
    let mut random = Random(0x2545_f491_4f6c_dd1d);
    let mut outcomes = Outcomes { bytes: (under, whole.len()), ..Outcomes::default() };
    for _ in 0..flips {
        let place = random.below(whole.len());
        let mut bytes = whole.clone();
        bytes[place] ^= 1 << random.below(8);
        match everything(&bytes, name, hints) {
            Err(_) => outcomes.refused += 1,
            Ok(found) if found == expected => outcomes.same += 1,
            Ok(_) if protected.iter().any(|range| range.contains(&place)) => outcomes.silent.push(place),
            Ok(_) => outcomes.unprotected += 1,
        }
    }
    outcomes
}

fn compare(flips: usize) {
    // Those of the Parquet library are damaged files.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !kalmems_formats::panic_is_caught() {
            hook(panic);
        }
    }));
    let mut faults = Vec::new();
    for file in files() {
        let Outcomes { bytes: (under, all), refused, same, unprotected, silent } = turned(&file, flips);
        println!(
            "{}: {under} of {all} bytes under a checksum; of {flips} bits {refused} refused, {same} without effect, {unprotected} read \
             with other numbers in bytes without a checksum",
            file.0
        );
        if !silent.is_empty() {
            faults.push(format!("{}: other numbers by a bit under a checksum, at {silent:?}", file.0));
        }
        assert!(refused > 0, "{}", file.0);
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn a_turned_bit_under_a_checksum_is_refused() {
    compare(400);
}

#[test]
#[ignore = "slow: 10 000 bits of each of 19 files"]
fn slow_ten_thousand_turned_bits_of_each_format_are_refused_or_in_bytes_without_a_checksum() {
    compare(10_000);
}

/// A turned bit in the header of an array may make it one that is left out, whose numbers nobody compares later.
#[test]
fn every_turned_bit_in_the_header_of_an_array_is_refused() {
    const HEADER: usize = 128;
    let (whole, hints) = (std::fs::read(fixture("stored.npz")).unwrap(), Hints::default());
    let expected = everything(&whole, "stored.npz", &hints).unwrap();
    for range in members(&whole) {
        for (place, bit) in range.take(HEADER).flat_map(|place| (0..8).map(move |bit| (place, bit))) {
            let mut bytes = whole.clone();
            bytes[place] ^= 1 << bit;
            if let Ok(found) = everything(&bytes, "stored.npz", &hints) {
                assert_eq!(found, expected, "bit {bit} of byte {place}");
            }
        }
    }
}

/// The numbers of a variable are refused as a whole: not one is given before the checksum behind them is compared.
#[test]
fn no_number_of_a_damaged_variable_is_given() {
    for (name, wanted) in [("sums.mat", "Adler-32"), ("sums.npz", "CRC-32")] {
        let whole = std::fs::read(fixture(name)).unwrap();
        let range = if name == "sums.mat" { packed_variables(&whole) } else { members(&whole) }.remove(0);
        let table = open_reader(Cursor::new(whole.clone()), name, &Hints::default()).unwrap();
        let protection = &table.description().protection;
        assert_eq!(*protection, format!("Every number is under a checksum ({wanted}), which was compared."));
        let mut bytes = whole;
        // The last byte before the checksum of zlib, or the last of all.
        bytes[range.end - if name == "sums.mat" { 1 } else { 3 }] ^= 4;
        let error = open_reader(Cursor::new(bytes), name, &Hints::default())
            .and_then(|mut table| {
                table.want(&[WantedColumn::Number { column: 0, power: 0 }])?;
                table.read(&mut Block::with_capacity(16))
            })
            .unwrap_err()
            .to_string();
        assert!(error.contains("damaged"), "{error}");
    }
}

#[test]
fn what_has_no_checksum_is_said() {
    let said = |name: &str, hints: &Hints| {
        let table = open_reader(Cursor::new(std::fs::read(fixture(name)).unwrap()), name, hints).unwrap();
        table.description().protection.clone()
    };
    let none = "The file has no checksum over its numbers: that one of them was damaged cannot be found.";
    let names = named(&["time_s", "drive_V", "cap_V"]);
    for (name, hints) in
        [("plain.npy", &names), ("variables.mat", &Hints::default()), ("i16.wav", &Hints::default())]
    {
        assert_eq!(said(name, hints), none, "{name}");
    }
    assert_eq!(
        said("sums.parquet", &Hints::default()),
        "Every number is under a checksum (CRC-32), which was compared."
    );
    assert_eq!(said("units.h5", &Hints::default()), none);
    assert_eq!(said("csv/picoscope.csv", &Hints::default()), none);
    assert_eq!(
        said("gzip.h5", &Hints::default()),
        "Every number is under a checksum (Adler-32), which was compared."
    );
}

/// Each bit of the checksum of zlib behind a chunk of HDF5 that has no other.
#[test]
fn the_checksum_of_gzip_alone_is_compared() {
    let whole = std::fs::read(fixture("gzip.h5")).unwrap();
    assert!(everything(&whole, "gzip.h5", &Hints::default()).is_ok());
    let end = packed_chunk(&whole)[0].end;
    for (place, bit) in (end - 4..end).flat_map(|place| (0..8).map(move |bit| (place, bit))) {
        let mut bytes = whole.clone();
        bytes[place] ^= 1 << bit;
        let error = everything(&bytes, "gzip.h5", &Hints::default()).unwrap_err().to_string();
        assert!(error.contains("damaged HDF5"), "bit {bit} of byte {place}: {error}");
    }
}

/// Lengths that contradict each other are refused: of a file, of a member, of a variable, of a second of sound.
#[test]
fn lengths_that_are_swapped_are_refused() {
    let altered = |name: &str, place: usize, bytes: &[u8]| {
        let mut whole = std::fs::read(fixture(name)).unwrap();
        whole[place..place + bytes.len()].copy_from_slice(bytes);
        everything(&whole, name, &Hints::default()).unwrap_err().to_string()
    };
    let i16 = std::fs::read(fixture("i16.wav")).unwrap();
    let longer = u32::try_from(i16.len() + 100).unwrap().to_le_bytes();
    assert!(altered("i16.wav", 4, &longer).contains("a file that is whole"));
    assert!(altered("i16.wav", 28, &1_u32.to_le_bytes()).contains("1 bytes a second"));
    let npz = std::fs::read(fixture("sums.npz")).unwrap();
    let names: Vec<usize> =
        (0..npz.len() - 30).filter(|place| npz[*place..].starts_with(b"PK\x03\x04")).collect();
    assert!(altered("sums.npz", names[0] + 30, b"X").contains("as the directory says"));
    assert!(altered("waveforms.tdms", 8, &[0, 0]).contains("version 4712 or 4713"));
}

/// Bytes in memory that count how many of them were read.
struct Counted(Cursor<Vec<u8>>, Arc<AtomicUsize>);

impl Read for Counted {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.0.read(buffer)?;
        self.1.fetch_add(count, Ordering::Relaxed);
        Ok(count)
    }
}

impl Seek for Counted {
    fn seek(&mut self, place: SeekFrom) -> std::io::Result<u64> {
        self.0.seek(place)
    }
}

/// A file of MATLAB with a packed matrix of two columns of so many numbers: k and the square of its sine.
fn packed_matrix(rows: u32) -> Vec<u8> {
    let element = |kind: u32, bytes: &[u8]| {
        let length = u32::try_from(bytes.len()).unwrap();
        let mut all = [kind.to_le_bytes(), length.to_le_bytes()].concat();
        all.extend(bytes);
        all.resize(all.len().next_multiple_of(8), 0);
        all
    };
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
    let numbers = (0..rows).map(f64::from).chain((0..rows).map(|k| f64::from(k).sin().powi(2)));
    let numbers = numbers.flat_map(f64::to_le_bytes).collect::<Vec<u8>>();
    let parts =
        [element(6, &words(&[6, 0])), element(5, &words(&[rows, 2])), element(1, b"M"), element(9, &numbers)];
    let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    packer.write_all(&element(14, &parts.concat())).unwrap();
    let mut packed = packer.finish().unwrap();
    let mut file = vec![b' '; 124];
    file.extend([0, 1, b'I', b'M']);
    file.extend(words(&[15, u32::try_from(packed.len()).unwrap()]));
    file.append(&mut packed);
    file
}

/// The checksum behind a long variable is compared first, and yet it is unpacked once for all of its columns.
#[test]
fn a_packed_variable_is_unpacked_once() {
    const ROWS: u32 = 150_000;
    let (file, read) = (packed_matrix(ROWS), Arc::new(AtomicUsize::new(0)));
    let length = file.len();
    let source = Counted(Cursor::new(file.clone()), Arc::clone(&read));
    let mut table = open_reader(source, "packed.mat", &named(&["k_1", "square_1"])).unwrap();
    table.want(&[0, 1].map(|column| WantedColumn::Number { column, power: 0 })).unwrap();
    let mut block = Block::with_capacity(4096);
    let mut row = 0;
    loop {
        table.read(&mut block).unwrap();
        if block.is_end() {
            break;
        }
        for (k, square) in block.numbers[0].iter().zip(&block.numbers[1]) {
            assert!(*k == f64::from(row) && *square == f64::from(row).sin().powi(2), "{row}");
            row += 1;
        }
    }
    assert_eq!(row, ROWS);
    let read = read.load(Ordering::Relaxed);
    assert!(read < length + length / 2, "{read} of {length} bytes");
    // A bit of its last numbers.
    let mut damaged = file;
    damaged[length - 100] ^= 1;
    assert!(open_reader(Cursor::new(damaged), "packed.mat", &named(&["k_1", "square_1"])).is_err());
}
