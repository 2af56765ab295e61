//! Finds the pairs that `compare` puts beside each other: the two programs that are named, or lineages of one name, seed by seed.

use std::collections::BTreeSet;
use std::path::Path;

use crate::cli::records::folder::RunFolder;
use crate::cli::studies::packed;
use crate::cli::terminal::exit::Failure;
use crate::evidence::RecordedRun;
use crate::objects::SolutionId;
use crate::text::nearest;

/// One side: a run, and what of it is meant.
pub struct Side {
    pub folder: RunFolder,
    pub run: RecordedRun,
    /// A lineage or a program; nothing for all lineages.
    pub part: Option<String>,
}

/// The program that a seed of a search is reported by, or the one that is meant.
#[derive(Clone)]
struct Reported {
    /// The lineage, with its seed where it has several.
    lineage: String,
    /// The lineage of the experiment file.
    search: String,
    /// Which repetition, from 0.
    seed: u32,
    solution: SolutionId,
}

/// Two programs to compare.
pub struct Pair {
    pub name: String,
    pub first: SolutionId,
    pub second: SolutionId,
}

/// A search that both sides have, one pair a seed.
pub struct Search {
    pub name: String,
    pub pairs: Vec<Pair>,
}

/// Searches that are compared, and notes on what is not.
pub struct Pairs {
    pub searches: Vec<Search>,
    pub notes: Vec<String>,
}

impl Side {
    pub fn named(name: &str) -> Result<Side, Failure> {
        let (place, part) = match name.rsplit_once(':') {
            Some((place, part)) if !Path::new(name).is_dir() => (place, Some(part.to_string())),
            _ => (name, None),
        };
        let folder = RunFolder::find(Some(Path::new(place)))?;
        let run = folder.recorded()?;
        Ok(Side { folder, run, part })
    }

    /// Lineages with the program that each is reported by, or the ones that are meant.
    fn programs(&self) -> Result<Vec<Reported>, Failure> {
        let finished = || {
            let reason = "is not finished; finish it with `evodrive resume`, or name one of its programs";
            Failure::bad_input(format!("{} {reason}", self.folder.dir.display()))
        };
        if let Some(part) = self.part.as_ref().filter(|part| part.contains('/')) {
            let solution = packed::find(&self.run, part)?.solution_id.clone();
            return Ok(vec![Reported { lineage: part.clone(), search: part.clone(), seed: 0, solution }]);
        }
        let result = self.run.result.as_ref().ok_or_else(finished)?;
        let reported = result.lineages.iter().map(|of| Reported {
            lineage: of.lineage.to_string(),
            search: of.group.to_string(),
            seed: of.replica,
            solution: of.evolved.solution.clone(),
        });
        let all: Vec<Reported> = reported.collect();
        let Some(part) = &self.part else { return Ok(all) };
        // A lineage of the file means all its seeds.
        let of = |names: fn(&Reported) -> &String| -> Vec<Reported> {
            all.iter().filter(|one| names(one) == part).cloned().collect()
        };
        let meant = [of(|one| &one.lineage), of(|one| &one.search)].into_iter().find(|meant| !meant.is_empty());
        meant.ok_or_else(|| {
            let known: BTreeSet<&str> = all.iter().flat_map(|of| [of.search.as_str(), of.lineage.as_str()]).collect();
            let near =
                nearest(part, known.iter().copied()).map_or(String::new(), |near| format!("; did you mean {near}?"));
            let (place, known) = (self.folder.dir.display(), known.into_iter().collect::<Vec<_>>().join(", "));
            Failure::bad_input(format!("{place} has no lineage {part}, expected one of {known}{near}"))
        })
    }
}

/// Returns the pairs to compare: the two that are named, or searches of one name, by seed.
///
/// # Errors
/// No search has the same name in both.
pub fn pairs(first: &Side, second: &Side) -> Result<Pairs, Failure> {
    paired(&first.programs()?, &second.programs()?)
}

fn paired(ours: &[Reported], theirs: &[Reported]) -> Result<Pairs, Failure> {
    let names = |of: &[Reported]| -> Vec<String> {
        let mut names: Vec<String> = of.iter().map(|one| one.search.clone()).collect();
        names.dedup();
        names
    };
    let (our_names, their_names) = (names(ours), names(theirs));
    // Where each side has one search, these two are meant, whatever they are called.
    let searches: Vec<(String, String)> = match (&our_names[..], &their_names[..]) {
        ([one], [other]) => vec![(one.clone(), other.clone())],
        _ => our_names
            .iter()
            .filter(|name| their_names.contains(name))
            .map(|name| (name.clone(), name.clone()))
            .collect(),
    };
    if searches.is_empty() {
        return Err(Failure::bad_input(format!(
            "no lineage has the same name in both runs: {} in the first, {} in the second; name one of each, RUN:LINEAGE",
            our_names.join(", "),
            their_names.join(", ")
        )));
    }
    let mut made = Pairs { searches: Vec::new(), notes: Vec::new() };
    let alone = |names: &[String], of: fn(&(String, String)) -> &String| -> Vec<String> {
        names.iter().filter(|name| !searches.iter().any(|pair| of(pair) == *name)).cloned().collect()
    };
    for (side, names) in [("A", alone(&our_names, |pair| &pair.0)), ("B", alone(&their_names, |pair| &pair.1))] {
        if !names.is_empty() {
            made.notes.push(format!("only {side} has {}, which is left out", names.join(", ")));
        }
    }
    for (one, other) in &searches {
        let of = |all: &[Reported], name: &String| -> Vec<Reported> {
            all.iter().filter(|of| of.search == *name).cloned().collect()
        };
        let name = if one == other { one.clone() } else { format!("{one} and {other}") };
        made.search(name, &of(ours, one), &of(theirs, other));
    }
    Ok(made)
}

impl Pairs {
    /// One search of both: seed by seed, those that one side alone has are left out.
    fn search(&mut self, name: String, ours: &[Reported], theirs: &[Reported]) {
        let pair = |(one, other): (&Reported, &Reported)| {
            let (a, b) = (&one.lineage, &other.lineage);
            let name = if a == b { a.clone() } else { format!("{a} and {b}") };
            Pair { name, first: one.solution.clone(), second: other.solution.clone() }
        };
        if let ([one], [other]) = (ours, theirs) {
            // One of each: whatever their seeds are.
            self.searches.push(Search { name, pairs: vec![pair((one, other))] });
            return;
        }
        let with = |one: &Reported, all: &[Reported]| all.iter().find(|other| other.seed == one.seed).cloned();
        let pairs: Vec<Pair> = ours.iter().filter_map(|one| Some(pair((one, &with(one, theirs)?)))).collect();
        let listed = |all: &[Reported]| all.iter().map(|of| of.seed.to_string()).collect::<Vec<_>>().join(", ");
        if pairs.is_empty() {
            let [a, b] = [ours, theirs].map(|side| side.first().map_or("", |of| of.lineage.as_str()));
            self.notes.push(format!(
                "{name}: no seed is in both (A has {}, B has {}); name one of each, e.g. A:{a} B:{b}",
                listed(ours),
                listed(theirs)
            ));
            return;
        }
        for (side, own, others) in [("A", ours, theirs), ("B", theirs, ours)] {
            let alone: Vec<Reported> = own.iter().filter(|one| with(one, others).is_none()).cloned().collect();
            if !alone.is_empty() {
                self.notes.push(format!("{name}: only {side} has the seeds {}, which are left out", listed(&alone)));
            }
        }
        self.searches.push(Search { name, pairs });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn side(search: &str, seeds: &[u32], suffixed: bool) -> Vec<Reported> {
        let one = |seed: &u32| {
            let lineage = if suffixed { format!("{search}-s{seed}") } else { search.to_string() };
            let solution = SolutionId::new(format!("{lineage}/e0s1"));
            Reported { lineage, search: search.into(), seed: *seed, solution }
        };
        seeds.iter().map(one).collect()
    }

    fn names(made: &Pairs) -> Vec<String> {
        let of = |search: &Search| {
            let pairs: Vec<&str> = search.pairs.iter().map(|pair| pair.name.as_str()).collect();
            format!("{}: {}", search.name, pairs.join(", "))
        };
        made.searches.iter().map(of).collect()
    }

    #[test]
    fn seeds_that_both_have_are_paired_and_the_others_are_named() {
        let made = paired(&side("cat", &[0, 1, 2], true), &side("cat", &[1, 2, 3], true)).unwrap();
        assert_eq!(names(&made), ["cat: cat-s1, cat-s2"]);
        let expected =
            ["cat: only A has the seeds 0, which are left out", "cat: only B has the seeds 3, which are left out"];
        assert_eq!(made.notes, expected);
    }

    #[test]
    fn one_seed_is_compared_with_the_same_one_of_several() {
        let made = paired(&side("cat", &[0], false), &side("cat", &[0, 1], true)).unwrap();
        assert_eq!(names(&made), ["cat: cat and cat-s0"]);
        assert_eq!(made.notes, ["cat: only B has the seeds 1, which are left out"]);
        let both = [side("cat", &[3], true), side("at", &[0], true)].concat();
        let made = paired(&both, &[side("cat", &[0, 1], true), side("at", &[0], true)].concat()).unwrap();
        assert_eq!(names(&made), ["at: at-s0"]);
        assert!(made.notes[0].contains("no seed is in both (A has 3, B has 0, 1)"), "{:?}", made.notes);
        assert!(made.notes[0].contains("A:cat-s3 B:cat-s0"), "{:?}", made.notes);
    }

    #[test]
    fn two_that_were_named_are_compared_whatever_their_names_and_seeds_are() {
        let made = paired(&side("cat", &[4], true), &side("at", &[1], true)).unwrap();
        assert_eq!((names(&made), made.notes.len()), (vec!["cat and at: cat-s4 and at-s1".to_string()], 0));
        let several = [side("cat", &[0], false), side("at", &[0], false)].concat();
        assert!(paired(&several, &[side("king", &[0], false), side("seal", &[0], false)].concat()).is_err());
        let made = paired(&several, &[side("at", &[0], false), side("seal", &[0], false)].concat()).unwrap();
        let left_out = ["only A has cat, which is left out", "only B has seal, which is left out"];
        assert_eq!((names(&made), made.notes), (vec!["at: at".to_string()], left_out.map(String::from).to_vec()));
    }
}
