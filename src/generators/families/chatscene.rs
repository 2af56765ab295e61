//! ChatScene (Zhang et al. 2024): a template of actor, place, trigger and behaviour whose numbers are drawn from ranges;
//! every few samples the ranges shrink to mean +- standard deviation of the samples that collided.
//!
//! In the method a language model retrieves snippets for the parts of a description and puts a Scenic program together.
//! Here the experiment file describes a scenario for each kind of traffic family, the template agent composes a behaviour
//! and ranges from it (`forms` is what it may choose from), and `put` makes them the parent's. A kind that is not described
//! has the published template. Afterwards the agents of the role loop change both by patches, and the gates check them.
//! Actor and opposite side of the road come with the traffic family; who changes lane is the car in the target lane, as
//! in ChatScene's third scenario, and not the leader.
//! OS ranks the colliding samples in the method; the samples here are ranked by the share of its route that the ego
//! drove, which is what OS moves most with once the run collides. Choices of ours, as is the small sample.

use std::sync::Arc;

use super::grammar::{self, choice, integer, number, optional, required};
use super::interface::{self, FamilySpec, OwnParameter, own};
use super::staged;
use crate::adapters::Family;
use crate::kernel::{Pose, num};
use crate::motion::Candidate;
use crate::motion::chat_behaviour::Behaviour;
use crate::motion::chat_template::{DRAWN, DRAWN_MEANS, Frame, Template};
use crate::motion::script_space::{Perturbation, ScriptSpace};
use crate::motion::traffic_family::{self, actions, standard};
use crate::objects::composition::{BehaviourForm, RangeForm, TemplateForm};
use crate::objects::{Composition, Program, Slot, ValueType};
use crate::scene::Scene;
use crate::scene::safebench::{Stage as Places, TrafficFamily};
use crate::sim::Action;
use crate::stage::judged::Judged;
use crate::stage::{AskTemplates, Asks, Part, Published, Settings, Source, Stage, StageError, scripted};

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "chatscene";
/// Motion operator: a template with its ranges.
pub const SCENE_TEMPLATE: &str = "scene_template";
/// Search operator: samples whose ranges shrink.
pub const RANGE_SHRINKING: &str = "range_shrinking";

/// Low and high of each of the drawn numbers.
type Ranges = [(f64, f64); DRAWN.len()];

/// A kind of traffic families that share a template.
struct Kind {
    name: &'static str,
    /// Name of the setting that holds its behaviour.
    setting: &'static str,
    /// Behaviours that fit its roads and its road user; the first is the published template's.
    behaviours: &'static [Behaviour],
    /// Ranges of the published template, in the order of [`DRAWN`].
    ranges: Ranges,
    /// Ranges to which ChatScene's own search shrank them, in the same order.
    optimised: Ranges,
}

/// The kinds. Ranges follow ChatScene's `OPT_*` as far as its frame allows: speeds up to 5 on foot or by bicycle, 5-10
/// beside the ego, 5-15 over a junction; its trigger, stopping and steering distances; its places, as shifts of the place
/// where the traffic family puts the actor.
///
/// Optimised ranges are the medians over ten routes of the last ranges (`opt_time_5`) of `scenario_*.json`, of the template that has the kind's
/// first behaviour: 1/5, 2/4, 3/1, 4/3, 5/1 with 7/1 and 8/1, 6/1. Speeds and distances stand as they are, places as the same share of
/// the range here that they are of the range there; what a template there has not is as in `ranges`. Its cars set off 60 m from the ego.
const KINDS: [Kind; 6] = [
    Kind {
        name: "roadside",
        setting: "roadside_behaviour",
        behaviours: &[
            Behaviour::InterceptAndStop,
            Behaviour::Intercept,
            Behaviour::Steady,
            Behaviour::CrossAtAngle,
            Behaviour::SpeedUp,
        ],
        ranges: [(-25.0, 5.0), (-1.5, 3.0), (0.5, 5.0), (5.0, 25.0), (0.0, 1.0), (-3.0, 3.0)],
        optimised: [(-18.94, -12.8), (-0.58, 0.78), (1.81, 3.12), (9.02, 11.41), (0.41, 0.57), (-3.0, 3.0)],
    },
    Kind {
        name: "turning",
        setting: "turning_behaviour",
        behaviours: &[Behaviour::InterceptAndStop, Behaviour::Intercept, Behaviour::Steady, Behaviour::CrossAtAngle],
        ranges: [(-8.0, 7.0), (-1.5, 3.0), (0.5, 10.0), (5.0, 25.0), (0.0, 1.0), (-3.0, 3.0)],
        optimised: [(-0.6, 5.41), (-0.21, 0.5), (5.17, 7.62), (6.75, 9.81), (0.17, 0.42), (-3.0, 3.0)],
    },
    Kind {
        name: "lane_change",
        setting: "lane_change_behaviour",
        behaviours: &[
            Behaviour::CutIn,
            Behaviour::CutInAndBrake,
            Behaviour::Weave,
            Behaviour::Drift,
            Behaviour::PullOut,
            Behaviour::MatchEgo,
            Behaviour::StopBefore,
        ],
        ranges: [(-36.0, -6.0), (-0.5, 0.5), (5.0, 10.0), (15.0, 45.0), (3.0, 20.0), (2.5, 4.5)],
        optimised: [(-25.27, -15.0), (-0.5, 0.5), (6.4, 8.66), (15.0, 45.0), (7.7, 14.09), (2.5, 4.5)],
    },
    Kind {
        name: "passing",
        setting: "passing_behaviour",
        behaviours: &[
            Behaviour::CutIn,
            Behaviour::Swerve,
            Behaviour::Drift,
            Behaviour::TurnOff,
            Behaviour::SpeedUp,
            Behaviour::Steady,
        ],
        ranges: [(-20.0, 10.0), (-0.5, 0.5), (4.0, 10.0), (10.0, 60.0), (5.0, 30.0), (2.0, 4.5)],
        optimised: [(-5.34, 2.05), (-0.04, 0.05), (1.88, 6.23), (60.0, 60.0), (5.0, 30.0), (2.0, 4.5)],
    },
    Kind {
        name: "crossing",
        setting: "crossing_behaviour",
        behaviours: &[
            Behaviour::RushAndStop,
            Behaviour::Intercept,
            Behaviour::InterceptAndStop,
            Behaviour::StopBefore,
            Behaviour::TurnOff,
            Behaviour::SlowBlock,
            Behaviour::SpeedUp,
            Behaviour::Steady,
        ],
        ranges: [(-5.0, 10.0), (-0.5, 0.5), (5.0, 15.0), (15.0, 45.0), (0.0, 20.0), (-4.0, 4.0)],
        optimised: [(0.48, 5.28), (-0.5, 0.5), (8.18, 11.91), (60.0, 60.0), (0.76, 1.33), (-4.0, 4.0)],
    },
    Kind {
        name: "oncoming",
        setting: "oncoming_behaviour",
        behaviours: &[
            Behaviour::RushAndStop,
            Behaviour::StopBefore,
            Behaviour::TurnOff,
            Behaviour::Weave,
            Behaviour::SlowBlock,
            Behaviour::Steady,
        ],
        ranges: [(-5.0, 15.0), (-0.5, 0.5), (5.0, 15.0), (15.0, 55.0), (0.0, 20.0), (-4.0, 4.0)],
        optimised: [(5.68, 10.02), (-0.5, 0.5), (7.92, 10.13), (60.0, 60.0), (0.0, 20.0), (-4.0, 4.0)],
    },
];
/// Fewest scenarios that are drawn a scene.
const SAMPLES_MIN: i64 = 4;
/// Bounds within which evolution may put the ranges.
const BOUNDS: [(f64, f64, &str); DRAWN.len()] =
    [(-45.0, 20.0, "m"), (-8.0, 8.0, "m"), (0.0, 20.0, "m/s"), (0.0, 60.0, "m"), (0.0, 30.0, "m"), (-6.0, 6.0, "m")];

const SEARCH_IN_WORDS: &str = "The search plays 12 scenarios (`template_samples`) drawn from the six ranges of the scene's kind, which \
     shrink after every 4 to mean and spread of what collided (if two did). Ranked is 10 less the share of the \
     route driven on contact (9 to 10), else minus the smallest metres. `template_score` is always added and \
     ranks what was played; it steers neither draws nor shrinking, and 10 outweighs a contact. Ranges and \
     behaviours of a kind (`roadside`, `turning`, `lane_change`, `passing`, `crossing`, `oncoming`) act in its \
     scenes alone; filters act behind; no `reshape`, no law. Example: `-acceleration_mps2_max / 4` takes a \
     gentler contact.";

/// The family as it is registered: what it declares, and the code that carries it out.
pub fn source() -> Source {
    let asks = Asks { templates: Some(AskTemplates { forms, kind_of: kind_of_scene, put }), ..Asks::default() };
    let family = family();
    let published = Published { program: optimised(&family), kind: None };
    Source {
        asks,
        published: Some(published),
        ..Source::new(family, SEARCH_IN_WORDS)
            .actor(staged::SCRIPTED_ACTOR, staged::actor)
            .operator(SCENE_TEMPLATE, motion)
            .operator(RANGE_SHRINKING, search)
    }
}

/// The parent with ChatScene's optimised ranges: it draws from them what the contract allows at least, and shrinks nothing.
fn optimised(family: &Family) -> Program {
    let mut program = family.parent.clone();
    for kind in &KINDS {
        for (drawn, (low, high)) in DRAWN.iter().zip(kind.optimised) {
            let ends = [("low", low), ("high", high)];
            program
                .parameters
                .extend(ends.map(|(end, value)| grammar::value(&range_name(kind.name, drawn, end), value)));
        }
    }
    program.parameters.extend([grammar::value("template_samples", SAMPLES_MIN as f64)]);
    program
}

/// Contract and parent.
pub fn family() -> Family {
    let ranges = range_parameters();
    let sampling = [
        own("template_samples", integer(SAMPLES_MIN, 50, "1"), "scenarios drawn a scene; 50 in ChatScene", 12.0),
        own("shrink_every", integer(2, 25, "1"), "samples between two steps of the ranges; 10 there", 4.0),
    ];
    let behaviours = KINDS.iter().map(|kind| interface::word(kind.setting, kind.behaviours[0].word()));
    let mut graph = staged::graph_start();
    let settings = interface::from_parameters(&ranges).into_iter().chain(behaviours).collect();
    graph.push(interface::node("motion", Slot::Motion, SCENE_TEMPLATE, &["timing"], settings));
    let settings = interface::from_parameters(&sampling);
    graph.push(interface::node("search", Slot::Search, RANGE_SHRINKING, &["motion"], settings));
    graph.push(interface::best_of_search());
    let mut settings: Vec<_> = ranges.iter().map(interface::follows).collect();
    settings.extend(KINDS.iter().map(|kind| {
        let describes = format!("what the adversary of a {} scenario does once it is set off", kind.name);
        let words: Vec<&str> = kind.behaviours.iter().map(|behaviour| behaviour.word()).collect();
        required(kind.setting, choice(&words), &describes)
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
    let own_words = [SCENE_TEMPLATE, RANGE_SHRINKING, "template_score"];
    let words: Vec<&'static str> = own_words.into_iter().chain(KINDS.iter().map(|kind| kind.setting)).collect();
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

/// Returns what a template may be composed of, kind by kind.
pub fn forms() -> Vec<TemplateForm> {
    let behaviour = |of: &Behaviour| BehaviourForm { word: of.word(), describes: of.describes() };
    let form = |kind: &Kind| TemplateForm {
        kind: kind.name,
        published: kind.behaviours[0].word(),
        behaviours: kind.behaviours.iter().map(behaviour).collect(),
        ranges: (0..DRAWN.len())
            .map(|i| {
                let ((low_min, high_max, unit), (low, high)) = (BOUNDS[i], kind.ranges[i]);
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
        node.settings.insert(format!("{kind}_behaviour"), grammar::word(&template.behaviour));
    }
}

/// Low and high of every number of every kind.
fn range_parameters() -> Vec<OwnParameter> {
    let mut parameters = Vec::new();
    for Kind { name: kind, ranges, .. } in &KINDS {
        for (i, drawn) in DRAWN.iter().enumerate() {
            let (low, high, unit) = BOUNDS[i];
            for (end, value) in [("low", ranges[i].0), ("high", ranges[i].1)] {
                let describes = format!("{end} end of the range of {drawn} in {kind} scenarios");
                let name = range_name(kind, drawn, end);
                parameters.push(own(&name, number(low, high, unit), &describes, value));
            }
        }
    }
    parameters
}

fn range_name(kind: &str, drawn: &str, end: &str) -> String {
    format!("{kind}_{drawn}_{end}")
}

/// The kind of a staged scene.
fn kind_of_scene(scene: &Scene) -> Option<&'static str> {
    scene.staging.as_ref().map(|staging| kind_of(staging.family).name)
}

fn kind_of(family: TrafficFamily) -> &'static Kind {
    &KINDS[match family {
        TrafficFamily::StraightObstacle => 0,
        TrafficFamily::TurningObstacle => 1,
        TrafficFamily::LaneChanging => 2,
        TrafficFamily::VehiclePassing => 3,
        TrafficFamily::UnprotectedLeftTurn => 5,
        TrafficFamily::RedLightRunning | TrafficFamily::RightTurn | TrafficFamily::CrossingNegotiation => 4,
    }]
}

/// The action that a template changes: as everywhere the one that meets the ego, but where the ego would change lane the
/// car in the lane beside it.
fn adversary(family: TrafficFamily) -> usize {
    if family == TrafficFamily::LaneChanging { 1 } else { traffic_family::adversary(family) }
}

/// How a template's numbers are seen from where its adversary stands.
fn frame(family: TrafficFamily, spawn: &Pose) -> Frame {
    let turned_rad = match kind_of(family).name {
        // It faces the road from its right side.
        "roadside" | "turning" => -num::FRAC_PI_2,
        "passing" => num::PI,
        _ => 0.0,
    };
    // A car in the left lane and one that comes from the left have the ego on their right.
    let on_right = family == TrafficFamily::LaneChanging || kind_of(family).name == "crossing";
    Frame {
        heading_rad: num::wrap_angle(spawn.heading_rad + turned_rad),
        toward_left: if on_right { -1.0 } else { 1.0 },
    }
}

/// The template of the scene's kind of traffic family.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let Some(places) = Places::of(&stage.situation.scene) else { return Ok(()) };
    let family = places.staging().family;
    let Ok(base) = actions(&places, &standard(family), stage.situation.plant.options().scripts) else { return Ok(()) };
    let Some(Action::Triggered(script)) = base.get(adversary(family)) else { return Ok(()) };
    let template = template(family, &script.spawn, settings)?;
    let space = ScriptSpace { base, adversary: adversary(family), perturbation: Perturbation::Template(template) };
    let space = Arc::new(space);
    for part in parts {
        let place = vec![0.5; DRAWN.len()];
        part.candidates =
            sample(stage, &space, &place, part.window.from_step, Some(space.clone())).into_iter().collect();
        part.simulated += 1;
    }
    Ok(())
}

fn template(family: TrafficFamily, spawn: &Pose, settings: &Settings) -> Result<Template, StageError> {
    let kind = kind_of(family);
    let mut ranges = Vec::with_capacity(DRAWN.len());
    for drawn in DRAWN {
        let end = |end| settings.number(&range_name(kind.name, drawn, end));
        let (low, high) = (end("low")?, end("high")?);
        ranges.push((low.min(high), low.max(high)));
    }
    let word = settings.word(kind.setting)?;
    let behaviour = Behaviour::of_word(word).ok_or_else(|| StageError::Missing(format!("behaviour {word}")))?;
    Ok(Template { behaviour, frame: frame(family, spawn), ranges })
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
        part.simulated += count;
    }
    Ok(())
}
