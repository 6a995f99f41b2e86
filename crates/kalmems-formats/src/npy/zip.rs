//! The members of a zip file, whose directory the library `rawzip` reads: what is compared with the file before a byte of them is used.

use crate::limits;
use crate::source::SharedFile;
use crate::stream::{Compression, FileStretch};
use crate::{FormatError, Result};
use rawzip::{CompressionMethod, MAX_CENTRAL_DIRECTORY_RECORD_SIZE, ReaderAt, ZipLocator};
use std::io;
use std::sync::Arc;

const FORMAT: &str = "NPZ";

impl ReaderAt for SharedFile {
    fn read_at(&self, buffer: &mut [u8], offset: u64) -> io::Result<usize> {
        self.read_some(offset, buffer)
    }
}

/// A file in the zip file.
pub(super) struct ZipMember {
    pub(super) name: String,
    method: CompressionMethod,
    is_encrypted: bool,
    unpacked: u64,
    crc: u32,
    /// Its own header, and where its packed bytes begin and end.
    header: u64,
    start: u64,
    end: u64,
}

/// Reads the directory, and compares it with the members' own headers.
pub(super) fn members(source: &Arc<SharedFile>) -> Result<Vec<ZipMember>> {
    let mut buffer = vec![0; MAX_CENTRAL_DIRECTORY_RECORD_SIZE];
    let archive = ZipLocator::new().locate_in_reader(source, &mut buffer, source.length());
    let archive = archive.map_err(|(_, error)| failed(source.length(), &error))?;
    let directory = archive.directory_offset();
    let mut own = vec![0; 2 * usize::from(u16::MAX)];
    let (mut entries, mut members, mut mismatch) = (archive.entries(&mut buffer), Vec::new(), None);
    while let Some(entry) = entries.next_entry().map_err(|error| failed(directory, &error))? {
        let (path, header) = (entry.file_path(), entry.local_header_offset());
        let there = archive.get_entry(entry.wayfinder()).map_err(|error| failed(header, &error))?;
        let local = there.local_header(&mut own).map_err(|error| failed(header, &error))?;
        // The directory and the member's own header both have its name and its method.
        let name = |path: &[u8]| String::from_utf8_lossy(path).into_owned();
        let (said, method) = (name(path.as_ref()), entry.compression_method());
        if local.file_path().as_ref() != path.as_ref() || local.compression_method() != method {
            let (own_name, own_method) = (name(local.file_path().as_ref()), local.compression_method());
            let found = format!("a header of `{}`, packed by {own_method:?}", own_name.escape_debug());
            let expected = format!("that of `{said}`, packed by {method:?}, as the directory says");
            mismatch.get_or_insert_with(|| FormatError::damaged_at(FORMAT, header, found, expected));
        }
        let (start, end) = there.compressed_data_range();
        source.within(FORMAT, start, end - start)?;
        let (unpacked, crc) = (entry.uncompressed_size_hint(), entry.crc32());
        let is_encrypted = entry.flags().bits() & 1 != 0;
        let member = ZipMember { name: said, method, is_encrypted, unpacked, crc, header, start, end };
        limits::push(FORMAT, "the number of members", &mut members, member)?;
    }
    if members.len() as u64 != archive.entries_hint() {
        let found = format!("{} members", members.len());
        return Err(FormatError::damaged_at(FORMAT, directory, found, archive.entries_hint().to_string()));
    }
    refuse_overlaps(&members, directory)?;
    mismatch.map_or(Ok(members), Err)
}

impl ZipMember {
    /// Where its bytes are.
    pub(super) fn stretch(&self, source: Arc<SharedFile>) -> Result<FileStretch> {
        let packing = match self.method {
            _ if self.is_encrypted => Err("encrypted".to_owned()),
            CompressionMethod::STORE => Ok(Compression::Stored),
            CompressionMethod::DEFLATE => Ok(Compression::Deflate),
            other => Err(format!("packed by {other:?}")),
        };
        let packing = packing.map_err(|what| {
            let remedy = "write the file with numpy.savez or numpy.savez_compressed";
            FormatError::unsupported(FORMAT, format!("`{}`, which is {what},", self.name), remedy)
        })?;
        let &Self { start, end, unpacked, .. } = self;
        if packing == Compression::Stored && end - start != unpacked {
            let found = "unpacked bytes of another length";
            return Err(FormatError::damaged_at(FORMAT, self.header, found, "the same"));
        }
        let (name, crc) = (format!("`{}`", self.name), Some(self.crc));
        limits::plausible_unpacked(FORMAT, &name, unpacked, end - start)?;
        let verified = Arc::default();
        Ok(FileStretch { source, format: FORMAT, name, packing, start, end, unpacked, crc, verified })
    }
}

/// Members that share bytes unpack to more than the file could hold.
fn refuse_overlaps(members: &[ZipMember], directory: u64) -> Result<()> {
    let mut places: Vec<(u64, u64)> = members.iter().map(|member| (member.header, member.end)).collect();
    places.sort_unstable();
    let starts = places.iter().skip(1).map(|(start, _)| *start).chain([directory]);
    match places.iter().zip(starts).find(|((_, end), next)| end > next) {
        None => Ok(()),
        Some(((start, _), _)) => {
            let found = "a member that reaches into what follows";
            Err(FormatError::damaged_at(FORMAT, *start, found, "members one after the other"))
        }
    }
}

/// What the library says of the file.
fn failed(place: u64, error: &rawzip::Error) -> FormatError {
    FormatError::damaged_at(FORMAT, place, error.to_string(), "the end of a zip file that is whole")
}
