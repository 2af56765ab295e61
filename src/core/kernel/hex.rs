//! Bytes as hex digits, in one spelling.

/// Returns two lower-case digits per byte.
pub fn encoded(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the bytes of such a text; `None` for any other. As with digests there is one spelling: a letter in the other case is damage.
pub fn decoded(text: &str) -> Option<Vec<u8>> {
    let digit = |c: char| c.to_digit(16).filter(|_| !c.is_ascii_uppercase()).map(|d| d as u8);
    let digits = text.chars().map(digit).collect::<Option<Vec<u8>>>()?;
    let (pairs, rest) = digits.as_chunks::<2>();
    rest.is_empty().then(|| pairs.iter().map(|[high, low]| high * 16 + low).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_back_and_a_text_has_one_spelling() {
        let bytes: Vec<u8> = (0..=255).collect();
        assert_eq!(decoded(&encoded(&bytes)).unwrap(), bytes);
        for other in ["F0", "f", "+1", "g0", "é0"] {
            assert_eq!(decoded(other), None, "{other}");
        }
    }
}
