//! The audit a_W of the active evaluator: what a world agent is told, from held evidence alone.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    held::{Evidence, Held, Judging, measures},
    measures::{gain, share_pct, spearman},
};
use crate::objects::{
    FamilyName, FeatureGroup, GroupAudit, RouteDecision, RoutedShare, WorldAudit, WorldConfiguration, WorldMeasures,
};

/// Measures the active configuration: over all held candidates, by family and by group of columns, and how its routing did.
pub fn audit(
    judging: &Judging<'_>,
    active: &WorldConfiguration,
    evidence: &[Evidence<'_>],
    held: &[Held<'_>],
) -> WorldAudit {
    let declared = &judging.founding.routing;
    let all: Vec<&Held<'_>> = held.iter().collect();
    let families: BTreeSet<&FamilyName> = held.iter().map(|held| &held.evidence.label.row.family).collect();
    let of_family = |family: &FamilyName| -> WorldMeasures {
        let own = all.iter().copied().filter(|held| held.evidence.label.row.family == *family);
        measures(&own.collect::<Vec<_>>(), declared)
    };
    let known: Vec<&Evidence<'_>> = evidence.iter().filter(|of| of.label.epoch < judging.before).collect();
    let held_epochs: BTreeSet<u32> = held.iter().map(|held| held.evidence.label.epoch).collect();
    WorldAudit {
        before_epoch: judging.before,
        labels: known.len(),
        held_epochs: held_epochs.into_iter().collect(),
        level_pct: 100.0 * judging.founding.interval_level,
        measures: measures(&all, declared),
        families: families
            .into_iter()
            .map(|family| (family.clone(), of_family(family)))
            .collect::<BTreeMap<FamilyName, WorldMeasures>>(),
        groups: FeatureGroup::ALL.into_iter().filter_map(|group| group_audit(judging, active, group, held)).collect(),
        selected: routed(&known, RouteDecision::Select),
        audited: routed(&known, RouteDecision::Audit),
    }
}

fn routed(known: &[&Evidence<'_>], decision: RouteDecision) -> RoutedShare {
    let of: Vec<bool> = known.iter().filter(|of| of.label.decision == decision).map(|of| of.label.accepted).collect();
    RoutedShare { candidates: of.len(), accepted_pct: share_pct(of.iter().map(|accepted| (1.0, *accepted))) }
}

/// `None` for a group that the schema has no column of.
fn group_audit(
    judging: &Judging<'_>,
    active: &WorldConfiguration,
    group: FeatureGroup,
    held: &[Held<'_>],
) -> Option<GroupAudit> {
    let columns = judging.schema.columns.iter().enumerate().filter(|(_, column)| column.group == group);
    let columns: Vec<(usize, &String)> = columns.map(|(place, column)| (place, &column.name)).collect();
    let missed: Vec<f64> =
        held.iter().map(|held| gain(&held.evidence.label.difference()) - gain(&held.prediction.difference)).collect();
    let correlation = |(place, name): &(usize, &String)| {
        let values: Vec<f64> =
            held.iter().map(|held| held.evidence.label.row.features.get(*place).copied().unwrap_or(0.0)).collect();
        Some(((*name).clone(), spearman(&values, &missed)?))
    };
    let strongest = |best: Option<(String, f64)>, next: (String, f64)| match best {
        Some(best) if best.1.abs() >= next.1.abs() => Some(best),
        _ => Some(next),
    };
    (!columns.is_empty()).then(|| GroupAudit {
        group: group.name().into(),
        columns: columns.len(),
        excluded: columns.iter().filter(|(_, name)| active.excluded_columns.contains(name)).count(),
        residual: columns.iter().filter_map(correlation).fold(None, strongest),
    })
}
