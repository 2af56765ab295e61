//! `lineage[].policy`: the weights of a learned ego, by the name of weights that the program carries, or a file, which is read where it
//! is named and must have the digest that the experiment says. Its bytes take the name's place, so that digest and run folder hold the
//! weights and not a path.

use serde::{Deserialize, Serialize};
use std::path::Path;
use toml::{Table, Value};

use super::key::shown;
use super::place::{PUBLISHED, Place, STAGED, shipped_weights};
use super::{ExperimentError, OptionError};
use crate::ego::Policy;
use crate::families;
use crate::kernel::{Digest, hex};
use crate::objects::FamilyName;
use crate::store;

/// The ego that takes weights.
pub(super) const LEARNED: &str = "learned";
/// Bytes that a file of weights may have.
const WEIGHTS_BYTES_MAX: u64 = 64 << 20;

/// A file of weights as an experiment keeps it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EgoWeights {
    /// Digest of the file's bytes.
    pub digest: Digest,
    /// The bytes, two hex digits each.
    pub weights: String,
}

/// A file of weights as an experiment file names it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Named {
    file: String,
    digest: Digest,
}

impl EgoWeights {
    fn of(bytes: &[u8]) -> EgoWeights {
        EgoWeights { digest: Digest::of_bytes(bytes), weights: hex::encoded(bytes) }
    }

    /// The driver.
    pub fn policy(&self) -> Result<Policy, String> {
        let bytes = hex::decoded(&self.weights).filter(|bytes| Digest::of_bytes(bytes) == self.digest);
        let bytes = bytes.ok_or("its weights are not those of its digest; name the file again")?;
        Policy::learned(&bytes).map_err(|error| error.to_string())
    }
}

/// The driver of a lineage: by its name, or by its weights.
pub fn policy(ego: &str, weights: Option<&EgoWeights>) -> Result<Policy, String> {
    match weights {
        Some(weights) if ego == LEARNED => weights.policy(),
        Some(_) => Err(format!("{ego} takes no policy; write ego = \"{LEARNED}\" or take policy out")),
        None => ego.parse().map_err(|error: crate::ego::PolicyError| error.to_string()),
    }
}

/// Puts the bytes of named weights into the table of the file at `place`. Says whether a file was named.
///
/// # Errors
/// A file that is missing, holds no weights, or has another digest.
pub fn inline(table: &mut Table, place: &Place) -> Result<bool, ExperimentError> {
    let Some(Value::Array(lineages)) = table.get_mut("lineage") else { return Ok(false) };
    let mut named = false;
    for (i, lineage) in lineages.iter_mut().enumerate() {
        if let Some(lineage) = lineage.as_table_mut() {
            spell_several(lineage);
        }
        if lineage.get("policy").is_none()
            && is_staged(lineage)
            && let Some(lineage) = lineage.as_table_mut()
        {
            lineage.insert("policy".into(), PUBLISHED.into());
        }
        let Some(value) = lineage.get_mut("policy") else { continue };
        // What a run folder keeps.
        if value.get("weights").is_some() {
            continue;
        }
        let refuse = |field: &str, found: String, expected: &str| ExperimentError::Option {
            file: place.name(),
            error: OptionError::new(format!("lineage[{i}].policy{field}"), found, expected),
        };
        let form = "{ file = \"<name>.safetensors\", digest = \"<64 hex digits>\" }, or the name of weights that the program carries";
        let option = |error| ExperimentError::Option { file: place.name(), error };
        if let Some(bytes) = value.as_str().and_then(|name| shipped_weights(&format!("lineage[{i}].policy"), name)) {
            let kept = EgoWeights::of(bytes.map_err(option)?);
            *value = Value::try_from(&kept).map_err(|error| refuse("", error.to_string(), form))?;
            named = true;
            continue;
        }
        let of: Named = value.clone().try_into().map_err(|_| refuse("", shown(value), form))?;
        let made_by = format!("weights that {} makes", command(&of.file));
        let kept = match shipped_weights(&format!("lineage[{i}].policy.file"), &of.file) {
            Some(bytes) => EgoWeights::of(bytes.map_err(option)?),
            None => {
                let bytes = store::read_bounded(&place.path_beside(Path::new(&of.file)), WEIGHTS_BYTES_MAX);
                EgoWeights::of(&bytes.map_err(|error| refuse(".file", format!("{:?} ({error})", of.file), &made_by))?)
            }
        };
        if kept.digest != of.digest {
            let found = format!("{}, while {:?} has {}", of.digest, of.file, kept.digest);
            let expected =
                format!("the file's digest; write the file's, or make the one that is meant: {}", command(&of.file));
            return Err(refuse(".digest", found, &expected));
        }
        kept.policy().map_err(|error| refuse(".file", format!("{:?} ({error})", of.file), &made_by))?;
        *value = Value::try_from(&kept).map_err(|error| refuse("", error.to_string(), form))?;
        named = true;
    }
    Ok(named)
}

/// Writes out what several drivers stand for: the first one is the lineage's `ego`, and the name of weights that the program carries is the
/// driver `learned` with them as its `policy`.
fn spell_several(lineage: &mut Table) {
    let Some(Value::Array(egos)) = lineage.get_mut("egos") else { return };
    let carried = |name: &str| {
        [name.to_string(), format!("evodrive:{name}")]
            .into_iter()
            .find(|name| matches!(shipped_weights("", name), Some(Ok(_))))
    };
    let named = egos.iter().enumerate().find_map(|(i, ego)| Some((i, carried(ego.as_str()?)?)));
    if let Some((i, name)) = named {
        egos[i] = LEARNED.into();
        lineage.entry("policy").or_insert_with(|| name.into());
    }
    let first = lineage.get("egos").and_then(|egos| egos.get(0)).cloned();
    if let Some(first) = first {
        lineage.entry("ego").or_insert(first);
    }
}

/// Returns `true` if a lineage's ego is a learned one in SafeBench's protocol.
fn is_staged(lineage: &Value) -> bool {
    let word = |key: &str| lineage.get(key).and_then(Value::as_str);
    let family = word("family").map(FamilyName::new);
    let contract = family.and_then(|family| families::sources().get(&family).map(|of| of.contract.backend.clone()));
    word("ego") == Some(LEARNED) && contract.as_deref() == Some(STAGED)
}

/// Returns the command that makes the weights of a file.
fn command(file: &str) -> String {
    let name = Path::new(file).file_stem().map_or_else(|| "<name>".into(), |stem| stem.to_string_lossy().into_owned());
    if file.ends_with(".onnx") {
        "`torch.onnx.export`".into()
    } else if PUBLISHED.ends_with(&name) {
        "`evodrive policy import` of ChatScene's checkpoint".into()
    } else {
        format!("`evodrive train experiments/train/{name}.toml`")
    }
}
