//! SafeBench's files of scenario parameters, and ChatScene's: lists of scenarios (`scenario_type/*.json`), control sequences,
//! optimised ranges. Bytes to plain data and back; the meaning of the numbers is explained where a program is made of them.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::formats::import_error::{ImportError, shown};
use crate::scene::safebench::TrafficFamily;

/// Most bytes of a file. The benchmark's files have less than 1 MiB.
const BYTES_MAX: usize = 16 << 20;
/// Most entries of one list, and most sequences and ranges of one file.
const ENTRIES_MAX: usize = 100_000;
/// Count of numbers of a control sequence: one for each tick of 0.1 s.
pub const SEQUENCE_VALUES: usize = 100;
/// Largest absolute value of a parameter.
const VALUE_MAX: f64 = 1e6;

/// One scenario of a list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Its number in the list.
    pub data_id: u32,
    /// The method: SafeBench's folder of scenario classes.
    pub scenario_folder: String,
    /// Number of the scenario, 1 to 8.
    pub scenario_id: usize,
    /// Number of the route.
    pub route_id: u32,
    /// Null in the benchmark's own files.
    #[serde(default)]
    pub risk_level: Option<f64>,
    /// Parameters for the method.
    pub parameters: Parameters,
}

/// Parameters of one scenario.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Parameters {
    /// Numbers in the order of the scenario's class (Human).
    Numbers(Vec<f64>),
    /// Name of the file that holds them, below a folder of the scenario's number (AdvSim, AT).
    File(String),
    /// Anything else: null, a model with flags.
    Other(serde_json::Value),
}

/// Control sequences: method -> scenario -> number -> values.
pub type Sequences = BTreeMap<String, BTreeMap<usize, BTreeMap<u32, Vec<f64>>>>;

/// The bounds of one of ChatScene's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// Least value.
    pub low: f64,
    /// Greatest value.
    pub high: f64,
}

/// ChatScene's ranges: `OPT_behavior_<b>_opt_ROUTE-<r>` -> `opt_time_<t>` -> `OPT_*` -> bounds.
pub type OptimisedRanges = BTreeMap<String, BTreeMap<String, BTreeMap<String, Range>>>;

/// Content of a file of parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum ParameterFile {
    /// A list of scenarios.
    List(Vec<Entry>),
    /// Many control sequences.
    Sequences(Sequences),
    /// One control sequence, as SafeBench's own folder holds it.
    Sequence(Vec<f64>),
    /// Optimised ranges.
    Ranges(OptimisedRanges),
}

/// Returns the key of the entry for a behaviour on a route.
pub fn behaviour_key(behaviour: usize, route: u32) -> String {
    format!("OPT_behavior_{behaviour}_opt_ROUTE-{route}")
}

/// Returns the key of the ranges after a number of steps.
pub fn step_key(step: usize) -> String {
    format!("opt_time_{step}")
}

impl ParameterFile {
    /// Reads a file, and recognises by its content which of the four it is.
    ///
    /// # Errors
    /// It is no such file, or a number is out of bounds, with its place.
    pub fn read(file: &str, bytes: &[u8]) -> Result<ParameterFile, ImportError> {
        let refuse = |place: &str, expected: String| ImportError::new(file, place, expected, REMEDY);
        if bytes.len() > BYTES_MAX {
            return Err(refuse("byte 0", "at most 16 MiB".into()));
        }
        let value: serde_json::Value = serde_json::from_slice(bytes)
            .map_err(|error| refuse(&format!("line {}", error.line()), format!("JSON ({error})")))?;
        let first_of = |items: &[serde_json::Value]| items.first().is_some_and(serde_json::Value::is_number);
        let read = match &value {
            serde_json::Value::Array(items) if first_of(items) => {
                ParameterFile::Sequence(sequence(file, "the list", items.iter().cloned().collect())?)
            }
            serde_json::Value::Array(items) => ParameterFile::List(entries(file, items)?),
            serde_json::Value::Object(of) if of.keys().any(|key| key.starts_with("OPT_")) => {
                ParameterFile::Ranges(ranges(file, of)?)
            }
            serde_json::Value::Object(of) => ParameterFile::Sequences(sequences(file, of)?),
            other => {
                let found = format!("a list or an object, found {}", shown(&other.to_string()));
                return Err(refuse("the top", found));
            }
        };
        match read.count() {
            0 => Err(refuse("the top", "at least one entry, found none".into())),
            count if count > ENTRIES_MAX => Err(refuse("the top", format!("at most 100000 entries, found {count}"))),
            _ => Ok(read),
        }
    }

    fn count(&self) -> usize {
        match self {
            ParameterFile::List(entries) => entries.len(),
            ParameterFile::Sequences(of) => of.values().flat_map(BTreeMap::values).map(BTreeMap::len).sum(),
            ParameterFile::Sequence(_) => 1,
            ParameterFile::Ranges(of) => of.len(),
        }
    }
}

/// Advice for a file that is none of these.
const REMEDY: &str =
    "name a scenario list, a file of control sequences or of optimised ranges, as the benchmark ships them";

fn typed<T: DeserializeOwned>(file: &str, place: &str, value: serde_json::Value, what: &str) -> Result<T, ImportError> {
    let refused = |error: serde_json::Error| {
        ImportError::new(file, place, format!("{what} ({})", shown(&error.to_string())), REMEDY)
    };
    serde_json::from_value(value).map_err(refused)
}

fn entries(file: &str, items: &[serde_json::Value]) -> Result<Vec<Entry>, ImportError> {
    let mut entries = Vec::with_capacity(items.len().min(ENTRIES_MAX));
    for (k, item) in items.iter().enumerate() {
        let place = format!("entry {k}");
        let entry: Entry = typed(
            file,
            &place,
            item.clone(),
            "a scenario with data_id, scenario_folder, scenario_id, route_id and parameters",
        )?;
        let refuse = |expected: String| ImportError::new(file, place.as_str(), expected, REMEDY);
        if TrafficFamily::of_number(entry.scenario_id).is_none() {
            return Err(refuse(format!("scenario_id from 1 to 8, found {}", entry.scenario_id)));
        }
        if let Parameters::Numbers(numbers) = &entry.parameters
            && let Some(number) = numbers.iter().find(|x| x.abs() > VALUE_MAX)
        {
            return Err(refuse(format!("parameters within a million, found {number}")));
        }
        entries.push(entry);
    }
    Ok(entries)
}

/// Reads one sequence: 100 numbers from 0 to 1.
fn sequence(file: &str, place: &str, value: serde_json::Value) -> Result<Vec<f64>, ImportError> {
    let values: Vec<f64> = typed(file, place, value, "a list of numbers")?;
    let refuse = |expected: String| Err(ImportError::new(file, place, expected, REMEDY));
    if values.len() != SEQUENCE_VALUES {
        return refuse(format!("{SEQUENCE_VALUES} numbers, found {}", values.len()));
    }
    match values.iter().position(|u| !(0.0..=1.0).contains(u)) {
        Some(k) => refuse(format!("numbers from 0 to 1, found {} at place {k}", values[k])),
        None => Ok(values),
    }
}

type Object = serde_json::Map<String, serde_json::Value>;

fn sequences(file: &str, of: &Object) -> Result<Sequences, ImportError> {
    let mut read = Sequences::new();
    for (method, scenarios) in of {
        let place = shown(method);
        let scenarios: BTreeMap<String, Object> = typed(file, &place, scenarios.clone(), "scenarios with sequences")?;
        for (scenario, numbered) in scenarios {
            let number = scenario.parse().ok().filter(|number| TrafficFamily::of_number(*number).is_some());
            let Some(number) = number else {
                let expected = format!("a scenario from 1 to 8, found {}", shown(&scenario));
                return Err(ImportError::new(file, place, expected, REMEDY));
            };
            for (name, values) in numbered {
                let place = format!("{place}, scenario {number}, sequence {}", shown(&name));
                let Ok(key) = name.parse() else {
                    return Err(ImportError::new(file, place, "a number as the name of a sequence", REMEDY));
                };
                let values = sequence(file, &place, values)?;
                read.entry(method.clone()).or_default().entry(number).or_default().insert(key, values);
            }
        }
    }
    Ok(read)
}

fn ranges(file: &str, of: &Object) -> Result<OptimisedRanges, ImportError> {
    let mut read = OptimisedRanges::new();
    for (name, steps) in of {
        let steps: Object = typed(file, &shown(name), steps.clone(), "steps of optimised ranges")?;
        // The list of kept samples says nothing about the ranges.
        for (step, of_step) in steps.into_iter().filter(|(step, _)| step != "select_id") {
            let place = format!("{}, {}", shown(name), shown(&step));
            let of_step: BTreeMap<String, Range> = typed(file, &place, of_step, "ranges with low and high")?;
            let sound = |range: &Range| range.low <= range.high && range.low.abs().max(range.high.abs()) <= VALUE_MAX;
            if let Some((number, range)) = of_step.iter().find(|(_, range)| !sound(range)) {
                let expected =
                    format!("low not above high, found {} and {} in {}", range.low, range.high, shown(number));
                return Err(ImportError::new(file, place, expected, REMEDY));
            }
            read.entry(name.clone()).or_default().insert(step, of_step);
        }
    }
    Ok(read)
}

/// Writes a value as in the benchmark's files: indented JSON.
///
/// # Errors
/// A number that is not finite.
pub fn written<T: Serialize>(value: &T) -> Result<Vec<u8>, serde_json::Error> {
    let mut bytes = serde_json::to_vec_pretty(value)?;
    bytes.push(b'\n');
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        ParameterFile::read("p.json", text.as_bytes()).unwrap_err().to_string()
    }

    #[test]
    fn a_file_is_known_by_its_content() {
        let entry =
            r#"{"data_id":3,"scenario_folder":"human","scenario_id":1,"route_id":4,"risk_level":null,"parameters":P}"#;
        let list = |parameters: &str| format!("[{}]", entry.replace('P', parameters));
        let of = |text: &str| ParameterFile::read("p.json", text.as_bytes()).unwrap();
        let ParameterFile::List(entries) = of(&list("[2.5,16,40]")) else { panic!() };
        assert_eq!(entries[0].parameters, Parameters::Numbers(vec![2.5, 16.0, 40.0]));
        let ParameterFile::List(entries) = of(&list("\"0.json\"")) else { panic!() };
        assert_eq!(entries[0].parameters, Parameters::File("0.json".into()));
        let ParameterFile::List(entries) = of(&list("[\"0.pth\", false]")) else { panic!() };
        assert!(matches!(entries[0].parameters, Parameters::Other(_)));
        let values = format!("[{}]", ["0.25"; 100].join(","));
        assert_eq!(of(&values), ParameterFile::Sequence(vec![0.25; 100]));
        let ParameterFile::Sequences(all) = of(&format!(r#"{{"advsim":{{"8":{{"2":{values}}}}}}}"#)) else { panic!() };
        assert_eq!(all["advsim"][&8][&2], vec![0.25; 100]);
        let text =
            r#"{"OPT_behavior_1_opt_ROUTE-0":{"opt_time_0":{"OPT_ADV_SPEED":{"low":0,"high":5}},"select_id":[1]}}"#;
        let ParameterFile::Ranges(all) = of(text) else { panic!() };
        assert_eq!(all[&behaviour_key(1, 0)][&step_key(0)]["OPT_ADV_SPEED"], Range { low: 0.0, high: 5.0 });
        assert_eq!(all[&behaviour_key(1, 0)].len(), 1, "what was selected is no step");
    }

    #[test]
    fn what_does_not_fit_is_named_with_its_place() {
        assert!(refused("{").contains("line 1"), "{}", refused("{"));
        assert!(refused("[]").contains("found none") && refused("{}").contains("found none"));
        assert!(refused("7").contains("the top: expected a list or an object, found 7"));
        assert!(refused("[0.5]").contains("expected 100 numbers, found 1"));
        let long = format!("[{},1.5]", ["0.25"; 99].join(","));
        assert!(refused(&long).contains("found 1.5 at place 99"), "{}", refused(&long));
        let entry = r#"[{"data_id":3,"scenario_folder":"human","scenario_id":9,"route_id":4,"parameters":[1]}]"#;
        assert!(refused(entry).contains("entry 0: expected scenario_id from 1 to 8, found 9"), "{}", refused(entry));
        assert!(refused(r#"[{"data_id":3}]"#).contains("missing field"));
        assert!(refused(r#"{"advsim":{"9":{}}}"#).contains("a scenario from 1 to 8, found 9"));
        let crossed = r#"{"OPT_b":{"opt_time_0":{"OPT_ADV_SPEED":{"low":6,"high":5}}}}"#;
        assert!(
            refused(crossed).contains("low not above high, found 6 and 5 in OPT_ADV_SPEED"),
            "{}",
            refused(crossed)
        );
    }
}
