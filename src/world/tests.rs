//! The evaluator against hand-solved cases, against the normal equations, and at its edges.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use super::ridge::{leverage, standardised, value_at};
use super::*;
use crate::kernel::{Digest, Seed, Stream, Vec2};
use crate::objects::*;
use crate::scene::{LaneGraph, SceneFeatures, fixture};

fn configuration() -> WorldConfiguration {
    WorldConfiguration {
        excluded_columns: Vec::new(),
        ridge_lambda: 1.0,
        beta_attack: 0.75,
        beta_realism: 0.5,
        calibration_group: CalibrationGroup::Family,
        group_labels_min: 3,
        residual_floor: 1e-3,
        residual_share: 0.0,
        uncertainty_quantile: 1.0,
        routing: RoutingOptions { lambda_a: 0.5, lambda_r: 0.5, lambda_u: 0.2, audit_rate: 0.0, min_labels: 10 },
    }
}

/// A schema of `n` plain columns.
fn columns(n: usize) -> FeatureSchema {
    let column = |k| FeatureColumn { name: format!("x{k}"), group: FeatureGroup::Scene };
    FeatureSchema { families: vec![FamilyName::new("cat")], columns: (0..n).map(column).collect() }
}

fn pair(features: &[f64], family: &str) -> WorldPair {
    WorldPair {
        scene: "s".into(),
        features: features.to_vec(),
        family: FamilyName::new(family),
        scene_cluster: "plain".into(),
        mechanism_class: "none".into(),
    }
}

fn label(features: &[f64], attack: f64, realism: f64) -> WorldLabel {
    WorldLabel {
        attempt: AttemptId::new("cat-idm/e1s0"),
        solution: SolutionId::new("cat-idm/e1s0"),
        epoch: 1,
        pair: pair(features, "cat"),
        labels: Objectives { attack, realism },
        diagnostics: BTreeMap::new(),
        decision: RouteDecision::Audit,
        predicted: Objectives { attack: 0.5, realism: 0.5 },
        monitored: false,
    }
}

fn set_of(labels: Vec<WorldLabel>, width: usize) -> CalibrationSet {
    let mut set = CalibrationSet::default();
    set.append(labels, &columns(width)).unwrap();
    set
}

/// Attack rises and realism falls along one column: 21 labels on a line.
fn sloped() -> CalibrationSet {
    let at = |k: i32| f64::from(k) / 20.0;
    set_of((0..=20).map(|k| label(&[at(k), 7.0], at(k), 1.0 - 0.2 * at(k))).collect(), 2)
}

fn route_of(snapshot: &WorldSnapshot, features: &[f64]) -> Routed {
    let mut stream = monitor_stream(Seed(1), &AttemptId::new("a"));
    Router::new(snapshot).unwrap().route(&[pair(features, "cat")], &mut stream).unwrap()
}

fn settled(set: &CalibrationSet, configuration: &WorldConfiguration) -> WorldSnapshot {
    let width = set.labels().first().map_or(2, |label| label.pair.features.len());
    settle(&columns(width), configuration, set).unwrap()
}

#[test]
fn a_small_ridge_has_the_solution_found_by_hand() {
    // x = -1, 0, 1 has deviation sqrt(2/3), so standardised ends are ±sqrt(3/2); X'X = 3, X'y = sqrt(3/2) (0.8 - 0.2).
    let rows: [&[f64]; 3] = [&[-1.0], &[0.0], &[1.0]];
    let labels = [0.2, 0.5, 0.8].map(|a| Objectives { attack: a, realism: 0.5 });
    let fit = fit_ridge(&rows, &labels, vec![0], &configuration()).unwrap();
    assert!((fit.attack.intercept - 0.5).abs() < 1e-15);
    let expected = 1.5f64.sqrt() * 0.6 / (3.0 + 1.0);
    assert!((fit.attack.weights[0] - expected).abs() < 1e-12, "{:?}", fit.attack);
    assert!(fit.realism.weights[0].abs() < 1e-15);
    let end = leverage(&fit, &standardised(&fit, &[1.0]));
    assert!((end - (1.5 / 4.0 + 1.0 / 3.0)).abs() < 1e-12, "{end}");
}

#[test]
fn weights_and_leverage_agree_with_the_normal_equations() {
    let mut stream = Seed(3).stream(&["ridge"]);
    let rows: Vec<Vec<f64>> = (0..60).map(|_| (0..7).map(|_| stream.normal(2.0, 3.0)).collect()).collect();
    let labels: Vec<Objectives> = rows
        .iter()
        .map(|r| Objectives { attack: (0.5 + 0.05 * r[0] - 0.03 * r[4]).clamp(0.0, 1.0), realism: stream.unit() })
        .collect();
    let slices: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
    let fit = fit_ridge(&slices, &labels, (0..7).collect(), &configuration()).unwrap();
    let x = DMatrix::from_fn(60, 7, |i, j| standardised(&fit, &rows[i])[j]);
    let y = DVector::from_fn(60, |i, _| labels[i].attack - fit.attack.intercept);
    let inverse = (x.transpose() * &x + DMatrix::identity(7, 7)).try_inverse().unwrap();
    let weights = &inverse * x.transpose() * y;
    for (own, plain) in fit.attack.weights.iter().zip(weights.iter()) {
        assert!((own - plain).abs() < 1e-10, "{own} {plain}");
    }
    let row = standardised(&fit, &[1.0; 7]);
    let point = DVector::from_vec(row.clone());
    let expected = (point.transpose() * inverse * point)[0] + 1.0 / 60.0;
    assert!((leverage(&fit, &row) - expected).abs() < 1e-10);
    assert!((value_at(&fit.attack, &row) - 0.5).abs() < 0.5);
}

#[test]
fn uncertainty_grows_away_from_the_labels() {
    let snapshot = settled(&sloped(), &configuration());
    let router = Router::new(&snapshot).unwrap();
    let at = |x: f64| router.predict(&pair(&[x, 7.0], "cat")).unwrap().uncertainty;
    assert!(at(0.5) < at(1.0) && at(1.0) < at(3.0) && at(3.0) < at(30.0));
}

#[test]
fn promising_and_certain_is_selected_weak_and_certain_rejected_far_away_audited() {
    let snapshot = settled(&sloped(), &configuration());
    assert_eq!(route_of(&snapshot, &[0.9, 7.0]).route.decision, RouteDecision::Select);
    let weak = route_of(&snapshot, &[0.1, 7.0]);
    assert_eq!(weak.route.decision, RouteDecision::Reject);
    assert!(weak.route.reason.starts_with("reject: weak and certain; attack 0."), "{}", weak.route.reason);
    assert_eq!(weak.route.snapshot, snapshot.digest().unwrap());
    assert_eq!(route_of(&snapshot, &[-400.0, 7.0]).route.decision, RouteDecision::Audit);
}

#[test]
fn the_monitor_asks_for_labels_of_the_declared_share_of_rejections() {
    let mut options = configuration();
    options.routing.audit_rate = 0.25;
    let snapshot = settled(&sloped(), &options);
    let router = Router::new(&snapshot).unwrap();
    let audited = (0..400)
        .filter(|k| {
            let mut stream = monitor_stream(Seed(9), &AttemptId::new(format!("a{k}")));
            let routed = router.route(&[pair(&[0.1, 7.0], "cat")], &mut stream).unwrap();
            assert_eq!(routed.monitored, routed.route.decision == RouteDecision::Audit);
            assert_eq!(routed.monitored, drawn_by_monitor(&routed.route), "the record says so too");
            routed.monitored
        })
        .count();
    assert!((60..140).contains(&audited), "{audited}");
}

#[test]
fn nothing_is_rejected_before_there_are_enough_labels() {
    let mut options = configuration();
    options.routing.min_labels = 22;
    let routed = route_of(&settled(&sloped(), &options), &[0.1, 7.0]);
    assert_eq!(routed.route.decision, RouteDecision::Audit);
    assert_eq!(routed.route.reason, "audit: 21 labels, 22 needed before anything is judged");
    options.routing.min_labels = 0;
    let empty = settled(&CalibrationSet::default(), &options);
    let routed = route_of(&empty, &[0.1, 7.0]);
    assert_eq!((routed.route.decision, routed.route.uncertainty), (RouteDecision::Audit, 1.0));
}

#[test]
fn a_weak_candidate_of_a_sparse_group_is_audited() {
    let snapshot = settled(&sloped(), &configuration());
    let mut stream = monitor_stream(Seed(1), &AttemptId::new("a"));
    let routed = Router::new(&snapshot).unwrap().route(&[pair(&[0.1, 7.0], "at")], &mut stream).unwrap();
    assert_eq!(routed.route.decision, RouteDecision::Audit);
    assert!(routed.route.reason.contains("too few labels"));
}

#[test]
fn calibration_mixes_the_prediction_with_its_groups_mean_and_a_sparse_one_with_the_global() {
    let mut labels = sloped().labels().to_vec();
    for k in 0..2 {
        labels.push(WorldLabel { pair: pair(&[0.5, 7.0], "at"), ..label(&[0.5, 7.0], f64::from(k), 0.5) });
    }
    let snapshot = settled(&set_of(labels, 2), &configuration());
    let fit = snapshot.fit.as_ref().unwrap();
    let router = Router::new(&snapshot).unwrap();
    let raw = value_at(&fit.attack, &standardised(fit, &[0.9, 7.0]));
    let cat = router.predict(&pair(&[0.9, 7.0], "cat")).unwrap();
    assert!(!cat.sparse);
    assert!((cat.objectives.attack - (0.75 * raw + 0.25 * fit.groups["cat"].mean.attack)).abs() < 1e-12);
    let at = router.predict(&pair(&[0.9, 7.0], "at")).unwrap();
    assert!(at.sparse);
    assert!((at.objectives.attack - (0.75 * raw + 0.25 * fit.global.mean.attack)).abs() < 1e-12);
}

#[test]
fn the_most_uncertain_scene_stands_for_the_candidate() {
    let snapshot = settled(&sloped(), &configuration());
    let router = Router::new(&snapshot).unwrap();
    let pairs = [pair(&[0.5, 7.0], "cat"), pair(&[40.0, 7.0], "cat")];
    let routed = router.route(&pairs, &mut monitor_stream(Seed(1), &AttemptId::new("a"))).unwrap();
    assert_eq!(routed.route.uncertainty, router.predict(&pairs[1]).unwrap().uncertainty);
    assert!(matches!(
        router.route(&[], &mut monitor_stream(Seed(1), &AttemptId::new("a"))),
        Err(RouterError::NoScenes)
    ));
}

#[test]
fn refits_of_the_same_labels_have_the_same_bits_and_one_more_label_another_digest() {
    let (set, options) = (sloped(), configuration());
    let first = settled(&set, &options).digest().unwrap();
    assert_eq!(first, settled(&set, &options).digest().unwrap());
    let mut more = set.clone();
    more.append(vec![label(&[0.3, 7.0], 1.0, 1.0)], &columns(2)).unwrap();
    assert_ne!(first, settled(&more, &options).digest().unwrap());
}

#[test]
fn a_snapshot_read_back_routes_as_before_and_a_damaged_one_is_refused() {
    let snapshot = settled(&sloped(), &configuration());
    let text = serde_json::to_string(&snapshot).unwrap();
    let mut back: WorldSnapshot = serde_json::from_str(&text).unwrap();
    assert_eq!(back.digest(), snapshot.digest());
    back.fit.as_mut().unwrap().factor.pop();
    assert!(matches!(Router::new(&back), Err(RouterError::Inconsistent(_))));
    back.fit.as_mut().unwrap().columns[0] = 99;
    assert!(matches!(Router::new(&back), Err(RouterError::Inconsistent(_))));
}

#[test]
fn excluded_columns_are_not_read_and_unknown_ones_refused() {
    let mut options = configuration();
    options.excluded_columns = vec!["x0".into()];
    let snapshot = settled(&sloped(), &options);
    let router = Router::new(&snapshot).unwrap();
    assert_eq!(router.predict(&pair(&[0.1, 7.0], "cat")), router.predict(&pair(&[0.9, 7.0], "cat")));
    options.excluded_columns = vec!["no_such".into()];
    let refused = settle(&columns(2), &options, &CalibrationSet::default());
    assert_eq!(refused, Err(ConfigurationError::UnknownColumn("no_such".into())));
}

#[test]
fn an_ill_conditioned_fit_says_so_and_keeps_the_means() {
    let options = WorldConfiguration { ridge_lambda: 1e-14, ..configuration() };
    let at = |k: i32| f64::from(k) / 20.0;
    let set = set_of((0..=20).map(|k| label(&[at(k), at(k)], at(k), 0.5)).collect(), 2);
    let fit = settled(&set, &options).fit.unwrap();
    assert!(fit.fallback.is_some());
    assert_eq!((fit.attack.weights.len(), fit.attack.intercept), (0, fit.global.mean.attack));
}

#[test]
fn a_label_that_is_no_label_is_refused_with_its_batch() {
    let mut set = CalibrationSet::default();
    for bad in [label(&[0.1], 0.5, 0.5), label(&[0.1, f64::NAN], 0.5, 0.5), label(&[0.1, 0.2], f64::NAN, 0.5)] {
        assert!(set.append(vec![label(&[0.1, 0.2], 0.5, 0.5), bad], &columns(2)).is_err());
    }
    assert!(set.labels().is_empty());
}

#[test]
fn options_out_of_range_are_named() {
    let bad = WorldConfiguration { ridge_lambda: 0.0, ..configuration() };
    let refused = validate(&bad, &columns(2));
    assert!(matches!(refused, Err(ConfigurationError::Range { option: "ridge_lambda", .. })), "{refused:?}");
}

fn program() -> Program {
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

#[test]
fn features_fill_the_five_groups_in_the_schemas_order() {
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
    };
    let schema = schema(&[FamilyName::new("cat"), FamilyName::new("at"), FamilyName::new("cat")]);
    let scene = fixture::two_lane_scene();
    let of_scene = SceneFeatures::of(&scene, &LaneGraph::of(&scene.road));
    let interaction = Interaction::of(&scene);
    let candidate = candidate_features(&schema, &child, &parent, &patch, &[]).unwrap();
    let pair = features(&schema, &candidate, "s", &of_scene, &interaction).unwrap();
    assert_eq!(pair.features.len(), schema.columns.len());
    let value = |name: &str| pair.features[schema.columns.iter().position(|c| c.name == name).unwrap()];
    assert_eq!((value("family_at"), value("family_cat")), (0.0, 1.0));
    assert_eq!((value("edit_replaced"), value("edit_parameters"), value("edit_added")), (1.0, 1.0, 0.0));
    assert_eq!(value("edit_parameter_change_mean"), 0.5);
    assert_eq!((value("graph_nodes"), value("graph_edges"), value("graph_motion_nodes")), (3.0, 3.0, 1.0));
    assert!(value("graph_depth") <= 3.0, "a circle does no harm");
    assert_eq!(value("scene_vehicle_count"), of_scene.vehicle_count);
    assert!(value("log_relative_distance_m_min") <= 20.0);
    let foreign = Program { source_family: FamilyName::new("king"), ..program() };
    assert!(candidate_features(&schema, &foreign, &parent, &patch, &[]).is_err());
}

#[test]
fn a_log_that_closes_in_gives_its_time_to_conflict() {
    let mut scene = fixture::two_lane_scene();
    scene.ego.track.samples = fixture::straight(scene.steps, Vec2::new(0.0, 0.0), 0.0, 10.0);
    scene.tracks.truncate(1);
    scene.tracks[0].samples = fixture::straight(scene.steps, Vec2::new(50.0, 0.0), 0.0, 5.0);
    let found = Interaction::of(&scene);
    let last_s = (scene.steps - 1) as f64 * 0.1;
    assert!((found.relative_distance_m_min - (50.0 - 5.0 * last_s)).abs() < 1e-9);
    assert!((found.relative_speed_mps - 5.0).abs() < 1e-12);
    assert!((found.time_to_conflict_s_min - (10.0 - last_s)).abs() < 1e-9);
    assert!(found.route_deviation_m_min < 1e-9);
    scene.tracks.clear();
    assert_eq!(Interaction::of(&scene).time_to_conflict_s_min, 20.0);
}

/// Rows with a constant column, copies, and values of very different size.
fn awkward_rows() -> impl Strategy<Value = Vec<Vec<f64>>> {
    let value =
        || prop_oneof![Just(0.0), Just(1.0), -1.0..1.0f64, -1e12..1e12f64, Just(1e300), Just(-1e300), Just(1e-300)];
    let row = (value(), value(), value()).prop_map(|(a, b, c)| vec![a, 5.0, b, c]);
    (prop::collection::vec(row, 1..20), any::<bool>())
        .prop_map(|(rows, twice)| if twice { rows.iter().chain(&rows).cloned().collect() } else { rows })
}

proptest! {
    #[test]
    fn degenerate_features_never_give_a_nan(
        rows in awkward_rows(),
        targets in prop::collection::vec((0.0..=1.0f64, 0.0..=1.0f64), 40),
        lambda in prop_oneof![Just(1e-15), Just(1e-3), Just(1.0), Just(1e6)],
    ) {
        let labels = rows.iter().zip(&targets).map(|(row, (a, r))| label(row, *a, *r)).collect();
        let options = WorldConfiguration { ridge_lambda: lambda, residual_share: 1.0, ..configuration() };
        let snapshot = settled(&set_of(labels, 4), &options);
        prop_assert!(snapshot.digest().is_ok(), "a NaN has no digest");
        let router = Router::new(&snapshot).unwrap();
        for row in rows.iter().map(Vec::as_slice).chain([&[1e300, -1e300, 1e300, 0.0][..], &[0.0; 4][..]]) {
            let found = router.predict(&pair(row, "cat")).unwrap();
            prop_assert!((0.0..=1.0).contains(&found.objectives.attack));
            prop_assert!((0.0..=1.0).contains(&found.objectives.realism));
            prop_assert!(found.uncertainty.is_finite() && found.uncertainty >= 0.0);
        }
        prop_assert!(Digest::of("test", &route_of(&snapshot, &rows[0]).route).is_ok());
    }

    #[test]
    fn without_enough_labels_no_candidate_whatever_it_looks_like_is_rejected(
        rows in awkward_rows(),
        x in prop::collection::vec(-1e6..1e6f64, 4),
        seed in any::<u64>(),
    ) {
        let mut options = configuration();
        options.routing = RoutingOptions { lambda_a: 1.0, lambda_r: 1.0, lambda_u: 1e9, audit_rate: 0.0, min_labels: 41 };
        let snapshot = settled(&set_of(rows.iter().map(|row| label(row, 0.0, 0.0)).collect(), 4), &options);
        let mut stream: Stream = monitor_stream(Seed(seed), &AttemptId::new("a"));
        let routed = Router::new(&snapshot).unwrap().route(&[pair(&x, "cat")], &mut stream).unwrap();
        prop_assert_ne!(routed.route.decision, RouteDecision::Reject);
    }
}
