//! The evaluator against hand-solved cases, against the normal equations, and at its edges.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use super::router::too_few;
use super::*;
use crate::kernel::{Digest, Seed, Threads, Vec2};
use crate::objects::fixture::scene_score;
use crate::objects::*;
use crate::scene::{LaneGraph, SceneFeatures, fixture};
use crate::statistics::table::Table;

pub(super) fn configuration(model: WorldModel) -> WorldConfiguration {
    WorldConfiguration {
        excluded_columns: Vec::new(),
        model,
        ridge_lambda: 1.0,
        trees: 40,
        learning_rate: 0.2,
        beta_attack: 1.0,
        beta_realism: 1.0,
        calibration_group: CalibrationGroup::Family,
        group_labels_min: 3,
        interval_level: 0.8,
        realism_weight: 1.0,
        explore: 0.0,
        routing: RoutingOptions {
            rollout_budget: 6,
            choice: RoutingChoice::Ranked,
            lambda_a: 1.0,
            lambda_r: 1.0,
            lambda_u: 1.0,
            audit_share: 0.0,
            min_labels: 10,
            pilot: None,
        },
        pairs: None,
    }
}

/// A schema of `n` plain columns.
pub(super) fn columns(n: usize) -> FeatureSchema {
    let column = |k| FeatureColumn { name: format!("x{k}"), group: FeatureGroup::Scene };
    FeatureSchema { families: vec![FamilyName::new("cat")], columns: (0..n).map(column).collect() }
}

pub(super) fn xi(features: &[f64], open_share: f64) -> WorldRow {
    WorldRow {
        features: features.to_vec(),
        open_share,
        parent: Objectives { attack: 0.3, realism: 0.5 },
        family: FamilyName::new("cat"),
        mechanism_class: "none".into(),
        pairs: Vec::new(),
    }
}

/// A candidate of epoch `epoch` whose attack differs from its parent's by this much, and was predicted not to.
pub(super) fn label(epoch: u32, features: &[f64], attack: f64) -> WorldLabel {
    let row = xi(features, 1.0);
    WorldLabel {
        attempt: AttemptId::new("cat-idm/e1s0"),
        solution: SolutionId::new("cat-idm/e1s0"),
        epoch,
        labels: Objectives { attack: row.parent.attack + attack, realism: row.parent.realism },
        diagnostics: BTreeMap::new(),
        decision: RouteDecision::Audit,
        predicted: row.parent,
        accepted: false,
        pairs: Vec::new(),
        row,
    }
}

fn set_of(labels: Vec<WorldLabel>, width: usize) -> CalibrationSet {
    let mut set = CalibrationSet::default();
    set.append(labels, &columns(width)).unwrap();
    set
}

/// The difference of attack is a fifth of the first column's sign.
fn stepped(n: u32) -> CalibrationSet {
    let at = |k: u32| f64::from(k) / f64::from(n - 1);
    set_of((0..n).map(|k| label(0, &[at(k), 7.0], if at(k) > 0.5 { 0.2 } else { -0.2 })).collect(), 2)
}

fn settled(set: &CalibrationSet, configuration: &WorldConfiguration) -> WorldSnapshot {
    let width = set.labels().first().map_or(2, |label| label.row.features.len());
    settle(&columns(width), configuration, &set.by_lineage(), 1, &one_thread()).unwrap()
}

fn prediction(rank_score: f64) -> Prediction {
    let nothing = Objectives { attack: 0.0, realism: 0.0 };
    Prediction { objectives: nothing, difference: nothing, half_width: Some(nothing), rank_score, of_pairs: None }
}

fn options(budget: u32, audit_share: f64) -> RoutingOptions {
    RoutingOptions { rollout_budget: budget, audit_share, ..configuration(WorldModel::Ridge).routing }
}

fn routed(
    predictions: &[Prediction],
    options: &RoutingOptions,
    seed: u64,
) -> Vec<(RouteDecision, Option<f64>, String)> {
    let configuration = WorldConfiguration { routing: options.clone(), ..configuration(WorldModel::Ridge) };
    let stream = &mut audit_stream(Seed(seed), &LineageId::new("cat-idm"), 1);
    let all = allot(predictions, too_few(100, &configuration), options, stream);
    all.into_iter().map(|(decision, weight, why)| (decision, weight, why.into())).collect()
}

fn one_thread() -> Threads {
    Threads::new(1).unwrap()
}

#[test]
fn lines_agree_with_the_weighted_normal_equations() {
    let mut stream = Seed(3).stream(&["ridge"]);
    let rows: Vec<Vec<f64>> = (0..60).map(|_| (0..5).map(|_| stream.normal(0.0, 1.0)).collect()).collect();
    let weights: Vec<f64> = (0..60).map(|_| stream.uniform(0.1, 1.0)).collect();
    let target: Vec<f64> = rows.iter().map(|r| 0.3 * r[0] - 0.2 * r[3] + stream.normal(0.1, 0.05)).collect();
    let table = Table { rows: rows.clone(), weights: weights.clone(), columns: 5 };
    let line = ridge::fit(&table, &[&target], 2.0).unwrap().remove(0);
    let x = DMatrix::from_fn(60, 5, |i, j| rows[i][j]);
    let w = DMatrix::from_diagonal(&DVector::from_vec(weights));
    let y = DVector::from_fn(60, |i, _| target[i] - line.intercept);
    let plain =
        (x.transpose() * &w * &x + DMatrix::<f64>::identity(5, 5) * 2.0).try_inverse().unwrap() * x.transpose() * w * y;
    for (own, plain) in line.weights.iter().zip(plain.iter()) {
        assert!((own - plain).abs() < 1e-10, "{own} {plain}");
    }
}

#[test]
fn trees_find_a_step_that_a_line_cannot() {
    let set = stepped(60);
    let error = |model: WorldModel| {
        let snapshot = settled(&set, &configuration(model));
        let router = Router::new(&snapshot).unwrap();
        let off = |label: &WorldLabel| (router.predict(&label.row).unwrap().difference.attack - 0.2).abs();
        set.labels().iter().filter(|label| label.row.features[0] > 0.5).map(off).fold(0.0, f64::max)
    };
    let (trees, line) = (error(WorldModel::Boosted), error(WorldModel::Ridge));
    assert!(trees < 0.03 && line > 0.1, "{trees} {line}");
}

#[test]
fn a_candidate_that_is_open_nowhere_has_no_difference_and_no_uncertainty() {
    let snapshot = settled(&stepped(60), &configuration(WorldModel::Boosted));
    let router = Router::new(&snapshot).unwrap();
    let computed = router.predict(&xi(&[0.9, 7.0], 0.0)).unwrap();
    assert_eq!((computed.difference.attack, computed.uncertainty()), (0.0, 0.0));
    let (half, whole) =
        (router.predict(&xi(&[0.9, 7.0], 0.5)).unwrap(), router.predict(&xi(&[0.9, 7.0], 1.0)).unwrap());
    assert!((2.0 * half.difference.attack - whole.difference.attack).abs() < 1e-12);
    assert!(half.uncertainty() < whole.uncertainty());
}

#[test]
fn calibration_mixes_the_prediction_with_its_groups_mean_and_a_sparse_one_with_the_global() {
    let mut labels = stepped(60).labels().to_vec();
    let family = |mut label: WorldLabel| {
        label.row.family = FamilyName::new("at");
        label
    };
    labels.extend((0..2).map(|_| family(label(0, &[0.2, 7.0], 0.5))));
    let set = set_of(labels, 2);
    let mean = |name: &str, beta: f64, group_labels_min: u32| {
        let mixing = WorldConfiguration { beta_attack: beta, group_labels_min, ..configuration(WorldModel::Ridge) };
        let snapshot = settled(&set, &mixing);
        let row = WorldRow { family: FamilyName::new(name), ..xi(&[0.9, 7.0], 1.0) };
        let computed = Router::new(&snapshot).unwrap().predict(&row).unwrap().difference.attack;
        (computed, snapshot.fit.unwrap())
    };
    let (raw, fit) = mean("at", 1.0, 3);
    assert!((mean("at", 0.75, 3).0 - (0.75 * raw + 0.25 * fit.global.mean.attack)).abs() < 1e-12);
    assert!((mean("at", 0.75, 2).0 - (0.75 * raw + 0.25 * 0.5)).abs() < 1e-12);
}

#[test]
fn intervals_hold_the_declared_share_of_labels_that_were_not_known() {
    let mut stream = Seed(5).stream(&["conformal"]);
    let of = |stream: &mut crate::kernel::Stream| label(0, &[stream.unit()], stream.normal(0.0, 0.05));
    let set = set_of((0..400).map(|_| of(&mut stream)).collect(), 1);
    let half = settled(&set, &configuration(WorldModel::Ridge)).fit.unwrap().half_width.unwrap().attack;
    let held = (0..2000).filter(|_| of(&mut stream).difference().attack.abs() <= half).count();
    assert!((1500..1700).contains(&held), "{held} of 2000");
    let few = set_of((0..19).map(|_| of(&mut stream)).collect(), 1);
    assert_eq!(settled(&few, &configuration(WorldModel::Ridge)).fit.unwrap().half_width, None);
}

#[test]
fn the_budget_goes_to_the_first_by_rank() {
    let predictions: Vec<Prediction> = [0.1, 0.4, 0.2, 0.3].map(prediction).to_vec();
    let decisions: Vec<RouteDecision> =
        routed(&predictions, &options(2, 0.0), 1).into_iter().map(|(d, ..)| d).collect();
    use RouteDecision::{Reject, Select};
    assert_eq!(decisions, [Reject, Select, Reject, Select]);
    let reasons: Vec<String> = routed(&predictions, &options(2, 0.0), 1).into_iter().map(|(.., why)| why).collect();
    let rejected = |rank: u32| format!("reject: behind the budget, rank {rank} of 4");
    assert_eq!(reasons, [rejected(4), "select: rank 1 of 4".into(), rejected(3), "select: rank 2 of 4".into()]);
    let all = routed(&predictions, &options(9, 0.0), 1);
    assert!(all.iter().all(|(decision, ..)| *decision == Select), "{all:?}");
}

#[test]
fn the_weak_and_certain_leave_even_a_budget_unused_and_the_uncertain_do_not() {
    let weak = |half: f64| Prediction {
        difference: Objectives { attack: -0.3, realism: 0.0 },
        half_width: Some(Objectives { attack: half, realism: half }),
        ..prediction(0.5)
    };
    let mut thresholds = options(2, 0.0);
    (thresholds.lambda_a, thresholds.lambda_u) = (0.2, 0.1);
    let computed = routed(&[weak(0.05), weak(0.5)], &thresholds, 1);
    assert_eq!((computed[0].0, computed[1].0), (RouteDecision::Reject, RouteDecision::Select));
    assert!(computed[0].2.contains("weak and certain"), "{}", computed[0].2);
    // Either objective alone may be lost too much of; as much as declared is not too much.
    let loses =
        |attack: f64, realism: f64| Prediction { difference: Objectives { attack, realism }, ..prediction(0.5) };
    (thresholds.lambda_a, thresholds.lambda_r) = (0.2, 0.1);
    let computed = routed(&[loses(0.5, -0.11), loses(-0.2, -0.1), loses(-0.21, 0.5)], &thresholds, 1);
    let decisions: Vec<RouteDecision> = computed.into_iter().map(|(decision, ..)| decision).collect();
    assert_eq!(decisions, [RouteDecision::Reject, RouteDecision::Select, RouteDecision::Reject]);
}

#[test]
fn audits_estimate_what_was_left_out_without_bias() {
    // Ten candidates, five places, two of them for audits: three are selected, seven are left out.
    let predictions: Vec<Prediction> = (0..10).map(|k| prediction(f64::from(k))).collect();
    let (mut estimate, mut drawn) = (0.0, BTreeSet::new());
    let seeds = 2000;
    for seed in 0..seeds {
        let computed = routed(&predictions, &options(5, 0.4), seed);
        let audited: Vec<(usize, f64)> =
            computed.iter().enumerate().filter_map(|(place, (_, weight, _))| Some((place, (*weight)?))).collect();
        assert_eq!((audited.len(), audited.iter().map(|(_, weight)| weight).sum::<f64>()), (2, 7.0));
        estimate += audited.iter().filter(|(place, _)| [0, 5].contains(place)).map(|(_, weight)| weight).sum::<f64>();
        drawn.extend(audited.into_iter().map(|(place, _)| place));
    }
    // Two of those left out are of the kind that is counted.
    assert!((estimate / seeds as f64 - 2.0).abs() < 0.1, "{}", estimate / seeds as f64);
    assert_eq!(drawn, (0..7).collect());
}

#[test]
fn a_share_of_audits_that_is_no_whole_number_is_met_on_the_average() {
    let predictions: Vec<Prediction> = (0..10).map(|k| prediction(f64::from(k))).collect();
    let audits = |seed: u64| {
        let computed = routed(&predictions, &options(3, 0.4), seed);
        computed.iter().filter(|(decision, ..)| *decision == RouteDecision::Audit).count()
    };
    // 1.2 of three places: one, and in a fifth of the epochs two.
    let counts: Vec<usize> = (0..500).map(audits).collect();
    let twice = counts.iter().filter(|count| **count == 2).count();
    assert!(counts.iter().all(|count| (1..=2).contains(count)) && (70..130).contains(&twice), "{twice} of 500");
}

#[test]
fn without_evidence_and_by_choice_the_budget_is_drawn() {
    let predictions: Vec<Prediction> = (0..10).map(|k| prediction(f64::from(k))).collect();
    let random = RoutingOptions { choice: RoutingChoice::Random, ..options(5, 0.0) };
    let scarce = RoutingOptions { min_labels: 101, ..options(5, 0.0) };
    for unranked in [random, scarce] {
        let mut counts = [0; 10];
        for seed in 0..400 {
            let computed = routed(&predictions, &unranked, seed);
            let drawn = computed.iter().enumerate().filter(|(_, (decision, ..))| *decision == RouteDecision::Audit);
            drawn.for_each(|(place, (_, weight, _))| {
                counts[place] += 1;
                assert_eq!(*weight, Some(2.0));
            });
        }
        assert!(counts.iter().sum::<i32>() == 2000 && counts.iter().all(|n| (140..260).contains(n)), "{counts:?}");
    }
}

#[test]
fn a_pilot_takes_the_first_open_scenes_of_an_order_that_all_share() {
    let options = PilotOptions { scenes: 2, prior_scenes: 3.0 };
    let order = pilot_order(Seed(1), &LineageId::new("cat-idm"), 4, 6);
    assert_eq!(order.iter().copied().collect::<BTreeSet<usize>>(), (0..6).collect());
    assert_ne!(order, pilot_order(Seed(1), &LineageId::new("cat-idm"), 5, 6), "another epoch begins elsewhere");
    assert_eq!(pilot_places(&order, &[true; 6], &options), order[..2]);
    let mut open = [false; 6];
    (open[order[1]], open[order[4]], open[order[5]]) = (true, true, true);
    assert_eq!(pilot_places(&order, &open, &options), [order[1], order[4]], "elsewhere it is its parent's label");
    assert!(pilot_places(&order, &[false; 6], &options).is_empty());
}

#[test]
fn what_a_pilot_shows_is_mixed_with_the_prediction_by_the_scenes_seen() {
    let mut snapshot = settled(&stepped(60), &configuration(WorldModel::Boosted));
    snapshot.configuration.routing.pilot = Some(PilotOptions { scenes: 3, prior_scenes: 3.0 });
    (snapshot.configuration.realism_weight, snapshot.configuration.explore) = (0.5, 0.2);
    let of = |attack: f64, realism: f64| Objectives { attack, realism };
    let expected = Prediction {
        objectives: of(0.5, 0.9),
        difference: of(-0.1, 0.04),
        half_width: Some(of(0.2, 0.1)),
        rank_score: -0.08 + 0.2 * 0.25,
        of_pairs: None,
    };
    let router = Router::new(&snapshot).unwrap();
    let after = |labelled: u32, open_share: f64| {
        let pilot = Pilot { scenes: Vec::new(), difference: of(0.4, -0.2), labelled };
        router.after_pilot(expected, open_share, &pilot)
    };
    // Half of the window is open; a gain of .4 - .5 * .2 in an open scene is .15 of the window.
    let three = (-0.08 + 0.15) / 2.0 + 0.2 * 0.25 * 0.5_f64.sqrt();
    assert!((after(3, 0.5).rank_score - three).abs() < 1e-12, "{}", after(3, 0.5).rank_score);
    assert!(after(9, 0.5).rank_score > after(3, 0.5).rank_score);
    assert_eq!(after(3, 0.5).difference, expected.difference, "what was predicted stays on record");
    for nothing in [after(0, 0.5), after(3, 0.0)] {
        assert_eq!(nothing, expected);
    }
}

#[test]
fn behind_a_pilot_candidates_are_ranked_however_few_were_labelled_before() {
    let predictions: Vec<Prediction> = (0..10).map(|k| prediction(f64::from(k))).collect();
    let pilot = Some(PilotOptions { scenes: 3, prior_scenes: 3.0 });
    let scarce = RoutingOptions { min_labels: 101, pilot, ..options(5, 0.0) };
    let computed = routed(&predictions, &scarce, 1);
    let chosen = |(decision, ..): &(RouteDecision, Option<f64>, String)| *decision == RouteDecision::Select;
    assert_eq!(computed.iter().map(chosen).collect::<Vec<bool>>(), (0..10).map(|k| k >= 5).collect::<Vec<bool>>());
}

#[test]
fn a_recorded_route_tells_an_audit_of_the_left_out_from_a_draw_without_evidence() {
    let snapshot = settled(&stepped(60), &configuration(WorldModel::Boosted));
    let mut auditing = snapshot.clone();
    auditing.configuration.routing = options(4, 0.5);
    let predictions: Vec<Prediction> = (0..8).map(|k| prediction(f64::from(k))).collect();
    let routes = |snapshot: &WorldSnapshot| {
        let mut stream = audit_stream(Seed(2), &LineageId::new("cat-idm"), 3);
        Router::new(snapshot).unwrap().routes(&predictions, &mut stream)
    };
    let audited = routes(&auditing);
    assert_eq!(audited.iter().filter(|route| drawn_by_monitor(route)).count(), 2);
    assert!(audited.iter().all(|route| route.snapshot == auditing.digest().unwrap()));
    auditing.fit = None;
    assert_eq!(routes(&auditing).iter().filter(|route| drawn_by_monitor(route)).count(), 0);
}

#[test]
fn a_snapshot_read_back_predicts_as_before_and_a_damaged_one_is_refused() {
    for model in [WorldModel::Ridge, WorldModel::Boosted] {
        let snapshot = settled(&stepped(60), &configuration(model));
        let text = serde_json::to_string(&snapshot).unwrap();
        let mut back: WorldSnapshot = serde_json::from_str(&text).unwrap();
        assert_eq!(back.digest(), snapshot.digest());
        match &mut back.fit.as_mut().unwrap().attack {
            Regression::Ridge(line) => drop(line.weights.pop()),
            Regression::Boosted(model) => model.trees[0].nodes.truncate(1),
            Regression::Simulated(line) => panic!("{line:?}"),
        }
        assert!(matches!(Router::new(&back), Err(RouterError::Inconsistent(_))));
    }
}

/// A schema of a plain column and of what our own simulator shows.
fn with_simulator() -> FeatureSchema {
    let column = |(name, group): (&str, FeatureGroup)| FeatureColumn { name: name.into(), group };
    let simulated = ["attack", "realism"].map(|name| (name, FeatureGroup::Simulated));
    let columns = [("x0", FeatureGroup::Scene)].into_iter().chain(simulated).map(column).collect();
    FeatureSchema { families: vec![FamilyName::new("cat")], columns }
}

#[test]
fn what_our_own_simulator_shows_ranks_before_any_label_and_is_scaled_by_labels_alone() {
    let routing = RoutingOptions { min_labels: 30, ..options(2, 0.0) };
    let founding = configuration(WorldModel::Simulator);
    let configuration = WorldConfiguration { ridge_lambda: 10.0, beta_attack: 0.3, routing, ..founding };
    let settle = |labels: &[WorldLabel], epoch| {
        let labels: Vec<&WorldLabel> = labels.iter().collect();
        settle(&with_simulator(), &configuration, &labels, epoch, &one_thread()).unwrap()
    };
    let shown = |snapshot: &WorldSnapshot, attack| {
        Router::new(snapshot).unwrap().predict(&xi(&[7.0, attack, -0.1], 0.5)).unwrap()
    };
    let unlabelled = settle(&[], 0);
    let first = shown(&unlabelled, 0.4);
    assert_eq!((first.difference.attack, first.difference.realism), (0.2, -0.05), "as it is, over the open half");
    let routes = Router::new(&unlabelled).unwrap().routes(
        &[0.0, 0.4, 0.2].map(|attack| shown(&unlabelled, attack)),
        &mut audit_stream(Seed(1), &LineageId::new("cat-idm"), 0),
    );
    let selected: Vec<bool> = routes.iter().map(|route| route.decision == RouteDecision::Select).collect();
    assert_eq!(selected, [false, true, true], "the best two, though nobody is labelled");
    // Forty candidates gain half of what ours shows; they lose a little in the mean, which would be added to all.
    let at = |k: u32| 0.01 * f64::from(k) - 0.2;
    let labels: Vec<WorldLabel> = (0..40).map(|k| label(0, &[7.0, at(k), 0.0], 0.5 * at(k))).collect();
    let settled = settle(&labels, 1);
    let slope = (10.0 + 40.0 * 0.5) / 50.0;
    assert!((shown(&settled, 0.4).difference.attack - 0.2 * slope).abs() < 1e-12, "ten labels for a slope of one");
    assert_eq!(shown(&settled, 0.0).difference.attack, 0.0, "no mean is mixed in");
    assert!(settled.fit.unwrap().half_width.is_some());
}

#[test]
fn a_slope_on_a_column_that_is_not_there_is_refused() {
    let simulator = configuration(WorldModel::Simulator);
    let labels: Vec<WorldLabel> = (0..3).map(|_| label(0, &[7.0, 0.1, 0.0], 0.1)).collect();
    let labels: Vec<&WorldLabel> = labels.iter().collect();
    let mut snapshot = settle(&with_simulator(), &simulator, &labels, 1, &one_thread()).unwrap();
    assert!(Router::new(&snapshot).is_ok());
    match &mut snapshot.fit.as_mut().unwrap().realism {
        Regression::Simulated(line) if line.column == 2 => line.column = 3,
        other => panic!("{other:?}"),
    }
    assert!(matches!(Router::new(&snapshot), Err(RouterError::Inconsistent(_))));
}

#[test]
fn our_own_simulator_ranks_nobody_where_its_columns_are_missing() {
    let mut simulator = configuration(WorldModel::Simulator);
    let refused = settle(&columns(2), &simulator, &[], 0, &one_thread()).unwrap_err().to_string();
    assert!(refused.contains("are not in the schema"), "{refused}");
    simulator.excluded_columns = vec!["realism".into()];
    let refused = settle(&with_simulator(), &simulator, &[], 0, &one_thread()).unwrap_err().to_string();
    assert!(refused.contains("excluded_columns leaves out"), "{refused}");
}

#[test]
fn excluded_columns_are_not_read_and_unknown_ones_refused() {
    let mut excluding = configuration(WorldModel::Boosted);
    excluding.excluded_columns = vec!["x0".into()];
    let snapshot = settled(&stepped(60), &excluding);
    let router = Router::new(&snapshot).unwrap();
    assert_eq!(router.predict(&xi(&[0.1, 7.0], 1.0)), router.predict(&xi(&[0.9, 7.0], 1.0)));
    excluding.excluded_columns = vec!["no_such".into()];
    let refused = settle(&columns(2), &excluding, &[], 0, &one_thread());
    assert_eq!(refused, Err(ConfigurationError::UnknownColumn("no_such".into())));
}

#[test]
fn an_ill_conditioned_fit_says_so_and_keeps_the_means() {
    let options = WorldConfiguration { ridge_lambda: 1e-14, ..configuration(WorldModel::Ridge) };
    let at = |k: i32| f64::from(k) / 20.0;
    let set = set_of((0..=20).map(|k| label(0, &[at(k), at(k)], 0.1)).collect(), 2);
    let fit = settled(&set, &options).fit.unwrap();
    assert!(fit.fallback.is_some());
    let Regression::Ridge(line) = &fit.attack else { panic!("{:?}", fit.attack) };
    assert!(line.weights.is_empty() && (line.intercept - fit.global.mean.attack).abs() < 1e-12);
}

#[test]
fn a_label_that_is_no_label_is_refused_with_its_batch() {
    let mut set = CalibrationSet::default();
    for bad in [label(1, &[0.1], 0.1), label(1, &[0.1, f64::NAN], 0.1), label(1, &[0.1, 0.2], f64::NAN)] {
        assert!(set.append(vec![label(1, &[0.1, 0.2], 0.1), bad], &columns(2)).is_err());
    }
    assert!(set.labels().is_empty());
}

#[test]
fn options_out_of_range_are_named() {
    let bad = WorldConfiguration { learning_rate: 0.0, ..configuration(WorldModel::Ridge) };
    let refused = validate(&bad, &columns(2));
    assert!(matches!(refused, Err(ConfigurationError::Range { option: "learning_rate", .. })), "{refused:?}");
}

pub(super) fn program() -> Program {
    let node = |slot, inputs: &[&str]| OperatorNode {
        slot,
        kind: "any".into(),
        settings: BTreeMap::new(),
        inputs: inputs.iter().map(|name| name.to_string()).collect(),
    };
    Program {
        solution_id: SolutionId::new("cat-idm/parent"),
        lineage_id: LineageId::new("cat-idm"),
        source_family: FamilyName::new("cat"),
        generation: 0,
        parameters: BTreeMap::from([("gain".to_string(), ParameterValue::Number(1.0))]),
        operator_graph: BTreeMap::from([
            ("a".to_string(), node(Slot::Select, &[])),
            ("b".to_string(), node(Slot::Actor, &["a"])),
            ("c".to_string(), node(Slot::Motion, &["b", "c"])),
        ]),
        scenario_conditioned_policy: Vec::new(),
        mechanism_modules: BTreeMap::new(),
        compile_contract: CompileContract { backend: "metadrive".into(), constraints: Vec::new() },
        ancestor_chain: Vec::new(),
    }
}

pub(super) fn scored(scene: &str, attack: f64) -> SceneScore {
    scene_score(scene, attack, 0.75)
}

#[test]
fn features_fill_the_groups_in_the_schemas_order() {
    let (parent, mut child) = (program(), program());
    child.parameters.insert("gain".into(), ParameterValue::Number(3.0));
    let patch = ProgramPatch {
        source_baseline: FamilyName::new("cat"),
        parent_solution_id: parent.solution_id.clone(),
        parent_program_hash: Digest::of_bytes(b"p").to_hex(),
        operations: vec![Operation {
            op: OperationKind::Replace,
            path: "/parameters/gain".into(),
            value: Some(serde_json::json!(3.0)),
        }],
        hypothesis: String::new(),
        memory_refs_used: Vec::new(),
        cluster_refs_used: Vec::new(),
        repair_summary: None,
        free: Default::default(),
    };
    let schema = schema(&[FamilyName::new("cat"), FamilyName::new("at"), FamilyName::new("cat")], false);
    let scene = fixture::two_lane_scene();
    let (of_scene, interaction) = (SceneFeatures::of(&scene, &LaneGraph::of(&scene.road)), Interaction::of(&scene));
    let score = Score {
        objectives: Objectives { attack: 0.5, realism: 0.75 },
        realism_all: 0.75,
        coverage: 1.0,
        scenes: vec![scored("s", 1.0), scored("t", 0.0)],
        failures: vec![],
        benchmark: None,
        rules: Default::default(),
    };
    let near = Probe { ego_distance_m_min: 3.0, actors: 1.0, ..Probe::NOTHING };
    let probes = [
        ProbePair { child: near, parent: Probe::NOTHING, same: false },
        ProbePair { child: Probe::NOTHING, parent: Probe::NOTHING, same: true },
    ];
    let view = CandidateView {
        program: &child,
        parent: &parent,
        patch: &patch,
        mechanism_tags: &[],
        parent_score: &score,
        probes: &probes,
        simulated: None,
    };
    let seen = |id: &'static str, open| SceneView { id, features: &of_scene, interaction: &interaction, open };
    let xi = row(&schema, &view, &[seen("s", true), seen("t", false)]).unwrap();
    assert_eq!(xi.features.len(), schema.columns.len());
    let value = |name: &str| xi.features[schema.columns.iter().position(|c| c.name == name).unwrap()];
    assert_eq!((value("family_at"), value("family_cat")), (0.0, 1.0));
    assert_eq!((value("edit_replaced"), value("edit_parameters"), value("edit_added")), (1.0, 1.0, 0.0));
    assert_eq!((value("edit_parameter_change_mean"), value("edit_parameter_rise_mean")), (0.5, 0.5));
    assert_eq!((value("graph_nodes"), value("graph_edges"), value("graph_motion_nodes")), (3.0, 3.0, 1.0));
    assert_eq!(value("scene_vehicle_count"), of_scene.vehicle_count);
    assert_eq!((xi.open_share, value("open_share")), (0.5, 0.5));
    assert_eq!((value("parent_attack"), value("parent_open_attack")), (0.5, 1.0), "of the open scene alone");
    assert_eq!((value("probe_scenes"), value("probe_differing_share")), (2.0, 0.5));
    assert_eq!((value("probe_ego_distance_m_min"), value("probe_change_ego_distance_m_min")), (3.0, -97.0));
    let hashed: f64 = (0..32).map(|k| value(&format!("edit_hashed_{k:02}"))).sum();
    assert_eq!(hashed, 1.5, "one operation, and a change of one half");
    let foreign = Program { source_family: FamilyName::new("king"), ..program() };
    assert!(row(&schema, &CandidateView { program: &foreign, ..view }, &[]).is_err());
}

#[test]
fn a_log_that_closes_in_gives_its_time_to_conflict() {
    let mut scene = fixture::two_lane_scene();
    scene.ego.track.samples = fixture::straight(scene.steps, Vec2::new(0.0, 0.0), 0.0, 10.0);
    scene.tracks.truncate(1);
    scene.tracks[0].samples = fixture::straight(scene.steps, Vec2::new(50.0, 0.0), 0.0, 5.0);
    let computed = Interaction::of(&scene);
    let last_s = (scene.steps - 1) as f64 * 0.1;
    assert!((computed.relative_distance_m_min - (50.0 - 5.0 * last_s)).abs() < 1e-9);
    assert!((computed.relative_speed_mps - 5.0).abs() < 1e-12);
    assert!((computed.time_to_conflict_s_min - (10.0 - last_s)).abs() < 1e-9);
    assert!(computed.route_deviation_m_min < 1e-9);
    scene.tracks.clear();
    assert_eq!(Interaction::of(&scene).time_to_conflict_s_min, 20.0);
}

/// Rows with a constant column, copies, and values of very different size.
fn awkward_rows() -> impl Strategy<Value = Vec<Vec<f64>>> {
    let value =
        || prop_oneof![Just(0.0), Just(1.0), -1.0..1.0f64, -1e12..1e12f64, Just(1e300), Just(-1e300), Just(1e-300)];
    let row = (value(), value(), value()).prop_map(|(a, b, c)| vec![a, 5.0, b, c]);
    (prop::collection::vec(row, 1..30), any::<bool>())
        .prop_map(|(rows, twice)| if twice { rows.iter().chain(&rows).cloned().collect() } else { rows })
}

proptest! {
    #[test]
    fn degenerate_features_never_give_a_nan(
        rows in awkward_rows(),
        targets in prop::collection::vec(-0.3..=0.5f64, 60),
        lambda in prop_oneof![Just(1e-15), Just(1e-3), Just(1.0), Just(1e6)],
        boosted in any::<bool>(),
    ) {
        let labels = rows.iter().zip(&targets).map(|(row, attack)| label(0, row, *attack)).collect();
        let model = if boosted { WorldModel::Boosted } else { WorldModel::Ridge };
        let options = WorldConfiguration { ridge_lambda: lambda, ..configuration(model) };
        let snapshot = settled(&set_of(labels, 4), &options);
        prop_assert!(snapshot.digest().is_ok(), "a NaN has no digest");
        let router = Router::new(&snapshot).unwrap();
        for row in rows.iter().map(Vec::as_slice).chain([&[1e300, -1e300, 1e300, 0.0][..], &[0.0; 4][..]]) {
            let computed = router.predict(&xi(row, 1.0)).unwrap();
            prop_assert!((0.0..=1.0).contains(&computed.objectives.attack) && computed.rank_score.is_finite());
            prop_assert!(computed.uncertainty().is_finite() && computed.uncertainty() >= 0.0);
        }
    }

    #[test]
    fn no_label_of_an_epoch_can_influence_a_decision_of_that_epoch(
        earlier in prop::collection::vec((0.0..1.0f64, -0.3..=0.5f64), 25..40),
        later in prop::collection::vec((3..6u32, 0.0..1.0f64, -0.3..=0.5f64), 1..20),
        wanted in prop::collection::vec(0.0..1.0f64, 8),
        seed in any::<u64>(),
        boosted in any::<bool>(),
    ) {
        let model = if boosted { WorldModel::Boosted } else { WorldModel::Ridge };
        let mut options = configuration(model);
        (options.routing.rollout_budget, options.routing.audit_share, options.explore) = (4, 0.4, 0.5);
        let known: Vec<WorldLabel> = earlier.iter().map(|(x, y)| label(2, &[*x], *y)).collect();
        // Labels of the epoch itself and of later ones arrive before the fit, between the others.
        let mut all = known.clone();
        for (k, (epoch, x, y)) in later.iter().enumerate() {
            all.insert((2 * k).min(all.len()), label(*epoch, &[*x], *y));
        }
        let routes = |labels: Vec<WorldLabel>| {
            let snapshot = settle(&columns(1), &options, &set_of(labels, 1).by_lineage(), 3, &one_thread()).unwrap();
            let router = Router::new(&snapshot).unwrap();
            let predicted: Vec<Prediction> = wanted.iter().map(|x| router.predict(&xi(&[*x], 1.0)).unwrap()).collect();
            router.routes(&predicted, &mut audit_stream(Seed(seed), &LineageId::new("cat-idm"), 3))
        };
        prop_assert_eq!(routes(known.clone()), routes(all));
        let more: Vec<WorldLabel> = known.into_iter().chain([label(2, &[0.5], 0.5)]).collect();
        prop_assert_ne!(routes(more.clone())[0].snapshot, routes(more[..more.len() - 1].to_vec())[0].snapshot);
    }
}

#[test]
fn a_fit_does_not_depend_on_threads() {
    let set = stepped(60);
    for model in [WorldModel::Ridge, WorldModel::Boosted] {
        let options = configuration(model);
        let fit =
            |threads| settle(&columns(2), &options, &set.by_lineage(), 1, &Threads::new(threads).unwrap()).unwrap();
        let one = fit(1);
        assert!(one.fit.as_ref().is_some_and(|fit| fit.half_width.is_some()));
        assert_eq!((fit(3), fit(2)), (one.clone(), one));
    }
}
