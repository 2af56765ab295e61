//! Chooses the scenes to freeze: a number of each family, spread over kinds of place and classes of contact. The same
//! candidates give the same choice, in whatever order they come.

use std::collections::{BTreeMap, BTreeSet};

use crate::kernel::Digest;

/// Family of a scene in which nobody is moved.
pub const PLAIN: &str = "plain";

/// A scene that could be frozen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Candidate {
    pub family: String,
    pub scene: String,
    pub cluster: String,
    pub class: String,
    /// Digest of the program, so that programs of a family take turns.
    pub program: Digest,
    /// Digest of the scene: its draw.
    pub digest: Digest,
}

/// Number of times that each thing was taken so far.
type Taken<K> = BTreeMap<K, usize>;

/// Returns the places of the chosen candidates, in the order of family and choice: at most `count` of each family. A scene is taken once
/// per family. First comes the kind of place and contact that the family has least of, then the scene and the program that were taken least,
/// then a draw by the scene's digest.
pub fn chosen(candidates: &[Candidate], count: impl Fn(&str) -> usize) -> Vec<usize> {
    let families: BTreeSet<&str> = candidates.iter().map(|candidate| candidate.family.as_str()).collect();
    let (mut scenes, mut places) = (Taken::<&str>::new(), Vec::new());
    for family in families {
        let mut left: Vec<usize> = (0..candidates.len()).filter(|&i| candidates[i].family == family).collect();
        let (mut strata, mut classes, mut clusters) = (Taken::new(), Taken::<&str>::new(), Taken::<&str>::new());
        let mut programs = Taken::<Digest>::new();
        for _ in 0..count(family) {
            let rank = |&&i: &&usize| {
                let of = &candidates[i];
                let stratum = (of.cluster.as_str(), of.class.as_str());
                let taken = |all: &Taken<&str>, key: &str| all.get(key).copied().unwrap_or(0);
                (
                    strata.get(&stratum).copied().unwrap_or(0),
                    taken(&classes, &of.class),
                    taken(&clusters, &of.cluster),
                    taken(&scenes, &of.scene),
                    programs.get(&of.program).copied().unwrap_or(0),
                    Digest::of_bytes(format!("{} {} {}", family, of.digest, of.program).as_bytes()),
                )
            };
            let Some(&next) = left.iter().min_by_key(rank) else { break };
            let of = &candidates[next];
            *strata.entry((of.cluster.as_str(), of.class.as_str())).or_insert(0) += 1;
            *classes.entry(&of.class).or_insert(0) += 1;
            *clusters.entry(&of.cluster).or_insert(0) += 1;
            *scenes.entry(&of.scene).or_insert(0) += 1;
            *programs.entry(of.program).or_insert(0) += 1;
            left.retain(|&i| candidates[i].scene != of.scene);
            places.push(next);
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidates() -> Vec<Candidate> {
        let clusters = ["junction", "highway"];
        let one = |family: &str, program: usize, k: usize| Candidate {
            family: family.into(),
            scene: format!("s{k}"),
            cluster: clusters[usize::from(k.is_multiple_of(10))].into(),
            class: if k.is_multiple_of(7) { "cut_in" } else { "none" }.into(),
            program: Digest::of_bytes(format!("{family} {program}").as_bytes()),
            digest: Digest::of_bytes(format!("scene {k}").as_bytes()),
        };
        let of = |(family, program): (&'static str, usize)| (0..70).map(move |k| one(family, program, k));
        [("cat", 0), ("cat", 1), ("at", 0)].into_iter().flat_map(of).collect()
    }

    #[test]
    fn rare_places_and_contacts_are_taken_as_often_as_common_ones_and_no_scene_twice_in_a_family() {
        let all = candidates();
        let places = chosen(&all, |_| 20);
        for family in ["cat", "at"] {
            let own: Vec<&Candidate> = places.iter().map(|&i| &all[i]).filter(|of| of.family == family).collect();
            assert_eq!(own.len(), 20, "{family}");
            let with = |holds: &dyn Fn(&Candidate) -> bool| own.iter().filter(|of| holds(of)).count();
            // One scene of a highway has a contact and 6 have none; 9 of a junction have one. A blind choice has 2, 2 and 3.
            assert_eq!(with(&|of| of.cluster == "highway" && of.class == "cut_in"), 1, "{family}");
            assert!(with(&|of| of.class == "cut_in") >= 8 && with(&|of| of.cluster == "highway") >= 6, "{own:?}");
            let scenes: BTreeSet<&str> = own.iter().map(|of| of.scene.as_str()).collect();
            assert_eq!(scenes.len(), 20, "{family}");
        }
        let of_program = |k: usize| {
            let program = Digest::of_bytes(format!("cat {k}").as_bytes());
            places.iter().filter(|&&i| all[i].program == program).count()
        };
        assert_eq!([of_program(0), of_program(1)], [10, 10], "programs of a family take turns");
        let shared = |scene: &str| places.iter().filter(|&&i| all[i].scene == scene).count();
        let twice = (0..70).filter(|k| shared(&format!("s{k}")) == 2).count();
        assert!(twice < 14, "another family takes other scenes where there are some: {twice}");
    }

    #[test]
    fn the_choice_hangs_on_what_is_there_and_not_on_its_order() {
        let all = candidates();
        let turned: Vec<Candidate> = all.iter().rev().cloned().collect();
        let of =
            |all: &[Candidate]| -> Vec<Candidate> { chosen(all, |_| 9).into_iter().map(|i| all[i].clone()).collect() };
        assert_eq!(of(&all), of(&turned));
        assert_eq!(chosen(&all, |family| usize::from(family == "at")).len(), 1);
    }
}
