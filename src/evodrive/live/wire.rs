//! A reply's schema as it is sent. Servers build grammars from schemas and refuse what is too large for them; the reader of
//! replies keeps the schema as it is, and so does the key of a request.

use serde_json::{Map, Value};

/// The largest repetition that llama.cpp compiles into a grammar: 2000 is refused with HTTP 400.
const REPETITION_MAX: u64 = 1999;
/// Keywords that say how often something repeats.
const REPETITIONS: [&str; 6] = ["maxLength", "minLength", "maxItems", "minItems", "maxProperties", "minProperties"];

/// The schema with bounds that common servers compile.
pub fn compilable(schema: &Value) -> Value {
    let bounded = |(keyword, value): (&String, &Value)| {
        let value = match value.as_u64() {
            Some(bound) if REPETITIONS.contains(&keyword.as_str()) => bound.min(REPETITION_MAX).into(),
            _ => compilable(value),
        };
        (keyword.clone(), value)
    };
    match schema {
        Value::Object(fields) => Value::Object(fields.iter().map(bounded).collect()),
        Value::Array(items) => items.iter().map(compilable).collect(),
        other => other.clone(),
    }
}

/// The schema in the form that strict mode takes: every object closed, with all its fields required, no free values, no bounds.
/// None where it is not of that form; the reader holds the reply to the bounds all the same.
pub fn strict(schema: &Value) -> Option<Value> {
    let fields = schema.as_object()?;
    let kind = fields.get("type").and_then(Value::as_str);
    let is_closed = fields.get("additionalProperties") == Some(&Value::Bool(false)) && requires_all(fields);
    let fits = match kind {
        Some("object") => is_closed,
        Some("array") => fields.contains_key("items"),
        Some(_) => true,
        // A choice or a list of words; a list of types may hold anything.
        None => {
            !fields.contains_key("type") && ["anyOf", "enum", "const"].iter().any(|word| fields.contains_key(*word))
        }
    };
    if !fits {
        return None;
    }
    let mut kept = Map::new();
    for (keyword, value) in fields.iter().filter(|(keyword, _)| !REPETITIONS.contains(&keyword.as_str())) {
        let value = match (keyword.as_str(), value) {
            ("properties", Value::Object(all)) => {
                let read: Option<Map<_, _>> = all.iter().map(|(name, of)| Some((name.clone(), strict(of)?))).collect();
                Value::Object(read?)
            }
            ("anyOf", Value::Array(all)) => Value::Array(all.iter().map(strict).collect::<Option<_>>()?),
            ("items", of) => strict(of)?,
            (_, other) => other.clone(),
        };
        kept.insert(keyword.clone(), value);
    }
    Some(Value::Object(kept))
}

fn requires_all(fields: &Map<String, Value>) -> bool {
    let required = fields.get("required").and_then(Value::as_array);
    let is_required = |name: &String| required.is_some_and(|all| all.iter().any(|word| word == name));
    fields.get("properties").and_then(Value::as_object).is_some_and(|all| all.keys().all(is_required))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn bounds_that_a_grammar_cannot_hold_are_lowered_wherever_they_stand_and_nothing_else() {
        let schema = json!({
            "properties": {
                "maxLength": {"type": "string", "minLength": 1, "maxLength": 2000},
                "list": {"type": "array", "maxItems": 32, "items": {"anyOf": [{"type": "string", "maxLength": 9000}]}},
                "number": {"type": "number", "maximum": 5000, "enum": [2000, 3000]},
            },
        });
        let mut expected = schema.clone();
        expected["properties"]["maxLength"]["maxLength"] = 1999.into();
        expected["properties"]["list"]["items"]["anyOf"][0]["maxLength"] = 1999.into();
        assert_eq!(compilable(&schema), expected);
    }

    #[test]
    fn strict_mode_takes_closed_schemas_without_bounds_and_no_others() {
        let closed = json!({"type": "object", "additionalProperties": false, "required": ["a", "b"], "properties": {
            "a": {"type": "string", "maxLength": 5},
            "b": {"type": "array", "maxItems": 3, "items": {"anyOf": [{"enum": ["x"]}, {"type": "number"}]}}}});
        let mut expected = closed.clone();
        expected["properties"]["a"] = json!({"type": "string"});
        expected["properties"]["b"].as_object_mut().unwrap().remove("maxItems");
        assert_eq!(strict(&closed), Some(expected));
        for (place, value) in [
            ("/required", json!(["a"])),
            ("/additionalProperties", json!({"type": "number"})),
            ("/properties/a", json!({"type": ["string", "object"]})),
            ("/properties/b/items", json!({"type": "object"})),
        ] {
            let mut open = closed.clone();
            *open.pointer_mut(place).unwrap() = value;
            assert_eq!(strict(&open), None, "{place}");
        }
    }
}
