//! Search that AdvSim and the AT port share: a profile of 100 numbers over a traffic family's scripted scenario,
//! searched by queries that each simulate the whole scenario. Every family names the same figures in words of its own.

use std::sync::Arc;

use super::grammar::{self, integer, number, optional};
use super::interface::{self, FamilySpec, OwnParameter, own};
use super::published::{self, Port};
use super::staged;
use crate::adapters::Family;
use crate::kernel::num;
use crate::motion::script_space::{PROFILE_VALUES, Perturbation, ScriptSpace};
use crate::motion::traffic_family::{self, actions, standard};
use crate::objects::{Slot, ValueType};
use crate::scene::safebench::{Stage as Places, TrafficFamily};
use crate::search::query_search::{Answer, Queries, ask_all};
use crate::sim::Action;
use crate::stage::judged::Judged;
use crate::stage::{Part, Published, Settings, Stage, StageError, scripted};

/// Description of a source of searched profiles.
pub struct Profiled {
    pub name: &'static str,
    pub title: &'static str,
    pub describes: &'static str,
    /// Motion operator: the space of profiles, and its parameters.
    pub space: &'static str,
    pub space_describes: &'static str,
    pub motion: Vec<OwnParameter>,
    /// Search operator, and what the names of its parameters begin with.
    pub queries: &'static str,
    /// The same search from a sequence that the port publishes.
    pub shipped: &'static str,
    pub prefix: &'static str,
    /// Mechanism that adds to the search's loss.
    pub loss: &'static str,
}

/// Contract and parent of a source.
pub fn family(of: Profiled) -> Family {
    let search = parameters(of.prefix);
    let mut graph = staged::graph_start();
    let values = interface::from_parameters(&of.motion);
    graph.push(interface::node("motion", Slot::Motion, of.space, &["timing"], values));
    let values = interface::from_parameters(&search);
    graph.push(interface::node("search", Slot::Search, of.queries, &["motion"], values));
    graph.push(interface::best_of_search());
    let settings = of.motion.iter().map(interface::follows).collect();
    let space = interface::operator(Slot::Motion, of.space, settings, of.space_describes);
    let mut settings: Vec<_> = search.iter().map(interface::follows).collect();
    settings.push(optional("loss", of.loss, "added to the search's own loss of a simulated scenario"));
    let shipped = interface::operator(
        Slot::Search,
        of.shipped,
        settings.clone(),
        "The same from one of the ten sequences that the port publishes for the traffic family: the first query is that one as it is.",
    );
    let queries = interface::operator(
        Slot::Search,
        of.queries,
        settings,
        "Simulates profiles one after the other, each a change of the best so far, until the ego collides; with a loss of \
         the program's own, all of them, and the least loss wins.",
    );
    staged::family(FamilySpec {
        name: of.name,
        title: of.title,
        describes: of.describes.into(),
        words: vec![of.space, of.queries, of.shipped, of.loss],
        parameters: of.motion.into_iter().chain(search).collect(),
        operators: vec![(Slot::Motion, space), (Slot::Search, queries), (Slot::Search, shipped)],
        without_shared: staged::WITHOUT_SHARED,
        mechanism_slots: vec![grammar::slot(
            of.loss,
            ValueType::Number,
            grammar::candidate_features(),
            "A loss of a simulated scenario by its adversary's motion, smaller is better; added to distance and contact.",
        )],
        graph,
    })
}

/// The parent that plays what the port publishes and searches nothing: one query.
pub fn published(family: &Family, shipped: &'static str, prefix: &str) -> Published {
    let mut program = family.parent.clone();
    program.parameters.extend([grammar::value(&format!("{prefix}query_count"), 1.0)]);
    for node in program.operator_graph.values_mut().filter(|node| node.slot == Slot::Search) {
        node.kind = shipped.into();
    }
    Published { program, kind: Some(shipped) }
}

/// Parameters of the search; each name begins with `prefix`.
fn parameters(prefix: &str) -> Vec<OwnParameter> {
    let named = |name: &str, domain, describes: &str, value| own(&format!("{prefix}{name}"), domain, describes, value);
    vec![
        named(
            "query_count",
            integer(1, 50, "1"),
            "most simulations; without a loss, the first contact is the last",
            8.0,
        ),
        named("query_step", number(0.02, 1.0, "1"), "largest change of a number between queries", 0.8),
        named(
            "changed_share",
            number(0.02, 1.0, "1"),
            "length of the stretch of the 100 numbers that a query changes",
            0.5,
        ),
    ]
}

/// Changes that a source makes to a traffic family's script.
pub struct Setting {
    /// Figures that it sets by their names, where the script has them.
    pub figures: Vec<(&'static str, f64)>,
    /// Change of the script that its profiles describe.
    pub perturbation: Perturbation,
    /// True if the adversary rides a bicycle, whatever the script has.
    pub on_bicycle: bool,
}

/// Puts every part at the middle of the space over the stage's scripted scenario; where that finds no place on the road,
/// nothing is put.
pub fn start(
    stage: &Stage<'_>,
    parts: &mut [Part],
    setting: impl FnOnce(TrafficFamily) -> Result<Setting, StageError>,
) -> Result<(), StageError> {
    let Some(places) = Places::of(&stage.situation.scene) else { return Ok(()) };
    let family = places.staging().family;
    let Setting { figures, perturbation, on_bicycle } = setting(family)?;
    let mut values = standard(family);
    for (name, value) in figures {
        if let Some(place) = staged::place_of(family, name) {
            values[place] = value;
        }
    }
    let scripts = stage.situation.plant.options().scripts;
    let Ok(mut base) = actions(&places, &values, scripts) else { return Ok(()) };
    let adversary = traffic_family::adversary(family);
    if let Some(Action::Triggered(script)) = base.get_mut(adversary).filter(|_| on_bicycle) {
        traffic_family::mount(script);
    }
    let space = ScriptSpace { base, adversary, perturbation };
    parts.iter_mut().for_each(|part| open(stage, &space, part));
    Ok(())
}

/// The middle of a space, simulated: where a search sets out from.
fn open(stage: &Stage<'_>, space: &ScriptSpace, part: &mut Part) {
    let actions = space.actions(&vec![0.5; space.dimensions()]);
    let space = Some(Arc::new(space.clone()));
    let middle = scripted::simulated(stage.situation, actions, adversary(&space), part.window.from_step, space);
    part.candidates = middle.into_iter().collect();
    part.simulated += 1;
}

fn adversary(space: &Option<Arc<ScriptSpace>>) -> usize {
    space.as_ref().map_or(0, |space| space.adversary)
}

/// Shares from 0 to 1. Division may miss the number that was multiplied by its last bit, so its neighbours are asked, too, whether
/// they are the one.
///
/// # Errors
/// The first number that is no share.
pub fn shares(of: impl Iterator<Item = f64>, is_it: impl Fn(f64, usize) -> bool) -> Result<Vec<f64>, f64> {
    let exact = |(k, u): (usize, f64)| {
        let u = [u, u.next_up(), u.next_down()].into_iter().find(|near| is_it(*near, k)).unwrap_or(u);
        if (0.0..=1.0).contains(&u) { Ok(u) } else { Err(u) }
    };
    of.enumerate().map(exact).collect()
}

/// Asks for profiles. Every query is a candidate, scored by minus its loss. As published, a contact ends the search; where
/// the program adds a loss of its own, the search goes on and that loss chooses among the contacts. The first query is drawn at
/// random, or among those that a port publishes.
pub fn search(
    stage: &Stage<'_>,
    settings: &Settings,
    prefix: &str,
    port: Option<Port>,
    parts: &mut [Part],
) -> Result<(), StageError> {
    let number = |name: &str| settings.number(&format!("{prefix}{name}"));
    let count = settings.count(&format!("{prefix}query_count"))?;
    let queries = Queries { count, step: number("query_step")?, changed_share: number("changed_share")? };
    let module = settings.optional("loss");
    let adversaries: Vec<usize> = parts.iter().map(|part| part.actor).collect();
    for part in parts {
        let spaces = part.candidates.iter().filter_map(|c| c.scripted.as_ref()?.space.clone());
        let Some(space) = spaces.into_iter().next() else { continue };
        let (situation, actor, from_step) = (stage.situation, part.actor, part.window.from_step);
        let judged = Judged { situation, actor, from_step, adversaries: &adversaries };
        let mut asked_of_ego = 0;
        let mut ask = |place: &[f64]| {
            asked_of_ego += 1;
            let actions = space.actions(place);
            let mut profiles = scripted::simulated(situation, actions, space.adversary, from_step, None)?;
            let (own, success) = profiles.scripted.as_ref().map(|s| (s.loss(), s.contact))?;
            let extra = module.map_or(0.0, |module| module.of_candidate(&profiles, &judged));
            let loss = num::stored(own + extra)?;
            profiles.score = -loss;
            Some(Answer { loss, success: success && module.is_none(), made: profiles })
        };
        // A profile that is given is played as it is.
        if let Some(given) = stage.counsel.map(|counsel| &counsel.profile).filter(|given| !given.is_empty()) {
            part.candidates = ask(given).map(|answer| answer.made).into_iter().collect();
            part.simulated += asked_of_ego;
            continue;
        }
        let mut stream = stage.stream("queries", actor);
        let first = match port.zip(situation.scene.staging.as_ref()) {
            Some((port, staging)) => published::drawn(port, staging.family, &mut stage.stream("published", actor)),
            None => (0..PROFILE_VALUES).map(|_| stream.unit()).collect(),
        };
        let asked = ask_all(&queries, first, &mut stream, ask);
        part.candidates = asked.into_iter().map(|(_, found)| found).collect();
        part.simulated += asked_of_ego;
    }
    Ok(())
}
