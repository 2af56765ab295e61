//! A reply's schema as a form to fill in: what a reader needs of it in a fifth of its length. The schema itself goes with the
//! request, for servers that hold answers to it.

use serde_json::Value;
use std::collections::BTreeMap;

/// The form of a JSON schema, on one line: values in angle brackets are to be filled in, `|` parts alternatives, `..` means more of
/// the same. Members whose value is known have it: a small model copies what it sees, placeholders too.
pub fn form(schema: &Value, known: &BTreeMap<&str, String>) -> String {
    if let Some(options) = schema["enum"].as_array() {
        return options.iter().map(Value::to_string).collect::<Vec<_>>().join("|");
    }
    if let Some(options) = schema["anyOf"].as_array() {
        return options.iter().map(|option| form(option, known)).collect::<Vec<_>>().join(" | ");
    }
    let number = |name: &str| schema[name].as_u64();
    match schema["type"].as_str() {
        Some("object") => object(schema, known),
        Some("array") => {
            let items = form(&schema["items"], known);
            match (number("minItems").unwrap_or(0), number("maxItems")) {
                (2, Some(2)) => format!("[{items}, {items}]"),
                (0, Some(most)) => format!("[{items}, ..up to {most}, or none]"),
                (_, Some(most)) => format!("[{items}, ..up to {most}]"),
                _ => format!("[{items}, ..]"),
            }
        }
        Some("string") => {
            let what = schema["description"].as_str().unwrap_or("text");
            match number("maxLength") {
                Some(most) if most > SHORT => format!("\"<{what}, at most {most} characters>\""),
                _ => format!("\"<{what}>\""),
            }
        }
        Some("number") => "<number>".into(),
        _ => "<value>".into(),
    }
}

/// Texts of at most so many characters are names, whose limit nobody meets by chance.
const SHORT: u64 = 400;

fn object(schema: &Value, known: &BTreeMap<&str, String>) -> String {
    let member = |(name, value): (&String, &Value)| match known.get(name.as_str()) {
        Some(text) => format!("\"{name}\": {}", Value::from(text.as_str())),
        None => format!("\"{name}\": {}", form(value, known)),
    };
    let mut members: Vec<String> = schema["properties"].as_object().into_iter().flatten().map(member).collect();
    if schema["additionalProperties"].is_object() {
        members.push(format!("\"<name>\": {}, ..", form(&schema["additionalProperties"], known)));
    }
    format!("{{{}}}", members.join(", "))
}

#[cfg(test)]
mod tests {
    use super::super::reply::schema;
    use super::form;
    use crate::objects::Role;
    use std::collections::BTreeMap;

    #[test]
    fn a_form_names_every_key_and_every_word_of_the_schema() {
        fn names(schema: &serde_json::Value, found: &mut Vec<String>) {
            if let Some(properties) = schema["properties"].as_object() {
                found.extend(properties.keys().cloned());
            }
            found.extend(schema["enum"].as_array().into_iter().flatten().filter_map(|w| w.as_str()).map(String::from));
            match schema {
                serde_json::Value::Object(map) => map.values().for_each(|value| names(value, found)),
                serde_json::Value::Array(items) => items.iter().for_each(|value| names(value, found)),
                _ => {}
            }
        }
        let asides = [Role::AttackerAgent, Role::TemplateAgent, Role::WorldAgent];
        for role in [Role::Actor, Role::Repair, Role::AttackCritic].into_iter().chain(asides) {
            let (mut all, text) = (vec![], form(&schema(role), &BTreeMap::new()));
            names(&schema(role), &mut all);
            assert!(all.len() > 3 && all.iter().all(|name| text.contains(&format!("\"{name}\""))), "{role:?}: {text}");
            assert!(text.len() < 1000, "{role:?}: {} bytes", text.len());
        }
        assert!(form(&schema(Role::AttackCritic), &BTreeMap::new()).contains("\"approve\"|\"repair\"|\"reject\""));
        assert!(form(&schema(Role::Actor), &BTreeMap::new()).contains("\"op\": \"remove\""));
    }

    #[test]
    fn what_is_known_stands_in_the_form() {
        let known =
            BTreeMap::from([("response_id", "cat-idm/e0s1/actor/0".to_string()), ("source_baseline", "cat".into())]);
        let text = form(&schema(Role::Actor), &known);
        assert!(
            text.contains(r#""response_id": "cat-idm/e0s1/actor/0""#) && text.contains(r#""source_baseline": "cat""#)
        );
        assert!(text.contains(r#""parent_program_hash": "<"#), "{text}");
    }
}
