//! TensorFlow's record files: length, masked CRC-32C of the length, data, masked CRC-32C of the data.

use crate::formats::import_error::ImportError;

const HEAD_BYTES: usize = 12;
const TAIL_BYTES: usize = 4;

/// The records of a file, in order; ends after the first that is damaged.
pub struct Records<'a> {
    file: &'a str,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Records<'a> {
    /// Returns the records of a file's bytes.
    pub fn of(file: &'a str, bytes: &'a [u8]) -> Records<'a> {
        Records { file, bytes, at: 0 }
    }

    /// Returns `true` if bytes begin like a record file, that is, the first length matches its checksum.
    pub fn looks_like(bytes: &[u8]) -> bool {
        let check = bytes.get(8..HEAD_BYTES).and_then(|b| b.first_chunk()).map(|b| u32::from_le_bytes(*b));
        bytes.get(..8).is_some_and(|length| check == Some(masked_crc(length)))
    }

    fn record(&self) -> Result<(&'a [u8], usize), ImportError> {
        let refuse = |expected: &str| {
            let remedy = "the file is damaged or cut off; fetch it again";
            ImportError::new(self.file, format!("byte {}", self.at), expected, remedy)
        };
        let rest = &self.bytes[self.at..];
        if !Records::looks_like(rest) {
            return Err(refuse("a record's length with a checksum that fits"));
        }
        let length = rest.first_chunk().map(|b| u64::from_le_bytes(*b)).and_then(|n| usize::try_from(n).ok());
        let end = length.and_then(|n| n.checked_add(HEAD_BYTES));
        let whole = end.and_then(|end| end.checked_add(TAIL_BYTES)).filter(|&whole| whole <= rest.len());
        let (Some(end), Some(whole)) = (end, whole) else {
            return Err(refuse("a whole record, found the end of the file"));
        };
        let data = &rest[HEAD_BYTES..end];
        if rest[end..whole] != masked_crc(data).to_le_bytes() {
            return Err(refuse("a record whose data fits its checksum"));
        }
        Ok((data, whole))
    }
}

impl<'a> Iterator for Records<'a> {
    type Item = Result<&'a [u8], ImportError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.at >= self.bytes.len() {
            return None;
        }
        match self.record() {
            Ok((data, whole)) => {
                self.at += whole;
                Some(Ok(data))
            }
            Err(error) => {
                self.at = self.bytes.len();
                Some(Err(error))
            }
        }
    }
}

/// Returns the CRC-32C, rotated and shifted as TensorFlow does so that a checksum of checksums stays useful.
fn masked_crc(bytes: &[u8]) -> u32 {
    let crc = !bytes.iter().fold(!0u32, |crc, &byte| CRC32C[((crc ^ u32::from(byte)) & 0xff) as usize] ^ (crc >> 8));
    crc.rotate_right(15).wrapping_add(0xa282_ead8)
}

/// Table of Castagnoli's polynomial, reflected.
const CRC32C: [u32; 256] = {
    let mut table = [0u32; 256];
    let mut k = 0;
    while k < 256 {
        let mut value = k as u32;
        let mut bit = 0;
        while bit < 8 {
            value = if value & 1 == 1 { (value >> 1) ^ 0x82f6_3b78 } else { value >> 1 };
            bit += 1;
        }
        table[k] = value;
        k += 1;
    }
    table
};

/// Makes a record file of the given records.
#[cfg(test)]
pub(in crate::formats) fn written(records: &[Vec<u8>]) -> Vec<u8> {
    let mut out = Vec::new();
    for data in records {
        out.extend(head(data.len() as u64));
        out.extend_from_slice(data);
        out.extend_from_slice(&masked_crc(data).to_le_bytes());
    }
    out
}

/// Writes a record's length with its checksum.
#[cfg(test)]
pub(in crate::formats) fn head(length: u64) -> Vec<u8> {
    let length = length.to_le_bytes();
    [&length[..], &masked_crc(&length).to_le_bytes()].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_castagnoli_s() {
        let crc = masked_crc(b"123456789").wrapping_sub(0xa282_ead8).rotate_left(15);
        assert_eq!(crc, 0xe306_9283);
    }

    #[test]
    fn records_come_back_until_the_first_damage() {
        let bytes = written(&[b"one".to_vec(), vec![], b"three".to_vec()]);
        let read: Vec<&[u8]> = Records::of("f", &bytes).map(Result::unwrap).collect();
        assert_eq!(read, [b"one".as_slice(), b"", b"three"]);
        let mut damaged = bytes.clone();
        damaged[13] ^= 1;
        assert!(Records::of("f", &damaged).next().unwrap().is_err());
        assert!(Records::of("f", &bytes[..bytes.len() - 1]).last().unwrap().is_err());
    }

    #[test]
    fn a_huge_length_is_refused() {
        let length = u64::MAX.to_le_bytes();
        let mut bytes = length.to_vec();
        bytes.extend_from_slice(&masked_crc(&length).to_le_bytes());
        assert!(Records::of("f", &bytes).next().unwrap().is_err());
    }
}
