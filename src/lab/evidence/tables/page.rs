//! Choice of a table's columns for the width of a page: the most telling ones, and none in which every row says the same.

use super::key::RowKey;
use super::layout::{Row, Table};

/// Most columns of a table for a page, those of words counted in.
pub const COLUMNS_MAX: usize = 8;

/// Columns and counts by their keys, the most telling first; `None` where those of the table's beginning serve.
fn by_weight(name: &str) -> Option<&'static [&'static str]> {
    Some(match name {
        "metadrive-main" | "metadrive-policy" => &[
            "parent_attack",
            "evolved_attack",
            "attack_change",
            "pf_area_at_3_pct",
            "evolved_rp_pct",
            "parent_rp_pct",
            "rp_change_pp",
            "seeds",
        ],
        "metadrive-contacts" => {
            &["attack", "avoidable_contact", "met_anyway", "adversary_contact", "any_contact", "seeds"]
        }
        "metadrive-readings" => &[
            "published_parent",
            "published_evolved",
            "published_change",
            "evolved_rams",
            "preventable_parent",
            "preventable_evolved",
            "preventable_change",
        ],
        "metadrive-gains" => &[
            "attack_change",
            "over_random_proposals",
            "over_shuffled_labels",
            "area_change",
            "floor_low",
            "floor_middle",
            "floor_high",
        ],
        "safebench-main" => &[
            "parent_attack",
            "redrawn_attack",
            "evolved_attack",
            "attack_change_pct",
            "pf_area_change_pp",
            "ars_change_pp",
            "evolved_ars",
        ],
        "safebench-rounds" => &[
            "average",
            "straight_obstacle",
            "turning_obstacle",
            "lane_changing",
            "vehicle_passing",
            "red_light_running",
            "unprotected_left_turn",
            "right_turn",
            "crossing_negotiation",
        ],
        "safebench-held-out" => {
            &["parent_attack", "evolved_attack", "attack_change_pct", "parent_ars", "evolved_ars", "ars_change_pp"]
        }
        "proposals" => &[
            "readable_at_once_pct",
            "declined_pct",
            "refused_pct",
            "not_simulated_pct",
            "evaluated_pct",
            "accepted_pct",
            "attempts",
        ],
        "attack-only" | "without" => &[
            "attack",
            "realism",
            "pf_area_at_3_pct",
            "attack_change",
            "attack_p_holm",
            "realism_change",
            "realism_p_holm",
        ],
        "kwidth" => &["simulated", "validated", "accepted_of_simulated_pct", "speedup", "attack", "realism"],
        "downstream" => {
            &["crash_adversarial", "failure_adversarial", "completion_adversarial", "crash_plain", "completion_plain"]
        }
        _ => return None,
    })
}

/// Rows with a program: what is the same in all of these need not stand in each.
fn of_programs(table: &Table) -> impl Iterator<Item = &Row> {
    table.rows().filter(|row| !row.missing() && !matches!(row.key, RowKey::Replay(_)))
}

fn same_in_all<T: PartialEq>(table: &Table, part: impl Fn(&Row) -> T) -> bool {
    let mut all = of_programs(table).map(part);
    let first = all.next();
    all.all(|other| Some(&other) == first.as_ref())
}

/// Places of the columns of words that rows differ in; the first names the row and stays.
pub fn telling_labels(table: &Table) -> Vec<usize> {
    (0..table.labels.len()).filter(|at| *at == 0 || !same_in_all(table, |row| row.labels[*at].clone())).collect()
}

/// Returns `true` if rows differ in who proposed.
pub fn proposals_differ(table: &Table) -> bool {
    !same_in_all(table, |row| row.proposals.clone())
}

/// The table with what fits the width of a page.
pub fn of_a_page(table: &Table) -> Table {
    let room = COLUMNS_MAX.saturating_sub(telling_labels(table).len() + usize::from(proposals_differ(table)));
    let known = table.keys();
    let is_telling = |key: &&str| match table.counts.iter().position(|count| count.key == *key) {
        Some(at) => !same_in_all(table, |row| row.counts[at]),
        None => known.contains(key),
    };
    let numbers: Vec<&str> = table.columns.iter().map(|column| column.key).collect();
    let wanted = by_weight(table.name).map_or(numbers, <[&str]>::to_vec);
    let kept: Vec<&str> = wanted.into_iter().filter(is_telling).take(room).collect();
    table.with(&kept)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{CAT, End, add, run};
    use super::super::{NAMED, metadrive_policy, safebench_tests};
    use super::*;

    #[test]
    fn what_fits_a_page_is_of_the_table_and_at_most_eight_columns() {
        let mut metadrive = run("made", &[("actor", "scripted")]);
        add(&mut metadrive, &CAT);
        let safebench = safebench_tests::recorded_unseen();
        let mut made = 0;
        for (name, make) in NAMED {
            let Some(table) = [&metadrive, &safebench].into_iter().find_map(|run| make(std::slice::from_ref(run)).ok())
            else {
                continue;
            };
            made += 1;
            let page = of_a_page(&table);
            let all = telling_labels(&page).len() + page.keys().len() + usize::from(proposals_differ(&page));
            assert!((2..=COLUMNS_MAX).contains(&all), "{name}: {all}");
            // Some tables have no parent beside the evolved program, and no table lacks what its list begins with.
            let absent: Vec<_> =
                by_weight(name).into_iter().flatten().filter(|key| !table.keys().contains(key)).collect();
            assert!(absent.iter().all(|key| key.ends_with("_attack") || **key == "seeds"), "{name} has no {absent:?}");
        }
        assert!(made >= 10, "{made} tables");
    }

    #[test]
    fn a_column_that_tells_rows_apart_stays_and_one_that_does_not_goes() {
        let mut recorded = run("made", &[("actor", "scripted")]);
        add(&mut recorded, &CAT);
        let one = metadrive_policy(&[recorded.clone()]).unwrap();
        assert_eq!(telling_labels(&one), [0], "one ego");
        add(&mut recorded, &End { id: "cat-sac", ego: "learned", ..CAT });
        let two = metadrive_policy(&[recorded]).unwrap();
        assert_eq!(telling_labels(&two), [0, 1]);
        assert_eq!(
            of_a_page(&one).keys().len(),
            of_a_page(&two).keys().len() + 1,
            "a column of words takes a number's room"
        );
    }
}
