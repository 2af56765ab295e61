//! SafeBench's archive by family and route, on groups whose scores an attempt's own table tells: one route a family.

use std::collections::BTreeMap;
use std::path::Path;

use super::tests::carried_out;
use crate::archive::{Contender, first_by_rule, hypervolume, pf_area_pct};
use crate::experiment::{Experiment, SceneSource};
use crate::objects::{FrontOf, FrontPer, Objectives, Score, SolutionId, WorldModel};
use crate::scene::EvolutionSize;
use crate::scene::safebench::TrafficFamily;

/// Human's scenes of three families on one route each, under the paper's rules.
fn small() -> Experiment {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/reproduction-safebench.toml");
    let mut experiment = Experiment::read(&file).unwrap();
    experiment.lineages.retain(|lineage| lineage.family.as_str() == "human");
    experiment.composition = None;
    experiment.roles.remove(&crate::objects::Role::TemplateAgent);
    let SceneSource::Safebench { options, .. } = &mut experiment.scenes else { panic!("staged scenes") };
    options.families = vec![TrafficFamily::LaneChanging, TrafficFamily::RightTurn, TrafficFamily::StraightObstacle];
    (options.routes, options.draws) = (vec![4, 5], 4);
    experiment.split.evolution = EvolutionSize::Count(12);
    (experiment.split.held_out, experiment.split.window) = (12, 12);
    (experiment.budget.epochs, experiment.budget.slots) = (3, 6);
    experiment.world.routing.rollout_budget = 6;
    (experiment.world.routing.lambda_a, experiment.world.routing.lambda_r) = (1.0, 1.0);
    (experiment.world_agent, experiment.world.routing.audit_share) = (None, 0.0);
    experiment.roles.remove(&crate::objects::Role::WorldAgent);
    experiment
}

/// Points of the families whose scenes the program acts in.
fn points(score: &Score) -> BTreeMap<String, Objectives> {
    let families = &score.benchmark.as_ref().expect("a table").families;
    let acting = families.iter().filter(|(_, row)| row.realism > 0.0);
    acting.map(|(name, row)| (name.clone(), Objectives { attack: row.attack, realism: row.realism })).collect()
}

fn plane(of: &Objectives) -> [f64; 2] {
    [of.attack, of.realism]
}

#[test]
fn a_child_is_accepted_where_a_group_gains_and_each_group_takes_its_own_three() {
    let experiment = small();
    assert_eq!((experiment.archive.front_per, experiment.archive.front), (FrontPer::Group, FrontOf::Evaluated));
    assert!(experiment.world.pairs.is_some() && experiment.world.model == WorldModel::Ridge);
    let ran = carried_out(&experiment);
    // A family's row of the table is a group's where evolution has one route of it.
    let areas = &ran.result.lineages[0].pf_area_at_3_pct_by_group;
    let family_of = |group: &str| group.split('/').next().unwrap_or(group).to_string();
    let routes = |family: &str| areas.keys().filter(|group| family_of(group) == family).count();
    let single = |of: BTreeMap<String, Objectives>| -> BTreeMap<String, Objectives> {
        of.into_iter().filter(|(family, _)| routes(family) == 1).collect()
    };
    let parent = single(points(&ran.frozen[0].parent_score));
    let mut known: BTreeMap<String, Vec<Objectives>> = BTreeMap::new();
    parent.iter().for_each(|(family, point)| known.entry(family.clone()).or_default().push(*point));
    let mut members: BTreeMap<String, Vec<Contender>> = BTreeMap::new();
    let (mut gained, mut without) = (0, 0);
    for attempt in &ran.attempts {
        let (Some(score), Some(decision)) = (attempt.exit.score(), attempt.exit.decision()) else { continue };
        let groups = decision.gates.groups.as_ref().expect("groups have their own archives");
        assert_eq!(decision.gates.any(), !groups.is_empty());
        let solution: SolutionId = attempt.exit.candidate().unwrap().program.solution_id.clone();
        let named = |family: &str| groups.iter().any(|group| family_of(group) == family);
        for (family, point) in single(points(score)) {
            let before: Vec<[f64; 2]> = known.get(&family).into_iter().flatten().map(plane).collect();
            let after = [before.clone(), vec![plane(&point)]].concat();
            let gain = hypervolume(&after, [0.0; 2]) - hypervolume(&before, [0.0; 2]);
            if gain > 1e-9 {
                gained += 1;
                assert!(named(&family), "{}: {family} gains {gain} and is none of {groups:?}", attempt.id);
            }
            known.entry(family.clone()).or_default().push(point);
            members.entry(family).or_default().push(Contender {
                solution: solution.clone(),
                objectives: point,
                coverage: 1.0,
            });
        }
        without += usize::from(groups.is_empty());
    }
    assert!(gained > 0 && without > 0, "{gained} gains, {without} accepted nowhere: the test tells nothing");
    for (group, area) in areas.iter().filter(|(group, _)| routes(&family_of(group)) == 1) {
        let family = family_of(group);
        let own: Vec<Objectives> = parent.get(&family).copied().into_iter().collect();
        let all = members.get(&family).cloned().unwrap_or_default();
        let first = first_by_rule(all.clone(), 3, &experiment.selector);
        let chosen: Vec<Objectives> = first
            .iter()
            .filter_map(|of| all.iter().find(|one| one.solution == *of))
            .map(|one| one.objectives)
            .collect();
        let wanted = pf_area_pct(&own, &chosen, 3, &experiment.archive);
        assert!((area - wanted).abs() < 1e-9, "{group}: {area}, by hand {wanted}");
    }
    let mut together = experiment;
    together.archive.front_per = FrontPer::Lineage;
    let other = carried_out(&together);
    assert!(other.attempts.iter().filter_map(|of| of.exit.decision()).all(|of| of.gates.groups.is_none()));
    assert!(ran.root != other.root);
}
