//! Many files at once: the format of each found by its content, what was left out named.

use std::collections::BTreeMap;

use super::error::ImportError;
use super::tfrecord::Records;
use super::{commonroad, gpudrive, opendrive, scenarionet, scenarionet_json, waymo};
use crate::kernel::Digest;
use crate::scene::{LeftOut, Scene};

/// What one file gave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Imported {
    pub scenes: Vec<Scene>,
    pub left_out: Vec<LeftOut>,
}

/// What many files gave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportSummary {
    /// In the order of the files; every one passes [`Scene::validate`]; ids are unique.
    pub scenes: Vec<Scene>,
    pub left_out: Vec<LeftOut>,
}

/// Imports files given as (name without folder, bytes). A bad file is left out and stops nothing.
pub fn import_files<N: AsRef<str>, B: AsRef<[u8]>>(files: &[(N, B)]) -> ImportSummary {
    let mut summary = ImportSummary::default();
    let mut taken: BTreeMap<String, (String, Digest)> = BTreeMap::new();
    for (name, bytes) in files {
        let name = name.as_ref();
        match import_file(name, bytes.as_ref()) {
            Err(error) => {
                let reason = format!("{}: expected {}; {}", error.place, error.expected, error.remedy);
                summary.left_out.push(LeftOut { file: name.into(), what: String::new(), reason });
            }
            Ok(imported) => {
                summary.left_out.extend(imported.left_out);
                for scene in imported.scenes {
                    match refusal(&scene, &taken) {
                        Some(reason) => {
                            summary.left_out.push(LeftOut { file: name.into(), what: scene.id, reason });
                        }
                        None => {
                            taken.insert(scene.id.clone(), (name.to_string(), scene.digest()));
                            summary.scenes.push(scene);
                        }
                    }
                }
            }
        }
    }
    summary
}

/// Imports one file of whatever format, told by its content, never by its name.
pub fn import_file(file: &str, bytes: &[u8]) -> Result<Imported, ImportError> {
    let head = &bytes[..bytes.len().min(4096)];
    let holds = |needle: &[u8]| head.windows(needle.len()).any(|window| window == needle);
    let first = head.iter().find(|b| !b.is_ascii_whitespace() && !matches!(b, 0xef | 0xbb | 0xbf));
    if first == Some(&b'<') {
        if holds(b"<commonRoad") {
            return commonroad::import(file, bytes);
        }
        if holds(b"<OpenDRIVE") {
            let road = opendrive::road(file, bytes)?;
            let reason = format!("a road network of {} lanes alone: nothing says who drives on it", road.lanes.len());
            let left_out = vec![LeftOut { file: file.into(), what: String::new(), reason }];
            return Ok(Imported { scenes: vec![], left_out });
        }
        let remedy = "EvoDrive reads CommonRoad XML; convert the file or leave it out";
        return Err(ImportError::new(file, "line 1", "a root element <commonRoad>", remedy));
    }
    if bytes.first() == Some(&0x80) {
        return scenarionet::import(file, bytes);
    }
    // GPUDrive's road users have lengths too, but stand in a list called "objects".
    let described = holds(b"\"version\"") && holds(b"\"length\"") && !holds(b"\"objects\"");
    if first == Some(&b'{') && described {
        return scenarionet_json::import(file, bytes);
    }
    if first == Some(&b'{') {
        return gpudrive::import(file, bytes);
    }
    if Records::looks_like(bytes) {
        return waymo::import(file, bytes);
    }
    let remedy = "see `evodrive scenes import --help` for the formats that are read";
    Err(ImportError::new(file, "byte 0", "a scene file of a known format", remedy))
}

fn refusal(scene: &Scene, taken: &BTreeMap<String, (String, Digest)>) -> Option<String> {
    let violations = scene.validate();
    if let Some(first) = violations.first() {
        return Some(format!("it breaks {} rules of a sound scene, first {first}", violations.len()));
    }
    let (file, digest) = taken.get(&scene.id)?;
    Some(if *digest == scene.digest() {
        format!("the same scene was already read from {file}")
    } else {
        format!("its id is already taken by a different scene of {file}; give it an id of its own")
    })
}
