//! Human: SafeBench's hand-designed scenarios (Xu et al. 2022), the traffic families' own parameters on a grid, without
//! any search. The grid is that of the benchmark's `human.json`; each run takes one of its members.
//!
//! Every figure of the grid's middle is a parameter that evolution may move, and one number scales how far the grid
//! reaches. The published file lists every member as a scene of its own; here a member is drawn a scene, so that a
//! program is labelled by one run a route. That is our choice.

use super::grammar::{self, number, optional};
use super::interface::{self, FamilySpec, OwnParameter, own};
use super::staged;
use crate::adapters::Family;
use crate::kernel::num;
use crate::motion::traffic_family::{FamilyParameter, actions, adversary};
use crate::objects::{Slot, ValueType};
use crate::scene::safebench::{Stage as Places, TrafficFamily};
use crate::stage::judged::Judged;
use crate::stage::{Part, Settings, Source, Stage, StageError, scripted};

/// The family's name in programs, experiments and tables.
pub const NAME: &str = "human";
/// Motion operator: the grid of hand-chosen parameters.
pub const PARAMETER_GRID: &str = "parameter_grid";
/// Search operator: an order over the grid, by an expression or none.
pub const GRID_ORDER: &str = "grid_order";

const SEARCH_IN_WORDS: &str = "Nothing is searched: the 9 or 10 members of the traffic family's grid are each played once, all score 0, \
     and the parent's `soft_choice` draws one evenly, whether or not it collided. `grid_score` is the whole \
     score: at `temperature` 0.5 one unit makes a member e^2 = 7.4 times likelier; without it the temperature \
     changes nothing. `best_choice` takes the highest, of equals the first. A middle such as \
     `right_turn_trigger_m` acts in scenes of its traffic family alone, `grid_reach` in all; filters before or \
     behind remove members; no `reshape`, no law. Example: `-ego_distance_m_min` prefers members that come \
     nearest to the undisturbed ego's way.";

/// The family as it is registered: what it declares, and the code that carries it out.
pub fn source() -> Source {
    Source::new(family(), SEARCH_IN_WORDS)
        .actor(staged::SCRIPTED_ACTOR, staged::actor)
        .operator(PARAMETER_GRID, motion)
        .operator(GRID_ORDER, search)
}

/// Contract and parent.
pub fn family() -> Family {
    let parameters = own_parameters();
    let mut graph = staged::graph_start();
    graph.push(interface::node(
        "motion",
        Slot::Motion,
        PARAMETER_GRID,
        &["timing"],
        interface::from_parameters(&parameters),
    ));
    graph.push(interface::node("search", Slot::Search, GRID_ORDER, &["motion"], vec![]));
    let temperature = ("temperature".to_string(), grammar::from_parameter("temperature"));
    graph.push(interface::node("choice", Slot::Diversity, "soft_choice", &["search"], vec![temperature]));
    let motion = interface::operator(
        Slot::Motion,
        PARAMETER_GRID,
        parameters.iter().map(interface::follows).collect(),
        "The scenarios of a grid of hand-chosen parameters around the given middle, each simulated against the ego.",
    );
    let search = grammar::operator(
        Slot::Search,
        GRID_ORDER,
        [optional("score", "grid_score", "an order over the grid; without one all members are alike")],
        "Gives every member of the grid the value of an expression, or 0.",
    );
    let mut family = staged::family(FamilySpec {
        name: NAME,
        title: "Human: SafeBench's hand-designed scenarios (Xu et al. 2022)",
        describes: "One scripted road user a traffic family waits until the ego is near and then crosses, brakes or \
                    comes toward it. Speed, trigger distance and place are hand-chosen and varied on a small grid; one \
                    member of the grid is drawn. Nothing is searched."
            .into(),
        words: vec![PARAMETER_GRID, GRID_ORDER, "grid_score"],
        parameters,
        operators: vec![(Slot::Motion, motion), (Slot::Search, search)],
        without_shared: staged::WITHOUT_SHARED,
        mechanism_slots: vec![grammar::slot(
            "grid_score",
            ValueType::Number,
            grammar::candidate_features(),
            "Rank of a scenario of the grid by the adversary's motion when it was simulated; larger is likelier.",
        )],
        graph,
    });
    // Its word is nobody's own: every family may draw.
    family.contract.parameters.extend([grammar::temperature_parameter()]);
    family.parent.parameters.extend([grammar::value("temperature", 0.5)]);
    family
}

/// Name of a scenario parameter in θ.
pub fn name(family: TrafficFamily, parameter: &FamilyParameter) -> String {
    format!("{}_{}", family.name(), parameter.name)
}

/// Bounds from half the least to one and a half times the greatest figure that SafeBench uses anywhere.
fn own_parameters() -> Vec<OwnParameter> {
    let of = |(family, place, p): (TrafficFamily, usize, &FamilyParameter)| {
        let levels = levels(family, place);
        let figures = || levels.iter().copied().chain([p.standard, p.sampled.0, p.sampled.1]);
        let (least, most) = (figures().fold(f64::INFINITY, f64::min), figures().fold(0.0, f64::max));
        let domain = number(0.5 * least, 1.5 * most, p.unit);
        let describes = format!("middle of the grid: {} of the {} scenario", p.name, family.name());
        own(&name(family, p), domain, &describes, middle(&levels))
    };
    let reach = own("grid_reach", number(0.0, 2.5, "1"), "how far the grid reaches; 1 as published", 1.0);
    staged::scenario_parameters().map(of).chain([reach]).collect()
}

/// Values of a scenario parameter in `human.json`.
fn levels(family: TrafficFamily, place: usize) -> Vec<f64> {
    let grid: &[&[f64]] = match family {
        TrafficFamily::StraightObstacle => &[&[2.5], &[16.0, 18.0, 20.0, 22.0, 24.0], &[40.0, 45.0]],
        TrafficFamily::TurningObstacle => &[&[10.0], &[15.0, 16.0, 17.0, 18.0, 19.0], &[8.0, 10.0]],
        TrafficFamily::LaneChanging => {
            &[&[30.0, 35.0, 40.0], &[1.0], &[10.0, 15.0, 20.0], &[15.0], &[20.0], &[3.0], &[30.0]]
        }
        TrafficFamily::VehiclePassing => &[&[50.0], &[25.0, 30.0, 35.0], &[6.0, 8.0, 10.0], &[45.0]],
        TrafficFamily::RedLightRunning | TrafficFamily::CrossingNegotiation => {
            &[&[8.0, 10.0, 12.0], &[31.0, 35.0, 39.0]]
        }
        TrafficFamily::UnprotectedLeftTurn => &[&[10.0, 12.0, 14.0], &[41.0, 45.0, 49.0]],
        TrafficFamily::RightTurn => &[&[10.0, 12.0, 14.0], &[31.0, 35.0, 39.0]],
    };
    grid.get(place).map_or(vec![], |levels| levels.to_vec())
}

fn middle(levels: &[f64]) -> f64 {
    let (least, most) =
        (levels.iter().copied().fold(f64::INFINITY, f64::min), levels.iter().copied().fold(0.0, f64::max));
    0.5 * (least + most)
}

/// Every member of a traffic family's grid, in the order of `human.json`: the last parameter varies first.
pub fn grid(family: TrafficFamily, middles: &[f64], reach: f64) -> Vec<Vec<f64>> {
    let mut members = vec![vec![]];
    for (place, own) in middles.iter().enumerate() {
        let levels = levels(family, place);
        let values: Vec<f64> = levels.iter().map(|level| (own + reach * (level - middle(&levels))).max(0.0)).collect();
        let longer = |member: &Vec<f64>| {
            let member = member.clone();
            values.iter().map(move |value| [member.as_slice(), &[*value]].concat()).collect::<Vec<_>>()
        };
        members = members.iter().flat_map(longer).collect();
    }
    members
}

/// Middles and reach of the grid that has these members in this order.
///
/// # Errors
/// A description of the expected grid, if no grid of this form has them.
pub fn grid_of(family: TrafficFamily, members: &[Vec<f64>]) -> Result<(Vec<f64>, f64), String> {
    let span = |values: &mut dyn Iterator<Item = f64>| {
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
    };
    let (mut middles, mut reach) = (Vec::new(), None);
    for place in 0..members.first().map_or(0, Vec::len) {
        let (least, most) = span(&mut members.iter().filter_map(|member| member.get(place).copied()));
        let (low, high) = span(&mut levels(family, place).into_iter());
        middles.push(0.5 * (least + most));
        if high > low {
            reach = reach.or(Some((most - least) / (high - low)));
        }
    }
    let reach = reach.unwrap_or(0.0);
    let expected = grid(family, &middles, reach);
    // Files hold nine decimals, of the reach and of both ends.
    let near = |(one, other): (&Vec<f64>, &Vec<f64>)| one.iter().zip(other).all(|(a, b)| (a - b).abs() <= 1e-8);
    if expected.len() != members.len() {
        return Err(format!("a grid of {} members, found {} entries", expected.len(), members.len()));
    }
    match expected.iter().zip(members).position(|pair| !near(pair)) {
        None => Ok((middles, reach)),
        Some(k) => Err(format!(
            "a grid in the order of human.json, with {:?} at place {k}, found {:?}",
            expected[k], members[k]
        )),
    }
}

/// The grid's scenarios; members that find no place on the scene's road are left out.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let Some(places) = Places::of(&stage.situation.scene) else { return Ok(()) };
    let family = places.staging().family;
    let own = staged::scenario_parameters().filter(|(f, _, _)| *f == family);
    let middles = own.map(|(f, _, p)| settings.number(&name(f, p))).collect::<Result<Vec<f64>, _>>()?;
    let members = grid(family, &middles, settings.number("grid_reach")?);
    for part in parts {
        let scripts = stage.situation.plant.options().scripts;
        let laid_out: Vec<_> = members.iter().filter_map(|member| actions(&places, member, scripts).ok()).collect();
        part.simulated += laid_out.len();
        let simulated =
            |actions| scripted::simulated(stage.situation, actions, adversary(family), part.window.from_step, None);
        part.candidates = laid_out.into_iter().filter_map(simulated).collect();
    }
    Ok(())
}

/// An order over the grid: none, or an expression's.
pub fn search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let adversaries: Vec<usize> = parts.iter().map(|part| part.actor).collect();
    for part in parts {
        let (situation, actor, from_step) = (stage.situation, part.actor, part.window.from_step);
        let judged = Judged { situation, actor, from_step, adversaries: &adversaries };
        for candidate in &mut part.candidates {
            let score = settings.optional("score").map_or(0.0, |module| module.of_candidate(candidate, &judged));
            candidate.score = num::stored(score).unwrap_or(0.0);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::traffic_family::parameters;

    #[test]
    fn the_parent_s_grid_is_that_of_human_json() {
        let middles = |family| -> Vec<f64> {
            (0..parameters(family).len()).map(|place| middle(&levels(family, place))).collect()
        };
        let counts = TrafficFamily::ALL.map(|family| grid(family, &middles(family), 1.0).len());
        assert_eq!(counts, [10, 10, 9, 9, 9, 9, 9, 9]);
        assert_eq!(counts.iter().sum::<usize>() * 10, 740, "scenes in human.json on its ten routes");
        let first = grid(TrafficFamily::StraightObstacle, &middles(TrafficFamily::StraightObstacle), 1.0);
        assert_eq!((&first[0][..], &first[9][..]), (&[2.5, 16.0, 40.0][..], &[2.5, 24.0, 45.0][..]));
        let third = grid(TrafficFamily::LaneChanging, &middles(TrafficFamily::LaneChanging), 1.0);
        assert_eq!(third[4], [35.0, 1.0, 15.0, 15.0, 20.0, 3.0, 30.0]);
    }

    #[test]
    fn a_grid_without_reach_is_its_middle() {
        let members = grid(TrafficFamily::RightTurn, &[9.0, 30.0], 0.0);
        assert!(members.iter().all(|member| member == &[9.0, 30.0]));
    }
}
