//! Balanced selection: the same number of scenes for every group of family and route, wherever it has eligible ones
//! (paper, appendix CARLA/SafeBench Protocol), so that easy families or routes do not dominate a result.
//!
//! The paper names no rank within a group. Ours is the quantity of its evolution traces, 100 A R Valid of the single
//! run, then R, then the earlier one: no attack without realism, and the parent wins a tie.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use super::safebench::{Group, point_of};
use crate::objects::benchmark::SafebenchRun;

/// Places of the runs that are kept, group after group, the best first. A group without a valid run keeps its best
/// invalid ones, which count as such: it may not vanish from the result.
pub fn balanced(runs: &[(Group, SafebenchRun)], per_group: usize) -> Vec<usize> {
    let mut groups: BTreeMap<Group, Vec<usize>> = BTreeMap::new();
    for (place, (group, _)) in runs.iter().enumerate() {
        groups.entry(*group).or_default().push(place);
    }
    let mut kept = Vec::new();
    for (_, mut places) in groups {
        if places.iter().any(|place| runs[*place].1.realism.valid) {
            places.retain(|place| runs[*place].1.realism.valid);
        }
        places.sort_by(|a, b| rank(&runs[*b].1, &runs[*a].1).then(a.cmp(b)));
        kept.extend(places.into_iter().take(per_group));
    }
    kept
}

fn rank(a: &SafebenchRun, b: &SafebenchRun) -> Ordering {
    let worth = |run: &SafebenchRun| {
        let (attack, realism) = point_of(run);
        (attack * realism, realism)
    };
    let (a, b) = (worth(a), worth(b));
    a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
}

#[cfg(test)]
mod tests {
    use super::super::safebench::samples::run;
    use super::*;
    use crate::scene::safebench::TrafficFamily::{LaneChanging, RightTurn};

    #[test]
    fn every_group_keeps_as_many_and_collisions_come_first() {
        let runs = [
            ((RightTurn, 4), run(false, true)),
            ((RightTurn, 4), run(true, true)),
            ((RightTurn, 4), run(true, true)),
            ((LaneChanging, 4), run(false, true)),
        ];
        assert_eq!(balanced(&runs, 1), [3, 1], "groups in the families' order; the earlier one of equals");
        assert_eq!(balanced(&runs, 2), [3, 1, 2]);
    }

    #[test]
    fn attack_times_realism_decides_then_realism() {
        let of = |collision, realism| {
            let mut run = run(collision, true);
            run.realism.sub_scores = [realism; 4];
            ((RightTurn, 4), run)
        };
        let runs = [of(true, 0.1), of(false, 0.7), of(true, 0.8), of(false, 1.0)];
        assert_eq!(balanced(&runs, 4), [2, 0, 3, 1]);
    }

    #[test]
    fn what_is_invalid_is_kept_only_where_there_is_nothing_else() {
        let runs = [((RightTurn, 4), run(true, false)), ((RightTurn, 4), run(false, true))];
        assert_eq!(balanced(&runs, 2), [1]);
        assert_eq!(balanced(&runs[..1], 2), [0]);
    }
}
