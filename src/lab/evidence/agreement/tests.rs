//! The counting of agreement, by hand.

use super::count::{EgoApart, Of, kappa};
use super::disagreement::{Cause, cause};
use super::*;

fn side(contact: Option<(&str, u32)>, x: f64) -> Side {
    let contact = contact.map(|(with, at_cs)| Meeting {
        with: with.into(),
        adversary: true,
        at_cs,
        class: "crossing".into(),
        striker: "ego".into(),
        avoidable: Some(true),
        relative_speed_mps: 5.0,
    });
    Side {
        published: contact.is_some(),
        preventable: contact.is_some(),
        contact,
        end: "horizon".into(),
        ego: (0..80).map(|k| [k as f64, x]).collect(),
        distance_m_min: Some(2.0),
    }
}

fn pair(scene: usize, a: Option<(&str, u32)>, b: Option<(&str, u32)>, apart: f64) -> Pair {
    Pair {
        program: if scene.is_multiple_of(2) { "cat/parent" } else { "replay against idm" }.into(),
        family: scene.is_multiple_of(2).then(|| "cat".into()),
        proposed: false,
        cluster: if scene < 2 { "dense" } else { "plain" }.into(),
        scene: format!("s{scene}"),
        ego: "idm".into(),
        a: side(a, 0.0),
        b: side(b, apart),
        partner_apart_m: Some(0.0),
        changed: vec![],
    }
}

fn counted(pairs: &[Pair]) -> Report {
    report(["x".into(), "y".into()], true, pairs, &Tried::default(), &[], vec![])
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
    let report = counted(&pairs);
    let all = &report.rows[0];
    assert_eq!((all.contact.confusion, all.rollouts, all.same_partner), ([2, 1, 0, 1], 4, 1));
    assert!((all.contact.agreement.value - 0.75).abs() < 1e-12 && all.contact.agreement.low < 0.75);
    assert!((all.contact_time_apart_s.unwrap() - 0.1).abs() < 1e-9);
    // One second before: all three with a contact; five seconds before: only the contact at 6 s.
    let apart =
        |before_s, median, p90, rollouts| EgoApart { before_s, median_m: Some(median), p90_m: Some(p90), rollouts };
    assert_eq!(all.ego_apart[0], apart(1.0, 1.5, 3.0, 3));
    assert_eq!(all.ego_apart[2], apart(5.0, 1.5, 1.5, 1));
    let counts: Vec<_> = report.rows.iter().map(|row| (row.of, row.row.as_str(), row.rollouts)).collect();
    assert_eq!(
        counts,
        [
            (Of::All, "all", 4),
            (Of::Program, "cat/parent", 2),
            (Of::Program, "replay against idm", 2),
            (Of::Family, "cat", 2),
            (Of::Cluster, "dense", 2),
            (Of::Cluster, "plain", 2)
        ]
    );
    assert_eq!(report.disagreements.len(), 1);
    assert_eq!((report.disagreements[0].contact_in, report.disagreements[0].cause), ("first", Cause::EgoElsewhere));
    assert!(text(&report).contains("| all | 4 | 2 | 1 | 0 | 1 | 75.0 ["), "{}", text(&report));
}

#[test]
fn a_proposal_moves_no_row_but_its_own() {
    let mut pairs = vec![pair(0, Some(("a", 400)), Some(("a", 400)), 0.0), pair(2, None, None, 0.0)];
    let before = counted(&pairs);
    let mut child = pair(2, Some(("a", 400)), None, 0.0);
    (child.program, child.proposed) = ("cat/e0s0".into(), true);
    pairs.push(child);
    let after = counted(&pairs);
    assert_eq!(after.rows[..before.rows.len()], before.rows);
    let own: Vec<_> = after.rows[before.rows.len()..].iter().map(|row| (row.of, row.row.as_str())).collect();
    assert_eq!(own, [(Of::Proposal, "cat/e0s0")]);
    assert_eq!(after.disagreements.len(), 1);
}

#[test]
fn runs_that_plan_apart_are_not_called_the_same_rollouts() {
    let says = |same| {
        text(&report(["x".into(), "y".into()], same, &[pair(0, None, None, 0.0)], &Tried::default(), &[], vec![]))
    };
    assert!(says(true).contains("the same rollouts in x (first)") && !says(true).contains("commands differ"));
    assert!(says(false).contains("the same programs in x (first)") && says(false).contains("commands differ"));
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
    let traffic_is_elsewhere = |pair: &mut Pair| {
        pair.partner_apart_m = Some(1.5);
        pair.b.contact.as_mut().unwrap().adversary = false;
    };
    assert_eq!(one(&traffic_is_elsewhere), Cause::Follower);
    assert_eq!(one(&|pair| pair.partner_apart_m = Some(1.5)), Cause::Untold, "an adversary follows nobody");
    assert_eq!(one(&|pair| pair.partner_apart_m = None), Cause::PartnerAbsent);
    assert_eq!(one(&|pair| pair.a.ego.truncate(20)), Cause::EndedBefore);
    assert_eq!(one(&|pair| pair.b.contact.as_mut().unwrap().at_cs = 6), Cause::Start);
    assert_eq!(cause(&pair(0, None, None, 0.0)), None);
}

#[test]
fn labels_are_compared_beside_contact() {
    let mut pairs = [
        pair(0, Some(("a", 400)), Some(("a", 400)), 0.0),
        pair(1, Some(("a", 400)), Some(("a", 400)), 0.0),
        // With somebody else: it counts for the attack, not for what kind of contact it is.
        pair(2, Some(("a", 400)), Some(("b", 400)), 0.0),
        pair(3, None, None, 0.0),
    ];
    let b = |pair: &mut Pair, change: &dyn Fn(&mut Meeting)| change(pair.b.contact.as_mut().unwrap());
    b(&mut pairs[0], &|met| (met.class, met.relative_speed_mps) = ("sideswipe".into(), 2.0));
    b(&mut pairs[1], &|met| (met.striker, met.avoidable) = ("other".into(), Some(false)));
    b(&mut pairs[2], &|met| met.class = "head_on".into());
    pairs[1].b.preventable = false;
    pairs[2].a.published = false;
    let of = counted(&pairs).rows[0].labels.clone();
    assert_eq!((of.published.confusion, of.preventable.confusion), ([2, 0, 1, 1], [2, 1, 0, 1]));
    assert!((of.published.agreement.value - 0.75).abs() < 1e-12);
    assert_eq!((of.contacts, of.same_class, of.same_striker), (2, 1, 1));
    assert_eq!((of.assessed, of.same_avoidability), (2, 1));
    assert_eq!((of.relative_speed_more_mps, of.relative_speed_apart_mps), (Some(-1.5), Some(1.5)));
    pairs[0].b.contact.as_mut().unwrap().avoidable = None;
    let of = counted(&pairs).rows[0].labels.clone();
    assert_eq!((of.assessed, of.same_avoidability), (1, 0), "who asks nobody says nothing");
}

#[test]
fn a_change_mends_what_disagrees_and_breaks_what_agrees() {
    let mut pairs = [
        pair(0, Some(("a", 400)), None, 0.0),
        pair(1, Some(("a", 400)), None, 0.0),
        pair(2, None, None, 0.0),
        pair(3, Some(("a", 400)), Some(("a", 400)), 0.0),
    ];
    for (pair, changed) in pairs.iter_mut().zip([[false, true], [false, true], [false, true], [true, true]]) {
        pair.changed = changed.to_vec();
    }
    let tried = Tried { own: 0, changes: vec!["boxes".into(), "brakes".into()] };
    let with = |own: usize, pairs: &[Pair]| {
        report(["x".into(), "y".into()], true, pairs, &Tried { own, ..tried.clone() }, &[], vec![])
    };
    let ours_first = with(0, &pairs);
    let counts = |of: &Report| of.changes.iter().map(|one| (one.mended, one.broken, one.confusion)).collect::<Vec<_>>();
    assert_eq!(counts(&ours_first), [(2, 0, [1, 0, 0, 3]), (0, 1, [1, 3, 0, 0])]);
    assert_eq!(ours_first.disagreements[0].mended_by, ["boxes"]);
    assert!(text(&ours_first).contains("| boxes | 2 | 100 | 0 | 100.0 | 1.00 |"), "{}", text(&ours_first));
    // Where the second is ours, the first is what it is held to.
    let ours_second = with(1, &pairs);
    assert_eq!(counts(&ours_second), [(0, 0, [1, 2, 0, 1]), (2, 1, [3, 0, 1, 0])]);
    assert_eq!(ours_second.disagreements[0].mended_by, ["brakes"]);
    assert!(with(0, &[pair(0, None, None, 0.0)]).disagreements.is_empty());
    assert!(!text(&counted(&pairs)).contains("one option changed"), "neither simulator is ours");
}

#[test]
fn a_gain_in_one_simulator_is_set_beside_the_other_scene_by_scene() {
    let met = Some(("a", 400));
    let named = |program: &str, pair: Pair| Pair { program: program.into(), ..pair };
    // The parent meets nobody in scene 0, and somebody in 1 in the first alone. The child meets somebody in 0 to 2 in the first, in 0 and
    // 1 in the second; scene 3 has no rollout of the parent.
    let pairs = [
        named("cat/parent", pair(0, None, None, 0.0)),
        named("cat/parent", pair(1, met, None, 0.0)),
        named("cat/parent", pair(2, None, None, 0.0)),
        named("new/parent", pair(0, met, met, 0.0)),
        named("new/parent", pair(1, met, met, 0.0)),
        named("new/parent", pair(2, met, None, 0.0)),
        named("new/parent", pair(3, met, met, 0.0)),
        named("worse/parent", pair(1, None, met, 0.0)),
    ];
    let descent = |evolved: &str| Descent { evolved: format!("{evolved}/parent"), parent: "cat/parent".into() };
    let descents = ["new", "worse", "absent"].map(descent);
    let report = report(["x".into(), "y".into()], true, &pairs, &Tried::default(), &descents, vec![]);
    let counts = |row: usize| {
        let gain = &report.transfers[row].gains[0];
        [gain.first.parent, gain.first.evolved, gain.second.parent, gain.second.evolved]
    };
    assert_eq!(
        report.transfers.iter().map(|of| of.rollouts).collect::<Vec<_>>(),
        [3, 1, 4],
        "who is absent has no row"
    );
    assert_eq!((counts(0), counts(1), counts(2)), ([1, 3, 0, 2], [1, 0, 0, 1], [2, 3, 0, 3]));
    let first = report.transfers[0].gains[0].first.gain;
    assert!((first.value - 2.0 / 3.0).abs() < 1e-12 && first.low < first.value && first.high > first.value);
    assert_eq!((first.low, first.high), (0.0, 1.0), "scenes are drawn");
    let said = text(&report);
    assert!(said.contains("for contact the same sign in 1, none in 0, the other in 1"), "{said}");
    assert!(said.contains("1 to 3: +66.7 [+0.0, +100.0] | 0 to 2: +66.7"), "{said}");
    assert!(!text(&counted(&pairs)).contains("evolved"), "nothing is said where nobody descends from anybody");
}
