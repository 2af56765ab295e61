//! Files of SafeBench and ChatScene become programs that play what they say, and come back as the same files.

use proptest::prelude::*;
use std::collections::BTreeMap;

use super::*;
use crate::formats::safebench::parameters::{OptimisedRanges, Range, behaviour_key, step_key, written};

fn none(scenario: usize, name: &str) -> Result<Vec<f64>, ImportError> {
    Err(ImportError::new("list.json", format!("scenario {scenario}"), format!("no file {name}"), "none"))
}

fn of(file: &str, read: ParameterFile, wanted: &Wanted) -> Result<Made, String> {
    Made::of(file, read, wanted, &none).map_err(|error| error.to_string())
}

fn entry(scenario_id: usize, route_id: u32, parameters: Parameters) -> Entry {
    Entry { data_id: 7, scenario_folder: "human".into(), scenario_id, route_id, risk_level: None, parameters }
}

fn number(file: &ProgramFile, name: &str) -> f64 {
    match file.program.parameters[name] {
        ParameterValue::Number(number) => number,
        ParameterValue::Choice(_) => panic!("{name} is a word"),
    }
}

fn parent(family: &str) -> Program {
    ProgramFile::published(&FamilyName::new(family)).unwrap().program
}

/// The list of a program, read again from its bytes.
fn list(program: &Program) -> Vec<Entry> {
    let entries = human_entries(program, &parent("human"), &[4, 5]).unwrap();
    let ParameterFile::List(read) = ParameterFile::read("human.json", &written(&entries).unwrap()).unwrap() else {
        panic!()
    };
    assert_eq!(read, entries, "a file holds its numbers bit for bit");
    read
}

#[test]
fn the_published_parents_list_is_read_as_the_published_parent() {
    let entries = list(&parent("human"));
    assert_eq!(entries.len(), 74 * 2, "74 members on each route, as in human.json");
    assert_eq!(entries[0].parameters, Parameters::Numbers(vec![2.5, 16.0, 40.0]));
    let made = of("human.json", ParameterFile::List(entries), &Wanted::default()).unwrap();
    assert_eq!(made.file.program.hash().unwrap(), parent("human").hash().unwrap());
    assert!(made.file.origins.is_empty(), "nothing was changed");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn a_list_read_and_written_again_is_the_same_list(
        speed in 2.0..3.5f64, trigger in 10.0..30.0f64, leader in 20.0..50.0f64, reach in 0.0..2.4f64,
    ) {
        let mut program = parent("human");
        let changes = [
            ("straight_obstacle_speed_mps", speed),
            ("straight_obstacle_trigger_m", trigger),
            ("lane_changing_leader_ahead_m", leader),
            ("grid_reach", reach),
        ];
        program.parameters.extend(changes.map(|(name, value)| (name.to_string(), ParameterValue::Number(value))));
        let first = list(&program);
        let made = of("human.json", ParameterFile::List(first.clone()), &Wanted::default()).unwrap();
        for (name, value) in changes {
            prop_assert!((number(&made.file, name) - value).abs() < 1e-8, "{name}: {} for {value}", number(&made.file, name));
        }
        // Nine decimals of the reach and of both ends: the last may be another.
        let again = list(&made.file.program);
        prop_assert_eq!(again.len(), first.len());
        for (one, other) in again.iter().zip(&first) {
            let (Parameters::Numbers(a), Parameters::Numbers(b)) = (&one.parameters, &other.parameters) else {
                panic!("a grid has numbers");
            };
            prop_assert_eq!((one.scenario_id, one.route_id, a.len()), (other.scenario_id, other.route_id, b.len()));
            prop_assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-8));
        }
    }

    #[test]
    fn ranges_read_and_written_again_are_the_same_ranges(
        ahead in -4.0..4.0f64, aside in 2.0..4.0f64, speed in 0.0..4.0f64, width in 0.0..3.0f64,
    ) {
        let range = |low: f64| Range { low: (low * 1e6).round() / 1e6, high: ((low + width) * 1e6).round() / 1e6 };
        let ranges: BTreeMap<String, Range> = [
            ("OPT_GEO_X_DISTANCE", range(aside)),
            ("OPT_GEO_Y_DISTANCE", range(ahead)),
            ("OPT_ADV_SPEED", range(speed)),
            ("OPT_ADV_DISTANCE", range(speed + 5.0)),
            ("OPT_STOP_DISTANCE", range(0.0)),
        ]
        .map(|(name, range)| (name.to_string(), range))
        .into();
        let all: OptimisedRanges = [(behaviour_key(2, 0), [(step_key(0), ranges.clone())].into())].into();
        let wanted = Wanted { behaviour: Some(2), ..Wanted::default() };
        let made = of("scenario_2.json", ParameterFile::Ranges(all), &wanted).unwrap();
        let (again, _) = optimised_ranges(&made.file.program).unwrap();
        prop_assert_eq!(&again[&2][&behaviour_key(2, 0)][&step_key(0)], &ranges);
    }
}

#[test]
fn one_entry_is_the_middle_of_a_grid_without_reach_and_nothing_else_moves() {
    let entries = vec![
        entry(1, 4, Parameters::Numbers(vec![2.25, 21.5, 48.0])),
        entry(1, 4, Parameters::Numbers(vec![2.75, 17.0, 37.5])),
        entry(5, 4, Parameters::Numbers(vec![9.5, 33.0])),
        entry(5, 4, Parameters::Numbers(vec![11.0, 36.0])),
    ];
    let wanted = Wanted { take: Some(1), ..Wanted::default() };
    let made = of("random.json", ParameterFile::List(entries.clone()), &wanted).unwrap();
    let names = [
        "straight_obstacle_speed_mps",
        "straight_obstacle_trigger_m",
        "straight_obstacle_start_m",
        "red_light_running_speed_mps",
    ];
    assert_eq!(names.map(|name| number(&made.file, name)), [2.75, 17.0, 37.5, 11.0]);
    assert_eq!((number(&made.file, "grid_reach"), number(&made.file, "right_turn_speed_mps")), (0.0, 12.0));
    assert!(
        made.notes[1].contains("turning_obstacle") && !made.notes[1].contains("straight_obstacle"),
        "{:?}",
        made.notes
    );
    let whole = of("random.json", ParameterFile::List(entries.clone()), &Wanted::default()).unwrap_err();
    assert!(
        whole.contains("scenario 1: expected a grid of 10 members, found 2 entries; take one entry: --take"),
        "{whole}"
    );
    let beyond =
        of("random.json", ParameterFile::List(entries), &Wanted { take: Some(2), ..Wanted::default() }).unwrap_err();
    assert!(beyond.contains("scenario 1, route 4: expected an entry 2 (counted from 0), found 2 entries"), "{beyond}");
}

#[test]
fn routes_that_differ_have_to_be_named() {
    let of_route = |route, speed| entry(5, route, Parameters::Numbers(vec![speed, 33.0]));
    let entries = vec![of_route(4, 9.5), of_route(5, 10.5)];
    let taken = |route| {
        of("random.json", ParameterFile::List(entries.clone()), &Wanted { take: Some(0), route, ..Wanted::default() })
    };
    let refused = taken(None).unwrap_err();
    assert!(
        refused.contains("scenario 5, route 5: expected the parameters of route 4, found others; name the route"),
        "{refused}"
    );
    assert_eq!(number(&taken(Some(5)).unwrap().file, "red_light_running_speed_mps"), 10.5);
    assert!(taken(Some(6)).unwrap_err().contains("found none"));
}

#[test]
fn parameters_that_the_contract_refuses_are_named_with_their_bounds() {
    let fast = vec![entry(5, 4, Parameters::Numbers(vec![900.0, 33.0]))];
    let refused =
        of("list.json", ParameterFile::List(fast), &Wanted { take: Some(0), ..Wanted::default() }).unwrap_err();
    assert!(refused.contains("red_light_running_speed_mps") && refused.contains("900"), "{refused}");
    let short = vec![entry(5, 4, Parameters::Numbers(vec![9.0]))];
    let refused = of("list.json", ParameterFile::List(short), &Wanted::default()).unwrap_err();
    assert!(refused.contains("data_id 7: expected 2 numbers for scenario 5, found 1"), "{refused}");
    let strange = vec![Entry {
        scenario_folder: "adv_init_state".into(),
        ..entry(1, 0, Parameters::Other(serde_json::Value::Null))
    }];
    let refused = of("list.json", ParameterFile::List(strange), &Wanted::default()).unwrap_err();
    assert!(refused.contains("found adv_init_state"), "{refused}");
}

#[test]
fn sequences_are_carried_whole_by_files_of_both_forms() {
    let values = |first: f64| (0..100).map(|k| (first + 0.007 * f64::from(k)).fract()).collect::<Vec<_>>();
    let all = BTreeMap::from([
        ("advsim".to_string(), BTreeMap::from([(1, BTreeMap::from([(0, values(0.1)), (1, values(0.2))]))])),
        ("advtraj".to_string(), BTreeMap::from([(1, BTreeMap::from([(0, values(0.3))]))])),
    ]);
    let taken = |method: &str, take| {
        of(
            "s.json",
            ParameterFile::Sequences(all.clone()),
            &Wanted { method: Some(method.into()), take, ..Wanted::default() },
        )
    };
    let second = taken("advsim", Some(1)).unwrap().file;
    assert_eq!(second.sequences[&TrafficFamily::StraightObstacle], values(0.2));
    assert_eq!(taken("adv_trajectory", None).unwrap().file.sequences[&TrafficFamily::StraightObstacle], values(0.3));
    assert_eq!(taken("advtraj", None).unwrap().file.family.as_str(), "adv_traj");
    assert!(taken("advsim", Some(9)).unwrap_err().contains("advsim, scenario 1: expected a sequence 9, found 0, 1"));
    let unnamed = of("s.json", ParameterFile::Sequences(all.clone()), &Wanted::default()).unwrap_err();
    assert!(unnamed.contains("name it: --method advsim or advtraj"), "{unnamed}");
    let json = ProgramFile::from_bytes("p.json", &second.to_bytes().unwrap()).unwrap();
    let toml = ProgramFile::from_bytes("p.toml", second.to_toml().unwrap().as_bytes()).unwrap();
    assert_eq!((&json, &toml), (&second, &second));
    let mut short = second.clone();
    short.sequences.insert(TrafficFamily::RightTurn, vec![0.5; 99]);
    let refused =
        ProgramFile::from_bytes("p.json", &short.sealed().unwrap().to_bytes().unwrap()).unwrap_err().to_string();
    assert!(refused.contains("the sequence of right_turn is not 100 numbers"), "{refused}");
    let other =
        ProgramFile { sequences: second.sequences, ..ProgramFile::published(&FamilyName::new("human")).unwrap() };
    let refused =
        ProgramFile::from_bytes("p.json", &other.sealed().unwrap().to_bytes().unwrap()).unwrap_err().to_string();
    assert!(refused.contains("programs of family human play no control sequences"), "{refused}");
}

#[test]
fn a_list_of_sequences_reads_those_that_it_names() {
    let file =
        |k: u32| Entry { scenario_folder: "advsim".into(), ..entry(3, 4, Parameters::File(format!("{k}.json"))) };
    let list = vec![file(0), file(1)];
    let read = |scenario: usize, name: &str| {
        assert_eq!((scenario, name), (3, "1.json"));
        Ok(vec![0.75; 100])
    };
    let wanted = Wanted { take: Some(1), ..Wanted::default() };
    let made = Made::of("advsim.json", ParameterFile::List(list.clone()), &wanted, &read).unwrap();
    assert_eq!(made.file.sequences, BTreeMap::from([(TrafficFamily::LaneChanging, vec![0.75; 100])]));
    let missing = of("advsim.json", ParameterFile::List(list), &wanted).unwrap_err();
    assert!(missing.contains("no file 1.json"), "{missing}");
}

#[test]
fn ranges_are_those_of_the_template_and_what_no_template_has_is_named() {
    let range = |low, high| Range { low, high };
    let ranges: BTreeMap<String, Range> = [
        ("OPT_GEO_Y_DISTANCE", range(-0.5, 4.0)),
        ("OPT_ADV_SPEED", range(7.0, 11.0)),
        ("OPT_ADV_DISTANCE", range(8.0, 14.0)),
        ("OPT_THROTTLE", range(0.6, 0.9)),
        ("OPT_STOP_DISTANCE", range(0.75, 1.5)),
    ]
    .map(|(name, range)| (name.to_string(), range))
    .into();
    let all: OptimisedRanges =
        [(behaviour_key(1, 3), [(step_key(0), BTreeMap::new()), (step_key(5), ranges)].into())].into();
    let taken = |wanted| of("scenario_5.json", ParameterFile::Ranges(all.clone()), &wanted);
    let made = taken(Wanted { route: Some(3), ..Wanted::default() }).unwrap();
    let bounds = |name: &str| ["low", "high"].map(|end| number(&made.file, &format!("crossing_{name}_{end}")));
    assert_eq!(
        (bounds("speed_mps"), bounds("act_within_m"), bounds("ahead_m")),
        ([7.0, 11.0], [0.75, 1.5], [-0.5, 4.0])
    );
    assert_eq!(bounds("trigger_m"), [60.0, 60.0], "ChatScene's program waits for 60 m");
    assert_eq!(number(&made.file, "roadside_speed_mps_high"), 5.0, "other templates stay");
    assert!(made.notes[1].ends_with("OPT_ADV_DISTANCE, OPT_THROTTLE"), "{:?}", made.notes);
    let other = taken(Wanted { route: Some(3), behaviour: Some(2), ..Wanted::default() }).unwrap_err();
    assert!(other.contains("expected an entry OPT_behavior_2_opt_ROUTE-3, found none"), "{other}");
    let early = taken(Wanted { route: Some(3), step: Some(2), ..Wanted::default() }).unwrap_err();
    assert!(early.contains("opt_time_2, found steps up to 5"), "{early}");
    let empty = taken(Wanted { route: Some(3), step: Some(0), ..Wanted::default() }).unwrap_err();
    assert!(empty.contains("expected a range OPT_GEO_Y_DISTANCE"), "{empty}");
}

#[test]
fn programs_without_such_a_form_say_why() {
    let mut ruled = parent("human");
    let rule = crate::objects::PolicyRule {
        name: "r".into(),
        when: "is_junction".into(),
        parameters: BTreeMap::new(),
        operators: BTreeMap::new(),
    };
    ruled.scenario_conditioned_policy.push(rule);
    assert!(human_entries(&ruled, &parent("human"), &[4]).unwrap_err().contains("rules"));
    assert!(
        optimised_ranges(&Program { source_family: FamilyName::new("chatscene"), ..ruled })
            .unwrap_err()
            .contains("rules")
    );
    let (ranges, left) = optimised_ranges(&parent("chatscene")).unwrap();
    assert!(ranges.contains_key(&1) && ranges.contains_key(&2), "{:?}", ranges.keys());
    assert!(left.iter().any(|why| why.contains("scenario 5: it is set off at 15 to 45 m")), "{left:?}");
}
