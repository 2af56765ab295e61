//! An episode that is driven from outside gives what a rollout gives, bit for bit: every family's parent, both
//! protocols, every kind of driver, borrowed and shared, with everything kept and with nothing.

use evodrive::compiler::{Prepared, Situation};
use evodrive::ego::{Arrays, Policy, Setting};
use evodrive::families::sources;
use evodrive::kernel::{Digest, Seed, Threads};
use evodrive::learn::fleet::{Autoreset, Fleet, FleetOptions, Kind, Seeing, Task, TaskSet, Tasks};
use evodrive::learn::{Keeps, Lesson, Reward, Ride};
use evodrive::objects::FamilyName;
use evodrive::scene::safebench::TrafficFamily;
use evodrive::sim::{
    Control, Driver, Episode, Intervention, Outcome, Plant, Repeated, rollout, rollout_assessed, rollout_counted,
    rollout_traced,
};
use evodrive::synth::{WorldKind, family_scene};
use std::collections::BTreeSet;
use std::sync::Arc;

use crate::worlds;

/// Both protocols' scenes: recorded-like traffic and staged ones.
fn situations() -> (Vec<Situation>, Vec<Situation>) {
    let prepared = |family| Situation::new(Arc::new(family_scene(family, 5, Seed(7))), &Policy::Idm).unwrap();
    let staged = TrafficFamily::ALL.into_iter().map(prepared).collect();
    (worlds::situations(&worlds::options(), 900, WorldKind::ALL.len()), staged)
}

/// Every family's parent in some scenes of its protocol.
fn acts() -> Vec<(Plant, Intervention)> {
    let (recorded, staged) = situations();
    let mut acts = Vec::new();
    for family in sources().iter() {
        let scenes = if family.contract.backend == "safebench" { &staged } else { &recorded };
        let before = acts.len();
        for situation in scenes {
            let compiled = Prepared::new(&family.parent, family).unwrap().compile(situation, Seed(1));
            if let Ok(compiled) = compiled {
                acts.push((situation.plant.clone(), compiled.intervention));
            }
        }
        assert!(acts.len() > before, "{} acts nowhere", family.contract.family);
    }
    acts
}

/// Drives from outside, and says what the driver decided.
fn driven<'a>(mut episode: Episode<'a>, driver: &mut dyn Driver) -> Episode<'a> {
    driver.begin(episode.observe().plant());
    while episode.end().is_none() {
        let control = driver.decide(&episode.observe());
        episode.step(control).unwrap();
    }
    episode
}

#[test]
fn an_episode_driven_from_outside_is_the_rollout_of_every_family_in_both_protocols() {
    let weights =
        |name: &str| Policy::learned(&std::fs::read(format!("policies/{name}.safetensors")).unwrap()).unwrap();
    let drivers = [Policy::Idm, weights("sac-metadrive"), weights("sac-safebench")];
    let (mut ends, mut avoidable) = (BTreeSet::new(), BTreeSet::new());
    for (n, (plant, act)) in acts().into_iter().enumerate() {
        let policy = &drivers[n % drivers.len()];
        let (outcome, cost) = rollout_counted(&plant, &act, policy.driver().as_mut()).unwrap();
        let labelled = rollout_assessed(&plant, &act, policy.driver().as_mut()).unwrap();
        let (traced, motion) = rollout_traced(&plant, &act, policy.driver().as_mut()).unwrap();
        assert_eq!(traced, outcome);
        let borrowed = Episode::new(&plant, &act).unwrap().keeping_controls().keeping_motion();
        let borrowed = driven(borrowed, policy.driver().as_mut());
        assert_eq!(borrowed.outcome(), Some(outcome.clone()), "{n}");
        assert_eq!(borrowed.outcome(), Some(outcome.clone()), "asked again");
        assert_eq!(borrowed.assessed().unwrap(), Some(labelled.clone()), "{n}");
        assert_eq!(borrowed.motion(), Some(&motion), "{n}");
        assert_eq!(borrowed.cost(), cost);
        assert_eq!((borrowed.end(), borrowed.contact()), (Some(outcome.end), outcome.contact.as_ref()));
        // What was decided is a driver like any other.
        let again = rollout(&plant, &act, &mut Repeated::new(borrowed.controls(), false)).unwrap();
        assert_eq!(again, outcome);
        let mut shared: Episode<'static> =
            Episode::without_account(Arc::new(plant.clone()), Arc::new(act.clone())).unwrap();
        shared = driven(shared, policy.driver().as_mut());
        assert_eq!((shared.end(), shared.contact()), (Some(outcome.end), outcome.contact.as_ref()), "{n}");
        assert_eq!(shared.route_completion(), outcome.route_completion, "{n}");
        ends.insert(format!("{:?}", outcome.end));
        avoidable.extend(labelled.contact.and_then(|contact| contact.avoidable));
    }
    assert_eq!((ends.len(), avoidable.len()), (4, 2), "{ends:?} {avoidable:?}");
}

#[test]
fn an_episode_that_is_over_stays_as_it_is_and_a_control_that_is_no_number_moves_nobody() {
    let (recorded, _) = situations();
    let act = Intervention::default();
    let mut episode = Episode::new(&recorded[0].plant, &act).unwrap().keeping_controls();
    let before = *episode.observe().ego();
    let nan = Control::Drive { acceleration_mps2: f64::NAN, steering_rad: 0.0 };
    assert!(episode.step(nan).is_err());
    assert_eq!((*episode.observe().ego(), episode.steps(), episode.controls().len()), (before, 0, 0));
    assert_eq!((episode.outcome(), episode.end()), (None, None));
    let full = Control::Drive { acceleration_mps2: 9.0, steering_rad: 0.0 };
    while episode.end().is_none() {
        episode.step(full).unwrap();
    }
    let outcome: Outcome = episode.outcome().unwrap();
    assert_eq!(episode.step(full).unwrap(), Some(outcome.end));
    assert_eq!(episode.outcome(), Some(outcome));
}

const REWARD: Reward = Reward::metadrive(10.0);

fn options(autoreset: Autoreset, seeing: impl Into<Seeing>) -> FleetOptions {
    let (assesses, keeps, seeing) = (true, true, seeing.into());
    FleetOptions { seeing, reward: REWARD, autoreset, by_failure: 1.0, assesses, keeps, keeps_motion: false }
}

/// Plain scenes, and CAT's parent in them.
fn tasks() -> Arc<Tasks> {
    let (recorded, _) = situations();
    let sources = sources();
    let cat = sources.get(&FamilyName::new("cat")).unwrap();
    let mut sets = [Vec::new(), Vec::new()];
    for (scene, situation) in recorded.iter().enumerate() {
        let plant = Arc::new(situation.plant.clone());
        let compiled = Prepared::new(&cat.parent, cat).unwrap().compile(situation, Seed(1));
        let acts = [Some(Intervention::default()), compiled.ok().map(|compiled| compiled.intervention)];
        for (set, intervention) in sets.iter_mut().zip(acts) {
            let task = |intervention| Task { scene, plant: plant.clone(), intervention: Arc::new(intervention) };
            set.extend(intervention.map(task));
        }
    }
    let shares = [0.3, 0.7];
    let sets = sets.into_iter().zip(shares).map(|(tasks, share)| TaskSet { share, tasks }).collect();
    Arc::new(Tasks::new(sets).unwrap())
}

/// Numbers that look drawn, the same everywhere: what place `i` does at step `t`.
fn action(i: usize, t: usize, which: usize) -> f32 {
    (((i * 7919 + t * 104_729 + which * 31) % 2001) as f32 - 1000.0) / 4000.0 + if which == 1 { 0.25 } else { 0.0 }
}

/// All numbers of some steps, hashed.
fn digest(tasks: &Arc<Tasks>, options: FleetOptions, threads: usize, steps: usize) -> (Digest, u64) {
    let threads = Threads::new(threads).unwrap();
    let mut fleet = Fleet::new(tasks.clone(), 24, options).unwrap();
    fleet.reset(&|_| true, None, &threads).unwrap();
    let (mut bytes, mut ended) = (Vec::new(), 0);
    for t in 0..steps {
        let actions = fleet.actions_mut();
        (0..actions.len()).for_each(|at| actions[at] = action(at / 2, t, at % 2));
        ended += fleet.step(&threads).unwrap();
        if options.autoreset == Autoreset::Disabled {
            let over: Vec<bool> = fleet.sheets().reports.end.iter().map(|end| *end >= 0).collect();
            if over.contains(&true) {
                fleet.reset(&|place| over[place], None, &threads).unwrap();
            }
        }
        let sheets = fleet.sheets();
        bytes.extend(fleet.observations().iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend(sheets.rewards.iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend(sheets.terminated.iter().chain(&sheets.truncated).chain(&sheets.reports.adversary));
        bytes.extend(sheets.reports.preventable.iter().map(|x| *x as u8));
    }
    (Digest::of_bytes(&bytes), ended as u64)
}

#[test]
fn a_fleet_drives_the_same_by_any_number_of_threads_in_every_mode() {
    let tasks = tasks();
    let arrays = Seeing { kind: Kind::Arrays(Arrays { goal: true, ..Arrays::default() }), stack: 3 };
    for seeing in [Setting::Metadrive1.into(), Setting::Safebench2.into(), arrays] {
        let mut seen = BTreeSet::new();
        for mode in [Autoreset::NextStep, Autoreset::SameStep, Autoreset::Disabled] {
            let (one, ended) = digest(&tasks, options(mode, seeing), 1, 150);
            assert_eq!(digest(&tasks, options(mode, seeing), 2, 150).0, one);
            assert_eq!(digest(&tasks, options(mode, seeing), 5, 150).0, one);
            assert!(ended > 20, "{ended} episodes");
            seen.insert(one);
        }
        // With SameStep and Disabled the same observations follow each other, but a reset clears what was said of the end.
        assert!(seen.len() > 1, "the modes differ");
    }
}

#[test]
fn what_a_fleet_says_of_an_episode_is_what_a_rollout_of_its_decisions_comes_to() {
    let tasks = tasks();
    let threads = Threads::none();
    let mut fleet = Fleet::new(tasks.clone(), 16, options(Autoreset::SameStep, Setting::Metadrive1)).unwrap();
    fleet.reset(&|_| true, None, &threads).unwrap();
    let (mut looked, mut preventable) = (0, BTreeSet::new());
    for t in 0..200 {
        let actions = fleet.actions_mut();
        (0..actions.len()).for_each(|at| actions[at] = if at % 2 == 0 { 0.0 } else { action(at / 2, t / 10, 1).abs() });
        fleet.step(&threads).unwrap();
        for place in 0..fleet.places() {
            let said = &fleet.sheets().reports;
            if said.end[place] < 0 {
                continue;
            }
            let kept = fleet.kept(place).unwrap();
            let task = &kept.task;
            let mut again = Repeated::new(&kept.controls, false);
            let outcome = rollout_assessed(&task.plant, &task.intervention, &mut again).unwrap();
            assert_eq!((said.program[place], said.scene[place]), (kept.program as i32, task.scene as i32));
            assert_eq!((said.end[place], said.length[place]), (outcome.end as i8, outcome.steps as i32));
            assert_eq!(said.route_completion[place], outcome.route_completion as f32);
            assert_eq!(said.contact_class[place], outcome.contact.map_or(-1, |contact| contact.class as i8));
            assert_eq!(said.adversary[place] == 1, outcome.contact.is_some_and(|contact| contact.adversary));
            let avoidable = outcome.contact.and_then(|contact| contact.avoidable);
            assert_eq!(said.preventable[place], avoidable.map_or(-1, i8::from));
            preventable.insert(said.preventable[place]);
            looked += 1;
        }
    }
    assert!(looked > 30 && preventable.len() == 3, "{looked} episodes, {preventable:?}");
}

#[test]
fn a_fleet_refuses_what_cannot_be_driven() {
    let tasks = tasks();
    let threads = Threads::none();
    let one = |mode| Fleet::new(tasks.clone(), 3, options(mode, Setting::Safebench1)).unwrap();
    let mut fleet = one(Autoreset::Disabled);
    assert!(fleet.step(&threads).unwrap_err().to_string().contains("before the first reset"));
    fleet.reset(&|_| true, None, &threads).unwrap();
    for bad in [f32::NAN, 1.5, f32::NEG_INFINITY] {
        fleet.actions_mut()[3] = bad;
        let said = fleet.step(&threads).unwrap_err().to_string();
        assert!(said.contains("place 1: action[1] is") && said.contains("from -1 to 1"), "{said}");
    }
    assert_eq!(fleet.steps(), 0, "nothing moved");
    fleet.actions_mut()[3] = 0.0;
    fleet.actions_mut().iter_mut().skip(1).step_by(2).for_each(|pedal| *pedal = 1.0);
    let over = (0..2000).find_map(|_| fleet.step(&threads).err()).unwrap().to_string();
    assert!(over.contains("its episode is over"), "{over}");
    assert!(fleet.reset(&|_| true, Some((7, 0)), &threads).unwrap_err().to_string().contains("program 7"));
    assert!(Fleet::new(tasks.clone(), 0, options(Autoreset::SameStep, Setting::Safebench1)).is_err());
    let shares = |shares: &[f64]| {
        let set = |share: &f64| TaskSet { share: *share, tasks: vec![] };
        Tasks::new(shares.iter().map(set).collect()).unwrap_err().to_string()
    };
    assert!(shares(&[0.0, f64::NAN]).contains("program 1 is NaN"));
    assert!(shares(&[1.0]).contains("no scene"));
    assert!(shares(&[0.0]).contains("no program has a share above 0"));
}

#[test]
fn a_ride_gives_the_observations_that_a_learned_driver_sees() {
    let (recorded, _) = situations();
    let lesson = Lesson::plain(Arc::new(recorded[1].plant.clone()));
    let mut ride = Ride::new(&*lesson.plant, &lesson.intervention, Setting::Metadrive1, Keeps::default()).unwrap();
    let (mut here, mut there) = (Vec::new(), Vec::new());
    let mut steps = 0;
    while ride.episode().end().is_none() {
        ride.observe(&mut here);
        Setting::Metadrive1.observe(&ride.view(), &mut there);
        assert_eq!(here, there);
        assert!(here.iter().all(|x| x.is_finite()));
        ride.step([0.0, 0.5], &REWARD).unwrap();
        steps += 1;
    }
    assert_eq!(ride.episode().steps(), steps);
}
