//! `--set budget.slots=8`: values of the command line that stand above those of the file. They go the way of a file that has
//! the file as its base, so they are checked like it and kept in the run's experiment.

use toml::{Table, Value};

use super::OptionError;

/// How messages name where such a value stands.
pub const SET: &str = "--set";

/// The table that these assignments write: `key=value`, the value as a file writes it; a word needs no quotes.
///
/// # Errors
/// No `=`, an empty key, a list's entry, or a key below another one's value.
pub fn table(assignments: &[String]) -> Result<Table, OptionError> {
    let mut root = Table::new();
    for assignment in assignments {
        let form = "KEY=VALUE, e.g. budget.slots=8; `evodrive options` lists the keys";
        let refuse = |found: String, expected: &str| OptionError::new(SET, found, expected);
        let (key, value) = assignment.split_once('=').ok_or_else(|| refuse(format!("{assignment:?}"), form))?;
        let words: Vec<&str> = key.trim().split('.').collect();
        if words.iter().any(|word| word.is_empty()) {
            return Err(refuse(format!("{assignment:?}"), form));
        }
        if key.contains('[') || words[0] == "lineage" {
            let expected = "a key outside lists; write a file with `base` to change [[lineage]]";
            return Err(refuse(format!("{assignment:?}"), expected));
        }
        let (last, above) = words.split_last().unwrap_or((&"", &[]));
        let mut table = &mut root;
        for word in above {
            let entry = table.entry(word.to_string()).or_insert_with(|| Value::Table(Table::new()));
            let Value::Table(below) = entry else {
                return Err(refuse(format!("{assignment:?}"), "no key below a key that already has a value"));
            };
            table = below;
        }
        table.insert(last.to_string(), read(value.trim()));
    }
    Ok(root)
}

/// A value as a file writes it, or else a text.
pub fn read(value: &str) -> Value {
    let text = || Value::String(value.to_string());
    let parsed = format!("value = {value}").parse::<Table>().ok();
    // A value with a line of its own would smuggle in other keys.
    match parsed {
        Some(mut table) if table.len() == 1 => table.remove("value").unwrap_or_else(text),
        _ => text(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn assignments_become_a_table_and_unfit_ones_say_what_is_expected() {
        let of = |assignments: &[&str]| table(&assignments.iter().map(|text| text.to_string()).collect::<Vec<_>>());
        let set = of(&["budget.slots=8", "budget.epochs = 2", "scenes.source=synth", "name=\"a\"", "describes=a = b"]);
        let expected =
            "name = \"a\"\ndescribes = \"a = b\"\n[budget]\nslots = 8\nepochs = 2\n[scenes]\nsource = \"synth\"\n";
        assert_eq!(set.unwrap(), expected.parse::<Table>().unwrap());
        let cases = [("budget.slots", "KEY=VALUE"), ("=8", "KEY=VALUE"), ("lineage.ego=idm", "outside lists")];
        for (bad, expected) in cases {
            let error = of(&[bad]).unwrap_err().to_string();
            assert!(error.contains(expected) && error.contains(bad), "{error}");
        }
        assert!(of(&["seed=1", "seed.x=2"]).unwrap_err().to_string().contains("no key below"));
        assert_eq!(of(&["seed=1\nname=2"]).unwrap()["seed"].as_str(), Some("1\nname=2"));
    }
}
