//! Causal retrieval: which cards an actor is shown (paper eq. app-memory-score).

use serde::{Deserialize, Serialize};

use super::{store::Memory, text::tag_set};
use crate::objects::{AttemptId, Card, CardKind, Program, Taking, is_unsaid};

/// Weights of the score and size of the context. Come from the experiment file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MemoryOptions {
    /// α_1: same lineage, 1.
    pub alpha_lineage: f64,
    /// α_2: same family, 1.
    pub alpha_family: f64,
    /// α_3: mechanism tags in common, 1.
    pub alpha_mechanism: f64,
    /// α_4: scene tags in common, 1.
    pub alpha_scene: f64,
    /// α_5: recency, 1.
    pub alpha_recency: f64,
    /// α_6: penalty of a card from the future, 1. The filter removes such cards before they are scored.
    pub alpha_future: f64,
    /// M: how many cards are shown.
    pub top_m: usize,
    /// Rule for which of the scored cards are shown.
    #[serde(default, skip_serializing_if = "is_unsaid")]
    pub taking: Taking,
}

/// An option that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("memory option {option} is {value}; expected a finite number of at least 0: correct it in the experiment file")]
pub struct MemoryOptionsError {
    /// Name of the option.
    pub option: &'static str,
    /// Its value.
    pub value: f64,
}

impl MemoryOptions {
    /// Refuses weights and counts that cannot be used.
    pub fn validate(&self) -> Result<(), MemoryOptionsError> {
        let weights = [
            ("alpha_lineage", self.alpha_lineage),
            ("alpha_family", self.alpha_family),
            ("alpha_mechanism", self.alpha_mechanism),
            ("alpha_scene", self.alpha_scene),
            ("alpha_recency", self.alpha_recency),
            ("alpha_future", self.alpha_future),
        ];
        match weights.into_iter().find(|(_, value)| !(value.is_finite() && *value >= 0.0)) {
            Some((option, value)) => Err(MemoryOptionsError { option, value }),
            None => Ok(()),
        }
    }
}

/// A query: for which parent and which epoch.
#[derive(Clone, Copy, Debug)]
pub struct Query<'a> {
    /// p_t: its lineage, family and mechanism tags are compared.
    pub parent: &'a Program,
    /// The epoch t + 1 for which a proposal is made.
    pub epoch: u32,
    /// Words for the scenes of this epoch's window, without those that name nearly every scene.
    pub scene_tags: &'a [String],
    /// Attempts whose programs are on the lineage's front.
    pub front: &'a [AttemptId],
}

/// Tags of a program's mechanism modules, sorted, without repeats.
pub fn tags_of(program: &Program) -> Vec<String> {
    tag_set(program.mechanism_modules.values().flat_map(|module| &module.tags))
}

/// Most cards of one attempt.
const PER_ATTEMPT_MAX: usize = 1;

/// The cards that an actor sees, with their scores: first the success card of every front member, however many those are, then
/// the best others up to M, equal scores by card id.
///
/// First the causal filter: a card exists after its epoch's barrier, so a proposal of epoch t + 1 sees only cards
/// with epoch(u) <= t. Then the lineage filter: cards of other lineages only where they may be shared. A success of this
/// lineage that the front has left behind is none any more. Of one attempt and of one kind only so many are taken, so that no
/// epoch with many like cards hides all others. As the paper has it (`memory.taking`), the M with the highest scores are taken of those that
/// the two filters leave.
pub fn retrieve<'m>(memory: &'m Memory, query: &Query<'_>, options: &MemoryOptions) -> Vec<(&'m Card, f64)> {
    let own = |card: &Card| card.lineage == query.parent.lineage_id;
    let on_front = |card: &Card| card.attempt.as_ref().is_some_and(|attempt| query.front.contains(attempt));
    let as_scored = options.taking == Taking::TopM;
    let surpassed = |card: &Card| !as_scored && own(card) && card.kind == CardKind::Success && !on_front(card);
    let tags = tags_of(query.parent);
    let mut scored: Vec<(&Card, f64)> = memory
        .cards()
        .iter()
        .filter(|card| card.epoch < query.epoch)
        .filter(|card| (own(card) || card.shareable) && !surpassed(card))
        .map(|card| (card, scored_by(card, query, &tags, options)))
        .collect();
    scored.sort_by(|(a, x), (b, y)| y.total_cmp(x).then_with(|| a.id.cmp(&b.id)));
    if as_scored {
        scored.truncate(options.top_m);
        return scored;
    }
    let of_front = |card: &Card| own(card) && card.kind == CardKind::Success && !card.shareable && on_front(card);
    let (mut taken, others): (Vec<_>, Vec<_>) = scored.into_iter().partition(|(card, _)| of_front(card));
    // Half of what is shown, rounded up.
    let per_kind = options.top_m.div_ceil(2);
    for (card, score) in others {
        let of_kind = taken.iter().filter(|(other, _)| other.kind == card.kind).count();
        let of_attempt =
            taken.iter().filter(|(other, _)| card.attempt.is_some() && other.attempt == card.attempt).count();
        if taken.len() < options.top_m && of_kind < per_kind && of_attempt < PER_ATTEMPT_MAX {
            taken.push((card, score));
        }
    }
    taken
}

/// score(u, p_t): similarity of families is 1 or 0, of tags Jaccard's index, recency 1 / (1 + age in epochs).
pub fn score(card: &Card, query: &Query<'_>, options: &MemoryOptions) -> f64 {
    scored_by(card, query, &tags_of(query.parent), options)
}

/// The same, given the tags of the parent's mechanisms.
fn scored_by(card: &Card, query: &Query<'_>, tags: &[String], options: &MemoryOptions) -> f64 {
    let flag = |holds: bool| if holds { 1.0 } else { 0.0 };
    let parent = query.parent;
    let age = query.epoch.saturating_sub(1).saturating_sub(card.epoch);
    options.alpha_lineage * flag(card.lineage == parent.lineage_id)
        + options.alpha_family * flag(card.family == parent.source_family)
        + options.alpha_mechanism * jaccard(&card.mechanism_tags, tags)
        + options.alpha_scene * jaccard(&card.scene_tags, query.scene_tags)
        + options.alpha_recency / (1.0 + f64::from(age))
        - options.alpha_future * flag(card.epoch >= query.epoch)
}

/// |A ∩ B| / |A ∪ B|; 0 of two empty sets, which have nothing in common. Every card of the memory is compared, so no sets are
/// made: tags are few.
fn jaccard(a: &[String], b: &[String]) -> f64 {
    let first = |list: &[String], at: usize| !list[..at].contains(&list[at]);
    let distinct = |list: &[String]| (0..list.len()).filter(|at| first(list, *at)).count();
    let common = (0..a.len()).filter(|at| first(a, *at) && b.contains(&a[*at])).count();
    let union = distinct(a) + distinct(b) - common;
    if union == 0 { 0.0 } else { common as f64 / union as f64 }
}
