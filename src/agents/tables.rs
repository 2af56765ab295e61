//! Clusters and front as tables of text, as prompts show them: a head, then a row a line.

use std::collections::{BTreeMap, BTreeSet};

use crate::kernel::num;
use crate::objects::{AttemptId, Objectives, SolutionId};

/// Decimals of shares and objectives.
const DECIMALS: u32 = 4;
/// Decimals of features.
const FEATURE_DECIMALS: u32 = 2;

/// A group of scenes of the evolution split that patches may refer to.
#[derive(Clone, Debug, PartialEq)]
pub struct Cluster {
    /// The name by which `cluster_refs_used` cites it.
    pub name: String,
    /// Number of scenes in the group.
    pub scenes: usize,
    /// What the scenes have in common, in words.
    pub describes: String,
    /// Share of these scenes in which the parent's attack succeeded, 0..1.
    pub attacked_share: Option<f64>,
    /// Mean of scene features in the group: feature name -> value, units as in the contract.
    pub features: BTreeMap<String, f64>,
    /// What became of its scenes of the window: outcome -> scenes; only in detailed questions.
    pub outcomes: BTreeMap<&'static str, usize>,
}

/// A member of the lineage's non-dominated set.
#[derive(Clone, Debug, PartialEq)]
pub struct FrontPoint {
    /// Which program.
    pub solution: SolutionId,
    /// F(c).
    pub objectives: Objectives,
    /// The attempt that brought it, whose content the history shows; `None` for the first parent.
    pub attempt: Option<AttemptId>,
    /// Whether it is the parent that is edited.
    pub is_parent: bool,
    /// The same on the present window, where the parent and its children are compared; only in detailed questions.
    pub on_window: Option<Objectives>,
}

/// `ref | scenes | attacked | <feature> | .. | describes`. What is not known is `-`.
pub fn clusters(clusters: &[Cluster]) -> String {
    let features: BTreeSet<&str> =
        clusters.iter().flat_map(|cluster| cluster.features.keys().map(String::as_str)).collect();
    let known = |x: Option<f64>, decimals| x.map_or("-".to_string(), |x| num::rounded(x, decimals).to_string());
    let counted = clusters.iter().any(|cluster| !cluster.outcomes.is_empty()).then_some("outcomes");
    let head = ["ref", "scenes", "attacked"].into_iter().chain(features.iter().copied()).chain(counted);
    // With more clusters what they mean stands once, above the table.
    let head = head.chain(counted.is_none().then_some("describes"));
    let row = |cluster: &Cluster| {
        let own = [cluster.name.clone(), cluster.scenes.to_string(), known(cluster.attacked_share, DECIMALS)];
        let values = features.iter().map(|name| known(cluster.features.get(*name).copied(), FEATURE_DECIMALS));
        let outcomes = counted.map(|_| {
            let mut all: Vec<_> = cluster.outcomes.iter().collect();
            all.sort_by_key(|(name, count)| (std::cmp::Reverse(**count), **name));
            all.iter().map(|(name, count)| format!("{count} {name}")).collect::<Vec<_>>().join(", ")
        });
        let describes = counted.is_none().then(|| cluster.describes.clone());
        own.into_iter().chain(values).chain(outcomes).chain(describes).collect::<Vec<_>>().join(" | ")
    };
    let head = head.collect::<Vec<_>>().join(" | ");
    [head].into_iter().chain(clusters.iter().map(row)).collect::<Vec<_>>().join("\n")
}

/// `program | attack | realism`, the same on the window where it is known, and which of them is edited.
pub fn front(front: &[FrontPoint]) -> String {
    let both = |of: &Objectives| {
        let [attack, realism] = [of.attack, of.realism].map(|x| num::rounded(x, DECIMALS).to_string());
        format!("{attack} | {realism}")
    };
    let row = |point: &FrontPoint| {
        let window = point.on_window.as_ref().map(|of| format!(" | {}", both(of))).unwrap_or_default();
        let edited = if point.is_parent { " | the parent" } else { "" };
        format!("{} | {}{window}{edited}", point.solution, both(&point.objectives))
    };
    let known = front.iter().any(|point| point.on_window.is_some());
    let window = if known { " | attack on this window | realism on this window" } else { "" };
    let head = format!("program | attack | realism{window}");
    [head].into_iter().chain(front.iter().map(row)).collect::<Vec<_>>().join("\n")
}
