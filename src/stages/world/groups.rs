//! Groups of labelled candidates, whose means calibrate predictions.

use std::collections::BTreeMap;

use crate::kernel::num;
use crate::objects::{CalibrationGroup, GroupMean, Objectives, WorldLabel, WorldRow};

/// Returns the key of the group whose mean calibrates a row.
pub fn group_key(row: &WorldRow, group: CalibrationGroup) -> &str {
    match group {
        CalibrationGroup::Family => row.family.as_str(),
        CalibrationGroup::MechanismClass => &row.mechanism_class,
    }
}

/// Count and mean of a number of the labels, by group.
pub fn group_means_of(
    labels: &[&WorldLabel],
    key: impl Fn(&WorldLabel) -> String,
    of: impl Fn(&WorldLabel) -> Objectives,
) -> BTreeMap<String, GroupMean> {
    let mut members: BTreeMap<String, Vec<Objectives>> = BTreeMap::new();
    labels.iter().for_each(|label| members.entry(key(label)).or_default().push(of(label)));
    let mean = |all: &[Objectives], read: fn(&Objectives) -> f64| {
        num::mean(&all.iter().map(read).collect::<Vec<f64>>()).unwrap_or(0.0)
    };
    let group = |all: Vec<Objectives>| GroupMean {
        labels: all.len() as u32,
        mean: Objectives { attack: mean(&all, |o| o.attack), realism: mean(&all, |o| o.realism) },
    };
    members.into_iter().map(|(key, all)| (key, group(all))).collect()
}
