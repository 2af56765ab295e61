//! The backward rollout: from the imposed collision half a second at a time, each token drawn by how likely the state
//! is that it would have come from, how well it continues the token after it, and whether that state is on the road.
//! Controls run from token to token in a ramp, so that accelerations do not jump.

use crate::kernel::{OrientedBox, Stream, Vec2, num};
use crate::motion::bicycle::{Control, State};
use crate::motion::token_grid::{Nucleus, SIDE, TOKEN_STEPS, TOKENS, acceleration_mps2, control, draw, yaw_rate_radps};
use crate::scene::{DT_S, LaneIx, Sample, TrackIx};
use crate::stage::Situation;

/// Duration of a token, s.
const TOKEN_S: f64 = TOKEN_STEPS as f64 * DT_S;
/// Within this distance a lane is preferred that heads the same way, metres.
const LANE_NEAR_M: f64 = 6.0;
/// A lane farther away than this counts as this far, metres.
const LANE_M_MAX: f64 = 40.0;
/// Lateral acceleration from which on a token is penalised, m/s².
const LATERAL_MPS2: f64 = 4.0;
/// Curvature beyond which a road user cannot turn, 1/m: heading changes need way.
const CURVATURE_1PM: f64 = 0.4;
/// Speed limit where a lane has none, m/s.
const LIMIT_UNKNOWN_MPS: f64 = 13.9;
/// Steps in which a control goes over into the one of the next token; the rest of a token holds it.
pub const RAMP_STEPS: usize = 3;
/// Log-probability of what cannot be.
const IMPOSSIBLE: f64 = -1e3;
/// Length over which a lane's curvature is measured, metres.
const CURVATURE_OVER_M: f64 = 5.0;

/// Scales of the log-preference; figures of the stand-in: 1.5, 0.2, 1, 0.35, 6, and ours: 0.5 m, 1.25 m/s², 0.2 rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Preference {
    pub acceleration_scale_mps2: f64,
    /// Scale of the yaw rate that the lane does not ask for.
    pub yaw_scale_radps: f64,
    pub lane_scale_m: f64,
    pub heading_scale_rad: f64,
    /// Scale of the difference to half the speed limit.
    pub speed_scale_mps: f64,
    /// Scale of the depth of the body beside the road.
    pub road_scale_m: f64,
    /// Scales of the change of acceleration and yaw rate from one token to the next: what a model that has seen motion expects.
    pub acceleration_change_mps2: f64,
    pub yaw_change_radps: f64,
}

/// The collision that is imposed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Imposed {
    pub state: State,
    /// Scene step of the collision.
    pub step: usize,
}

impl Imposed {
    pub fn new(position: Vec2, heading_rad: f64, speed_mps: f64, step: usize) -> Imposed {
        Imposed { state: State { position, heading_rad, speed_mps }, step }
    }
}

/// Grows motion backward in one situation for one inserted road user.
pub struct Reverse<'a> {
    situation: &'a Situation,
    actor: TrackIx,
    preference: Preference,
    nucleus: Nucleus,
}

/// The lane at a place, as far as the preference needs it.
#[derive(Clone, Copy, Debug)]
struct Along {
    /// Signed, positive to the left.
    offset_m: f64,
    heading_rad: f64,
    curvature_1pm: f64,
    limit_mps: f64,
}

impl<'a> Reverse<'a> {
    pub fn new(situation: &'a Situation, actor: TrackIx, preference: Preference, nucleus: Nucleus) -> Reverse<'a> {
        Reverse { situation, actor, preference, nucleus }
    }

    /// Samples from `from_step` to the collision and the mean log-probability of their tokens; `None` where every way
    /// back leads through another road user.
    pub fn grow(&self, imposed: &Imposed, from_step: usize, stream: &mut Stream) -> Option<(Vec<Sample>, f64)> {
        let steps = imposed.step.checked_sub(from_step)?;
        let mut backward = vec![imposed.state.sample()];
        let (mut state, mut logs, mut tokens) = (imposed.state, 0.0, 0);
        let mut later: Option<Control> = None;
        let mut table = vec![IMPOSSIBLE; TOKENS];
        while backward.len() <= steps {
            let step = imposed.step - (backward.len() - 1);
            self.logs(&state, later, &mut table);
            let blocked = |control: Control| self.is_blocked(&state, later, control, step);
            let (token, log) = draw(&table, &self.nucleus, stream, blocked)?;
            for k in 0..TOKEN_STEPS.min(steps + 1 - backward.len()) {
                state = before(&state, later, control(token), k);
                backward.push(state.sample());
            }
            later = Some(control(token));
            (logs, tokens) = (logs + log, tokens + 1);
        }
        backward.reverse();
        Some((backward, logs / f64::from(tokens.max(1))))
    }

    /// Writes log p(a, ω | s) of every token up to a constant, judged by the state before: gentle, like the token after
    /// it, near a lane and along it, on the road, near half the limit, within what a car can turn.
    fn logs(&self, state: &State, later: Option<Control>, logs: &mut [f64]) {
        logs.fill(IMPOSSIBLE);
        let p = &self.preference;
        let track = self.situation.track(self.actor);
        let field = self.situation.road_field();
        for j in 0..SIDE {
            let yaw = yaw_rate_radps(j);
            let before = state.backward(Control { acceleration_mps2: 0.0, yaw_rate_radps: yaw }, TOKEN_S);
            let mean_heading = 0.5 * (state.heading_rad + before.heading_rad);
            let lane = self.lane(before.position, before.heading_rad);
            let astray = lane.map_or(0.0, |lane| num::wrap_angle(before.heading_rad - lane.heading_rad));
            let by_heading = half_square(astray / p.heading_scale_rad);
            // Share of a token's move by acceleration that goes across the lane: one query serves all of them.
            let across = lane.map_or(0.0, |lane| num::sin(mean_heading - lane.heading_rad));
            let direction = Vec2::from_heading(mean_heading);
            let yaw_jump = later.map_or(0.0, |later| half_square((yaw - later.yaw_rate_radps) / p.yaw_change_radps));
            for i in 0..SIDE {
                let acceleration = acceleration_mps2(i);
                let speed = state.speed_mps - acceleration * TOKEN_S;
                if speed < 0.0 {
                    continue;
                }
                let aside = lane.map_or(LANE_M_MAX, |lane| {
                    (lane.offset_m + 0.5 * acceleration * TOKEN_S * TOKEN_S * across).abs().min(LANE_M_MAX)
                });
                let bend = lane.map_or(0.0, |lane| lane.curvature_1pm) * speed;
                let limit = lane.map_or(LIMIT_UNKNOWN_MPS, |lane| lane.limit_mps);
                let jump = later.map_or(0.0, |later| acceleration - later.acceleration_mps2);
                let place = before.position + direction * (0.5 * acceleration * TOKEN_S * TOKEN_S);
                let room_m = field.map_or(f64::INFINITY, |field| field.distance_m(place));
                let turning = yaw.abs() - CURVATURE_1PM * 0.5 * (speed + state.speed_mps);
                logs[i * SIDE + j] = -(half_square(acceleration / p.acceleration_scale_mps2)
                    + half_square((yaw - bend) / p.yaw_scale_radps)
                    + half_square(aside / p.lane_scale_m)
                    + by_heading
                    + yaw_jump
                    + half_square(jump / p.acceleration_change_mps2)
                    + half_square((0.5 * track.width_m - room_m).max(0.0) / p.road_scale_m)
                    + half_square(((speed * yaw).abs() - LATERAL_MPS2).max(0.0))
                    + half_square((speed - 0.5 * limit) / p.speed_scale_mps)
                    + half_square(turning.max(0.0) / 0.05));
            }
        }
    }

    fn lane(&self, position: Vec2, heading_rad: f64) -> Option<Along> {
        let lanes = &self.situation.lanes;
        let place = lanes
            .nearest_lane(position, heading_rad, LANE_NEAR_M)
            .or_else(|| lanes.nearest_lane_any_heading(position, LANE_M_MAX))?;
        Some(Along {
            offset_m: place.offset_m,
            heading_rad: place.heading_rad,
            curvature_1pm: self.curvature(place.lane, place.s_m),
            limit_mps: self.situation.scene.road.lanes[place.lane].speed_limit_mps.unwrap_or(LIMIT_UNKNOWN_MPS),
        })
    }

    fn curvature(&self, lane: LaneIx, s_m: f64) -> f64 {
        let Some(centre) = self.situation.lanes.centre(lane) else { return 0.0 };
        let heading = |s: f64| centre.heading_at(s.clamp(0.0, centre.length_m()));
        num::wrap_angle(heading(s_m + 0.5 * CURVATURE_OVER_M) - heading(s_m - 0.5 * CURVATURE_OVER_M))
            / CURVATURE_OVER_M
    }

    /// Returns `true` if the token leads back through another road user, half way or at its beginning.
    fn is_blocked(&self, state: &State, later: Option<Control>, control: Control, step: usize) -> bool {
        let mut earlier = [*state; TOKEN_STEPS + 1];
        for k in 0..TOKEN_STEPS {
            earlier[k + 1] = before(&earlier[k], later, control, k);
        }
        let meets = |back: usize| {
            let Some(step) = step.checked_sub(back) else { return false };
            let own = self.situation.body(self.actor, &earlier[back].sample());
            let tracks = self.situation.scene.tracks.iter();
            tracks.filter_map(|track| Some((track, track.at(step)?))).any(|(track, other)| {
                let reach = own.radius() + 0.5 * (track.length_m + track.width_m);
                (own.center - other.position).norm_squared() < reach * reach
                    && own.overlaps(&OrientedBox::new(other.position, other.heading_rad, track.length_m, track.width_m))
            })
        };
        meets(TOKEN_STEPS / 2) || meets(TOKEN_STEPS)
    }
}

/// The state a step earlier within a token, `k` steps before the state that the token leads to.
fn before(state: &State, later: Option<Control>, control: Control, k: usize) -> State {
    let share = ((k + 1) as f64 / RAMP_STEPS as f64).min(1.0);
    let from = later.unwrap_or(control);
    let ramped = Control {
        acceleration_mps2: from.acceleration_mps2 + share * (control.acceleration_mps2 - from.acceleration_mps2),
        yaw_rate_radps: from.yaw_rate_radps + share * (control.yaw_rate_radps - from.yaw_rate_radps),
    };
    let mut earlier = state.backward(ramped, DT_S);
    earlier.speed_mps = earlier.speed_mps.max(0.0);
    earlier
}

fn half_square(x: f64) -> f64 {
    0.5 * x * x
}
