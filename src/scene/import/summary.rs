//! Many files at once: the format of each found by its content, what was left out named.

use std::collections::BTreeMap;

use super::error::ImportError;
use super::tfrecord::Records;
use super::{commonroad, gpudrive, opendrive, safebench, scenarionet, scenarionet_json, waymo};
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
    let beside = beside_routes(files);
    for (name, bytes) in files {
        let name = name.as_ref();
        let imported = match &beside {
            Some(library) if is_beside(bytes.as_ref()) => read_beside(name, library),
            Some(library) if has_root(bytes.as_ref(), b"<routes") => {
                safebench::import(name, bytes.as_ref(), &library.found)
            }
            _ => import_file(name, bytes.as_ref()),
        };
        match imported {
            Err(error) => {
                summary.left_out.push(LeftOut { file: name.into(), what: String::new(), reason: reason(&error) })
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

fn reason(error: &ImportError) -> String {
    format!("{}: expected {}; {}", error.place, error.expected, error.remedy)
}

/// Towns and scenario files, which are no scenes but are needed by route files, and those that could not be read.
#[derive(Default)]
struct BesideRoutes {
    found: safebench::Library,
    refused: BTreeMap<String, ImportError>,
}

/// What stands beside the route files of a list; `None` where there is no route file.
fn beside_routes<N: AsRef<str>, B: AsRef<[u8]>>(files: &[(N, B)]) -> Option<BesideRoutes> {
    files.iter().find(|(_, bytes)| has_root(bytes.as_ref(), b"<routes"))?;
    let mut beside = BesideRoutes::default();
    for (name, bytes) in files {
        let (name, bytes) = (name.as_ref(), bytes.as_ref());
        let read = if has_root(bytes, b"<OpenDRIVE") {
            opendrive::road(name, bytes).map(|road| beside.found.add_town(name, road))
        } else if safebench::looks_like_scenarios(head(bytes)) {
            beside.found.add_scenarios(name, bytes)
        } else {
            continue;
        };
        if let Err(error) = read {
            beside.refused.insert(name.to_string(), error);
        }
    }
    Some(beside)
}

fn is_beside(bytes: &[u8]) -> bool {
    has_root(bytes, b"<OpenDRIVE") || safebench::looks_like_scenarios(head(bytes))
}

/// A file that was read beside the routes gives no scene of its own, or the reason why it could not be read.
fn read_beside(name: &str, beside: &BesideRoutes) -> Result<Imported, ImportError> {
    beside.refused.get(name).map_or(Ok(Imported::default()), |error| Err(error.clone()))
}

fn head(bytes: &[u8]) -> &[u8] {
    &bytes[..bytes.len().min(4096)]
}

/// Whether an XML file's root element begins so, told by its first bytes.
fn has_root(bytes: &[u8], element: &[u8]) -> bool {
    let head = head(bytes);
    let first = head.iter().find(|b| !b.is_ascii_whitespace() && !matches!(b, 0xef | 0xbb | 0xbf));
    first == Some(&b'<') && head.windows(element.len()).any(|window| window == element)
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
        if holds(b"<routes") {
            return safebench::import(file, bytes, &safebench::Library::default());
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
        if safebench::looks_like_scenarios(head) {
            let remedy = "import it together with the route files";
            return Err(ImportError::new(file, "byte 0", "route files beside this scenario file of SafeBench", remedy));
        }
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
