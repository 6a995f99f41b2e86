//! The checksum of parameters that a program keeps in its memory.

/// CRC-32 as Ethernet and zip files have it, in Rust as it is written into a source and as the version is made.
#[allow(clippy::all, clippy::pedantic, dead_code)] // written for any compiler
mod sums {
    include!("rust/crc.rs");
}

pub(super) use sums::crc32;

/// The text of it in Rust.
pub(super) const IN_RUST: &str = include_str!("rust/crc.rs");

/// What is around parameters in C, with `@name@` and `@NAME@` where the filter's name stands.
pub(super) const IN_C: &str = include_str!("c/parameters.c");

/// A number that changes with the names and the order of parameters.
pub(super) fn version(fields: &[String]) -> u32 {
    crc32(fields.join(",").as_bytes())
}

#[cfg(test)]
mod tests {
    /// The check value of the catalogues.
    #[test]
    fn the_sum_is_that_of_the_standard() {
        assert_eq!(super::crc32(b"123456789"), 0xCBF4_3926);
    }
}
