//! Measures of candidates that can be worked out by hand.

use super::{Case, quality};
use crate::kernel::Digest;
use crate::objects::{AttemptId, FamilyName, LineageId, Objectives, RouteDecision};
use crate::world::measures::{kendall, spearman};

fn point(attack: f64, realism: f64) -> Objectives {
    Objectives { attack, realism }
}

fn case(epoch: u32, predicted: f64, label: f64, accepted: bool) -> Case {
    Case {
        attempt: AttemptId::new(format!("cat-idm/e{epoch}s0")),
        program: Digest::of_bytes(b"program"),
        uncertainty: 0.1,
        parent: point(0.3, 0.9),
        labelled: Some(point(0.3 + label, 0.9)),
        lineage: LineageId::new("cat-idm"),
        family: FamilyName::new("cat"),
        epoch,
        decision: RouteDecision::Select,
        predicted: point(predicted, 0.0),
        half_width: Some(point(0.1, 0.1)),
        rank_score: predicted,
        label: Some((point(label, 0.0), accepted)),
        turned_away: false,
        weight: 1.0,
    }
}

#[test]
fn correlations_share_ranks_and_know_constants() {
    assert_eq!(spearman(&[1.0, 2.0, 3.0], &[5.0, 6.0, 9.0]), Some(1.0));
    assert_eq!(kendall(&[1.0, 2.0, 3.0], &[9.0, 6.0, 5.0]), Some(-1.0));
    assert_eq!(spearman(&[1.0, 1.0], &[0.0, 1.0]), None);
    let tied = spearman(&[1.0, 1.0, 2.0, 3.0], &[1.0, 2.0, 3.0, 4.0]).unwrap();
    assert!((tied - 4.5 / (4.5f64 * 5.0).sqrt()).abs() < 1e-12, "{tied}");
}

#[test]
fn errors_are_told_as_a_share_of_the_guess_that_nothing_changes() {
    let cases = [case(1, 0.1, 0.2, true), case(1, 0.0, -0.2, false)];
    let measured = quality(&cases.iter().collect::<Vec<_>>());
    // Errors 0.1 and 0.2 against differences of 0.2 and 0.2.
    assert!((measured.error_ratio_to_parent.unwrap() - (0.05f64 / 0.08).sqrt()).abs() < 1e-12);
    assert!((measured.absolute_error_ratio_to_parent.unwrap() - 0.75).abs() < 1e-12);
    // Of four labels one lies outside of its interval: the second attack.
    assert_eq!(measured.coverage_80_pct, Some(75.0));
    assert_eq!(measured.spearman_pooled, Some(1.0));
}

#[test]
fn a_drawn_reject_stands_for_its_stratum_and_the_selected_for_nobody() {
    let drawn = |weight: f64, accepted: bool| Case {
        decision: RouteDecision::Audit,
        turned_away: true,
        weight,
        ..case(1, 0.0, 0.1, accepted)
    };
    let cases = [case(1, 0.3, 0.3, true), drawn(9.0, false), drawn(3.0, true)];
    let measured = quality(&cases.iter().collect::<Vec<_>>());
    assert_eq!(measured.false_reject_pct, Some(25.0), "three of twelve");
    let of_a_draw = measured.false_reject_of_a_draw_pct.unwrap();
    assert!((of_a_draw - 100.0 * 4.0 / 13.0).abs() < 1e-12, "four of all thirteen: {of_a_draw}");
    assert_eq!((measured.selected_accepted_pct, measured.audited_accepted_pct), (Some(100.0), Some(50.0)));
    assert_eq!((measured.selected, measured.audited, measured.rejected), (1, 2, 0));
}

#[test]
fn recall_and_regret_look_at_the_first_three_in_ten_of_every_epoch() {
    let mut cases: Vec<Case> = (0..10).map(|k| case(1, f64::from(k) / 10.0, 0.0, k >= 6)).collect();
    cases[6].label = Some((point(0.5, 0.0), true));
    let measured = quality(&cases.iter().collect::<Vec<_>>());
    assert_eq!((measured.recall_top_30_pct, measured.precision_top_30_pct), (Some(75.0), Some(100.0)));
    assert_eq!(measured.regret, Some(0.5));
}

#[test]
fn a_rank_that_knows_nothing_turns_away_what_a_draw_does() {
    // Acceptance has nothing to do with the rank; an epoch that was drawn whole says nothing about either.
    let mut cases: Vec<Case> = (0..1000).map(|k| case(1, f64::from(k), 0.0, k % 10 == 0)).collect();
    cases.iter_mut().for_each(|case| case.turned_away = case.rank_score < 700.0);
    cases.push(Case { decision: RouteDecision::Audit, weight: 50.0, ..case(0, 0.0, 0.0, true) });
    let measured = quality(&cases.iter().collect::<Vec<_>>());
    assert_eq!((measured.false_reject_pct, measured.false_reject_of_a_draw_pct), (Some(10.0), Some(10.0)));
}
