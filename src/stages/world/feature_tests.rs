//! The features of an edit worked by hand, and the ends of every option's range.

use super::tests::{columns, configuration, program, scored};
use super::{CandidateView, ConfigurationError, Interaction, SceneView, pair_row, pair_schema, row, schema, validate};
use crate::kernel::Digest;
use crate::objects::*;
use crate::scene::{LaneGraph, SceneFeatures, fixture};

/// An option, how it is set, values that it may have, and values that it may not.
type Case = (&'static str, fn(&mut WorldConfiguration, f64), &'static [f64], &'static [f64]);

const CASES: &[Case] = &[
    ("ridge_lambda", |c, v| c.ridge_lambda = v, &[1e-9, 1e9], &[0.0, -1.0, 2e9, f64::NAN]),
    ("beta_attack", |c, v| c.beta_attack = v, &[0.0, 1.0], &[-0.1, 1.1]),
    ("beta_realism", |c, v| c.beta_realism = v, &[0.0, 1.0], &[-0.1, 1.1]),
    ("learning_rate", |c, v| c.learning_rate = v, &[0.01, 1.0], &[0.0, -0.5, 1.1]),
    ("interval_level", |c, v| c.interval_level = v, &[0.5, 0.99], &[0.49, 1.0]),
    ("realism_weight", |c, v| c.realism_weight = v, &[0.0, 1e3], &[-1.0, 1001.0]),
    ("explore", |c, v| c.explore = v, &[0.0, 1e3], &[-1.0, 1001.0]),
    ("trees", |c, v| c.trees = v as u32, &[0.0, 1000.0], &[1001.0]),
    ("routing.lambda_a", |c, v| c.routing.lambda_a = v, &[0.0, 1.0], &[-0.1, 1.1]),
    ("routing.lambda_r", |c, v| c.routing.lambda_r = v, &[0.0, 1.0], &[-0.1, 1.1]),
    ("routing.lambda_u", |c, v| c.routing.lambda_u = v, &[1e-9, 1e9], &[0.0, -1.0, 2e9]),
    ("routing.audit_share", |c, v| c.routing.audit_share = v, &[0.0, 1.0], &[-0.1, 1.1]),
    ("routing.pilot.scenes", |c, v| c.routing.pilot = Some(pilot(v as u32, 1.0)), &[1.0, 1000.0], &[0.0, 1001.0]),
    ("routing.pilot.prior_scenes", |c, v| c.routing.pilot = Some(pilot(1, v)), &[1e-3, 1e6], &[0.0, -1.0, 2e6]),
];

fn pilot(scenes: u32, prior_scenes: f64) -> PilotOptions {
    PilotOptions { scenes, prior_scenes }
}

#[test]
fn every_option_is_taken_up_to_the_ends_of_its_range_and_refused_beyond() {
    for (name, set, taken, refused) in CASES {
        let with = |value: f64| {
            let mut changed = configuration(WorldModel::Boosted);
            set(&mut changed, value);
            validate(&changed, &columns(2))
        };
        for value in *taken {
            assert_eq!(with(*value), Ok(()), "{name} = {value}");
        }
        for value in *refused {
            let named = matches!(with(*value), Err(ConfigurationError::Range { option, .. }) if option == *name);
            assert!(named, "{name} = {value}");
        }
    }
}

#[test]
fn an_excluded_column_must_be_one_of_the_schema() {
    let excluding = |name: &str| {
        let changed = WorldConfiguration { excluded_columns: vec![name.into()], ..configuration(WorldModel::Boosted) };
        validate(&changed, &columns(2))
    };
    assert_eq!(excluding("x1"), Ok(()));
    assert_eq!(excluding("x2"), Err(ConfigurationError::UnknownColumn("x2".into())));
}

fn operation(op: OperationKind, path: &str, value: Option<serde_json::Value>) -> Operation {
    Operation { op, path: path.into(), value }
}

fn module(expression: &str) -> MechanismModule {
    MechanismModule {
        slot: "guard".into(),
        inputs: Vec::new(),
        output: ValueType::Number,
        expression: expression.into(),
        tags: Vec::new(),
    }
}

/// A patch of several kinds, its parent and its child.
fn edited() -> (Program, Program, ProgramPatch) {
    let mut parent = program();
    let number = ParameterValue::Number;
    parent.parameters.insert("width".into(), number(4.0));
    parent.parameters.insert("mode".into(), ParameterValue::Choice("calm".into()));
    parent.parameters.insert("same".into(), number(7.0));
    let mut child = parent.clone();
    child.parameters.insert("gain".into(), number(3.0));
    child.parameters.insert("width".into(), number(1.0));
    child.parameters.insert("mode".into(), ParameterValue::Choice("bold".into()));
    child.mechanism_modules.insert("m".into(), module("1 + 1"));
    child.mechanism_modules.insert("n".into(), module("2"));
    // Feeds the first node: the longest path has four nodes, of five.
    let lone = OperatorNode { inputs: Vec::new(), ..child.operator_graph["a"].clone() };
    child.operator_graph.insert("z".into(), lone.clone());
    child.operator_graph.insert("lone".into(), lone);
    let inputs = |name: &str| vec![name.to_string()];
    child.operator_graph.get_mut("a").unwrap().inputs = inputs("z");
    child.operator_graph.get_mut("c").unwrap().inputs = inputs("b");
    child.operator_graph.get_mut("b").unwrap().settings.insert("reach".into(), Setting::Number(1.0));
    let patch = ProgramPatch {
        source_baseline: FamilyName::new("cat"),
        parent_solution_id: parent.solution_id.clone(),
        parent_program_hash: String::new(),
        operations: vec![
            operation(OperationKind::Replace, "/parameters/gain", Some(serde_json::json!(3.0))),
            operation(OperationKind::Replace, "/parameters/width", Some(serde_json::json!(1.0))),
            operation(OperationKind::Replace, "/parameters/mode", Some(serde_json::json!("bold"))),
            operation(OperationKind::Add, "/mechanism_modules/m", Some(serde_json::json!({"kind": "any"}))),
            operation(OperationKind::Remove, "/operator_graph/q/settings/r", None),
        ],
        hypothesis: String::new(),
        memory_refs_used: Vec::new(),
        cluster_refs_used: Vec::new(),
        repair_summary: None,
        free: Default::default(),
    };
    (parent, child, patch)
}

/// The features of that edit by name, with a scene in which the parent was hit and one in which it was not.
fn features_of_edit() -> impl Fn(&str) -> f64 {
    let (parent, child, patch) = edited();
    let schema = schema(&[FamilyName::new("cat")], false);
    let score = Score {
        objectives: Objectives { attack: 0.5, realism: 0.75 },
        realism_all: 0.75,
        coverage: 0.25,
        scenes: vec![scored("s", 1.0), SceneScore { acted: false, ..scored("t", 0.0) }],
        failures: vec![],
        benchmark: None,
        rules: Default::default(),
    };
    let probe = |jerk_mps3| Probe { jerk_mps3, ..Probe::NOTHING };
    let pair = |child, parent, same| ProbePair { child: probe(child), parent: probe(parent), same };
    let view = CandidateView {
        program: &child,
        parent: &parent,
        patch: &patch,
        mechanism_tags: &["a".into(), "b".into()],
        parent_score: &score,
        probes: &[pair(3.0, 1.0, false), pair(5.0, 2.0, false), pair(9.0, 9.0, true)],
        simulated: None,
    };
    let scene = fixture::two_lane_scene();
    let (features, log) = (SceneFeatures::of(&scene, &LaneGraph::of(&scene.road)), Interaction::of(&scene));
    let seen = |id: &'static str| SceneView { id, features: &features, interaction: &log, open: true };
    let row = row(&schema, &view, &[seen("s"), seen("t")]).unwrap();
    assert_eq!(row.mechanism_class, "a+b");
    move |name: &str| row.features[schema.columns.iter().position(|column| column.name == name).unwrap()]
}

#[test]
fn an_edit_is_described_by_kind_place_and_size() {
    let value = features_of_edit();
    let kinds = ["edit_operations", "edit_added", "edit_replaced", "edit_removed"].map(&value);
    assert_eq!(kinds, [5.0, 1.0, 3.0, 1.0]);
    let places = ["edit_parameters", "edit_operator_graph", "edit_policy", "edit_mechanisms"].map(&value);
    assert_eq!(places, [3.0, 1.0, 0.0, 1.0]);
    // From 1 to 3 is a rise of a half, from 4 to 1 a fall of three fifths, and another word is a whole change.
    assert!((value("edit_parameter_change_mean") - 0.7).abs() < 1e-12);
    assert!((value("edit_parameter_rise_mean") + 0.05).abs() < 1e-12);
    assert_eq!(value("edit_parameter_change_max"), 1.0);
}

#[test]
fn every_word_of_an_edit_adds_to_its_hashed_column() {
    let mut wanted = [0.0; 32];
    for (word, size) in [
        ("Replace parameters gain", 1.0),
        ("change of gain", 0.5),
        ("Replace parameters width", 1.0),
        ("change of width", -0.6),
        ("Replace parameters mode", 1.0),
        ("kind bold", 1.0),
        ("Add mechanism_modules m", 1.0),
        ("kind any", 1.0),
        ("Remove operator_graph q", 1.0),
    ] {
        let digest = Digest::of_bytes(format!("cat {word}").as_bytes()).to_hex();
        wanted[usize::from_str_radix(&digest[..4], 16).unwrap() % 32] += size;
    }
    let value = features_of_edit();
    for (place, wanted) in wanted.iter().enumerate() {
        assert!((value(&format!("edit_hashed_{place:02}")) - wanted).abs() < 1e-12, "{place}");
    }
}

#[test]
fn a_graph_is_described_by_its_size_and_its_longest_path() {
    let value = features_of_edit();
    let sizes = ["graph_nodes", "graph_edges", "graph_settings", "graph_depth", "mechanism_modules"].map(&value);
    assert_eq!(sizes, [5.0, 3.0, 1.0, 4.0, 2.0]);
    assert_eq!(value("mechanism_characters_mean"), 3.0);
    assert_eq!((value("graph_select_nodes"), value("graph_actor_nodes")), (3.0, 1.0));
}

#[test]
fn means_are_of_the_open_scenes_and_of_the_probes_that_differ() {
    let value = features_of_edit();
    let parent = ["parent_coverage", "parent_open_attack", "parent_open_realism", "parent_open_acted"].map(&value);
    assert_eq!(parent, [0.25, 0.5, 0.75, 0.5]);
    assert_eq!(value("parent_open_idle_contact"), 0.0, "one was hit by somebody who acts, one was not hit");
    assert_eq!((value("probe_scenes"), value("probe_jerk_mps3"), value("probe_change_jerk_mps3")), (3.0, 4.0, 2.5));
    assert!((value("probe_differing_share") - 2.0 / 3.0).abs() < 1e-12);
}

#[test]
fn a_pair_has_the_scene_s_own_numbers_the_ego_s_the_tags_and_what_was_missed() {
    let (parent, child, patch) = edited();
    let families = [FamilyName::new("cat")];
    let schema = pair_schema(&families, &["idm".into(), "learned".into()]);
    let score = Score {
        objectives: Objectives { attack: 0.5, realism: 0.75 },
        realism_all: 0.75,
        coverage: 0.25,
        scenes: vec![scored("s", 1.0), SceneScore { acted: false, realism: 0.6, ..scored("t", 0.0) }],
        failures: vec![],
        benchmark: None,
        rules: Default::default(),
    };
    let probe = |jerk_mps3| Probe { jerk_mps3, ..Probe::NOTHING };
    let view = CandidateView {
        program: &child,
        parent: &parent,
        patch: &patch,
        mechanism_tags: &["a".into(), "b".into()],
        parent_score: &score,
        probes: &[ProbePair { child: probe(3.0), parent: probe(1.0), same: false }],
        simulated: None,
    };
    let scene = fixture::two_lane_scene();
    let (features, log) = (SceneFeatures::of(&scene, &LaneGraph::of(&scene.road)), Interaction::of(&scene));
    let seen = |id: &'static str, open| SceneView { id, features: &features, interaction: &log, open };
    let scenes = [seen("s", true), seen("t", false), seen("unlabelled", true)];
    let row = pair_row(&schema, &view, "learned", None, &scenes).unwrap();
    assert_eq!((row.pairs.len(), row.mechanism_class.as_str()), (3, "a+b"));
    assert!(row.pairs.iter().all(|pair| pair.features.len() == schema.columns.len()));
    let at =
        |name: &str| schema.columns.iter().position(|column| column.name == name).unwrap_or_else(|| panic!("{name}"));
    let of = |name: &str| -> Vec<f64> { row.pairs.iter().map(|pair| pair.features[at(name)]).collect() };
    assert_eq!(of("parent_scene_attack"), [1.0, 0.0, 0.5], "where the parent has no label, that on the window");
    assert_eq!(of("parent_scene_acted"), [1.0, 0.0, 0.0]);
    assert_eq!((of("probe_open"), of("probe_kept_realism")), (vec![1.0, 0.0, 1.0], vec![0.0, 0.6, 0.0]));
    assert_eq!((of("ego_learned"), of("ego_idm"), of("ego_reacts")), (vec![1.0; 3], vec![0.0; 3], vec![1.0; 3]));
    assert_eq!((of("mechanism_tags")[0], of("probe_change_jerk_mps3")[0], of("edit_operations")[0]), (2.0, 2.0, 5.0));
    let hashed: f64 = (0..16).map(|k| of(&format!("mechanism_hashed_{k:02}"))[0]).sum();
    assert!((1.0..=2.0).contains(&hashed), "{hashed}");
    assert!((row.features[at("probe_open")] - 2.0 / 3.0).abs() < 1e-12, "the row is the mean of its pairs");
    assert_eq!(of("missed_family_labels"), [0.0; 3], "nothing was predicted yet");
    let missed = |labels, attack| GroupMean { labels, mean: Objectives { attack, realism: 0.0 } };
    let groups = [("family cat".to_string(), missed(7, 0.25)), ("mechanism a+b".to_string(), missed(2, -0.5))];
    let line = || Regression::Ridge(RidgeLine { intercept: 0.0, weights: vec![] });
    let fit = WorldFit {
        labels: 7,
        columns: vec![],
        column_mean: vec![],
        column_std: vec![],
        attack: line(),
        realism: line(),
        fallback: None,
        global: missed(7, 0.0),
        groups: Default::default(),
        half_width: None,
        pairs: Some(PairFit {
            pairs: 3,
            inverse: vec![],
            sigma: Objectives { attack: 0.1, realism: 0.1 },
            missed: groups.into(),
        }),
    };
    let known = pair_row(&schema, &view, "idm", Some(&fit), &scenes).unwrap();
    let of = |name: &str| known.pairs[0].features[at(name)];
    assert_eq!(
        (of("missed_family_attack"), of("missed_family_labels"), of("missed_mechanism_attack")),
        (0.25, 7.0, -0.5)
    );
    assert_eq!((of("ego_idm"), of("ego_learned")), (1.0, 0.0));
}
