//! The key of a request: 200 frozen ones, whose keys another program computed from docs/FORMAT.md, and every field of each.

use evodrive::{kernel::Digest, llm::Request};
use serde_json::{Value, json};
use std::path::Path;

/// Requests and their keys.
fn frozen() -> Vec<(Digest, Value)> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/keys/requests.jsonl");
    let text = std::fs::read_to_string(path).unwrap();
    let line = |line: &str| {
        let mut line: Value = serde_json::from_str(line).unwrap();
        (serde_json::from_value(line["key"].take()).unwrap(), line["request"].take())
    };
    text.lines().map(line).collect()
}

fn key_of(request: &Value) -> Option<Digest> {
    serde_json::from_value::<Request>(request.clone()).ok()?.key().ok()
}

#[test]
fn two_hundred_frozen_requests_keep_their_keys() {
    let frozen = frozen();
    assert_eq!(frozen.len(), 200);
    for (place, (key, request)) in frozen.iter().enumerate() {
        assert_eq!(
            key_of(request),
            Some(*key),
            "request {place}: a key is for ever; another definition takes a new domain"
        );
    }
}

/// Every change of one place of a value: a leaf that is another one, an item or an entry more, an item or an entry less.
fn mutations(value: &Value, of: &mut Vec<Value>) {
    let mut add = |changed: Value| of.push(changed);
    match value {
        Value::Null => add(json!(false)),
        Value::Bool(is) => add(json!(!is)),
        Value::String(text) => {
            add(json!(format!("{text} ")));
            text.chars().next().into_iter().for_each(|first| add(json!(text[first.len_utf8()..])));
        }
        Value::Number(number) => match (number.as_u64(), number.as_i64(), number.as_f64()) {
            (Some(whole), ..) => add(json!(whole ^ 1)),
            (_, Some(whole), _) => add(json!(whole ^ 1)),
            // The next float: one bit.
            (.., Some(real)) => add(json!(f64::from_bits(real.to_bits() ^ 1))),
            _ => {}
        },
        Value::Array(items) => {
            for place in 0..items.len() {
                let mut inner = Vec::new();
                mutations(&items[place], &mut inner);
                let put = |item: Value| {
                    let mut changed = items.clone();
                    changed[place] = item;
                    Value::Array(changed)
                };
                of.extend(inner.into_iter().map(put));
                let mut fewer = items.clone();
                fewer.remove(place);
                of.push(Value::Array(fewer));
            }
        }
        Value::Object(entries) => {
            for (name, inner) in entries {
                let mut all = Vec::new();
                mutations(inner, &mut all);
                let put = |item: Value| {
                    let mut changed = entries.clone();
                    changed.insert(name.clone(), item);
                    Value::Object(changed)
                };
                of.extend(all.into_iter().map(put));
                let mut fewer = entries.clone();
                fewer.remove(name);
                of.push(Value::Object(fewer));
            }
        }
    }
}

#[test]
fn every_field_of_every_frozen_request_changes_its_key() {
    let (mut tried, mut same) = (0, Vec::new());
    for (key, request) in frozen() {
        let mut changed = Vec::new();
        mutations(&request, &mut changed);
        for changed in changed {
            // What is no request any more has no key; what only writes a default out is the same request.
            let Ok(read) = serde_json::from_value::<Request>(changed.clone()) else { continue };
            if read == serde_json::from_value(request.clone()).unwrap() {
                continue;
            }
            tried += 1;
            if read.key().unwrap() == key {
                same.push(changed);
            }
        }
    }
    assert!(same.is_empty(), "{} of {tried} changes left the key, the first: {}", same.len(), same[0]);
    // A reader that refused everything would pass, too.
    assert!(tried > 5000, "{tried}");
}
