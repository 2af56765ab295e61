//! JSON as prompts show it: keys always sorted, short values on one line, long ones on several.

use serde_json::{Map, Value};
use std::fmt::Write as _;

/// A value whose text is at most this long stays on one line.
const LINE_MAX_CHARS: usize = 120;

/// The same text for equal values, on every machine and with every feature set of `serde_json`.
pub fn stable_json(value: &Value) -> String {
    let mut out = String::new();
    write(value, 0, &mut out);
    out
}

/// The same text on one line without needless spaces: for what no person edits.
pub fn lean_json(value: &Value) -> String {
    value.to_string()
}

/// Members of the first `depth` levels a line each, without indentation and needless spaces: long tables that should cost few
/// tokens.
pub fn dense_json(value: &Value, depth: usize) -> String {
    let name = |key: &String| Value::from(key.as_str()).to_string();
    match value {
        Value::Object(map) if depth > 0 && !map.is_empty() => {
            let members =
                sorted(map).into_iter().map(|(key, value)| format!("{}:{}", name(key), dense_json(value, depth - 1)));
            format!("{{\n{}\n}}", members.collect::<Vec<_>>().join(",\n"))
        }
        Value::Array(items) if depth > 0 && items.iter().any(|item| item.is_object()) => {
            let items = items.iter().map(|item| dense_json(item, depth - 1));
            format!("[\n{}\n]", items.collect::<Vec<_>>().join(",\n"))
        }
        other => lean_json(other),
    }
}

/// A list with an entry a line, or an object whose lists have an entry a line: short, and still readable.
pub fn lines(value: &Value) -> String {
    let line = |value: &Value| {
        let mut out = String::new();
        one_line(value, usize::MAX, &mut out);
        out
    };
    match value {
        Value::Array(items) if !items.is_empty() => {
            format!("[\n{}\n]", items.iter().map(line).collect::<Vec<_>>().join(",\n"))
        }
        Value::Object(map) => {
            let members = sorted(map).into_iter().map(|(key, value)| {
                let mut name = String::new();
                quote(key, &mut name);
                match value {
                    Value::Array(items) if items.iter().any(Value::is_array) => format!("{name}: {}", lines(value)),
                    value => format!("{name}: {}", line(value)),
                }
            });
            format!("{{\n{}\n}}", members.collect::<Vec<_>>().join(",\n"))
        }
        other => line(other),
    }
}

fn write(value: &Value, indent: usize, out: &mut String) {
    let (start, budget) = (out.len(), LINE_MAX_CHARS.saturating_sub(indent));
    if one_line(value, start + budget, out) {
        return;
    }
    out.truncate(start);
    match value {
        Value::Object(map) if !map.is_empty() => {
            block('{', '}', sorted(map).into_iter().map(|(key, value)| (Some(key.as_str()), value)), indent, out);
        }
        Value::Array(items) if !items.is_empty() => {
            block('[', ']', items.iter().map(|value| (None, value)), indent, out);
        }
        leaf => scalar(leaf, out),
    }
}

fn block<'a>(
    open: char,
    close: char,
    members: impl Iterator<Item = (Option<&'a str>, &'a Value)>,
    indent: usize,
    out: &mut String,
) {
    out.push(open);
    for (place, (key, value)) in members.enumerate() {
        out.push_str(if place == 0 { "\n" } else { ",\n" });
        out.extend(std::iter::repeat_n(' ', indent + 1));
        if let Some(key) = key {
            quote(key, out);
            out.push_str(": ");
        }
        write(value, indent + 1, out);
    }
    out.push('\n');
    out.extend(std::iter::repeat_n(' ', indent));
    out.push(close);
}

/// Appends the value on one line. Returns false as soon as `out` is longer than `end` bytes, so that a long value costs
/// no more than a short one.
fn one_line(value: &Value, end: usize, out: &mut String) -> bool {
    match value {
        Value::Object(map) => {
            out.push('{');
            for (place, (key, value)) in sorted(map).into_iter().enumerate() {
                out.push_str(if place == 0 { "" } else { ", " });
                quote(key, out);
                out.push_str(": ");
                if !one_line(value, end, out) {
                    return false;
                }
            }
            out.push('}');
        }
        Value::Array(items) => {
            out.push('[');
            for (place, item) in items.iter().enumerate() {
                out.push_str(if place == 0 { "" } else { ", " });
                if !one_line(item, end, out) {
                    return false;
                }
            }
            out.push(']');
        }
        Value::String(text) if out.len() + text.len() > end => return false,
        Value::String(text) => quote(text, out),
        other => scalar(other, out),
    }
    out.len() <= end
}

/// Members sorted by key. They already are, unless `serde_json` was built to keep the order of insertion.
fn sorted(map: &Map<String, Value>) -> Vec<(&String, &Value)> {
    let mut members: Vec<(&String, &Value)> = map.iter().collect();
    if !members.is_sorted_by_key(|(key, _)| *key) {
        members.sort_by_key(|(key, _)| *key);
    }
    members
}

fn scalar(value: &Value, out: &mut String) {
    match value {
        Value::String(text) => quote(text, out),
        // Writing to a text cannot fail.
        other => drop(write!(out, "{other}")),
    }
}

fn quote(text: &str, out: &mut String) {
    if text.bytes().any(|b| b < 0x20 || b == b'"' || b == b'\\') {
        out.push_str(&Value::from(text).to_string());
    } else {
        out.push('"');
        out.push_str(text);
        out.push('"');
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_text_reads_back_as_the_value_and_keys_are_sorted() {
        let value =
            json!({"b": [1.0, "x\n\"```"], "a": {"long": "y".repeat(200), "k": [json!({"q": "z".repeat(130)})]}});
        let text = stable_json(&value);
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), value);
        assert!(text.find("\"a\"") < text.find("\"b\""));
        assert!(text.lines().all(|line| !line.starts_with("```")), "a string cannot close the fence:\n{text}");
    }

    #[test]
    fn dense_text_reads_back_and_breaks_its_first_levels_only() {
        let value = json!({"b": {"x": {"y": [1]}, "w": 2}, "a": [{"c": 1}, {"d": []}]});
        let text = dense_json(&value, 2);
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), value);
        assert_eq!(text, "{\n\"a\":[\n{\"c\":1},\n{\"d\":[]}\n],\n\"b\":{\n\"w\":2,\n\"x\":{\"y\":[1]}\n}\n}");
    }

    #[test]
    fn a_list_has_an_entry_a_line_and_reads_back() {
        let value = json!({"columns": ["a"], "rows": [[1, "x".repeat(300)], [2, "y"]]});
        let text = lines(&value);
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), value);
        assert_eq!(text.lines().count(), 7, "{text}");
        assert_eq!(
            serde_json::from_str::<Value>(&lines(&json!([{"a": 1}, {"b": []}]))).unwrap(),
            json!([{"a": 1}, {"b": []}])
        );
        assert_eq!(lines(&json!([])), "[]");
    }

    #[test]
    fn short_values_stay_on_one_line() {
        assert_eq!(stable_json(&json!({"z": 1, "a": [0.5, true]})), r#"{"a": [0.5, true], "z": 1}"#);
    }
}
