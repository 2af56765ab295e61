//! Signatures of the SafeBench sources: each mechanism against the toy that could stand in its place, random search of
//! equal budget, paired over scenes and seeds of the search, on the mechanism's own objective.

use std::sync::Arc;

use super::{adv_traj, advsim, chatscene, human, profile_search};
use crate::adapters::Family;
use crate::ego::Policy;
use crate::kernel::{Seed, num};
use crate::motion::Scripted;
use crate::motion::script_space::PROFILE_VALUES;
use crate::motion::traffic_family::{actions, standard};
use crate::objects::{ParameterValue, Setting};
use crate::scene::safebench::{Stage as Places, TrafficFamily};
use crate::sim::Scripts;
use crate::stage::{Operator, Part, Settings, Situation, Stage, scripted};
use crate::synth::family_scene;

const ROUTES: [u32; 3] = [5, 8, 12];
const SEEDS: [u64; 4] = [1, 2, 3, 4];
/// Seeds of the searches by queries, whose gain over random profiles is a small one beside its spread.
const QUERY_SEEDS: u64 = 12;

fn situations() -> Vec<Situation> {
    let scenes = TrafficFamily::ALL.into_iter().flat_map(|family| ROUTES.map(|route| (family, route)));
    scenes
        .map(|(family, route)| Situation::new(Arc::new(family_scene(family, route, Seed(7))), &Policy::Idm).unwrap())
        .collect()
}

fn family_of(situation: &Situation) -> TrafficFamily {
    situation.scene.staging.as_ref().unwrap().family
}

/// The settings that a parent gives one of its nodes.
fn settings(family: &Family, node: &str) -> Settings {
    let mut settings = Settings::default();
    for (name, setting) in &family.parent.operator_graph[node].settings {
        match setting {
            Setting::Number(number) => drop(settings.numbers.insert(name.clone(), *number)),
            Setting::Choice(word) => drop(settings.words.insert(name.clone(), word.clone())),
            Setting::Parameter(reference) => match &family.parent.parameters[&reference.parameter] {
                ParameterValue::Number(number) => drop(settings.numbers.insert(name.clone(), *number)),
                ParameterValue::Choice(word) => drop(settings.words.insert(name.clone(), word.clone())),
            },
            Setting::Mechanism(_) => {}
        }
    }
    settings
}

fn stage(situation: &Situation, seed: u64) -> Stage<'_> {
    Stage { situation, seed: Seed(seed), counsel: None }
}

/// Returns the parts that a motion operator opens in a scene.
fn opened(stage: &Stage<'_>, motion: Operator, settings: &Settings) -> Vec<Part> {
    let actor = super::staged::actor(stage, &Settings::default()).unwrap()[0];
    let from_step = stage.situation.first_step();
    let steps = stage.situation.scene.steps - from_step;
    let window = crate::motion::Window { from_step, steps };
    let mut parts = vec![Part { actor, window, candidates: vec![], offsets: None, driven: None, simulated: 0 }];
    motion(stage, settings, &mut parts).unwrap();
    parts
}

fn scenarios(part: &Part) -> impl Iterator<Item = &Scripted> {
    part.candidates.iter().filter_map(|candidate| candidate.scripted.as_deref())
}

/// The mean of paired differences over its standard error: beyond 2 the difference is no chance.
fn paired_t(differences: &[f64]) -> (f64, f64) {
    let mean = num::mean(differences).unwrap();
    let squares: Vec<f64> = differences.iter().map(|d| (d - mean) * (d - mean)).collect();
    let error = (num::mean(&squares).unwrap() / differences.len() as f64).sqrt();
    (mean, mean / error.max(1e-12))
}

/// Least loss of the source's queries, and of as many profiles drawn at random.
fn profile_losses(stage: &Stage<'_>, family: &Family, motion: Operator, prefix: &str) -> Option<(f64, f64)> {
    let mut parts = opened(stage, motion, &settings(family, "motion"));
    let space = parts[0].candidates.first()?.scripted.clone()?.space.clone()?;
    let search = settings(family, "search");
    profile_search::search(stage, &search, prefix, None, &mut parts).unwrap();
    let losses = scenarios(&parts[0]).map(Scripted::loss).fold(f64::INFINITY, f64::min);
    let mut stream = stage.stream("random", 0);
    let mut random = f64::INFINITY;
    for _ in 0..search.count(&format!("{prefix}query_count")).unwrap() {
        let place: Vec<f64> = (0..PROFILE_VALUES).map(|_| stream.unit()).collect();
        let (situation, from_step) = (stage.situation, parts[0].window.from_step);
        let drawn = scripted::simulated(situation, space.actions(&place), space.adversary, from_step, None)?;
        let drawn = drawn.scripted?;
        random = random.min(drawn.loss());
        if drawn.contact {
            break;
        }
    }
    Some((losses, random))
}

fn search_beats_random(family: &Family, motion: Operator, prefix: &str) {
    let situations = situations();
    let pairs: Vec<(TrafficFamily, f64, f64)> = situations
        .iter()
        .flat_map(|situation| (1..=QUERY_SEEDS).map(move |seed| (situation, seed)))
        .filter_map(|(situation, seed)| {
            let (losses, random) = profile_losses(&stage(situation, seed), family, motion, prefix)?;
            Some((family_of(situation), losses, random))
        })
        .collect();
    for of in TrafficFamily::ALL {
        let own: Vec<&(TrafficFamily, f64, f64)> = pairs.iter().filter(|(f, ..)| *f == of).collect();
        let mean = |x: &dyn Fn(&(TrafficFamily, f64, f64)) -> f64| {
            num::mean(&own.iter().map(|pair| x(pair)).collect::<Vec<f64>>()).unwrap_or(f64::NAN)
        };
        let contact = |loss: f64| if loss < 0.0 { 1.0 } else { 0.0 };
        println!(
            "{prefix} {}: contacts {:.2} {:.2}, losses {:.2} {:.2}",
            of.name(),
            mean(&|p| contact(p.1)),
            mean(&|p| contact(p.2)),
            mean(&|p| p.1),
            mean(&|p| p.2)
        );
    }
    assert!(pairs.len() > 80, "{}", pairs.len());
    let (mean, t) = paired_t(&pairs.iter().map(|(_, found, random)| random - found).collect::<Vec<f64>>());
    println!("{prefix} random search loses {mean:.3} more over {} pairs, t = {t:.2}", pairs.len());
    assert!(mean > 0.0 && t > 2.0, "random search loses {mean} more, t = {t}");
}

#[test]
fn advsim_s_queries_find_less_loss_than_random_profiles_of_equal_budget() {
    search_beats_random(&advsim::family(), advsim::motion, "speed_");
}

#[test]
fn the_at_port_s_queries_find_less_loss_than_random_profiles_of_equal_budget() {
    search_beats_random(&adv_traj::family(), adv_traj::motion, "lateral_");
}

#[test]
fn chatscene_s_shrinking_ranges_make_more_samples_collide_than_ranges_that_stay() {
    let family = chatscene::family();
    let (motion, search) = (settings(&family, "motion"), settings(&family, "search"));
    let mut stays = search.clone();
    // No step is ever reached: the toy draws from the same ranges with the same stream.
    stays.numbers.insert("shrink_every".into(), 1e3);
    let situations = situations();
    let mut differences = Vec::new();
    for situation in &situations {
        let (mut ours, mut toys) = (0, 0);
        for seed in SEEDS {
            let stage = stage(situation, seed);
            let contacts = |search: &Settings| {
                let mut parts = opened(&stage, chatscene::motion, &motion);
                chatscene::search(&stage, search, &mut parts).unwrap();
                scenarios(&parts[0]).filter(|scenario| scenario.contact).count()
            };
            let (shrinking, random) = (contacts(&search), contacts(&stays));
            (ours, toys) = (ours + shrinking, toys + random);
            differences.push(shrinking as f64 - random as f64);
        }
        println!("{}: contacts {ours}, without shrinking {toys}", situation.scene_id());
    }
    let (mean, t) = paired_t(&differences);
    println!("shrinking gives {mean:.3} contacts more of 12, t = {t:.2}");
    assert!(mean > 0.0 && t > 2.0, "shrinking gives {mean} contacts more, t = {t}");
}

#[test]
fn templates_reach_the_ego_in_every_traffic_family_also_where_it_changes_lane_or_passes() {
    let family = chatscene::family();
    let (motion, search) = (settings(&family, "motion"), settings(&family, "search"));
    let mut reached = [0; 8];
    for situation in situations() {
        let met = SEEDS.into_iter().any(|seed| {
            let stage = stage(&situation, seed);
            let mut parts = opened(&stage, chatscene::motion, &motion);
            chatscene::search(&stage, &search, &mut parts).unwrap();
            scenarios(&parts[0]).any(|scenario| scenario.contact)
        });
        reached[family_of(&situation).number() - 1] += usize::from(met);
    }
    println!("scenes of 3 in which some template of chatscene meets the ego: {reached:?}");
    assert!(reached.iter().all(|scenes| *scenes > 0), "{reached:?}");
}

#[test]
fn every_member_of_human_s_grid_is_set_off_in_every_scene() {
    let family = human::family();
    let motion = settings(&family, "motion");
    for situation in situations() {
        let stage = stage(&situation, 1);
        let parts = opened(&stage, human::motion, &motion);
        assert!(parts[0].candidates.len() >= 9, "{}: {}", situation.scene_id(), parts[0].candidates.len());
        for candidate in &parts[0].candidates {
            let moves = candidate.samples.iter().any(|sample| sample.speed_mps() > 0.0);
            assert!(moves, "{}: a member of the grid stands still", situation.scene_id());
        }
        let places = Places::of(&situation.scene).unwrap();
        assert!(actions(&places, &standard(family_of(&situation)), Scripts::AsDefined).is_ok());
    }
}
