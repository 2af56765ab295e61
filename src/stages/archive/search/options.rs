//! `[search]`: which method searches, and how many rollouts it has.

use serde::{Deserialize, Serialize};

use super::super::openevolve::OpenEvolveOptions;
use crate::objects::Objectives;

/// Method that decides what is kept and edited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The whole system: three acceptance gates over a front of attack and realism.
    Pareto,
    /// The whole system with one gate: more attack than the parent, shown at the archive's level. Realism has no say.
    AttackOnly,
    /// OpenEvolve's database by one score (`archive::openevolve`); no critics, memory or acceptance gates.
    #[serde(rename = "openevolve")]
    OpenEvolve,
    /// Random legal patches of the first parent; no model is asked.
    Random,
    /// The best by one score is edited; a child with a larger one takes its place.
    HillClimbing,
    /// NSGA-II by attack and realism, one child at a time (Deb et al. 2002; the (mu + 1) form of Durillo et al. 2009).
    Nsga2,
    /// A null search: the whole system, but every proposal is a random legal patch of the program that leads. No model is asked.
    RandomProposals,
    /// A control: the whole system, but every proposal leaves free some numbers of the program that leads, and `tuning` sets them. No model is
    /// asked. Whoever claims a gain for what a model writes has to beat this.
    Numbers,
    /// A null search: the whole system, but acceptance and promotion see the labels of another candidate of the same epoch.
    ShuffledLabels,
}

impl Method {
    /// All of them.
    pub const ALL: [Method; 9] = [
        Method::Pareto,
        Method::AttackOnly,
        Method::OpenEvolve,
        Method::Random,
        Method::HillClimbing,
        Method::Nsga2,
        Method::RandomProposals,
        Method::Numbers,
        Method::ShuffledLabels,
    ];

    /// Returns `true` if it decides in place of the archive's gates. A null search does not: it takes away what the gates go by.
    pub fn replaces_gates(self) -> bool {
        !matches!(self, Method::Pareto | Method::RandomProposals | Method::Numbers | Method::ShuffledLabels)
    }

    /// Returns `true` if its proposals are random patches.
    pub fn draws_patches(self) -> bool {
        matches!(self, Method::Random | Method::RandomProposals | Method::Numbers)
    }

    /// The word in experiment files.
    pub fn name(self) -> &'static str {
        match self {
            Method::Pareto => "pareto",
            Method::AttackOnly => "attack_only",
            Method::OpenEvolve => "openevolve",
            Method::Random => "random",
            Method::HillClimbing => "hill_climbing",
            Method::Nsga2 => "nsga2",
            Method::RandomProposals => "random_proposals",
            Method::Numbers => "numbers",
            Method::ShuffledLabels => "shuffled_labels",
        }
    }
}

/// The table `[search]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SearchOptions {
    /// The method.
    pub method: Method,
    /// Distinct rollouts on evolution scenes that a lineage may use; without it epochs and slots alone bound the search.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rollouts: Option<usize>,
    /// w of the score w A + (1 - w) R, 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attack_weight: Option<f64>,
    /// Most members of NSGA-II's population.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub population: Option<usize>,
    /// Most edits of a random patch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edits_max: Option<usize>,
    /// How free constants of patches are set; without it patches leave none free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tuning: Option<TuningOptions>,
    /// OpenEvolve's own options.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub openevolve: Option<OpenEvolveOptions>,
}

/// `[search.tuning]`: a numeric search by successive halving sets the constants that a patch leaves free, before the child competes. Several
/// settings are drawn and labelled in a few evolution scenes outside the epoch's window; the better half goes on to twice as many.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TuningOptions {
    /// Settings that are tried, the patch's own among them.
    pub draws: usize,
    /// Scenes in which all of them are labelled.
    pub scenes: usize,
}

impl SearchOptions {
    /// The one score of the methods that have one: attack alone, or the weighted sum.
    pub fn scalar(&self, of: Objectives) -> f64 {
        let weight = self.attack_weight.unwrap_or(1.0);
        weight * of.attack + (1.0 - weight) * of.realism
    }

    /// Returns `true` if critics review its proposals.
    pub fn has_critics(&self) -> bool {
        self.method != Method::OpenEvolve && !self.method.draws_patches()
    }

    /// The rule of acceptance as prompts tell it; `None` for the system's own.
    pub fn described(&self) -> Option<String> {
        let same = "A child is compared with its parent on the same scenes.";
        match self.method {
            // Agents are not told that labels are shuffled: they work as in the search that this one is compared with.
            Method::Pareto | Method::ShuffledLabels => None,
            Method::AttackOnly => Some(format!(
                "{same} It is accepted if it has more attack, at the confidence of the experiment; realism does not count."
            )),
            Method::HillClimbing | Method::OpenEvolve => {
                let weight = self.attack_weight.unwrap_or(1.0);
                Some(format!(
                    "Programs are compared by one score, {weight} A + {} R, on the same scenes; the larger, the better.",
                    crate::kernel::num::rounded(1.0 - weight, 6)
                ))
            }
            Method::Nsga2 => Some(
                "A population is kept by NSGA-II: who is dominated by fewest stays, of equals who stands farther from its neighbours \
                 in attack and realism."
                    .into(),
            ),
            Method::Random | Method::RandomProposals | Method::Numbers => Some("Nobody is asked.".into()),
        }
    }
}
