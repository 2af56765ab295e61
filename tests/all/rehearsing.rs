//! The choice that rolls candidates out before it decides.

use std::sync::OnceLock;

use evodrive::adapters::Contract;
use evodrive::compiler::{Compiled, Prepared, Situation};
use evodrive::families::{grammar, rehearsals_of, rehearsing, sources, sources_by_hand};
use evodrive::kernel::Seed;
use evodrive::objects::expr::Expr;
use evodrive::objects::{FamilyName, MechanismModule, OperatorNode, Program, Setting, Slot, ValueType};
use evodrive::sim::{Outcome, rollout_assessed};
use evodrive::stage::Source;
use evodrive::synth::WorldKind;

use crate::by_hand::{here, well};
use crate::worlds;

fn situations() -> &'static [Situation] {
    static SITUATIONS: OnceLock<Vec<Situation>> = OnceLock::new();
    SITUATIONS.get_or_init(|| worlds::situations(&worlds::options(), 4712, 2 * WorldKind::ALL.len()))
}

fn family(name: &str) -> Source {
    sources_by_hand().get(&FamilyName::new(name)).unwrap().clone()
}

/// A parent that rolls its best candidates out and takes the one of the largest value.
fn rehearsed(source: &Source, count: u32, value: &str) -> Program {
    let mut program = source.parent.clone();
    let module = MechanismModule {
        slot: grammar::REHEARSAL_SLOT.into(),
        inputs: Expr::parse(value).unwrap().names().into_iter().collect(),
        output: ValueType::Number,
        expression: value.into(),
        tags: vec!["rehearsal".into()],
    };
    program.mechanism_modules.insert("worth".into(), module);
    let choice = program.operator_graph.values_mut().find(|node| node.slot == Slot::Diversity).unwrap();
    let settings = [
        ("count".to_string(), Setting::Number(f64::from(count))),
        ("value".to_string(), grammar::from_mechanism("worth")),
    ];
    *choice = OperatorNode { kind: grammar::REHEARSED_CHOICE.into(), settings: settings.into(), ..choice.clone() };
    program
}

fn played(situation: &Situation, compiled: &Compiled) -> Outcome {
    rollout_assessed(&situation.plant, &compiled.intervention, situation.policy.driver().as_mut()).unwrap()
}

/// What a label reads from an outcome under the name of a feature.
fn read(outcome: &Outcome, feature: &str) -> f64 {
    let contact = outcome.contact.filter(|contact| contact.adversary);
    let flag = |holds: bool| if holds { 1.0 } else { 0.0 };
    match feature {
        "rehearsed_met" => flag(contact.is_some()),
        "rehearsed_preventable" => flag(contact.and_then(|of| of.preventable()) == Some(true)),
        "rehearsed_visible_s" => contact.and_then(|of| of.visible_s).unwrap_or(0.0),
        "rehearsed_impact_mps" => contact.map_or(0.0, |of| of.relative_speed_mps),
        "rehearsed_ego_route_share" => outcome.route_completion,
        other => panic!("{other}"),
    }
}

#[test]
fn what_a_rehearsal_tells_is_what_the_label_is_read_from_and_the_largest_value_is_chosen() {
    let source = family("adv_bmt");
    for (feature, value) in [
        ("rehearsed_met", "if(rehearsed_met, 1, 0)"),
        ("rehearsed_preventable", "if(rehearsed_preventable, 1, 0)"),
        ("rehearsed_visible_s", "rehearsed_visible_s"),
        ("rehearsed_impact_mps", "rehearsed_impact_mps"),
        ("rehearsed_ego_route_share", "rehearsed_ego_route_share"),
    ] {
        let program = rehearsed(&source, 8, value);
        let mut apart = 0;
        for situation in situations() {
            let prepared = Prepared::new(&program, &source).unwrap().watching();
            let compiled = prepared.compile(situation, Seed(7)).unwrap();
            if !compiled.decision.applies {
                continue;
            }
            let told = prepared.watched("worth");
            let most = *told.last().unwrap();
            assert_eq!(read(&played(situation, &compiled), feature), most, "{feature} in {}", situation.scene_id());
            assert_eq!(compiled.decision.search_rollouts, Some(told.len()), "every rollout counts");
            assert!(told.len() <= 8 && told.len() <= compiled.decision.actors[0].candidates);
            apart += usize::from(told[0] < most);
        }
        assert!(apart > 0, "{feature} is the same of all candidates in every scene");
    }
}

#[test]
fn one_rehearsal_is_the_parents_own_choice_in_every_family_that_takes_the_best() {
    let best = |source: &&Source| source.parent.operator_graph.values().any(|node| node.kind == "best_choice");
    let mut families = 0;
    for source in sources_by_hand().iter().filter(best) {
        families += 1;
        let program = rehearsed(source, 1, "if(rehearsed_met, 1, 0)");
        let parent = Prepared::new(&source.parent, source).unwrap();
        let once = Prepared::new(&program, source).unwrap();
        for situation in &situations()[..6] {
            let [own, tried] = [&parent, &once].map(|of| of.compile(situation, Seed(7)).unwrap());
            assert_eq!(own.intervention, tried.intervention, "{} in {}", source.contract.family, situation.scene_id());
            let expected = tried.decision.applies.then_some(1);
            assert!(own.decision.search_rollouts.is_none());
            assert_eq!(tried.decision.search_rollouts.filter(|_| situation.scene.staging.is_none()), expected);
        }
    }
    assert!(families >= 4, "{families}");
}

#[test]
fn it_is_offered_only_where_a_budget_allows_it() {
    let name = FamilyName::new("cat");
    let bare = sources().get(&name).unwrap().clone();
    let refused = |contract: &Contract, count: u32| {
        contract
            .check_program(&rehearsed(&bare, count, "if(rehearsed_met, 1, 0)"))
            .iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>()
    };
    assert!(refused(&bare.contract, 4).iter().any(|problem| problem.contains("rehearsed_choice")));
    let four = rehearsing(bare.clone(), 4);
    assert_eq!(refused(&four.contract, 4), Vec::<String>::new());
    assert!(
        refused(&four.contract, 5).iter().any(|problem| problem.contains("count")),
        "{:?}",
        refused(&four.contract, 5)
    );
    assert_eq!(rehearsing(bare.clone(), 0).contract.digest().unwrap(), bare.contract.digest().unwrap());
    assert_eq!(rehearsals_of(&rehearsed(&bare, 5, "if(rehearsed_met, 1, 0)")), 5);
    assert_eq!(rehearsals_of(&bare.parent), 0);
}

#[test]
fn a_study_goes_on_from_a_program_that_rehearses_and_its_tables_count_the_rollouts() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    well(folder, &["program", "new", "--family", "cat", "--out", "my.toml"]);
    let path = folder.join("my.toml");
    let begun = std::fs::read_to_string(&path).unwrap();
    let settings = "kind = \"rehearsed_choice\"\nsettings = { count = 4, value = { mechanism = \"worth\" } }\n";
    let module = "\n[mechanism_modules.worth]\nslot = \"rehearsal_value\"\ninputs = [\"rehearsed_met\"]\noutput = \"number\"\n\
                  expression = \"if(rehearsed_met, 1, 0)\"\ntags = [\"tries\"]\n";
    std::fs::write(&path, begun.replace("kind = \"best_choice\"\n", settings) + module).unwrap();
    well(folder, &["program", "check", "my.toml"]);
    well(folder, &["init", "mine", "--start", "my.toml", "--epochs", "1", "--slots", "1"]);
    let short =
        ["--set", "scenes.count=12", "--set", "split.held_out=4", "--set", "split.window=4", "--set", "scenes.seed=3"];
    let root = here(folder, &[&["record", "mine.toml", "--no-report"][..], &short].concat()).root();
    let table = well(folder, &["table", "metadrive-main"]);
    assert!(table.contains("Rollouts"), "{table}");
    assert_eq!(here(folder, &["check"]).root(), root);
}
