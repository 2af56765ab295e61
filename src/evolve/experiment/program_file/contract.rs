//! The contract of a program file against the one that this program has: what changed in between.

use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

use super::ProgramFileError;
use super::error::shown;
use crate::adapters::{ADAPTER_VERSION, Contract};
use crate::families;
use crate::kernel::{Digest, canon::CanonError};
use crate::objects::FamilyName;
use crate::stage::Source;

/// Names that a message lists; of more it says how many.
const LISTED_MAX: usize = 12;

/// Mark of the contract that a program obeys.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContractMark {
    /// Version of contracts, compiler and families.
    pub adapter: u32,
    pub digest: Digest,
    /// Every name that a program may use, so that another version can say which of them it lacks.
    pub names: BTreeSet<String>,
}

impl ContractMark {
    /// The mark of a contract of this program.
    ///
    /// # Errors
    /// A bound that is no finite number.
    pub fn of(contract: &Contract) -> Result<ContractMark, CanonError> {
        let contract = &families::without_rehearsal(contract);
        Ok(ContractMark { adapter: ADAPTER_VERSION, digest: contract.digest()?, names: contract.names() })
    }

    /// Why a program of this mark can mean something else under the contract as it is now, in words; `None` if it cannot. Names
    /// that came in since, and texts that explain, change nothing of a program that does without them; what bounds allow is asked
    /// of the program itself; and the adapter version rises when a meaning changes.
    pub fn broken_by(&self, now: &ContractMark) -> Option<String> {
        let gone: Vec<&String> = self.names.difference(&now.names).collect();
        let mut changes = Vec::new();
        if self.adapter != now.adapter {
            changes.push(format!("adapter version {} in the file, {} here", self.adapter, now.adapter));
        }
        changes.extend((!gone.is_empty()).then(|| format!("unknown now: {}", listed(&gone))));
        if changes.is_empty() {
            return None;
        }
        let new: Vec<&String> = now.names.difference(&self.names).collect();
        changes.extend((!new.is_empty()).then(|| format!("new since: {}", listed(&new))));
        if self.digest != now.digest {
            changes.push(format!("contract {} in the file, {} here", self.digest.short(16), now.digest.short(16)));
        }
        Some(changes.join("; "))
    }
}

fn listed(names: &[&String]) -> String {
    let named: Vec<String> = names.iter().take(LISTED_MAX).map(|name| shown(name)).collect();
    let more = names.len().saturating_sub(LISTED_MAX);
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{rest}", named.join(", "))
}

/// The code of a family that a file names.
///
/// # Errors
/// No family has that name; the nearest one is proposed.
pub fn source_of(file: &str, family: &FamilyName) -> Result<Source, ProgramFileError> {
    let sources = families::sources_by_hand();
    sources.get(family).cloned().ok_or_else(|| {
        let known: Vec<&str> = sources.iter().map(|source| source.contract.family.as_str()).collect();
        let hint = crate::text::nearest(family.as_str(), known.iter().copied());
        let hint = hint.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
        let expected = format!("one of {}{hint}", known.join(", "));
        ProgramFileError::Family { file: file.into(), place: "family", found: shown(family.as_str()), expected }
    })
}
