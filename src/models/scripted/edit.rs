//! Operations on JSON: reading paths, applying a patch to the parent's parts, making operations.

use serde_json::{Value, json};

pub fn add(path: String, value: Value) -> Value {
    json!({"op": "add", "path": path, "value": value})
}

pub fn replace(path: String, value: Value) -> Value {
    json!({"op": "replace", "path": path, "value": value})
}

pub fn remove(path: String) -> Value {
    json!({"op": "remove", "path": path})
}

pub fn path_of(operation: &Value) -> &str {
    operation["path"].as_str().unwrap_or_default()
}

/// The steps of a JSON Pointer, escapes undone.
pub fn steps(path: &str) -> Vec<String> {
    path.split('/').skip(1).map(|step| step.replace("~1", "/").replace("~0", "~")).collect()
}

/// The operations of a patch.
pub fn operations(patch: &Value) -> &[Value] {
    patch["operations"].as_array().map_or(&[], Vec::as_slice)
}

/// One operation on the parent's parts; the reason where it cannot be done.
pub fn apply(parts: &mut Value, operation: &Value) -> Result<(), String> {
    let steps = steps(path_of(operation));
    let Some((last, way)) = steps.split_last() else { return Err("the path is empty".into()) };
    let mut holder = parts;
    for step in way {
        holder = child(holder, step).ok_or_else(|| format!("there is nothing at `{step}`"))?;
    }
    let exists = child(holder, last).is_some();
    match (operation["op"].as_str(), holder) {
        (Some("add"), Value::Object(map)) => {
            map.insert(last.clone(), operation["value"].clone());
        }
        (Some("add"), Value::Array(items)) => match place(last, items.len()) {
            Some(at) => items.insert(at, operation["value"].clone()),
            None => return Err(format!("`{last}` is no place of the list")),
        },
        (Some("replace" | "remove"), _) if !exists => return Err(format!("there is no `{last}`")),
        (Some("replace"), holder) => {
            if let Some(old) = child(holder, last) {
                *old = operation["value"].clone();
            }
        }
        (Some("remove"), Value::Object(map)) => {
            map.remove(last);
        }
        (Some("remove"), Value::Array(items)) => {
            if let Some(at) = place(last, items.len()).filter(|at| *at < items.len()) {
                items.remove(at);
            }
        }
        _ => return Err("the operation does not fit its place".into()),
    }
    Ok(())
}

fn child<'a>(holder: &'a mut Value, step: &str) -> Option<&'a mut Value> {
    match holder {
        Value::Object(map) => map.get_mut(step),
        Value::Array(items) => step.parse::<usize>().ok().and_then(|at| items.get_mut(at)),
        _ => None,
    }
}

fn place(step: &str, length: usize) -> Option<usize> {
    if step == "-" { Some(length) } else { step.parse().ok().filter(|at| *at <= length) }
}
