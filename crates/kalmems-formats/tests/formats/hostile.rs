//! Files that are cut, altered or made to do harm: an error or the numbers that are there, in bounded time and memory,
//! and never a panic.

use super::{fixture, group, named};
use kalmems_formats::{Block, Format, FormatError, Hints, WantedColumn, open_reader};
use std::io::Cursor;

/// Every fixture with the hints that it needs.
fn fixtures() -> Vec<(&'static str, Hints)> {
    let plain =
        |names: &[&'static str]| names.iter().map(|name| (*name, Hints::default())).collect::<Vec<_>>();
    let mut all = plain(&[
        "fields.npy",
        "stored.npz",
        "deflated.npz",
        "none.parquet",
        "snappy.parquet",
        "gzip.parquet",
        "lz4.parquet",
        "groups.parquet",
        "encoded.parquet",
        "columns.h5",
        "links.h5",
        "table.h5",
        "compound.h5",
        "many.h5",
        "variables.mat",
        "packed.mat",
        "struct.mat",
        "variables73.mat",
        "segments.tdms",
        "clock.tdms",
        "interleaved.tdms",
        "chunks.tdms",
        "cut.tdms",
        "u8.wav",
        "i24.wav",
        "rf64.wav",
        "f64.wav",
        "zstd.parquet",
        "polars.parquet",
        "sums.parquet",
        "newest.h5",
        "units.h5",
        "differential/both_v108.h5",
        "differential/both_latest.h5",
        "differential/wide_latest.h5",
        "differential/netcdf_earliest.h5",
        "differential/links_latest.h5",
        "differential/records_latest.h5",
        "differential/mat4_row.mat",
        "differential/mat5_beside.mat",
        "differential/scale_chain.tdms",
        "differential/decimal_30.parquet",
        "differential/half.parquet",
        "differential/beside.npz",
    ]);
    let names = ["time_s", "drive_V", "cap_V"];
    all.extend(["plain.npy", "fortran.npy", "matrix.mat"].map(|name| (name, named(&names))));
    all.push(("matrix.npz", Hints { group: Some("run".to_owned()), ..named(&names) }));
    all.push(("struct73.mat", group("rig")));
    all
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

type Columns = Vec<(String, Vec<u64>)>;

/// Reads all columns of numbers of the first one's length, at most so many blocks; what was read before an error counts.
fn drain(bytes: &[u8], hints: &Hints) -> Result<(Columns, Option<FormatError>), FormatError> {
    let mut table = open_reader(Cursor::new(bytes.to_vec()), "", hints)?;
    let (mut names, mut wanted) = (Vec::new(), Vec::new());
    let count = table.description().columns.len().min(20);
    for column in 0..count {
        wanted.push(WantedColumn::Number { column, power: 0 });
        if table.want(&wanted).is_ok() {
            names.push(table.description().columns[column].name.clone());
        } else {
            wanted.pop();
        }
    }
    table.want(&wanted)?;
    let mut columns: Columns = names.into_iter().map(|name| (name, Vec::new())).collect();
    let mut block = Block::with_capacity(64);
    for _ in 0..64 {
        if let Err(error) = table.read(&mut block) {
            return Ok((columns, Some(error)));
        }
        if block.is_end() {
            break;
        }
        for ((_, all), some) in columns.iter_mut().zip(&block.numbers) {
            all.extend(some.iter().map(|number| number.to_bits()));
        }
    }
    Ok((columns, None))
}

/// A file that is cut gives an error, or numbers that are those of the whole file as far as they go.
#[test]
fn cut_files_give_an_error_or_what_is_there() {
    let mut random = Random(0x2545_f491_4f6c_dd1d);
    for (name, hints) in fixtures() {
        let bytes = std::fs::read(fixture(name)).unwrap();
        let (whole, error) = drain(&bytes, &hints).unwrap();
        assert!(error.is_none() && whole.iter().all(|(_, numbers)| !numbers.is_empty()), "{name}");
        let mut refused = 0;
        for cut in 0..60 {
            // Its beginning and its end, and anywhere between.
            let length = match cut {
                0..20 => cut * 8,
                20..30 => bytes.len() - (cut - 19),
                _ => random.below(bytes.len()),
            };
            let Ok((part, error)) = drain(&bytes[..length.min(bytes.len())], &hints) else {
                refused += 1;
                continue;
            };
            refused += usize::from(error.is_some());
            for (column, numbers) in &part {
                let Some((_, all)) = whole.iter().find(|(known, _)| known == column) else { continue };
                assert!(all.starts_with(numbers), "{name} cut at {length}: {column}");
            }
        }
        assert!(refused > 20, "{name}: {refused}");
    }
}

/// Bytes that are altered: nothing is demanded of the numbers, which a format without checksums cannot protect.
#[test]
fn altered_files_end() {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    for (name, hints) in fixtures() {
        let bytes = std::fs::read(fixture(name)).unwrap();
        for round in 0..120 {
            let mut altered = bytes.clone();
            // Headers are at the beginning and at the end, and most of what matters in them.
            let span = if round % 2 == 0 { bytes.len() } else { bytes.len().min(400) };
            for _ in 0..=round % 4 {
                let mut place = random.below(span);
                if round % 4 == 1 {
                    place = bytes.len() - 1 - place;
                }
                altered[place] = match round % 3 {
                    0 => altered[place] ^ (1 << random.below(8)),
                    1 => [0, 1, 0x7f, 0x80, 0xff][random.below(5)],
                    _ => u8::try_from(random.below(256)).unwrap(),
                };
            }
            let _ = drain(&altered, &hints);
        }
    }
}

fn refused(bytes: &[u8], hints: &Hints, words: &str) {
    let found = match drain(bytes, hints) {
        Err(error) | Ok((_, Some(error))) => error.to_string(),
        Ok((columns, None)) => panic!("read {} columns; expected `{words}`", columns.len()),
    };
    assert!(found.contains(words), "`{found}` without `{words}`");
}

fn npy(header: &str, values: usize) -> Vec<u8> {
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(vec![0; values]);
    bytes
}

#[test]
fn arrays_that_claim_too_much_are_refused() {
    let header = |shape: &str| format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({shape}), }}\n");
    let hints = named(&["cap_V"]);
    refused(
        &npy(&header("1000000000000,"), 800),
        &hints,
        "the number of rows that it claims is 1000000000000",
    );
    refused(
        &npy(&header("1, 1000000000000"), 800),
        &hints,
        "the number of rows that it claims is 1000000000000",
    );
    refused(&npy(&header("4000000000, 4000000000, 4000000000"), 800), &hints, "the number of elements");
    refused(&npy(&header("200,"), 800), &hints, "800 bytes after the header; expected 1600");
    refused(&npy("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", 8), &hints, "Python objects");
    refused(&npy(&"[".repeat(60_000), 8), &hints, "fewer brackets");
    // A parser that tries each bracket in two ways takes 2ⁿ steps.
    refused(&npy(&format!("{}{}", "[".repeat(15), "]".repeat(15)), 8), &hints, "a header without keys");
    refused(&npy(&format!("{}{}", "[".repeat(30_000), "]".repeat(30_000)), 8), &hints, "fewer brackets");
    let wide =
        format!("{{'descr': [('a', '<f8', ({0}, {0}))], 'fortran_order': False, 'shape': (1,), }}", 1 << 30);
    refused(&npy(&wide, 8), &hints, "a field `a` of more than");
    // A header that is longer than the file, and than anything sensible.
    refused(b"\x93NUMPY\x02\x00\xff\xff\xff\xff", &hints, "the length of the header is 4294967295");
}

/// The places of the entries of a zip file's directory.
fn entries(bytes: &[u8]) -> Vec<usize> {
    bytes.windows(4).enumerate().filter(|(_, w)| *w == b"PK\x01\x02").map(|(place, _)| place).collect()
}

#[test]
fn zip_files_that_unpack_to_more_than_they_hold_are_refused() {
    let bytes = std::fs::read(fixture("deflated.npz")).unwrap();
    let places = entries(&bytes);
    // Two members in the same bytes.
    let mut overlapping = bytes.clone();
    let first: Vec<u8> = overlapping[places[0] + 42..places[0] + 46].to_vec();
    overlapping[places[1] + 42..places[1] + 46].copy_from_slice(&first);
    refused(&overlapping, &Hints::default(), "a member that reaches into what follows");
    // One that claims four gigabytes.
    let mut claiming = bytes.clone();
    claiming[places[0] + 24..places[0] + 28].copy_from_slice(&(u32::MAX - 1).to_le_bytes());
    refused(&claiming, &Hints::default(), "claims to unpack to is 4294967294");
    // A checksum that is not that of what was read.
    let mut altered = bytes.clone();
    altered[places[0] + 16] ^= 1;
    refused(&altered, &Hints::default(), "a checksum of");
    let mut encrypted = bytes;
    encrypted[places[0] + 8] |= 1;
    refused(&encrypted, &Hints::default(), "which is encrypted");
}

/// An element of a MAT file.
fn element(kind: u32, body: &[u8]) -> Vec<u8> {
    let mut bytes = kind.to_le_bytes().to_vec();
    bytes.extend(u32::try_from(body.len()).unwrap().to_le_bytes());
    bytes.extend(body);
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}

fn mat(body: &[u8]) -> Vec<u8> {
    let mut bytes = vec![b' '; 124];
    bytes.extend(b"\x00\x01IM");
    bytes.extend(body);
    bytes
}

/// An array of a class and one value, with what follows its name.
fn array(class: u32, name: &str, rest: &[u8]) -> Vec<u8> {
    let flags = [class.to_le_bytes(), [0; 4]].concat();
    let shape = [1_u32.to_le_bytes(), 1_u32.to_le_bytes()].concat();
    element(
        14,
        &[element(6, &flags), element(5, &shape), element(1, name.as_bytes()), rest.to_vec()].concat(),
    )
}

#[test]
fn structs_without_end_are_refused() {
    let mut inner = array(6, "", &element(9, &1.5_f64.to_le_bytes()));
    for _ in 0..1000 {
        let names = [element(5, &4_u32.to_le_bytes()), element(1, b"sub\0")].concat();
        inner = array(2, "", &[names, inner].concat());
    }
    refused(
        &mat(&inner),
        &Hints { format: Some(Format::Mat), ..Hints::default() },
        "without a column of numbers",
    );
}

#[test]
fn packed_arrays_that_claim_too_much_are_refused() {
    let mut packer = flate2::Compress::new(flate2::Compression::best(), true);
    let mut packed = Vec::with_capacity(4096);
    // An array that says that it has four gigabytes.
    let mut claim = array(6, "cap_V", &element(9, &1.5_f64.to_le_bytes()));
    claim[4..8].copy_from_slice(&(u32::MAX - 8).to_le_bytes());
    packer.compress_vec(&claim, &mut packed, flate2::FlushCompress::Finish).unwrap();
    refused(
        &mat(&element(15, &packed)),
        &Hints::default(),
        "what a variable claims to unpack to is 4294967287",
    );
}

fn tdms(objects: &[u8], raw: &[u8]) -> Vec<u8> {
    let mut bytes = b"TDSm\x0e\0\0\0\x69\x12\0\0".to_vec();
    bytes.extend(((objects.len() + raw.len()) as u64).to_le_bytes());
    bytes.extend((objects.len() as u64).to_le_bytes());
    bytes.extend(objects);
    bytes.extend(raw);
    bytes
}

fn channel(kind: u32, values: u64, rest: &[u8]) -> Vec<u8> {
    let path = b"/'rig'/'cap'";
    let mut bytes = 1_u32.to_le_bytes().to_vec();
    bytes.extend(u32::try_from(path.len()).unwrap().to_le_bytes());
    bytes.extend(path);
    bytes.extend(20_u32.to_le_bytes());
    bytes.extend(kind.to_le_bytes());
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend(values.to_le_bytes());
    bytes.extend(rest);
    bytes
}

/// As the driver of National Instruments logs them.
#[test]
fn raw_values_of_daqmx_are_named() {
    let mut objects = channel(0xffff_ffff, 2, &0_u32.to_le_bytes());
    let place = objects.windows(4).position(|four| *four == 20_u32.to_le_bytes()).unwrap();
    objects[place..place + 4].copy_from_slice(&0x1269_u32.to_le_bytes());
    refused(
        &tdms(&objects, &[0; 16]),
        &Hints::default(),
        "raw values that DAQmx has logged is not read; read it in LabVIEW",
    );
}

/// An object of MATLAB: flags, its name, the kind of objects, its class, and what is not documented.
#[test]
fn tables_of_matlab_are_named() {
    let flags = [17_u32.to_le_bytes(), [0; 4]].concat();
    let words = ["T", "MCOS", "table"].map(|word| element(1, word.as_bytes())).concat();
    let body = [element(6, &flags), words, array(13, "", &element(6, &7_u32.to_le_bytes()))].concat();
    refused(
        &mat(&element(14, &body)),
        &Hints::default(),
        "`T` (a table of MATLAB: save `S = table2struct(T, ToScalar=true)`",
    );
}

#[test]
fn segments_that_claim_too_much_are_refused() {
    let none = 0_u32.to_le_bytes();
    let hints = Hints::default();
    refused(&tdms(&channel(10, 1 << 62, &none), &[0; 16]), &hints, "4611686018427387904 values");
    refused(&tdms(&channel(10, 1 << 40, &none), &[0; 16]), &hints, "a multiple of 8796093022208");
    refused(&tdms(&channel(10, 0, &none), &[0; 16]), &hints, "values of no channel");
    refused(
        &tdms(&channel(0x20, 1 << 40, &[&16_u64.to_le_bytes()[..], &none].concat()), &[0; 16]),
        &hints,
        "texts in 16 bytes",
    );
    refused(&tdms(&channel(99, 1, &none), &[0; 16]), &hints, "values of type 0x63");
    // A property with a name of four gigabytes, and as many properties.
    let long = [1_u32.to_le_bytes(), u32::MAX.to_le_bytes()].concat();
    refused(&tdms(&channel(10, 2, &long), &[0; 16]), &hints, "the end of what is described there");
    refused(
        &tdms(&channel(10, 2, &u32::MAX.to_le_bytes()), &[0; 16]),
        &hints,
        "the end of what is described there",
    );
    // Texts whose ends run backwards.
    let texts = [8_u32.to_le_bytes(), 4_u32.to_le_bytes(), [0; 4], [0; 4]].concat();
    let bytes = tdms(&channel(0x20, 2, &[&16_u64.to_le_bytes()[..], &none].concat()), &texts);
    let mut table = open_reader(Cursor::new(bytes), "", &hints).unwrap();
    table.want(&[WantedColumn::Label { column: 0 }]).unwrap();
    let error = table.read(&mut Block::with_capacity(8)).unwrap_err().to_string();
    assert!(error.contains("a text from 8 to 4 of 8 bytes"), "{error}");
}

#[test]
fn sound_that_contradicts_itself_is_refused() {
    let bytes = std::fs::read(fixture("i16.wav")).unwrap();
    let altered = |place: usize, new: &[u8]| {
        let mut altered = bytes.clone();
        altered[place..place + new.len()].copy_from_slice(new);
        altered
    };
    let hints = Hints { format: Some(Format::Wav), ..Hints::default() };
    refused(&altered(40, &u32::MAX.to_le_bytes()), &hints, "a claim of 4294967295 bytes of samples, and 480");
    refused(&altered(40, &[0; 4]), &hints, "a claim of 0 bytes of samples");
    refused(&altered(22, &[0, 0]), &hints, "0 channels of 16 bits");
    refused(&altered(24, &[0; 4]), &hints, "at 0 Hz");
    refused(&altered(34, &[12, 0]), &hints, "code 1 with 12 bits");
    refused(&altered(20, &[2, 0]), &hints, "code 2 with 16 bits");
    refused(&altered(36, b"junk"), &hints, "no data chunk");
    refused(&altered(32, &[5, 0]), &hints, "2 channels of 16 bits at 48000 Hz in 5 bytes a sample");
    // Fewer bits than the bytes hold, which stand in their upper part: 20 of 24.
    let mut extensible = std::fs::read(fixture("i24.wav")).unwrap();
    extensible[38] = 20;
    refused(&extensible, &hints, "a kind of sample of its own, 20 of 24 bits,");
}

#[test]
fn groups_in_a_circle_and_rows_that_are_not_there_are_refused() {
    let read = |name: &str| std::fs::read(fixture(name)).unwrap();
    refused(&read("circle.h5"), &Hints::default(), "a file without a column of numbers");
    let mut path = "/g".repeat(60);
    let (columns, error) = drain(&read("deep.h5"), &group(&path)).unwrap();
    assert!(error.is_none() && columns[0].1.len() == 120);
    path.push_str("/g");
    refused(&read("deep.h5"), &group(&path), "which is not in the file");
    refused(&read("unwritten.h5"), &Hints::default(), "whose rows from 1 on were never written");
    let table = open_reader(Cursor::new(read("unwritten.h5")), "", &Hints::default()).unwrap();
    let recognised = &table.description().recognised;
    assert!(
        recognised.contains("left out: `large_V`") && recognised.contains("1000000000000"),
        "{recognised}"
    );
}

/// What a chunk holds may change in a segment without values, and counts for the next one.
#[test]
fn a_change_without_values_counts() {
    let values = |count: u8| (0..count).flat_map(|k| f64::from(k).to_le_bytes()).collect::<Vec<u8>>();
    let none = 0_u32.to_le_bytes();
    let mut bytes = tdms(&channel(10, 2, &none), &values(2));
    let mut change = tdms(&channel(10, 1, &none), &[]);
    change[4] = 2;
    bytes.extend(change);
    let mut more = tdms(&[], &values(1));
    more[4] = 8;
    bytes.extend(more);
    let (columns, error) = drain(&bytes, &Hints::default()).unwrap();
    assert!(error.is_none());
    assert_eq!(columns[0].1, [0.0_f64, 1.0, 0.0].map(f64::to_bits));
}

/// Metadata with a list of two thousand million flags, which the fuzzer found; passing over it would take minutes.
#[test]
fn metadata_that_claim_too_much_are_refused() {
    let hints = Hints { format: Some(Format::Parquet), ..Hints::default() };
    refused(&std::fs::read(fixture("claims.parquet")).unwrap(), &hints, "damaged Parquet");
    // A column at a place below zero.
    refused(&std::fs::read(fixture("offsets.parquet")).unwrap(), &hints, "columns that are not in the file");
}

/// What is said of each column of a file, read by itself.
fn said_of_columns(file: &str) -> Vec<String> {
    let hints = Hints { format: Some(Format::Parquet), ..Hints::default() };
    let bytes = std::fs::read(fixture(file)).unwrap();
    let open = || open_reader(Cursor::new(bytes.clone()), "", &hints);
    let columns = open().unwrap().description().columns.len();
    let mut said = Vec::new();
    for column in 0..columns {
        let mut table = open().unwrap();
        let number = table.want(&[WantedColumn::Number { column, power: 0 }]);
        number.or_else(|_| table.want(&[WantedColumn::Label { column }])).unwrap();
        let mut block = Block::with_capacity(4096);
        let error = (0..64).find_map(|_| table.read(&mut block).err());
        said.extend(error.map(|error| error.to_string()));
    }
    said
}

/// A bit that is altered in any byte of pages with checksums is told, or the numbers are those of the whole file.
#[test]
fn checksums_of_pages_are_compared() {
    let bytes = std::fs::read(fixture("sums.parquet")).unwrap();
    let (whole, error) = drain(&bytes, &Hints::default()).unwrap();
    assert!(error.is_none());
    let mut told = 0;
    for place in 4..data_end(&bytes) {
        let mut altered = bytes.clone();
        altered[place] ^= 1 << (place % 8);
        let (columns, error) = drain(&altered, &Hints::default()).unwrap();
        match error {
            Some(error) => told += usize::from(error.to_string().contains("a checksum of")),
            None => assert_eq!(columns, whole, "byte {place}"),
        }
    }
    assert!(told > 1000, "{told}");
}

/// Where the metadata of a Parquet file begin, which have no checksum.
fn data_end(bytes: &[u8]) -> usize {
    let length = bytes[bytes.len() - 8..].first_chunk().map_or(0, |length| u32::from_le_bytes(*length));
    bytes.len() - 8 - length as usize
}

/// A column that refers to a dictionary which is not there, at which the library gives up by a panic.
#[test]
fn a_panic_of_the_library_is_a_damaged_file() {
    let said = said_of_columns("dictionary.parquet");
    assert!(said.iter().any(|said| said.contains("does not expect")), "{said:?}");
}

/// Headers of pages that keep the library busy for a minute, that make it ask for eight gigabytes, and whose levels are
/// longer than the page.
#[test]
fn pages_that_claim_too_much_are_refused() {
    for file in ["types.parquet", "entries.parquet", "levels.parquet"] {
        let said = said_of_columns(file);
        assert!(said.iter().any(|said| said.contains("no header of a page")), "{file}: {said:?}");
    }
}
