//! The isolation gate: nothing of another family's implementation, nothing of another lineage.

use super::{apply::ApplyError, weight};
use crate::{
    adapters::{Contract, ForeignVocabulary, Problem, Registry, isolation::identifiers},
    objects::{Operation, Program, ProgramPatch},
};

pub fn check(
    parent: &Program,
    patch: &ProgramPatch,
    contract: &Contract,
    registry: &Registry,
    child: &Result<Program, ApplyError>,
) -> Vec<Problem> {
    let vocabulary = match registry.foreign_vocabulary(&contract.family) {
        Some(known) => known,
        None => &contract.foreign_vocabulary(registry.iter()),
    };
    let mut problems = Vec::new();
    for (index, operation) in patch.operations.iter().enumerate() {
        let texts = operation_texts(operation);
        let place = format!("patch/operations/{index}");
        problems.extend(foreign(&place, contract, vocabulary, &texts));
        problems.extend(texts.iter().filter_map(|text| other_lineage(&place, parent, contract, registry, text)));
    }
    // Words that the parent already had count too.
    if let Ok(content) = child.as_ref().map(program_json) {
        problems.extend(foreign("/", contract, vocabulary, &weight::texts(&content)));
    }
    problems
}

fn operation_texts(operation: &Operation) -> Vec<&str> {
    let mut texts = vec![operation.path.as_str()];
    texts.extend(operation.value.iter().flat_map(weight::texts));
    texts
}

/// Returns the editable content; nothing if the program cannot be written as JSON, in which case the schema gate has failed.
fn program_json(program: &Program) -> serde_json::Value {
    let content = (
        &program.parameters,
        &program.operator_graph,
        &program.scenario_conditioned_policy,
        &program.mechanism_modules,
    );
    serde_json::to_value(content).unwrap_or_default()
}

fn foreign(place: &str, contract: &Contract, vocabulary: &ForeignVocabulary, texts: &[&str]) -> Vec<Problem> {
    let words = vocabulary.words_in(texts.iter().copied());
    words
        .into_iter()
        .map(|found| {
            let word = format!("`{}`, a word of family `{}`", found.word, found.family);
            Problem::new(place, word, format!("only the vocabulary of `{}`", contract.family))
        })
        .collect()
}

/// A lineage or solution id that is not of the parent's lineage: `<family>-<ego>`, `<lineage>/parent`,
/// `<lineage>/e<epoch>s<slot>`.
fn other_lineage(
    place: &str,
    parent: &Program,
    contract: &Contract,
    registry: &Registry,
    text: &str,
) -> Option<Problem> {
    let own = parent.lineage_id.as_str();
    let problem = |id: &str| {
        Problem::new(
            place,
            format!("`{id}`, an id of another lineage"),
            format!("nothing that belongs to others than `{own}`"),
        )
    };
    let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '/')));
    for word in words {
        if let Some((lineage, place)) = word.trim_start_matches('/').split_once('/')
            && is_solution_place(place)
            && lineage != own
        {
            return Some(problem(word));
        }
        let others = registry.iter().map(|f| f.contract.family.as_str()).filter(|f| *f != contract.family.as_str());
        let names_lineage = |family: &str| {
            let rest = word.strip_prefix(family).and_then(|rest| rest.strip_prefix('-'));
            rest.is_some_and(|ego| identifiers(ego).next().is_some())
        };
        if word != own && others.into_iter().any(names_lineage) {
            return Some(problem(word));
        }
    }
    None
}

fn is_solution_place(text: &str) -> bool {
    let numbers = text.strip_prefix('e').and_then(|rest| rest.split_once('s'));
    let digits = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
    text == "parent" || numbers.is_some_and(|(epoch, slot)| digits(epoch) && digits(slot))
}

/// Returns words of other families in a program that stands by itself.
pub fn words_of_others(program: &Program, contract: &Contract, registry: &Registry) -> Vec<Problem> {
    let vocabulary = contract.foreign_vocabulary(registry.iter());
    foreign("/", contract, &vocabulary, &weight::texts(&program_json(program)))
}
