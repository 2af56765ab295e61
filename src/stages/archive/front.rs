//! The archive: every evaluated candidate in the order of acceptance, and which of them nobody dominates.

use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

use super::{
    objectives::{ObjectivesError, admissible},
    plane::{self, point},
};
use crate::kernel::Digest;
use crate::objects::{Entry, Objectives, SolutionId, Ties, is_unsaid};

/// Entries in order of insertion. Only the serial acceptor inserts; everyone else reads.
///
/// Of entries with equal objectives the first stays on the front, or all of them do; later ones are kept and logged as duplicates.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Archive {
    entries: Vec<Entry>,
    /// Ascending places in `entries`.
    front: Vec<usize>,
    duplicates: Vec<Duplicate>,
    #[serde(default, skip_serializing_if = "is_unsaid")]
    ties: Ties,
    /// Members of each group's archive in order of entry, where groups have their own.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    groups: BTreeMap<String, Vec<SolutionId>>,
    /// Children that were not accepted and are measured on, the most promising first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    challengers: Vec<Challenger>,
}

/// A child that was not accepted and is measured on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Challenger {
    pub solution: SolutionId,
    /// Looks at it after its own epoch.
    pub looks: u32,
    /// What it gained on its parent or leader when it was last looked at, attack and realism together, 1.
    pub gain: f64,
}

/// A candidate whose objectives the front already held.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Duplicate {
    pub solution: SolutionId,
    /// The entry that came first.
    pub of: SolutionId,
}

/// Effect of an insertion on the front.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Inserted {
    pub on_front: bool,
    pub duplicate_of: Option<SolutionId>,
    /// Entries that it pushed off the front.
    pub displaced: Vec<SolutionId>,
}

/// Why an entry was refused; the archive is as it was.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ArchiveError {
    #[error("solution {solution}: {source}")]
    Objectives { solution: SolutionId, source: ObjectivesError },
    #[error("solution {0} is in the archive already; a solution is evaluated once")]
    Twice(SolutionId),
}

impl Archive {
    /// One that treats equals so.
    pub fn with(ties: Ties) -> Archive {
        Archive { ties, ..Archive::default() }
    }

    /// Adds an evaluated candidate. Its objectives must be finite rates.
    pub fn insert(&mut self, mut entry: Entry) -> Result<Inserted, ArchiveError> {
        entry.objectives = admissible(entry.objectives)
            .map_err(|source| ArchiveError::Objectives { solution: entry.solution.clone(), source })?;
        if self.entry(&entry.solution).is_some() {
            return Err(ArchiveError::Twice(entry.solution));
        }
        let duplicate_of =
            self.front().find(|other| other.objectives == entry.objectives).map(|other| other.solution.clone());
        let dominated = self.front().any(|other| other.objectives.dominates(&entry.objectives));
        let on_front = !dominated && (duplicate_of.is_none() || self.ties == Ties::All);
        let displaced = if on_front { self.displace(&entry) } else { Vec::new() };
        if let Some(of) = &duplicate_of {
            self.duplicates.push(Duplicate { solution: entry.solution.clone(), of: of.clone() });
        }
        self.entries.push(entry);
        Ok(Inserted { on_front, duplicate_of, displaced })
    }

    /// Makes room on the front for an entry that is about to be pushed.
    fn displace(&mut self, entry: &Entry) -> Vec<SolutionId> {
        let (entries, mut displaced) = (&self.entries, Vec::new());
        self.front.retain(|&place| {
            let stays = !entry.objectives.dominates(&entries[place].objectives);
            if !stays {
                displaced.push(entries[place].solution.clone());
            }
            stays
        });
        self.front.push(self.entries.len());
        displaced
    }

    /// Keeps an evaluated candidate that was not accepted: it never stands on the front.
    pub fn keep(&mut self, mut entry: Entry) -> Result<(), ArchiveError> {
        entry.objectives = admissible(entry.objectives)
            .map_err(|source| ArchiveError::Objectives { solution: entry.solution.clone(), source })?;
        if self.entry(&entry.solution).is_some() {
            return Err(ArchiveError::Twice(entry.solution));
        }
        self.entries.push(entry);
        Ok(())
    }

    /// Children that were not accepted and are measured on, the most promising first.
    pub fn challengers(&self) -> &[Challenger] {
        &self.challengers
    }

    /// Says who is measured on from now on.
    pub fn challenge(&mut self, challengers: Vec<Challenger>) {
        self.challengers = challengers;
    }

    /// Puts a kept entry among those that may stand on the front, because its gain is shown by now. It comes last in the order of
    /// acceptance, with these objectives on the scenes of this digest.
    pub fn admit(&mut self, solution: &SolutionId, objectives: Objectives, scenes: Digest) -> Result<(), ArchiveError> {
        let place = self.entries.iter().position(|entry| entry.solution == *solution);
        let Some(place) = place.filter(|place| !self.front.contains(place)) else { return Ok(()) };
        // Places behind it move up by one.
        let entry = self.entries.remove(place);
        self.front.iter_mut().filter(|other| **other > place).for_each(|other| *other -= 1);
        self.insert(Entry { objectives, scenes, ..entry }).map(drop)
    }

    /// Measures the front again on more scenes, whose list has the digest `scenes`, and drops from it whoever is dominated
    /// there or has no objectives in `fresh`. Points of one front are so always measured on the same scenes.
    pub fn relabel(&mut self, fresh: &BTreeMap<SolutionId, Objectives>, scenes: Digest) -> Result<(), ArchiveError> {
        let mut front: Vec<usize> = Vec::with_capacity(self.front.len());
        for place in std::mem::take(&mut self.front) {
            let entry = &mut self.entries[place];
            let Some(objectives) = fresh.get(&entry.solution) else { continue };
            entry.objectives = admissible(*objectives)
                .map_err(|source| ArchiveError::Objectives { solution: entry.solution.clone(), source })?;
            entry.scenes = scenes;
            front.push(place);
        }
        let points: Vec<[f64; 2]> = front.iter().map(|place| point(&self.entries[*place].objectives)).collect();
        let stays = match self.ties {
            Ties::First => plane::non_dominated(&points),
            Ties::All => plane::non_dominated_with_copies(&points),
        };
        self.front = front.into_iter().zip(stays).filter(|(_, stays)| *stays).map(|(place, _)| place).collect();
        Ok(())
    }

    /// The same entries with these programs shown as the front, in this order: what another method than the front's asks a
    /// proposer to look at. For prompts; nothing is accepted by it.
    pub fn showing(&self, shown: &[SolutionId]) -> Archive {
        let place = |solution: &SolutionId| self.entries.iter().position(|entry| entry.solution == *solution);
        Archive { front: shown.iter().filter_map(place).collect(), ..self.clone() }
    }

    /// Area that a member of the front alone dominates; 0 for anybody else.
    pub fn contribution(&self, solution: &SolutionId, reference: [f64; 2]) -> f64 {
        if !self.on_front(solution) {
            return 0.0;
        }
        let others = self.front().filter(|entry| entry.solution != *solution);
        let points: Vec<[f64; 2]> = others.map(|entry| point(&entry.objectives)).collect();
        self.hypervolume(reference) - plane::hypervolume(&points, reference)
    }

    /// Adds a program to a group's archive.
    pub fn enter(&mut self, group: String, solution: SolutionId) {
        self.groups.entry(group).or_default().push(solution);
    }

    /// Members of a group's archive, in order of entry.
    pub fn group(&self, name: &str) -> &[SolutionId] {
        self.groups.get(name).map_or(&[], Vec::as_slice)
    }

    /// Members of any group's archive, each once.
    pub fn members(&self) -> impl Iterator<Item = &SolutionId> {
        self.groups.values().flatten().collect::<BTreeSet<_>>().into_iter()
    }

    /// Everything evaluated, in order of insertion.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    pub fn entry(&self, solution: &SolutionId) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.solution == *solution)
    }

    /// The non-dominated set P_t, in order of insertion.
    pub fn front(&self) -> impl Iterator<Item = &Entry> {
        self.front.iter().filter_map(|&place| self.entries.get(place))
    }

    pub fn on_front(&self, solution: &SolutionId) -> bool {
        self.front().any(|entry| entry.solution == *solution)
    }

    pub fn duplicates(&self) -> &[Duplicate] {
        &self.duplicates
    }

    /// HV(P_t) above a reference point.
    pub fn hypervolume(&self, reference: [f64; 2]) -> f64 {
        let points: Vec<[f64; 2]> = self.front().map(|entry| point(&entry.objectives)).collect();
        plane::hypervolume(&points, reference)
    }
}

/// Small archives for this room's tests.
#[cfg(test)]
pub(super) mod samples {
    use super::*;
    use crate::objects::{FamilyName, LineageId};

    pub fn objectives([attack, realism]: [f64; 2]) -> Objectives {
        Objectives { attack, realism }
    }

    pub fn entry(name: &str, at: [f64; 2]) -> Entry {
        Entry {
            solution: SolutionId::new(name),
            attempt: None,
            program_hash: Digest::of_bytes(name.as_bytes()),
            family: FamilyName::new("cat"),
            ego: "idm".into(),
            lineage: LineageId::new("cat-idm"),
            epoch: 0,
            objectives: objectives(at),
            diagnostics: BTreeMap::new(),
            scenes: Digest::of_bytes(b"scenes"),
            sim_version: 1,
            operators: Vec::new(),
            mechanism_tags: Vec::new(),
            gates: None,
        }
    }

    pub fn archive_of(points: &[[f64; 2]]) -> Archive {
        let mut archive = Archive::default();
        for (i, at) in points.iter().enumerate() {
            archive.insert(entry(&format!("s{i}"), *at)).unwrap();
        }
        archive
    }
}

#[cfg(test)]
mod tests {
    use super::{samples::*, *};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_front_kept_by_insertion_is_the_non_dominated_set(
            points in prop::collection::vec([0..=12u32, 0..=12u32], 0..30)
        ) {
            let points: Vec<[f64; 2]> = points.iter().map(|p| p.map(|k| f64::from(k) / 12.0)).collect();
            let archive = archive_of(&points);
            let mask = plane::plain_definitions::non_dominated(&points);
            let expected: Vec<&Entry> = archive.entries().iter().zip(mask).filter(|(_, on)| *on).map(|(e, _)| e).collect();
            prop_assert_eq!(archive.front().collect::<Vec<_>>(), expected);
            prop_assert_eq!(archive.hypervolume([0.0; 2]), plane::hypervolume(&points, [0.0; 2]));
        }
    }

    #[test]
    fn whoever_is_admitted_later_stands_last_in_line_and_pushes_off_whom_it_dominates() {
        let mut archive = Archive::default();
        archive.keep(entry("late", [0.9, 0.9])).unwrap();
        archive.insert(entry("a", [0.2, 0.8])).unwrap();
        archive.insert(entry("b", [0.95, 0.1])).unwrap();
        archive.admit(&SolutionId::new("late"), objectives([0.5, 0.9]), Digest::of_bytes(b"more scenes")).unwrap();
        assert_eq!(archive.front().map(|e| e.solution.as_str()).collect::<Vec<_>>(), ["b", "late"]);
        assert_eq!(archive.entries().len(), 3);
        assert_eq!(archive.entry(&SolutionId::new("late")).unwrap().objectives, objectives([0.5, 0.9]));
        // Nobody unknown, and nobody twice.
        archive.admit(&SolutionId::new("late"), objectives([1.0, 1.0]), Digest::of_bytes(b"")).unwrap();
        archive.admit(&SolutionId::new("nobody"), objectives([1.0, 1.0]), Digest::of_bytes(b"")).unwrap();
        assert_eq!(archive.front().count(), 2);
    }

    #[test]
    fn the_first_of_equals_stays_on_the_front_and_the_rest_is_logged() {
        let archive = archive_of(&[[0.5, 0.5], [0.5, 0.5], [0.2, 0.2]]);
        assert_eq!(archive.front().map(|e| e.solution.as_str()).collect::<Vec<_>>(), ["s0"]);
        assert_eq!(archive.duplicates(), [Duplicate { solution: SolutionId::new("s1"), of: SolutionId::new("s0") }]);
        assert_eq!(archive.entries().len(), 3);
    }

    #[test]
    fn equals_stand_on_the_front_together_where_ties_say_so_also_when_it_is_measured_anew() {
        let mut archive = Archive::with(Ties::All);
        for (name, at) in [("a", [0.5, 0.5]), ("b", [0.5, 0.5]), ("c", [0.2, 0.2])] {
            archive.insert(entry(name, at)).unwrap();
        }
        let on_front = |archive: &Archive| archive.front().map(|e| e.solution.to_string()).collect::<Vec<_>>();
        assert_eq!((on_front(&archive), archive.duplicates().len()), (vec!["a".to_string(), "b".into()], 1));
        let fresh = ["a", "b"].map(|name| (SolutionId::new(name), objectives([0.4, 0.6])));
        archive.relabel(&BTreeMap::from(fresh.clone()), Digest::of_bytes(b"more")).unwrap();
        assert_eq!(on_front(&archive), ["a", "b"]);
        let mut first = archive_of(&[[0.5, 0.5], [0.6, 0.4]]);
        let names = ["s0", "s1"].map(|name| (SolutionId::new(name), objectives([0.4, 0.6])));
        first.relabel(&BTreeMap::from(names), Digest::of_bytes(b"more")).unwrap();
        assert_eq!(on_front(&first), ["s0"]);
    }

    #[test]
    fn what_a_question_shows_stands_in_its_own_order_and_changes_nothing_else() {
        let archive = archive_of(&[[0.2, 0.8], [0.5, 0.5], [0.1, 0.1]]);
        let wanted = ["s2", "unknown", "s0"].map(SolutionId::new);
        let shown = archive.showing(&wanted);
        assert_eq!(shown.front().map(|e| e.solution.as_str()).collect::<Vec<_>>(), ["s2", "s0"]);
        assert_eq!((shown.entries(), archive.front().count()), (archive.entries(), 2));
    }

    #[test]
    fn an_insertion_says_whom_it_pushed_off_the_front() {
        let mut archive = archive_of(&[[0.2, 0.8], [0.5, 0.5], [0.9, 0.1]]);
        let done = archive.insert(entry("better", [0.6, 0.8])).unwrap();
        assert!(done.on_front);
        assert_eq!(done.displaced, [SolutionId::new("s0"), SolutionId::new("s1")]);
    }

    #[test]
    fn on_more_scenes_a_member_may_turn_out_dominated_and_who_was_not_measured_leaves() {
        let mut archive = archive_of(&[[0.2, 0.8], [0.5, 0.5], [0.9, 0.1]]);
        let fresh = BTreeMap::from([
            (SolutionId::new("s0"), objectives([0.6, 0.8])),
            (SolutionId::new("s1"), objectives([0.5, 0.5])),
        ]);
        archive.relabel(&fresh, Digest::of_bytes(b"more")).unwrap();
        let front: Vec<&Entry> = archive.front().collect();
        assert_eq!(front.iter().map(|e| e.solution.as_str()).collect::<Vec<_>>(), ["s0"]);
        assert_eq!((front[0].objectives, front[0].scenes), (objectives([0.6, 0.8]), Digest::of_bytes(b"more")));
        assert_eq!(archive.entries().len(), 3);
    }

    #[test]
    fn who_was_not_accepted_is_kept_beside_the_front() {
        let mut archive = archive_of(&[[0.2, 0.2]]);
        archive.keep(entry("luck", [0.9, 0.9])).unwrap();
        assert!(!archive.on_front(&SolutionId::new("luck")) && archive.entries().len() == 2);
        assert!(archive.keep(entry("luck", [0.9, 0.9])).is_err());
    }

    #[test]
    fn a_member_contributes_what_it_alone_dominates() {
        let archive = archive_of(&[[0.2, 0.8], [0.5, 0.5]]);
        assert!((archive.contribution(&SolutionId::new("s0"), [0.0; 2]) - 0.2 * 0.3).abs() < 1e-12);
        assert_eq!(archive.contribution(&SolutionId::new("nobody"), [0.0; 2]), 0.0);
    }

    #[test]
    fn a_refused_entry_leaves_the_archive_as_it_was() {
        let mut archive = archive_of(&[[0.2, 0.8]]);
        let before = archive.clone();
        assert!(archive.insert(entry("nan", [f64::NAN, 0.5])).is_err());
        assert_eq!(archive.insert(entry("s0", [0.9, 0.9])), Err(ArchiveError::Twice(SolutionId::new("s0"))));
        assert_eq!(archive, before);
    }
}
