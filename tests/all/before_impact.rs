//! MetaDrive's recorded rollouts at the moment of a contact: the state of two road users who are about to collide.

use crate::harness::home;
use evodrive::backend::{Answer, RolloutCassette};
use evodrive::sim::{ActorRef, ReportedRollout};

/// More than MetaDrive's brakes take, m/s² (16.5 measured: docs/PLANT.md).
const TYRES_MPS2: f64 = 17.0;
/// Poses are written to a micrometre; a physics step of 0.02 s may lie in between, m/s.
const ROUNDING_MPS: f64 = 0.1;

fn contacts() -> Vec<ReportedRollout> {
    let path = home().join("cassettes/agreement/metadrive-rollouts.jsonl.zst");
    let cassette = RolloutCassette::load(&path).unwrap();
    let answers = cassette.rollouts().filter_map(|(_, recorded)| match &recorded.answer {
        Answer::ReportedRollout(rollout) => rollout.contact.map(|_| rollout.clone()),
        Answer::Failed(_) => None,
    });
    answers.collect()
}

#[test]
fn no_speed_of_the_ego_jumps_at_a_contact_as_only_an_impact_can_make_it() {
    let contacts = contacts();
    assert!(contacts.len() > 150, "{}", contacts.len());
    let mut jumps = Vec::new();
    for rollout in &contacts {
        let contact = rollout.contact.unwrap();
        let [.., before, at] = &rollout.ego[..] else { continue };
        let elapsed_s = if contact.substep == 0 { 0.1 } else { 0.02 * contact.substep as f64 };
        let change_mps = (at.sample.velocity - before.sample.velocity).norm();
        if change_mps > TYRES_MPS2 * elapsed_s + ROUNDING_MPS {
            jumps.push(change_mps);
        }
    }
    assert!(jumps.is_empty(), "{} of {}: {jumps:?} m/s", jumps.len(), contacts.len());
}

#[test]
fn the_boxes_that_bullet_collided_touch_at_that_moment() {
    let (mut known, mut apart) = (0, Vec::new());
    for rollout in contacts() {
        let contact = rollout.contact.unwrap();
        let boxes = contact.boxes.expect("the worker says which boxes it collided");
        assert_eq!(boxes.ego, [4.515, 1.852]);
        let row = rollout.ego.len() - 1;
        let other = rollout.actors.iter().find(|actor| actor.who == contact.with).and_then(|actor| actor.at(row));
        // A road user that is not told follows a recording, which is not in the cassette.
        let (Some(other), ActorRef::Track(_)) = (other, contact.with) else { continue };
        let ego = &rollout.ego[row];
        let sized = |pose: &evodrive::sim::Pose, [length_m, width_m]: [f64; 2]| {
            let sample = &pose.sample;
            evodrive::kernel::OrientedBox::new(sample.position, sample.heading_rad, length_m, width_m)
        };
        apart.push(sized(ego, boxes.ego).distance(&sized(other, boxes.other)));
        known += 1;
    }
    // Bullet adds a contact a few centimetres before boxes touch: two are told 5 and 9 cm apart. One is told 0.36 m apart, for no known reason.
    let wider = |than_m: f64| apart.iter().filter(|gap_m| **gap_m > than_m).count();
    assert!(known > 200 && wider(0.05) <= 3 && wider(0.1) <= 1, "{known}: {apart:?}");
}
