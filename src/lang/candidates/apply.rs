//! T_b: a patch applied to its parent. Pure; knows paths and types, nothing of contracts.

use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use std::collections::BTreeMap;

use super::weight;
use crate::{
    kernel::{Digest, canon::CanonError},
    objects::{
        Ancestor, Operation, OperationKind, Pointer, Program, ProgramPatch, SolutionId, Surface, pointer::within,
    },
};

/// Most tokens of a path: the deepest place of a program has five.
const TOKENS_MAX: usize = 8;

/// Why a patch has no child. `operation` counts from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ApplyError {
    #[error("operation {operation} at {path}: {reason}")]
    Operation { operation: usize, path: String, reason: String },
    #[error("at {place}: {reason}")]
    Type { place: String, reason: String },
    /// The schema gate found the patch itself unfit to be applied.
    #[error("the patch is not one that can be applied")]
    Refused,
    #[error("the parent's generation {0} is the last that can be counted")]
    Generation(u32),
    #[error("the parent or the patch has no canonical form: {0}")]
    Canon(#[from] CanonError),
}

/// The child: the parent with the patch's operations done in order, one generation further, its ancestors extended
/// by the parent.
pub fn apply(
    parent: &Program,
    parent_hash: Digest,
    patch: &ProgramPatch,
    child_id: SolutionId,
) -> Result<Program, ApplyError> {
    let mut editable = editable_json(parent)?;
    for (index, operation) in patch.operations.iter().enumerate() {
        edit(&mut editable, operation).map_err(|reason| ApplyError::Operation {
            operation: index,
            path: shortened(&operation.path),
            reason,
        })?;
    }
    let generation = parent.generation.checked_add(1).ok_or(ApplyError::Generation(parent.generation))?;
    let mut ancestor_chain = parent.ancestor_chain.clone();
    ancestor_chain.push(Ancestor {
        solution_id: parent.solution_id.clone(),
        program_hash: parent_hash,
        patch_hash: patch.hash()?,
    });
    Ok(Program {
        solution_id: child_id,
        lineage_id: parent.lineage_id.clone(),
        source_family: parent.source_family.clone(),
        generation,
        parameters: entries(&mut editable, Surface::Parameters)?,
        operator_graph: entries(&mut editable, Surface::OperatorGraph)?,
        scenario_conditioned_policy: rules(&mut editable)?,
        mechanism_modules: entries(&mut editable, Surface::MechanismModules)?,
        compile_contract: parent.compile_contract.clone(),
        ancestor_chain,
    })
}

/// The four editable parts as one JSON object, and nothing else: other places do not exist for a patch.
fn editable_json(program: &Program) -> Result<Value, ApplyError> {
    let mut parts = Map::new();
    for surface in Surface::ALL {
        let part = match surface {
            Surface::Parameters => serde_json::to_value(&program.parameters),
            Surface::OperatorGraph => serde_json::to_value(&program.operator_graph),
            Surface::ScenarioConditionedPolicy => serde_json::to_value(&program.scenario_conditioned_policy),
            Surface::MechanismModules => serde_json::to_value(&program.mechanism_modules),
        };
        let part = part.map_err(|error| type_error(format!("/{}", surface.name()), &error))?;
        parts.insert(surface.name().into(), part);
    }
    Ok(Value::Object(parts))
}

fn edit(document: &mut Value, operation: &Operation) -> Result<(), String> {
    let pointer = Pointer::parse(&operation.path).map_err(|error| error.to_string())?;
    let Some((last, way)) = pointer.tokens.split_last() else { return Err("expected a path".into()) };
    if way.is_empty() {
        return Err("expected a place inside one of the four editable parts, such as /parameters/<name>".into());
    }
    if way.len() >= TOKENS_MAX {
        return Err(format!("found {} steps, expected at most {TOKENS_MAX}", pointer.tokens.len()));
    }
    let holder = way.iter().try_fold(document, step)?;
    match (operation.op, &operation.value) {
        (OperationKind::Remove, None) => remove(holder, last),
        (OperationKind::Remove, Some(_)) => Err("`remove` takes no value".into()),
        (_, None) => Err("expected a value".into()),
        (kind, Some(value)) => match weight::too_large(value) {
            Some(reason) => Err(reason),
            None if kind == OperationKind::Add => add(holder, last, value.clone()),
            None => replace(holder, last, value.clone()),
        },
    }
}

fn step<'a>(value: &'a mut Value, token: &String) -> Result<&'a mut Value, String> {
    let missing = || format!("found nothing at `{}`, expected a place that exists", shortened(token));
    match value {
        Value::Object(entries) => entries.get_mut(token).ok_or_else(missing),
        Value::Array(items) => {
            let index = index(token, items.len())?;
            items.get_mut(index).ok_or_else(missing)
        }
        _ => Err(format!("found a plain value before `{}`, expected an object or a list", shortened(token))),
    }
}

fn add(holder: &mut Value, last: &str, value: Value) -> Result<(), String> {
    match holder {
        Value::Object(entries) => {
            entries.insert(last.into(), value);
        }
        Value::Array(items) if last == "-" => items.push(value),
        Value::Array(items) => {
            let index = index(last, items.len() + 1)?;
            items.insert(index, value);
        }
        _ => return Err("expected the path to end in an object or a list".into()),
    }
    Ok(())
}

fn replace(holder: &mut Value, last: &str, value: Value) -> Result<(), String> {
    *step(holder, &last.to_string())? = value;
    Ok(())
}

fn remove(holder: &mut Value, last: &str) -> Result<(), String> {
    step(holder, &last.to_string())?;
    match holder {
        Value::Object(entries) => {
            entries.remove(last);
        }
        Value::Array(items) => {
            let index = index(last, items.len())?;
            items.remove(index);
        }
        _ => {}
    }
    Ok(())
}

/// A list index below `end`, in digits without leading zeros.
fn index(token: &str, end: usize) -> Result<usize, String> {
    let digits =
        !token.is_empty() && token.bytes().all(|b| b.is_ascii_digit()) && (token == "0" || !token.starts_with('0'));
    match token.parse::<usize>() {
        Ok(index) if digits && index < end => Ok(index),
        _ => Err(format!("found the index `{}`, expected a whole number below {end}", shortened(token))),
    }
}

fn take(editable: &mut Value, surface: Surface) -> Value {
    editable.get_mut(surface.name()).map(Value::take).unwrap_or_default()
}

/// Entries typed one by one, so that an error names its entry.
fn entries<T: DeserializeOwned>(editable: &mut Value, surface: Surface) -> Result<BTreeMap<String, T>, ApplyError> {
    let place = format!("/{}", surface.name());
    let Value::Object(parts) = take(editable, surface) else {
        return Err(ApplyError::Type { place, reason: "expected an object".into() });
    };
    let typed = |(name, value): (String, Value)| {
        let entry = serde_json::from_value(value).map_err(|error| type_error(within(&place, &name), &error))?;
        Ok((name, entry))
    };
    parts.into_iter().map(typed).collect()
}

fn rules<T: DeserializeOwned>(editable: &mut Value) -> Result<Vec<T>, ApplyError> {
    let place = format!("/{}", Surface::ScenarioConditionedPolicy.name());
    let Value::Array(items) = take(editable, Surface::ScenarioConditionedPolicy) else {
        return Err(ApplyError::Type { place, reason: "expected a list".into() });
    };
    let typed = |(index, value): (usize, Value)| {
        serde_json::from_value(value).map_err(|error| type_error(within(&place, &index.to_string()), &error))
    };
    items.into_iter().enumerate().map(typed).collect()
}

/// serde cannot say which form of a setting or a parameter was meant, so the forms are named here.
fn type_error(place: String, error: &serde_json::Error) -> ApplyError {
    let text = error.to_string();
    let reason = if text.contains("enum ParameterValue") {
        "expected a number or a word".into()
    } else if text.contains("enum Setting") {
        "expected settings that are a number, a word, {\"parameter\": name} or {\"mechanism\": name}".into()
    } else {
        shortened(&text)
    };
    ApplyError::Type { place: shortened(&place), reason }
}

/// Quoted text is cut: it may be hostile.
pub(super) fn shortened(text: &str) -> String {
    let short: String = text.chars().take(160).collect();
    if short.len() < text.len() { short + "…" } else { short }
}
