//! The evaluator of pairs against cases that are known by hand, and its routing at its edges.

use super::configuration::ConfigurationError;
use super::tests::{columns, configuration, label, xi};
use super::verdict::is_weak;
use super::*;
use crate::kernel::{Seed, Threads};
use crate::objects::*;

fn paired() -> WorldConfiguration {
    let pairs = Some(PairOptions { aggregate: 0.9, abstain_above: 1.0 });
    WorldConfiguration { pairs, ridge_lambda: 1e-6, group_labels_min: 1, ..configuration(WorldModel::Ridge) }
}

fn objectives(attack: f64, realism: f64) -> Objectives {
    Objectives { attack, realism }
}

/// A row of scenes with these columns; its parent has attack .3 and realism .5 in each.
fn row(scenes: &[[f64; 2]]) -> WorldRow {
    let parent = objectives(0.3, 0.5);
    let pair = |features: &[f64; 2]| PairRow { features: features.to_vec(), parent };
    let mean = |k: usize| scenes.iter().map(|of| of[k]).sum::<f64>() / scenes.len() as f64;
    WorldRow { pairs: scenes.iter().map(pair).collect(), ..xi(&[mean(0), mean(1)], 1.0) }
}

/// A candidate of epoch 0 whose attack in a scene is a line of the first column, and its realism of the second.
fn labelled(scenes: &[[f64; 2]]) -> WorldLabel {
    let truth = |of: &[f64; 2]| objectives(0.2 + 0.5 * of[0], 0.9 - 0.4 * of[1]);
    let pairs: Vec<Objectives> = scenes.iter().map(truth).collect();
    let n = pairs.len() as f64;
    let labels = objectives(
        pairs.iter().map(|of| of.attack).sum::<f64>() / n,
        pairs.iter().map(|of| of.realism).sum::<f64>() / n,
    );
    WorldLabel { row: row(scenes), pairs: pairs.into_iter().map(Some).collect(), labels, ..label(0, &[0.0, 0.0], 0.0) }
}

fn grid() -> Vec<WorldLabel> {
    let at = |k: u32| [f64::from(k % 5) / 4.0, f64::from(k / 5) / 4.0];
    (0..10).map(|k| labelled(&[at(k), at(k + 7), at(24 - k)])).collect()
}

fn snapshot_of(labels: Vec<WorldLabel>, configuration: &WorldConfiguration) -> WorldSnapshot {
    let mut set = CalibrationSet::default();
    set.append(labels, &columns(2)).unwrap();
    settle(&columns(2), configuration, &set.by_lineage(), 1, &Threads::new(1).unwrap()).unwrap()
}

#[test]
fn pairs_of_a_line_are_predicted_to_the_scene_and_their_mean_is_the_candidates() {
    let snapshot = snapshot_of(grid(), &paired());
    let router = Router::new(&snapshot).unwrap();
    let found = router.predict(&row(&[[0.1, 0.9], [0.7, 0.2]])).unwrap();
    let expected = objectives(0.2 + 0.5 * 0.4, 0.9 - 0.4 * 0.55);
    assert!((found.objectives.attack - expected.attack).abs() < 1e-4, "{found:?}");
    assert!((found.objectives.realism - expected.realism).abs() < 1e-4, "{found:?}");
    // A prediction of means would not see that a rate ends at 1: the line says 1.2 and .2 here.
    let clipped = router.predict(&row(&[[2.0, 0.0], [0.0, 0.0]])).unwrap();
    assert!((clipped.objectives.attack - 0.6).abs() < 1e-4, "{clipped:?}");
}

#[test]
fn a_pair_like_none_that_was_labelled_is_uncertain_and_one_such_scene_makes_the_candidate_so() {
    let mut labels = grid();
    // Without a residual nothing is uncertain.
    for (k, label) in labels.iter_mut().enumerate() {
        label.pairs[0] = Some(objectives(if k % 2 == 0 { 0.9 } else { 0.1 }, 0.5));
    }
    let configuration = paired();
    let snapshot = snapshot_of(labels.clone(), &configuration);
    let of = |scenes: &[[f64; 2]]| Router::new(&snapshot).unwrap().predict(&row(scenes)).unwrap().uncertainty();
    let (near, far) = (of(&[[0.5, 0.5]; 4]), of(&[[6.0, 0.5]; 4]));
    assert!(far > 3.0 * near && near > 0.0, "{near} {far}");
    assert_eq!(of(&[[0.5, 0.5], [0.5, 0.5], [6.0, 0.5], [0.5, 0.5]]), far, "the upper quantile, not the mean");
    let mild =
        WorldConfiguration { pairs: Some(PairOptions { aggregate: 0.5, abstain_above: 1.0 }), ..configuration.clone() };
    let snapshot = snapshot_of(labels.clone(), &mild);
    let middle = Router::new(&snapshot).unwrap().predict(&row(&[[0.5, 0.5], [0.5, 0.5], [6.0, 0.5]])).unwrap();
    assert!(middle.uncertainty() < 1.01 * near, "{middle:?}");
    let quiet =
        WorldConfiguration { pairs: Some(PairOptions { aggregate: 0.9, abstain_above: 2.0 * near }), ..configuration };
    let snapshot = snapshot_of(labels, &quiet);
    let router = Router::new(&snapshot).unwrap();
    let abstains = router.predict(&row(&[[6.0, 0.5]; 4])).unwrap();
    assert_eq!(abstains.difference, objectives(0.0, 0.0), "it expects what the parent does");
    assert!(abstains.of_pairs.unwrap().abstains && abstains.uncertainty() == far, "{abstains:?}");
    let speaks = router.predict(&row(&[[0.5, 0.5]; 4])).unwrap();
    assert!(speaks.difference != objectives(0.0, 0.0) && !speaks.of_pairs.unwrap().abstains, "{speaks:?}");
}

#[test]
fn calibration_mixes_with_the_groups_labels_and_what_was_missed_is_counted_by_family() {
    let mixing = WorldConfiguration { beta_attack: 0.25, beta_realism: 1.0, ..paired() };
    let labels = grid();
    let mean = labels.iter().map(|of| of.labels.attack).sum::<f64>() / labels.len() as f64;
    let missed = labels.iter().map(|of| of.labels.attack - of.predicted.attack).sum::<f64>() / labels.len() as f64;
    let snapshot = snapshot_of(labels, &mixing);
    let found = Router::new(&snapshot).unwrap().predict(&row(&[[0.4, 0.5]])).unwrap();
    assert!((found.objectives.attack - (0.25 * 0.4 + 0.75 * mean)).abs() < 1e-4, "{found:?}");
    let fit = snapshot.fit.unwrap().pairs.unwrap();
    assert_eq!((fit.pairs, fit.missed["family cat"].labels), (30, 10));
    assert!((fit.missed["family cat"].mean.attack - missed).abs() < 1e-12, "{fit:?}");
}

#[test]
fn a_scene_that_failed_is_no_label_and_rows_of_another_width_are_refused() {
    let mut labels = grid();
    labels[0].pairs[1] = None;
    let fit = snapshot_of(labels.clone(), &paired()).fit.unwrap();
    assert_eq!(fit.pairs.unwrap().pairs, 29);
    labels[3].row.pairs[0].features.push(1.0);
    let refused = CalibrationSet::default().append(labels.clone(), &columns(2)).unwrap_err().to_string();
    assert!(refused.contains("3 pairs of up to 3 features"), "{refused}");
    labels[3] = labelled(&[[0.0, 0.0]]);
    labels[3].pairs.push(None);
    let refused = CalibrationSet::default().append(labels, &columns(2)).unwrap_err().to_string();
    assert!(refused.contains("1 pairs") && refused.contains("2 labels"), "{refused}");
}

fn prediction(rank_score: f64, attack: f64, uncertainty: f64, sparse: bool) -> Prediction {
    Prediction {
        objectives: objectives(0.5, 0.5),
        difference: objectives(attack, 0.0),
        half_width: None,
        rank_score,
        of_pairs: Some(OfPairs { uncertainty, sparse, abstains: false }),
    }
}

fn allotted(
    predictions: &[Prediction],
    budget: u32,
    audit_share: f64,
    seed: u64,
) -> Vec<(RouteDecision, Option<f64>, String)> {
    let routing = &configuration(WorldModel::Ridge).routing;
    let options = RoutingOptions {
        rollout_budget: budget,
        audit_share,
        lambda_a: 0.1,
        lambda_r: 0.1,
        lambda_u: 0.2,
        ..routing.clone()
    };
    let all = by_value::allot(predictions, &options, &mut audit_stream(Seed(seed), &LineageId::new("cat-idm"), 1));
    all.into_iter().map(|(decision, weight, why)| (decision, weight, why.into())).collect()
}

#[test]
fn only_what_is_low_with_certainty_is_turned_away_for_its_value() {
    use RouteDecision::{Audit, Reject, Select};
    let of = [
        prediction(-0.3, -0.3, 0.05, false), // low and certain
        prediction(0.1, 0.1, 0.05, false),
        prediction(-0.4, -0.4, 0.5, false), // low and uncertain
        prediction(0.3, 0.3, 0.05, true),   // in a sparse region
        prediction(0.2, 0.2, 0.05, false),
    ];
    let all = allotted(&of, 5, 0.0, 1);
    let decisions: Vec<RouteDecision> = all.iter().map(|(decision, ..)| *decision).collect();
    assert_eq!(decisions, [Reject, Select, Audit, Audit, Select], "the budget has room, and what is low stays out");
    assert!(all[0].2.starts_with("reject: low and certain, rank 4 of 5"), "{all:?}");
    let three = allotted(&of, 3, 0.0, 1);
    let decisions: Vec<RouteDecision> = three.iter().map(|(decision, ..)| *decision).collect();
    assert_eq!(decisions, [Reject, Select, Reject, Audit, Select], "the selected first, then the uncertain by rank");
    assert!(three[2].2.starts_with("reject: behind the budget, uncertain"), "{three:?}");
    assert!(is_weak(
        &of[0],
        &RoutingOptions { lambda_a: 0.1, lambda_u: 0.2, ..configuration(WorldModel::Ridge).routing }
    ));
}

#[test]
fn a_monitor_draws_among_all_who_are_left_and_stands_for_them() {
    let of: Vec<Prediction> = (0..10).map(|k| prediction(-f64::from(k), -0.3, 0.05, false)).collect();
    let mut met = std::collections::BTreeSet::new();
    for seed in 0..60 {
        let drawn: Vec<usize> =
            (0..10).filter(|&k| allotted(&of, 4, 0.25, seed)[k].0 == RouteDecision::Audit).collect();
        assert_eq!(drawn.len(), 1, "all are low: only the monitor's place is taken");
        assert_eq!(allotted(&of, 4, 0.25, seed)[drawn[0]].1, Some(10.0));
        met.extend(drawn);
    }
    assert_eq!(met.len(), 10, "nobody is out of its reach");
}

#[test]
fn what_pairs_rest_on_cannot_be_taken_away_and_the_surface_has_their_keys() {
    let refused = |change: &dyn Fn(&mut WorldConfiguration)| {
        let mut configuration = paired();
        change(&mut configuration);
        validate(&configuration, &columns(2)).unwrap_err()
    };
    let boosted = refused(&|of| of.model = WorldModel::Boosted);
    assert!(matches!(boosted, ConfigurationError::BesidePairs("model", _)), "{boosted}");
    assert!(boosted.to_string().contains("[world.pairs]") && boosted.to_string().contains("remove one of the two"));
    let pilot = refused(&|of| of.routing.pilot = Some(PilotOptions { scenes: 3, prior_scenes: 3.0 }));
    assert!(matches!(pilot, ConfigurationError::BesidePairs("routing.pilot", _)), "{pilot}");
    let pairs = |aggregate, abstain_above| Some(PairOptions { aggregate, abstain_above });
    for (options, name) in [(pairs(0.4, 0.5), "pairs.aggregate"), (pairs(0.9, 0.0), "pairs.abstain_above")] {
        let range = refused(&|of| of.pairs = options);
        assert!(range.to_string().contains(name), "{range}");
    }
    let families = [FamilyName::new("cat")];
    let schema = pair_schema(&families, &["idm".into()]);
    let surface = update_surface([0.2, 0.5], &schema);
    let names: Vec<&str> = surface.iter().map(|key| key.name).collect();
    assert!(names.contains(&"abstain_above") && names.contains(&"aggregate") && !names.contains(&"model"), "{names:?}");
    let patch = WorldPatch {
        changes: [("abstain_above".to_string(), serde_json::json!(0.3))].into(),
        hypothesis: "h".into(),
        expected_gain: "g".into(),
        rationale: "r".into(),
        audit_policy: "p".into(),
        risk_notes: vec![],
    };
    let changed = patch.applied(&paired(), &schema, &surface).unwrap();
    assert_eq!(changed.pairs, pairs(0.9, 0.3));
    let without = update_surface([0.2, 0.5], &schema_of(&configuration(WorldModel::Ridge), &families, &[]));
    assert!(without.iter().all(|key| key.name != "abstain_above"), "no key of an evaluator that does not read it");
}
