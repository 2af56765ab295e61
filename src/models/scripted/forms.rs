//! Expressions: atoms with a meaning, and forms that join them. Atoms are shares or decays around 0..1, so that their
//! sums and products have sensible units for any features.

use super::{
    conditions,
    constants::{fill, without_constants},
    names::{names_in, words},
    reader::PromptView,
};
use crate::kernel::{Stream, num};

/// A new expression and what it is about.
pub struct Mechanism {
    pub expression: String,
    pub tags: Vec<String>,
    pub clusters: Vec<String>,
}

/// The purpose of a mechanism slot, according to its contract entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A number, larger is taken first.
    Score,
    /// A number, smaller is better.
    Loss,
    /// A number of seconds.
    Time,
    /// A condition on an actor or a candidate.
    Guard,
    /// A condition on the scene alone.
    Gate,
    /// Output of a law at every step: when it begins, the acceleration, the offset.
    Onset,
    Acceleration,
    Offset,
    /// The same of a candidate that is reshaped: share of its speed, offset.
    SpeedShare,
    ShapeOffset,
}

/// Terms that grow with the pressure on the ego.
const PRESSURE: [(&str, &str); 21] = [
    ("time_pressure", "exp(-abs(arrival_difference_s) / <1.5..5 s>)"),
    ("time_pressure", "1 / (1 + abs(arrival_difference_s) / <1..3 s>)"),
    ("conflict_time", "exp(-time_to_conflict_s / <1.5..5 s>)"),
    ("conflict_time", "1 / (1 + time_to_conflict_s / <1..4 s>)"),
    ("speed_mismatch", "clamp(closing_speed_mps / <4..12 m/s>, 0, 1)"),
    ("closing_rate", "clamp(<1..3 s> * closing_speed_mps / max(gap_m, 1), 0, 3)"),
    ("proximity", "exp(-gap_m / <8..30 m>)"),
    ("path_conflict", "exp(-path_distance_m_min / <2..8 m>)"),
    ("route_conflict", "if(paths_cross, 1, <0.05..0.4>)"),
    ("cut_in", "if(adjacent_lane and not behind, exp(-gap_m / <8..25 m>), 0)"),
    ("lead_vehicle", "if(same_lane and not behind, exp(-abs(longitudinal_offset_m) / <10..30 m>), 0)"),
    ("angle_conflict", "clamp(heading_difference_rad / 3.14, 0, 1)"),
    ("lateral_merge", "if(abs(lateral_offset_m) < <2..5 m>, 1, <0.1..0.5>)"),
    ("counselled_attacker", "if(counsel_rank > 0, 1 / max(counsel_rank, 1), <0.1..0.5>)"),
    ("marked_interaction", "if(object_of_interest, 1, <0.1..0.5>)"),
    ("likely_contact", "collision_likelihood"),
    ("likely_contact", "sqrt(collision_likelihood)"),
    ("near_approach", "exp(-ego_distance_m_min / <1..6 m>)"),
    ("near_approach", "1 / (1 + ego_distance_m_min / <1..4 m>)"),
    ("early_contact", "exp(-closest_approach_s / <2..6 s>)"),
    ("impact_speed", "clamp(closest_speed_mps / <5..15 m/s>, 0, 1)"),
];

/// Terms that grow with the plausibility of the motion.
const PLAUSIBILITY: [(&str, &str); 13] = [
    ("mobility", "clamp(moved_m / <10..40 m>, 0, 1)"),
    ("well_observed", "observed_share"),
    ("in_front", "if(behind, <0.1..0.5>, 1)"),
    ("moderate_speed", "1 / (1 + actor_speed_mps / <10..20 m/s>)"),
    ("smooth_acceleration", "1 / (1 + acceleration_mps2_max / <3..8 m/s^2>)"),
    ("smooth_turning", "1 / (1 + lateral_acceleration_mps2_max / <2..5 m/s^2>)"),
    ("smooth_jerk", "exp(-jerk_mps3_max / <8..25 m/s^3>)"),
    ("calm_yaw", "1 / (1 + yaw_rate_radps_max / <0.3..0.8 rad/s>)"),
    ("on_road", "if(off_road_m_max > <0.2..0.8 m>, <0.05..0.3>, 1)"),
    ("lane_keeping", "exp(-lane_deviation_m_max / <1..3 m>)"),
    ("near_log", "exp(-log_deviation_m_max / <2..10 m>)"),
    ("clear_of_others", "clamp(bystander_gap_m_min / <0.5..2 m>, 0, 1)"),
    ("plausible_prior", "exp(prior_log_probability / <2..6>)"),
];

/// Conditions for guards on an actor or a candidate.
const GUARDS: [(&str, &str); 19] = [
    ("acceleration_guard", "acceleration_mps2_max <= <3.5..7 m/s^2>"),
    ("turning_guard", "lateral_acceleration_mps2_max <= <3..6 m/s^2>"),
    ("jerk_guard", "jerk_mps3_max <= <8..25 m/s^3>"),
    ("yaw_guard", "yaw_rate_radps_max <= <0.4..1 rad/s>"),
    ("road_guard", "off_road_m_max <= <0.1..0.6 m>"),
    ("bystander_guard", "bystander_gap_m_min >= <0.2..1 m>"),
    ("lane_guard", "lane_deviation_m_max <= <1..3 m>"),
    ("log_guard", "log_deviation_m_max <= <5..20 m>"),
    ("impact_guard", "closest_speed_mps <= <8..18 m/s>"),
    ("heading_guard", "heading_change_rad <= <0.6..1.5 rad>"),
    ("onset_guard", "closest_approach_s >= <0.6..1.8 s>"),
    ("speed_guard", "speed_mps_max <= <12..25 m/s>"),
    ("range_guard", "gap_m <= <20..60 m>"),
    ("in_front_guard", "not behind"),
    ("observation_guard", "observed_share >= <0.3..0.8>"),
    ("mobility_guard", "moved_m >= <3..12 m>"),
    ("conflict_guard", "time_to_conflict_s <= <4..10 s>"),
    ("path_guard", "path_distance_m_min <= <3..12 m>"),
    ("crossing_guard", "paths_cross or path_distance_m_min <= <2..6 m>"),
];

/// Seconds from now.
const TIMES: [(&str, &str); 6] = [
    ("conflict_lead", "max(0, time_to_conflict_s - <1..4 s>)"),
    ("conflict_lead", "clamp(time_to_conflict_s - <1..4 s>, 0, <3..6>)"),
    ("early_start", "<0.2..0.6> * time_to_conflict_s"),
    ("crossing_lead", "if(paths_cross, max(0, time_to_conflict_s - <1.5..4 s>), <0..1.5>)"),
    ("arrival_lead", "max(0, min(time_to_conflict_s, <3..6 s>) - abs(arrival_difference_s) / <1.5..3>)"),
    ("gap_lead", "clamp(gap_m / max(closing_speed_mps, <1..3 m/s>) - <1..3 s>, 0, <3..6>)"),
];

/// When a law begins.
const ONSETS: [(&str, &str); 4] = [
    ("cut_in", "seen_ego_ahead_m < 0 and abs(seen_ego_left_m) < <1.5..2.5 m> and seen_gap_m < <8..20 m>"),
    ("near_onset", "seen_gap_m < <6..25 m>"),
    ("late_onset", "seen_ttc_s < <1.5..4 s>"),
    ("conflict_onset", "ego_to_conflict_m < <10..40 m>"),
];

/// Expressions that a law accelerates by.
const ACCELERATIONS: [(&str, &str); 5] = [
    ("brake_ahead", "if(since_onset_s < <0.2..0.6 s>, -<1..4 m/s^2>, -<5..8.5 m/s^2>)"),
    (
        "meet_the_ego",
        "if(ego_to_conflict_m < 0 or own_to_conflict_m < 0, planned_acceleration_mps2, clamp(<1..3> * (own_to_conflict_m \
         / max(ego_to_conflict_m / max(seen_ego_speed_mps, 1), 0.3) - own_speed_mps), -<2..5 m/s^2>, 2.5))",
    ),
    ("yield_to_others", "if(others_ahead_gap_m < <3..10 m>, -<3..6 m/s^2>, planned_acceleration_mps2)"),
    ("keep_to_the_plan", "clamp(planned_acceleration_mps2, -<3..6 m/s^2>, <1.5..2.7 m/s^2>)"),
    ("match_the_ego", "clamp(seen_ego_speed_mps - own_speed_mps, -<2..6 m/s^2>, 2.5)"),
];

/// How far beside the candidate's path a law drives.
const OFFSETS: [(&str, &str); 2] = [
    ("drift_to_the_ego", "clamp(seen_ego_left_m, -<0.5..2 m>, <0.5..2 m>)"),
    ("keep_off_the_edge", "if(road_left_m < <0.5..1 m>, -0.5, if(road_right_m < <0.5..1 m>, 0.5, 0))"),
];

/// Share of a candidate's speed over its progress.
const SPEED_SHARES: [(&str, &str); 3] = [
    ("late_slowdown", "1 - <0.1..0.5> * progress"),
    ("early_rush", "<1.05..1.3> - <0.1..0.3> * progress"),
    ("slow_start", "clamp(<0.6..0.9> + progress, 0, 1)"),
];

/// Offset of a candidate over its progress.
const SHAPES: [(&str, &str); 2] =
    [("drift_left", "<0.3..1.5 m> * progress"), ("drift_right", "-<0.3..1.5 m> * progress")];

/// How two terms make a score. `A` is the leading term, `B` the other, `C` a condition on the scene.
const SCORES: [&str; 10] = [
    "A + <0.2..1> * B",
    "A * (<0.3..0.8> + B)",
    "if(C, A, <0.3..0.8> * B)",
    "clamp(A + <0.2..0.8> * B, 0, <1.2..2>)",
    "max(A, <0.4..0.9> * B)",
    "min(A + <0.1..0.3>, B + <0.1..0.3>)",
    "sqrt(max(A * B, 0))",
    "A / (<1.1..1.6> - min(B, 1))",
    "if(C, A + <0.2..0.6> * B, B)",
    "<0.5..2.5> * (A - <0.2..0.6> * (1 - B))",
];

impl Purpose {
    /// Decided by the slot's output, its features and the text of its entry.
    pub fn of(page: &PromptView, slot: &str) -> Option<Purpose> {
        let spec = page.contract.mechanism_slots.get(slot)?;
        let says = spec.meaning.to_lowercase();
        Some(match spec.output.as_str() {
            "boolean" if slot == "law_onset" => Purpose::Onset,
            _ if slot == "law_acceleration_mps2" => Purpose::Acceleration,
            _ if slot == "law_offset_m" => Purpose::Offset,
            _ if slot == "shape_speed_share" => Purpose::SpeedShare,
            _ if slot == "shape_offset_m" => Purpose::ShapeOffset,
            "boolean" if spec.reads.is_empty() => Purpose::Gate,
            "boolean" => Purpose::Guard,
            _ if slot.ends_with("_s") || says.starts_with("seconds") => Purpose::Time,
            _ if says.contains("smaller is better") || slot.contains("loss") || slot.contains("cost") => Purpose::Loss,
            _ => Purpose::Score,
        })
    }
}

/// An expression for a mechanism slot from the features that it may read; `None` where no form fits them.
pub fn invent(page: &PromptView, slot: &str, stream: &mut Stream) -> Option<Mechanism> {
    match Purpose::of(page, slot)? {
        Purpose::Score => score(page, slot, stream),
        Purpose::Loss => {
            let mechanism = score(page, slot, stream)?;
            Some(Mechanism { expression: format!("-({})", mechanism.expression), ..mechanism })
        }
        Purpose::Time => one_of(page, slot, &TIMES, stream),
        Purpose::Guard => guard(page, slot, stream),
        Purpose::Onset => one_of(page, slot, &ONSETS, stream),
        Purpose::Acceleration => one_of(page, slot, &ACCELERATIONS, stream),
        Purpose::Offset => one_of(page, slot, &OFFSETS, stream),
        Purpose::SpeedShare => one_of(page, slot, &SPEED_SHARES, stream),
        Purpose::ShapeOffset => one_of(page, slot, &SHAPES, stream),
        Purpose::Gate => {
            let condition = conditions::draw(page, stream)?;
            let tags = vec![format!("{}_gate", condition.name)];
            Some(Mechanism { expression: condition.text, tags, clusters: condition.cluster.into_iter().collect() })
        }
    }
}

/// One more term for an existing score or guard of the slot, with its tag.
pub fn extra_term(page: &PromptView, slot: &str, stream: &mut Stream) -> Option<(String, String)> {
    match Purpose::of(page, slot)? {
        Purpose::Guard => atom(page, slot, &GUARDS, &[], stream),
        Purpose::Score | Purpose::Loss => {
            let first = if page.target() == "raise_realism" { &PLAUSIBILITY[..] } else { &PRESSURE[..] };
            atom(page, slot, first, &[], stream).or_else(|| atom(page, slot, &PRESSURE, &[], stream))
        }
        _ => None,
    }
}

/// One whole text.
fn one_of(page: &PromptView, slot: &str, texts: &[(&str, &str)], stream: &mut Stream) -> Option<Mechanism> {
    let (tag, expression) = atom(page, slot, texts, &[], stream)?;
    Some(Mechanism { expression, tags: vec![tag], clusters: vec![] })
}

fn score(page: &PromptView, slot: &str, stream: &mut Stream) -> Option<Mechanism> {
    let (lead_tag, lead) = atom(page, slot, &PRESSURE, &[], stream).or_else(|| plain_feature(page, slot, stream))?;
    let plausible = stream.chance(if page.target() == "raise_realism" { 0.8 } else { 0.35 });
    let other = if plausible { &PLAUSIBILITY[..] } else { &PRESSURE[..] };
    let Some((tag, term)) = atom(page, slot, other, &[&lead_tag], stream) else {
        return Some(Mechanism { expression: lead, tags: vec![lead_tag], clusters: vec![] });
    };
    let form = stream.pick(&SCORES)?;
    let condition = if form.contains('C') { conditions::draw(page, stream) } else { None };
    let form = if form.contains('C') && condition.is_none() { SCORES[0] } else { form };
    let form = fill(page, "", form, stream);
    let clusters = condition.iter().filter_map(|c| c.cluster.clone()).collect();
    let expression = joined(&form, &lead, &term, condition.as_ref().map_or("", |c| &c.text));
    Some(Mechanism { expression, tags: vec![lead_tag, tag], clusters })
}

fn guard(page: &PromptView, slot: &str, stream: &mut Stream) -> Option<Mechanism> {
    let (first, mut expression) = atom(page, slot, &GUARDS, &[], stream)?;
    let mut tags = vec![first];
    for share in [0.7, 0.35] {
        let used: Vec<&str> = tags.iter().map(String::as_str).collect();
        if stream.chance(share)
            && let Some((tag, text)) = atom(page, slot, &GUARDS, &used, stream)
        {
            let wrapped = if text.contains(" or ") { format!("({text})") } else { text };
            let left = if expression.contains(" or ") { format!("({expression})") } else { expression };
            expression = format!("{left} and {wrapped}");
            tags.push(tag);
        }
    }
    Some(Mechanism { expression, tags, clusters: vec![] })
}

/// Puts terms into the places of a form. Places are single capitals; nothing else in the language is a capital.
fn joined(form: &str, a: &str, b: &str, c: &str) -> String {
    form.chars().fold(String::new(), |mut text, letter| {
        match letter {
            'A' => text.push_str(&bracketed(a)),
            'B' => text.push_str(&bracketed(b)),
            'C' => text.push_str(c),
            other => text.push(other),
        }
        text
    })
}

/// Parentheses where the term is neither one name nor one call.
fn bracketed(term: &str) -> String {
    let call = term.ends_with(')') && words(term).next().is_some_and(|f| term.starts_with(&format!("{f}(")));
    if call && closes_at_end(term) || !term.contains([' ', '-']) { term.into() } else { format!("({term})") }
}

fn closes_at_end(term: &str) -> bool {
    let mut open = 0;
    for (at, letter) in term.char_indices() {
        match letter {
            '(' => open += 1,
            ')' => open -= 1,
            _ => continue,
        }
        if open == 0 {
            return at + 1 == term.len();
        }
    }
    false
}

/// Draws an atom whose features the slot may read. Atoms that memory recommends are likelier, atoms that it warns of
/// less likely.
fn atom(
    page: &PromptView,
    slot: &str,
    atoms: &[(&str, &str)],
    used: &[&str],
    stream: &mut Stream,
) -> Option<(String, String)> {
    let readable = page.readable(Some(slot));
    let legal: Vec<&(&str, &str)> = atoms
        .iter()
        .filter(|(tag, text)| {
            !used.contains(tag) && names_in(&without_constants(text)).iter().all(|n| readable.contains(n))
        })
        .collect();
    let weights: Vec<f64> = legal.iter().map(|(tag, text)| appeal(page, tag, text)).collect();
    let (tag, template) = legal.get(weighted(&weights, stream)?)?;
    Some(((*tag).to_string(), fill(page, tag, template, stream)))
}

/// How strongly the context favours a mechanism.
fn appeal(page: &PromptView, tag: &str, text: &str) -> f64 {
    let mut weight = 1.0;
    if page.failed_tags().contains(tag) {
        weight *= 0.1;
    }
    if page.tags_of("success").contains(tag) {
        weight *= 3.0;
    }
    let tried = page.program.mechanism_modules.values().any(|module| module.tags.iter().any(|t| t == tag))
        || page.history.iter().any(|edit| edit.has_tag(tag));
    if tried && page.target() == "diversify" {
        weight *= 0.2;
    }
    if let Some((weakest, value)) = page.weakest()
        && value < 0.95
        && weakest.split('_').any(|word| word.len() > 3 && text.contains(word))
    {
        weight *= 3.0;
    }
    weight
}

/// A term from a feature that no atom knows, scaled by its unit.
fn plain_feature(page: &PromptView, slot: &str, stream: &mut Stream) -> Option<(String, String)> {
    let reads = &page.contract.mechanism_slots.get(slot)?.reads;
    let numbers: Vec<_> = reads.iter().filter_map(|name| Some((name, page.contract.features.get(name)?))).collect();
    let numbers: Vec<_> = numbers.into_iter().filter(|(_, feature)| feature.value == "number").collect();
    let (name, feature) = stream.pick(&numbers)?;
    let scale = match feature.unit.as_str() {
        "s" => "<1..5 s>",
        "m" => "<5..30 m>",
        "m/s" => "<4..12 m/s>",
        "m/s^2" => "<2..6 m/s^2>",
        "m/s^3" => "<5..20 m/s^3>",
        _ => "<0.5..2>",
    };
    Some((shortened(name), fill(page, name, &format!("1 / (1 + abs({name}) / {scale})"), stream)))
}

fn shortened(name: &str) -> String {
    name.chars().take(40).collect()
}

/// An index drawn with the given weights.
pub fn weighted(weights: &[f64], stream: &mut Stream) -> Option<usize> {
    let total = num::sum(weights.iter().copied());
    if total <= 0.0 {
        return None;
    }
    let mut rest = stream.uniform(0.0, total);
    for (index, weight) in weights.iter().enumerate() {
        rest -= weight;
        if rest < 0.0 && *weight > 0.0 {
            return Some(index);
        }
    }
    weights.iter().rposition(|weight| *weight > 0.0)
}
