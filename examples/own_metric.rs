//! A metric of one's own: the nearness of a rollout to a collision, from 0 (nobody came near) to 1 (contact).
//! It is a pure function of an outcome. It is printed beside the attack metric for scenes that CAT attacks.
//!
//! `cargo run --example own_metric`

use std::error::Error;
use std::sync::Arc;

use evodrive::compiler::{Situation, compile};
use evodrive::ego::Policy;
use evodrive::evaluation::AttackOptions;
use evodrive::evaluation::metrics::attack::attack;
use evodrive::families::sources;
use evodrive::kernel::{Seed, num};
use evodrive::objects::FamilyName;
use evodrive::sim::{ContactClass, Outcome, rollout};
use evodrive::synth::{SynthOptions, WorldKind, pool_member};

/// Options of the metric. An experiment would give them in its file; nothing has a default in code.
struct NearMissOptions {
    /// Gaps from this one on count as harmless, box to box, metres.
    gap_m_harmless: f64,
}

/// Severity in 0..=1: 1 for a contact with an adversary, else it falls linearly with the smallest gap to one. `None`
/// where the outcome has no gap: a label is measured or absent, never a made-up number.
fn near_miss(outcome: &Outcome, options: &NearMissOptions) -> Option<f64> {
    if outcome.contact.is_some_and(|contact| contact.adversary) {
        return Some(1.0);
    }
    Some(1.0 - (outcome.distance_m_min? / options.gap_m_harmless).min(1.0))
}

fn main() -> Result<(), Box<dyn Error>> {
    let worlds = SynthOptions {
        kinds: vec![WorldKind::SignalledCrossing, WorldKind::Merge, WorldKind::Roundabout],
        steps: 91,
        current_step: 10,
        warm_up_s: 12.0,
        tracks_per_scene: 20,
        pedestrian_share: 0.0,
        cyclist_share: 0.0,
        ego_travel_m_min: 10.0,
        interaction_time_s_max: 4.0,
        interaction_gap_m_max: 12.0,
        following_share: 0.2,
        attempts_max: 40,
        traffic: None,
    };
    let families = sources();
    let cat = families.get(&FamilyName::new("cat")).ok_or("no family is called cat")?;
    // Every contact with the adversary counts, whoever caused it.
    let attack_options = AttackOptions {
        counts: ContactClass::ALL.into(),
        counts_if_avoidable: [].into(),
        when: None,
        requires: Default::default(),
    };
    let options = NearMissOptions { gap_m_harmless: 5.0 };
    let mut severities = Vec::new();
    for index in 0..6 {
        let situation = Situation::new(Arc::new(pool_member(&worlds, Seed(11), index)?), &Policy::Idm)?;
        let compiled = compile(&cat.parent, cat, &situation, Seed(1))?;
        let outcome = rollout(&situation.plant, &compiled.intervention, &mut *Policy::Idm.driver())?;
        let (failed, severity) = (attack(&outcome, &attack_options), near_miss(&outcome, &options));
        println!("{:32} attack {failed:.0}, near miss {severity:?}", situation.scene_id());
        severities.extend(severity);
    }
    let mean = num::mean(&severities).ok_or("no rollout has a label")?;
    println!("mean severity over {} labelled scenes: {mean:.3}", severities.len());
    Ok(())
}
