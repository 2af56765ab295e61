//! Wrappings around a file's own bytes: gzip, and text in Latin-1. Also names of foreign files.

use std::borrow::Cow;
use std::io::Read;

use flate2::read::MultiGzDecoder;

use super::import_error::{ImportError, shown};

/// Most bytes of a file that was unpacked; as many as the largest XML file.
const UNPACKED_MAX: u64 = 256 << 20;
/// Number of bytes in which an XML declaration ends.
const DECLARATION_MAX: usize = 256;

/// Returns the bytes as the readers take them: out of gzip, and an XML file that declares Latin-1 as UTF-8.
///
/// # Errors
/// The packed data is damaged, cut off or too large, or an XML file declares an encoding that is not read.
pub(super) fn unwrapped<'b>(file: &str, bytes: &'b [u8]) -> Result<Cow<'b, [u8]>, ImportError> {
    if !is_gzip(bytes) {
        return in_utf8(file, Cow::Borrowed(bytes));
    }
    let mut out = Vec::new();
    let refuse = |expected: String, remedy: &str| ImportError::new(file, "its gzip data", expected, remedy);
    MultiGzDecoder::new(bytes).take(UNPACKED_MAX + 1).read_to_end(&mut out).map_err(|error| {
        refuse(format!("a whole gzip file ({error})"), "the file is damaged or cut off; fetch it again")
    })?;
    if out.len() as u64 > UNPACKED_MAX {
        return Err(refuse("at most 256 MiB when it is unpacked".into(), "unpack and split the file"));
    }
    in_utf8(file, Cow::Owned(out))
}

/// Returns the beginning of a file out of gzip, as far as the given beginning of the packed file reaches.
pub(super) fn unwrapped_head(head: &[u8], most: usize) -> Cow<'_, [u8]> {
    if !is_gzip(head) {
        return Cow::Borrowed(head);
    }
    let mut out = Vec::new();
    // It ends in the middle of the data, which is no error here.
    let _ = MultiGzDecoder::new(head).take(most as u64).read_to_end(&mut out);
    Cow::Owned(out)
}

fn is_gzip(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x1f\x8b\x08")
}

fn in_utf8<'b>(file: &str, bytes: Cow<'b, [u8]>) -> Result<Cow<'b, [u8]>, ImportError> {
    let Some(encoding) = declared_encoding(&bytes).filter(|_| std::str::from_utf8(&bytes).is_err()) else {
        return Ok(bytes);
    };
    match encoding.to_ascii_lowercase().as_str() {
        "iso-8859-1" | "iso8859-1" | "iso_8859-1" | "latin1" | "latin-1" => {
            // The characters of Latin-1 are the first 256 of Unicode.
            Ok(Cow::Owned(bytes.iter().map(|&byte| char::from(byte)).collect::<String>().into_bytes()))
        }
        _ => {
            let encoding = shown(&encoding);
            let remedy = format!("save it as UTF-8: iconv -f {encoding} -t UTF-8");
            Err(ImportError::new(file, "line 1", format!("text in UTF-8 or ISO-8859-1, found {encoding}"), remedy))
        }
    }
}

/// Returns the encoding that an XML file names in its declaration.
fn declared_encoding(bytes: &[u8]) -> Option<String> {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(DECLARATION_MAX)]);
    let declaration = head.trim_start().strip_prefix("<?xml")?.split_once("?>")?.0;
    let (_, value) = declaration.split_once("encoding")?;
    let value = value.trim_start().strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|c| matches!(c, '"' | '\''))?;
    Some(value[1..].split_once(quote)?.0.trim().to_string())
}

/// Describes a file that holds no scene in a readable form, by its beginning, and says what to do.
pub(super) fn foreign(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    const CONVERT: &str = "convert its scenes to ScenarioNet pickles, with ScenarioNet's converters";
    const BEGINNINGS: [(&[u8], &str, &str); 10] = [
        (b"PK\x03\x04", "a ZIP archive (.zip, .npz)", "unpack it, and import the files in it"),
        (b"\x28\xb5\x2f\xfd", "a file packed with zstd", "unpack it: zstd -d"),
        (b"BZh", "a file packed with bzip2", "unpack it: bunzip2"),
        (b"\xfd7zXZ\0", "a file packed with xz", "unpack it: unxz"),
        (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", "unpack it, and import the files in it"),
        (b"PAR1", "a Parquet table, as Argoverse 2 has them", CONVERT),
        (b"SQLite format 3\0", "an SQLite database, as nuPlan has them", CONVERT),
        (b"\x89HDF", "an HDF5 file", CONVERT),
        (b"\x93NUMPY", "a NumPy array", CONVERT),
        (
            b"version https://git-lfs",
            "a pointer of Git LFS in place of the file",
            "fetch the file itself: git lfs pull",
        ),
    ];
    if bytes.get(257..262) == Some(b"ustar") {
        return Some(("a tar archive", "unpack it, and import the files in it"));
    }
    if bytes.starts_with(b"track_id,") || bytes.starts_with(b"case_id,") {
        return Some(("a CSV table of tracks, as INTERACTION has them", "convert it to CommonRoad XML with its map"));
    }
    BEGINNINGS.iter().find(|(begins, ..)| bytes.starts_with(begins)).map(|(_, name, remedy)| (*name, *remedy))
}

/// Describes an XML file whose root element no reader takes, and says what to do.
pub(super) fn foreign_root(holds: impl Fn(&[u8]) -> bool) -> (&'static str, &'static str) {
    if holds(b"<OpenSCENARIO") {
        return ("an OpenSCENARIO file, which is written and not read", "import the scene that it was made of");
    }
    if holds(b"<osm") {
        return ("an OpenStreetMap or Lanelet2 file", "convert the map with its tracks to CommonRoad XML");
    }
    ("another one", "EvoDrive reads CommonRoad XML; convert the file or leave it out")
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn packed(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn gzip_is_unpacked_part_by_part_and_damage_is_named() {
        assert_eq!(unwrapped("f", b"plain").unwrap().as_ref(), b"plain");
        let two = [packed(b"one "), packed(b"two")].concat();
        assert_eq!(unwrapped("f", &two).unwrap().as_ref(), b"one two");
        assert_eq!(unwrapped_head(&two[..two.len() - 9], 3).as_ref(), b"one");
        let cut = unwrapped("f", &two[..two.len() - 3]).unwrap_err().to_string();
        assert!(cut.contains("a whole gzip file") && cut.contains("fetch it again"), "{cut}");
    }

    #[test]
    fn what_unpacks_to_more_than_any_scene_is_refused() {
        let bomb = packed(&vec![0; (UNPACKED_MAX + 2) as usize]);
        assert!(bomb.len() < 4 << 20);
        assert!(unwrapped("f", &bomb).unwrap_err().to_string().contains("at most 256 MiB"));
    }

    #[test]
    fn latin_1_is_read_where_it_is_declared_and_another_encoding_is_named() {
        let text = |encoding: &str| {
            [format!("<?xml version='1.0' encoding='{encoding}'?><a n='").as_bytes(), b"K\xf6ln'/>"].concat()
        };
        for name in ["ISO-8859-1", "latin1"] {
            let read = unwrapped("f", &text(name)).unwrap().into_owned();
            assert!(String::from_utf8(read).unwrap().ends_with("n='K\u{f6}ln'/>"), "{name}");
        }
        let other = unwrapped("f", &text("windows-1252")).unwrap_err().to_string();
        assert!(other.contains("found windows-1252") && other.contains("iconv -f windows-1252"), "{other}");
        // Declared as Latin-1, but UTF-8 all the same.
        let utf8 = "<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?><a n='K\u{f6}ln'/>".as_bytes();
        assert_eq!(unwrapped("f", utf8).unwrap().as_ref(), utf8);
        assert_eq!(unwrapped("f", b"\xf6 no declaration").unwrap().as_ref(), b"\xf6 no declaration");
    }
}
