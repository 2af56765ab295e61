//! One label of a scene from those against several drivers, and a program's score from these. A scene stays the unit of every mean,
//! interval and paired test: its rollouts against several drivers are no independent draws.

use std::collections::BTreeMap;

use super::score::score_of;
use crate::kernel::num;
use crate::objects::{OverEgos, RealismMean, RealismSums, SceneFailure, SceneScore, Score};

/// A program's score against several drivers, from its scores against each alone, which are given with the drivers' names, the lineage's
/// first driver first. A scene counts where it has a label against all of them. `None` if there is no such scene.
pub fn over_egos(rule: OverEgos, scores: &[(String, Score)]) -> Option<Score> {
    let (_, first) = scores.first()?;
    let failures = failures(scores);
    let labelled = first.scenes.iter().filter(|label| !failures.iter().any(|failure| failure.scene == label.scene));
    let mut scenes = Vec::with_capacity(first.scenes.len());
    let by_ego: Vec<(&String, BTreeMap<&str, &SceneScore>)> = scores
        .iter()
        .map(|(ego, score)| (ego, score.scenes.iter().map(|label| (label.scene.as_str(), label)).collect()))
        .collect();
    for label in labelled {
        let of_ego = |(ego, labels): &(&String, BTreeMap<&str, &SceneScore>)| {
            Some(((*ego).clone(), (*labels.get(label.scene.as_str())?).clone()))
        };
        let alone: Vec<(String, SceneScore)> = by_ego.iter().filter_map(of_ego).collect();
        if alone.len() == scores.len() {
            scenes.push(scene_over_egos(rule, first.rules.mean, label, alone));
        }
    }
    let mut rules = first.rules.clone();
    rules.over_egos = Some(rule);
    score_of(scenes, failures, rules)
}

/// Scenes without a label against some driver, each once, with the first driver's reason.
fn failures(scores: &[(String, Score)]) -> Vec<SceneFailure> {
    let mut all: Vec<SceneFailure> = Vec::new();
    for (ego, failure) in scores.iter().flat_map(|(ego, score)| score.failures.iter().map(move |of| (ego, of))) {
        if !all.iter().any(|known| known.scene == failure.scene) {
            all.push(SceneFailure { reason: format!("against {ego}: {}", failure.reason), ..failure.clone() });
        }
    }
    all
}

/// A scene's label from its labels against each driver. By the mean the attack is the mean over the drivers, and realism is summed up over
/// them as it is over scenes: a program cannot pay with its realism against one driver for its successes against another. By the worst the
/// attack is the least over the drivers, and realism the least over those against which the program acts. Contact, request and record are
/// those of `first`, the label against the lineage's first driver.
pub fn scene_over_egos(
    rule: OverEgos,
    realism: RealismMean,
    first: &SceneScore,
    alone: Vec<(String, SceneScore)>,
) -> SceneScore {
    let labels: Vec<&SceneScore> = alone.iter().map(|(_, label)| label).collect();
    let acting: Vec<&SceneScore> = labels.iter().copied().filter(|label| label.acted).collect();
    let over = |values: &[f64]| match rule {
        OverEgos::Mean => num::mean(values),
        OverEgos::Worst => values.iter().copied().reduce(f64::min),
    };
    let attack = over(&labels.iter().map(|label| label.attack).collect::<Vec<f64>>()).unwrap_or(0.0);
    let realism = match rule {
        OverEgos::Mean => RealismSums::of(labels.iter().copied()).realism(realism),
        OverEgos::Worst => over(&acting.iter().map(|label| label.realism).collect::<Vec<f64>>()),
    };
    let diagnosed = if acting.is_empty() { &labels } else { &acting };
    let named = |of: fn(&SceneScore) -> &BTreeMap<String, f64>, over: &dyn Fn(&[f64]) -> Option<f64>| {
        let value = |name: &String| {
            let values: Vec<f64> = diagnosed.iter().filter_map(|label| of(label).get(name).copied()).collect();
            Some((name.clone(), over(&values)?))
        };
        of(first).keys().filter_map(value).collect::<BTreeMap<String, f64>>()
    };
    SceneScore {
        scene: first.scene.clone(),
        attack,
        realism: realism.unwrap_or(1.0),
        acted: !acting.is_empty(),
        diagnostics: named(|label| &label.diagnostics, &over),
        metrics: named(|label| &label.metrics, &|values| num::mean(values)),
        contact: first.contact.clone(),
        intervened: labels.iter().any(|label| label.intervened),
        request: first.request,
        record: first.record,
        by_ego: alone.into_iter().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::LabelRules;
    use crate::objects::fixture::scene_score;

    fn label(scene: &str, attack: f64, realism: f64) -> SceneScore {
        SceneScore { diagnostics: [("jerk".to_string(), realism)].into(), ..scene_score(scene, attack, realism) }
    }

    fn scores() -> Vec<(String, Score)> {
        let of = |ego: &str, labels: Vec<SceneScore>, failures: Vec<SceneFailure>| {
            (ego.to_string(), score_of(labels, failures, LabelRules::default()).expect("labels"))
        };
        let failed = SceneFailure { scene: "c".into(), reason: "no road".into(), too_slow: false, abandoned: false };
        vec![
            of("idm", vec![label("a", 1.0, 0.4), label("b", 1.0, 0.9), label("c", 1.0, 0.9)], vec![]),
            of("pdm", vec![label("a", 0.0, 1.0), label("b", 1.0, 0.8)], vec![failed]),
        ]
    }

    #[test]
    fn the_mean_counts_every_driver_and_the_worst_whom_it_troubles_least() {
        let mean = over_egos(OverEgos::Mean, &scores()).expect("a score");
        let worst = over_egos(OverEgos::Worst, &scores()).expect("a score");
        assert_eq!((mean.objectives.attack, worst.objectives.attack), (0.75, 0.5));
        assert_eq!(mean.scenes.iter().map(|of| of.attack).collect::<Vec<_>>(), [0.5, 1.0]);
        assert_eq!(worst.scenes.iter().map(|of| of.realism).collect::<Vec<_>>(), [0.4, 0.8]);
        assert_eq!((mean.rules.over_egos, worst.rules.over_egos), (Some(OverEgos::Mean), Some(OverEgos::Worst)));
    }

    #[test]
    fn a_scene_without_a_label_against_one_driver_has_none_and_says_against_whom() {
        let mean = over_egos(OverEgos::Mean, &scores()).expect("a score");
        assert_eq!((mean.scenes.len(), mean.failures.len()), (2, 1));
        assert_eq!(mean.failures[0].reason, "against pdm: no road");
    }

    #[test]
    fn labels_against_each_driver_stay_as_they_were() {
        let alone = scores();
        let mean = over_egos(OverEgos::Mean, &alone).expect("a score");
        for (ego, score) in &alone {
            assert_eq!(mean.scenes[1].by_ego[ego], score.scenes[1]);
        }
    }

    #[test]
    fn realism_against_a_driver_who_is_not_hit_pays_for_no_success_against_another() {
        // Hit with realism 0.4 against IDM, not hit with 1.0 against PDM: the success has 0.4.
        let mean = over_egos(OverEgos::Mean, &scores()).expect("a score");
        assert_eq!(mean.scenes[0].realism, 0.4);
    }
}
