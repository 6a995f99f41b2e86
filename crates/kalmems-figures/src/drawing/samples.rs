//! Every sample of the series of a page, in a file beside it: the page reads pieces of that file where it is looked into closely.
//!
//! The file begins with [`BEGINNING`]. Blocks of at most 2¹⁴ samples of one track follow, in the order in which they were full:
//!
//! | bytes | content |
//! |---|---|
//! | 16 | the first abscissa and the step, as `f64`; a step of 0 says that the abscissae are not at equal steps |
//! | 16 for each column | an offset and a unit, as `f64`; a unit of 0 says that the block has no number of this column |
//! | 8 for each sample, where the step is 0 | the abscissae, as `f64` |
//! | 4 for each sample, column by column but for those without numbers | a number as `f32`, which times the unit, plus the offset, is the value; not a number where there is none |
//!
//! A description in JSON comes behind the blocks, then its length in bytes as `u64`, and [`END`]. All numbers are little-endian.
//! The description has the place, the length and the CRC-32 of each block; it is at the end because nothing of it is known before.

use crate::decimate::is_drawable;
use crate::page::SamplesLink;
use crate::record::{Abscissae, BandCentre, SampledQuantity, offset_and_unit};
use crc32fast::Hasher;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{self, Write};

/// The first bytes of the file.
pub const BEGINNING: &[u8; 16] = b"kalmems samples\n";
/// The last bytes of the file.
pub const END: &[u8; 8] = b"samples\n";
/// Samples of a block.
const BLOCK: usize = 1 << 14;

/// A file of all samples of the tracks of a page, written as they pass in memory that does not grow with them.
///
/// ```
/// use kalmems_figures::{SampledQuantity, SamplesWriter};
/// let mut samples = SamplesWriter::new(Vec::new())?;
/// let angle = SampledQuantity { unit: "deg", band: None };
/// samples.take("angle", angle, (0..100_000).map(|i| (1e-6 * f64::from(i), [f64::from(i % 7), f64::NAN])))?;
/// let (file, link) = samples.finish("samples.bin")?;
/// assert_eq!(link.bytes, file.len() as u64);
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug)]
pub struct SamplesWriter<W> {
    to: W,
    written: u64,
    tracks: BTreeMap<String, SampledTrack>,
}

#[derive(Debug)]
struct SampledTrack {
    unit: String,
    band: Option<BandCentre>,
    samples: u64,
    /// Place, length and CRC-32 of each block that is written.
    blocks: Vec<(u64, u64, u32)>,
    /// The samples of the next block.
    x: Vec<f64>,
    columns: Vec<Vec<f64>>,
}

impl<W: Write> SamplesWriter<W> {
    /// Begins a file.
    pub fn new(mut to: W) -> io::Result<Self> {
        to.write_all(BEGINNING)?;
        Ok(Self { to, written: BEGINNING.len() as u64, tracks: BTreeMap::new() })
    }

    /// Takes the next samples of a track: of each its abscissa, its value, and where the track has a band half of its width.
    ///
    /// As for a [`Track`](crate::Track), a sample whose abscissa is not finite is left out.
    pub fn take(
        &mut self,
        track: &str,
        quantity: SampledQuantity,
        samples: impl IntoIterator<Item = (f64, [f64; 2])>,
    ) -> io::Result<()> {
        if !self.tracks.contains_key(track) {
            self.tracks.insert(track.to_owned(), SampledTrack::new(quantity));
        }
        let Some(track) = self.tracks.get_mut(track) else { return Ok(()) };
        for (x, values) in samples {
            if !is_drawable(x) {
                continue;
            }
            track.x.push(x);
            for (column, value) in track.columns.iter_mut().zip(values) {
                column.push(if is_drawable(value) { value } else { f64::NAN });
            }
            if track.x.len() == BLOCK {
                self.written += track.write(&mut self.to, self.written)?;
            }
        }
        Ok(())
    }

    /// Ends the file: what of it is still in memory and the description. Gives back where it was written to, and what a page needs
    /// to know of the file, which has this name as seen from the page.
    pub fn finish(mut self, file: &str) -> io::Result<(W, SamplesLink)> {
        for track in self.tracks.values_mut() {
            self.written += track.write(&mut self.to, self.written)?;
        }
        let tracks: serde_json::Map<String, Value> =
            self.tracks.iter().map(|(name, track)| (name.clone(), track.description())).collect();
        let description = json!({ "kalmems_samples": 1, "samples_of_a_block": BLOCK, "tracks": tracks });
        let description = description.to_string();
        self.to.write_all(description.as_bytes())?;
        self.to.write_all(&(description.len() as u64).to_le_bytes())?;
        self.to.write_all(END)?;
        let bytes = self.written + (description.len() + 8 + END.len()) as u64;
        let crc32 = crc32fast::hash(description.as_bytes());
        Ok((self.to, SamplesLink { file: file.to_owned(), bytes, crc32 }))
    }
}

impl SampledTrack {
    fn new(quantity: SampledQuantity) -> Self {
        let columns = if quantity.band.is_some() { 2 } else { 1 };
        Self {
            unit: quantity.unit.to_owned(),
            band: quantity.band,
            samples: 0,
            blocks: Vec::new(),
            x: Vec::with_capacity(BLOCK),
            columns: vec![Vec::with_capacity(BLOCK); columns],
        }
    }

    /// Writes what it holds as a block that begins at this place; the length of the block.
    fn write(&mut self, to: &mut impl Write, at: u64) -> io::Result<u64> {
        if self.x.is_empty() {
            return Ok(0);
        }
        let x = Abscissae::of(&self.x);
        let (first, step) = if let Abscissae::Equal(first, step, _) = x { (first, step) } else { (0.0, 0.0) };
        let scale = |column: &Vec<f64>| {
            if column.iter().all(|value| value.is_nan()) { (0.0, 0.0) } else { offset_and_unit(column) }
        };
        let scales: Vec<(f64, f64)> = self.columns.iter().map(scale).collect();
        let mut block = Vec::with_capacity(16 + (16 + 4 * BLOCK) * self.columns.len());
        for number in
            [first, step].into_iter().chain(scales.iter().flat_map(|(offset, unit)| [*offset, *unit]))
        {
            block.extend_from_slice(&number.to_le_bytes());
        }
        if let Abscissae::Each(x) = &x {
            block.extend(x.iter().flat_map(|x| x.to_le_bytes()));
        }
        for (column, (offset, unit)) in self.columns.iter().zip(&scales).filter(|(_, (_, unit))| *unit > 0.0)
        {
            #[allow(clippy::cast_possible_truncation)] // rounded on purpose
            block.extend(column.iter().flat_map(|value| (((value - offset) / unit) as f32).to_le_bytes()));
        }
        to.write_all(&block)?;
        let mut crc = Hasher::new();
        crc.update(&block);
        self.blocks.push((at, block.len() as u64, crc.finalize()));
        self.samples += self.x.len() as u64;
        self.x.clear();
        self.columns.iter_mut().for_each(Vec::clear);
        Ok(block.len() as u64)
    }

    fn description(&self) -> Value {
        let columns: &[&str] = if self.band.is_some() { &["value", "half_width"] } else { &["value"] };
        let band = self.band.map(|centre| match centre {
            BandCentre::Value => "value",
            BandCentre::Zero => "zero",
        });
        json!({ "unit": self.unit, "samples": self.samples, "columns": columns, "band_about": band, "blocks": self.blocks })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Abscissa, value and half width of each sample of a track, read as the description of the file says.
    fn read(file: &[u8], track: &str) -> Vec<[f64; 3]> {
        let (rest, end) = file.split_at(file.len() - 8);
        assert!(end == END && rest.starts_with(BEGINNING));
        let (rest, length) = rest.split_at(rest.len() - 8);
        let length = usize::try_from(u64::from_le_bytes(length.try_into().unwrap())).unwrap();
        let known: Value = serde_json::from_slice(&rest[rest.len() - length..]).unwrap();
        let per = known["samples_of_a_block"].as_u64().unwrap();
        let track = &known["tracks"][track];
        let (mut left, mut all) = (track["samples"].as_u64().unwrap(), Vec::new());
        let columns = track["columns"].as_array().unwrap().len();
        for block in track["blocks"].as_array().unwrap() {
            let [at, bytes, crc] = [0, 1, 2].map(|k| usize::try_from(block[k].as_u64().unwrap()).unwrap());
            let block = &file[at..at + bytes];
            assert_eq!(crc32fast::hash(block) as usize, crc);
            let f64_at =
                |place: usize| f64::from_le_bytes(block[8 * place..8 * place + 8].try_into().unwrap());
            let count = usize::try_from(left.min(per)).unwrap();
            left -= count as u64;
            let (first, step) = (f64_at(0), f64_at(1));
            let head = 2 + 2 * columns;
            let numbers = 8 * (head + if step == 0.0 { count } else { 0 });
            // Columns without numbers are not there.
            let stored = (0..columns).filter(|column| f64_at(3 + 2 * column) > 0.0).count();
            for k in 0..count {
                let x = if step == 0.0 { f64_at(head + k) } else { first + step * k as f64 };
                let value = |column: usize| {
                    if column >= stored {
                        return f64::NAN;
                    }
                    let place = numbers + 4 * (column * count + k);
                    let number = f32::from_le_bytes(block[place..place + 4].try_into().unwrap());
                    f64_at(2 + 2 * column) + f64_at(3 + 2 * column) * f64::from(number)
                };
                all.push([x, value(0), value(1)]);
            }
            assert_eq!(numbers + 4 * stored * count, bytes);
        }
        assert_eq!(left, 0);
        all
    }

    fn value(i: u32) -> f64 {
        if i == 20_000 { f64::NAN } else { 1e-11 + 1e-15 * (f64::from(i) / 50.0).sin() }
    }

    #[test]
    fn each_sample_is_there_to_seven_digits_of_the_range_of_its_block_however_they_came() {
        let time = |i: u32| 3.0 + 1e-6 * f64::from(i);
        // At no equal steps.
        let odd = |i: u32| f64::from(i) + if i.is_multiple_of(3) { 0.4 } else { 0.0 };
        let mut samples = SamplesWriter::new(Vec::new()).unwrap();
        let signal = SampledQuantity { unit: "F", band: Some(BandCentre::Value) };
        let events = SampledQuantity { unit: "V", band: Some(BandCentre::Zero) };
        for part in [0..7, 7..30_000, 30_000..40_000_u32] {
            samples.take("signal", signal, part.clone().map(|i| (time(i), [value(i), 1e-18]))).unwrap();
            samples.take("events", events, part.map(|i| (odd(i), [-f64::from(i), f64::NAN]))).unwrap();
        }
        samples.take("events", events, [(f64::NAN, [0.0; 2])]).unwrap();
        let (file, link) = samples.finish("samples.bin").unwrap();
        assert_eq!(link.bytes, file.len() as u64);
        let found = read(&file, "signal");
        assert_eq!(found.len(), 40_000);
        for (i, [x, found, half]) in (0..).zip(found) {
            assert!((x - time(i)).abs() < 1e-9, "{i}");
            assert!((found - value(i)).abs() < 2e-22 || i == 20_000 && found.is_nan(), "{i}: {found}");
            assert!((half - 1e-18).abs() < 1e-24);
        }
        for (i, [x, found, _]) in (0..).zip(read(&file, "events")) {
            assert_eq!((x, found), (odd(i), -f64::from(i)));
        }
    }

    #[test]
    fn a_file_without_samples_has_its_description_alone() {
        let (file, _) = SamplesWriter::new(Vec::new()).unwrap().finish("samples.bin").unwrap();
        assert!(file.starts_with(BEGINNING) && file.ends_with(END));
    }

    #[test]
    fn memory_does_not_grow_with_the_samples() {
        let mut samples = SamplesWriter::new(io::sink()).unwrap();
        let angle = SampledQuantity { unit: "deg", band: None };
        samples.take("angle", angle, (0..1_000_000).map(|i| (f64::from(i), [f64::from(i); 2]))).unwrap();
        let held = &samples.tracks["angle"];
        assert!(held.x.len() < BLOCK && held.x.capacity() == BLOCK);
        assert_eq!(held.blocks.len(), 1_000_000 / BLOCK);
    }
}
