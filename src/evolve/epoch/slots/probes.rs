//! The scenes on which a child is tried before any rollout. They are drawn so that every rule and every gate that the patch
//! touched holds in one of them, as far as the window allows; the first scenes of the window fill the rest.

use std::collections::BTreeSet;

use crate::epoch::briefs::in_effect::InScene;
use crate::objects::Program;

/// At most `probe_scenes` places of the window. A child that cannot be prepared gets the first ones: the gates say why.
pub fn probes(
    window: &[usize],
    probe_scenes: usize,
    child: &Program,
    own: Option<&Vec<InScene>>,
    parent: &Program,
    before: &[InScene],
) -> Vec<usize> {
    let wanted = probe_scenes.min(window.len());
    let Some(own) = own else { return window[..wanted].to_vec() };
    let (added, removed) = edited_rules(child, parent);
    drawn(window, wanted, |at| touched(&own[at], &before[at], &added, &removed))
}

/// The scenes in which an edited thing is met first, then the first of the others, in the window's order. `touched` is asked by place in
/// the window.
fn drawn(window: &[usize], wanted: usize, touched: impl Fn(usize) -> BTreeSet<Touch>) -> Vec<usize> {
    let mut touches: BTreeSet<Touch> = BTreeSet::new();
    let mut chosen: Vec<usize> = Vec::with_capacity(wanted);
    for (at, &place) in window.iter().enumerate() {
        let touched = touched(at);
        if chosen.len() < wanted && !touched.is_subset(&touches) {
            touches.extend(touched);
            chosen.push(place);
        }
    }
    let others: Vec<usize> = window.iter().copied().filter(|place| !chosen.contains(place)).collect();
    chosen.extend(others.into_iter().take(wanted.saturating_sub(chosen.len())));
    chosen.sort_by_key(|place| window.iter().position(|other| other == place));
    chosen
}

/// An edited thing that holds in a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Touch {
    /// A rule of the child, by its place.
    New(usize),
    /// A rule of the parent that the child does not have.
    Old(usize),
    /// The select gate opens the scene for one of the two and not for the other.
    Gate,
    /// The child acts here at all, as far as its gate says: what a guard of actors or candidates needs to be asked.
    Open,
}

/// Places of the child's rules that its parent does not have, and of the parent's that the child does not have.
fn edited_rules(child: &Program, parent: &Program) -> (Vec<usize>, Vec<usize>) {
    let strange = |of: &Program, other: &Program| {
        let rules = of.scenario_conditioned_policy.iter().enumerate();
        rules.filter(|(_, rule)| !other.scenario_conditioned_policy.contains(rule)).map(|(place, _)| place).collect()
    };
    (strange(child, parent), strange(parent, child))
}

fn touched(new: &InScene, old: &InScene, added: &[usize], removed: &[usize]) -> BTreeSet<Touch> {
    let hold = |of: &InScene, edited: &[usize]| {
        of.rules.iter().copied().filter(|rule| edited.contains(rule)).collect::<Vec<usize>>()
    };
    let rules = hold(new, added).into_iter().map(Touch::New);
    let gone = hold(old, removed).into_iter().map(Touch::Old);
    let gate = (new.opens != old.opens).then_some(Touch::Gate);
    rules.chain(gone).chain(gate).chain(new.opens.then_some(Touch::Open)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compiler::Prepared;
    use crate::families::sources;
    use crate::objects::{FamilyName, ParameterValue, PolicyRule};
    use crate::scene::fixture::two_lane_scene;
    use crate::scene::{LaneGraph, SceneFeatures};
    use crate::stage::scene_values;
    use std::collections::BTreeMap;

    fn rule(name: &str, when: &str) -> PolicyRule {
        let parameters = BTreeMap::from([("duration_s".to_string(), ParameterValue::Number(3.0))]);
        PolicyRule { name: name.into(), when: when.into(), parameters, operators: BTreeMap::new() }
    }

    fn values_of(vehicles: usize) -> Vec<f64> {
        let mut scene = two_lane_scene();
        scene.tracks = (0..vehicles).map(|_| scene.tracks[0].clone()).collect();
        scene.objects_of_interest.clear();
        scene_values(&SceneFeatures::of(&scene, &LaneGraph::of(&scene.road)))
    }

    #[test]
    fn a_rule_that_holds_in_the_last_scene_only_is_tried_there() {
        let source = sources().get(&FamilyName::new("cat")).unwrap().clone();
        let (mut parent, mut child) = (source.parent.clone(), source.parent.clone());
        parent.scenario_conditioned_policy =
            vec![rule("kept", "vehicle_count >= 1"), rule("gone", "vehicle_count >= 8")];
        child.scenario_conditioned_policy = vec![rule("kept", "vehicle_count >= 1"), rule("new", "vehicle_count >= 9")];
        let (new, old) = (Prepared::new(&child, &source).unwrap(), Prepared::new(&parent, &source).unwrap());
        let (added, removed) = edited_rules(&child, &parent);
        assert_eq!((&added[..], &removed[..]), (&[1][..], &[1][..]));
        let in_scenes = |of: &Prepared<'_>| -> Vec<InScene> {
            (1..=9).map(|vehicles| InScene::of(of, &values_of(vehicles)).unwrap()).collect()
        };
        let (new, old) = (in_scenes(&new), in_scenes(&old));
        let window: Vec<usize> = (0..9).collect();
        let touches = drawn(&window, 3, |at| touched(&new[at], &old[at], &added, &removed));
        assert_eq!(touches, [0, 7, 8], "the first scene, the one of the rule that is gone, the one of the new rule");
        let nothing_edited = drawn(&window, 3, |at| touched(&old[at], &old[at], &[], &[]));
        assert_eq!(nothing_edited, [0, 1, 2]);
    }
}
