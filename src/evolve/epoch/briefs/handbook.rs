//! The handbook of a lineage's family, and the numbers behind its formulas, from the study's options.

use super::searching::{around_search_in_words, ego_in_words, learned_in_words};
use crate::agents::{Acceptance, AgentError, Detail, Diagnostic, Handbook, HandbookParts, Measures, Omitted, Protocol};
use crate::candidates::PROTECTED;
use crate::ego::Policy;
use crate::epoch::RunError;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::evaluation::{self, EvaluationOptions, MetadriveOptions, Quantity, SafebenchOptions};
use crate::objects::{
    AcceptanceRequirement, AttackRequirement, FrontOf, FrontPer, GatesAsked, JudgedOn, RealismMean, UnreadableCritic,
    UnreadablePatch,
};

/// Writes the handbook out.
pub fn handbook(study: &Study, spec: &LineageSpec) -> Result<Handbook, RunError> {
    let source = study.source(spec)?;
    let egos: Vec<&str> = spec.by_ego().iter().map(|of| ego(&of.ego)).collect();
    let egos = egos.join(" ");
    let parts = HandbookParts {
        contract: &source.contract,
        contract_text: study.contract_text(spec)?,
        parent: &source.parent,
        foreign_vocabulary: &study.foreign_vocabulary(spec),
        protected_words: &PROTECTED,
        measures: &measures(study),
        omitted: Omitted {
            isolation: study.without.isolation,
            rules: study.without.conditions,
            modules: study.without.mechanisms,
        },
        detail: (!study.questions.is_plain()).then(|| Detail {
            search: source.search_in_words,
            around: around_search_in_words(source.contract.backend == "safebench", study.questions.is_compact()),
            ego: (!study.without.sight).then_some(&egos),
            compact: study.questions.is_compact(),
        }),
    };
    Ok(Handbook::of(&parts).map_err(AgentError::from)?)
}

fn ego(of: &Policy) -> &'static str {
    match of {
        Policy::Learned(weights) => learned_in_words(weights.setting.name()),
        ego => ego_in_words(ego.name()),
    }
}

/// How the study labels and accepts.
pub fn measures(study: &Study) -> Measures {
    let protocol = match &study.evaluation {
        EvaluationOptions::Metadrive(options) => metadrive(options, study.simulator.avoidance.reaction_s),
        EvaluationOptions::Safebench { safebench } => Protocol::Safebench { limits: safebench_limits(safebench) },
    };
    let archive = &study.archive;
    let acceptance = Acceptance {
        r0: archive.r0,
        a0: archive.a0,
        epsilon_r: archive.epsilon_r,
        epsilon_a: archive.epsilon_a,
        level: archive.level,
        coverage_floor: archive.coverage_floor,
        realism_min: study.selector.realism_min,
    };
    let rule = study.search.as_ref().and_then(|search| search.described());
    let (tradeoff, fixed_bodies) = (!study.without.tradeoff, study.fixed_bodies);
    Measures { protocol, acceptance, rule, tradeoff, fixed_bodies, otherwise: otherwise(study) }
}

/// Rules in which a study has not ours, which the texts tell.
fn otherwise(study: &Study) -> Vec<&'static str> {
    let (archive, proposals) = (&study.archive, &study.proposals);
    let labels = match &study.evaluation {
        EvaluationOptions::Safebench { .. } => Vec::new(),
        EvaluationOptions::Metadrive(options) => {
            let lacks = |of| !options.attack.requires.has(of);
            vec![
                (lacks(AttackRequirement::Adversary), "a contact of the ego counts with whomever it is"),
                (lacks(AttackRequirement::Acts), "whom the ego meets need not have acted"),
                (lacks(AttackRequirement::NotMetAnyway), "a contact counts that plain replay has too"),
                (
                    options.realism.mean == RealismMean::Plain,
                    "R is the mean of r(scene) over all scenes, 1 where the program does not act",
                ),
                (!options.realism.excuses_recordings, "the adversary's own log excuses nothing"),
            ]
        }
    };
    let lacks = |of| !archive.requires.has(of);
    let others = [
        (lacks(AcceptanceRequirement::Acts), "a child need not act to be accepted"),
        (lacks(AcceptanceRequirement::Differs), "its labels may be its parent's"),
        (archive.front == FrontOf::Evaluated, "the front is made of all measured programs"),
        (
            archive.front_per == FrontPer::Group,
            "each group of traffic family and route has its own front, and a program is accepted where a gate holds in one of them",
        ),
        (archive.judged_on == JudgedOn::Window, "programs are compared on the epoch's window alone"),
        (!proposals.effect_gate, "there is no effect gate"),
        (
            proposals.gates == GatesAsked::AfterCritics,
            "gates judge a patch once its critics approve, and nothing is repaired for them",
        ),
        (proposals.unreadable_critic == UnreadableCritic::Blocks, "a review that cannot be read ends the proposal"),
        (proposals.unreadable_patch == UnreadablePatch::Ends, "a patch that cannot be read ends the proposal"),
    ];
    labels.into_iter().chain(others).filter(|(holds, _)| *holds).map(|(_, says)| says).collect()
}

fn metadrive(options: &MetadriveOptions, reaction_s: f64) -> Protocol {
    let names = |classes: &std::collections::BTreeSet<crate::sim::ContactClass>| {
        classes.iter().map(|class| class.name().to_string()).collect()
    };
    let vehicle = &options.realism.calibration.vehicle;
    let limit = |of: &Quantity| (of.limit)(vehicle).map(|limit| (of.name.to_string(), limit.bound, limit.tolerance));
    let diagnostic = |(of, weight): (&evaluation::Diagnostic, f64)| Diagnostic {
        name: of.name().into(),
        weight,
        meaning: of.meaning,
        short: of.short,
        limits: of.quantities().iter().filter_map(limit).collect(),
    };
    Protocol::Metadrive {
        counts: names(&options.attack.counts),
        counts_if_avoidable: names(&options.attack.counts_if_avoidable),
        reaction_s,
        when: options.attack.when.as_ref().map(|when| when.text().to_string()),
        metrics: options.metrics.iter().map(|(name, of)| (name.clone(), of.text().to_string())).collect(),
        diagnostics: options.realism.diagnostics().map(diagnostic).collect(),
    }
}

fn safebench_limits(options: &SafebenchOptions) -> Vec<(String, f64, f64)> {
    let ars = &options.ars;
    let of = |name: &str, bound: f64, tolerance: f64| (name.to_string(), bound, tolerance);
    let bounded = [
        ("acceleration m/s^2", ars.kinematics.acceleration),
        ("lateral acceleration m/s^2", ars.kinematics.lateral_acceleration),
        ("jerk m/s^3", ars.kinematics.jerk),
        ("impact speed m/s", ars.interaction.impact_speed),
        ("distance to the ego m", ars.interaction.approach),
    ];
    let own = bounded.into_iter().map(|(name, limit)| of(name, limit.bound, limit.tolerance));
    let scales = [
        of("off road m", 0.0, ars.map.off_road_tolerance_m),
        of("wrong way m", 0.0, ars.map.wrong_way_tolerance_m),
        of("jump m", 0.0, ars.distance.jump_tolerance_m),
    ];
    own.chain(scales).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::{Counts, DIAGNOSTICS};
    use serde_json::{Value, json};

    /// The objectives as a prompt has them, with these weights in place of some.
    fn objectives(weights: &[&str]) -> String {
        let calibration = include_str!("../../../../experiments/calibration/kinds.toml");
        let calibration: Value = toml::from_str(calibration).unwrap();
        let always = DIAGNOSTICS.iter().filter(|of| of.counts == Counts::Always).map(|of| of.name());
        let weights = always.chain(weights.iter().copied()).map(|name| (name.to_string(), json!(0.1)));
        let options = json!({
            "attack": {"counts": ["ego_strikes"], "counts_if_avoidable": []},
            "realism": {"weights": weights.collect::<serde_json::Map<_, _>>(), "calibration": calibration},
        });
        let protocol = metadrive(&serde_json::from_value(options).unwrap(), 1.0);
        let acceptance = Acceptance {
            r0: 0.9,
            a0: 0.5,
            epsilon_r: 0.0,
            epsilon_a: 0.0,
            level: 0.8,
            coverage_floor: 0.8,
            realism_min: 0.95,
        };
        Measures { protocol, acceptance, rule: None, tradeoff: true, fixed_bodies: true, otherwise: vec![] }
            .text(false)
            .unwrap()
    }

    #[test]
    fn a_run_that_weighs_the_place_of_a_kind_reads_what_it_measures_and_no_other_run_does() {
        let asked = objectives(&["place_of_kind"]);
        let row = asked.lines().find(|line| line.contains("place_of_kind")).unwrap();
        assert!(row.contains("time on a motorway") && row.contains("(motorway_s 0, 0.3; across_m 0.5, 1)"), "{row}");
        assert!(!objectives(&["rolling", "speed_of_kind"]).contains("place_of_kind"));
        assert!(objectives(&["rolling"]).contains("`rolling`: how far"), "what is asked is told");
    }
}
