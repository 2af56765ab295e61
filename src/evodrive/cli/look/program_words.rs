//! Chosen programs in the words of their families' contracts, for the report.

use std::collections::BTreeMap;

use crate::adapters::vocabulary;
use crate::compiler::Prepared;
use crate::epoch::Study;
use crate::evidence::RecordedRun;
use crate::evidence::report::Words;
use crate::objects::{Program, SolutionId};
use crate::stage::{Source, scene_values};

/// Returns the words for each lineage whose parent did not stay, for what an expression may read everywhere, and for the families' parameters.
pub fn of(study: &Study, run: &RecordedRun) -> Words {
    let mut words = Words { meanings: meanings(), ..Words::default() };
    for result in run.result.iter().flat_map(|result| &result.lineages) {
        let Some(source) = study.sources.get(&result.family) else { continue };
        let (parent, chosen) = (run.program(&result.parent.solution), run.program(&result.evolved.solution));
        let (Some(parent), Some(chosen)) = (parent, chosen) else { continue };
        if result.parent.solution != result.evolved.solution {
            let changes = source.contract.changes(parent, chosen).into_iter().map(|change| change.says);
            words.changes.insert(result.evolved.solution.clone(), changes.collect());
            words.rules_hold.extend(rules_hold(study, source, chosen));
            words.flows.insert(result.evolved.solution.clone(), source.contract.flow(parent, chosen));
        }
        for (name, spec) in &source.contract.parameters {
            words.meanings.entry(name.clone()).or_insert_with(|| spec.describes.clone());
        }
    }
    words
}

/// In how many held-out scenes each rule of a program holds; nothing of one without rules.
fn rules_hold(study: &Study, source: &Source, program: &Program) -> Option<(SolutionId, (Vec<usize>, usize))> {
    let rules = program.scenario_conditioned_policy.len();
    let prepared = Prepared::new(program, source).ok().filter(|_| rules > 0)?;
    let held_out = study.held_out.iter().map(|place| scene_values(study.scenes[*place].features()));
    let holding: Vec<Vec<usize>> = held_out.map(|values| prepared.rules(&values)).collect();
    let count = |rule: usize| holding.iter().filter(|of| of.contains(&rule)).count();
    Some((program.solution_id.clone(), ((0..rules).map(count).collect(), holding.len())))
}

fn meanings() -> BTreeMap<String, String> {
    let lists = [
        vocabulary::SCENE,
        vocabulary::ACTOR,
        vocabulary::SHAPE,
        vocabulary::LAW,
        vocabulary::CANDIDATE,
        vocabulary::REHEARSED,
        vocabulary::GROUP,
    ];
    let unit = |unit: &str| if unit.is_empty() || unit == "1" { String::new() } else { format!(" [{unit}]") };
    let of = |feature: &crate::adapters::Feature| {
        (feature.name.to_string(), format!("{}{}", feature.describes, unit(feature.unit)))
    };
    lists.into_iter().flatten().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::evolve::first_epoch::carried_out;
    use crate::objects::PolicyRule;

    #[test]
    fn a_rule_is_counted_in_the_held_out_scenes_in_which_it_holds() {
        carried_out(None, |study, run, _| {
            let parent = &run.parents[0].program;
            let source = study.sources.get(&parent.source_family).unwrap();
            assert!(rules_hold(study, source, parent).is_none(), "it has no rule");
            let rule = |name: &str, when: &str| PolicyRule {
                name: name.into(),
                when: when.into(),
                // A rule has to set something.
                parameters: parent.parameters.clone().into_iter().take(1).collect(),
                operators: BTreeMap::new(),
            };
            let mut program = parent.clone();
            program.scenario_conditioned_policy = vec![
                rule("always", "vehicle_count >= 0"),
                rule("never", "vehicle_count < 0"),
                rule("crossing", "is_junction"),
            ];
            let (_, (holds, all)) = rules_hold(study, source, &program).unwrap();
            let junctions = study.held_out.iter().filter(|place| study.scenes[**place].features().is_junction).count();
            assert_eq!((all, holds), (study.held_out.len(), vec![all, 0, junctions]));
            assert!(junctions > 0 && junctions < all, "the scenes do not tell the rules apart: {junctions} of {all}");
        });
    }
}
