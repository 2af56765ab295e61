//! The protected-resource gate: no edit names or reaches ego, scenes and their split, simulator, metrics, evaluator,
//! archive, or the fields that are inherited or kept by the system.

use super::{
    apply::{ApplyError, shortened},
    weight,
};
use crate::{
    adapters::{Contract, Problem, isolation::identifiers},
    objects::{Operation, Program, ProgramPatch, Surface},
};

/// Whole words, compared without case; `ego_speed_mps` is not `ego`. No contract declares one of them.
pub const PROTECTED: [&str; 44] = [
    "acceptor",
    "ancestor_chain",
    "archive",
    "archive_acceptor",
    "attempt",
    "attempts",
    "benchmark",
    "benchmark_manifest",
    "compile_contract",
    "ego",
    "ego_policy",
    "evaluation",
    "evaluator",
    "generation",
    "held_out",
    "heldout",
    "labels",
    "lineage_id",
    "locked_split",
    "manifest",
    "memory",
    "metric",
    "metrics",
    "objectives",
    "parent_program_hash",
    "program_hash",
    "realism_weights",
    "registry",
    "reward",
    "scene_pool",
    "scenes",
    "score_weights",
    "seed_split",
    "seeds",
    "simulator",
    "simulator_evaluator",
    "solution_id",
    "source_baseline",
    "source_family",
    "split",
    "splits",
    "test_split",
    "world",
    "world_evaluator",
];

pub fn check(
    parent: &Program,
    patch: &ProgramPatch,
    contract: &Contract,
    child: &Result<Program, ApplyError>,
) -> Vec<Problem> {
    let mut problems = Vec::new();
    for (index, operation) in patch.operations.iter().enumerate() {
        let place = format!("patch/operations/{index}");
        problems.extend(check_path(&format!("{place}/path"), &operation.path));
        problems.extend(check_words(&format!("{place}/value"), operation));
    }
    if let Ok(child) = child {
        problems.extend(contract.check_inherited(child));
        if child.lineage_id != parent.lineage_id {
            problems.push(Problem::new(
                "/lineage_id",
                format!("`{}`", child.lineage_id),
                format!("`{}`", parent.lineage_id),
            ));
        }
    }
    problems
}

fn is_protected(word: &str) -> bool {
    PROTECTED.contains(&word)
}

/// Checks the target of the path as written, and as a careless reader would understand it: escapes
/// and percent codes undone, `.` and `..` resolved, case and repeated slashes ignored.
fn check_path(place: &str, path: &str) -> Option<Problem> {
    let steps = normalised(path);
    let leaves = !steps.first().is_some_and(|first| Surface::ALL.iter().any(|surface| surface.name() == first));
    let named = steps.iter().find(|step| is_protected(step));
    let climbs = path_steps(path).iter().any(|step| step == "..");
    let reason = match named {
        Some(word) => format!("`{}`, which reaches `{word}`", shortened(path)),
        None if climbs && leaves => format!("`{}`, which leaves the editable surface", shortened(path)),
        None => return None,
    };
    Some(Problem::new(place, reason, "a place of the editable surface: this one is protected"))
}

/// Keys and identifiers of the value, the names in its expressions among them.
fn check_words(place: &str, operation: &Operation) -> Vec<Problem> {
    let texts = operation.value.iter().flat_map(weight::texts);
    let words = texts.flat_map(identifiers);
    let names: std::collections::BTreeSet<String> =
        words.map(str::to_ascii_lowercase).filter(|word| is_protected(word)).collect();
    names
        .into_iter()
        .map(|word| Problem::new(place, format!("the protected word `{word}`"), "nothing protected"))
        .collect()
}

fn path_steps(path: &str) -> Vec<String> {
    let decoded = percent_decoded(&percent_decoded(path)).to_lowercase().replace("~1", "/").replace("~0", "~");
    decoded.split(['/', '\\', '#']).map(str::trim).filter(|step| !step.is_empty()).map(String::from).collect()
}

fn normalised(path: &str) -> Vec<String> {
    let mut steps: Vec<String> = Vec::new();
    for step in path_steps(path) {
        match step.as_str() {
            "." => {}
            ".." => {
                steps.pop();
            }
            _ => steps.push(step),
        }
    }
    steps
}

fn percent_decoded(text: &str) -> String {
    let bytes = text.as_bytes();
    let digit = |at: usize| bytes.get(at).and_then(|b| char::from(*b).to_digit(16));
    let mut out = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while let Some(byte) = bytes.get(at) {
        match (byte, digit(at + 1), digit(at + 2)) {
            (b'%', Some(high), Some(low)) => {
                out.push((high * 16 + low) as u8);
                at += 3;
            }
            _ => {
                out.push(*byte);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adapters::{toy, vocabulary};

    #[test]
    fn no_word_that_programs_need_is_protected() {
        let features =
            [vocabulary::SCENE, vocabulary::ACTOR, vocabulary::CANDIDATE, vocabulary::LAW, vocabulary::SHAPE].concat();
        assert!(!features.iter().any(|feature| is_protected(feature.name)));
        assert!(!toy::contract().vocabulary().into_iter().any(is_protected));
    }

    #[test]
    fn paths_are_read_as_a_careless_reader_would() {
        for path in ["/a/../ego", "//EGO", "/a/%2e%2e/%65go", "/a/%252e%252e/ego", "#/ego", "\\ego", "/./ego/"] {
            assert_eq!(normalised(path).first().map(String::as_str), Some("ego"), "{path}");
        }
        assert_eq!(normalised("/parameters/%zz%"), ["parameters", "%zz%"]);
        assert_eq!(normalised("/../../.."), Vec::<String>::new());
    }

    #[test]
    fn a_path_that_climbs_is_refused_only_where_it_leaves_the_editable_surface() {
        assert!(check_path("operations/0", "/parameters/../weather").is_some());
        assert!(check_path("operations/0", "/parameters/a/../b").is_none(), "stays inside");
        assert!(check_path("operations/0", "/weather").is_none(), "the interface gate refuses it");
    }
}
