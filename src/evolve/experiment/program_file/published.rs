//! A family's published parent as a program file: where somebody who writes a program begins.

use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use toml::Table;

use super::contract::source_of;
use super::{Conditions, ContractMark, FORMAT, ProgramFile, ProgramFileError};
use crate::adapters::ADAPTER_VERSION;
use crate::evaluation::{EVAL_VERSION, EvaluationOptions};
use crate::experiment::calibration;
use crate::experiment::options::SimulatorTable;
use crate::experiment::place::{PROTOCOLS, Place};
use crate::kernel::Digest;
use crate::objects::event::Versions;
use crate::objects::{FamilyName, LineageId, Program, SolutionId};
use crate::sim::SIM_VERSION;

/// The driver that programs are written against where nothing else is said.
const EGO: &str = "idm";

/// The lineage of programs that were written by hand.
pub fn lineage(family: &FamilyName) -> LineageId {
    LineageId::new(format!("{family}-hand"))
}

/// The name of a program that has none.
pub fn name(lineage: &LineageId) -> SolutionId {
    SolutionId::new(format!("{lineage}/program"))
}

/// How the shipped protocol of a backend labels.
///
/// # Errors
/// No protocol of that name.
pub fn conditions(backend: &str) -> Result<Conditions, String> {
    #[derive(Deserialize)]
    struct Protocol {
        seed: u64,
        simulator: SimulatorTable,
        evaluation: EvaluationOptions,
    }
    let shipped = PROTOCOLS.into_iter().find(|(name, _)| *name == backend);
    let (name, text) = shipped.ok_or_else(|| format!("no protocol is called {backend}"))?;
    let mut table: Table = text.parse().map_err(|error: toml::de::Error| error.to_string())?;
    calibration::inline(&mut table, &Place::Shipped(name, text)).map_err(|error| error.to_string())?;
    let read: Protocol = toml::Value::Table(table).try_into().map_err(|error: toml::de::Error| error.to_string())?;
    Ok(Conditions {
        ego: EGO.into(),
        seed: read.seed,
        versions: Versions { adapter: ADAPTER_VERSION, sim: SIM_VERSION, eval: EVAL_VERSION },
        simulator: read.simulator.rules(),
        backend: None,
        evaluation: read.evaluation,
    })
}

impl ProgramFile {
    /// The published parent of a family under its shipped protocol, as a program that stands beside it.
    ///
    /// # Errors
    /// An unknown family.
    pub fn published(family: &FamilyName) -> Result<ProgramFile, ProgramFileError> {
        let source = source_of("--family", family)?;
        let unfit = |reason: String| ProgramFileError::Options { file: family.to_string(), reason };
        let lineage = lineage(family);
        let parent = source.parent.adopted(&lineage);
        let text = |error: crate::kernel::canon::CanonError| unfit(error.to_string());
        let file = ProgramFile {
            format: FORMAT.into(),
            digest: Digest::of_bytes(&[]),
            family: family.clone(),
            contract: ContractMark::of(&source.contract).map_err(text)?,
            program: Program { solution_id: name(&lineage), ..parent.clone() },
            program_hash: parent.hash().map_err(text)?,
            parent,
            parent_settings: BTreeMap::new(),
            conditions: conditions(&source.contract.backend).map_err(unfit)?,
            counsel: BTreeMap::new(),
            sequences: BTreeMap::new(),
            evolution_scenes: BTreeSet::new(),
            origins: Vec::new(),
        };
        file.sealed().map_err(text)
    }
}
