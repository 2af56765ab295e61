//! Rules of ours that the method's paper does not have: each is a key of the experiment file that can be switched to the paper's
//! (`docs/PAPER.md`). Absent, ours holds and nothing is written, so that digests of files without the key stay.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

/// What is asked for beyond the paper: the words of a list, all of them where there is no list.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Required<T: Ord>(Option<BTreeSet<T>>);

impl<T: Ord> Default for Required<T> {
    fn default() -> Required<T> {
        Required(None)
    }
}

impl<T: Ord> Required<T> {
    /// These alone.
    pub fn only(of: impl IntoIterator<Item = T>) -> Required<T> {
        Required(Some(of.into_iter().collect()))
    }

    /// Whether this is asked for.
    pub fn has(&self, of: T) -> bool {
        self.0.as_ref().is_none_or(|listed| listed.contains(&of))
    }

    /// Whether there is no list.
    pub fn is_unsaid(&self) -> bool {
        self.0.is_none()
    }
}

/// A switch that is on where a file does not say.
pub fn yes() -> bool {
    true
}

/// Whether such a switch is as in a file without the key.
pub fn is_yes(value: &bool) -> bool {
    *value
}

/// Whether a value is that of a file without the key.
pub fn is_unsaid<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// `evaluation.attack.requires`: what a contact of the ego needs besides its class, so that it is an attack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AttackRequirement {
    /// It is with an adversary of the program.
    Adversary,
    /// Whom the ego meets moved differently than recorded.
    Acts,
    /// The ego does not run into the same one in plain replay.
    NotMetAnyway,
}

impl AttackRequirement {
    /// The words of a file.
    pub const NAMES: [&str; 3] = ["adversary", "acts", "not_met_anyway"];
}

/// `evaluation.realism.mean`: what R(c) is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RealismMean {
    /// The mean over the scenes acted in, and no more than that over successes.
    #[default]
    Strict,
    /// The mean over all labelled scenes, those that nobody touched counting 1 (paper eq. prelim-objectives).
    Plain,
    /// The strict one, and no more than the share of scenes acted in, nor of successes, where no diagnostic fails outright: a mean hides a
    /// diagnostic of little weight that fails in most scenes.
    Sound,
}

impl RealismMean {
    /// The words of a file.
    pub const NAMES: [&str; 3] = ["strict", "plain", "sound"];
}

/// `lineage[].over_egos`: what a scene's attack is, where a program is played against several drivers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OverEgos {
    /// The mean over the drivers.
    #[default]
    Mean,
    /// That against the driver whom it troubles least.
    Worst,
}

impl OverEgos {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["mean", "worst"];

    /// The name of several drivers in labels and tables: `mean of idm+pdm`.
    pub fn label(self, egos: &[&str]) -> String {
        let rule = match self {
            OverEgos::Mean => "mean",
            OverEgos::Worst => "worst",
        };
        format!("{rule} of {}", egos.join("+"))
    }
}

/// By which rules a score was summed up.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LabelRules {
    /// What realism is a mean of.
    #[serde(default, skip_serializing_if = "is_unsaid")]
    pub mean: RealismMean,
    /// What a contact needed to count.
    #[serde(default, skip_serializing_if = "Required::is_unsaid")]
    pub attack: Required<AttackRequirement>,
    /// What a scene's label is of those against several drivers, where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over_egos: Option<OverEgos>,
}

impl LabelRules {
    /// Whether a contact counts that no program brought about, so that doing nothing scores.
    pub fn counts_any_contact(&self) -> bool {
        use AttackRequirement::{Acts, Adversary, NotMetAnyway};
        [Adversary, Acts, NotMetAnyway].into_iter().all(|of| !self.attack.has(of))
    }
}

/// `archive.requires`: what a child must do besides what a gate asks, so that it is accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AcceptanceRequirement {
    /// It acts in some scene; whoever does not never leads either.
    Acts,
    /// It has another label than its parent in some scene.
    Differs,
}

impl AcceptanceRequirement {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["acts", "differs"];
}

/// `archive.front`: whose points the front is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FrontOf {
    /// Of accepted programs.
    #[default]
    Accepted,
    /// Of all evaluated ones (paper: H_t).
    Evaluated,
}

impl FrontOf {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["accepted", "evaluated"];
}

/// `archive.front_per`: who has a front of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FrontPer {
    /// A lineage.
    #[default]
    Lineage,
    /// A group of traffic family and route of a lineage (paper, appendix CARLA/SafeBench Protocol).
    Group,
}

impl FrontPer {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["lineage", "group"];
}

/// `archive.judged_on`: on which scenes a child is compared with its parent and the front.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JudgedOn {
    /// On the epoch's window, and if a gate holds there, on the scenes of all windows so far, which decide.
    #[default]
    WindowThenAll,
    /// On the epoch's window alone.
    Window,
}

impl JudgedOn {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["window_then_all", "window"];
}

/// `archive.ties`: which of several programs with equal objectives stand on the front.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ties {
    /// The first; later ones are logged as its duplicates.
    #[default]
    First,
    /// All of them: none dominates another.
    All,
}

impl Ties {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["first", "all"];
}

/// `selector.rule`: whom of those realistic enough the selector reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReportedBy {
    /// The most realistic one within the tolerance of the best attack.
    #[default]
    Tolerance,
    /// The one with the best attack; the tolerance means nothing.
    BestAttack,
}

impl ReportedBy {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["tolerance", "best_attack"];
}

/// `memory.taking`: which of the scored cards an actor is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Taking {
    /// Successes of the front first, no surpassed ones; of one kind half at most, of an attempt one.
    #[default]
    Mixed,
    /// The M with the highest scores (paper: TopM).
    TopM,
}

impl Taking {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["mixed", "top_m"];
}

/// `proposals.unreadable_critic`: what becomes of a proposal of which a critic gave no readable review.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UnreadableCritic {
    /// The critic is asked once more, and then has no say.
    #[default]
    Abstains,
    /// The proposal ends there (paper: malformed JSON is a failure before simulation).
    Blocks,
}

impl UnreadableCritic {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["abstains", "blocks"];
}

/// `proposals.unreadable_patch`: what becomes of a proposal whose patch cannot be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UnreadablePatch {
    /// The repair sees its text while rounds are left.
    #[default]
    Repaired,
    /// The proposal ends there (paper: malformed JSON is a failure before simulation).
    Ends,
}

impl UnreadablePatch {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["repaired", "ends"];
}

/// `proposals.gates`: when the deterministic gates judge a patch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GatesAsked {
    /// Before its critics, who are told the verdicts; what a gate refuses is repaired while rounds are left.
    #[default]
    BeforeCritics,
    /// After the role loop, once: whom all critics approve is final (paper alg:actor_critic_mutation).
    AfterCritics,
}

impl GatesAsked {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["before_critics", "after_critics"];
}
