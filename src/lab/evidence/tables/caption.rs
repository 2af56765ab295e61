//! The end of a caption: what the numbers rest on, so that a table can be read without the text around it.

use std::collections::BTreeSet;

use super::layout::{RunSource, Table};
use crate::text::counted;

/// Returns what several runs say, each statement once, in their order.
fn each_once(runs: &[RunSource], part: impl Fn(&RunSource) -> String) -> Option<String> {
    let mut seen = BTreeSet::new();
    let said: Vec<String> =
        runs.iter().map(part).filter(|said| !said.is_empty() && seen.insert(said.clone())).collect();
    (!said.is_empty()).then(|| said.join(" or "))
}

/// Names who proposed: the models of the actor and of the repair, and of the critics where those are others.
fn proposer(run: &RunSource) -> String {
    let words = |label: &String| match label.split(' ').next() {
        Some("scripted") => "a rule-based stand-in, no language model".to_string(),
        Some("random") => "random legal patches".to_string(),
        _ => label.clone(),
    };
    let of = |is_critic: bool| -> BTreeSet<String> {
        let roles = run.models.iter().filter(|(role, _)| role.ends_with("_critic") == is_critic);
        roles
            .filter(|(role, _)| is_critic || matches!(role.as_str(), "actor" | "repair"))
            .map(|(_, label)| words(label))
            .collect()
    };
    let joined = |of: &BTreeSet<String>| of.iter().cloned().collect::<Vec<_>>().join(", ");
    let (own, critics) = (of(false), of(true));
    if critics.is_empty() || critics == own {
        joined(&own)
    } else {
        format!("{}; critics: {}", joined(&own), joined(&critics))
    }
}

/// Sentences on simulator, pool, ego, reading of attack and proposer; nothing of what no run says.
pub fn rests_on(table: &Table) -> String {
    let runs = &table.runs;
    let scenes = |run: &RunSource| {
        let left_out = match run.setting.left_out.as_str() {
            "" => String::new(),
            which => format!(", left out {which}"),
        };
        let counts = format!("{} for evolution, {} held out{left_out}", run.evolution_scenes, run.held_out_scenes);
        match run.setting.pool.as_str() {
            "" => format!("{}, {counts}", counted(run.evolution_scenes + run.held_out_scenes, "scene")),
            pool => format!("{pool}, {counts}"),
        }
    };
    [
        ("Simulator", each_once(runs, |run| run.setting.simulator.clone())),
        ("Pool", each_once(runs, scenes)),
        ("Ego", each_once(runs, |run| run.egos.join(", "))),
        ("Attack", each_once(runs, |run| run.setting.reading.clone())),
        ("Proposals", each_once(runs, proposer)),
        ("Searches a row", each_once(runs, |run| counted(run.seeds, "seed"))),
    ]
    .into_iter()
    .filter_map(|(what, said)| Some(format!(" {what}: {}.", said?)))
    .collect()
}

#[cfg(test)]
mod tests {
    use super::super::metadrive_policy;
    use super::super::tests::{CAT, add, run};
    use super::*;
    use crate::evidence::recorded_run::Setting;

    #[test]
    fn a_caption_names_simulator_pool_ego_reading_and_proposer() {
        let models =
            [("actor", "exchange (agent, big)"), ("repair", "exchange (agent, big)"), ("realism_critic", "scripted")];
        let mut recorded = run("made", &models);
        add(&mut recorded, &CAT);
        recorded.declared.setting = Setting {
            simulator: "ours".into(),
            pool: "generated".into(),
            reading: "every contact".into(),
            ..Setting::default()
        };
        let expected = " Simulator: ours. Pool: generated, 2 for evolution, 4 held out. Ego: IDM. Attack: every contact. \
                        Proposals: exchange (agent, big); critics: a rule-based stand-in, no language model. Searches a row: 1 seed.";
        assert_eq!(rests_on(&metadrive_policy(&[recorded.clone()]).unwrap()), expected);
        recorded.declared.setting.left_out = "crashes".into();
        let table = metadrive_policy(&[recorded.clone()]).unwrap();
        assert!(rests_on(&table).contains("Pool: generated, 2 for evolution, 4 held out, left out crashes."));
        assert!(table.notes.iter().any(|note| note.ends_with(" Left out: crashes.")), "{:?}", table.notes);
        // What nobody read is not made up.
        recorded.declared.setting = Setting::default();
        let bare = rests_on(&metadrive_policy(&[recorded]).unwrap());
        assert!(!bare.contains("Simulator") && bare.contains("Pool: 6 scenes, 2 for evolution, 4 held out."), "{bare}");
    }
}
