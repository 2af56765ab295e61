//! The judge, rule by rule, against challengers that differ in one measure; and what may not reach a decision.

use proptest::prelude::*;

use super::tests::{columns, configuration, label};
use super::*;
use crate::kernel::Threads;
use crate::objects::*;

const EPOCHS: u32 = 6;
const OF_EPOCH: usize = 10;

fn options() -> WorldAgentOptions {
    WorldAgentOptions {
        rounds: 1,
        fit_labels_min: 8,
        held_labels_min: 20,
        coverage_slack_pct: 1.0,
        gain_errors: 1.0,
        audit_share: [0.1, 0.5],
    }
}

/// Sixty candidates of six epochs. The later in its epoch the more one gains in attack; realism differs by turns.
fn candidates(accepted: fn(usize) -> bool) -> Vec<WorldLabel> {
    let one = |k: usize| {
        let place = k % OF_EPOCH;
        let mut label = label((k / OF_EPOCH) as u32, &[place as f64, (k % 7) as f64], 0.04 * place as f64 - 0.2);
        label.labels.realism += if k.is_multiple_of(2) { 0.1 } else { -0.05 };
        label.accepted = accepted(place);
        label
    };
    (0..EPOCHS as usize * OF_EPOCH).map(one).collect()
}

/// Statement of a made-up configuration about the candidate at a place of its epoch.
struct Says {
    rank_score: f64,
    realism: f64,
    holds: bool,
    weak: bool,
}

/// The incumbent: ranks by every third place, knows half of each difference of realism, and four in five of its intervals hold.
fn usual(k: usize, label: &WorldLabel) -> Says {
    let rank_score = ((k % OF_EPOCH) * 7 % OF_EPOCH) as f64;
    Says { rank_score, realism: 0.5 * label.difference().realism, holds: !k.is_multiple_of(5), weak: false }
}

fn made_up<'a>(
    labels: &'a [WorldLabel],
    lineage: &'a LineageId,
    says: impl Fn(usize, &WorldLabel) -> Says,
) -> Vec<Held<'a>> {
    let one = |(k, label): (usize, &'a WorldLabel)| {
        let Says { rank_score, realism, holds, weak } = says(k, label);
        let difference = Objectives { attack: 0.0, realism };
        let error = label.difference().less(&difference);
        let half = |error: f64| if holds { error.abs() + 0.01 } else { 0.5 * error.abs() + 1e-6 };
        let half_width = Some(Objectives { attack: half(error.attack + 0.001), realism: half(error.realism) });
        let prediction = Prediction { objectives: label.labels, difference, half_width, rank_score, of_pairs: None };
        Held { evidence: Evidence { label, lineage, weight: 1.0 }, prediction, weak }
    };
    labels.iter().enumerate().map(one).collect()
}

/// The rules that object to a challenger.
fn objections(
    accepted: fn(usize) -> bool,
    options: &WorldAgentOptions,
    challenger: impl Fn(usize, &WorldLabel) -> Says,
) -> Vec<JudgeRule> {
    let (labels, lineage) = (candidates(accepted), LineageId::new("cat-idm"));
    let (schema, founding) = (columns(2), configuration(WorldModel::Ridge));
    let judging = Judging { schema: &schema, founding: &founding, options, before: EPOCHS };
    let (old, new) = (made_up(&labels, &lineage, usual), made_up(&labels, &lineage, challenger));
    judge(&judging, &old, &new).objections.into_iter().map(|objection| objection.rule).collect()
}

/// Ranks as the labels do.
fn sighted(k: usize, label: &WorldLabel) -> Says {
    Says { rank_score: label.difference().attack + label.difference().realism, ..usual(k, label) }
}

fn last(place: usize) -> bool {
    place >= 8
}

fn nobody(_: usize) -> bool {
    false
}

#[test]
fn a_challenger_that_ranks_better_and_worsens_nothing_is_promoted() {
    assert_eq!(objections(last, &options(), sighted), []);
}

#[test]
fn too_few_held_candidates_keep_the_incumbent() {
    let many = WorldAgentOptions { held_labels_min: 61, ..options() };
    assert_eq!(objections(last, &many, sighted), [JudgeRule::Evidence]);
}

#[test]
fn a_worse_rank_is_refused_whatever_else_gains() {
    let blind = |k: usize, label: &WorldLabel| Says {
        rank_score: -label.difference().attack,
        realism: 0.9 * label.difference().realism,
        ..usual(k, label)
    };
    assert_eq!(objections(nobody, &options(), blind), [JudgeRule::Ranking]);
}

#[test]
fn a_larger_error_of_realism_is_refused_whatever_else_gains() {
    let worse = |k: usize, label: &WorldLabel| Says { realism: 0.4 * label.difference().realism, ..sighted(k, label) };
    assert_eq!(objections(last, &options(), worse), [JudgeRule::RealismError]);
}

#[test]
fn intervals_that_hold_everything_are_as_far_off_as_intervals_that_hold_too_little() {
    let wide = |k: usize, label: &WorldLabel| Says { holds: true, ..sighted(k, label) };
    assert_eq!(objections(last, &options(), wide), [JudgeRule::Coverage]);
    let narrow = |k: usize, label: &WorldLabel| Says { holds: k.is_multiple_of(2), ..sighted(k, label) };
    assert_eq!(objections(last, &options(), narrow), [JudgeRule::Coverage]);
    let within = WorldAgentOptions { coverage_slack_pct: 21.0, ..options() };
    assert_eq!(objections(last, &within, wide), []);
}

#[test]
fn more_false_rejects_are_refused_whatever_else_gains() {
    // The archive accepts those alone that gain least; the incumbent has them in front.
    fn first(place: usize) -> bool {
        place == 7
    }
    let missing = |k: usize, label: &WorldLabel| {
        let said = sighted(k, label);
        Says { rank_score: if first(k % OF_EPOCH) { -9.0 } else { said.rank_score }, ..said }
    };
    assert_eq!(objections(first, &options(), missing), [JudgeRule::FalseRejects]);
}

#[test]
fn a_tie_keeps_the_incumbent_and_so_does_a_gain_of_one_epoch() {
    assert_eq!(objections(last, &options(), usual), [JudgeRule::Gain]);
    let once = |k: usize, label: &WorldLabel| if k < OF_EPOCH { sighted(k, label) } else { usual(k, label) };
    let strict = WorldAgentOptions { gain_errors: 1.5, ..options() };
    assert_eq!(objections(nobody, &strict, once), [JudgeRule::Gain]);
    let lenient = WorldAgentOptions { gain_errors: 0.5, ..options() };
    assert_eq!(objections(nobody, &lenient, once), []);
}

#[test]
fn turning_everybody_away_never_lowers_false_rejects() {
    let harsh = |k: usize, label: &WorldLabel| Says { weak: true, ..sighted(k, label) };
    assert_eq!(objections(last, &options(), harsh), [JudgeRule::FalseRejects]);
}

#[test]
fn a_rank_that_tells_lineages_apart_and_no_candidates_of_one_is_no_rank() {
    let by_epoch = |k: usize, label: &WorldLabel| Says { rank_score: (k / OF_EPOCH) as f64, ..usual(k, label) };
    let (labels, lineage) = (candidates(last), LineageId::new("cat-idm"));
    let of = made_up(&labels, &lineage, by_epoch);
    let measured = super::held::measures(&of.iter().collect::<Vec<_>>(), &configuration(WorldModel::Ridge).routing);
    assert_eq!(measured.rank_correlation, None);
}

#[test]
fn a_drawn_candidate_counts_for_all_that_it_stands_for() {
    let (mut labels, lineage) = (candidates(nobody), LineageId::new("cat-idm"));
    labels.truncate(3);
    labels[0].accepted = true;
    let mut of = made_up(&labels, &lineage, |k, label| Says { rank_score: -(k as f64), ..usual(k, label) });
    // The first by rank stands for seven; three places of the budget go by rank.
    of[0].evidence.weight = 7.0;
    let routing = RoutingOptions { rollout_budget: 6, audit_share: 0.5, ..configuration(WorldModel::Ridge).routing };
    let measured = super::held::measures(&of.iter().collect::<Vec<_>>(), &routing);
    let missed = 100.0 * 4.0 / 9.0;
    assert!((measured.false_reject_pct.unwrap() - missed).abs() < 1e-9, "{measured:?}");
}

#[test]
fn a_rank_correlation_is_worked_by_hand() {
    let lineage = LineageId::new("cat-idm");
    // One epoch of three, of whom the last stands for two. Gains rise, ranks are 3, 1, 2.
    let labels: Vec<WorldLabel> = (1..4).map(|k| label(0, &[0.0, 0.0], 0.1 * f64::from(k))).collect();
    let mut held = made_up(&labels, &lineage, |k, _| Says {
        rank_score: [3.0, 1.0, 2.0][k],
        realism: 0.0,
        holds: true,
        weak: false,
    });
    held[2].evidence.weight = 2.0;
    let routing = configuration(WorldModel::Ridge).routing;
    let measured = super::held::measures(&held.iter().collect::<Vec<_>>(), &routing).rank_correlation.unwrap();
    // Centred ranks 0.375, -0.375, 0 and -0.375, -0.125, 0.25; products -0.09375, squares 0.28125 each.
    assert!((measured + 1.0 / 3.0).abs() < 1e-12, "{measured}");
    // Against a rank that differs from the gains in its spread: squares 0.375 and 0.28125.
    held[1].prediction.rank_score = 3.0;
    let tied = super::held::measures(&held.iter().collect::<Vec<_>>(), &routing).rank_correlation.unwrap();
    // Centred ranks 0.25, 0.25, -0.25: squares 0.25, products -0.09375 - 0.03125 - 0.125.
    assert!((tied + 0.25 / (0.25_f64 * 0.28125).sqrt()).abs() < 1e-12, "{tied}");
}

fn evidence<'a>(labels: &'a [WorldLabel], lineage: &'a LineageId) -> Vec<Evidence<'a>> {
    labels.iter().map(|label| Evidence { label, lineage, weight: 1.0 }).collect()
}

fn fits<'a>(judging: &Judging<'_>, configuration: &WorldConfiguration, known: &[Evidence<'a>]) -> Vec<Held<'a>> {
    held(judging, configuration, known, &Threads::new(1).unwrap()).unwrap()
}

#[test]
fn a_change_of_the_share_of_audits_alone_earns_nothing() {
    let (labels, lineage) = (candidates(last), LineageId::new("cat-idm"));
    let (schema, founding, options) = (columns(2), configuration(WorldModel::Ridge), options());
    let judging = Judging { schema: &schema, founding: &founding, options: &options, before: EPOCHS };
    for share in [0.1, 0.5] {
        let mut other = founding.clone();
        other.routing.audit_share = share;
        let of = |configuration| fits(&judging, configuration, &evidence(&labels, &lineage));
        let measured = judge(&judging, &of(&founding), &of(&other));
        let rules: Vec<JudgeRule> = measured.objections.iter().map(|objection| objection.rule).collect();
        assert_eq!(rules, [JudgeRule::Gain]);
    }
}

#[test]
fn an_evaluator_that_sees_the_decisive_column_takes_the_place_of_one_that_does_not() {
    let (labels, lineage) = (candidates(last), LineageId::new("cat-idm"));
    let (schema, founding, options) = (columns(2), configuration(WorldModel::Ridge), options());
    let blind = WorldConfiguration { excluded_columns: vec!["x0".into()], ..founding.clone() };
    let judging = Judging { schema: &schema, founding: &founding, options: &options, before: EPOCHS };
    let known = evidence(&labels, &lineage);
    let (old, new) = (fits(&judging, &blind, &known), fits(&judging, &founding, &known));
    let measured = judge(&judging, &old, &new);
    let ranked = measured.gains.iter().find(|gain| gain.rule == JudgeRule::Ranking).unwrap();
    assert!(ranked.gain > 0.5, "{measured:?}");
    let back = judge(&judging, &new, &old);
    let objection = back.objections.iter().find(|objection| objection.rule == JudgeRule::Ranking).unwrap();
    let number = |of: &WorldMeasures| format!("{:.4}", of.rank_correlation.unwrap());
    let (from, to) = (number(&back.incumbent), number(&back.challenger));
    assert_eq!(objection.says, format!("rank correlation would go from {from} to {to}"));
    let audited = audit(&judging, &blind, &known, &old);
    let scene = audited.groups.iter().find(|group| group.group == "scene").unwrap();
    let (column, correlation) = scene.residual.clone().unwrap();
    assert!(column == "x0" && correlation > 0.7 && scene.excluded == 1, "{scene:?}");
    assert_eq!(audited.held_epochs, [1, 2, 3, 4, 5], "nothing is known before the first epoch");
}

#[test]
fn an_audit_counts_what_is_known_by_way_of_routing_and_names_the_column_that_the_prediction_misses() {
    let lineage = LineageId::new("cat-idm");
    let mut labels = candidates(last);
    // What decides stands in the second column; every third candidate was ranked, the others were drawn.
    for (k, label) in labels.iter_mut().enumerate() {
        label.row.features.reverse();
        label.decision = if k.is_multiple_of(3) { RouteDecision::Select } else { RouteDecision::Audit };
    }
    let (schema, founding, options) = (columns(2), configuration(WorldModel::Ridge), options());
    let blind = WorldConfiguration { excluded_columns: vec!["x1".into()], ..founding.clone() };
    let judging = Judging { schema: &schema, founding: &founding, options: &options, before: EPOCHS - 1 };
    let known = evidence(&labels, &lineage);
    let audited = audit(&judging, &blind, &known, &fits(&judging, &blind, &known));
    assert_eq!(
        (audited.labels, audited.before_epoch, audited.level_pct),
        (50, 5, 80.0),
        "the last epoch is not known yet"
    );
    let accepted = |found: RoutedShare| found.accepted_pct.unwrap() * found.candidates as f64 / 100.0;
    assert_eq!((audited.selected.candidates, audited.audited.candidates), (17, 33));
    // The last two of each epoch are accepted; of these 9, 18, 39 and 48 were ranked.
    assert!(
        (accepted(audited.selected) - 4.0).abs() < 1e-9 && (accepted(audited.audited) - 6.0).abs() < 1e-9,
        "{audited:?}"
    );
    assert_eq!(audited.families.keys().collect::<Vec<_>>(), [&FamilyName::new("cat")]);
    let [scene] = audited.groups.as_slice() else { panic!("one group has columns: {:?}", audited.groups) };
    assert_eq!((scene.columns, scene.excluded), (2, 1));
    assert_eq!(scene.residual.as_ref().unwrap().0, "x1", "the strongest, not the first");
    // An evaluator that predicts every difference misses nothing that a column could tell.
    let exact = |label| {
        let difference = WorldLabel::difference(label);
        let prediction =
            Prediction { objectives: label.labels, difference, half_width: None, rank_score: 0.0, of_pairs: None };
        Held { evidence: Evidence { label, lineage: &lineage, weight: 1.0 }, prediction, weak: false }
    };
    let held: Vec<Held<'_>> = labels.iter().map(exact).collect();
    assert_eq!(audit(&judging, &founding, &known, &held).groups[0].residual, None);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn no_label_of_an_epoch_reaches_the_turn_before_it(
        known in prop::collection::vec((0..4u32, 0.0..1.0f64, -0.3..=0.5f64, any::<bool>()), 50..70),
        later in prop::collection::vec((4..8u32, 0.0..1.0f64, -0.3..=0.5f64, any::<bool>()), 1..20),
        boosted in any::<bool>(),
    ) {
        let model = if boosted { WorldModel::Boosted } else { WorldModel::Ridge };
        let founding = WorldConfiguration { trees: 5, ..configuration(model) };
        let proposed = WorldConfiguration { beta_attack: 0.5, beta_realism: 0.7, explore: 0.5, ..founding.clone() };
        let of = |list: &[(u32, f64, f64, bool)]| -> Vec<WorldLabel> {
            list.iter().map(|(epoch, x, y, accepted)| WorldLabel { accepted: *accepted, ..label(*epoch, &[*x], *y) }).collect()
        };
        // Labels of the epoch that the turn is before and of later ones stand between the others.
        let (earlier, mut all) = (of(&known), of(&known));
        for (k, label) in of(&later).into_iter().enumerate() {
            all.insert((2 * k).min(all.len()), label);
        }
        let (schema, options, lineage) = (columns(1), options(), LineageId::new("cat-idm"));
        let judging = Judging { schema: &schema, founding: &founding, options: &options, before: 4 };
        let turn = |labels: &[WorldLabel]| {
            let known = evidence(labels, &lineage);
            let (old, new) = (fits(&judging, &founding, &known), fits(&judging, &proposed, &known));
            let predicted: Vec<Prediction> = old.iter().map(|held| held.prediction).collect();
            (audit(&judging, &founding, &known, &old), judge(&judging, &old, &new), predicted)
        };
        prop_assert_eq!(turn(&earlier), turn(&all));
        // A held candidate is predicted from the epochs before its own: other labels of its epoch change none of that.
        let (_, _, predicted) = turn(&earlier);
        let changed: Vec<WorldLabel> = earlier.iter().map(|of| match of.epoch {
            3 => WorldLabel { labels: Objectives { attack: 1.0 - of.labels.attack, ..of.labels }, ..of.clone() },
            _ => of.clone(),
        }).collect();
        prop_assert_eq!(predicted, turn(&changed).2);
        let other: Vec<WorldLabel> = earlier[1..].to_vec();
        prop_assert_ne!(turn(&earlier).0, turn(&other).0);
    }
}
