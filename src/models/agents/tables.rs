//! Clusters and front as tables of text, as prompts show them: a head, then a row a line.

use std::collections::{BTreeMap, BTreeSet};

use crate::kernel::num;
use crate::objects::{AttemptId, LineageId, Objectives, SolutionId};

/// Decimals of shares and objectives.
const DECIMALS: u32 = 4;
/// Decimals of features.
const FEATURE_DECIMALS: u32 = 2;
/// Decimals of shares and objectives in compact questions.
const COMPACT_DECIMALS: u32 = 3;

/// Between two cells of a compact table. A space before a number is a token of its own.
pub const BAR: &str = "|";
/// Stands for a bar inside a cell of such a table.
pub const BAR_INSIDE: &str = "¦";

/// A row of a compact table. A bar or a line break inside a cell would end it.
pub fn line(cells: impl IntoIterator<Item = String>) -> String {
    let whole = |cell: String| cell.replace(BAR, BAR_INSIDE).replace(['\n', '\r'], " ");
    cells.into_iter().map(whole).collect::<Vec<_>>().join(BAR)
}

/// A group of scenes of the evolution split that patches may refer to.
#[derive(Clone, Debug, PartialEq)]
pub struct Cluster {
    /// The name by which `cluster_refs_used` cites it.
    pub name: String,
    /// Number of scenes in the group.
    pub scenes: usize,
    /// Traits that the scenes have in common, in words.
    pub describes: String,
    /// Share of these scenes in which the parent's attack succeeded, 0..1.
    pub attacked_share: Option<f64>,
    /// Mean of scene features in the group: feature name -> value, units as in the contract.
    pub features: BTreeMap<String, f64>,
    /// Outcomes of its scenes of the window: outcome -> scenes; only in detailed questions.
    pub outcomes: BTreeMap<&'static str, usize>,
}

/// A member of the lineage's non-dominated set.
#[derive(Clone, Debug, PartialEq)]
pub struct FrontPoint {
    /// Id of the program.
    pub solution: SolutionId,
    /// F(c).
    pub objectives: Objectives,
    /// The attempt that brought it, whose content the history shows; `None` for the first parent.
    pub attempt: Option<AttemptId>,
    /// True if it is the parent that is edited.
    pub is_parent: bool,
    /// The same on the present window, where the parent and its children are compared; only in detailed questions.
    pub on_window: Option<Objectives>,
}

/// `ref | scenes | attacked | <feature> | .. | describes`. What is not known is `-`; in compact questions nothing stands for it.
pub fn clusters(clusters: &[Cluster], compact: bool) -> String {
    let (between, unknown, decimals) = if compact { (BAR, "", COMPACT_DECIMALS) } else { (" | ", "-", DECIMALS) };
    let features: BTreeSet<&str> =
        clusters.iter().flat_map(|cluster| cluster.features.keys().map(String::as_str)).collect();
    let known = |x: Option<f64>, decimals| x.map_or(unknown.to_string(), |x| num::rounded(x, decimals).to_string());
    let counted = clusters.iter().any(|cluster| !cluster.outcomes.is_empty()).then_some("outcomes");
    let head = ["ref", "scenes", "attacked"].into_iter().chain(features.iter().copied()).chain(counted);
    // With more clusters what they mean stands once, above the table.
    let head = head.chain(counted.is_none().then_some("describes"));
    let row = |cluster: &Cluster| {
        let own = [cluster.name.clone(), cluster.scenes.to_string(), known(cluster.attacked_share, decimals)];
        let values = features.iter().map(|name| known(cluster.features.get(*name).copied(), FEATURE_DECIMALS));
        let outcomes = counted.map(|_| {
            let mut all: Vec<_> = cluster.outcomes.iter().collect();
            all.sort_by_key(|(name, count)| (std::cmp::Reverse(**count), **name));
            all.iter().map(|(name, count)| format!("{count} {name}")).collect::<Vec<_>>().join(if compact {
                " "
            } else {
                ", "
            })
        });
        let describes = counted.is_none().then(|| cluster.describes.clone());
        own.into_iter().chain(values).chain(outcomes).chain(describes).collect::<Vec<_>>().join(between)
    };
    let head = head.collect::<Vec<_>>().join(between);
    [head].into_iter().chain(clusters.iter().map(row)).collect::<Vec<_>>().join("\n")
}

/// `program | attack | realism`, the same on the window where it is known, and which of them is edited. In compact questions of a lineage
/// its name stands before no id.
pub fn front(front: &[FrontPoint], compact: Option<&LineageId>) -> String {
    let (between, decimals) = if compact.is_some() { (BAR, COMPACT_DECIMALS) } else { (" | ", DECIMALS) };
    let both = |of: &Objectives| [of.attack, of.realism].map(|x| num::rounded(x, decimals).to_string());
    let row = |point: &FrontPoint| {
        let id = point.solution.as_str();
        let id = compact.map_or(id, |lineage| within(id, lineage)).to_string();
        let window = point.on_window.iter().flat_map(both);
        let edited = point.is_parent.then(|| "the parent".to_string());
        let cells = [id].into_iter().chain(both(&point.objectives)).chain(window).chain(edited);
        cells.collect::<Vec<_>>().join(between)
    };
    let known = front.iter().any(|point| point.on_window.is_some());
    let window: &[&str] = if known { &["attack on this window", "realism on this window"] } else { &[] };
    let head = ["program", "attack", "realism"].iter().chain(window).copied().collect::<Vec<_>>().join(between);
    [head].into_iter().chain(front.iter().map(row)).collect::<Vec<_>>().join("\n")
}

/// An id without the name of its lineage, where it is of this one.
pub fn within<'i>(id: &'i str, lineage: &LineageId) -> &'i str {
    id.strip_prefix(lineage.as_str()).and_then(|rest| rest.strip_prefix('/')).unwrap_or(id)
}
