//! What only who was told the address knows.

/// Bytes of a token.
const BYTES: usize = 16;

/// A new one, as letters and digits.
pub fn random() -> Result<String, getrandom::Error> {
    let mut bytes = [0_u8; BYTES];
    getrandom::fill(&mut bytes)?;
    let digits = bytes.iter().flat_map(|byte| [byte >> 4, byte & 15]);
    Ok(digits.filter_map(|digit| char::from_digit(u32::from(digit), 16)).collect())
}

/// Whether this is the token; how long it takes does not tell how much of it is right.
pub fn is_same(found: &str, token: &str) -> bool {
    let differences = found.bytes().zip(token.bytes()).fold(0, |all, (a, b)| all | (a ^ b));
    found.len() == token.len() && differences == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_is_new_each_time_and_only_itself_is_the_same() {
        let (one, other) = (random().unwrap(), random().unwrap());
        assert!(one.len() == 32 && one != other);
        assert!(is_same(&one, &one) && !is_same(&one, &other));
        assert!(!is_same("", &one) && !is_same(&one[..31], &one) && !is_same(&format!("{one}0"), &one));
    }
}
