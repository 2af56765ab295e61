//! Programs made of SafeBench's own files of parameters, and of ChatScene's: what the numbers are in a family's parameters. What
//! a file says and a program cannot hold is refused or named, never dropped.

mod human;
mod ranges;
mod sequences;

pub use human::entries as human_entries;
pub use ranges::written as optimised_ranges;
pub use sequences::{sequence_of, trigger_is_the_ports};

use std::collections::BTreeMap;

use super::ProgramFile;
use crate::families::{adv_traj, advsim, human as human_family};
use crate::formats::ImportError;
use crate::formats::safebench::parameters::{Entry, ParameterFile, Parameters, SEQUENCE_VALUES};
use crate::objects::{FamilyName, ParameterValue, Program, Setting};
use crate::scene::safebench::TrafficFamily;

/// Part of a file that is meant.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    /// The member of each scenario's list, or the sequence of this number.
    pub take: Option<u32>,
    /// Of entries that differ from route to route, and of ChatScene's.
    pub route: Option<u32>,
    /// SafeBench's method: `advsim` or `adv_trajectory`.
    pub method: Option<String>,
    /// Scenario that a file's content does not name, 1 to 8.
    pub scenario: Option<usize>,
    /// ChatScene's behaviour, 1 to 5.
    pub behaviour: Option<usize>,
    /// ChatScene's step; the last without it.
    pub step: Option<usize>,
}

/// A program made of a file.
#[derive(Clone, Debug)]
pub struct Made {
    /// The program.
    pub file: ProgramFile,
    /// Sentences on what it holds of the file, and what not.
    pub notes: Vec<String>,
}

/// Reads the sequence file of a scenario by its name, for lists that name them.
pub type SequenceFiles<'a> = &'a dyn Fn(usize, &str) -> Result<Vec<f64>, ImportError>;

/// The method as SafeBench's folders, its lists and the file of sequences call it, and our family.
const METHODS: [(&str, &str); 3] =
    [("advsim", advsim::NAME), ("adv_trajectory", adv_traj::NAME), ("advtraj", adv_traj::NAME)];

impl Made {
    /// The program of a file.
    ///
    /// # Errors
    /// A method that has no family here; a part that is not named and would have to be; values that the family's contract
    /// refuses, with name and bounds.
    pub fn of(file: &str, read: ParameterFile, wanted: &Wanted, files: SequenceFiles<'_>) -> Result<Made, ImportError> {
        match read {
            ParameterFile::List(entries) => of_list(file, &entries, wanted, files),
            ParameterFile::Ranges(all) => ranges::made(file, &all, wanted),
            ParameterFile::Sequence(values) => {
                let method = wanted.method.as_deref().ok_or_else(|| {
                    ImportError::new(
                        file,
                        "the list",
                        "a method beside one sequence",
                        "add --method advsim or --method adv_trajectory",
                    )
                })?;
                let scenario = family_of(file, wanted.scenario)?;
                sequences::made(file, method, BTreeMap::from([(scenario, values)]))
            }
            ParameterFile::Sequences(all) => {
                let known = all.keys().cloned().collect::<Vec<_>>().join(" or ");
                let only = (all.len() == 1).then(|| all.keys().next()).flatten();
                let method = wanted.method.as_ref().or(only).ok_or_else(|| {
                    ImportError::new(file, "the top", "one method", format!("name it: --method {known}"))
                })?;
                let found = all
                    .iter()
                    .find(|(name, _)| family_name(name).is_some() && family_name(name) == family_name(method));
                let of_method = found.map(|(_, of)| of).ok_or_else(|| {
                    ImportError::new(
                        file,
                        "the top",
                        format!("sequences of {method}"),
                        format!("it holds those of {known}"),
                    )
                })?;
                let number = wanted.take.unwrap_or(0);
                let mut taken = BTreeMap::new();
                for (scenario, numbered) in of_method {
                    let place = format!("{method}, scenario {scenario}");
                    let values = numbered.get(&number).ok_or_else(|| {
                        let expected = format!("a sequence {number}, found {}", of_list_of(numbered.keys()));
                        ImportError::new(file, place, expected, "name another one with --take")
                    })?;
                    taken.insert(family_of(file, Some(*scenario))?, values.clone());
                }
                let mut made = sequences::made(file, method, taken)?;
                made.notes.push(format!("sequence {number} of each scenario; --take names another one"));
                Ok(made)
            }
        }
    }
}

/// Our family for a method.
fn family_name(method: &str) -> Option<&'static str> {
    METHODS.iter().find(|(name, family)| *name == method || *family == method).map(|(_, family)| *family)
}

fn of_list_of<T: ToString>(all: impl Iterator<Item = T>) -> String {
    all.map(|one| one.to_string()).collect::<Vec<_>>().join(", ")
}

fn family_of(file: &str, scenario: Option<usize>) -> Result<TrafficFamily, ImportError> {
    scenario
        .and_then(TrafficFamily::of_number)
        .ok_or_else(|| ImportError::new(file, "its name", "the number of a scenario, 1 to 8", "add --scenario NUMBER"))
}

/// A list: entries of one method.
fn of_list(file: &str, entries: &[Entry], wanted: &Wanted, files: SequenceFiles<'_>) -> Result<Made, ImportError> {
    let method = entries.first().map_or("", |entry| entry.scenario_folder.as_str());
    if let Some(k) = entries.iter().position(|entry| entry.scenario_folder != method) {
        let expected = format!("scenario_folder {method}, as in entry 0, found {}", entries[k].scenario_folder);
        return Err(ImportError::new(
            file,
            format!("entry {k}"),
            expected,
            "import each method from a list of its own",
        ));
    }
    if method == human_family::NAME {
        return human::made(file, entries, wanted);
    }
    if family_name(method).is_none() {
        let expected = format!("human, advsim or adv_trajectory as scenario_folder, found {method}");
        return Err(ImportError::new(file, "entry 0", expected, "no family here plays that method's models"));
    }
    let number = wanted.take.unwrap_or(0) as usize;
    let mut taken: BTreeMap<TrafficFamily, Vec<f64>> = BTreeMap::new();
    for (family, (_, entry)) in chosen(file, entries, number, wanted.route)? {
        let Parameters::File(name) = &entry.parameters else {
            let place = format!("data_id {}", entry.data_id);
            return Err(ImportError::new(
                file,
                place,
                "the name of a sequence's file as parameters",
                "take the benchmark's list",
            ));
        };
        taken.insert(family, files(family.number(), name)?);
    }
    sequences::made(file, method, taken)
}

/// Of each scenario in a list the entry at a place of its route's entries. Where routes differ one has to be named.
fn chosen<'e>(
    file: &str,
    entries: &'e [Entry],
    number: usize,
    route: Option<u32>,
) -> Result<BTreeMap<TrafficFamily, (u32, &'e Entry)>, ImportError> {
    let mut taken: BTreeMap<TrafficFamily, (u32, &Entry)> = BTreeMap::new();
    for ((family, of_route), members) in by_route(entries) {
        if route.is_some_and(|route| route != of_route) {
            continue;
        }
        let place = format!("scenario {}, route {of_route}", family.number());
        let entry = *members.get(number).ok_or_else(|| {
            let expected = format!("an entry {number} (counted from 0), found {} entries", members.len());
            ImportError::new(file, place.clone(), expected, "name another one with --take")
        })?;
        match taken.get(&family) {
            None => drop(taken.insert(family, (of_route, entry))),
            Some((_, before)) if before.parameters == entry.parameters => {}
            Some((other, _)) => {
                let expected = format!("the parameters of route {other}, found others");
                return Err(ImportError::new(
                    file,
                    place,
                    expected,
                    "name the route whose parameters are meant: --route NUMBER",
                ));
            }
        }
    }
    if taken.is_empty() {
        Err(ImportError::new(file, "the list", "entries of that route, found none", "name a route that it holds"))
    } else {
        Ok(taken)
    }
}

/// Entries of each scenario on each route, in the order of the list.
fn by_route(entries: &[Entry]) -> BTreeMap<(TrafficFamily, u32), Vec<&Entry>> {
    let mut all: BTreeMap<(TrafficFamily, u32), Vec<&Entry>> = BTreeMap::new();
    for entry in entries {
        let Some(family) = TrafficFamily::of_number(entry.scenario_id) else { continue };
        all.entry((family, entry.route_id)).or_default().push(entry);
    }
    all
}

/// A family's parent with other parameters and words, if its contract allows them.
fn changed(
    file: &str,
    family: &str,
    parameters: BTreeMap<String, f64>,
    words: &BTreeMap<String, String>,
    sequences: BTreeMap<TrafficFamily, Vec<f64>>,
) -> Result<ProgramFile, ImportError> {
    let unfit = |reason: String| {
        ImportError::new(file, "its values", reason, "correct that value, or take another part of the file")
    };
    let published = ProgramFile::published(&FamilyName::new(family)).map_err(|error| unfit(error.to_string()))?;
    let mut program: Program = published.program.clone();
    program.parameters.extend(parameters.into_iter().map(|(name, value)| (name, ParameterValue::Number(value))));
    for node in program.operator_graph.values_mut() {
        for (setting, word) in words {
            if let Some(value) = node.settings.get_mut(setting) {
                *value = Setting::Choice(word.clone());
            }
        }
    }
    let source = super::contract::source_of(file, &published.family).map_err(|error| unfit(error.to_string()))?;
    if let Some(problem) = source.contract.check_program(&program).into_iter().next() {
        return Err(unfit(format!("values within the contract of family {family}: {problem}")));
    }
    if program == published.program && sequences.is_empty() {
        return Ok(published);
    }
    ProgramFile { sequences, ..published }.rewritten(program).map_err(|error| unfit(error.to_string()))
}

impl ProgramFile {
    /// Says what is wrong with its control sequences; `None` if nothing is.
    pub(super) fn unfit_sequence(&self) -> Option<String> {
        let plays = METHODS.iter().any(|(_, family)| *family == self.family.as_str());
        if !plays && !self.sequences.is_empty() {
            return Some(format!("programs of family {} play no control sequences", self.family));
        }
        let sound = |values: &[f64]| values.len() == SEQUENCE_VALUES && values.iter().all(|u| (0.0..=1.0).contains(u));
        let (family, _) = self.sequences.iter().find(|(_, values)| !sound(values))?;
        Some(format!("the sequence of {} is not {SEQUENCE_VALUES} numbers from 0 to 1", family.name()))
    }
}

#[cfg(test)]
mod tests;
