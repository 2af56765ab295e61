//! Places where a slot of a detailed question looks first: those that the parent's scenes suggest and the family can follow, with the
//! numbers that suggest them.

use std::collections::BTreeMap;

use crate::adapters::Contract;
use crate::agents::{Cluster, ParentOutcome, SceneRow, TargetKind};
use crate::objects::Slot;

/// Condition that must hold so that an instruction can be followed.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Needs {
    Nothing,
    /// A front of more than the parent.
    OtherMembers,
    /// A parent that is a child itself.
    InheritedEdits,
}

/// Findings on a parent from the window, and what its family can edit.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// Scenes with a label.
    scenes: usize,
    /// Outcome -> scenes.
    outcomes: BTreeMap<&'static str, usize>,
    near_misses: usize,
    /// The cluster with most scenes of the window in which no attack came about, and how many.
    spared: Option<(String, usize)>,
    /// The diagnostic with the lowest mean, and how many scenes fall below half of it.
    weakest: Option<(String, f64, usize)>,
    /// Parts that the family offers.
    can: Can,
    /// True if questions tell what the ego sees.
    sight: bool,
}

/// Parts of a family's contract that an instruction needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Can {
    choose_actors: bool,
    time: bool,
    score: bool,
    filter: bool,
    obey: bool,
    several: bool,
}

/// Outcomes of contacts that do not count.
const UNCOUNTED: [&str; 5] = ["anyway", "unmoved", "bystander", "unavoidable", "not_counted"];

impl Seen {
    /// Collects it from all rows of a window. `sight`: true if questions tell what the ego sees, and may speak of it.
    pub fn of(
        rows: &[SceneRow],
        clusters: &[Cluster],
        outcome: &ParentOutcome,
        contract: &Contract,
        sight: bool,
    ) -> Seen {
        let mut outcomes: BTreeMap<&'static str, usize> = BTreeMap::new();
        rows.iter().for_each(|row| *outcomes.entry(row.outcome).or_default() += 1);
        let labelled = |cluster: &Cluster| cluster.outcomes.values().sum::<usize>();
        let spared = clusters.iter().filter(|cluster| cluster.attacked_share == Some(0.0));
        let spared = spared.map(|cluster| (cluster.name.clone(), labelled(cluster)));
        let spared = spared.reduce(|best, next| if next.1 > best.1 { next } else { best });
        let weakest = outcome.weakest_diagnostic().filter(|name| outcome.diagnostics[*name] < 0.999).map(|name| {
            let low = rows.iter().filter(|row| row.diagnostics.get(name).is_some_and(|value| *value < 0.5));
            (name.to_string(), outcome.diagnostics[name], low.count())
        });
        let kinds = |slot: Slot| contract.operators.get(&slot).map_or(0, Vec::len);
        let actors = contract.operators.get(&Slot::Actor).into_iter().flatten();
        let several = actors.into_iter().any(|kind| kind.settings.contains_key("count"));
        let can = Can {
            choose_actors: kinds(Slot::Actor) > 1,
            time: kinds(Slot::Timing) > 1,
            score: contract.mechanism_slots.contains_key("candidate_score"),
            filter: kinds(Slot::Filter) > 0,
            obey: kinds(Slot::Law) > 0,
            several,
        };
        let near_misses = outcome.near_misses.unwrap_or_default();
        Seen { scenes: rows.len(), outcomes, near_misses, spared, weakest, can, sight }
    }

    fn count(&self, outcomes: &[&str]) -> usize {
        outcomes.iter().map(|outcome| self.outcomes.get(outcome).copied().unwrap_or_default()).sum()
    }

    /// Instructions for a kind of target, those with most scenes behind them first. `meets` says whether what one needs is there.
    pub fn instructions(&self, kind: TargetKind, meets: impl Fn(Needs) -> bool) -> Vec<String> {
        match kind {
            TargetKind::RaiseAttack => self.attack(),
            TargetKind::RaiseRealism => self.realism(),
            TargetKind::Diversify => self.portfolio(meets),
        }
    }

    fn attack(&self) -> Vec<String> {
        let (scenes, can) = (self.scenes, self.can);
        let far = self.count(&["never_close"]);
        let (missed, braked) = (self.count(&["missed"]), self.count(&["ego_braked"]));
        let (blocked, uncounted) = (self.count(&["blocked"]), self.count(&UNCOUNTED));
        let mut all: Vec<(usize, String)> = Vec::new();
        if far > 0 && can.choose_actors {
            all.push((far, format!("In {far} of {scenes} scenes no adversary comes near: look at who is chosen there, and at who would come near.")));
        }
        if far + missed > 0 && can.time {
            all.push((far + missed, format!("In {} of {scenes} scenes nobody is met and the ego need not brake: look at when the change begins and how long it lasts.", far + missed)));
        }
        if braked > 0 {
            let look =
                if self.sight { "at what it sees when (`how`), and whom it does not heed" } else { "at when (`how`)" };
            all.push((braked, format!("In {braked} of {scenes} scenes the ego brakes in time: look {look}.")));
        }
        if self.near_misses > 0 {
            all.push((
                self.near_misses,
                format!(
                    "{} scenes are near misses: what is missing there, a metre or half a second?",
                    self.near_misses
                ),
            ));
        }
        if uncounted > 0 {
            let which = UNCOUNTED.iter().filter_map(|name| Some((name, *self.outcomes.get(name)?)));
            let which = which.map(|(name, count)| format!("{count} {name}")).collect::<Vec<_>>().join(", ");
            all.push((uncounted, format!("{uncounted} contacts do not count ({which}): make them of another class, later visible or with somebody else.")));
        }
        if blocked > 0 && can.filter {
            all.push((blocked, format!("In {blocked} scenes an adversary hits somebody else: keep candidates clear of bystanders, or choose another adversary.")));
        }
        if let Some((cluster, count)) = self.spared.as_ref().filter(|(_, count)| *count > 0) {
            all.push((
                *count,
                format!("{cluster} has {count} scenes of the window and no attack: something for these scenes alone."),
            ));
        }
        all.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
        let mut all: Vec<String> = all.into_iter().map(|(_, text)| text).collect();
        if can.score {
            all.push("Look at which candidate wins (`took`): score what makes a contact that counts, of the size of what is ranked.".into());
        }
        if can.several {
            all.push(
                "Look at how many adversaries act, and at another operator kind in a slot that was not changed yet."
                    .into(),
            );
        }
        if can.obey {
            all.push(
                "Look at what an adversary does once the ego has answered: a law that takes over when it is near."
                    .into(),
            );
        }
        all
    }

    fn realism(&self) -> Vec<String> {
        let can = self.can;
        let mut all = Vec::new();
        if let Some((name, mean, low)) = &self.weakest {
            let how =
                if can.filter { "refuse or devalue the candidates that break it" } else { "give up what breaks it" };
            all.push(format!(
                "{name} costs most: {mean:.3} in the mean, below .5 in {low} of {} scenes; {how}.",
                self.scenes
            ));
            all.push(format!("Look at what the scenes with the lowest {name} have in common: a rule for these alone."));
        }
        if can.filter {
            all.push("Look at bounds and limits: tighten the one that costs the least attack.".into());
        }
        if can.choose_actors {
            all.push("Look at who is chosen: an adversary from where the contact needs no violent motion.".into());
        }
        if can.time {
            all.push("Look at timing: an earlier or longer change needs less acceleration.".into());
        }
        all
    }

    fn portfolio(&self, meets: impl Fn(Needs) -> bool) -> Vec<String> {
        let mut all = Vec::new();
        if meets(Needs::OtherMembers) {
            all.push("Take the mechanism of another member of the front and add it to the parent.".into());
        }
        all.push("Use a mechanism slot, an operator kind or a scene feature that no past edit used.".into());
        if self.can.obey {
            all.push("Use a slot of the contract that the parent leaves empty, such as a law, or a fallback between two ways.".into());
        }
        if self.count(&["attack"]) > 0 {
            all.push("Split the scenes: the parent's behaviour where it attacks, another one elsewhere.".into());
        }
        if self.weakest.is_some() {
            all.push("Trade: give up attack where a diagnostic is low, and seek it where realism is high.".into());
        }
        if meets(Needs::InheritedEdits) {
            all.push(
                "Undo an inherited edit that costs more than it brings, and put a simpler one in its place.".into(),
            );
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::families::sources;
    use crate::objects::{FamilyName, Objectives};

    fn seen(outcomes: &[(&'static str, usize)], family: &str) -> Seen {
        let row = |outcome: &'static str| SceneRow {
            scene: "s".into(),
            cluster: "leads".into(),
            tags: vec![],
            actors: vec![],
            attack: 0.0,
            outcome,
            contact: None,
            nearest_m: None,
            note: String::new(),
            diagnostics: BTreeMap::from([("bounded_jerk".into(), 0.2)]),
            metrics: BTreeMap::new(),
            encounter: None,
        };
        let rows: Vec<SceneRow> =
            outcomes.iter().flat_map(|(name, count)| std::iter::repeat_n(*name, *count)).map(row).collect();
        let outcome = ParentOutcome {
            objectives: Objectives { attack: 0.1, realism: 0.9 },
            scenes: rows.len(),
            failures: 0,
            coverage: 1.0,
            diagnostics: BTreeMap::from([("bounded_jerk".into(), 0.6)]),
            near_misses: Some(0),
        };
        let sources = sources();
        Seen::of(&rows, &[], &outcome, &sources.get(&FamilyName::new(family)).unwrap().contract, true)
    }

    #[test]
    fn what_most_scenes_speak_for_comes_first_and_what_none_speaks_for_is_not_asked() {
        let asked =
            |outcomes: &[(&'static str, usize)]| seen(outcomes, "cat").instructions(TargetKind::RaiseAttack, |_| true);
        let braked = asked(&[("ego_braked", 9), ("never_close", 2), ("blocked", 1)]);
        assert!(braked[0].contains("9 of 12 scenes the ego brakes"), "{braked:?}");
        assert!(
            braked.iter().all(|text| !text.contains("do not count") && !text.contains("near misses")),
            "{braked:?}"
        );
        let uncounted = asked(&[("ego_braked", 1), ("unavoidable", 5), ("anyway", 2)]);
        assert!(uncounted[0].contains("7 contacts do not count (2 anyway, 5 unavoidable)"), "{uncounted:?}");
    }

    #[test]
    fn a_family_is_asked_for_nothing_that_it_cannot_edit() {
        let all = |family: &str| {
            let seen = seen(&[("never_close", 5), ("missed", 3), ("blocked", 2)], family);
            let kinds = [TargetKind::RaiseAttack, TargetKind::RaiseRealism, TargetKind::Diversify];
            kinds.into_iter().flat_map(|kind| seen.instructions(kind, |_| true)).collect::<Vec<_>>().join("\n")
        };
        assert!(all("cat").contains("when the change begins") && all("cat").contains("a law"));
        // SafeBench's families have one kind of actor and of timing, and no law.
        let staged = all("advsim");
        assert!(!staged.contains("when the change begins") && !staged.contains("law"), "{staged}");
        assert!(!staged.contains("who is chosen"), "{staged}");
    }
}
