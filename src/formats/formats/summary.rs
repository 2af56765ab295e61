//! Imports many files at once. The format of each is recognised by its content, and everything that is left out is
//! named.

use std::collections::BTreeMap;

use super::conventions::Conventions;
use super::import_error::ImportError;
use super::imported::Imported;
use super::scenarionet::pickle::is_headless;
use super::scenarionet::{DATA_SET_FILES, pickle_name};
use super::waymo::tfrecord::Records;
use super::wrapped::{foreign, foreign_root, unwrapped, unwrapped_head};
use super::{
    commonroad::read as commonroad,
    gpudrive,
    opendrive::read as opendrive,
    safebench,
    scenarionet::{read_json as scenarionet_json, read_pickle as scenarionet},
    waymo,
};
use crate::kernel::Digest;
use crate::scene::validate::how_many;
use crate::scene::{LeftOut, Scene};

/// Scenes of many files.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportSummary {
    /// Scenes in the order of the files; every one passes [`Scene::validate`]; ids are unique.
    pub scenes: Vec<Scene>,
    /// Parts left out, with the reasons.
    pub left_out: Vec<LeftOut>,
}

/// Number of bytes at the start of a file that suffice to recognise its format.
pub const HEAD_BYTES: usize = 4096;

/// The role of a file among the files of a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// A scenario or several, read without any other file.
    Alone,
    /// Routes of SafeBench, which need the files that are [`Part::Beside`] them.
    Routes,
    /// A town or SafeBench's scenario file: it holds no scene, but routes need it.
    Beside,
}

/// Returns the role of a file, recognised by its first [`HEAD_BYTES`] bytes.
pub fn part(head: &[u8]) -> Part {
    let head = unwrapped_head(&head[..head.len().min(HEAD_BYTES)], HEAD_BYTES);
    if has_root(&head, b"<routes") {
        Part::Routes
    } else if has_root(&head, b"<OpenDRIVE") || safebench::looks_like_scenarios(&head) {
        Part::Beside
    } else {
        Part::Alone
    }
}

/// The files that routes need: towns and scenario files, with those that could not be read.
#[derive(Debug, Default)]
pub struct BesideRoutes {
    found: safebench::Library,
    /// Results by name and content, because files of several folders may share a name: the parts left out, or why a file was
    /// refused.
    read: BTreeMap<(String, Digest), Result<Imported, ImportError>>,
}

impl BesideRoutes {
    /// Reads a file that is [`Part::Beside`]. If it cannot be read, the reason is reported when the file itself is
    /// imported.
    pub fn add(&mut self, name: &str, bytes: &[u8]) {
        // A file that cannot be unwrapped is reported when it is imported.
        let Ok(bytes) = unwrapped(name, bytes) else { return };
        let bytes = bytes.as_ref();
        let mut imported = Imported::default();
        let read = if has_root(bytes, b"<OpenDRIVE") {
            opendrive::road(name, bytes, &mut imported).and_then(|road| self.found.add_town(name, road))
        } else {
            self.found.add_scenarios(name, bytes, &mut imported)
        };
        let key = (name.to_string(), Digest::of_bytes(bytes));
        if read.is_err() || !imported.left_out.is_empty() {
            // Of two equal files the first reports the parts left out.
            self.read.entry(key).or_insert(read.map(|()| imported));
        }
    }
}

/// Results of one file: scenes that break no rule, with their digests, and the parts left out.
#[derive(Debug, Default)]
pub struct FileScenes {
    scenes: Vec<(Scene, Digest)>,
    left_out: Vec<LeftOut>,
}

/// Reads one file of a list. `beside` holds the files that routes need, if the list has routes. A bad file gives no
/// scene, and the reason is in `left_out`.
pub fn read_file(name: &str, bytes: &[u8], beside: Option<&BesideRoutes>, conventions: Conventions) -> FileScenes {
    let bytes = match unwrapped(name, bytes) {
        Ok(bytes) => bytes,
        Err(error) => return FileScenes::left_out(name, reason(&error)),
    };
    let bytes = bytes.as_ref();
    let imported = match (part(bytes), beside) {
        // Such a file gives no scene, only the reason if it could not be read.
        (Part::Beside, Some(beside)) => {
            let read = beside.read.get(&(name.to_string(), Digest::of_bytes(bytes)));
            read.cloned().unwrap_or_else(|| Ok(Imported::default()))
        }
        (Part::Routes, Some(beside)) => safebench::import(name, bytes, &beside.found),
        _ => import_file(name, bytes, conventions),
    };
    let mut imported = match imported {
        Ok(imported) => imported,
        Err(error) => return FileScenes::left_out(name, reason(&error)),
    };
    let mut sound = Vec::with_capacity(imported.scenes.len());
    for scene in std::mem::take(&mut imported.scenes) {
        let violations = scene.validate();
        match violations.first() {
            None => {
                let digest = scene.digest();
                sound.push((scene, digest));
            }
            Some(first) => imported.leave_out(name, || {
                let reason = format!("it breaks {} validation rules, the first is: {first}", how_many(&violations));
                (scene.id.clone(), reason)
            }),
        }
    }
    FileScenes { scenes: sound, left_out: imported.listed(name) }
}

impl FileScenes {
    /// Makes the result of a file that is left out as a whole.
    pub fn left_out(name: &str, reason: String) -> FileScenes {
        let left_out = vec![LeftOut { file: name.into(), what: String::new(), reason }];
        FileScenes { scenes: vec![], left_out }
    }
}

/// Rule for a scene whose id a different scene has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SameId {
    /// It is left out.
    #[default]
    LeftOut,
    /// It gets a name of its own, with its file's name at the end.
    Renamed,
}

/// How files are read.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Rule for a scene whose id a different scene has.
    pub same_id: SameId,
    /// How the fields of road users are read.
    pub conventions: Conventions,
}

/// Joins the results of files, in the files' order. Of two scenes with one id the first is taken, and the other
/// follows `same_id`. Two forms of one scene in an export of ours, and the lists of a data set beside its scenes, are not
/// reported.
pub fn summed(files: impl IntoIterator<Item = (String, FileScenes)>, same_id: SameId) -> ImportSummary {
    let mut summary = ImportSummary::default();
    let mut taken: BTreeMap<String, (String, Digest)> = BTreeMap::new();
    for (name, read) in files {
        summary.left_out.extend(read.left_out);
        for (mut scene, digest) in read.scenes {
            let Some((file, earlier)) = taken.get(&scene.id) else {
                taken.insert(scene.id.clone(), (name.clone(), digest));
                summary.scenes.push(scene);
                continue;
            };
            if *earlier == digest && are_forms_of_one(file, &name) {
                continue;
            }
            let id = scene.id.clone();
            if *earlier == digest {
                let reason = format!("the same scene was already read from {file}");
                summary.left_out.push(LeftOut { file: name.clone(), what: id, reason });
                continue;
            }
            if same_id == SameId::LeftOut {
                let reason = format!(
                    "its id is already taken by a different scene of {file}; give it an id of its own, or import with \
                     --keep-both"
                );
                summary.left_out.push(LeftOut { file: name.clone(), what: id, reason });
                continue;
            }
            let reason = format!("{id} is a different scene of {file}; it was given a name of its own: ");
            scene.id = free_id(&id, &name, &taken);
            let reason = reason + &scene.id;
            summary.left_out.push(LeftOut { file: name.clone(), what: LeftOut::SCENE_ID.into(), reason });
            taken.insert(scene.id.clone(), (name.clone(), scene.digest()));
            summary.scenes.push(scene);
        }
    }
    if !summary.scenes.is_empty() {
        summary.left_out.retain(|left| !DATA_SET_FILES.contains(&left.file.as_str()));
    }
    summary
}

/// Returns an id that no scene has: the given one with the file's name behind it, and a number where that is taken too.
fn free_id(id: &str, file: &str, taken: &BTreeMap<String, (String, Digest)>) -> String {
    let stem = file.split('.').next().unwrap_or(file);
    let plain = format!("{id}@{stem}");
    let numbered = (2u64..).map(|number| format!("{plain}-{number}"));
    std::iter::once(plain.clone()).chain(numbered).find(|id| !taken.contains_key(id)).unwrap_or(plain)
}

/// Returns `true` if these are the JSON and the pickle that an export writes of a scene.
fn are_forms_of_one(a: &str, b: &str) -> bool {
    let twins = |json: &str, pickle: &str| json.strip_suffix(".json").is_some_and(|name| pickle == pickle_name(name));
    twins(a, b) || twins(b, a)
}

/// Imports files given as (name without folder, bytes). A bad file is left out and stops nothing.
pub fn import_files<N: AsRef<str>, B: AsRef<[u8]>>(files: &[(N, B)]) -> ImportSummary {
    let beside = files.iter().any(|(_, bytes)| part(bytes.as_ref()) == Part::Routes).then(|| {
        let mut beside = BesideRoutes::default();
        for (name, bytes) in files.iter().filter(|(_, bytes)| part(bytes.as_ref()) == Part::Beside) {
            beside.add(name.as_ref(), bytes.as_ref());
        }
        beside
    });
    let read = |(name, bytes): &(N, B)| {
        let name = name.as_ref();
        (name.to_string(), read_file(name, bytes.as_ref(), beside.as_ref(), Conventions::default()))
    };
    summed(files.iter().map(read), SameId::LeftOut)
}

fn reason(error: &ImportError) -> String {
    format!("{}: expected {}; {}", error.place, error.expected, error.remedy)
}

/// Returns `true` if the root element of an XML file begins like this, judged by its first bytes.
fn has_root(bytes: &[u8], element: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(HEAD_BYTES)];
    let first = head.iter().find(|b| !b.is_ascii_whitespace() && !matches!(b, 0xef | 0xbb | 0xbf));
    first == Some(&b'<') && head.windows(element.len()).any(|window| window == element)
}

/// Imports one file of any format. The format is recognised by the content, never by the name.
pub fn import_file(file: &str, bytes: &[u8], conventions: Conventions) -> Result<Imported, ImportError> {
    let bytes = unwrapped(file, bytes)?;
    let bytes = bytes.as_ref();
    let head = &bytes[..bytes.len().min(HEAD_BYTES)];
    let holds = |needle: &[u8]| head.windows(needle.len()).any(|window| window == needle);
    // A record begins with its length, which may look like the first letter of anything.
    if Records::looks_like(bytes) {
        return waymo::import_as(file, bytes, conventions);
    }
    let first = head.iter().find(|b| !b.is_ascii_whitespace() && !matches!(b, 0xef | 0xbb | 0xbf));
    if first == Some(&b'<') {
        if holds(b"<commonRoad") {
            return commonroad::import_as(file, bytes, conventions);
        }
        if holds(b"<OpenDRIVE") {
            let mut imported = Imported::default();
            let road = opendrive::road(file, bytes, &mut imported)?;
            let reason = format!("a road network of {} lanes alone: nothing says who drives on it", road.lanes.len());
            imported.left_out.insert(0, LeftOut { file: file.into(), what: String::new(), reason });
            return Ok(imported);
        }
        if holds(b"<routes") {
            return safebench::import(file, bytes, &safebench::Library::default());
        }
        let (found, remedy) = foreign_root(holds);
        return Err(ImportError::new(file, "line 1", format!("a root element <commonRoad>, found {found}"), remedy));
    }
    let marked = bytes.strip_prefix(b"\xef\xbb\xbf");
    if [bytes, marked.unwrap_or(bytes)].iter().any(|from| from.first() == Some(&0x80)) || is_headless(bytes) {
        return scenarionet::import_as(file, bytes, conventions);
    }
    if matches!(bytes, [0xff, 0xfe, ..] | [0xfe, 0xff, ..]) {
        let remedy = "save it as UTF-8; a pickle or a record file is no text: fetch it again as binary";
        return Err(ImportError::new(
            file,
            "byte 0",
            "UTF-8 or binary data, found a byte order mark of UTF-16",
            remedy,
        ));
    }
    // JSON behind a byte order mark is JSON.
    let bytes = marked.unwrap_or(bytes);
    // Its keys may come in any order. GPUDrive's road users have lengths too, but they are in a list called "objects".
    let described = [b"\"map_features\"".as_slice(), b"\"dynamic_map_states\"", b"\"sdc_id\""].into_iter().any(holds)
        || (holds(b"\"tracks\"") || holds(b"\"version\"") && holds(b"\"length\"")) && !holds(b"\"objects\"");
    if first == Some(&b'{') && described {
        return scenarionet_json::import_as(file, bytes, conventions);
    }
    if first == Some(&b'{') {
        if safebench::looks_like_scenarios(head) {
            let remedy = "import it together with the route files";
            return Err(ImportError::new(file, "byte 0", "route files beside this scenario file of SafeBench", remedy));
        }
        return gpudrive::import_as(file, bytes, conventions);
    }
    let (found, remedy) = foreign(bytes).map_or_else(
        || (String::new(), "see `evodrive scenes import --help` for the formats that are read"),
        |(name, remedy)| (format!(", found {name}"), remedy),
    );
    Err(ImportError::new(file, "byte 0", format!("a scene file of a known format{found}"), remedy))
}
