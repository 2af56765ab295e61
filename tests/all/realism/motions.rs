//! Motions that no road user makes, drawn by hand from the recorded motion of one of a scene's vehicles.

use evodrive::kernel::{Vec2, num};
use evodrive::scene::{AgentKind, DT_S, LaneGraph, Sample, Scene, Track};
use evodrive::sim::Action;

/// Samples that a motion lasts at most.
const STEPS: usize = 60;
/// A vehicle to be moved is this fast at least, m/s: from less, a brake of 2 g lasts less than half a second.
const SPEED_MPS_MIN: f64 = 10.0;

/// A scene, the vehicle that is moved, and its recorded samples from the step at which that begins.
pub struct Case {
    pub scene: Scene,
    pub track: usize,
    pub from_step: usize,
    pub log: Vec<Sample>,
}

impl Case {
    /// The fast vehicle farthest from the ego that is seen to the scene's end.
    pub fn of(scene: Scene) -> Option<Case> {
        let from_step = scene.ego.start_step + 1;
        let ego = scene.ego.track.at(scene.ego.start_step)?.position;
        let seen = |track: &Track| (from_step - 1..scene.steps).all(|step| track.at(step).is_some());
        let fast = |track: &Track| track.at(from_step).is_some_and(|s| s.speed_mps() >= SPEED_MPS_MIN);
        let apart = |track: &Track| track.at(from_step).map_or(0.0, |s| s.position.distance(ego));
        let fit = (0..scene.tracks.len()).filter(|ix| {
            let track = &scene.tracks[*ix];
            track.kind == AgentKind::Vehicle && seen(track) && fast(track)
        });
        let track = fit.max_by(|a, b| apart(&scene.tracks[*a]).total_cmp(&apart(&scene.tracks[*b])))?;
        let log = (from_step..scene.steps).filter_map(|step| scene.tracks[track].at(step).copied()).collect();
        Some(Case { scene, track, from_step, log })
    }

    pub fn follow(&self, samples: Vec<Sample>) -> Action {
        Action::Follow { track: self.track, from_step: self.from_step, samples }
    }

    fn insert(&self, samples: Vec<Sample>) -> Action {
        let Track { length_m, width_m, .. } = self.scene.tracks[self.track];
        Action::Insert { kind: AgentKind::Vehicle, length_m, width_m, from_step: self.from_step, samples }
    }

    /// The log with every place shifted, and velocities that fit; headings stay.
    pub fn shifted(&self, shift: impl Fn(f64, &Sample) -> Vec2) -> Vec<Sample> {
        let at = |k: usize| self.log[k].position + shift(k as f64 * DT_S, &self.log[k]);
        let velocity = |k: usize| (at(k + 1) - at(k)) * (1.0 / DT_S);
        let count = self.log.len() - 1;
        (0..count).map(|k| Sample { position: at(k), velocity: velocity(k), ..self.log[k] }).collect()
    }

    /// Moves on from the first place, each step by a velocity; the heading stays.
    fn drawn(&self, velocity: impl Fn(f64) -> Vec2) -> Vec<Sample> {
        let mut now = Sample { velocity: velocity(0.0), ..self.log[0] };
        let mut samples = vec![now];
        for k in 1..STEPS {
            let next = velocity(k as f64 * DT_S);
            now = Sample { position: now.position + (now.velocity + next) * (0.5 * DT_S), velocity: next, ..now };
            samples.push(now);
        }
        samples
    }

    pub fn teleport(&self) -> Action {
        let mut samples = self.log.clone();
        for sample in samples.iter_mut().skip(15) {
            sample.position = sample.position + Vec2::from_heading(sample.heading_rad) * 6.0;
        }
        self.follow(samples)
    }

    /// Ten metres in a second, eased in and out.
    pub fn smooth_teleport(&self) -> Action {
        let eased = |t: f64| 0.5 - 0.5 * num::cos(num::PI * (t - 1.0).clamp(0.0, 1.0));
        self.follow(self.shifted(|t, s| Vec2::from_heading(s.heading_rad) * (10.0 * eased(t))))
    }

    pub fn two_g_brake(&self) -> Action {
        let speed = self.log[0].speed_mps();
        let axis = Vec2::from_heading(self.log[0].heading_rad);
        self.follow(self.drawn(|t| axis * (speed - 2.0 * 9.81 * t).max(0.0)))
    }

    pub fn sideways_slide(&self) -> Action {
        self.follow(self.shifted(|t, _| Vec2::from_heading(self.log[0].heading_rad).left() * (2.5 * t.min(3.0))))
    }

    pub fn against_traffic(&self) -> Action {
        let back =
            |s: &Sample| Sample { heading_rad: num::wrap_angle(s.heading_rad + num::PI), velocity: -s.velocity, ..*s };
        self.insert(self.log.iter().rev().map(back).collect())
    }

    /// A scene with a car that stands beside the vehicle's way, and a way through it.
    pub fn through_parked(&self) -> (Scene, Action) {
        let (mut scene, aside_m, at) = (self.scene.clone(), 4.0, self.log.len().min(30) - 1);
        let place = self.log[at];
        let beside = place.position + Vec2::from_heading(place.heading_rad).left() * aside_m;
        let stands = Sample { position: beside, heading_rad: place.heading_rad, velocity: Vec2::ZERO };
        let samples = vec![Some(stands); scene.steps];
        let parked = Track { id: "parked".into(), kind: AgentKind::Vehicle, length_m: 4.5, width_m: 1.8, samples };
        scene.tracks.push(parked);
        let duration_s = at as f64 * DT_S;
        let eased = |t: f64| 0.5 - 0.5 * num::cos(num::PI * (t / duration_s).min(1.0));
        let way = self.shifted(|t, s| Vec2::from_heading(s.heading_rad).left() * (aside_m * eased(t)));
        (scene, self.follow(way))
    }

    /// Straight off to the side that leads farther from the lanes.
    pub fn off_the_road(&self) -> Action {
        let graph = LaneGraph::of(&self.scene.road);
        let (heading, speed) = (self.log[0].heading_rad, self.log[0].speed_mps());
        let away = |turn_rad: f64| {
            let axis = Vec2::from_heading(heading + turn_rad);
            let way = self.drawn(|_| axis * speed);
            way.into_iter().map(|s| Sample { heading_rad: heading + turn_rad, ..s }).collect::<Vec<Sample>>()
        };
        let far_m = |way: &Vec<Sample>| way.iter().map(|s| graph.off_road_m(s.position)).fold(0.0, f64::max);
        let [left, right] = [away(1.2), away(-1.2)];
        self.follow(if far_m(&left) >= far_m(&right) { left } else { right })
    }

    /// Straight at where another moving car will be in two seconds; `None` where there is no other.
    pub fn through_another(&self) -> Option<Action> {
        let when = self.from_step + 20;
        let (start, ego) = (self.log[0].position, self.scene.ego.track.at(self.from_step)?.position);
        let fits = |(ix, track): &(usize, &Track)| {
            let ends = [self.from_step, when, when + 5].map(|step| track.at(step).map(|s| s.position));
            let [Some(first), Some(then), Some(_)] = ends else { return false };
            let moves = first.distance(then) > 5.0 && then.distance(start) > 8.0 && first.distance(start) > 8.0;
            *ix != self.track && track.kind == AgentKind::Vehicle && moves
        };
        // Far from the ego, so that neither it nor traffic that reacts to it comes between.
        let apart_m = |track: &Track| track.at(self.from_step).map_or(0.0, |s| s.position.distance(ego));
        let others = self.scene.tracks.iter().enumerate().filter(fits);
        let other = others.max_by(|a, b| apart_m(a.1).total_cmp(&apart_m(b.1)));
        let goal = other?.1.at(when)?.position;
        let velocity = (goal - start) * (1.0 / (20.0 * DT_S));
        let way = self.drawn(|_| velocity);
        Some(self.follow(way.into_iter().map(|s| Sample { heading_rad: velocity.heading(), ..s }).collect()))
    }

    /// Someone new half a metre from where the vehicle is.
    pub fn onto_another(&self) -> Action {
        let shift = Vec2::new(0.5, 0.0);
        self.insert(self.log.iter().map(|s| Sample { position: s.position + shift, ..*s }).collect())
    }

    /// Moves to and fro across the way.
    pub fn jitter(&self, amplitude_m: f64, hertz: f64) -> Action {
        let swing = |t: f64| amplitude_m * num::sin(2.0 * num::PI * hertz * t);
        self.follow(self.shifted(|t, s| Vec2::from_heading(s.heading_rad).left() * swing(t)))
    }

    /// The log's places with velocities that say the opposite.
    pub fn lying_velocity(&self) -> Action {
        self.follow(self.log.iter().map(|s| Sample { velocity: -s.velocity, ..*s }).collect())
    }

    /// Stands still at once after a gentle brake, and stays: its way remains undriven.
    pub fn gives_up(&self) -> Action {
        let speed = self.log[0].speed_mps();
        let axis = Vec2::from_heading(self.log[0].heading_rad);
        self.follow(self.drawn(|t| axis * (speed - 4.0 * t).max(0.0)))
    }
}
