//! A downstream study as it is recorded: which sets were fixed before training began, and how egos that were trained on them drive.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

use crate::kernel::Digest;

/// Name and version of the record's format.
pub const FORMAT: &str = "evodrive-downstream/1";

/// A set of scenes that a study fixes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SetName {
    /// The scenes that the generators play, as they are.
    Plain,
    /// An equal number of other scenes, as they are; none for evaluation.
    Benign,
    /// The plain ones as the parent program plays them.
    Original,
    /// The plain ones as the evolved program plays them.
    Evolved,
}

impl SetName {
    /// Returns the name in study files and tables.
    pub fn name(self) -> &'static str {
        match self {
            SetName::Plain => "plain",
            SetName::Benign => "benign",
            SetName::Original => "original",
            SetName::Evolved => "evolved",
        }
    }
}

/// Facts of a set that are fixed before the first training begins.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FixedSet {
    /// Which one.
    pub name: SetName,
    /// Digest of every scene's content and of others' motion there under the program, in order.
    pub digest: Digest,
    /// Ids of its scenes.
    pub scenes: Vec<String>,
    /// The traffic family of each, in a study by family.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub groups: Vec<String>,
}

impl FixedSet {
    /// Returns the number of its scenes that a training is examined on: those of its family, or all.
    fn count(&self, family: Option<&str>) -> usize {
        match family {
            None => self.scenes.len(),
            Some(family) => self.groups.iter().filter(|group| *group == family).count(),
        }
    }
}

/// The sets of a study.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FixedSets {
    /// Arms draw their scenes from these.
    pub training: Vec<FixedSet>,
    /// Every arm is examined on all of these.
    pub evaluation: Vec<FixedSet>,
}

/// The first line of a record: all that the trainings depend on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Opening {
    /// [`FORMAT`].
    pub format: String,
    /// Name of the study.
    pub name: String,
    /// Its sentence for tables and figures.
    pub describes: String,
    /// Digest of schedule, arms, seeds, simulator and sets.
    pub recipe: Digest,
    /// Digest of the program file whose parent and program are the two generators.
    pub program: Digest,
    /// Name of the evolved program, and of its run.
    pub generator: String,
    /// Kinds of the models that proposed its patches.
    pub proposals: String,
    /// Fixed before the first training.
    pub sets: FixedSets,
    /// Arm -> sets that it is trained on, in the order of the study.
    pub arms: Vec<(String, Vec<SetName>)>,
    /// One training per arm and seed.
    pub seeds: Vec<u64>,
    /// Updates of every training.
    pub updates: u64,
    /// Number of updates that all arms make together on the plain set, before each goes on alone.
    #[serde(default, skip_serializing_if = "is_none")]
    pub plain_updates: u64,
    /// Traffic families, in a study that trains an ego for each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub families: Vec<String>,
    /// Drivers that were not trained, on the evaluation sets.
    pub references: Vec<Reference>,
}

/// A driver that nobody trained, beside the arms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// Name of the driver.
    pub driver: String,
    /// How it drives, in the order of the evaluation sets.
    pub sets: Vec<SetDriven>,
}

fn is_none(updates: &u64) -> bool {
    *updates == 0
}

/// One training of a study.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Wanted {
    /// The traffic family for which it is, in a study by family.
    pub family: Option<String>,
    /// Its arm.
    pub arm: String,
    /// Root of its random streams.
    pub seed: u64,
}

impl fmt::Display for Wanted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.family {
            Some(family) => write!(f, "{family}, {}, seed {}", self.arm, self.seed),
            None => write!(f, "{}, seed {}", self.arm, self.seed),
        }
    }
}

/// How an actor drove a set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetDriven {
    /// Which set.
    pub set: SetName,
    /// One letter per scene for how it ended: f a contact that the ego caused or could have avoided, c another contact, o off the road,
    /// a arrived, h at the scene's last step.
    pub ends: String,
    /// Share of the route driven, one number per scene.
    pub completion: Vec<f64>,
    /// SafeBench's overall score of each run by itself, where scenes are staged for its traffic families.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub score: Vec<f64>,
}

/// An examination on the way, or at the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Examination {
    /// Number of updates so far.
    pub updates: u64,
    /// Steps of the simulator driven for learning so far.
    pub steps: u64,
    /// How the actor drove each set, in the order of the evaluation sets.
    pub sets: Vec<SetDriven>,
}

/// One training: an arm with a seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trained {
    /// The traffic family for which it is, in a study by family.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub family: Option<String>,
    /// Its name.
    pub arm: String,
    /// Root of its random streams.
    pub seed: u64,
    /// Digest of the last actor's weights file.
    pub weights: Digest,
    /// The last one is of that actor.
    pub examinations: Vec<Examination>,
}

impl Trained {
    /// Which training it is.
    pub fn which(&self) -> Wanted {
        Wanted { family: self.family.clone(), arm: self.arm.clone(), seed: self.seed }
    }
}

/// A whole record: a line of JSON for the opening, then one per training, arms in order and seeds in order within each arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Downstream {
    /// Its first line.
    pub opening: Opening,
    /// Trainings, in the order of [`Opening::wanted`].
    pub trainings: Vec<Trained>,
}

/// Text that is no record of a downstream study.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct DownstreamError {
    /// Number of the line, from 1.
    pub line: usize,
    /// The value found and the value expected.
    pub problem: String,
}

impl Downstream {
    /// Returns its text.
    ///
    /// # Errors
    /// A number in it that is not finite.
    pub fn to_text(&self) -> Result<String, serde_json::Error> {
        let mut text = serde_json::to_string(&self.opening)?;
        for trained in &self.trainings {
            text.push('\n');
            text += &serde_json::to_string(trained)?;
        }
        text.push('\n');
        Ok(text)
    }

    /// Reads a record, and checks that every training is there once with all its scenes.
    ///
    /// # Errors
    /// The line that cannot be read, is of another format, or does not fit the opening.
    pub fn read(text: &str) -> Result<Downstream, DownstreamError> {
        let at = |line: usize, problem: String| DownstreamError { line, problem };
        let mut lines = text.lines().enumerate().map(|(i, line)| (i + 1, line));
        let (_, first) =
            lines.next().ok_or_else(|| at(1, "the file is empty, expected the opening of a study".into()))?;
        let opening: Opening = serde_json::from_str(first).map_err(|error| at(1, error.to_string()))?;
        if opening.format != FORMAT {
            return Err(at(1, format!("format is {:?}, expected {FORMAT:?}", opening.format)));
        }
        let wanted = opening.wanted();
        let mut trainings = Vec::new();
        for (line, text) in lines {
            let trained: Trained = serde_json::from_str(text).map_err(|error| at(line, error.to_string()))?;
            let expected = wanted.get(trainings.len());
            if expected != Some(&trained.which()) {
                let expected = expected.map_or("no further line".to_string(), Wanted::to_string);
                return Err(at(line, format!("found {}; expected {expected}", trained.which())));
            }
            opening.fits(&trained).map_err(|problem| at(line, problem))?;
            trainings.push(trained);
        }
        match wanted.get(trainings.len()) {
            None => Ok(Downstream { opening, trainings }),
            Some(next) => {
                Err(at(trainings.len() + 2, format!("the file ends, expected {next}; record the study again")))
            }
        }
    }
}

impl Opening {
    /// Returns every training in the order of the record: by family, then by arm, then by seed.
    pub fn wanted(&self) -> Vec<Wanted> {
        let of_family = |family: Option<String>| {
            let of_arm = move |arm: &(String, Vec<SetName>)| {
                let (family, arm) = (family.clone(), arm.0.clone());
                self.seeds.iter().map(move |seed| Wanted { family: family.clone(), arm: arm.clone(), seed: *seed })
            };
            self.arms.iter().flat_map(of_arm)
        };
        self.parts().into_iter().flat_map(of_family).collect()
    }

    /// Returns its traffic families, or `None` once for a study of all scenes together.
    pub fn parts(&self) -> Vec<Option<String>> {
        if self.families.is_empty() { vec![None] } else { self.families.iter().cloned().map(Some).collect() }
    }

    /// Checks that a training has all that the opening says.
    fn fits(&self, trained: &Trained) -> Result<(), String> {
        let family = trained.family.as_deref();
        let sizes: BTreeMap<SetName, usize> =
            self.sets.evaluation.iter().map(|set| (set.name, set.count(family))).collect();
        let last = trained.examinations.last().ok_or("a training without examinations")?;
        if last.updates < self.updates {
            return Err(format!("the last examination is after {} of {} updates", last.updates, self.updates));
        }
        for examination in &trained.examinations {
            if examination.sets.len() != sizes.len() {
                return Err(format!("an examination on {} of {} sets", examination.sets.len(), sizes.len()));
            }
            for driven in &examination.sets {
                let expected = sizes.get(&driven.set).copied().unwrap_or(0);
                let scored = driven.score.is_empty() || driven.score.len() == expected;
                if driven.ends.len() != expected || driven.completion.len() != expected || !scored {
                    let (ends, completions) = (driven.ends.len(), driven.completion.len());
                    let name = driven.set.name();
                    return Err(format!("set {name}: {ends} ends and {completions} completions of {expected} scenes"));
                }
                if let Some(letter) = driven.ends.chars().find(|letter| !"fcoah".contains(*letter)) {
                    return Err(format!("set {}: end {letter:?}, expected f, c, o, a or h", driven.set.name()));
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record() -> Downstream {
        let digest = Digest::of_bytes(b"set");
        let set = |name| FixedSet { name, digest, scenes: vec!["a".into(), "b".into()], groups: vec![] };
        let opening = Opening {
            format: FORMAT.into(),
            name: "made".into(),
            describes: "made".into(),
            recipe: digest,
            program: digest,
            generator: "g".into(),
            proposals: "scripted".into(),
            sets: FixedSets { training: vec![set(SetName::Plain)], evaluation: vec![set(SetName::Evolved)] },
            arms: vec![("none".into(), vec![SetName::Plain])],
            seeds: vec![1, 2],
            updates: 10,
            plain_updates: 0,
            families: vec![],
            references: vec![],
        };
        let driven =
            SetDriven { set: SetName::Evolved, ends: "ca".into(), completion: vec![0.25, 0.95], score: vec![] };
        let examinations = vec![Examination { updates: 10, steps: 40, sets: vec![driven] }];
        let trained = |seed| Trained {
            family: None,
            arm: "none".into(),
            seed,
            weights: digest,
            examinations: examinations.clone(),
        };
        Downstream { opening, trainings: vec![trained(1), trained(2)] }
    }

    #[test]
    fn what_was_written_is_read_again() {
        let record = record();
        assert_eq!(Downstream::read(&record.to_text().unwrap()).unwrap(), record);
    }

    #[test]
    fn a_record_that_lost_something_is_refused_with_its_line() {
        let text = record().to_text().unwrap();
        let refused = |text: &str| Downstream::read(text).unwrap_err().to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert!(refused("").starts_with("line 1: the file is empty"));
        assert!(refused(&lines[..2].join("\n")).contains("expected none, seed 2"));
        assert!(
            refused(&[lines[0], lines[2]].join("\n")).starts_with("line 2: found none, seed 2; expected none, seed 1")
        );
        assert!(
            refused(&format!("{text}{}\n", lines[2])).contains("line 4: found none, seed 2; expected no further line")
        );
        assert!(
            refused(&text.replace("\"ca\"", "\"c\"")).contains("set evolved: 1 ends and 2 completions of 2 scenes")
        );
        assert!(refused(&text.replace("\"ca\"", "\"cx\"")).contains("end 'x'"));
        assert!(
            refused(&text.replace("\"updates\":10,\"steps\"", "\"updates\":9,\"steps\"")).contains("9 of 10 updates")
        );
        assert!(refused(&text.replace("downstream/1", "downstream/2")).contains("expected \"evodrive-downstream/1\""));
    }
}
