//! AT, adversarial trajectories (Zhang et al. 2022): a vehicle's own path plus offsets of at most 1 m whose derivative
//! bounds hold by global scaling, found by particle swarm (black box) or by gradient (white box) on a directional loss.
//!
//! The method perturbs what a trajectory predictor observes. Against a closed-loop ego the perturbed path is the one
//! that is driven: offsets at knots of 0.5 s on the logged future, the first knot 0, loss toward the ego's rollout.
//! This adaptation is ours, declared; the source describes none. Bounds are the method's nuScenes maxima in SI.

use super::grammar::{self, choice, integer, number, optional, required, slot};
use super::interface::{self, FamilySpec, OwnParameter, own};
use crate::adapters::{Family, OperatorSpec};
use crate::kernel::{Vec2, num};
use crate::motion::Candidate;
use crate::motion::feasibility::Bounds;
use crate::motion::offsets::{Interpolation, OffsetSpace};
use crate::objects::{OperatorNode, Slot, ValueType};
use crate::search::gradient::{self, PlainDescent};
use crate::search::pso::{self, Found, Swarm};
use crate::stage::judged::Judged;
use crate::stage::operator::Module;
use crate::stage::{Part, Settings, Source, Stage, StageError};

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "at";
/// Motion operator: the logged path with bounded offsets.
pub const BOUNDED_OFFSETS: &str = "bounded_offsets";
/// Search operator: particle swarm over the offsets.
pub const PARTICLE_SWARM: &str = "particle_swarm";
/// Search operator: gradient descent over the offsets.
pub const OFFSET_GRADIENT: &str = "offset_gradient";

const SEARCH_IN_WORDS: &str = "The search moves a swarm: 10 particles, 100 rounds, each particle offsets of at most 1 m from one \
     vehicle's log; each one's best becomes a candidate. Its loss is the smallest centre distance to the ego's \
     undisturbed path (m) less the mean offset toward it; the best gains at most about 2 on the log, so a term \
     of 1 matters. `offset_loss` (smaller is better) is added or replaces it and steers the swarm; in \
     `offset_gradient` it only ranks the restarts. A `reshape` before the search changes nothing; behind, it \
     keeps the score. Example: `jerk_added_mps3 / 5 - if(struck_by_ego, 1, 0)` prefers contacts that the ego \
     causes.";

/// The family as it is registered: what it declares, and the code that carries it out.
pub fn source() -> Source {
    Source::new(family(), SEARCH_IN_WORDS)
        .operator(BOUNDED_OFFSETS, motion)
        .operator(PARTICLE_SWARM, search)
        .operator(OFFSET_GRADIENT, descend)
}

/// Contract, and the parent: AT as published, on the logged future.
pub fn family() -> Family {
    let (motion, search) = (motion_parameters(), search_parameters());
    FamilySpec {
        name: NAME,
        title: "AT: adversarial trajectories (Zhang et al. 2022)",
        describes: "Keeps a recorded vehicle on its own path and shifts it by offsets of at most one metre at knots of \
                    two seconds. All offsets are scaled down together until speed, acceleration and jerk stay within bounds. \
                    A particle swarm looks for the offsets that bring it toward the ego's rollout."
            .into(),
        words: vec![BOUNDED_OFFSETS, PARTICLE_SWARM, OFFSET_GRADIENT, "offset_loss", "restart_count", "gradient_step"],
        operators: vec![
            (Slot::Motion, motion_operator(&motion)),
            (Slot::Search, search_operator(&search)),
            (Slot::Search, gradient_operator(&search)),
        ],
        without_shared: &[],
        mechanism_slots: vec![slot(
        "offset_loss",
        ValueType::Number,
        grammar::candidate_features(),
        "A loss of a perturbed path, smaller is better; the search operator says whether it is added to AT's own loss \
         or replaces it.",
        )],
        graph: parent_graph(&motion, &search),
        parameters: interface::by_name(motion.into_iter().chain(search)),
    }
    .family()
}

fn motion_parameters() -> Vec<OwnParameter> {
    vec![
        own("offset_m_max", number(0.05, 1.0, "m"), "largest offset at any time; 1 in AT", 1.0),
        own("knot_spacing_s", number(0.3, 4.0, "s"), "time between knots; 2 s give the four points of AT", 2.0),
        own("path_speed_mps_max", number(5.0, 40.0, "m/s"), "speed bound of the perturbed path", 17.2),
        own("path_acceleration_mps2_max", number(0.5, 9.0, "m/s^2"), "longitudinal acceleration bound", 5.1),
        own("path_lateral_mps2_max", number(0.3, 6.0, "m/s^2"), "lateral acceleration bound", 1.87),
        own("path_jerk_mps3_max", number(1.0, 30.0, "m/s^3"), "longitudinal jerk bound", 15.7),
        own("path_lateral_jerk_mps3_max", number(0.5, 20.0, "m/s^3"), "lateral jerk bound", 4.3),
    ]
}

fn search_parameters() -> Vec<OwnParameter> {
    vec![
        own("particle_count", integer(4, 20, "1"), "particles of the swarm; 10 in AT", 10.0),
        own("iteration_count", integer(10, 150, "1"), "iterations of the swarm; 100 in AT", 100.0),
        own("cognitive_pull", number(0.0, 2.5, "1"), "c1; 0.5 in AT", 0.5),
        own("social_pull", number(0.0, 2.5, "1"), "c2; 0.3 in AT", 0.3),
        own("inertia", number(0.1, 1.0, "1"), "w; 1 in AT", 1.0),
        own("toward_weight", number(0.0, 5.0, "1"), "weight of the mean offset toward the ego's rollout", 1.0),
        own("distance_weight", number(0.0, 5.0, "1/m"), "weight of the smallest distance to the ego's rollout", 1.0),
    ]
}

fn motion_operator(parameters: &[OwnParameter]) -> OperatorSpec {
    let mut settings: Vec<_> = parameters.iter().map(interface::follows).collect();
    settings.extend([required(
        "interpolation",
        choice(&["linear", "cubic"]),
        "how offsets run between knots; cubic is smooth in velocity",
    )]);
    interface::operator(
        Slot::Motion,
        BOUNDED_OFFSETS,
        settings,
        "The actor's own logged path and the offsets that may be added to it.",
    )
}

fn search_operator(parameters: &[OwnParameter]) -> OperatorSpec {
    let mut settings: Vec<_> = parameters.iter().map(interface::follows).collect();
    settings.extend([
        optional("loss", "offset_loss", "a loss of the family's own"),
        required("combine", choice(&["add", "replace"]), "what a given loss does to AT's own"),
    ]);
    interface::operator(
        Slot::Search,
        PARTICLE_SWARM,
        settings,
        "Moves a swarm of offsets to smaller loss; the best of every particle become the candidates.",
    )
}

/// The white-box attacker: 10 restarts of 100 iterations at step 0.1 in AT.
fn gradient_operator(parameters: &[OwnParameter]) -> OperatorSpec {
    let shared = ["iteration_count", "toward_weight", "distance_weight"];
    let mut settings: Vec<_> =
        parameters.iter().filter(|p| shared.contains(&p.name.as_str())).map(interface::follows).collect();
    settings.extend([
        required("restart_count", integer(1, 10, "1"), "restarts, the first from the log itself; 10 in AT"),
        required("gradient_step", number(0.005, 0.5, "1"), "step per unit of slope; 0.1 in AT"),
        optional("loss", "offset_loss", "a loss of the family's own, for ranking what the restarts found"),
        required("combine", choice(&["add", "replace"]), "what a given loss does to AT's own in that ranking"),
    ]);
    interface::operator(
        Slot::Search,
        OFFSET_GRADIENT,
        settings,
        "Follows the slope of AT's loss over the offsets; the best of every restart become the candidates.",
    )
}

fn parent_graph(motion: &[OwnParameter], search: &[OwnParameter]) -> Vec<(String, OperatorNode)> {
    let with = |parameters: &[OwnParameter], word| {
        let mut settings = interface::from_parameters(parameters);
        settings.push(word);
        settings
    };
    let (motion, search) =
        (with(motion, interface::word("interpolation", "cubic")), with(search, interface::word("combine", "add")));
    let mut graph = interface::one_marked_vehicle();
    graph.extend([
        interface::node("motion", Slot::Motion, BOUNDED_OFFSETS, &["timing"], motion),
        interface::node("search", Slot::Search, PARTICLE_SWARM, &["motion"], search),
        interface::best_of_search(),
    ]);
    graph
}

/// The record whose maxima the bounds are (nuScenes, 2 Hz) has a sample every this many steps.
const INTERVAL_STEPS: usize = 5;
/// Checks of the loss lie this many samples apart (0.5 s).
const CHECK_STEPS: usize = 5;

/// The actor's own logged path, and the space of offsets around it.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let bounds = Bounds {
        offset_m_max: settings.number("offset_m_max")?,
        speed_mps_max: settings.number("path_speed_mps_max")?,
        acceleration_mps2_max: settings.number("path_acceleration_mps2_max")?,
        lateral_mps2_max: settings.number("path_lateral_mps2_max")?,
        jerk_mps3_max: settings.number("path_jerk_mps3_max")?,
        lateral_jerk_mps3_max: settings.number("path_lateral_jerk_mps3_max")?,
        interval_steps: INTERVAL_STEPS,
    };
    let spacing_s = settings.number("knot_spacing_s")?;
    let cubic = settings.word("interpolation")? == "cubic";
    let interpolation = if cubic { Interpolation::Cubic } else { Interpolation::Linear };
    for part in parts {
        let track = &stage.situation.scene.tracks[part.actor];
        part.offsets = OffsetSpace::of_log(track, part.window, spacing_s, interpolation, bounds);
        part.candidates = part.offsets.iter().map(|space| Candidate::new(space.logged().to_vec(), 0.0)).collect();
    }
    Ok(())
}

/// Moves a swarm over the offsets; every particle's best becomes a candidate, scored by minus its loss.
pub fn search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let swarm = Swarm {
        particles: settings.count("particle_count")?,
        iterations: settings.count("iteration_count")?,
        cognitive: settings.number("cognitive_pull")?,
        social: settings.number("social_pull")?,
        inertia: settings.number("inertia")?,
    };
    let judge = Judge::new(settings, parts)?;
    for part in parts {
        let Some(space) = &part.offsets else { continue };
        let (judged, target) = (judge.of(stage, part), Target::new(stage, part, space));
        let mut offsets = Vec::new();
        let loss = |place: &[f64]| {
            let theta = space.offsets(place, &mut offsets);
            let own = if judge.replaces { 0.0 } else { target.loss(&offsets, theta, judge.weights) };
            let extra = judge.module.map_or(0.0, |module| {
                module.of_candidate(&Candidate::new(space.samples(&offsets, theta), 0.0), &judged)
            });
            own + extra
        };
        let minimum = pso::minimise(&swarm, space.dimensions(), &mut stage.stream("swarm", part.actor), loss);
        let mut offsets = Vec::new();
        part.candidates = minimum
            .iter()
            .map(|best| {
                let theta = space.offsets(&best.place, &mut offsets);
                Candidate { score: -best.loss, ..Candidate::new(space.samples(&offsets, theta), 0.0) }
            })
            .collect();
    }
    Ok(())
}

/// Gradient descent over the offsets from several starts; the best of every start becomes a candidate. The scale θ that
/// keeps the bounds is found at every iteration and taken as given by the slope.
pub fn descend(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let descent = PlainDescent {
        restarts: settings.count("restart_count")?,
        iterations: settings.count("iteration_count")?,
        step: settings.number("gradient_step")?,
    };
    let judge = Judge::new(settings, parts)?;
    for part in parts {
        let Some(space) = &part.offsets else { continue };
        let (judged, target) = (judge.of(stage, part), Target::new(stage, part, space));
        let mut offsets = Vec::new();
        let loss = |place: &[f64], slope: &mut [f64]| {
            let theta = space.offsets(place, &mut offsets);
            slope.fill(0.0);
            target.pull(space, &offsets, theta, judge.weights, slope);
            target.loss(&offsets, theta, judge.weights)
        };
        let mut stream = stage.stream("gradient", part.actor);
        let minimum = gradient::minimise(&descent, space.dimensions(), &mut stream, loss);
        let mut offsets = Vec::new();
        let candidate = |best: &Found| {
            let theta = space.offsets(&best.place, &mut offsets);
            let candidate = Candidate::new(space.samples(&offsets, theta), 0.0);
            let own = if judge.replaces { 0.0 } else { best.loss };
            let given = judge.module.map_or(0.0, |module| module.of_candidate(&candidate, &judged));
            Candidate { score: -own - given, ..candidate }
        };
        part.candidates = minimum.iter().map(candidate).collect();
    }
    Ok(())
}

/// How both searches judge a perturbed path.
struct Judge<'a> {
    /// Weights of the offset toward the ego, and of the distance to it.
    weights: Weights,
    /// A loss of the family's own, and whether it replaces AT's.
    module: Option<&'a Module>,
    replaces: bool,
    adversaries: Vec<usize>,
}

/// Weights of AT's loss.
#[derive(Clone, Copy)]
struct Weights {
    /// a, of the mean offset toward the ego.
    toward: f64,
    /// b, of the smallest distance to it, 1/m.
    distance: f64,
}

impl<'a> Judge<'a> {
    fn new(settings: &'a Settings, parts: &[Part]) -> Result<Judge<'a>, StageError> {
        let module = settings.optional("loss");
        Ok(Judge {
            weights: Weights {
                toward: settings.number("toward_weight")?,
                distance: settings.number("distance_weight")?,
            },
            replaces: settings.word("combine")? == "replace" && module.is_some(),
            module,
            adversaries: parts.iter().map(|part| part.actor).collect(),
        })
    }

    fn of<'j>(&'j self, stage: &Stage<'j>, part: &Part) -> Judged<'j> {
        let (situation, actor, from_step) = (stage.situation, part.actor, part.window.from_step);
        Judged { situation, actor, from_step, adversaries: &self.adversaries }
    }
}

/// Targets of AT's loss: the ego's rollout, and the side on which it lies at the log's closest approach.
struct Target {
    /// Logged position and ego position at every check; `None` where the ego's rollout has ended.
    checks: Vec<(Vec2, Option<Vec2>)>,
    /// Front, left, rear or right of the actor, per check.
    toward: Vec<Vec2>,
}

impl Target {
    fn new(stage: &Stage<'_>, part: &Part, space: &OffsetSpace) -> Target {
        let logged = space.logged();
        let ego = |k: usize| stage.situation.ego.at(part.window.from_step + k).map(|s| s.position);
        let indices = || (0..logged.len()).step_by(CHECK_STEPS);
        let checks: Vec<(Vec2, Option<Vec2>)> = indices().map(|k| (logged[k].position, ego(k))).collect();
        let gap = |check: &(Vec2, Option<Vec2>)| check.1.map(|e| e.distance(check.0));
        let nearest = (0..checks.len())
            .filter_map(|k| Some((k, gap(&checks[k])?)))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map_or(0, |(k, _)| k);
        let axis = |k: usize| Vec2::from_heading(logged[k].heading_rad);
        let wish = checks.get(nearest).and_then(|(own, ego)| ego.map(|e| e - *own)).unwrap_or_default();
        let forward = logged.get(nearest * CHECK_STEPS).map_or(Vec2::ZERO, |s| Vec2::from_heading(s.heading_rad));
        let (ahead, left) = (wish.dot(forward), forward.cross(wish));
        let side = |axis: Vec2| match (ahead.abs() >= left.abs(), ahead >= 0.0, left >= 0.0) {
            (true, true, _) => axis,
            (true, false, _) => -axis,
            (false, _, true) => axis.left(),
            (false, _, false) => -axis.left(),
        };
        Target { toward: indices().map(|k| side(axis(k))).collect(), checks }
    }

    /// −a · mean offset toward the ego + b · smallest centre distance to it.
    fn loss(&self, offsets: &[Vec2], theta: f64, weights: Weights) -> f64 {
        let change = |k: usize| offsets.get(k * CHECK_STEPS).copied().unwrap_or_default() * theta;
        let along = num::sum((0..self.checks.len()).map(|k| change(k).dot(self.toward[k])));
        let distance = |k: usize| Some((self.checks[k].0 + change(k)).distance(self.checks[k].1?));
        let nearest = (0..self.checks.len()).filter_map(distance).fold(200.0, f64::min);
        weights.distance * nearest - weights.toward * along / self.checks.len().max(1) as f64
    }

    /// Adds the slope of [`Target::loss`] at the coordinates, for a given θ.
    fn pull(&self, space: &OffsetSpace, offsets: &[Vec2], theta: f64, weights: Weights, slope: &mut [f64]) {
        let count = self.checks.len().max(1) as f64;
        let mut nearest: Option<(f64, usize, Vec2)> = None;
        for (k, (own, ego)) in self.checks.iter().enumerate() {
            space.pull(k * CHECK_STEPS, self.toward[k] * (-weights.toward * theta / count), slope);
            let Some(ego) = ego else { continue };
            let away = *own + offsets.get(k * CHECK_STEPS).copied().unwrap_or_default() * theta - *ego;
            let distance = away.norm();
            if distance > 1e-9 && nearest.is_none_or(|n| distance < n.0) {
                nearest = Some((distance, k, away * (1.0 / distance)));
            }
        }
        if let Some((_, k, unit)) = nearest {
            space.pull(k * CHECK_STEPS, unit * (weights.distance * theta), slope);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;
    use crate::motion::Window;
    use crate::scene::fixture::two_lane_scene;
    use crate::stage::Situation;

    const WEIGHTS: Weights = Weights { toward: 1.0, distance: 2.0 };

    fn opened(situation: &Situation, interpolation: Interpolation) -> Part {
        let bounds = Bounds {
            offset_m_max: 1.0,
            speed_mps_max: 17.2,
            acceleration_mps2_max: 5.1,
            lateral_mps2_max: 1.87,
            jerk_mps3_max: 15.7,
            lateral_jerk_mps3_max: 4.3,
            interval_steps: INTERVAL_STEPS,
        };
        let window = Window { from_step: 1, steps: 50 };
        let offsets = OffsetSpace::of_log(&situation.scene.tracks[0], window, 0.5, interpolation, bounds);
        Part { actor: 0, window, candidates: vec![], offsets, driven: None, simulated: 0 }
    }

    #[test]
    fn the_slope_of_ats_loss_matches_finite_differences_for_a_given_scale() {
        let situation = Situation::new(std::sync::Arc::new(two_lane_scene()), &crate::ego::Policy::Idm).unwrap();
        let stage = Stage { situation: &situation, seed: Seed(1), counsel: None };
        for interpolation in [Interpolation::Linear, Interpolation::Cubic] {
            let part = opened(&situation, interpolation);
            let space = part.offsets.as_ref().unwrap();
            let target = Target::new(&stage, &part, space);
            let place: Vec<f64> = (0..space.dimensions()).map(|k| 0.3 * num::sin(k as f64)).collect();
            let mut offsets = Vec::new();
            let theta = space.offsets(&place, &mut offsets);
            let mut slope = vec![0.0; place.len()];
            target.pull(space, &offsets, theta, WEIGHTS, &mut slope);
            for k in 0..place.len() {
                let mut at = |step: f64| {
                    let mut moved = place.clone();
                    moved[k] += step;
                    space.offsets(&moved, &mut offsets);
                    target.loss(&offsets, theta, WEIGHTS)
                };
                let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
                assert!((difference - slope[k]).abs() < 1e-6, "{interpolation:?} {k}: {difference} {}", slope[k]);
            }
        }
    }

    #[test]
    fn the_gradient_attacker_keeps_within_a_metre_and_is_never_worse_than_the_log() {
        let situation = Situation::new(std::sync::Arc::new(two_lane_scene()), &crate::ego::Policy::Idm).unwrap();
        let stage = Stage { situation: &situation, seed: Seed(1), counsel: None };
        let mut parts = vec![opened(&situation, Interpolation::Cubic)];
        let mut settings = Settings::default();
        let numbers = [
            ("restart_count", 4.0),
            ("gradient_step", 0.1),
            ("iteration_count", 60.0),
            ("toward_weight", 1.0),
            ("distance_weight", 1.0),
        ];
        settings.numbers.extend(numbers.map(|(name, x)| (name.to_string(), x)));
        settings.words.insert("combine".into(), "add".into());
        descend(&stage, &settings, &mut parts).unwrap();
        let log = &situation.scene.tracks[0];
        let target = Target::new(&stage, &parts[0], parts[0].offsets.as_ref().unwrap());
        let untouched = target.loss(&[], 0.0, Weights { toward: 1.0, distance: 1.0 });
        assert_eq!(parts[0].candidates.len(), 4);
        assert!(-parts[0].candidates[0].score < untouched - 1e-3);
        for candidate in &parts[0].candidates {
            for (k, sample) in candidate.samples.iter().enumerate() {
                assert!(sample.position.distance(log.at(1 + k).unwrap().position) <= 1.0 + 1e-9);
            }
        }
    }
}
