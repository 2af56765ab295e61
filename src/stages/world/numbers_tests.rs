//! Numbers of the evaluator against cases worked by hand and against plain definitions.

use super::judge::jackknife;
use super::measures::{Compared, centred_ranks, coverage_pct, kendall, loss_ratio, share_pct, spearman};
use super::tests::{columns, configuration, label, xi};
use super::{CalibrationSet, Interaction, Router, settle};
use crate::kernel::{Seed, Threads, Vec2};
use crate::objects::*;
use crate::scene::fixture;
use crate::statistics::boosted::{self, is_sound};
use crate::statistics::table::{Table, moments, standardised};

/// A tree by its definition: of all questions the one that explains most, three levels deep. Gives each row's value, and whether
/// anything was asked.
fn plain_tree(
    table: &Table,
    left: &[f64],
    rows: &[usize],
    turn: usize,
    depth: usize,
    rate: f64,
) -> (Vec<(usize, f64)>, bool) {
    let gain = |rows: &[usize]| {
        let sum: f64 = rows.iter().map(|&row| table.weights[row] * left[row]).sum();
        let weight: f64 = rows.iter().map(|&row| table.weights[row]).sum();
        (sum * sum / (weight + 5.0), rate * sum / (weight + 5.0))
    };
    let mut best: Option<(f64, Vec<usize>, Vec<usize>)> = None;
    for column in (0..table.columns).filter(|column| column % 3 == turn && depth < 3) {
        for &bound in rows {
            let is_low = |row: &&usize| table.rows[**row][column] <= table.rows[bound][column];
            let (low, high): (Vec<usize>, Vec<usize>) = (
                rows.iter().filter(is_low).copied().collect(),
                rows.iter().filter(|row| !is_low(row)).copied().collect(),
            );
            let explained = gain(&low).0 + gain(&high).0 - gain(rows).0;
            if low.len() >= 5 && high.len() >= 5 && explained > best.as_ref().map_or(1e-12, |best| best.0) {
                best = Some((explained, low, high));
            }
        }
    }
    let Some((_, low, high)) = best else { return (rows.iter().map(|&row| (row, gain(rows).1)).collect(), false) };
    let side = |rows: &[usize]| plain_tree(table, left, rows, turn, depth + 1, rate).0;
    ([side(&low), side(&high)].concat(), true)
}

#[test]
fn boosted_trees_agree_with_their_plain_definition() {
    let mut stream = Seed(8).stream(&["trees"]);
    let rows: Vec<Vec<f64>> = (0..48).map(|_| (0..5).map(|_| stream.normal(0.0, 1.0)).collect()).collect();
    let weights: Vec<f64> = rows.iter().map(|_| stream.uniform(0.2, 1.0)).collect();
    let target: Vec<f64> = rows.iter().map(|r| r[0] * r[3] + 0.5 * r[1] + stream.normal(0.2, 0.1)).collect();
    let table = Table { rows, weights, columns: 5 };
    let mut known = vec![table.mean(&target); target.len()];
    let mut left: Vec<f64> = target.iter().map(|value| value - known[0]).collect();
    for turn in 0..7 {
        let everyone: Vec<usize> = (0..target.len()).collect();
        let (values, asked) = plain_tree(&table, &left, &everyone, turn % 3, 0, 0.3);
        for (row, value) in values {
            left[row] -= value;
            known[row] += if asked { value } else { 0.0 };
        }
    }
    let model = boosted::fit(&table, &target, 7, 0.3);
    for (row, plain) in table.rows.iter().zip(&known) {
        assert!((boosted::value_at(&model, row) - plain).abs() < 1e-12);
    }
}

#[test]
fn a_tree_is_sound_only_if_it_leads_on_and_reads_columns_that_there_are() {
    let leaf = TreeNode::Leaf { value: 1.0 };
    let split = |column, low, high| TreeNode::Split { column, bound: 0.5, low, high };
    let sound = |nodes: &[TreeNode]| is_sound(&Tree { nodes: nodes.to_vec() }, 2);
    assert!(sound(&[leaf]) && sound(&[split(1, 1, 2), leaf, leaf]));
    assert!(!sound(&[]), "without an answer");
    assert!(!sound(&[split(2, 1, 2), leaf, leaf]), "reads a third column");
    assert!(!sound(&[split(0, 0, 2), leaf, leaf]) && !sound(&[split(0, 1, 0), leaf, leaf]), "leads back to itself");
    assert!(!sound(&[split(0, 3, 2), leaf, leaf]) && !sound(&[split(0, 1, 3), leaf, leaf]), "leads nowhere");
}

#[test]
fn of_two_equal_questions_the_first_is_asked_and_a_leaf_keeps_five_rows() {
    let at = |k: usize| [0.0, 1.0, 2.0][k / 4];
    let table = Table { rows: (0..12).map(|k| vec![at(k)]).collect(), weights: vec![1.0; 12], columns: 1 };
    let target: Vec<f64> = (0..12).map(at).collect();
    assert!(boosted::fit(&table, &target, 3, 1.0).trees.is_empty(), "four rows are too few for a leaf");
    let table = Table { rows: (0..15).map(|k| vec![at(4 * (k / 5))]).collect(), weights: vec![1.0; 15], columns: 1 };
    let target: Vec<f64> = table.rows.iter().map(|row| row[0]).collect();
    let tree = boosted::fit(&table, &target, 1, 1.0).trees.remove(0);
    assert!(matches!(tree.nodes[0], TreeNode::Split { bound: 0.5, .. }), "{tree:?}");
}

#[test]
fn a_column_is_read_in_units_of_its_deviation_and_not_beyond_ten() {
    let rows: [&[f64]; 4] = [&[1.0, 3.0], &[3.0, 3.0], &[5.0, 3.0], &[7.0, 3.0]];
    assert_eq!(moments(&rows, 0), (4.0, 5f64.sqrt()));
    assert_eq!(moments(&rows, 1), (3.0, 0.0), "does not vary");
    let nearly = moments(&[&[1e6], &[1e6 + 1e-7]], 0);
    assert_eq!(nearly.1, 0.0, "what varies by less than a billionth of a thousandth of itself does not: {nearly:?}");
    assert_eq!(standardised(&[9.0, 4.0, -70.0], &[0, 1, 2], &[5.0, 4.0, 0.0], &[2.0, 0.0, 1.0]), [2.0, 0.0, -10.0]);
}

#[test]
fn equal_values_share_their_rank_in_both_correlations() {
    let (a, b) = ([1.0, 2.0, 2.0, 4.0], [1.0, 3.0, 2.0, 0.0]);
    // Ranks 1, 2.5, 2.5, 4 and 2, 4, 3, 1: the products of what they differ from 2.5 by sum to -1.5, the squares to 4.5 and 5.
    assert!((spearman(&a, &b).unwrap() + 1.5 / 22.5f64.sqrt()).abs() < 1e-12);
    // Of six pairs five differ in a; two go with b and three against.
    assert!((kendall(&a, &b).unwrap() + 1.0 / 30f64.sqrt()).abs() < 1e-12);
    assert_eq!((spearman(&a, &[3.0; 4]), spearman(&[3.0; 4], &a)), (None, None));
    assert_eq!((kendall(&a, &[3.0; 4]), kendall(&[3.0; 4], &a)), (None, None));
}

#[test]
fn a_weighted_rank_is_the_middle_of_the_weight_that_it_stands_for() {
    let ranks = centred_ranks(&[3.0, 1.0, 1.0, 7.0], &[2.0, 1.0, 1.0, 4.0]);
    assert_eq!(ranks, [-0.125, -0.375, -0.375, 0.25]);
}

#[test]
fn shares_and_losses_count_by_weight_and_are_none_of_nothing() {
    assert_eq!(share_pct([(3.0, true), (1.0, false)].into_iter()), Some(75.0));
    assert_eq!(share_pct(std::iter::empty()), None);
    let point = |attack, realism| Objectives { attack, realism };
    let one = |predicted, label, weight| Compared { predicted, half_width: None, label, weight };
    let both = [one(point(0.5, 0.0), point(1.0, 0.0), 2.0), one(point(0.0, 0.0), point(0.25, 0.0), 4.0)];
    // Errors of a half and a quarter, weighed 2 and 4, beside labels of 1 and a quarter.
    assert_eq!(loss_ratio(&both, &|error| error.attack), Some(2.0 / 3.0));
    assert_eq!(loss_ratio(&both, &|error| error.realism), None);
}

#[test]
fn a_label_on_the_edge_of_its_interval_lies_within_and_no_width_says_nothing() {
    let point = |attack, realism| Objectives { attack, realism };
    let one = |half_width, label, weight| Compared { predicted: point(0.0, 0.0), half_width, label, weight };
    let all = [
        one(Some(point(0.25, 0.0)), point(-0.25, 0.0), 3.0),
        one(Some(point(0.0, 0.25)), point(0.125, 0.5), 1.0),
        one(Some(point(0.0, 0.0)), point(1.0, 1.0), 9.0),
        one(None, point(1.0, 1.0), 9.0),
    ];
    assert_eq!(coverage_pct(&all), Some(75.0));
}

#[test]
fn a_log_that_passes_beside_gives_its_nearest_moment_and_who_goes_away_no_conflict() {
    let mut scene = fixture::two_lane_scene();
    scene.ego.track.samples = fixture::straight(scene.steps, Vec2::new(0.0, 0.0), 0.0, 10.0);
    scene.tracks.truncate(1);
    scene.tracks[0].samples = fixture::straight(scene.steps, Vec2::new(30.0, 4.0), 0.0, 4.0);
    // From the current step on: the gap shrinks by 6 m/s, 4 m to the side.
    let gap_m = |step: usize| 30.0 - 0.6 * step as f64;
    let steps = scene.current_step..scene.steps;
    let distance = |step: usize| (gap_m(step) * gap_m(step) + 16.0).sqrt();
    let nearest = steps.clone().map(distance).fold(f64::INFINITY, f64::min);
    let closing = |step: usize| 6.0 * gap_m(step) / distance(step);
    let conflict = steps.filter(|step| closing(*step) > 0.1).map(|step| distance(step) / closing(step));
    let computed = Interaction::of(&scene);
    assert!((computed.relative_distance_m_min - nearest).abs() < 1e-9);
    assert!((computed.relative_speed_mps - 6.0).abs() < 1e-9);
    assert!((computed.time_to_conflict_s_min - conflict.fold(20.0, f64::min)).abs() < 1e-9);
    assert!((computed.route_deviation_m_min - 4.0).abs() < 1e-9);
    scene.tracks[0].samples = fixture::straight(scene.steps, Vec2::new(30.0, 4.0), 0.0, 14.0);
    assert_eq!(Interaction::of(&scene).time_to_conflict_s_min, 20.0);
}

#[test]
fn an_ego_without_a_log_follows_its_route_at_its_first_speed() {
    let mut scene = fixture::two_lane_scene();
    let logged = fixture::straight(scene.steps, Vec2::new(2.0, 0.0), 0.0, 8.0);
    scene.ego.track.samples = logged.clone();
    scene.ego.route = vec![Vec2::new(0.0, 0.0), Vec2::new(160.0, 0.0)];
    scene.tracks.truncate(1);
    scene.tracks[0].samples = fixture::straight(scene.steps, Vec2::new(40.0, 1.0), 0.0, 6.0);
    let start = 3;
    (scene.ego.start_step, scene.current_step) = (start, start);
    let whole = Interaction::of(&scene);
    let unlogged = |(step, sample)| if step <= start { sample } else { None };
    scene.ego.track.samples = logged.into_iter().enumerate().map(unlogged).collect();
    let computed = Interaction::of(&scene);
    assert!((computed.relative_distance_m_min - whole.relative_distance_m_min).abs() < 1e-9);
    assert!((computed.relative_speed_mps - 2.0).abs() < 1e-9);
    assert!((computed.time_to_conflict_s_min - whole.time_to_conflict_s_min).abs() < 1e-9);
}

#[test]
fn a_standard_error_comes_from_what_a_measure_is_without_each_group() {
    // Around their mean of 3 the squares sum to 14, of which four groups count three quarters.
    assert!((jackknife(&[1.0, 2.0, 3.0, 6.0]).unwrap() - 10.5f64.sqrt()).abs() < 1e-12);
    assert_eq!((jackknife(&[1.0, 2.0]), jackknife(&[])), (None, None), "too few groups");
}

/// A fit that knows nothing but the mean of labels whose attack is off by a tenth and whose realism by a fiftieth.
fn means_alone(open_share: f64) -> WorldSnapshot {
    let off = |k: u32| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
    let one = |k: u32| {
        let mut label = label(0, &[f64::from(k), 7.0], 0.1 * off(k));
        label.labels.realism += 0.02 * off(k / 2) - 0.1;
        label.row.open_share = open_share;
        label
    };
    let mut set = CalibrationSet::default();
    set.append((0..80).map(one).collect(), &columns(2)).unwrap();
    let mixing = WorldConfiguration {
        beta_attack: 0.0,
        beta_realism: 0.0,
        realism_weight: 3.0,
        explore: 0.5,
        ..configuration(WorldModel::Ridge)
    };
    settle(&columns(2), &mixing, &set.by_lineage(), 1, &Threads::new(1).unwrap()).unwrap()
}

#[test]
fn an_error_is_scaled_by_the_root_of_the_open_share_that_it_was_made_at() {
    let half = |open_share: f64| means_alone(open_share).fit.unwrap().half_width.unwrap().attack;
    assert!((half(1.0) - 0.1).abs() < 0.02 && (half(0.25) - 0.2).abs() < 0.04, "{} {}", half(1.0), half(0.25));
}

#[test]
fn candidates_are_ranked_by_their_gain_and_by_what_is_not_known_of_them() {
    let snapshot = means_alone(1.0);
    let computed = Router::new(&snapshot).unwrap().predict(&xi(&[3.0, 7.0], 0.25)).unwrap();
    let (gain, half) = (computed.difference, computed.half_width.unwrap());
    let wanted = gain.attack + 3.0 * gain.realism + 0.5 * (half.attack + 3.0 * half.realism);
    assert!((computed.rank_score - wanted).abs() < 1e-12);
    assert!((gain.realism + 0.1).abs() < 1e-9 && half.realism > 0.0, "{gain:?} {half:?}");
    assert!((computed.objectives.realism - (0.5 + gain.realism)).abs() < 1e-12);
    assert!((computed.objectives.attack - (0.3 + gain.attack)).abs() < 1e-12);
}

#[test]
fn what_few_open_scenes_show_counts_for_those_scenes_alone() {
    // In a quarter of the scenes something changes, and a fifth of attack is gained there: a twentieth over all.
    let one = |k: u32| {
        let mut label = label(0, &[f64::from(k % 5), 7.0], 0.05);
        label.row.open_share = 0.25;
        label
    };
    let mut set = CalibrationSet::default();
    set.append((0..40).map(one).collect(), &columns(2)).unwrap();
    let snapshot =
        settle(&columns(2), &configuration(WorldModel::Ridge), &set.by_lineage(), 1, &Threads::new(1).unwrap())
            .unwrap();
    let router = Router::new(&snapshot).unwrap();
    for (open_share, gain) in [(0.25, 0.05), (1.0, 0.2)] {
        let computed = router.predict(&xi(&[2.0, 7.0], open_share)).unwrap();
        assert!((computed.difference.attack - gain).abs() < 1e-9, "{open_share}: {computed:?}");
        assert!((computed.objectives.attack - (0.3 + gain)).abs() < 1e-9, "{open_share}: {computed:?}");
    }
}

#[test]
fn a_fit_whose_columns_means_and_deviations_differ_in_number_is_refused() {
    let whole = means_alone(1.0);
    assert!(Router::new(&whole).is_ok());
    let damaged = |damage: fn(&mut WorldFit)| {
        let mut snapshot = whole.clone();
        damage(snapshot.fit.as_mut().unwrap());
        Router::new(&snapshot).is_err()
    };
    assert!(damaged(|fit| fit.column_mean.truncate(1)));
    assert!(damaged(|fit| fit.column_std.truncate(1)));
    assert!(damaged(|fit| fit.columns[0] = 2));
}
