//! A reply's schema as it is sent. Servers build grammars from schemas and refuse what is too large for them; the reader of
//! replies keeps the schema as it is, and so does the key of a request.

use serde_json::Value;

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

/// What to change where a server cannot make a grammar of the schema, if its words are about that.
pub fn remedy(model: &str, held_to_schema: bool, said: &str) -> Option<String> {
    const WORDS: [&str; 6] = ["grammar", "schema", "response_format", "guided", "structured output", "tool"];
    let said = said.to_ascii_lowercase();
    let about_it = held_to_schema && WORDS.iter().any(|word| said.contains(word));
    about_it.then(|| {
        format!(
            "if the server cannot hold a reply to the schema, set another response_format in [models.{model}] \
             (json_object, or none)"
        )
    })
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
    fn a_refusal_about_the_grammar_names_the_setting_and_another_one_does_not() {
        let llama = "Failed to initialize samplers: failed to parse grammar";
        let told = remedy("local", true, llama).unwrap();
        assert!(told.contains("response_format") && told.contains("[models.local]"), "{told}");
        assert_eq!(remedy("local", false, llama), None);
        assert_eq!(remedy("local", true, "Incorrect API key provided"), None);
    }
}
