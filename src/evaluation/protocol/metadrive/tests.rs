//! The protocol on small scenes.

use super::*;
use crate::baselines::registry;
use crate::evaluation::record::MemoryCache;
use crate::evaluation::{AttackTarget, RealismWeights};
use crate::objects::FamilyName;
use crate::scene::fixture::two_lane_scene;
use std::sync::atomic::{AtomicUsize, Ordering};

fn options() -> EvaluationOptions {
    EvaluationOptions {
        seed: Seed(11),
        attack: AttackTarget::Adversary,
        realism: RealismOptions {
            weights: RealismWeights {
                lane_validity: 0.2,
                initial_non_overlap: 0.1,
                collision_validity: 0.2,
                route_progress: 0.1,
                continuity: 0.1,
                acceleration: 0.2,
                jerk: 0.1,
            },
            off_road_tolerance_m: 1.0,
            wrong_way_tolerance_m: 10.0,
            jump_tolerance_m: 1.0,
            acceleration_bound_mps2: 6.0,
            lateral_acceleration_bound_mps2: 5.0,
            acceleration_tolerance_mps2: 4.0,
            jerk_bound_mps3: 20.0,
            jerk_tolerance_mps3: 40.0,
        },
    }
}

fn scenes() -> (Vec<SceneRef>, Vec<crate::scene::Scene>) {
    let named = |k: usize| {
        let mut scene = two_lane_scene();
        scene.id = format!("fixture-{k}");
        scene
    };
    let scenes: Vec<_> = (0..3).map(named).collect();
    (scenes.iter().map(|s| SceneRef { id: s.id.clone(), digest: s.digest() }).collect(), scenes)
}

fn run(
    cache: &MemoryCache,
    threads: usize,
    built: &AtomicUsize,
    broken: Option<usize>,
) -> Result<Score, EvaluationError> {
    let registry = registry();
    let family = registry.get(&FamilyName::new("cat")).unwrap();
    let (refs, scenes) = scenes();
    let provide = |i: usize| {
        built.fetch_add(1, Ordering::SeqCst);
        let mut scene = scenes[i].clone();
        if broken == Some(i) {
            scene.ego.route.clear();
        }
        Situation::new(Arc::new(scene), &ego::Policy::Idm).map(Arc::new)
    };
    let pool = Pool::new(threads).unwrap();
    let program = &family.parent;
    evaluate(program, &family.contract, &refs, &provide, &ego::Policy::Idm, &options(), cache, &pool)
}

#[test]
fn a_recorded_rollout_needs_no_prepared_scene_and_gives_the_same_score() {
    let (cache, built) = (MemoryCache::default(), AtomicUsize::new(0));
    let first = run(&cache, 2, &built, None).unwrap();
    assert_eq!((first.scenes.len(), cache.len(), built.load(Ordering::SeqCst)), (3, 3, 3));
    let again = run(&cache, 1, &built, None).unwrap();
    assert_eq!((first, built.load(Ordering::SeqCst)), (again, 3));
}

#[test]
fn a_scene_that_fails_is_listed_and_never_scored() {
    let score = run(&MemoryCache::default(), 1, &AtomicUsize::new(0), Some(1)).unwrap();
    assert_eq!((score.scenes.len(), score.failures.len()), (2, 1));
    assert_eq!(score.failures[0].scene, "fixture-1");
}

#[test]
fn no_label_is_an_error_and_not_a_zero() {
    assert!(matches!(score_of(&[], &options()), Err(EvaluationError::NoLabel { .. })));
}
