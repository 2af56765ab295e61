//! A recorded run, read back from its transcript: what every report, table and audit starts from.

use std::collections::BTreeMap;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use serde::{Serialize, de::DeserializeOwned};

use crate::archive::ArchiveOptions;
use crate::archive::search::Method;
use crate::kernel::Digest;
use crate::objects::benchmark::{ArchiveRound, Redrawn};
use crate::objects::{
    Attempt, Composed, Counselled, LabelRules, LineageId, Role, SceneScore, Score, SolutionId, WorldEvolved,
    event::{Finalist, Frozen, HeldOut, LineageResult, Opened, ParentAdopted, RunResult, Settled, kind},
    program::Program,
    realism_name,
    replay::Replayed,
};
use crate::store::Event;

/// A transcript that is no run of this format.
#[derive(Debug, thiserror::Error)]
pub enum RecordedRunError {
    #[error("event {seq} ({kind}) cannot be read: {reason}; the run was written by another version of evodrive")]
    Unreadable { seq: u64, kind: String, reason: String },
    #[error("the transcript does not begin with an `opened` event; it is not the transcript of a run")]
    NotARun,
}

/// A run as it was recorded. A clone shares its events, which are many, until it is changed: every table and figure takes runs of its
/// own.
#[derive(Clone, Debug)]
pub struct RecordedRun(Arc<RunEvents>);

impl From<RunEvents> for RecordedRun {
    fn from(events: RunEvents) -> RecordedRun {
        RecordedRun(Arc::new(events))
    }
}

impl Deref for RecordedRun {
    type Target = RunEvents;

    fn deref(&self) -> &RunEvents {
        &self.0
    }
}

impl DerefMut for RecordedRun {
    fn deref_mut(&mut self) -> &mut RunEvents {
        Arc::make_mut(&mut self.0)
    }
}

/// All events of a run, typed, in order.
#[derive(Clone, Debug)]
pub struct RunEvents {
    pub opened: Opened,
    pub parents: Vec<ParentAdopted>,
    /// Templates that were composed; empty where no family takes templates.
    pub composed: Vec<Composed>,
    /// Advice on who attacks, scene by scene; empty where no family takes counsel.
    pub counsels: Vec<Counselled>,
    pub frozen: Vec<Frozen>,
    pub attempts: Vec<Attempt>,
    pub settled: Vec<Settled>,
    /// Turns of the world evaluator; empty without a world agent.
    pub evolved: Vec<WorldEvolved>,
    pub finalists: Vec<Finalist>,
    /// SafeBench's archive after every round; empty in other protocols.
    pub rounds: Vec<ArchiveRound>,
    pub held_out: Vec<HeldOut>,
    /// The recorded scenes without a program, by ego and suite.
    pub replays: Vec<Replayed>,
    /// Absent while the run is unfinished.
    pub result: Option<RunResult>,
    /// Hash of the last event.
    pub root: Digest,
    /// The controls of SafeBench's archives, one a lineage; none where nobody drew the parents anew. They are worked out behind the seal.
    pub redrawn: Vec<Redrawn>,
    /// Reason for the choice of a seed, as the experiment gives it. The events do not hold it: whoever has the run's folder adds it.
    pub seed_note: Option<String>,
    /// Declarations of the experiment that no event holds.
    pub declared: Declared,
}

/// Label in place of an actor's model where the search draws its patches. Labels open with their kind: this one's is `random`.
const RANDOM_PATCHES: &str = "random legal patches";

/// The kind that a model's label opens with.
pub fn kind_of(label: &str) -> &str {
    label.split(' ').next().unwrap_or_default()
}

impl RunEvents {
    /// Returns the name of the realism among its objectives, as readers see it.
    pub fn realism_name(&self) -> &'static str {
        realism_name(!self.rounds.is_empty(), self.label_rules().mean)
    }

    /// Returns the rules by which its scores were summed up.
    pub fn label_rules(&self) -> LabelRules {
        self.frozen.first().map(|frozen| frozen.parent_score.rules.clone()).unwrap_or_default()
    }

    /// Returns the label of the model that answered, by role. The opening names one for every role of the experiment. Critics are left out where
    /// none was asked; where the search drew its patches, critics and repair are left out and the actor is `random legal patches`.
    pub fn models(&self) -> BTreeMap<String, String> {
        let method = self.opened.search.as_ref().map(|search| search.method.as_str());
        let drawn = Method::ALL.iter().any(|of| of.draws_patches() && method == Some(of.name()));
        let asked =
            || self.attempts.iter().flat_map(|attempt| &attempt.proposal.exchanges).map(|exchange| exchange.role);
        let is_critic = |role: &str| Role::CRITICS.iter().any(|critic| critic.name() == role);
        let unreviewed = drawn || asked().next().is_some() && !asked().any(|role| Role::CRITICS.contains(&role));
        let mut models = self.opened.models.clone();
        models.retain(|role, _| !(unreviewed && is_critic(role) || drawn && role == Role::Repair.name()));
        if drawn {
            models.insert(Role::Actor.name().into(), RANDOM_PATCHES.into());
        }
        models
    }

    /// Roles that the scripted stand-in answered.
    pub fn scripted_roles(&self) -> Vec<String> {
        self.models().into_iter().filter(|(_, label)| kind_of(label) == "scripted").map(|(role, _)| role).collect()
    }

    /// Returns the kind of whoever proposes patches: that of the actor's model, or `random`.
    pub fn proposer(&self) -> String {
        self.models().get(Role::Actor.name()).map_or("", |label| kind_of(label)).to_string()
    }

    /// Returns the models with the roles that each answered, in one line.
    pub fn proposals_from(&self) -> String {
        let models = self.models();
        let mut roles: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        models.iter().for_each(|(role, label)| roles.entry(label).or_default().push(role));
        match roles.len() {
            1 => roles.into_keys().collect(),
            _ => roles.iter().map(|(label, of)| format!("{label} as {}", of.join(", "))).collect::<Vec<_>>().join("; "),
        }
    }
}

/// Declarations of a run's experiment that its events lack; empty where nobody read the experiment.
#[derive(Clone, Debug, Default)]
pub struct Declared {
    /// Name of the planner behind the ego [`OWN_PLANNER`].
    pub planner: Option<String>,
    /// Options by which the archive compared.
    pub archive: Option<ArchiveOptions>,
    /// Label of a model -> its `provenance`: who answered, when, how.
    pub answered: BTreeMap<String, String>,
    pub setting: Setting,
}

/// Words of a caption about an experiment; empty where nobody read it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Setting {
    /// Simulator of the run.
    pub simulator: String,
    /// Source of the scenes.
    pub pool: String,
    /// Scenes that were left out before scenes were drawn; empty where none was.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub left_out: String,
    /// Contacts that count as attacks.
    pub reading: String,
    /// Values that realism is a mean of.
    pub realism: String,
}

/// The ego that is a planner of the experimenter's own.
pub const OWN_PLANNER: &str = "command";

/// Outcome of a scene under a lineage's parent and under its chosen program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Became {
    /// The chosen program attacks, the parent does not.
    Gained,
    /// The parent attacks, the chosen program does not.
    Lost,
    Both,
    Neither,
}

impl Became {
    /// Compares the labels; a parent without one does not attack.
    pub fn of(parent: Option<&SceneScore>, chosen: &SceneScore) -> Became {
        match (parent.is_some_and(|was| was.attack > 0.0), chosen.attack > 0.0) {
            (false, true) => Became::Gained,
            (true, false) => Became::Lost,
            (true, true) => Became::Both,
            (false, false) => Became::Neither,
        }
    }
}

/// A run being read event by event: all events of a long run as JSON would need several times its memory.
#[derive(Default)]
pub struct Reading(Option<Result<RecordedRun, RecordedRunError>>);

impl Reading {
    /// Takes the next event in. What comes behind one that cannot be read is passed over.
    pub fn add(&mut self, event: Event) {
        self.0 = Some(match self.0.take() {
            None => RecordedRun::begun(event),
            Some(Ok(mut run)) => run.add(event).map(|()| run),
            Some(Err(error)) => Err(error),
        });
    }

    /// The run, or why its events cannot be read.
    pub fn finish(self) -> Result<RecordedRun, RecordedRunError> {
        self.0.unwrap_or(Err(RecordedRunError::NotARun))
    }
}

impl RecordedRun {
    /// A run from all its events.
    pub fn read(events: &[Event]) -> Result<RecordedRun, RecordedRunError> {
        let mut reading = Reading::default();
        events.iter().for_each(|event| reading.add(event.clone()));
        reading.finish()
    }

    fn begun(first: Event) -> Result<RecordedRun, RecordedRunError> {
        if first.kind != kind::OPENED {
            return Err(RecordedRunError::NotARun);
        }
        let root = first.hash;
        Ok(RecordedRun::from(RunEvents {
            opened: body(first)?,
            parents: Vec::new(),
            composed: Vec::new(),
            counsels: Vec::new(),
            frozen: Vec::new(),
            attempts: Vec::new(),
            settled: Vec::new(),
            evolved: Vec::new(),
            finalists: Vec::new(),
            rounds: Vec::new(),
            held_out: Vec::new(),
            replays: Vec::new(),
            result: None,
            root,
            redrawn: Vec::new(),
            seed_note: None,
            declared: Declared::default(),
        }))
    }

    /// An ego as people call it: a planner by its name.
    pub fn ego_name<'n>(&'n self, ego: &'n str) -> &'n str {
        self.declared.planner.as_deref().filter(|_| ego == OWN_PLANNER).unwrap_or(ego)
    }

    fn add(&mut self, event: Event) -> Result<(), RecordedRunError> {
        self.root = event.hash;
        match event.kind.as_str() {
            kind::PARENT => self.parents.push(body(event)?),
            kind::COMPOSED => self.composed.push(body(event)?),
            kind::COUNSEL => self.counsels.push(body(event)?),
            kind::FROZEN => self.frozen.push(body(event)?),
            kind::ATTEMPT => self.attempts.push(body(event)?),
            kind::SETTLED => self.settled.push(body(event)?),
            kind::WORLD => self.evolved.push(body(event)?),
            kind::FINALIST => self.finalists.push(body(event)?),
            kind::ROUND => self.rounds.push(body(event)?),
            kind::HELD_OUT => self.held_out.push(body(event)?),
            kind::REPLAY => self.replays.push(body(event)?),
            kind::SEALED => self.result = Some(body(event)?),
            _ => {
                let Event { seq, kind, .. } = event;
                return Err(RecordedRunError::Unreadable { seq, kind, reason: "unknown kind".into() });
            }
        }
        Ok(())
    }

    /// The attempt by its id, e.g. `cat-idm/e2s5`.
    pub fn attempt(&self, id: &str) -> Option<&Attempt> {
        self.attempts.iter().find(|a| a.id.as_str() == id)
    }

    /// The composition of a lineage's template, named `<lineage>/<kind>`.
    pub fn composition(&self, name: &str) -> Option<&Composed> {
        self.composed.iter().find(|composed| composed.name() == name)
    }

    /// The counsel for a scene of a lineage, named `<lineage>/<scene>`.
    pub fn counsel(&self, name: &str) -> Option<&Counselled> {
        self.counsels.iter().find(|counselled| counselled.name() == name)
    }

    /// A turn of the world evaluator, named `world/e<epoch>`.
    pub fn turn(&self, name: &str) -> Option<&WorldEvolved> {
        self.evolved.iter().find(|turn| turn.name() == name)
    }

    /// The program of a solution: a lineage's parent or the child of an attempt.
    pub fn program(&self, solution: &SolutionId) -> Option<&Program> {
        self.parents.iter().map(|p| &p.program).find(|p| p.solution_id == *solution).or_else(|| {
            self.attempts
                .iter()
                .filter_map(|a| a.exit.candidate())
                .map(|c| &c.program)
                .find(|p| p.solution_id == *solution)
        })
    }

    /// Every recorded score with its lineage, its program and its suite (`evolution` or `held_out`).
    pub fn scores(&self) -> impl Iterator<Item = (&LineageId, &SolutionId, &'static str, &Score)> {
        let attempts = self.attempts.iter().filter_map(|attempt| {
            let (candidate, score) = (attempt.exit.candidate()?, attempt.exit.score()?);
            Some((&attempt.lineage, &candidate.program.solution_id, "evolution", score))
        });
        let frozen = self.frozen.iter().map(|f| (&f.lineage, &f.parent, "evolution", &f.parent_score));
        let finalists = self.finalists.iter().map(|f| (&f.lineage, &f.solution, "evolution", &f.score));
        let held_out = self.held_out.iter().map(|h| (&h.lineage, &h.solution, "held_out", &h.score));
        attempts.chain(frozen).chain(finalists).chain(held_out)
    }

    /// Returns the result of a lineage; `None` while the run is unfinished.
    pub fn result_of(&self, lineage: &LineageId) -> Option<&LineageResult> {
        self.result.as_ref()?.lineages.iter().find(|of| of.lineage == *lineage)
    }

    /// The held-out labels of one of a lineage's programs.
    pub fn held_out_score(&self, lineage: &LineageId, solution: &SolutionId) -> Option<&Score> {
        let own = self.held_out.iter().find(|of| of.lineage == *lineage && of.solution == *solution);
        own.map(|of| &of.score)
    }

    /// The held-out labels of a program by scene.
    pub fn held_out_labels(&self, solution: &SolutionId) -> BTreeMap<&str, &SceneScore> {
        let own = self.held_out.iter().filter(|of| of.solution == *solution);
        own.flat_map(|of| &of.score.scenes).map(|label| (label.scene.as_str(), label)).collect()
    }

    /// Returns, by scene, the outcome of each held-out scene for which both programs of a lineage's result have a label.
    pub fn outcomes(&self, of: &LineageResult) -> BTreeMap<&str, Became> {
        let (was, is) = (self.held_out_labels(&of.parent.solution), self.held_out_labels(&of.evolved.solution));
        let both = is.into_iter().filter_map(|(scene, label)| Some((scene, *was.get(scene)?, label)));
        both.map(|(scene, was, is)| (scene, Became::of(Some(was), is))).collect()
    }

    /// The label of a program in a scene: a function of program, scene and ego, so it does not matter where it is met first.
    pub fn label(&self, solution: &SolutionId, scene: &str) -> Option<&SceneScore> {
        let own = self.scores().filter(|(_, of, ..)| *of == solution);
        own.flat_map(|(.., score)| &score.scenes).find(|label| label.scene == scene)
    }

    /// The chain p0 → … → p of a solution, oldest first.
    pub fn chain(&self, solution: &SolutionId) -> Vec<&Program> {
        let Some(last) = self.program(solution) else { return Vec::new() };
        let ancestors = last.ancestor_chain.iter().filter_map(|a| self.program(&a.solution_id));
        ancestors.chain([last]).collect()
    }

    /// The active solution of a lineage at the end.
    pub fn active(&self, lineage: &LineageId) -> Option<&SolutionId> {
        let settled = self.settled.iter().rev().find(|s| s.lineage == *lineage).map(|s| &s.active);
        settled.or_else(|| self.parents.iter().find(|p| p.lineage == *lineage).map(|p| &p.program.solution_id))
    }
}

fn body<T: DeserializeOwned>(event: Event) -> Result<T, RecordedRunError> {
    let Event { seq, kind, body, .. } = event;
    serde_json::from_value(body).map_err(|error| RecordedRunError::Unreadable { seq, kind, reason: error.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::tables::tests::{CAT, End, add, run};

    #[test]
    fn a_scene_is_gained_or_lost_or_the_same_and_counts_where_both_programs_have_its_label() {
        let outcomes = |parent, evolved| {
            let mut recorded = run("made", &[]);
            add(&mut recorded, &End { parent, evolved: Some(evolved), ..CAT });
            let result = &recorded.result.as_ref().unwrap().lineages[0];
            recorded.outcomes(result).into_iter().map(|(scene, became)| (scene.to_string(), became)).collect::<Vec<_>>()
        };
        let (attack, none) = (Some((1.0, 0.9)), Some((0.0, 0.9)));
        let became = outcomes([attack, none, none, attack], [attack, attack, none, none]);
        let expected = [Became::Both, Became::Gained, Became::Neither, Became::Lost];
        assert!(became.iter().map(|(_, became)| *became).eq(expected), "{became:?}");
        let some = outcomes([None, none, attack, none], [attack, attack, None, none]);
        assert_eq!(some, [("s2".to_string(), Became::Gained), ("s4".to_string(), Became::Neither)]);
        // Where nobody labelled the parent it did not attack.
        let mut recorded = run("made", &[]);
        add(&mut recorded, &CAT);
        let label = recorded.held_out[1].score.scenes[0].clone();
        assert_eq!(Became::of(None, &label), Became::Gained);
    }
}
