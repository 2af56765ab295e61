//! Size of a JSON value, and the texts in it: walked with a list, never by recursion.

use serde_json::Value;

/// Deepest value of a patch: a whole rule of ρ needs four levels.
pub const VALUE_DEPTH_MAX: usize = 8;
/// Most elements and entries of one value.
pub const VALUE_ELEMENTS_MAX: usize = 512;
/// Most bytes of keys and texts of one value.
pub const VALUE_TEXT_MAX_BYTES: usize = 16_384;

/// Returns why a value is too large to be checked any further.
pub fn too_large(value: &Value) -> Option<String> {
    let (mut elements, mut text_bytes) = (0, 0);
    for (value, depth) in Walk::new(value) {
        elements += 1;
        text_bytes += match value {
            Value::String(text) => text.len(),
            Value::Object(entries) => entries.keys().map(String::len).sum(),
            _ => 0,
        };
        if depth > VALUE_DEPTH_MAX {
            return Some(format!("found a value nested deeper than {VALUE_DEPTH_MAX}, expected less"));
        }
        if elements > VALUE_ELEMENTS_MAX {
            return Some(format!("found more than {VALUE_ELEMENTS_MAX} elements, expected fewer"));
        }
        if text_bytes > VALUE_TEXT_MAX_BYTES {
            return Some(format!("found more than {VALUE_TEXT_MAX_BYTES} bytes of text, expected fewer"));
        }
    }
    None
}

/// Keys and texts of a value, in no particular order.
pub fn texts(value: &Value) -> Vec<&str> {
    let mut weight = keys(value);
    weight.extend(Walk::new(value).filter_map(|(value, _)| value.as_str()));
    weight
}

/// Keys of all objects in a value.
pub fn keys(value: &Value) -> Vec<&str> {
    let objects = Walk::new(value).filter_map(|(value, _)| value.as_object());
    objects.flat_map(|entries| entries.keys().map(String::as_str)).collect()
}

/// Every value inside a value with its depth, the outermost being 1.
struct Walk<'a> {
    open: Vec<(&'a Value, usize)>,
}

impl<'a> Walk<'a> {
    fn new(value: &'a Value) -> Walk<'a> {
        Walk { open: vec![(value, 1)] }
    }
}

impl<'a> Iterator for Walk<'a> {
    type Item = (&'a Value, usize);

    fn next(&mut self) -> Option<(&'a Value, usize)> {
        let (value, depth) = self.open.pop()?;
        match value {
            Value::Array(values) => self.open.extend(values.iter().map(|value| (value, depth + 1))),
            Value::Object(entries) => self.open.extend(entries.values().map(|value| (value, depth + 1))),
            _ => {}
        }
        Some((value, depth))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_value_may_be_as_deep_as_wide_and_as_long_as_the_bounds_say_and_no_more() {
        let nested = |levels: usize, of: fn(Value) -> Value| (1..levels).fold(json!(1), |value, _| of(value));
        for of in [|value| json!([value]), |value| json!({ "k": value })] as [fn(Value) -> Value; 2] {
            assert_eq!(too_large(&nested(VALUE_DEPTH_MAX, of)), None);
            assert!(too_large(&nested(VALUE_DEPTH_MAX + 1, of)).unwrap().contains("nested deeper than 8"));
        }
        // The list itself is an element, too.
        assert_eq!(too_large(&json!(vec![0; VALUE_ELEMENTS_MAX - 1])), None);
        assert!(too_large(&json!(vec![0; VALUE_ELEMENTS_MAX])).unwrap().contains("more than 512 elements"));
        let half = "x".repeat(VALUE_TEXT_MAX_BYTES / 2);
        assert_eq!(too_large(&json!({ &half: &half })), None);
        assert!(too_large(&json!({ &half: format!("{half}x") })).unwrap().contains("bytes of text"));
    }

    #[test]
    fn texts_are_keys_and_texts_of_all_levels() {
        let value = json!({ "a": ["b", { "c": "d" }], "e": 1 });
        let mut weight = texts(&value);
        weight.sort_unstable();
        assert_eq!(weight, ["a", "b", "c", "d", "e"]);
        weight = keys(&value);
        weight.sort_unstable();
        assert_eq!(weight, ["a", "c", "e"]);
    }
}
