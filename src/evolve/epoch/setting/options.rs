//! Options of an experiment file for the agents that are asked before a lineage evolves: who composes its templates,
//! who counsels it about attackers.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::objects::{GatesAsked, UnreadableCritic, UnreadablePatch};

/// `[proposals]`: how a proposal is judged before any rollout, where that is not our way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ProposalOptions {
    /// True if a child that does what its parent does on every probe scene goes no further. The paper has seven gates, not this one.
    pub effect_gate: bool,
    /// Treatment of a proposal of which a critic gave no readable review.
    pub unreadable_critic: UnreadableCritic,
    /// Treatment of a proposal whose patch cannot be read.
    pub unreadable_patch: UnreadablePatch,
    /// When the gates judge a patch.
    pub gates: GatesAsked,
}

impl Default for ProposalOptions {
    fn default() -> ProposalOptions {
        ProposalOptions {
            effect_gate: true,
            unreadable_critic: UnreadableCritic::default(),
            unreadable_patch: UnreadablePatch::default(),
            gates: GatesAsked::default(),
        }
    }
}

/// `[without]`: parts of the system that a run does without, so that their worth can be told.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Without {
    /// No critic is asked; the gates' verdicts still call for repairs.
    pub critics: bool,
    /// No patch is repaired.
    pub repair: bool,
    /// No card is written or shown.
    pub memory: bool,
    /// No new rule of a scene-conditioned policy.
    pub conditions: bool,
    /// No new mechanism module.
    pub mechanisms: bool,
    /// Neither the isolation gate nor its critic.
    pub isolation: bool,
    /// No share of the rollouts is drawn at random among those that the router leaves out.
    pub audit: bool,
    /// The parent trade-off gate accepts nobody.
    pub tradeoff: bool,
    /// No question says what the driver under test sees and how it drives; its name stays. Absent from digests where it is false,
    /// because files were recorded before it was there.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub sight: bool,
}

impl Without {
    /// Names of what is left out.
    pub fn names(&self) -> Vec<&'static str> {
        let Without { critics, repair, memory, conditions, mechanisms, isolation, audit, tradeoff, sight } = *self;
        let all = [
            ("critics", critics),
            ("repair", repair),
            ("memory", memory),
            ("conditions", conditions),
            ("mechanisms", mechanisms),
            ("isolation", isolation),
            ("audit", audit),
            ("tradeoff", tradeoff),
            ("sight", sight),
        ];
        all.into_iter().filter(|(_, left_out)| *left_out).map(|(name, _)| name).collect()
    }

    /// Parts of a program that no patch may touch.
    pub fn closed(&self) -> Vec<&'static str> {
        let conditions = self.conditions.then_some("/scenario_conditioned_policy");
        conditions.into_iter().chain(self.mechanisms.then_some("/mechanism_modules")).collect()
    }
}

/// `[composition]`: what the template agent is asked for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompositionOptions {
    /// Most questions a template: the first, and one after each answer that could not be used or whose template spared the ego
    /// somewhere when it was tried.
    pub rounds: u32,
    /// Kind of scenario -> what is to happen, in prose. A kind without a description keeps the published template.
    pub descriptions: BTreeMap<String, String>,
}

/// Longest description, characters: it is part of a prompt.
const DESCRIPTION_MAX_CHARS: usize = 2_000;

impl CompositionOptions {
    /// The first field that is out of bounds, with what is expected. `kinds` are the kinds of scenario of the families
    /// that take templates.
    pub fn fault(&self, kinds: &[&str]) -> Option<(String, String)> {
        if !(1..=8).contains(&self.rounds) {
            return Some(("rounds".into(), "1 to 8".into()));
        }
        if self.descriptions.is_empty() {
            return Some(("descriptions".into(), format!("one of {} at least", kinds.join(", "))));
        }
        self.descriptions.iter().find_map(|(kind, text)| {
            let place = format!("descriptions.{kind}");
            let length = text.chars().count();
            if !kinds.contains(&kind.as_str()) {
                return Some((place, format!("a kind of scenario: {}", kinds.join(", "))));
            }
            let fits = (1..=DESCRIPTION_MAX_CHARS).contains(&length);
            (!fits).then(|| (place, format!("1 to {DESCRIPTION_MAX_CHARS} characters, found {length}")))
        })
    }
}

/// `[counsel]`: how the attacker agent is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CounselOptions {
    /// Most sets of attackers that are tried in a scene: a proposal and what reflection makes of it.
    pub rounds: u32,
    /// Vehicles that the agent is shown, the most promising ones.
    pub vehicles: usize,
}

impl CounselOptions {
    /// The first field that is out of bounds, with what is expected.
    pub fn fault(&self) -> Option<(&'static str, String)> {
        let fields = [("rounds", self.rounds as usize, 8), ("vehicles", self.vehicles, 32)];
        let bad = fields.into_iter().find(|(_, value, most)| *value == 0 || value > most);
        bad.map(|(name, _, most)| (name, format!("1 to {most}")))
    }
}
