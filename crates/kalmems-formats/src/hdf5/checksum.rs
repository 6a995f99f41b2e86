//! The checksum of HDF5's metadata: `lookup3` (Bob Jenkins, 2006, public domain).

/// The sum over all bytes, begun with zero.
pub(super) fn checksum(bytes: &[u8]) -> u32 {
    #[allow(clippy::cast_possible_truncation)] // as the sum has it
    let start = 0xdead_beef_u32.wrapping_add(bytes.len() as u32);
    let mut state = [start; 3];
    if bytes.is_empty() {
        return start;
    }
    let last = (bytes.len() - 1) / 12;
    for (number, twelve) in bytes.chunks(12).enumerate() {
        let mut words = [0; 12];
        words[..twelve.len()].copy_from_slice(twelve);
        for (sum, word) in state.iter_mut().zip(words.chunks_exact(4)) {
            *sum = sum.wrapping_add(u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
        }
        if number < last {
            mix(&mut state);
        }
    }
    let [mut a, mut b, mut c] = state;
    for (to_c, to_a, to_b) in [(14, 11, 25), (16, 4, 14)] {
        c = (c ^ b).wrapping_sub(b.rotate_left(to_c));
        a = (a ^ c).wrapping_sub(c.rotate_left(to_a));
        b = (b ^ a).wrapping_sub(a.rotate_left(to_b));
    }
    (c ^ b).wrapping_sub(b.rotate_left(24))
}

fn mix(state: &mut [u32; 3]) {
    let [mut a, mut b, mut c] = *state;
    for (first, second, third) in [(4, 6, 8), (16, 19, 4)] {
        a = a.wrapping_sub(c) ^ c.rotate_left(first);
        c = c.wrapping_add(b);
        b = b.wrapping_sub(a) ^ a.rotate_left(second);
        a = a.wrapping_add(c);
        c = c.wrapping_sub(b) ^ b.rotate_left(third);
        b = b.wrapping_add(a);
    }
    *state = [a, b, c];
}

#[cfg(test)]
mod tests {
    use super::checksum;

    /// The values that the author's own test program gives.
    #[test]
    fn sums_are_those_of_the_author() {
        assert_eq!(checksum(b""), 0xdead_beef);
        assert_eq!(checksum(b"Four score and seven years ago"), 0x1777_0551);
    }
}
