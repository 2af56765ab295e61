//! RO-Crate 1.1 metadata of a bundle, for archives and search engines. It says nothing that the manifest does not say.

use serde_json::{Value, json};

use super::manifest::Manifest;
use super::names::{CRATE, FILES, MANIFEST};

/// Facts that only the author of a bundle knows.
pub struct Publication<'a> {
    /// ISO 8601, at least a day.
    pub date: &'a str,
    /// Address or name of a license.
    pub license: &'a str,
}

/// Returns the metadata of a bundle with these files, this one not among them.
pub fn metadata(manifest: &Manifest, publication: &Publication<'_>) -> Vec<u8> {
    let listed = manifest.files.iter().map(|content| (content.path.as_str(), Some(content.bytes)));
    let listed: Vec<(&str, Option<u64>)> = listed.chain([(MANIFEST, None)]).collect();
    let parts: Vec<Value> = listed.iter().map(|(path, _)| json!({"@id": path})).collect();
    let versions = &manifest.versions;
    let mut graph = vec![
        json!({"@id": CRATE, "@type": "CreativeWork", "about": {"@id": "./"},
            "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"}}),
        json!({"@id": "./", "@type": "Dataset", "name": format!("EvoDrive run {}", manifest.name),
            "description": format!("Experiment, scenes, recorded answers, events and result of one run; root {}.", manifest.root),
            "identifier": manifest.root, "datePublished": publication.date, "license": {"@id": license_id(publication)},
            "hasPart": parts}),
        json!({"@id": license_id(publication), "@type": "CreativeWork", "name": publication.license,
            "description": "License of this run, as its author named it."}),
        json!({"@id": "#evodrive", "@type": "SoftwareApplication", "name": "EvoDrive", "version": versions.evodrive,
            "softwareVersion": format!("{} (adapter {}, simulator {}, evaluation {})", versions.evodrive, versions.adapter,
                versions.sim, versions.eval)}),
        json!({"@id": "#run", "@type": "CreateAction", "name": format!("run of {}", manifest.name),
            "instrument": {"@id": "#evodrive"}, "object": [{"@id": "experiment.toml"}, {"@id": "scenes.pool"},
            {"@id": "cassette.jsonl"}], "result": [{"@id": "transcript.jsonl"}, {"@id": "result.json"}]}),
    ];
    graph.extend(listed.iter().map(|(path, bytes)| file(path, *bytes)));
    let whole = json!({"@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph});
    let mut text = serde_json::to_vec_pretty(&whole).unwrap_or_default();
    text.push(b'\n');
    text
}

fn license_id(publication: &Publication<'_>) -> String {
    if publication.license.starts_with("https://") { publication.license.to_string() } else { "#license".to_string() }
}

fn file(path: &str, bytes: Option<u64>) -> Value {
    let known = FILES.iter().find(|(name, ..)| *name == path);
    let (what, media) =
        known.map_or(("names, sizes and BLAKE3 digests of all files", "application/json"), |of| (of.1, of.2));
    let mut file = json!({"@id": path, "@type": "File", "name": path, "description": what, "encodingFormat": media});
    if let Some(bytes) = bytes {
        file["contentSize"] = json!(bytes.to_string());
    }
    file
}
