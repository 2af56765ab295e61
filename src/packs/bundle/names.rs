//! The names that a bundle may hold: a short list, so that no name leads out of the folder that it is unpacked to.

/// The manifest: the first entry.
pub const MANIFEST: &str = "manifest.json";
/// The signature: the last entry, where there is one.
pub const SIGNATURE: &str = "signature.dsse.json";
/// RO-Crate metadata.
pub const CRATE: &str = "ro-crate-metadata.json";
/// Recorded rollouts and trials of our own simulator.
pub const RECORDS: &str = "store/objects.pack";

/// Files of a run that a bundle may hold, with description and media type of each.
pub const FILES: [(&str, &str, &str); 8] = [
    ("cassette.jsonl", "recorded answers of models", "application/jsonl"),
    ("experiment.toml", "experiment file, with weights of learned egos and programs written out", "application/toml"),
    ("result.json", "root and result", "application/json"),
    (CRATE, "RO-Crate metadata", "application/ld+json"),
    ("rollouts.jsonl", "recorded rollouts of another simulator", "application/jsonl"),
    ("scenes.pool", "scenes that the run was made on", "application/octet-stream"),
    (RECORDS, "recorded rollouts and trials of the built-in simulator", "application/octet-stream"),
    ("transcript.jsonl", "events of the run, a hash chain; the hash of the last one is the root", "application/jsonl"),
];

/// Why no file of this name may be in a bundle.
pub fn refused(name: &str) -> Option<String> {
    let known = |name: &str| FILES.iter().any(|(file, ..)| *file == name) || [MANIFEST, SIGNATURE].contains(&name);
    if known(name) {
        return None;
    }
    let shown = crate::store::shortened(&format!("{name:?}"));
    let expected = "expected a name relative to the bundle";
    Some(if name.starts_with('/') || name.starts_with('\\') || name.chars().nth(1) == Some(':') {
        format!("{expected}, found the absolute name {shown}")
    } else if name.split(['/', '\\']).any(|part| part == "..") {
        format!("{expected}, found {shown}, which leads out of the folder")
    } else {
        let files: Vec<&str> = FILES.iter().map(|(file, ..)| *file).collect();
        format!("expected one of {}, found {shown}", files.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_of_the_list_are_taken_and_each_refusal_says_why() {
        assert!(FILES.iter().all(|(name, ..)| refused(name).is_none()));
        let mut sorted = FILES.map(|(name, ..)| name);
        sorted.sort_unstable();
        assert_eq!(sorted, FILES.map(|(name, ..)| name));
        for name in ["/etc/passwd", "C:\\x", "\\x"] {
            assert!(refused(name).unwrap().contains("absolute"), "{name}");
        }
        for name in ["../x", "store/../../x", "a\\..\\x"] {
            assert!(refused(name).unwrap().contains("leads out"), "{name}");
        }
        for name in ["", "./result.json", "store//objects.pack", "Result.json", "store"] {
            assert!(refused(name).unwrap().contains("expected one of"), "{name}");
        }
    }
}
