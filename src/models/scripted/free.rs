//! Free constants: the stand-in leaves to the numeric search every number that is a whole value of a parameter or of a setting.

use serde_json::{Map, Value, json};

/// Leaves the numbers of a patch free, with what it chose as their first values.
pub fn left_free(mut patch: Value) -> Value {
    let mut free = Map::new();
    for operation in patch["operations"].as_array_mut().into_iter().flatten() {
        let path = operation["path"].as_str().unwrap_or_default();
        let is_place = path.starts_with("/parameters/") || path.contains("/settings/");
        if let (true, Some(start)) = (is_place, operation["value"].as_f64()) {
            let name = format!("n{}", free.len());
            operation["value"] = json!(format!("${name}"));
            free.insert(name, json!({"start": start}));
        }
    }
    patch["free"] = free.into();
    patch
}

/// A patch with the first values of its free constants.
pub fn bound(mut patch: Value) -> Value {
    let free = patch.as_object_mut().and_then(|members| members.remove("free")).unwrap_or_default();
    for operation in patch["operations"].as_array_mut().into_iter().flatten() {
        let name = operation["value"].as_str().and_then(|text| text.strip_prefix('$'));
        if let Some(start) = name.map(|name| free[name]["start"].clone()).filter(Value::is_number) {
            operation["value"] = start;
        }
    }
    patch
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_free_is_bound_to_its_first_values_again() {
        let operation = |path: &str, value: Value| json!({"op": "replace", "path": path, "value": value});
        let word = operation("/operator_graph/search/settings/combine", json!("sum"));
        let rule = operation("/scenario_conditioned_policy/-", json!({"when": "speed > 3"}));
        let patch = json!({"operations": [operation("/parameters/gap", json!(2.5)), word, rule], "hypothesis": "h"});
        let open = left_free(patch.clone());
        assert_eq!(open["operations"][0]["value"], "$n0");
        assert_eq!(open["free"], json!({"n0": {"start": 2.5}}));
        assert!((1..3).all(|at| open["operations"][at] == patch["operations"][at]));
        assert_eq!(bound(open), patch);
    }
}
