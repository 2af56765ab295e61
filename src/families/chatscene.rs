//! ChatScene (Zhang et al. 2024): a template of actor, place, trigger and behaviour whose numbers are drawn from ranges;
//! every few samples the ranges shrink to mean +- standard deviation of the samples that collided.
//!
//! In the method a language model retrieves snippets for the parts of a description and puts a Scenic program together.
//! Here the experiment file describes a scenario for each kind of traffic family, the template agent composes a behaviour
//! and ranges from it (`forms` is what it may choose from), and `put` makes them the parent's. A kind that is not described
//! has the published template. Afterwards the agents of the role loop change both by patches, and the gates check them.
//! Actor and opposite side of the road come with the traffic family.
//! OS ranks the colliding samples in the method; the samples here are ranked by the share of its route that the ego
//! drove, which is what OS moves most with once the run collides. Choices of ours, as is the small sample.

use std::sync::Arc;

use super::grammar::{self, choice, integer, number, optional, parameter, required};
use super::interface::{self, FamilySpec, OwnParameter, own};
use super::staged;
use crate::adapters::Family;
use crate::kernel::num;
use crate::motion::Candidate;
use crate::motion::chat_template::{Behaviour, DRAWN, DRAWN_MEANS, Template};
use crate::motion::script_space::{Perturbation, ScriptSpace};
use crate::motion::traffic_family::{actions, adversary, standard};
use crate::objects::composition::{BehaviourForm, RangeForm, TemplateForm};
use crate::objects::{Composition, Program, Slot, ValueType};
use crate::scene::safebench::{Stage as Places, TrafficFamily};
use crate::sim::Action;
use crate::stage::judged::Judged;
use crate::stage::{AskTemplates, Asks, Part, Settings, Source, Stage, StageError, scripted};

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "chatscene";
/// Motion operator: a template with its ranges.
pub const SCENE_TEMPLATE: &str = "scene_template";
/// Search operator: samples whose ranges shrink.
pub const RANGE_SHRINKING: &str = "range_shrinking";

/// Low and high of each of the drawn numbers.
type Ranges = [(f64, f64); 5];

/// Kinds of traffic families that share a template: word, parent's behaviour, ranges of the five drawn numbers.
///
/// Ranges follow ChatScene's `OPT_*` where its frame allows: speeds 0-5 on foot or by bicycle, 5-15 else, its trigger
/// and stopping distances, and shifts of the place where the traffic family puts the actor.
const KINDS: [(&str, &str, Ranges); 3] = [
    ("roadside", "steady", [(-10.0, 5.0), (-2.0, 2.0), (0.5, 5.0), (5.0, 25.0), (2.0, 10.0)]),
    ("lane", "stop_before", [(-15.0, 5.0), (-0.5, 0.5), (2.0, 10.0), (10.0, 45.0), (2.0, 20.0)]),
    ("crossing", "intercept", [(-5.0, 10.0), (-5.0, 5.0), (5.0, 15.0), (15.0, 45.0), (2.0, 20.0)]),
];
/// Bounds within which evolution may put the ranges.
const BOUNDS: [(f64, f64, &str); 5] =
    [(-20.0, 20.0, "m"), (-8.0, 8.0, "m"), (0.0, 20.0, "m/s"), (0.0, 60.0, "m"), (0.0, 30.0, "m")];

/// The family as it is registered: what it declares, and the code that carries it out.
pub fn source() -> Source {
    let asks = Asks { templates: Some(AskTemplates { forms, put }), ..Asks::default() };
    Source {
        asks,
        ..Source::new(family())
            .actor(staged::SCRIPTED_ACTOR, staged::actor)
            .operator(SCENE_TEMPLATE, motion)
            .operator(RANGE_SHRINKING, search)
    }
}

/// Contract and parent.
pub fn family() -> Family {
    let ranges = range_parameters();
    let sampling = [
        own(parameter("template_samples", integer(4, 50, "1"), "scenarios drawn a scene; 50 in ChatScene"), 12.0),
        own(parameter("shrink_every", integer(2, 25, "1"), "samples between two steps of the ranges; 10 there"), 4.0),
    ];
    let behaviours: Vec<_> = KINDS.iter().map(|(kind, word, _)| interface::word(&behaviour_of(kind), word)).collect();
    let mut graph = staged::graph_start();
    let settings = interface::from_parameters(&ranges).into_iter().chain(behaviours).collect();
    graph.push(interface::node("motion", Slot::Motion, SCENE_TEMPLATE, &["timing"], settings));
    let settings = interface::from_parameters(&sampling);
    graph.push(interface::node("search", Slot::Search, RANGE_SHRINKING, &["motion"], settings));
    graph.push(interface::best_of_search());
    let mut settings: Vec<_> = ranges.iter().map(interface::follows).collect();
    settings.extend(KINDS.iter().map(|(kind, _, _)| {
        let describes = format!("what the adversary of a {kind} scenario does once it is set off");
        required(&behaviour_of(kind), choice(&Behaviour::WORDS), &describes)
    }));
    let template = interface::operator(
        Slot::Motion,
        SCENE_TEMPLATE,
        settings,
        "A template: where the adversary waits, what sets it off, what it does, and the ranges of its numbers.",
    );
    let mut settings: Vec<_> = sampling.iter().map(interface::follows).collect();
    settings.push(optional("score", "template_score", "added to the rank of a simulated sample"));
    let shrinking = interface::operator(
        Slot::Search,
        RANGE_SHRINKING,
        settings,
        "Draws scenarios from the ranges, simulates each, and shrinks the ranges to what collided.",
    );
    let words: Vec<&'static str> = vec![
        SCENE_TEMPLATE,
        RANGE_SHRINKING,
        "template_score",
        "roadside_behaviour",
        "lane_behaviour",
        "crossing_behaviour",
    ];
    staged::family(FamilySpec {
        name: NAME,
        title: "ChatScene (Zhang et al. 2024)",
        describes: "Composes a scenario from a template: a road user at a place beside or ahead of the ego, a trigger \
                    distance and a behaviour. The numbers are sampled from ranges, and the ranges shrink to the mean \
                    and spread of the samples that made the ego collide."
            .into(),
        words,
        parameters: ranges.into_iter().chain(sampling).collect(),
        operators: vec![(Slot::Motion, template), (Slot::Search, shrinking)],
        without_shared: staged::WITHOUT_SHARED,
        mechanism_slots: vec![grammar::slot(
            "template_score",
            ValueType::Number,
            grammar::candidate_features(),
            "A bonus for a simulated sample by its adversary's motion, larger is better; 10 outweighs a contact.",
        )],
        graph,
    })
}

/// What a template may be composed of, kind by kind.
pub fn forms() -> Vec<TemplateForm> {
    let behaviours = || Behaviour::WORDS.into_iter().zip(Behaviour::DESCRIBES);
    let form = |(kind, published, ranges): &(&'static str, &'static str, Ranges)| TemplateForm {
        kind,
        published,
        behaviours: behaviours().map(|(word, describes)| BehaviourForm { word, describes }).collect(),
        ranges: (0..DRAWN.len())
            .map(|i| {
                let ((low_min, high_max, unit), (low, high)) = (BOUNDS[i], ranges[i]);
                RangeForm { name: DRAWN[i], unit, describes: DRAWN_MEANS[i], low_min, high_max, published: [low, high] }
            })
            .collect(),
    };
    KINDS.iter().map(form).collect()
}

/// Makes a composed template a program's, for one kind of traffic family.
pub fn put(program: &mut Program, kind: &str, template: &Composition) {
    for (drawn, [low, high]) in &template.ranges {
        let ends = [("low", *low), ("high", *high)];
        program.parameters.extend(ends.map(|(end, value)| grammar::value(&range_name(kind, drawn, end), value)));
    }
    for node in program.operator_graph.values_mut().filter(|node| node.kind == SCENE_TEMPLATE) {
        node.settings.insert(behaviour_of(kind), grammar::word(&template.behaviour));
    }
}

fn behaviour_of(kind: &str) -> String {
    format!("{kind}_behaviour")
}

/// Low and high of every number of every kind.
fn range_parameters() -> Vec<OwnParameter> {
    let mut parameters = Vec::new();
    for (kind, _, ranges) in KINDS {
        for (i, drawn) in DRAWN.iter().enumerate() {
            let (low, high, unit) = BOUNDS[i];
            for (end, value) in [("low", ranges[i].0), ("high", ranges[i].1)] {
                let describes = format!("{end} end of the range of {drawn} in {kind} scenarios");
                let name = range_name(kind, drawn, end);
                parameters.push(own(parameter(&name, number(low, high, unit), &describes), value));
            }
        }
    }
    parameters
}

fn range_name(kind: &str, drawn: &str, end: &str) -> String {
    format!("{kind}_{drawn}_{end}")
}

fn kind_of(family: TrafficFamily) -> &'static str {
    match family.number() {
        1 | 2 => "roadside",
        3 | 4 => "lane",
        _ => "crossing",
    }
}

/// The template of the scene's kind of traffic family.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let Some(places) = Places::of(&stage.situation.scene) else { return Ok(()) };
    let family = places.staging().family;
    let kind = kind_of(family);
    let mut ranges = Vec::with_capacity(DRAWN.len());
    for drawn in DRAWN {
        let end = |end| settings.number(&range_name(kind, drawn, end));
        let (low, high) = (end("low")?, end("high")?);
        ranges.push((low.min(high), low.max(high)));
    }
    let word = settings.word(&behaviour_of(kind))?;
    let behaviour = Behaviour::of_word(word).ok_or_else(|| StageError::Missing(format!("behaviour {word}")))?;
    let heading_rad = places.staging().trigger.heading_rad;
    let Ok(base) = actions(&places, &standard(family)) else { return Ok(()) };
    let perturbation = Perturbation::Template(Template { behaviour, heading_rad, ranges });
    let space = Arc::new(ScriptSpace { base, adversary: adversary(family), perturbation });
    for part in parts {
        let place = vec![0.5; DRAWN.len()];
        part.candidates =
            sample(stage, &space, &place, part.window.from_step, Some(space.clone())).into_iter().collect();
    }
    Ok(())
}

fn sample(
    stage: &Stage<'_>,
    space: &ScriptSpace,
    place: &[f64],
    from_step: usize,
    kept: Option<Arc<ScriptSpace>>,
) -> Option<Candidate> {
    let mut actions = space.actions(place);
    // Whoever waits with the adversary is set off with it.
    let distance_m = match actions.get(space.adversary) {
        Some(Action::Triggered(script)) => script.trigger.distance_m,
        _ => return None,
    };
    for action in &mut actions {
        if let Action::Triggered(script) = action {
            script.trigger.distance_m = distance_m;
        }
    }
    scripted::simulated(stage.situation, actions, space.adversary, from_step, kept)
}

/// Draws, simulates, shrinks. Every sample is a candidate.
pub fn search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let (count, every) = (settings.count("template_samples")?, settings.count("shrink_every")?.max(1));
    let adversaries: Vec<usize> = parts.iter().map(|part| part.actor).collect();
    for part in parts {
        let opened = part.candidates.iter().filter_map(|c| c.scripted.as_ref()?.space.clone()).next();
        let Some(mut space) = opened.map(|space| (*space).clone()) else { continue };
        let Perturbation::Template(mut template) = space.perturbation.clone() else { continue };
        let (situation, actor, from_step) = (stage.situation, part.actor, part.window.from_step);
        let judged = Judged { situation, actor, from_step, adversaries: &adversaries };
        let mut stream = stage.stream("samples", actor);
        let (mut samples, mut collided) = (Vec::with_capacity(count), Vec::new());
        for drawn in 0..count {
            if drawn > 0 && drawn % every == 0 {
                template = template.shrunk(&collided);
                space.perturbation = Perturbation::Template(template.clone());
            }
            let place: Vec<f64> = template.ranges.iter().map(|_| stream.unit()).collect();
            let Some(mut found) = sample(stage, &space, &place, from_step, None) else { continue };
            let Some(scenario) = found.scripted.clone() else { continue };
            if scenario.contact {
                collided.push(template.values(&place));
            }
            let extra = settings.optional("score").map_or(0.0, |module| module.of_candidate(&found, &judged));
            let own = if scenario.contact { 10.0 - scenario.route_completion } else { -scenario.distance_m_min };
            found.score = num::stored(own + extra).unwrap_or(own);
            samples.push(found);
        }
        part.candidates = samples;
    }
    Ok(())
}
