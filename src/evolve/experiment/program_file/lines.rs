//! Line numbers: where a place of a program stands in the TOML text of its file.

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::objects::Pointer;

/// The line, counted from 1, of the deepest value on the way to a JSON pointer; none where the text is no TOML or the first step
/// leads nowhere.
pub fn line_of(text: &str, pointer: &str) -> Option<usize> {
    let at = span_of(text, pointer)?.start;
    Some(1 + text.as_bytes().get(..at)?.iter().filter(|byte| **byte == b'\n').count())
}

/// The bytes of the value at a pointer, where it stands there itself and not as a table with a head of its own.
pub fn value_span(text: &str, pointer: &str) -> Option<std::ops::Range<usize>> {
    let table = DeTable::parse(text).ok()?;
    let tokens = Pointer::parse(pointer).ok()?.tokens;
    let (first, rest) = tokens.split_first()?;
    let mut value = table.get_ref().get(first.as_str())?;
    for token in rest {
        value = step(value, token)?.1;
    }
    // A table or a list of tables with heads spans its head alone.
    let inline = match value.get_ref() {
        DeValue::Table(_) => text.get(value.span())?.starts_with('{'),
        DeValue::Array(_) => text.get(value.span())?.starts_with('[') && text.get(value.span())?.ends_with(']'),
        _ => true,
    };
    let is_head = text.get(..value.span().start)?.trim_end_matches([' ', '\t', '[']).ends_with('\n');
    (inline && !is_head).then(|| value.span())
}

fn span_of(text: &str, pointer: &str) -> Option<std::ops::Range<usize>> {
    let table = DeTable::parse(text).ok()?;
    let tokens = Pointer::parse(pointer).ok()?.tokens;
    let (first, rest) = tokens.split_first()?;
    let (key, mut value) = table.get_ref().get_key_value(first.as_str())?;
    let mut span = key.span();
    for token in rest {
        let Some((at, next)) = step(value, token) else { break };
        (span, value) = (at, next);
    }
    Some(span)
}

/// The entry of a table or list: where its key stands, or the entry where it has none.
fn step<'v, 't>(
    value: &'v Spanned<DeValue<'t>>,
    token: &str,
) -> Option<(std::ops::Range<usize>, &'v Spanned<DeValue<'t>>)> {
    match value.get_ref() {
        DeValue::Table(entries) => entries.get_key_value(token).map(|(key, value)| (key.span(), value)),
        DeValue::Array(items) => items.get(token.parse::<usize>().ok()?).map(|item| (item.span(), item)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "family = \"cat\"\n\n[parameters]\na = 1.0\nb = \"x\"\n\n[operator_graph.actor]\nkind = \"k\"\nsettings = { shape = \"cyclist\" }\n\n[[scenario_conditioned_policy]]\nname = \"one\"\n[[scenario_conditioned_policy]]\nname = \"two\"\n";

    #[test]
    fn a_pointer_leads_to_its_line_or_to_the_last_one_on_its_way() {
        for (pointer, line) in [
            ("/family", 1),
            ("/parameters/b", 5),
            ("/parameters/missing", 3),
            ("/operator_graph/actor", 7),
            ("/operator_graph/actor/kind", 8),
            ("/operator_graph/actor/settings/shape", 9),
            ("/scenario_conditioned_policy/1/name", 14),
        ] {
            assert_eq!(line_of(TEXT, pointer), Some(line), "{pointer}");
        }
        assert_eq!(line_of(TEXT, "/nowhere"), None);
    }

    #[test]
    fn a_value_that_stands_in_the_text_has_its_bytes_and_a_table_with_a_head_has_none() {
        let of = |pointer: &str| value_span(TEXT, pointer).map(|span| &TEXT[span]);
        assert_eq!(of("/parameters/a"), Some("1.0"));
        assert_eq!(of("/operator_graph/actor/settings/shape"), Some("\"cyclist\""));
        assert_eq!(of("/operator_graph/actor/settings"), Some("{ shape = \"cyclist\" }"));
        assert_eq!(of("/operator_graph/actor"), None);
        assert_eq!(of("/scenario_conditioned_policy"), None);
        assert_eq!(of("/scenario_conditioned_policy/0"), None);
        assert_eq!(of("/parameters/missing"), None);
    }
}
