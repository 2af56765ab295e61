//! `lineage[].parent_program`: the program file from which a lineage starts. The file is read where it is named, and its
//! program takes the name's place, so that digest and run folder hold the program and not a path.

use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;
use toml::{Table, Value};

use super::key::shown;
use super::place::Place;
use super::program_file::{ContractMark, ProgramFile};
use super::{ExperimentError, OptionError};
use crate::kernel::Digest;
use crate::objects::{Origin, Program};

/// A program file as an experiment keeps it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParentProgram {
    /// Digest of the file.
    pub file: Digest,
    pub contract: ContractMark,
    pub program_hash: Digest,
    pub program: Program,
    /// Digests of the scenes on which it was evolved.
    pub evolution_scenes: BTreeSet<Digest>,
    /// The runs that it came out of, the oldest first.
    pub origins: Vec<Origin>,
}

impl ParentProgram {
    fn of(file: ProgramFile) -> ParentProgram {
        let ProgramFile { digest, contract, program_hash, program, evolution_scenes, origins, .. } = file;
        ParentProgram { file: digest, contract, program_hash, program, evolution_scenes, origins }
    }
}

/// Puts named programs into the table of the file at `place`. Says whether a file was named.
///
/// # Errors
/// A file that is no program file, or one of another contract; a program of another family than the lineage's.
pub fn inline(table: &mut Table, place: &Place) -> Result<bool, ExperimentError> {
    let Some(Value::Array(lineages)) = table.get_mut("lineage") else { return Ok(false) };
    let mut named = false;
    for (i, lineage) in lineages.iter_mut().enumerate() {
        let family = lineage.get("family").and_then(Value::as_str).map(String::from);
        let Some(value) = lineage.get_mut("parent_program") else { continue };
        let refuse = |found: String, expected: &str| ExperimentError::Option {
            file: place.name(),
            error: OptionError::new(format!("lineage[{i}].parent_program"), found, expected),
        };
        let name = match value {
            Value::String(name) => name,
            // What a run folder keeps.
            Value::Table(_) => continue,
            other => return Err(refuse(shown(other), "the name of a file that `evodrive program export` wrote")),
        };
        let path = place.path_beside(Path::new(name));
        let read = ProgramFile::read(&path)
            .map_err(|error| refuse(format!("{name:?} ({error})"), "a file that `evodrive program export` wrote"))?;
        if family.as_deref().is_some_and(|family| family != read.family.as_str()) {
            let found = format!("{name:?}, a program of family {}", read.family);
            return Err(refuse(
                found,
                "a program of the lineage's own family; correct lineage.family or name another file",
            ));
        }
        if !read.sequences.is_empty() {
            let found = format!("{name:?}, which plays control sequences of a file in place of a search");
            return Err(refuse(found, "a program that searches by itself; `evodrive apply` plays this one"));
        }
        let kept = ParentProgram::of(read);
        *value = Value::try_from(&kept).map_err(|error| refuse(format!("{name:?} ({error})"), "a program file"))?;
        named = true;
    }
    Ok(named)
}
