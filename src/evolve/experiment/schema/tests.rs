use serde_json::Value;
use std::path::{Path, PathBuf};

use super::{NAME_PATTERN, schema};
use crate::experiment::place::PROTOCOLS;

/// Reads the schema as an editor does, as far as it goes: a word that it does not know ends the test, so nothing is passed over.
struct Editor(Value);

impl Editor {
    fn open() -> Editor {
        Editor(schema())
    }

    /// Returns what an editor underlines in a file, by place; empty where nothing is wrong.
    fn complaint(&self, text: &str) -> String {
        let table: toml::Table = text.parse().expect("TOML");
        let value = serde_json::to_value(table).expect("JSON");
        let mut complaints = Vec::new();
        hold(&self.0, &value, "", &mut complaints);
        complaints.join("\n")
    }
}

/// Holds a value to a schema and notes each word of it that the value breaks.
fn hold(schema: &Value, value: &Value, place: &str, complaints: &mut Vec<String>) {
    let Some(words) = schema.as_object() else {
        if *schema == Value::Bool(false) {
            complaints.push(format!("{place}: no such key"));
        }
        return;
    };
    for (word, asked) in words {
        let number = || asked.as_f64().expect("a number");
        let holds = match word.as_str() {
            "$schema" | "title" | "description" => true,
            "type" => match asked.as_str().expect("one type") {
                "object" => value.is_object(),
                "array" => value.is_array(),
                "string" => value.is_string(),
                "boolean" => value.is_boolean(),
                "number" => value.is_number(),
                "integer" => value.as_f64().is_some_and(|number| number.fract() == 0.0),
                other => panic!("type {other}"),
            },
            "enum" => asked.as_array().expect("a list").contains(value),
            "minimum" => value.as_f64().is_none_or(|it| it >= number()),
            "maximum" => value.as_f64().is_none_or(|it| it <= number()),
            "exclusiveMinimum" => value.as_f64().is_none_or(|it| it > number()),
            "exclusiveMaximum" => value.as_f64().is_none_or(|it| it < number()),
            "minLength" => value.as_str().is_none_or(|it| it.chars().count() as f64 >= number()),
            "maxLength" => value.as_str().is_none_or(|it| it.chars().count() as f64 <= number()),
            "minItems" => value.as_array().is_none_or(|it| it.len() as f64 >= number()),
            "maxItems" => value.as_array().is_none_or(|it| it.len() as f64 <= number()),
            "pattern" => {
                assert_eq!(asked, NAME_PATTERN, "the one pattern that is read here");
                let of_a_name = |c: char| matches!(c, 'a'..='z' | '0'..='9' | '_' | '-');
                value.as_str().is_none_or(|it| (1..=64).contains(&it.len()) && it.chars().all(of_a_name))
            }
            "items" => {
                for (index, item) in value.as_array().into_iter().flatten().enumerate() {
                    hold(asked, item, &format!("{place}/{index}"), complaints);
                }
                true
            }
            "properties" => true,
            "additionalProperties" => {
                for (key, item) in value.as_object().into_iter().flatten() {
                    let of = words.get("properties").and_then(|named| named.get(key)).unwrap_or(asked);
                    hold(of, item, &format!("{place}/{key}"), complaints);
                }
                true
            }
            other => panic!("{place}: the schema says `{other}`, which nothing reads here"),
        };
        if !holds {
            complaints.push(format!("{place}: {value} breaks {word} {asked}"));
        }
    }
}

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

/// Every experiment that is shipped. Files of a training, of a downstream study, of a driver and of a calibration have other keys.
fn shipped() -> Vec<PathBuf> {
    let mut open = vec![root().join("experiments")];
    let mut files = Vec::new();
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            let other = ["train", "downstream", "calibration"].iter().any(|name| path.ends_with(name));
            if path.is_dir() && !other {
                open.push(path);
            } else if path.extension().is_some_and(|ext| ext == "toml") {
                files.push(path);
            }
        }
    }
    files
}

#[test]
fn the_schema_in_docs_is_what_the_program_prints() {
    let written = std::fs::read_to_string(root().join("docs/experiment.schema.json")).unwrap_or_default();
    let printed = serde_json::to_string_pretty(&schema()).expect("JSON") + "\n";
    assert!(
        written == printed,
        "docs/experiment.schema.json is stale: run `evodrive options --schema > docs/experiment.schema.json` (or .ci/bless)"
    );
}

#[test]
fn every_shipped_experiment_fits_the_schema() {
    let editor = Editor::open();
    let files = shipped();
    assert!(files.len() > 40, "{} files only", files.len());
    for file in files {
        let complaint = editor.complaint(&std::fs::read_to_string(&file).expect("a file"));
        assert!(complaint.is_empty(), "{}: {complaint}", file.display());
    }
}

#[test]
fn a_misspelt_key_is_refused_and_named() {
    let complaint = Editor::open().complaint("[budget]\nslotz = 4\n");
    assert!(complaint.contains("slotz") && complaint.contains("/budget"), "{complaint}");
}

#[test]
fn a_value_outside_its_range_is_refused_where_it_stands() {
    let editor = Editor::open();
    for (text, place) in [
        ("[budget]\nslots = 0\n", "/budget/slots"),
        ("[budget]\nslots = \"four\"\n", "/budget/slots"),
        ("[search]\nmethod = \"pareto2\"\n", "/search/method"),
        ("[[lineage]]\nid = \"Cat IDM\"\n", "/lineage/0/id"),
    ] {
        let complaint = editor.complaint(text);
        assert!(complaint.contains(place), "{text}: {complaint}");
    }
}

#[test]
fn what_the_program_refuses_at_one_key_of_a_protocol_the_schema_refuses_too() {
    let editor = Editor::open();
    let (_, protocol) = PROTOCOLS.first().expect("a protocol");
    assert!(editor.complaint(protocol).is_empty());
    let wrong = protocol.replacen("[budget]", "[budget]\nunknown = 1", 1);
    assert!(editor.complaint(&wrong).contains("unknown"));
}

/// Values by place; a list is a value.
fn leaves(table: &toml::Table, at: &str, found: &mut Vec<(String, toml::Value)>) {
    for (key, value) in table {
        let place = format!("{at}.{key}");
        match value {
            toml::Value::Table(table) => leaves(table, &place, found),
            value => found.push((place, value.clone())),
        }
    }
}

fn values(text: &str) -> Vec<(String, toml::Value)> {
    let mut keys = Vec::new();
    leaves(&text.parse().expect("TOML"), "", &mut keys);
    keys
}

#[test]
fn what_the_protocols_say_to_leave_alone_has_one_value_in_every_shipped_experiment() {
    // `metadrive-2` has what `metadrive` has.
    for (name, protocol) in PROTOCOLS.into_iter().filter(|(_, protocol)| !protocol.contains("base = ")) {
        let (_, alone) = protocol.split_once("# LEAVE ALONE").expect("the part to leave alone");
        let alone = values(alone);
        assert!(alone.len() > 30, "{name}: {} values only", alone.len());
        for file in shipped() {
            let set = values(&std::fs::read_to_string(&file).expect("a file"));
            // Weights of more diagnostics are other weights; the ten sum to one without them.
            let more = set.iter().any(|(of, _)| of == ".evaluation.realism.weights.rolling");
            // The paper names seven of the ten.
            let more = more || file.ends_with("protocols/published.toml");
            let of_weights = |place: &str| more && place.starts_with(".evaluation.realism.weights.");
            // An evaluator that ranks by our own simulator has no regression, and says how many labels its slope's prior counts for.
            let simulates = set.contains(&(".world.model".into(), "simulator".into()));
            // An evaluator that predicts pairs of candidate and scene routes by value and uncertainty.
            let pairs = set.iter().any(|(of, _)| of.starts_with(".world.pairs."));
            let of_model = |place: &str| {
                simulates && [".world.model", ".world.ridge_lambda"].contains(&place)
                    || pairs && place.starts_with(".world.")
            };
            for (place, value) in alone.iter().filter(|(place, _)| !of_weights(place) && !of_model(place)) {
                let other = set.iter().find(|(of, it)| of == place && it != value);
                assert!(other.is_none(), "{name}{place} = {value}, but {}: {other:?}", file.display());
            }
        }
    }
}
