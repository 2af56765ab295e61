//! AdvSim and AT: control sequences, one number a tick, that stand in for the search.

use std::collections::BTreeMap;

use super::{Made, changed, family_name};
use crate::families::{adv_traj, advsim};
use crate::formats::ImportError;
use crate::scene::safebench::TrafficFamily;
use crate::sim::Script;

/// The program that plays these sequences.
pub fn made(file: &str, method: &str, taken: BTreeMap<TrafficFamily, Vec<f64>>) -> Result<Made, ImportError> {
    let Some(family) = family_name(method) else {
        let expected = format!("advsim or adv_trajectory as method, found {method}");
        return Err(ImportError::new(file, "its method", expected, "name one of them with --method"));
    };
    let played: Vec<&str> = taken.keys().map(|family| family.name()).collect();
    let notes = vec![format!("sequences for {}; in other traffic families the program searches", played.join(", "))];
    Ok(Made { file: changed(file, family, BTreeMap::new(), &BTreeMap::new(), taken)?, notes })
}

/// The control sequence that a script of these families plays, as SafeBench's classes read it.
///
/// # Errors
/// Why it has no such form.
pub fn sequence_of(family: &str, traffic: TrafficFamily, script: &Script) -> Result<Vec<f64>, String> {
    match family {
        advsim::NAME => advsim::sequence(traffic, script),
        adv_traj::NAME => adv_traj::sequence(traffic, script),
        other => Err(format!("a program of family {other} plays no sequence")),
    }
}

/// Checks that a script waits for the ego as the ported class does, which no sequence can change.
///
/// # Errors
/// Returns an error with the trigger distance that it has instead.
pub fn trigger_is_the_ports(family: &str, traffic: TrafficFamily, script: &Script) -> Result<(), String> {
    let ported = if family == advsim::NAME { advsim::trigger_m(traffic) } else { adv_traj::trigger_m(traffic) };
    if script.trigger.distance_m == ported {
        Ok(())
    } else {
        Err(format!(
            "it is set off at {} m, SafeBench's class at {ported} m, and a sequence says nothing of that",
            script.trigger.distance_m
        ))
    }
}
