//! The handbook of a lineage's family, and the numbers behind its formulas, from the study's options.

use super::searching::{around_search_in_words, ego_in_words, learned_in_words, search_in_words};
use crate::agents::{Acceptance, AgentError, Detail, Diagnostic, Handbook, HandbookParts, Measures, Omitted, Protocol};
use crate::candidates::PROTECTED;
use crate::ego::Policy;
use crate::epoch::RunError;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::evaluation::{EvaluationOptions, Limits, MetadriveOptions, SafebenchOptions};

/// Writes the handbook out.
pub fn handbook(study: &Study, spec: &LineageSpec) -> Result<Handbook, RunError> {
    let source = study.source(spec)?;
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
            search: search_in_words(source.contract.family.as_str()).unwrap_or_default(),
            around: around_search_in_words(source.contract.backend == "safebench"),
            ego: match &spec.ego {
                Policy::Learned(weights) => learned_in_words(weights.setting.name()),
                ego => ego_in_words(ego.name()),
            },
        }),
    };
    Ok(Handbook::of(&parts).map_err(AgentError::from)?)
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
    Measures { protocol, acceptance, rule, tradeoff: !study.without.tradeoff, fixed_bodies: study.fixed_bodies }
}

fn metadrive(options: &MetadriveOptions, reaction_s: f64) -> Protocol {
    let names = |classes: &std::collections::BTreeSet<crate::sim::ContactClass>| {
        classes.iter().map(|class| class.name().to_string()).collect()
    };
    let vehicle = &options.realism.calibration.vehicle;
    let diagnostic =
        |(name, weight): (&str, f64)| Diagnostic { name: name.into(), weight, limits: limits(name, vehicle) };
    Protocol::Metadrive {
        counts: names(&options.attack.counts),
        counts_if_avoidable: names(&options.attack.counts_if_avoidable),
        reaction_s,
        when: options.attack.when.as_ref().map(|when| when.text().to_string()),
        metrics: options.metrics.iter().map(|(name, of)| (name.clone(), of.text().to_string())).collect(),
        diagnostics: options.realism.weights().into_iter().map(diagnostic).collect(),
    }
}

/// Bound and tolerance of each quantity that a diagnostic measures in vehicles.
fn limits(diagnostic: &str, vehicle: &Limits) -> Vec<(String, f64, f64)> {
    let measured: &[&str] = match diagnostic {
        "map_validity" => &["off_road_m"],
        "lane_direction" => &["wrong_way_m"],
        "trajectory_continuity" => &["jump_m", "kink_m", "roughness_m"],
        "bounded_acceleration" => &["acceleration_mps2"],
        "bounded_jerk" => &["jerk_mps3"],
        "bounded_slip" => &["slip_mps"],
        "rolling" => &["unrolled_m"],
        "speed_of_kind" => &["speed_mps"],
        _ => &[],
    };
    let of = vehicle.by_name().into_iter().filter(|(name, _)| measured.contains(name));
    of.map(|(name, limit)| (name.to_string(), limit.bound, limit.tolerance)).collect()
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
