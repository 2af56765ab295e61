//! From TOML that somebody may have written to a program file. What is left out is the family's own; digests are computed anew,
//! and where the content is not what the file was made with, its way here ends in a hand.

use serde::Deserialize;
use serde_json::Map;
use std::collections::{BTreeMap, BTreeSet};
use toml::{Table, Value};

use super::contract::source_of;
use super::finding::Finding;
use super::{CarriedCounsel, Conditions, ContractMark, FORMAT, ProgramFile, ProgramFileError, parts, published};
use crate::adapters::{ADAPTER_VERSION, Problem};
use crate::experiment::toml_file;
use crate::kernel::{Digest, canon::CanonError};
use crate::objects::pointer::within;
use crate::objects::{
    Ancestor, CompileContract, FamilyName, Gate, HandOrigin, LineageId, Origin, ParameterValue, Program, SolutionId,
};
use crate::scene::safebench::TrafficFamily;
use crate::store;

/// The keys of the file.
const KEYS: [&str; 16] = [
    "format",
    "family",
    "adapter",
    "name",
    "made",
    "parameters",
    "operator_graph",
    "scenario_conditioned_policy",
    "mechanism_modules",
    "descent",
    "origins",
    "parent_settings",
    "conditions",
    "parent",
    "counsel",
    "sequences",
];
const PARTS: [&str; 4] = ["parameters", "operator_graph", "scenario_conditioned_policy", "mechanism_modules"];
/// Suffix of the name of a program that was changed by hand, where its own name is taken.
const HAND: &str = "-hand";

/// Everything but the parts of program and parent, which are typed one by one.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    format: String,
    family: FamilyName,
    /// Looked at before.
    #[serde(rename = "adapter")]
    _adapter: Option<u32>,
    name: Option<SolutionId>,
    made: Option<Made>,
    descent: Option<Descent>,
    #[serde(default)]
    origins: Vec<Origin>,
    #[serde(default)]
    parent_settings: BTreeMap<String, ParameterValue>,
    conditions: Option<Conditions>,
    parent: Option<Parent>,
    #[serde(default)]
    counsel: BTreeMap<String, CarriedCounsel>,
    #[serde(default)]
    sequences: BTreeMap<TrafficFamily, Vec<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Made {
    digest: Digest,
    program_hash: Digest,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Descent {
    lineage_id: Option<LineageId>,
    #[serde(default)]
    generation: u32,
    #[serde(default)]
    ancestor_chain: Vec<Ancestor>,
    #[serde(default)]
    evolution_scenes: BTreeSet<Digest>,
}

/// A parent's own fields; its parts are typed like the program's.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Parent {
    solution_id: SolutionId,
    lineage_id: LineageId,
    source_family: FamilyName,
    generation: u32,
    compile_contract: CompileContract,
    ancestor_chain: Vec<Ancestor>,
}

/// Reads the text; `file` is its name for messages. What the contract says of the program is asked by the caller.
///
/// # Errors
/// No TOML, another format or version, an unknown family, and every key and value that is not of its kind.
pub fn read(file: &str, text: &str) -> Result<ProgramFile, ProgramFileError> {
    let shape = |reason: String| ProgramFileError::Shape { file: file.into(), reason };
    if let Some((expected, found)) = store::toml_too_large(text) {
        return Err(shape(format!("expected {expected}, found {found}")));
    }
    let not_toml =
        |error: toml::de::Error| ProgramFileError::NotToml { file: file.into(), reason: toml_file::said(&error, text) };
    let mut table: Table = text.parse().map_err(not_toml)?;
    check_format(file, &table)?;
    let family =
        table.get("family").and_then(Value::as_str).ok_or_else(|| shape("missing the word `family`".into()))?;
    let source = source_of(file, &FamilyName::new(family))?;
    check_adapter(file, family, &table)?;
    let mut problems = not_finite("", &Value::Table(table.clone()));
    let unknown = table.keys().filter(|key| !KEYS.contains(&key.as_str()));
    problems.extend(unknown.map(|key| Problem::unknown(within("", key), "key", key, KEYS)));
    let own = taken(&mut table);
    let of_parent = table.get_mut("parent").and_then(Value::as_table_mut).map(taken);
    let refused = |problems: Vec<Problem>| ProgramFileError::Findings {
        file: file.into(),
        findings: problems.into_iter().map(|problem| Finding::at(Gate::Schema, problem, Some(text))).collect(),
    };
    let (own, of_own) = parts::typed(&own, "");
    problems.extend(of_own);
    let (parent_parts, of_parent) = of_parent.map_or_else(Default::default, |of| parts::typed(&of, "/parent"));
    problems.extend(of_parent);
    if !problems.is_empty() {
        return Err(refused(problems));
    }
    let written = rest(text, table).map_err(|problem| match problem {
        NotRest::Toml(error) => not_toml(error),
        NotRest::Problem(problem) => refused(vec![problem]),
    })?;
    let published = source.parent.clone();
    let lineage = written.descent.as_ref().and_then(|descent| descent.lineage_id.clone());
    let lineage = lineage.unwrap_or_else(|| published::lineage(&written.family));
    let descent = written.descent.unwrap_or(Descent {
        lineage_id: None,
        generation: 0,
        ancestor_chain: Vec::new(),
        evolution_scenes: BTreeSet::new(),
    });
    let adopted = published.adopted(&lineage);
    let parent = match written.parent {
        None => adopted.clone(),
        Some(of) => parent_parts.put_into(Program {
            solution_id: of.solution_id,
            lineage_id: of.lineage_id,
            source_family: of.source_family,
            generation: of.generation,
            compile_contract: of.compile_contract,
            ancestor_chain: of.ancestor_chain,
            ..adopted.clone()
        }),
    };
    let program = own.put_into(Program {
        solution_id: written.name.unwrap_or_else(|| published::name(&lineage)),
        generation: descent.generation,
        ancestor_chain: descent.ancestor_chain,
        ..adopted
    });
    let conditions = match written.conditions {
        Some(conditions) => conditions,
        None => published::conditions(&source.contract.backend).map_err(&shape)?,
    };
    let unprintable = |error: CanonError| shape(error.to_string());
    let drafted = ProgramFile {
        format: written.format,
        digest: Digest::of_bytes(&[]),
        family: written.family,
        contract: ContractMark::of(&source.contract).map_err(unprintable)?,
        program_hash: program.hash().map_err(unprintable)?,
        program,
        parent,
        parent_settings: written.parent_settings,
        conditions,
        counsel: written.counsel,
        sequences: written.sequences,
        evolution_scenes: descent.evolution_scenes,
        origins: written.origins,
    };
    stamped(drafted, written.made).map_err(unprintable)
}

fn check_format(file: &str, table: &Table) -> Result<(), ProgramFileError> {
    let format = table.get("format");
    if format.and_then(Value::as_str) == Some(FORMAT) {
        Ok(())
    } else {
        let found = format.map_or("missing".into(), |format| super::error::shown(&format.to_string()));
        Err(ProgramFileError::Format { file: file.into(), found, expected: FORMAT })
    }
}

/// A file of another version of the language would be compiled into something else.
fn check_adapter(file: &str, family: &str, table: &Table) -> Result<(), ProgramFileError> {
    match table.get("adapter") {
        None => Ok(()),
        Some(Value::Integer(version)) if *version == i64::from(ADAPTER_VERSION) => Ok(()),
        Some(other) => Err(ProgramFileError::Contract {
            file: file.into(),
            family: family.into(),
            changed: format!("adapter version {other} in the file, {ADAPTER_VERSION} here"),
        }),
    }
}

/// The parts as JSON, taken out of their table.
fn taken(table: &mut Table) -> Map<String, serde_json::Value> {
    let part = |name: &str| Some((name.to_string(), serde_json::to_value(table.remove(name)?).ok()?));
    PARTS.into_iter().filter_map(part).collect()
}

/// Why what stands beside the parts cannot be read.
enum NotRest {
    /// With its line.
    Toml(toml::de::Error),
    Problem(Problem),
}

/// Everything beside the parts, read from the text itself, so that an error has its line.
fn rest(text: &str, table: Table) -> Result<Written, NotRest> {
    Value::Table(table).try_into().map_err(|error: toml::de::Error| {
        // The same once more with places, which a value does not know.
        #[derive(Deserialize)]
        struct Placed {
            #[serde(rename = "made")]
            _made: Option<Made>,
            #[serde(rename = "descent")]
            _descent: Option<Descent>,
            #[serde(rename = "conditions")]
            _conditions: Option<Conditions>,
        }
        match toml::from_str::<Placed>(text) {
            Err(placed) => NotRest::Toml(placed),
            Ok(_) => NotRest::Problem(Problem::new(
                "/",
                error.message(),
                "the keys of docs/FORMAT.md with values of their types",
            )),
        }
    })
}

/// Numbers that are none.
fn not_finite(place: &str, value: &Value) -> Vec<Problem> {
    match value {
        Value::Float(x) if !x.is_finite() => vec![Problem::new(place, x.to_string(), "a finite number")],
        Value::Array(items) => {
            items.iter().enumerate().flat_map(|(i, item)| not_finite(&within(place, &i.to_string()), item)).collect()
        }
        Value::Table(table) => table.iter().flat_map(|(key, value)| not_finite(&within(place, key), value)).collect(),
        _ => Vec::new(),
    }
}

/// The file with its digest. What is not as it was made was written by hand, from the program that it was.
fn stamped(file: ProgramFile, made: Option<Made>) -> Result<ProgramFile, CanonError> {
    let file = file.sealed()?;
    if made.as_ref().is_some_and(|made| made.digest == file.digest) {
        return Ok(file);
    }
    let ProgramFile { mut program, mut origins, .. } = file.clone();
    let taken = |origin: &Origin| matches!(origin, Origin::Run(of) if of.solution == program.solution_id);
    if program.solution_id == file.parent.solution_id || origins.iter().any(taken) {
        program.solution_id = SolutionId::new(format!("{}{HAND}", program.solution_id));
    }
    // A patch leads from each ancestor to the next; from here on none does.
    program.generation = 0;
    program.ancestor_chain = Vec::new();
    let from = match origins.pop() {
        Some(Origin::Hand(before)) => before.from,
        other => {
            origins.extend(other);
            made.map(|made| made.program_hash)
        }
    };
    origins.push(Origin::Hand(HandOrigin { by_hand: program.solution_id.clone(), from }));
    ProgramFile { program, origins, ..file }.sealed()
}

impl ProgramFile {
    /// The file with another program in its place, written by hand from the one that it holds.
    ///
    /// # Errors
    /// A number that is not finite.
    pub fn rewritten(self, program: Program) -> Result<ProgramFile, CanonError> {
        let made = Made { digest: self.digest, program_hash: self.program_hash };
        let program_hash = program.hash()?;
        stamped(ProgramFile { program, program_hash, ..self }, Some(made))
    }
}
