//! Changes of a patch, for readers: unified diffs of programs, and the surfaces that a patch touches (paper fig.
//! patch-surface-distribution).

use serde::Serialize;
use std::collections::BTreeSet;

use super::{
    patch::{EDITABLE_SURFACE, ProgramPatch},
    program::{Program, normalised_modules, normalised_policy},
};

/// Lines around a change that are shown with it.
const CONTEXT_LINES: usize = 3;

/// The four parts of a program that can be edited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Surface {
    /// θ
    Parameters,
    /// G
    OperatorGraph,
    /// ρ
    ScenarioConditionedPolicy,
    /// H
    MechanismModules,
}

impl Surface {
    /// All surfaces, in the order of the paper's tuple.
    pub const ALL: [Surface; 4] =
        [Surface::Parameters, Surface::OperatorGraph, Surface::ScenarioConditionedPolicy, Surface::MechanismModules];

    /// The name as in paths, without the slash.
    pub fn name(self) -> &'static str {
        EDITABLE_SURFACE[self as usize].trim_start_matches('/')
    }

    /// The surface that a path begins with; `None` outside the editable part.
    pub fn of_path(path: &str) -> Option<Surface> {
        let first = path.strip_prefix('/')?.split('/').next()?;
        Surface::ALL.into_iter().find(|surface| surface.name() == first)
    }
}

/// The surfaces that a patch names; one patch may count for several.
pub fn edit_categories(patch: &ProgramPatch) -> BTreeSet<Surface> {
    patch.operations.iter().filter_map(|operation| Surface::of_path(&operation.path)).collect()
}

/// The program's content as indented JSON, expressions in canonical text: what diffs and reports show. Fields keep
/// their order and maps are sorted, so equal content gives equal text.
pub fn program_text(program: &Program) -> String {
    #[derive(Serialize)]
    struct Shown<'a> {
        source_family: &'a super::FamilyName,
        parameters: &'a std::collections::BTreeMap<String, super::ParameterValue>,
        operator_graph: &'a std::collections::BTreeMap<String, super::OperatorNode>,
        scenario_conditioned_policy: Vec<super::PolicyRule>,
        mechanism_modules: std::collections::BTreeMap<String, super::MechanismModule>,
        compile_contract: &'a super::CompileContract,
    }
    let shown = Shown {
        source_family: &program.source_family,
        parameters: &program.parameters,
        operator_graph: &program.operator_graph,
        scenario_conditioned_policy: normalised_policy(&program.scenario_conditioned_policy),
        mechanism_modules: normalised_modules(&program.mechanism_modules),
        compile_contract: &program.compile_contract,
    };
    match serde_json::to_string_pretty(&shown) {
        Ok(text) => text + "\n",
        Err(error) => unreachable!("a program has text keys only, so it always has a JSON text: {error}"),
    }
}

/// Unified diff of two programs' content; empty where they do the same.
pub fn program_diff(parent: &Program, child: &Program) -> String {
    let (old, new) = (program_text(parent), program_text(child));
    crate::text::unified_diff(&old, &new, CONTEXT_LINES, [parent.solution_id.as_str(), child.solution_id.as_str()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::{
        CompileContract, FamilyName, LineageId, MechanismModule, Operation, ParameterValue, SolutionId, ValueType,
    };
    use serde_json::json;
    use std::collections::BTreeMap;

    fn program(expression: &str, duration_s: f64) -> Program {
        let module = MechanismModule {
            slot: "actor_score".into(),
            inputs: vec!["gap_m".into()],
            output: ValueType::Number,
            expression: expression.into(),
            tags: vec![],
        };
        Program {
            solution_id: SolutionId::new("toy/parent"),
            lineage_id: LineageId::new("toy"),
            source_family: FamilyName::new("toy"),
            generation: 0,
            parameters: BTreeMap::from([("duration_s".into(), ParameterValue::Number(duration_s))]),
            operator_graph: BTreeMap::new(),
            scenario_conditioned_policy: vec![],
            mechanism_modules: BTreeMap::from([("pressure".into(), module)]),
            compile_contract: CompileContract { backend: "metadrive".into(), constraints: vec![] },
            ancestor_chain: vec![],
        }
    }

    #[test]
    fn a_diff_shows_changed_lines_and_nothing_of_spacing() {
        let parent = program("1/gap_m", 4.0);
        let mut child = program("1   / gap_m", 3.0);
        child.solution_id = SolutionId::new("toy/e1s0");
        let diff = program_diff(&parent, &child);
        assert!(diff.starts_with("--- toy/parent\n+++ toy/e1s0\n@@"), "{diff}");
        let changed: Vec<&str> =
            diff.lines().skip(2).filter(|line| line.starts_with('-') || line.starts_with('+')).collect();
        assert_eq!(changed, ["-    \"duration_s\": 4.0", "+    \"duration_s\": 3.0"]);
        assert_eq!(program_diff(&parent, &program("1 / gap_m", 4.0)), "");
    }

    #[test]
    fn spacing_of_expressions_does_not_change_the_hash_but_meaning_does() {
        let parent = program("1/gap_m", 4.0);
        assert_eq!(parent.hash(), program("(1) / gap_m", 4.0).hash());
        assert_ne!(parent.hash(), program("2 / gap_m", 4.0).hash());
        assert_ne!(program("1 /", 4.0).hash(), program("1  /", 4.0).hash());
    }

    #[test]
    fn adoption_begins_a_lineage_without_changing_the_content() {
        let adopted = program("1", 4.0).adopted(&LineageId::new("toy-idm"));
        assert_eq!(adopted.solution_id.as_str(), "toy-idm/parent");
        assert_eq!((adopted.lineage_id.as_str(), adopted.generation), ("toy-idm", 0));
        assert_eq!(adopted.hash(), program("1", 4.0).hash());
    }

    #[test]
    fn categories_name_the_surfaces() {
        use crate::objects::OperationKind;
        let operation = |op, path: &str, value: Option<serde_json::Value>| Operation { op, path: path.into(), value };
        let patch = ProgramPatch {
            source_baseline: FamilyName::new("toy"),
            parent_solution_id: SolutionId::new("toy/parent"),
            parent_program_hash: String::new(),
            operations: vec![
                operation(OperationKind::Replace, "/parameters/duration_s", Some(json!(3.5))),
                operation(OperationKind::Add, "/mechanism_modules/p", Some(json!("x".repeat(100)))),
                operation(OperationKind::Remove, "/parameters/other", None),
                operation(OperationKind::Remove, "/compile_contract", None),
            ],
            hypothesis: "h".into(),
            memory_refs_used: vec![],
            cluster_refs_used: vec![],
            repair_summary: None,
            free: Default::default(),
        };
        let touched: Vec<&str> = edit_categories(&patch).into_iter().map(Surface::name).collect();
        assert_eq!(touched, ["parameters", "mechanism_modules"]);
    }
}
