//! The most telling rollouts of a run: every recorded rollout of an evolved program or a parent, ranked by severity or by
//! realism (`docs/OBJECTIVES.md`, "Severity").

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::data::Rollout;
use super::recorded_run::RecordedRun;
use crate::kernel::Digest;
use crate::objects::{Attempt, LineageId, SceneScore, SolutionId};
use crate::scene::AgentKind;
use crate::sim::AdversaryReport;

/// Order of rollouts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum By {
    /// Contacts that count by their impact speed, then everything else by how near it came to one.
    Severity,
    /// The most realistic first; of equals the more severe.
    Realism,
}

/// A rollout with what it is ranked by.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ranked {
    /// Lineage of the program.
    pub lineage: LineageId,
    /// The program: an attempt or a lineage's parent.
    pub program: SolutionId,
    /// The scene.
    pub scene: String,
    /// `evolution` or `held_out`.
    pub suite: &'static str,
    /// Its label; above 0 where its contact counts.
    pub attack: f64,
    /// Its label.
    pub realism: f64,
    /// The ego's contact, if it met anyone.
    pub contact: Option<Met>,
    /// Smallest time to collision with an adversary (anyone, where there is none), s.
    pub ttc_s_min: Option<f64>,
    /// Nearest an adversary came (anyone, where there is none), metres.
    pub distance_m_min: Option<f64>,
    /// Adversaries that acted.
    pub adversaries: Vec<Acting>,
    /// Digest of the stored rollout.
    pub record: Digest,
    /// Other programs of the lineage in whose rollout of the scene the same happened, in the order of the record.
    pub also: Vec<SolutionId>,
}

/// An adversary that acted: whether it does what its kind does is read off its speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Acting {
    /// Kind of road user.
    pub kind: AgentKind,
    /// Its largest speed, m/s.
    pub speed_mps_max: f64,
}

/// A contact as it is ranked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Met {
    /// Seconds from the first simulated step, as on every clock.
    pub at_s: f64,
    /// Relative speed, m/s.
    pub speed_mps: f64,
    /// True if it is an adversary of the program.
    pub adversary: bool,
}

/// Rollouts in their order, and how many the run's store does not hold any more.
#[derive(Clone, Debug, PartialEq)]
pub struct Best {
    /// All of them, the first the best.
    pub ranked: Vec<Ranked>,
    /// Labels whose rollout record is gone.
    pub lacking: usize,
}

/// Says in a few words what became of a program: whether it is reported, accepted, or neither.
pub fn standing(run: &RecordedRun, program: &SolutionId) -> &'static str {
    let lineages = run.result.iter().flat_map(|result| &result.lineages);
    let reported = lineages.into_iter().any(|of| of.evolved.solution == *program);
    let made = |attempt: &&Attempt| attempt.exit.candidate().is_some_and(|of| of.program.solution_id == *program);
    match (run.attempts.iter().find(made), reported) {
        (None, true) => "the parent, which the run reports",
        (None, false) => "the parent",
        (Some(_), true) => "chosen: the run reports it",
        (Some(attempt), false) if attempt.exit.decision().is_some_and(|decision| decision.gates.any()) => {
            "accepted, but not the one that the run reports"
        }
        (Some(_), false) => "not accepted",
    }
}

/// The suite of a scene, in words.
pub fn suite_in_words(suite: &str) -> &'static str {
    if suite == "held_out" { "a held-out scene" } else { "an evolution scene" }
}

/// Ranks the rollouts behind the labels of a run in which the program acts, of one lineage or of all. `rollouts` are the records
/// that the run's store holds; a program that meets a scene twice counts once. Equals stay in the order of the record.
pub fn best(run: &RecordedRun, rollouts: &BTreeMap<Digest, Rollout>, by: By, lineage: Option<&LineageId>) -> Best {
    let (mut seen, mut ranked, mut lacking) = (BTreeSet::new(), Vec::new(), 0);
    for (of, program, suite, score) in run.scores().filter(|(of, ..)| lineage.is_none_or(|wanted| wanted == *of)) {
        for label in score.scenes.iter().filter(|label| label.acted) {
            if !seen.insert((program, &label.scene)) {
                continue;
            }
            match rollouts.get(&label.record) {
                None => lacking += 1,
                Some(rollout) => {
                    ranked.push(one(of, program, suite, label, rollout));
                }
            }
        }
    }
    match by {
        By::Severity => ranked.sort_by(severer),
        By::Realism => ranked.sort_by(|a, b| b.realism.total_cmp(&a.realism).then_with(|| severer(a, b))),
    }
    Best { ranked: folded(ranked), lacking }
}

/// One row for what happened in the rollouts of several programs: a child that does in a scene what its parent does makes no other event.
fn folded(ranked: Vec<Ranked>) -> Vec<Ranked> {
    let mut rows: Vec<Ranked> = Vec::with_capacity(ranked.len());
    let mut places: BTreeMap<(LineageId, String), Vec<usize>> = BTreeMap::new();
    for one in ranked {
        let known = places.entry((one.lineage.clone(), one.scene.clone())).or_default();
        match known.iter().find(|place| rows[**place].same_event(&one)) {
            Some(place) => rows[*place].also.push(one.program),
            None => {
                known.push(rows.len());
                rows.push(one);
            }
        }
    }
    rows
}

impl Ranked {
    fn same_event(&self, other: &Ranked) -> bool {
        let measured = |of: &Ranked| (of.attack, of.realism, of.contact, of.ttc_s_min, of.distance_m_min);
        measured(self) == measured(other)
    }
}

fn one(
    lineage: &LineageId,
    program: &SolutionId,
    suite: &'static str,
    label: &SceneScore,
    rollout: &Rollout,
) -> Ranked {
    let outcome = &rollout.outcome;
    Ranked {
        lineage: lineage.clone(),
        program: program.clone(),
        scene: label.scene.clone(),
        suite,
        attack: label.attack,
        realism: label.realism,
        contact: outcome.contact.map(|contact| Met {
            at_s: contact.time_s,
            speed_mps: contact.relative_speed_mps,
            adversary: contact.adversary,
        }),
        ttc_s_min: outcome.ttc_s_min,
        distance_m_min: outcome.distance_m_min,
        adversaries: outcome.adversaries.iter().filter(|of| of.acted).map(acting).collect(),
        record: label.record,
        also: Vec::new(),
    }
}

fn acting(of: &AdversaryReport) -> Acting {
    Acting { kind: of.kind, speed_mps_max: of.motion.speed_mps_max }
}

/// The more severe one first. What counts as attack is above everything else; between two of them the larger label, then the
/// larger impact speed decides (0 without a contact, where an experiment's own attack counts near misses); between two others the smaller time to collision, then the smaller distance. What was never measured is last.
fn severer(a: &Ranked, b: &Ranked) -> Ordering {
    let counts = |of: &Ranked| of.attack > 0.0;
    let speed = |of: &Ranked| of.contact.filter(|_| counts(of)).map_or(0.0, |contact| contact.speed_mps);
    let label = |of: &Ranked| if counts(of) { of.attack } else { 0.0 };
    let small = |value: Option<f64>| value.unwrap_or(f64::INFINITY);
    counts(b)
        .cmp(&counts(a))
        .then(label(b).total_cmp(&label(a)))
        .then(speed(b).total_cmp(&speed(a)))
        .then(small(a.ttc_s_min).total_cmp(&small(b.ttc_s_min)))
        .then(small(a.distance_m_min).total_cmp(&small(b.distance_m_min)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ranked(name: &str, attack: f64, speed: Option<f64>, ttc: Option<f64>, metres: f64) -> Ranked {
        Ranked {
            lineage: LineageId::new("l"),
            program: SolutionId::new(name),
            scene: "s".into(),
            suite: "evolution",
            attack,
            realism: 1.0,
            contact: speed.map(|speed_mps| Met { at_s: 1.0, speed_mps, adversary: true }),
            ttc_s_min: ttc,
            distance_m_min: Some(metres),
            adversaries: Vec::new(),
            record: Digest::of_bytes(name.as_bytes()),
            also: Vec::new(),
        }
    }

    #[test]
    fn what_counts_is_above_what_does_not_then_speed_then_time_to_collision_then_distance() {
        let ordered = [
            ranked("counts, fast", 1.0, Some(9.0), Some(0.5), 0.0),
            ranked("counts, slow", 1.0, Some(2.0), Some(0.1), 0.0),
            ranked("a near miss that counts", 1.0, None, Some(0.8), 0.3),
            ranked("half a label, faster", 0.5, Some(12.0), Some(0.1), 0.0),
            ranked("a bystander at speed, late seen", 0.0, Some(20.0), Some(0.2), 0.0),
            ranked("near miss", 0.0, None, Some(0.9), 0.4),
            ranked("as near in time, farther", 0.0, None, Some(0.9), 0.6),
            ranked("never closing in", 0.0, None, None, 0.1),
        ];
        let mut shuffled: Vec<Ranked> = ordered.iter().rev().cloned().collect();
        shuffled.swap(1, 4);
        shuffled.sort_by(severer);
        let names: Vec<&str> = shuffled.iter().map(|of| of.program.as_str()).collect();
        let expected: Vec<&str> = ordered.iter().map(|of| of.program.as_str()).collect();
        assert_eq!(names, expected);
    }

    #[test]
    fn what_several_programs_do_alike_in_a_scene_is_one_row() {
        let elsewhere = |mut of: Ranked| {
            of.scene = "t".into();
            of
        };
        let all = vec![
            ranked("parent", 1.0, Some(9.0), Some(0.5), 0.0),
            ranked("child", 1.0, Some(9.0), Some(0.5), 0.0),
            elsewhere(ranked("child", 1.0, Some(9.0), Some(0.5), 0.0)),
            ranked("other", 1.0, Some(8.0), Some(0.5), 0.0),
            ranked("grandchild", 1.0, Some(9.0), Some(0.5), 0.0),
        ];
        let rows = folded(all);
        let listed: Vec<(&str, Vec<&str>)> =
            rows.iter().map(|of| (of.program.as_str(), of.also.iter().map(SolutionId::as_str).collect())).collect();
        assert_eq!(listed, [("parent", vec!["child", "grandchild"]), ("child", vec![]), ("other", vec![])]);
    }
}
