//! A scene that several agents drive in lockstep: its ego, and vehicles that were recorded in it. Each agent has a closed loop of its
//! own, in which it is the ego and every other agent moves as in that one's loop, physics step by physics step.

use std::sync::Arc;

use crate::kernel::{Vec2, num};
use crate::scene::usable::{ROUTE_MIN_M, STEPS_AFTER_MIN};
use crate::scene::{AgentKind, PreparedScene, Scene, SceneFeatures, TrackIx};
use crate::sim::SimError;
use crate::sim::encounters::hit::Hit;
use crate::sim::prepared::body::SUBSTEPS;
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::actors::Actor;
use crate::sim::road_users::driver::{Control, View};
use crate::sim::road_users::intervention::{ActorRef, Intervention};

use super::closed_loop::EgoStep;
use super::episode::{Episode, Form};

/// Least distance between two points of an agent's route, metres: who stands does not turn it.
const ROUTE_SPACING_M: f64 = 1.0;

/// A vehicle that can be an agent, and the scene with it as the ego, in which the scene's own ego has its track's index.
#[derive(Clone, Debug)]
pub struct Agent {
    /// Its track; `None` for the scene's own ego.
    track: Option<TrackIx>,
    plant: Arc<Plant>,
}

impl Agent {
    /// Returns the ego of a scene, and up to `most - 1` vehicles that can be agents beside it, nearest to the ego first: they are there at
    /// the first simulated step and in the two seconds after it, and were recorded on a way of 10 m or more.
    pub fn of_scene(plant: &Arc<Plant>, most: usize) -> Vec<Agent> {
        let (scene, first) = (plant.scene(), plant.first_step());
        let distance_m =
            |track: TrackIx| Some((scene.tracks[track].at(first)?.position.distance(plant.ego_start.position), track));
        let mut near: Vec<(f64, TrackIx)> = (0..plant.tracks()).filter_map(distance_m).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let ego = Agent { track: None, plant: plant.clone() };
        let others = near.into_iter().filter_map(|(_, track)| Agent::in_place_of_ego(plant, track));
        std::iter::once(ego).chain(others).take(most).collect()
    }

    /// Swaps the roles of a track and the ego.
    fn in_place_of_ego(plant: &Plant, track: TrackIx) -> Option<Agent> {
        let own = &plant.scene().tracks[track];
        let route = route_of(own.samples.iter().skip(plant.first_step()).map_while(|s| Some(s.as_ref()?.position)))?;
        if own.kind != AgentKind::Vehicle {
            return None;
        }
        let mut scene = Scene::clone(plant.scene());
        std::mem::swap(&mut scene.ego.track, &mut scene.tracks[track]);
        (scene.ego.route, scene.ego.target_speed_mps) = (route, None);
        if !scene.validate().is_empty() {
            return None;
        }
        // The road is the same, so its graph is, too.
        let lanes = plant.lanes().clone();
        let features = SceneFeatures::of(&scene, &lanes);
        let prepared = Arc::new(PreparedScene { scene: Arc::new(scene), lanes, features });
        let plant = Arc::new(Plant::with_options(prepared, plant.options()).ok()?);
        Some(Agent { track: Some(track), plant })
    }

    /// Returns the name of its recording in the scene.
    pub fn name(&self) -> &str {
        &self.plant.scene().ego.track.id
    }

    /// Returns the scene with it as the ego.
    pub fn plant(&self) -> &Arc<Plant> {
        &self.plant
    }

    /// Returns the index that another agent has among the tracks of this one's scene.
    fn index_of(&self, other: &Agent) -> Option<TrackIx> {
        other.track.or(self.track)
    }
}

/// Returns the way along recorded places as a route; `None` of one that is too short in time or space.
fn route_of(places: impl Iterator<Item = Vec2>) -> Option<Vec<Vec2>> {
    let (mut route, mut count): (Vec<Vec2>, usize) = (Vec::new(), 0);
    for place in places {
        count += 1;
        if route.last().is_none_or(|last| last.distance(place) >= ROUTE_SPACING_M) {
            route.push(place);
        }
    }
    let length_m = num::sum(route.windows(2).map(|pair| pair[0].distance(pair[1])));
    (count > STEPS_AFTER_MIN && length_m >= ROUTE_MIN_M).then_some(route)
}

/// A scene under way with several agents. Everybody else follows the recording. An agent whose episode has ended, with a contact or
/// otherwise, is there no longer for the others from the end of that step on; within the step it is there up to its contact.
///
/// ```
/// use evodrive_sim::sim::{Agent, Control, Plant, SharedScene, SimError};
/// # use std::sync::Arc;
/// # fn drive(plant: &Arc<Plant>) -> Result<(), SimError> {
/// let mut scene = SharedScene::new(&Agent::of_scene(plant, 8))?;
/// while (0..scene.agents()).any(|agent| scene.episode(agent).end().is_none()) {
///     scene.step(|_, view| {
///         Control::Drive { acceleration_mps2: 10.0 - view.ego().speed_mps, steering_rad: 0.0 }
///     })?;
/// }
/// # Ok(())
/// # }
/// ```
pub struct SharedScene {
    episodes: Vec<Episode<'static>>,
    /// For each agent's loop, the agents behind its actors, in their order.
    others: Vec<Vec<usize>>,
}

impl SharedScene {
    /// Starts at the first state of a scene. The agents are some of [`Agent::of_scene`] of one plant.
    pub fn new(agents: &[Agent]) -> Result<SharedScene, SimError> {
        let form = Form { follows_log: false, keeps_account: false, reacts: false };
        let nobody = Arc::new(Intervention::default());
        let begun = |agent: &Agent| Episode::of(agent.plant.clone().into(), nobody.clone().into(), form, &mut |_| ());
        let mut episodes = agents.iter().map(begun).collect::<Result<Vec<_>, _>>()?;
        let starts: Vec<_> = episodes.iter().map(|episode| episode.state.ego).collect();
        let mut others = Vec::with_capacity(agents.len());
        for (own, episode) in agents.iter().zip(&mut episodes) {
            // In the order of the tracks, so that it does not matter in which order the agents were named.
            let index = |other: usize| Some((own.index_of(&agents[other])?, other));
            let mut around: Vec<(TrackIx, usize)> =
                (0..agents.len()).filter(|other| agents[*other].track != own.track).filter_map(index).collect();
            around.sort_unstable();
            for &(track, other) in &around {
                let start = &starts[other];
                episode.state.take_out(track);
                let actor = Actor::driven(ActorRef::Track(track), start.size, start.sample, start.axis);
                episode.state.world.actors.push(actor);
            }
            others.push(around.into_iter().map(|(_, other)| other).collect());
        }
        Ok(SharedScene { episodes, others })
    }

    /// Makes every agent's episode keep everyone's motion: [`Episode::motion`]. To be called before the first step.
    pub fn keeping_motion(mut self) -> SharedScene {
        self.episodes = self.episodes.into_iter().map(Episode::keeping_motion).collect();
        self
    }

    /// Returns the other agents that an agent's loop began with, and what each is there.
    pub fn others(&self, agent: usize) -> impl Iterator<Item = (usize, ActorRef)> {
        let actors = self.episodes[agent].state.world.actors.iter().map(|actor| actor.who);
        self.others[agent].iter().copied().zip(actors)
    }

    /// Returns the number of agents.
    pub fn agents(&self) -> usize {
        self.episodes.len()
    }

    /// Returns an agent's episode, in which it is the ego.
    pub fn episode(&self, agent: usize) -> &Episode<'static> {
        &self.episodes[agent]
    }

    /// Returns the agent whom an agent has touched.
    pub fn met(&self, agent: usize) -> Option<usize> {
        let episode = &self.episodes[agent];
        let with = episode.contact()?.with;
        self.others(agent).find(|(_, who)| *who == with).map(|(other, _)| other)
    }

    /// Asks every agent that still drives for a decision, by its number and what it sees, and carries all of them out for 0.1 s. A
    /// control that is not finite is refused, and nobody moves.
    pub fn step(&mut self, mut decide: impl FnMut(usize, &View<'_>) -> Control) -> Result<(), SimError> {
        let mut steps = Vec::with_capacity(self.agents());
        for (agent, episode) in self.episodes.iter_mut().enumerate() {
            let drives = episode.end().is_none();
            let control = drives.then(|| decide(agent, &episode.observe()));
            steps.push(control.map(|control| episode.ego_step(control)).transpose()?.flatten());
        }
        for (own, episode) in self.episodes.iter_mut().enumerate().filter(|(own, _)| steps[*own].is_some()) {
            episode.move_others(&mut |_| ());
            for (actor, other) in episode.state.world.actors.iter_mut().zip(&self.others[own]) {
                if let Some(step) = &steps[*other] {
                    actor.plan_as_driven(&step.path, &step.samples, step.shown, step.car.axis);
                }
            }
        }
        let hits = self.first_contacts(&steps);
        for ((episode, step), hit) in self.episodes.iter_mut().zip(&steps).zip(hits) {
            if let Some(step) = step {
                episode.recorded(|episode, recorder| episode.conclude(step, hit, &mut |_| (), recorder));
            }
        }
        self.take_out_ended();
        Ok(())
    }

    /// Returns each agent's first contact in the step. An agent that has touched somebody touches nobody later in the step.
    fn first_contacts(&mut self, steps: &[Option<EgoStep>]) -> Vec<Option<Hit>> {
        let sweep = |episode: &mut Episode<'_>, step: &Option<EgoStep>| episode.sweep(step.as_ref()?);
        let mut hits: Vec<Option<Hit>> =
            self.episodes.iter_mut().zip(steps).map(|(episode, step)| sweep(episode, step)).collect();
        for substep in 0..SUBSTEPS {
            let stops: Vec<bool> = hits.iter().map(|hit| hit.is_some_and(|hit| hit.substep == substep)).collect();
            if !stops.contains(&true) {
                continue;
            }
            for (own, episode) in self.episodes.iter_mut().enumerate() {
                if hits[own].is_none_or(|hit| hit.substep <= substep) {
                    continue;
                }
                for (actor, other) in episode.state.world.actors.iter_mut().zip(&self.others[own]) {
                    if stops[*other] {
                        actor.until = substep;
                    }
                }
                hits[own] = sweep(episode, &steps[own]);
            }
        }
        hits
    }

    /// Takes agents whose episode has ended out of the loops that go on.
    fn take_out_ended(&mut self) {
        let ended: Vec<bool> = self.episodes.iter().map(|episode| episode.end().is_some()).collect();
        for (own, episode) in self.episodes.iter_mut().enumerate().filter(|(own, _)| !ended[*own]) {
            for (actor, other) in episode.state.world.actors.iter_mut().zip(&self.others[own]) {
                if ended[*other] {
                    actor.now = None;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::accounts::end::End;
    use crate::sim::scenes::{car, crossing, sample, straight, straight_road};

    fn plant_of(scene: &Scene) -> Arc<Plant> {
        assert_eq!(scene.validate(), vec![]);
        Arc::new(Plant::new(scene).unwrap())
    }

    /// A scene in which agents meet, with up to so many of them.
    fn busy(seed: u64, most: usize) -> Vec<Agent> {
        Agent::of_scene(&plant_of(&crossing(seed, 40, 70)), most)
    }

    /// What an agent decides, by its name and what it sees: some keep straight on, some swerve, some brake.
    fn decided(name: &str, view: &View<'_>) -> Control {
        let of: usize = name.bytes().map(usize::from).sum();
        let steering_rad = [0.0, 0.02, -0.01][of % 3];
        Control::Drive { acceleration_mps2: [0.3, 2.0, -1.0, 0.0][of % 4] - 0.01 * view.ego().speed_mps, steering_rad }
    }

    fn stepped(scene: &mut SharedScene, agents: &[Agent]) {
        scene.step(|agent, view| decided(agents[agent].name(), view)).unwrap();
    }

    fn goes_on(scene: &SharedScene) -> bool {
        scene.episodes.iter().any(|episode| episode.end().is_none())
    }

    /// The first agent that is elsewhere in another one's loop, or ended, and is there.
    fn disagreement(scene: &SharedScene, agents: &[Agent]) -> Option<(usize, usize)> {
        let drives = |of: usize| scene.episode(of).end().is_none();
        let pairs = (0..agents.len()).flat_map(|own| (0..agents.len()).map(move |other| (own, other)));
        pairs.filter(|(own, other)| own != other && drives(*own)).find(|(own, other)| {
            let (track, mut seen) = (agents[*own].index_of(&agents[*other]).unwrap(), Vec::new());
            scene.episode(*own).observe().for_each_within(f64::INFINITY, |one| {
                if one.actor == ActorRef::Track(track) {
                    seen.push((one.position, one.axis, one.velocity, one.size));
                }
            });
            let ego = &scene.episode(*other).state.ego;
            let is = (ego.sample.position, ego.axis, ego.sample.velocity, ego.size);
            seen != if drives(*other) { vec![is] } else { vec![] }
        })
    }

    /// The first agent that touches one whose episode did not end with a contact at that time.
    fn one_sided(scene: &SharedScene) -> Option<usize> {
        let time_s = |of: usize| scene.episode(of).contact().map(|contact| contact.time_s);
        (0..scene.agents()).find(|own| scene.met(*own).is_some_and(|met| time_s(met) != time_s(*own)))
    }

    #[test]
    fn all_loops_agree_on_where_everybody_is_and_who_touches_whom() {
        let (mut ends, mut met) = ([0; 4], 0);
        for seed in 0..12 {
            let agents = busy(seed, 9);
            assert!(agents.len() > 4, "{seed}: {}", agents.len());
            let mut scene = SharedScene::new(&agents).unwrap();
            assert_eq!(disagreement(&scene, &agents), None);
            while goes_on(&scene) {
                stepped(&mut scene, &agents);
                assert_eq!((disagreement(&scene, &agents), one_sided(&scene)), (None, None), "{seed}");
            }
            scene.episodes.iter().for_each(|episode| ends[episode.end().unwrap() as usize] += 1);
            met += (0..agents.len()).filter(|agent| scene.met(*agent).is_some()).count();
        }
        assert!(met > 4 && ends[End::Contact as usize] > met && ends[End::Horizon as usize] > 0, "{met} {ends:?}");
    }

    #[test]
    fn the_checks_find_loops_in_which_others_keep_to_their_recording() {
        let agents = busy(1, 9);
        let mut toy = SharedScene::new(&agents).unwrap();
        for (episode, others) in toy.episodes.iter_mut().zip(&mut toy.others) {
            episode.state.world.actors.clear();
            episode.state.world.simulated.fill(false);
            others.clear();
        }
        assert_eq!(disagreement(&toy, &agents), None, "at the beginning everybody is where it was recorded");
        stepped(&mut toy, &agents);
        assert!(disagreement(&toy, &agents).is_some());
    }

    /// Two that come towards each other in one lane, and a third behind the second. The ego's recording ends at once.
    fn head_on(third_m: f64) -> Vec<Agent> {
        let oncoming = |name, x| car(name, straight(sample(x, 0.5, num::PI, 12.0), 60));
        let mut scene = straight_road(60, 12.0, vec![oncoming("second", 60.0), oncoming("third", third_m)]);
        scene.ego.track.samples[1..].fill(None);
        Agent::of_scene(&plant_of(&scene), 3)
    }

    #[test]
    fn a_contact_between_agents_is_one_event_seen_from_both_sides() {
        let agents = head_on(90.0);
        assert_eq!(agents.iter().map(Agent::name).collect::<Vec<_>>(), ["ego", "second", "third"]);
        let mut scene = SharedScene::new(&agents).unwrap();
        while scene.episode(0).end().is_none() {
            scene.step(|_, _| Control::Drive { acceleration_mps2: 0.0, steering_rad: 0.0 }).unwrap();
        }
        let contact = |of: usize| *scene.episode(of).contact().unwrap();
        let (a, b) = (contact(0), contact(1));
        assert_eq!((scene.met(0), scene.met(1), a.time_s, a.adversary), (Some(1), Some(0), b.time_s, false));
        assert_eq!((a.relative_speed_mps, a.ego_side, a.striker), (b.relative_speed_mps, b.other_side, b.striker));
        // 60 m less a car's length, at 24 m/s: within a physics step.
        assert!((a.time_s - 55.5 / 24.0).abs() < 0.021 && scene.episode(2).end().is_none(), "{}", a.time_s);
        let seen = |scene: &SharedScene| {
            let mut count = 0;
            scene.episode(2).observe().for_each_within(f64::INFINITY, |_| count += 1);
            count
        };
        assert_eq!(seen(&scene), 0, "who has crashed is gone");
    }

    /// When each agent has a contact if the third one hurries.
    fn contacts(agents: &[Agent]) -> Vec<Option<f64>> {
        let mut scene = SharedScene::new(agents).unwrap();
        while goes_on(&scene) {
            let hurries = |agent: usize, view: &View<'_>| agents[agent].name() == "third" && view.decision() >= 15;
            let decided = |agent, view: &View<'_>| Control::Drive {
                acceleration_mps2: if hurries(agent, view) { 5.0 } else { 0.0 },
                steering_rad: 0.0,
            };
            scene.step(decided).unwrap();
            assert_eq!(one_sided(&scene), None);
        }
        scene.episodes.iter().map(|episode| Some(episode.contact()?.time_s)).collect()
    }

    #[test]
    fn who_has_stopped_at_a_contact_is_not_touched_later_in_the_same_step() {
        let mut later_in_the_step = 0;
        for n in 0..40 {
            let agents = head_on(64.6 + 0.05 * f64::from(n));
            // Without the ego the third runs into the second.
            let (all, without_ego) = (contacts(&agents), contacts(&agents[1..]));
            let (Some(stopped_s), Some(touched_s)) = (all[0], without_ego[1]) else { continue };
            if touched_s > stopped_s {
                assert_eq!(all, [Some(stopped_s), Some(stopped_s), None]);
                later_in_the_step += u32::from(touched_s < stopped_s + 0.081);
            }
        }
        assert!(later_in_the_step > 0);
    }

    #[test]
    fn with_the_ego_alone_it_is_an_ordinary_episode() {
        let mut ahead = crossing(3, 40, 70);
        let start = ahead.ego.track.samples[0].unwrap();
        ahead.tracks.retain(|track| {
            track.samples.iter().flatten().all(|s| s.position.x > start.position.x) && track.samples[0].is_some()
        });
        let plant = plant_of(&ahead);
        for acceleration_mps2 in [0.0, 2.0, -2.0] {
            let control = Control::Drive { acceleration_mps2, steering_rad: 0.004 };
            let mut episode = Episode::without_account(plant.clone(), Arc::new(Intervention::default())).unwrap();
            let mut scene = SharedScene::new(&Agent::of_scene(&plant, 1)).unwrap();
            while episode.end().is_none() {
                episode.step(control).unwrap();
                scene.step(|_, _| control).unwrap();
                let shared = scene.episode(0);
                assert_eq!((shared.observe().ego(), shared.end()), (episode.observe().ego(), episode.end()));
                assert_eq!((shared.contact(), shared.steps()), (episode.contact(), episode.steps()));
                assert_eq!(shared.route_completion().to_bits(), episode.route_completion().to_bits());
            }
            assert!(episode.state.world.actors.is_empty(), "nobody turned reactive");
        }
    }

    #[test]
    fn the_order_of_the_agents_changes_nothing() {
        let ways = |agents: &[Agent]| {
            let mut scene = SharedScene::new(agents).unwrap();
            while goes_on(&scene) {
                stepped(&mut scene, agents);
            }
            let way = |agent: usize| {
                let (episode, met) = (scene.episode(agent), scene.met(agent).map(|met| agents[met].name()));
                (agents[agent].name(), episode.state.ego, episode.end(), episode.contact().copied(), met)
            };
            let mut ways: Vec<_> = (0..agents.len()).map(way).map(|of| format!("{of:?}")).collect();
            ways.sort();
            ways
        };
        for seed in 0..6 {
            let mut agents = busy(seed, 9);
            let first = ways(&agents);
            agents.reverse();
            assert_eq!(ways(&agents), first, "{seed}");
            agents.swap(0, 3);
            assert_eq!(ways(&agents), first, "{seed}");
        }
    }

    #[test]
    fn an_agent_is_there_from_the_start_and_drives_somewhere() {
        let all = straight(sample(20.0, 4.0, 0.0, 8.0), 60);
        let mut late = all.clone();
        late[..3].fill(None);
        let mut brief = all.clone();
        brief[20..].fill(None);
        let parked = straight(sample(-20.0, 4.0, 0.0, 0.1), 60);
        let tracks = [("far", straight(sample(90.0, 4.0, 0.0, 8.0), 60)), ("late", late), ("brief", brief)];
        let mut tracks: Vec<_> = tracks.into_iter().chain([("parked", parked), ("near", all)]).collect();
        let scene = straight_road(60, 10.0, tracks.drain(..).map(|(name, samples)| car(name, samples)).collect());
        let agents = Agent::of_scene(&plant_of(&scene), 9);
        assert_eq!(agents.iter().map(Agent::name).collect::<Vec<_>>(), ["ego", "near", "far"]);
        assert_eq!(agents[1].plant().scene().tracks[4].id, "ego", "roles are swapped");
        assert_eq!(Agent::of_scene(&plant_of(&scene), 2).len(), 2);
    }

    #[test]
    fn a_control_that_is_no_number_is_refused_and_nobody_moves() {
        let agents = busy(2, 5);
        let mut scene = SharedScene::new(&agents).unwrap();
        let before: Vec<_> = scene.episodes.iter().map(|episode| episode.state.ego).collect();
        let bad = |agent, view: &View<'_>| match agent {
            3 => Control::Drive { acceleration_mps2: f64::NAN, steering_rad: 0.0 },
            _ => decided("", view),
        };
        assert!(scene.step(bad).is_err());
        assert!(scene.episodes.iter().zip(before).all(|(episode, ego)| episode.state.ego == ego));
        stepped(&mut scene, &agents);
        assert!(scene.episodes.iter().all(|episode| episode.steps() == 1));
    }
}
