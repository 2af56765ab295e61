//! Finds where two JSON values first differ, for short messages.

use serde_json::Value;

/// Longest text of a value in a message, in characters.
const MAX_CHARS: usize = 120;

/// Returns `(JSON Pointer, left, right)` of the first difference in the order of sorted keys and of list places. Values print as
/// JSON, shortened; a missing one prints as `nothing`. For equal values the pointer is `at` itself.
pub fn first_difference(at: &str, left: &Value, right: &Value) -> (String, String, String) {
    let mut at = at.to_string();
    let (mut left, mut right) = (Some(left), Some(right));
    while let (Some(l), Some(r)) = (left, right) {
        let Some(step) = first_differing_child(l, r) else { break };
        at.push('/');
        at.push_str(&step.replace('~', "~0").replace('/', "~1"));
        (left, right) = (child(l, &step), child(r, &step));
    }
    (at, print(left), print(right))
}

/// Returns `true` if the canonical bytes are equal: they have one zero.
fn same(left: &Value, right: &Value) -> bool {
    crate::kernel::canonical_bytes(left) == crate::kernel::canonical_bytes(right)
}

fn first_differing_child(left: &Value, right: &Value) -> Option<String> {
    let differs = |step: &String| match (child(left, step), child(right, step)) {
        (Some(l), Some(r)) => !same(l, r),
        (l, r) => l.is_some() != r.is_some(),
    };
    match (left, right) {
        (Value::Object(l), Value::Object(r)) => {
            let keys: std::collections::BTreeSet<&String> = l.keys().chain(r.keys()).collect();
            keys.into_iter().find(|key| differs(key)).cloned()
        }
        (Value::Array(l), Value::Array(r)) => (0..l.len().max(r.len())).map(|i| i.to_string()).find(differs),
        _ => None,
    }
}

fn child<'a>(value: &'a Value, step: &str) -> Option<&'a Value> {
    match value {
        Value::Object(map) => map.get(step),
        Value::Array(items) => items.get(step.parse::<usize>().ok()?),
        _ => None,
    }
}

fn print(value: Option<&Value>) -> String {
    value.map_or_else(|| "nothing".to_string(), |value| shortened(&value.to_string()))
}

/// At most 120 characters of a text, then an ellipsis.
pub fn shortened(text: &str) -> String {
    match text.char_indices().nth(MAX_CHARS) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_first_differing_leaf_is_named() {
        let found =
            first_difference("", &json!({"a": [1, {"b/c": 2}], "z": 0}), &json!({"a": [1, {"b/c": 3}], "z": 1}));
        assert_eq!(found, ("/a/1/b~1c".into(), "2".into(), "3".into()));
    }

    #[test]
    fn a_missing_field_and_a_longer_list_are_named() {
        assert_eq!(first_difference("/x", &json!({"a": 1}), &json!({})), ("/x/a".into(), "1".into(), "nothing".into()));
        assert_eq!(first_difference("/x", &json!([1]), &json!([1, 2])), ("/x/1".into(), "nothing".into(), "2".into()));
        assert_eq!(first_difference("/x", &json!([1]), &json!({})).0, "/x");
    }

    #[test]
    fn long_values_are_shortened_at_a_character() {
        let text = "ü".repeat(500);
        assert_eq!(first_difference("", &json!(text), &json!(1)).1.chars().count(), MAX_CHARS + 1);
    }
}
