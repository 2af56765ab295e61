//! Chosen programs in the words of their families' contracts, for the report.

use std::collections::BTreeMap;

use crate::adapters::vocabulary;
use crate::epoch::Study;
use crate::evidence::RecordedRun;
use crate::evidence::report::Words;

/// Of each lineage whose parent did not stay; what an expression may read everywhere, and the parameters of the families.
pub fn of(study: &Study, run: &RecordedRun) -> Words {
    let mut words = Words { meanings: meanings(), ..Words::default() };
    for result in run.result.iter().flat_map(|result| &result.lineages) {
        let Some(source) = study.sources.get(&result.family) else { continue };
        let (parent, chosen) = (run.program(&result.parent.solution), run.program(&result.evolved.solution));
        let (Some(parent), Some(chosen)) = (parent, chosen) else { continue };
        if result.parent.solution != result.evolved.solution {
            let changes = source.contract.changes(parent, chosen).into_iter().map(|change| change.says);
            words.changes.insert(result.evolved.solution.clone(), changes.collect());
            words.flows.insert(result.evolved.solution.clone(), source.contract.flow(parent, chosen));
        }
        for (name, spec) in &source.contract.parameters {
            words.meanings.entry(name.clone()).or_insert_with(|| spec.describes.clone());
        }
    }
    words
}

fn meanings() -> BTreeMap<String, String> {
    let lists = [
        vocabulary::SCENE,
        vocabulary::ACTOR,
        vocabulary::SHAPE,
        vocabulary::LAW,
        vocabulary::CANDIDATE,
        vocabulary::GROUP,
    ];
    let unit = |unit: &str| if unit.is_empty() || unit == "1" { String::new() } else { format!(" [{unit}]") };
    let of = |feature: &crate::adapters::Feature| {
        (feature.name.to_string(), format!("{}{}", feature.describes, unit(feature.unit)))
    };
    lists.into_iter().flatten().map(of).collect()
}
