//! The counting of agreement, by hand.

use super::count::kappa;
use super::disagreement::{Cause, cause};
use super::*;

fn side(contact: Option<(&str, u32)>, x: f64) -> Side {
    let contact = contact.map(|(with, at_cs)| Meeting { with: with.into(), adversary: true, at_cs });
    Side { contact, end: "horizon".into(), ego: (0..80).map(|k| [k as f64, x]).collect(), distance_m_min: Some(2.0) }
}

fn pair(scene: usize, a: Option<(&str, u32)>, b: Option<(&str, u32)>, apart: f64) -> Pair {
    Pair {
        row: if scene.is_multiple_of(2) { "cat" } else { "replay" }.into(),
        program: "p".into(),
        scene: format!("s{scene}"),
        ego: "idm".into(),
        a: side(a, 0.0),
        b: side(b, apart),
        partner_is_there: true,
    }
}

#[test]
fn kappa_is_cohens() {
    // Cohen's measure by hand: 20 + 15 of 50 agree, chance 0.5 · 0.6 + 0.5 · 0.4 = 0.5, so (0.7 - 0.5) / 0.5.
    assert!((kappa([20, 5, 10, 15]).unwrap() - 0.4).abs() < 1e-12);
    assert_eq!(kappa([0, 0, 0, 7]), None, "nothing can be told where both always say no");
    assert_eq!(kappa([0, 0, 0, 0]), None);
    assert!((kappa([3, 0, 0, 5]).unwrap() - 1.0).abs() < 1e-12);
}

#[test]
fn rows_count_contacts_partners_times_and_egos() {
    let pairs = [
        pair(0, Some(("a", 400)), Some(("a", 420)), 0.5),
        pair(1, Some(("a", 600)), Some(("b", 600)), 1.5),
        pair(2, Some(("a", 400)), None, 3.0),
        pair(3, None, None, 9.0),
    ];
    let report = report(["x".into(), "y".into()], &pairs, vec![]);
    let all = &report.rows[0];
    assert_eq!((all.confusion, all.rollouts, all.same_partner), ([2, 1, 0, 1], 4, 1));
    assert!((all.agreement.value - 0.75).abs() < 1e-12 && all.agreement.low < 0.75);
    assert!((all.contact_time_apart_s.unwrap() - 0.1).abs() < 1e-9);
    // One second before: all three with a contact; five seconds before: only the contact at 6 s.
    assert_eq!(all.ego_apart_m[0], (1.0, Some(1.5), 3));
    assert_eq!(all.ego_apart_m[2], (5.0, Some(1.5), 1));
    assert_eq!(report.rows.iter().map(|row| row.row.as_str()).collect::<Vec<_>>(), ["all", "cat", "replay"]);
    assert_eq!(report.disagreements.len(), 1);
    assert_eq!((report.disagreements[0].contact_in, report.disagreements[0].cause), ("first", Cause::EgoElsewhere));
    assert!(text(&report).contains("| all | 4 | 2 | 1 | 0 | 1 | 75.0 ["), "{}", text(&report));
}

#[test]
fn a_disagreement_has_the_first_cause_that_holds() {
    let one = |spoil: &dyn Fn(&mut Pair)| {
        let mut pair = pair(0, None, Some(("a", 400)), 0.5);
        spoil(&mut pair);
        cause(&pair).unwrap()
    };
    assert_eq!(one(&|_| {}), Cause::Untold);
    assert_eq!(one(&|pair| pair.a.distance_m_min = Some(0.1)), Cause::NearMiss);
    assert_eq!(one(&|pair| pair.a.ego.iter_mut().for_each(|place| place[1] = 4.0)), Cause::EgoElsewhere);
    assert_eq!(one(&|pair| pair.partner_is_there = false), Cause::PartnerAbsent);
    assert_eq!(one(&|pair| pair.a.ego.truncate(20)), Cause::EndedBefore);
    assert_eq!(one(&|pair| pair.b.contact.as_mut().unwrap().at_cs = 6), Cause::Start);
    assert_eq!(cause(&pair(0, None, None, 0.0)), None);
}
