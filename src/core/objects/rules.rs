//! Rules of ours that the method's paper does not have: each is a key of the experiment file that can be switched to the paper's
//! (`docs/PAPER.md`). Absent, ours holds and nothing is written, so that digests of files without the key stay.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

/// Requirements beyond the paper: the words of a list, or all of them where there is no list.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Required<T: Ord>(Option<BTreeSet<T>>);

impl<T: Ord> Default for Required<T> {
    fn default() -> Required<T> {
        Required(None)
    }
}

impl<T: Ord> Required<T> {
    /// Requires these alone.
    pub fn only(of: impl IntoIterator<Item = T>) -> Required<T> {
        Required(Some(of.into_iter().collect()))
    }

    /// Returns `true` if this is required.
    pub fn has(&self, of: T) -> bool {
        self.0.as_ref().is_none_or(|listed| listed.contains(&of))
    }

    /// Returns `true` if there is no list.
    pub fn is_unsaid(&self) -> bool {
        self.0.is_none()
    }
}

/// Returns the value of a switch that is on where a file does not say.
pub fn yes() -> bool {
    true
}

/// Returns `true` if such a switch is as in a file without the key.
pub fn is_yes(value: &bool) -> bool {
    *value
}

/// Returns `true` if a value is that of a file without the key.
pub fn is_unsaid<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// `evaluation.attack.requires`: conditions besides its class that make a contact of the ego an attack.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AttackRequirement {
    /// It is with an adversary of the program.
    Adversary,
    /// The road user that the ego meets moved differently than recorded.
    Acts,
    /// The ego does not run into the same one in plain replay.
    NotMetAnyway,
}

impl AttackRequirement {
    /// The words of a file.
    pub const NAMES: [&str; 3] = ["adversary", "acts", "not_met_anyway"];
}

/// `evaluation.realism.mean`: the mean that gives R(c).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RealismMean {
    /// The mean over the scenes acted in, but at most the mean over successes.
    #[default]
    Strict,
    /// The mean over all labelled scenes, those that nobody touched counting 1 (paper eq. prelim-objectives).
    Plain,
    /// The strict mean, but at most the share of scenes acted in, and of successes, where no diagnostic fails outright: a mean hides a
    /// diagnostic of little weight that fails in most scenes.
    Sound,
}

impl RealismMean {
    /// The words of a file.
    pub const NAMES: [&str; 3] = ["strict", "plain", "sound"];
}

/// `lineage[].over_egos`: attack of a scene where a program is played against several drivers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OverEgos {
    /// The mean over the drivers.
    #[default]
    Mean,
    /// The attack against the driver that it troubles least.
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

/// Rules by which a score was summed up.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LabelRules {
    /// Mean that gives realism.
    #[serde(default, skip_serializing_if = "is_unsaid")]
    pub mean: RealismMean,
    /// Requirements for a contact to count.
    #[serde(default, skip_serializing_if = "Required::is_unsaid")]
    pub attack: Required<AttackRequirement>,
    /// Rule that combines a scene's labels against several drivers, where there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over_egos: Option<OverEgos>,
}

impl LabelRules {
    /// Returns `true` if a contact counts that no program brought about, so that doing nothing scores.
    pub fn counts_any_contact(&self) -> bool {
        use AttackRequirement::{Acts, Adversary, NotMetAnyway};
        [Adversary, Acts, NotMetAnyway].into_iter().all(|of| !self.attack.has(of))
    }
}

/// `archive.requires`: conditions for acceptance of a child besides those of a gate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AcceptanceRequirement {
    /// It acts in some scene; a child that does not never leads either.
    Acts,
    /// Its label differs from its parent's in some scene.
    Differs,
}

impl AcceptanceRequirement {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["acts", "differs"];
}

/// `archive.front`: the programs whose points make up the front.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FrontOf {
    /// Points of accepted programs.
    #[default]
    Accepted,
    /// Points of all evaluated programs (paper: H_t).
    Evaluated,
}

impl FrontOf {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["accepted", "evaluated"];
}

/// `archive.front_per`: the unit that has a front of its own.
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

/// `archive.judged_on`: the scenes on which a child is compared with its parent and the front.
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

/// `selector.rule`: which of the programs that are realistic enough the selector reports.
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
    /// Successes of the front first, none that was surpassed; at most half of them of one kind and one of an attempt.
    #[default]
    Mixed,
    /// The M with the highest scores (paper: TopM).
    TopM,
}

impl Taking {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["mixed", "top_m"];
}

/// `proposals.unreadable_critic`: fate of a proposal for which a critic gave no readable review.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UnreadableCritic {
    /// The critic is asked once more. If that fails too, it does not count.
    #[default]
    Abstains,
    /// The proposal ends there (paper: malformed JSON is a failure before simulation).
    Blocks,
}

impl UnreadableCritic {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["abstains", "blocks"];
}

/// `proposals.unreadable_patch`: fate of a proposal whose patch cannot be read.
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
    /// After the role loop, once: a patch that all critics approve is final (paper alg:actor_critic_mutation).
    AfterCritics,
}

impl GatesAsked {
    /// The words of a file.
    pub const NAMES: [&str; 2] = ["before_critics", "after_critics"];
}
