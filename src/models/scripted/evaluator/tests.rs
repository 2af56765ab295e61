//! The stand-in against real questions of the world agent.

use std::collections::BTreeMap;

use serde_json::json;

use super::super::attackers::tests::{Live, model};
use crate::agents::evolve::{Evolution, Turn, evolve};
use crate::llm::ModelSpec;
use crate::objects::{
    FamilyName, GroupAudit, Judgement, Objection, RoutedShare, WorldAudit, WorldConfiguration, WorldEvolved,
    WorldMeasures, WorldModel, WorldPatch, update_surface,
    world::{FeatureColumn, FeatureGroup, FeatureSchema},
};

fn founding() -> WorldConfiguration {
    let text = include_str!("../../../../experiments/protocols/metadrive.toml");
    text.parse::<toml::Table>().unwrap()["world"].clone().try_into().unwrap()
}

/// A column of each group that a run in our own simulator has.
fn columns() -> FeatureSchema {
    let column = |group: FeatureGroup| FeatureColumn { name: format!("{group:?}").to_lowercase(), group };
    let groups = FeatureGroup::ALL.into_iter().filter(|group| *group != FeatureGroup::Simulated);
    FeatureSchema { families: vec![FamilyName::new("cat")], columns: groups.map(column).collect() }
}

/// An audit in which all is well but what `measures` says.
fn audit(measures: WorldMeasures) -> WorldAudit {
    let group = |group: &str, columns: usize, residual: f64| GroupAudit {
        group: group.into(),
        columns,
        excluded: 0,
        residual: Some(("a_column".into(), residual)),
    };
    WorldAudit {
        before_epoch: 3,
        labels: 90,
        held_epochs: vec![1, 2],
        level_pct: 80.0,
        measures,
        families: BTreeMap::from([(FamilyName::new("cat"), measures)]),
        groups: vec![group("edit", 43, 0.1), group("scene", 14, 0.02), group("family", 1, 0.0)],
        selected: RoutedShare { candidates: 40, accepted_pct: Some(20.0) },
        audited: RoutedShare { candidates: 20, accepted_pct: Some(10.0) },
    }
}

fn well() -> WorldMeasures {
    WorldMeasures {
        held: 60,
        rank_correlation: Some(0.5),
        attack_error: Some(0.8),
        realism_error: Some(0.7),
        coverage_pct: Some(80.0),
        false_reject_pct: Some(2.0),
    }
}

fn asked(active: &WorldConfiguration, measures: WorldMeasures, earlier: &[WorldEvolved], of: &ModelSpec) -> Evolution {
    let (schema, surface, audit) = (columns(), update_surface([0.2, 0.5], &columns()), audit(measures));
    let epoch = 2 + earlier.len() as u32;
    let turn = Turn { epoch, active, schema: &schema, surface: &surface, audit: &audit, earlier, rounds: 2, model: of };
    let usable = |patch: &WorldPatch| patch.applied(active, &schema, &surface).map_err(|error| error.to_string());
    evolve(&turn, &Live, &usable).unwrap()
}

/// Every patch that it proposes, one turn after the other, each rejected.
fn proposed(active: &WorldConfiguration, measures: WorldMeasures, turns: usize) -> Vec<WorldPatch> {
    let (exact, mut earlier) = (model(0.0, 0.0, 0.0), Vec::new());
    for epoch in 0..turns as u32 {
        let (exchanges, edits) = asked(active, measures, &earlier, &exact);
        assert!(exchanges.iter().all(|exchange| exchange.refusal.is_none()), "{exchanges:?}");
        let (patch, changed) = edits.unwrap();
        let against = Objection { rule: crate::objects::JudgeRule::Gain, says: "no gain".into() };
        let (incumbent, challenger) = (measures, measures);
        let judgement = Judgement { incumbent, challenger, gains: vec![], objections: vec![against] };
        let digest = active.digest().unwrap();
        earlier.push(WorldEvolved {
            epoch,
            audit: audit(measures),
            exchanges,
            incumbent: digest,
            patch: Some(patch),
            challenger: Some(changed.digest().unwrap()),
            judgement: Some(judgement),
            active: active.clone(),
            active_digest: digest,
            snapshot: digest,
        });
    }
    earlier.into_iter().filter_map(|turn| turn.patch).collect()
}

#[test]
fn what_is_proposed_follows_from_the_audit() {
    let names = |measures: WorldMeasures, active: &WorldConfiguration| -> Vec<String> {
        let patches = proposed(active, measures, 2);
        patches.iter().flat_map(|patch| patch.changes.keys().cloned()).collect()
    };
    let narrow = WorldMeasures { coverage_pct: Some(60.0), ..well() };
    assert!(names(narrow, &founding()).contains(&"interval_level".to_string()));
    let off = WorldMeasures { realism_error: Some(1.8), ..well() };
    assert!(names(off, &founding()).contains(&"beta_realism".to_string()));
    let unranked = WorldMeasures { rank_correlation: Some(0.02), ..well() };
    assert!(names(unranked, &founding()).contains(&"explore".to_string()));
    let line = WorldConfiguration { model: WorldModel::Ridge, explore: 0.0, ..founding() };
    let edits = names(unranked, &line);
    assert!(edits.iter().any(|name| name == "ridge_lambda" || name == "model"), "{edits:?}");
    let quiet = names(well(), &founding());
    assert!(!quiet.contains(&"interval_level".into()) && !quiet.contains(&"explore".into()), "{quiet:?}");
}

#[test]
fn nothing_is_proposed_twice() {
    let unranked = WorldMeasures { rank_correlation: Some(0.1), realism_error: Some(0.95), ..well() };
    let changes: Vec<String> =
        proposed(&founding(), unranked, 9).iter().map(|patch| json!(patch.changes).to_string()).collect();
    let different: std::collections::BTreeSet<&String> = changes.iter().collect();
    assert_eq!(different.len(), changes.len(), "{changes:?}");
    assert!(changes.iter().any(|text| text.contains("excluded_groups")), "{changes:?}");
}

#[test]
fn errors_at_the_declared_rates_are_refused_with_their_reason_and_asked_for_again() {
    let (always, never) = (model(0.0, 1.0, 0.0), model(0.0, 0.0, 0.0));
    let (exchanges, edits) = asked(&founding(), well(), &[], &always);
    assert!(edits.is_none() && exchanges.len() == 2);
    let refusal = exchanges[0].refusal.clone().unwrap();
    assert!(refusal.contains("audit_share: found 1.0, expected a number from 0.2 to 0.5"), "{refusal}");
    let mut foreign = never.clone();
    foreign.sampling.insert("foreign_mechanism_rate".into(), 1.0);
    let (exchanges, _) = asked(&founding(), well(), &[], &foreign);
    assert!(exchanges[0].refusal.as_deref().unwrap().contains("`rollout_budget` is protected"), "{exchanges:?}");
    assert_eq!(asked(&founding(), well(), &[], &never), asked(&founding(), well(), &[], &never));
}
