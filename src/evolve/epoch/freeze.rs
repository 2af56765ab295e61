//! The immutable snapshot of the state that an epoch's slots see. The programs that a child will be compared with are labelled
//! first: its parents and the front, on the epoch's window and on all scenes that earlier windows opened.

use std::collections::{BTreeMap, BTreeSet, btree_map::Entry};

use super::RunError;
use super::state::State;
use crate::agents::{AgentError, Briefing, Cluster, Context, Handbook, Numbers, ParentOutcome, Questions, SceneRow};
use crate::archive::Archive;
use crate::archive::search::{SearchState, SlotDraw};
use crate::epoch::acceptance::challengers::looked_at;
use crate::epoch::acceptance::search;
use crate::epoch::briefs::counsels::Counsels;
use crate::epoch::briefs::handbook::handbook;
use crate::epoch::briefs::in_effect::{InScene, in_effect};
use crate::epoch::briefs::{aims::Seen, briefing, conflicts, encounters, history, window_rows};
use crate::epoch::labelling::labels::Labelling;
use crate::epoch::labelling::standings::Standings;
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::kernel::Digest;
use crate::memory::{Query, retrieve};
use crate::objects::{
    AttemptId, Card, Challenge, HashedProgram, Objectives, Program, Score, SolutionId, WorldSnapshot,
    event::{FrontPoint, Frozen, FrozenParent},
};

/// z_t: what the workers of one epoch get. Nothing in it can change.
pub struct Snapshot<'a> {
    pub spec: &'a LineageSpec,
    pub event: Frozen,
    /// p_t, and a second one where the epoch has one: the realism anchor, or another member of the front.
    pub parents: Vec<Parent>,
    /// The archive with its front measured on `so_far`.
    pub archive: Archive,
    /// Labels of the parents and of the front.
    pub standing: Standings,
    pub world: WorldSnapshot,
    /// Counsel that the lineage was given.
    pub counsels: Counsels,
    /// Places of the window's scenes in the pool.
    pub window: Vec<usize>,
    /// Places of all windows up to this one, in the order in which they were opened; those of the window alone where the archive judges on
    /// that.
    pub so_far: Vec<usize>,
    /// Tags that say something about a scene of the window, sorted.
    pub scene_tags: Vec<String>,
    /// The conflict that each evolution scene holds, where questions are detailed; empty elsewhere.
    pub conflicts: BTreeMap<String, &'static str>,
    /// Memory of a search method other than the archive's own, after the epoch's parents are drawn.
    pub search: Option<SearchState>,
    /// Looks at children of earlier epochs that were not accepted, with their programs.
    pub challenges: Vec<(Challenge, Program)>,
    /// Requests of the lineage's labels on evolution scenes so far, where their number is bounded.
    pub spent: BTreeSet<Digest>,
}

/// A program that slots edit.
pub struct Parent {
    pub program: Program,
    pub hash: Digest,
    /// On the window.
    pub score: Score,
    /// The score in sums.
    pub outcome: ParentOutcome,
    /// Findings on it from the window, where questions are detailed.
    pub seen: Option<Seen>,
    /// Its effect in each scene of the window.
    pub in_effect: Vec<InScene>,
    /// Written out once for all slots and roles.
    pub briefing: Briefing,
    /// Ids of the cards that its briefing shows.
    pub memory_shown: Vec<String>,
}

impl Parent {
    pub fn hashed(&self) -> HashedProgram<'_> {
        HashedProgram { program: &self.program, hash: self.hash }
    }
}

impl Snapshot<'_> {
    /// The program that a slot edits.
    pub fn parent_of(&self, slot: u32) -> &Parent {
        &self.parents[self.event.parent_place(slot)]
    }
}

/// Freezes the state for one epoch of one lineage.
pub fn freeze<'a>(
    study: &Study,
    state: &State,
    epoch: u32,
    spec: &'a LineageSpec,
    tools: &Tools<'_>,
) -> Result<Snapshot<'a>, RunError> {
    let (window, so_far) = (study.window(epoch), study.judged_on(epoch));
    let counsels = state.counsels.of(&spec.id);
    let labelling = Labelling { study, spec, counsels: &counsels, tools };
    let mut archive = state.archives.get(&spec.id).cloned().unwrap_or_default();
    let mut standing = Standings::new();
    let leaders = leaders(state, spec)?;
    let mut search = state.search.get(&spec.id).cloned();
    let drawn = search::draw(study, spec, epoch, &mut search);
    let live = leaders.iter().chain(drawn.iter().map(|slot| &slot.parent)).cloned();
    let live = live.chain(archive.front().map(|e| e.solution.clone()));
    let live = live.chain(archive.challengers().iter().map(|of| of.solution.clone()));
    let live: Vec<SolutionId> = live.chain(archive.members().cloned()).collect();
    let programs = live.iter().map(|solution| state.lineages.program(&spec.id, solution));
    labelling.ahead(&programs.collect::<Result<Vec<_>, _>>()?, &so_far)?;
    for solution in live {
        if let Entry::Vacant(place) = standing.entry(solution) {
            let program = state.lineages.program(&spec.id, place.key())?;
            let labels = labelling.standing(program.hashed()?, &window, &so_far)?;
            place.insert(labels);
        }
    }
    let fresh: BTreeMap<SolutionId, Objectives> =
        standing.iter().map(|(solution, labels)| (solution.clone(), labels.so_far.objectives)).collect();
    let scenes = study.scenes_digest(&so_far)?;
    archive.relabel(&fresh, scenes)?;
    let with_program = |of: Challenge| -> Result<_, RunError> {
        let program = state.lineages.program(&spec.id, &of.solution)?.clone();
        Ok((of, program))
    };
    let challenges = looked_at(study, &leaders[0], scenes, &mut archive, &standing, tools)?;
    let challenges = challenges.into_iter().map(with_program).collect::<Result<Vec<_>, _>>()?;
    let spent = search::spent(study, state, spec, &standing);
    let leaders = with_portfolio(study, state, spec, leaders, &archive, &standing, epoch)?;
    let scene_tags = study.telling_tags(&window);
    let conflicts = match study.questions {
        Questions::Plain => BTreeMap::new(),
        Questions::Detailed | Questions::Compact => conflicts::conflicts(study, spec, tools),
    };
    let handbook = handbook(study, spec)?;
    let freezing =
        Freezing { study, state, epoch, spec, labelling, standing: &standing, conflicts: &conflicts, handbook };
    let mut parents = Vec::with_capacity(leaders.len());
    for solution in &leaders {
        let score = standing[solution].window.clone();
        parents.push(freezing.parent(solution, score, &archive, &archive, &scene_tags)?);
    }
    for SlotDraw { parent, shown } in &drawn {
        let score = standing[parent].window.clone();
        let seen = if shown.is_empty() { archive.clone() } else { archive.showing(shown) };
        parents.push(freezing.parent(parent, score, &archive, &seen, &scene_tags)?);
    }
    let event = freezing.event(&parents, !drawn.is_empty(), &archive, &window, &so_far)?;
    drop(freezing);
    let world = state.world.clone();
    Ok(Snapshot {
        spec,
        event,
        parents,
        archive,
        standing,
        world,
        counsels,
        window,
        so_far,
        scene_tags,
        conflicts,
        search,
        challenges,
        spent,
    })
}

/// The programs that the slots edit: one, or the two anchors where they differ.
fn leaders(state: &State, spec: &LineageSpec) -> Result<Vec<SolutionId>, RunError> {
    let lineage = state.lineages.get(&spec.id)?;
    let anchor = lineage.realism_anchor.iter().filter(|anchor| **anchor != lineage.active);
    Ok(std::iter::once(&lineage.active).chain(anchor).cloned().collect())
}

/// Adds a second parent for the slots that widen the front, where one program leads and the epoch has such slots: the
/// front's other members that act take turns.
fn with_portfolio(
    study: &Study,
    state: &State,
    spec: &LineageSpec,
    leaders: Vec<SolutionId>,
    archive: &Archive,
    standing: &Standings,
    epoch: u32,
) -> Result<Vec<SolutionId>, RunError> {
    let one_parent = study.rival().is_some() || study.budget.slots < 3 || !study.archive.portfolio;
    if state.lineages.get(&spec.id)?.realism_anchor.is_some() || one_parent {
        return Ok(leaders);
    }
    let acts = |solution: &&SolutionId| standing.get(*solution).is_some_and(|labels| labels.window.coverage > 0.0);
    let others = archive.front().map(|entry| &entry.solution).filter(|solution| !leaders.contains(solution));
    let others: Vec<SolutionId> = others.filter(acts).cloned().collect();
    let attack = |solution: &SolutionId| standing.get(solution).map_or(0.0, |labels| labels.so_far.objectives.attack);
    let attacks: Vec<f64> = others.iter().map(attack).collect();
    let follows_up = study.archive.challengers > 0;
    let turn = turn(&attacks, attack(&leaders[0]), epoch, follows_up).map(|place| others[place].clone());
    Ok(leaders.into_iter().chain(turn).collect())
}

/// Whose turn it is to be the second parent, of others with these attacks. They take turns; where good ideas are followed up, the strongest
/// has every second one, if it has more attack than the leader: slots that edit weaker programs regain first what it has.
fn turn(attacks: &[f64], leader: f64, epoch: u32, follows_up: bool) -> Option<usize> {
    let strongest = (0..attacks.len()).reduce(|best, next| if attacks[next] > attacks[best] { next } else { best })?;
    if follows_up && epoch.is_multiple_of(2) && attacks[strongest] > leader {
        return Some(strongest);
    }
    Some(epoch as usize % attacks.len())
}

/// Parts of a parent's labels that the agents are told.
struct Shown {
    outcome: ParentOutcome,
    clusters: Vec<Cluster>,
    window: Vec<SceneRow>,
    seen: Option<Seen>,
}

/// State, epoch and lineage that a snapshot is made of.
struct Freezing<'f> {
    study: &'f Study,
    state: &'f State,
    epoch: u32,
    spec: &'f LineageSpec,
    labelling: Labelling<'f>,
    standing: &'f Standings,
    /// Of detailed questions: the conflict of each evolution scene.
    conflicts: &'f BTreeMap<String, &'static str>,
    /// The same for all parents.
    handbook: Handbook,
}

impl Freezing<'_> {
    /// A parent with what its slots' agents are told. Memory goes by the lineage's archive; its questions show the front of `seen`.
    fn parent(
        &self,
        solution: &SolutionId,
        score: Score,
        archive: &Archive,
        seen: &Archive,
        scene_tags: &[String],
    ) -> Result<Parent, RunError> {
        let Freezing { study, state, epoch, spec, .. } = *self;
        let program = state.lineages.program(&spec.id, solution)?.clone();
        let hash = program.hash()?;
        let front: Vec<AttemptId> = archive.front().filter_map(|entry| entry.attempt.clone()).collect();
        let query = Query { parent: &program, epoch, scene_tags, front: &front };
        let memory: Vec<Card> = if study.has_memory() {
            retrieve(&state.memory, &query, &study.memory).into_iter().map(|(card, _)| card.clone()).collect()
        } else {
            Vec::new()
        };
        let shown = self.shown(&program, &score, scene_tags)?;
        let mut history = history::shown(state, &spec.id, seen, &memory);
        let (mut not_shown, mut on_window) = (String::new(), None);
        if !study.questions.is_plain() {
            let compact = study.questions.is_compact();
            let numbers = if compact { Numbers::Thousandths } else { Numbers::Decimals };
            history::with_verdicts(state, &mut history, numbers);
            not_shown = history::not_shown(state, &spec.id, &history);
            on_window = Some(self.standing);
        }
        let context = Context {
            lineage: &spec.id,
            epoch,
            parent: &program,
            parent_hash: hash,
            handbook: &self.handbook,
            ego: &briefing::ego_sentence(study, spec),
            memory: &memory,
            clusters: &shown.clusters,
            parent_outcome: Some(&shown.outcome),
            window: &shown.window,
            history: &history,
            front: &briefing::front(seen, solution, on_window),
            questions: study.questions,
            not_shown: &not_shown,
        };
        let briefing = Briefing::of(&context).map_err(AgentError::from)?;
        let Shown { outcome, seen, .. } = shown;
        let memory_shown = memory.iter().map(|card| card.id.0.clone()).collect();
        let unfit = |failure| RunError::Study(format!("{}: {failure}", program.solution_id));
        let in_effect = in_effect(study, spec, &program, &study.window(epoch))?.map_err(unfit)?;
        Ok(Parent { program, hash, score, outcome, seen, in_effect, briefing, memory_shown })
    }

    /// Collects what the agents are told of a parent's labels on the window.
    fn shown(&self, program: &Program, score: &Score, scene_tags: &[String]) -> Result<Shown, RunError> {
        let Freezing { study, spec, ref labelling, .. } = *self;
        let mut outcome = briefing::parent_outcome(score);
        let mut rows = window_rows::rows(study, score, scene_tags, labelling.tools)?;
        if study.questions.is_plain() {
            let clusters = briefing::clusters(study, score);
            return Ok(Shown { outcome, clusters, window: rows, seen: None });
        }
        for row in &mut rows {
            row.tags = vec![row.cluster.clone()];
            row.cluster = self.conflicts.get(&row.scene).copied().unwrap_or("free").into();
        }
        let near = encounters::near_misses(score, labelling.tools.rollouts)?;
        outcome.near_misses = Some(near.len());
        let clusters = conflicts::clusters(study, self.conflicts, score, &rows);
        let seen = Some(Seen::of(&rows, &clusters, &outcome, &study.source(spec)?.contract, !study.without.sight));
        let window = encounters::with_encounters(labelling, program, score, rows, &near)?;
        Ok(Shown { outcome, clusters, window, seen })
    }

    fn event(
        &self,
        parents: &[Parent],
        drawn: bool,
        archive: &Archive,
        window: &[usize],
        so_far: &[usize],
    ) -> Result<Frozen, RunError> {
        let Freezing { study, state, epoch, spec, .. } = *self;
        let first = &parents[0];
        let frozen = |parent: &Parent| FrozenParent {
            parent: parent.program.solution_id.clone(),
            parent_hash: parent.hash,
            parent_score: parent.score.clone(),
            memory_shown: parent.memory_shown.clone(),
        };
        let drawn: Vec<FrozenParent> = if drawn { parents[1..].iter().map(frozen).collect() } else { Vec::new() };
        let second = parents.get(1).filter(|_| drawn.is_empty()).map(frozen);
        let anchored = state.lineages.get(&spec.id)?.realism_anchor.is_some();
        let (realism_anchor, portfolio) = if anchored { (second, None) } else { (None, second) };
        Ok(Frozen {
            epoch,
            lineage: spec.id.clone(),
            parent: first.program.solution_id.clone(),
            parent_hash: first.hash,
            window: study.scene_ids(window),
            parent_score: first.score.clone(),
            realism_anchor,
            portfolio,
            drawn,
            front: archive
                .front()
                .map(|e| FrontPoint { solution: e.solution.clone(), objectives: e.objectives })
                .collect(),
            scenes_so_far: so_far.len(),
            world: state.world.digest()?,
            memory_shown: first.memory_shown.clone(),
            slots: study.budget.slots,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::turn;

    #[test]
    fn the_strongest_has_every_second_turn_where_it_is_stronger_than_the_leader_and_ideas_are_followed_up() {
        let turns = |attacks: &[f64], leader, follows_up| -> Vec<Option<usize>> {
            (0..4).map(|epoch| turn(attacks, leader, epoch, follows_up)).collect()
        };
        let all = [0.2, 0.1, 0.4, 0.4];
        assert_eq!(turns(&all, 0.3, false), [Some(0), Some(1), Some(2), Some(3)]);
        assert_eq!(turns(&all, 0.3, true), [Some(2), Some(1), Some(2), Some(3)]);
        assert_eq!(turns(&all, 0.5, true), turns(&all, 0.5, false));
        assert_eq!(turns(&[], 0.5, true), [None; 4]);
    }
}
