//! Numbers of a record's examinations, ready to be averaged and resampled: scenes within seeds.

use crate::evidence::tables::{PerScene, Search};
use crate::kernel::Digest;
use crate::objects::downstream::{Downstream, Examination, FixedSet, SetDriven, SetName, Trained};

/// Quantity that is read of a driven scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Read {
    /// 1 for a contact with anyone, whoever caused it.
    Crash,
    /// 1 for a contact that the ego caused or could have avoided.
    Failure,
    /// Share of the route driven.
    Completion,
    /// SafeBench's overall score of the run by itself.
    Score,
}

/// Sets, of the same scenes, on which egos were examined as adversarial ones.
pub const ADVERSARIAL: [SetName; 2] = [SetName::Original, SetName::Evolved];

/// A mean over families, sets, seeds and scenes, as the bootstrap takes it.
pub type Quantity = Vec<Search>;

/// Quantity to read, the sets, and the family; `None` reads all families of a study by family, and all scenes of another.
#[derive(Clone, Copy, Debug)]
pub struct Question<'q> {
    pub sets: &'q [SetName],
    pub read: Read,
    pub family: Option<&'q str>,
}

/// The trainings of an arm, and of a family, in the order of the seeds.
pub fn trainings<'r>(record: &'r Downstream, arm: &str, family: Option<&str>) -> Vec<&'r Trained> {
    let own = |trained: &&Trained| trained.arm == arm && trained.family.as_deref() == family;
    record.trainings.iter().filter(own).collect()
}

/// The families that a question reads.
fn families<'r>(record: &'r Downstream, asked: Option<&'r str>) -> Vec<Option<&'r str>> {
    match (asked, record.opening.families.is_empty()) {
        (None, false) => record.opening.families.iter().map(|family| Some(family.as_str())).collect(),
        (asked, _) => vec![asked],
    }
}

fn values(examination: &Examination, set: SetName, read: Read) -> Vec<f64> {
    let of = |driven: &SetDriven| -> Vec<f64> {
        let ended = |with: &str| driven.ends.chars().map(|end| f64::from(u8::from(with.contains(end)))).collect();
        match read {
            Read::Crash => ended("cf"),
            Read::Failure => ended("f"),
            Read::Completion => driven.completion.clone(),
            Read::Score => driven.score.clone(),
        }
    };
    examination.sets.iter().find(|driven| driven.set == set).map(of).unwrap_or_default()
}

/// Seeds are drawn together in all arms and families, since one seed begins with the same weights in each, and scenes in all sets,
/// since these hold the same ones.
fn search(record: &Downstream, family: Option<&str>, seeds: impl Iterator<Item = Vec<f64>>) -> Search {
    let named = |set: &FixedSet| set.scenes.concat();
    let scenes: Vec<String> = record.opening.sets.evaluation.iter().map(named).collect();
    let digest = |what: &str| Digest::of_bytes(format!("{what} {scenes:?}").as_bytes());
    let suite = digest(&format!("scenes of {family:?}"));
    let part = |values: Vec<f64>| PerScene { suite, values: values.into_iter().map(Some).collect() };
    Search { id: digest("seeds"), seeds: seeds.map(part).collect() }
}

/// The mean of examination `place` of an arm.
pub fn mean(record: &Downstream, arm: &str, place: usize, asked: Question<'_>) -> Quantity {
    let of = |(family, set): (Option<&str>, &SetName)| {
        let seeds = trainings(record, arm, family).into_iter().filter_map(|trained| trained.examinations.get(place));
        search(record, family, seeds.map(|examination| values(examination, *set, asked.read)))
    };
    let all = families(record, asked.family);
    all.into_iter().flat_map(|family| asked.sets.iter().map(move |set| (family, set))).map(of).collect()
}

/// The mean of a driver that was not trained.
pub fn reference(record: &Downstream, driver: &str, asked: Question<'_>) -> Quantity {
    let Some(found) = record.opening.references.iter().find(|known| known.driver == driver) else { return Vec::new() };
    let of = |(family, name): (Option<&str>, &SetName)| {
        let set = record.opening.sets.evaluation.iter().find(|set| set.name == *name);
        let groups: &[String] = set.map_or(&[], |set| &set.groups);
        let own = |place: usize| family.is_none_or(|family| groups.get(place).is_some_and(|group| group == family));
        let examination = Examination { updates: 0, steps: 0, sets: found.sets.clone() };
        let all = values(&examination, *name, asked.read).into_iter().enumerate();
        let values = all.filter(|(place, _)| own(*place)).map(|(_, value)| value).collect();
        search(record, family, std::iter::once(values))
    };
    let all = families(record, asked.family);
    all.into_iter().flat_map(|family| asked.sets.iter().map(move |set| (family, set))).map(of).collect()
}

/// Returns the number of examinations that every training of an arm has.
pub fn examinations(record: &Downstream, arm: &str) -> usize {
    let own = record.trainings.iter().filter(|trained| trained.arm == arm);
    own.map(|trained| trained.examinations.len()).min().unwrap_or(0)
}

/// The same of the last examination.
pub fn last(record: &Downstream, arm: &str, asked: Question<'_>) -> Quantity {
    mean(record, arm, examinations(record, arm).saturating_sub(1), asked)
}

/// An arm's number less another's at the end, paired by seed and scene.
pub fn difference(record: &Downstream, [arm, other]: [&str; 2], asked: Question<'_>) -> Quantity {
    let less = |a: &PerScene, b: &PerScene| {
        let both = a.values.iter().zip(&b.values);
        PerScene { suite: a.suite, values: both.map(|(a, b)| Some((*a)? - (*b)?)).collect() }
    };
    let pairs = last(record, arm, asked).into_iter().zip(last(record, other, asked));
    pairs
        .map(|(a, b)| Search { id: a.id, seeds: a.seeds.iter().zip(&b.seeds).map(|(a, b)| less(a, b)).collect() })
        .collect()
}
