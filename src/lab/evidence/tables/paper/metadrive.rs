//! The MetaDrive tables.

use super::Figures;

/// Label of the table that averages over the ego policies.
pub const MAIN_LABEL: &str = "tab:metadrive-main-generator-evolution";
/// Label of the table with a row for every generator and ego policy.
pub const POLICY_LABEL: &str = "tab:metadrive-paper-baseline-profile-detail";

/// A generator as a row of the paper names it.
#[derive(Debug, PartialEq)]
pub struct Method {
    /// Row of the policy table.
    pub name: &'static str,
    /// Row of the main table, which averages SAGE over its weights.
    pub group: &'static str,
    /// Source family of our lineages.
    pub family: &'static str,
    /// SAGE's preference weight w.
    pub weight: Option<f64>,
}

const fn method(name: &'static str, family: &'static str) -> Method {
    Method { name, group: name, family, weight: None }
}

const fn sage(name: &'static str, weight: f64) -> Method {
    Method { name, group: "SAGE", family: "sage", weight: Some(weight) }
}

/// The rows of the policy table, in its order.
pub const METHODS: [Method; 10] = [
    method("CAT", "cat"),
    method("ADV-BMT", "adv_bmt"),
    method("AT", "at"),
    sage("SAGE (w=0.00)", 0.0),
    sage("SAGE (w=0.50)", 0.5),
    sage("SAGE (w=1.00)", 1.0),
    method("LLM-Attacker", "llm_attacker"),
    method("KING", "king"),
    method("SEAL", "seal"),
    method("STRIVE", "strive"),
];

/// Columns of tab:metadrive-main-generator-evolution, in its order.
const MAIN_COLUMNS: [&str; 7] = [
    "parent_attack",
    "parent_rp_pct",
    "evolved_attack",
    "evolved_rp_pct",
    "attack_change_pct",
    "rp_change_pp",
    "pf_area_at_3_pct",
];

/// Columns of tab:metadrive-paper-baseline-profile-detail, in its order.
const POLICY_COLUMNS: [&str; 7] = [
    "parent_attack",
    "parent_rp_pct",
    "evolved_attack",
    "evolved_rp_pct",
    "endpoint_attack",
    "endpoint_rp_pct",
    "pf_area_at_3_pct",
];

/// tab:metadrive-main-generator-evolution.
const MAIN: [(&str, [f64; 7]); 8] = [
    ("CAT", [0.345, 10.66, 0.330, 3.85, -4.3, -6.81, 7.4]),
    ("ADV-BMT", [0.260, 2.27, 0.295, 1.77, 13.5, -0.51, 18.7]),
    ("AT", [0.231, 0.09, 0.265, 1.06, 14.7, 0.97, 14.9]),
    ("SAGE", [0.211, 0.06, 0.234, 0.72, 10.7, 0.66, 13.2]),
    ("LLM-Attacker", [0.221, 0.28, 0.231, 0.51, 4.5, 0.23, 5.2]),
    ("KING", [0.261, 0.16, 0.280, 0.78, 7.2, 0.62, 7.0]),
    ("SEAL", [0.211, 0.07, 0.245, 1.02, 16.0, 0.95, 15.9]),
    ("STRIVE", [0.226, 0.04, 0.245, 0.74, 8.3, 0.70, 8.0]),
];

/// tab:metadrive-paper-baseline-profile-detail.
const POLICY: [(&str, &str, [f64; 7]); 20] = [
    ("CAT", "IDM", [0.390, 10.65, 0.370, 3.84, 0.370, 3.84, 7.2]),
    ("CAT", "RL", [0.300, 10.67, 0.290, 3.87, 0.290, 3.87, 7.6]),
    ("ADV-BMT", "IDM", [0.340, 2.74, 0.350, 1.79, 0.350, 1.79, 4.0]),
    ("ADV-BMT", "RL", [0.180, 1.81, 0.240, 1.74, 0.240, 1.74, 33.4]),
    ("AT", "IDM", [0.222, 0.09, 0.280, 1.50, 0.280, 1.50, 25.6]),
    ("AT", "RL", [0.240, 0.09, 0.250, 0.62, 0.250, 0.62, 4.1]),
    ("SAGE (w=0.00)", "IDM", [0.232, 0.09, 0.270, 1.51, 0.270, 1.51, 16.0]),
    ("SAGE (w=0.50)", "IDM", [0.232, 0.06, 0.232, 0.06, 0.270, 1.39, 16.0]),
    ("SAGE (w=1.00)", "IDM", [0.232, 0.04, 0.280, 1.48, 0.280, 1.48, 20.2]),
    ("SAGE (w=0.00)", "RL", [0.180, 0.09, 0.210, 0.62, 0.210, 0.62, 16.6]),
    ("SAGE (w=0.50)", "RL", [0.200, 0.06, 0.200, 0.06, 0.190, 0.52, 0.0]),
    ("SAGE (w=1.00)", "RL", [0.190, 0.04, 0.210, 0.59, 0.210, 0.59, 10.5]),
    ("LLM-Attacker", "IDM", [0.253, 0.26, 0.253, 0.26, 0.250, 1.48, 0.0]),
    ("LLM-Attacker", "RL", [0.190, 0.30, 0.210, 0.76, 0.210, 0.76, 10.5]),
    ("KING", "IDM", [0.263, 0.15, 0.300, 1.38, 0.300, 1.38, 14.1]),
    ("KING", "RL", [0.260, 0.18, 0.260, 0.18, 0.260, 0.48, 0.0]),
    ("SEAL", "IDM", [0.232, 0.07, 0.270, 1.46, 0.270, 1.46, 16.0]),
    ("SEAL", "RL", [0.190, 0.08, 0.220, 0.59, 0.220, 0.59, 15.7]),
    ("STRIVE", "IDM", [0.232, 0.04, 0.270, 1.44, 0.270, 1.44, 16.0]),
    ("STRIVE", "RL", [0.220, 0.04, 0.220, 0.04, 0.190, 0.53, 0.0]),
];

/// tab:actor-critic-diagnostic, which names no ego: per cent of the proposals that were reviewed.
pub const CRITICS_LABEL: &str = "tab:actor-critic-diagnostic";
/// Keys of its columns.
pub const CRITIC_COLUMNS: [&str; 3] = ["intervened_pct", "repaired_pct", "stopped_pct"];
const CRITICS: [(&str, [f64; 3]); 2] = [("cat", [89.0, 88.5, 23.5]), ("adv_bmt", [87.3, 85.9, 13.2])];

/// Figures of a family's row of the critics' table.
pub fn critic_figures(family: &str, _: &str) -> Option<Figures> {
    CRITICS.iter().find(|(name, _)| *name == family).map(|(_, figures)| Figures::new(CRITIC_COLUMNS, figures))
}

/// Figures of a row of the main table.
pub fn main_figures(group: &str) -> Option<Figures> {
    MAIN.iter().find(|(name, _)| *name == group).map(|(_, figures)| Figures::new(MAIN_COLUMNS, figures))
}

/// Figures of a row of the policy table.
pub fn policy_figures(name: &str, policy: &str) -> Option<Figures> {
    let row = POLICY.iter().find(|(n, p, _)| *n == name && *p == policy);
    row.map(|(_, _, figures)| Figures::new(POLICY_COLUMNS, figures))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::archive::{Contender, SelectorOptions, hypervolume, select_active};
    use crate::objects::{Objectives, ReportedBy, SolutionId};

    /// Parent, reported program and endpoint of a row as [attack, realism].
    fn points(row: &[f64; 7]) -> [[f64; 2]; 3] {
        [0, 2, 4].map(|place| [row[place], 1.0 - row[place + 1] / 100.0])
    }

    #[test]
    fn the_papers_rows_give_its_frontier_area_above_the_origin_and_above_no_other_corner() {
        let farthest = |reference: [f64; 2]| {
            let of = |row: &[f64; 7]| {
                let [parent, reported, endpoint] = points(row);
                let before = hypervolume(&[parent], reference);
                let after = hypervolume(&[parent, reported, endpoint], reference);
                (100.0 * (after - before) / before - row[6]).abs()
            };
            POLICY.iter().map(|(_, _, row)| of(row)).fold(0.0, f64::max)
        };
        assert!(farthest([0.0, 0.0]) < 0.25, "{}", farthest([0.0, 0.0]));
        for other in [[0.0, 0.5], [0.1, 0.0], [0.1, 0.5]] {
            assert!(farthest(other) > 1.0, "{other:?}: {}", farthest(other));
        }
    }

    #[test]
    fn two_of_the_papers_twenty_rows_contradict_our_rule_of_reporting_and_one_contradicts_the_best_attack() {
        let options = SelectorOptions::at(0.95, 0.05);
        let contradicts = |options: &SelectorOptions| {
            let of = |row: &[f64; 7]| {
                let [parent, reported, endpoint] = points(row);
                let contender = |(name, [attack, realism]): (&str, [f64; 2])| Contender {
                    solution: SolutionId::new(name),
                    objectives: Objectives { attack, realism },
                    coverage: 1.0,
                };
                let chosen = select_active(&[("parent", parent), ("endpoint", endpoint)].map(contender), options);
                let Objectives { attack, realism } = chosen.expect("both act").objectives;
                [attack, realism] != reported
            };
            let rows = POLICY.iter().filter(|(_, _, row)| of(row));
            rows.map(|(name, ego, _)| format!("{name}/{ego}")).collect::<Vec<_>>()
        };
        assert_eq!(contradicts(&options), ["AT/RL", "SAGE (w=0.50)/IDM"]);
        let strongest = SelectorOptions { rule: ReportedBy::BestAttack, ..options };
        assert_eq!(
            contradicts(&strongest),
            ["SAGE (w=0.50)/IDM"],
            "the nearest: experiments/protocols/published.toml has it"
        );
        let protocol: toml::Table =
            include_str!("../../../../../experiments/protocols/published.toml").parse().unwrap();
        assert_eq!(protocol["selector"]["rule"].as_str(), Some("best_attack"));
    }

    #[test]
    fn the_main_table_is_the_mean_of_the_policy_table_up_to_rounding() {
        for (group, figures) in &MAIN {
            let names: Vec<&str> = METHODS.iter().filter(|m| m.group == *group).map(|m| m.name).collect();
            let rows: Vec<&[f64; 7]> =
                POLICY.iter().filter(|(name, _, _)| names.contains(name)).map(|(_, _, figures)| figures).collect();
            assert_eq!(rows.len(), 2 * names.len(), "{group}");
            let mean = |column: usize| rows.iter().map(|row| row[column]).sum::<f64>() / rows.len() as f64;
            for (column, tolerance) in [(0, 0.0006), (1, 0.006), (2, 0.0006), (3, 0.006)] {
                assert!((figures[column] - mean(column)).abs() < tolerance, "{group} {column}: {}", mean(column));
            }
            assert!((figures[6] - mean(6)).abs() < 0.11, "{group}: {}", mean(6));
        }
    }

    #[test]
    fn every_method_has_a_row_for_every_policy() {
        for method in &METHODS {
            assert!(main_figures(method.group).is_some(), "{}", method.name);
            for (_, policy) in super::super::POLICIES {
                assert!(policy_figures(method.name, policy).is_some(), "{} {policy}", method.name);
            }
        }
    }
}
