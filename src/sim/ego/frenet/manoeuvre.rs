//! A manoeuvre beside a reference line: a quartic along it, a quintic aside (Werling et al., ICRA 2010).

use super::settings::{STATES, STEP_S, STEPS, Settings};
use crate::ego::pdm::centreline::{Centreline, Pose};
use crate::kernel::{Vec2, num};

/// Speed along the line up to which there is no direction, m/s.
const CRAWL_MPS: f64 = 1e-3;
/// Share of the way from the centre of a bend below which nobody can drive beside the line.
const INSIDE_MIN: f64 = 0.1;
/// Distance before and behind a place between which the bend of the line is taken, metres.
const BEND_M: f64 = 2.0;

/// A polynomial of time or of a way, lowest power first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Polynomial([f64; 6]);

impl Polynomial {
    /// Returns the quartic from a value with its two derivatives to a first derivative at `end`, where the second is 0.
    pub fn to_speed([x, v, a]: [f64; 3], speed: f64, end: f64) -> Polynomial {
        let by = speed - v - a * end;
        let c4 = -(by + 0.5 * a * end) / (2.0 * end * end * end);
        Polynomial([x, v, 0.5 * a, (-a - 12.0 * c4 * end * end) / (6.0 * end), c4, 0.0])
    }

    /// Returns the quintic from a value with its two derivatives to a value at `end`, where both derivatives are 0.
    pub fn to_rest([x, v, a]: [f64; 3], place: f64, end: f64) -> Polynomial {
        let (by, turn) = (place - x - (v + 0.5 * a * end) * end, -(v + a * end) * end);
        let bend = -a * end * end;
        let cube = end * end * end;
        Polynomial([
            x,
            v,
            0.5 * a,
            (10.0 * by - 4.0 * turn + 0.5 * bend) / cube,
            (-15.0 * by + 7.0 * turn - bend) / (cube * end),
            (6.0 * by - 3.0 * turn + 0.5 * bend) / (cube * end * end),
        ])
    }

    /// Returns the value and two derivatives.
    pub fn at(&self, t: f64) -> [f64; 3] {
        let (mut x, mut v, mut a) = (0.0, 0.0, 0.0);
        for c in self.0.iter().rev() {
            a = a * t + 2.0 * v;
            v = v * t + x;
            x = x * t + c;
        }
        [x, v, a]
    }
}

/// The line that manoeuvres follow, with its bends.
pub struct Reference {
    pub line: Centreline,
    /// Curvature at each metre, 1/m.
    bends_1pm: Vec<f64>,
}

impl Reference {
    pub fn of(line: Centreline) -> Reference {
        let heading = |s_m: f64| line.at(s_m).heading_rad;
        let bend = |k: usize| (heading(k as f64 + BEND_M) - heading(k as f64 - BEND_M)) / (2.0 * BEND_M);
        let bends_1pm = (0..=line.length_m() as usize).map(bend).collect();
        Reference { line, bends_1pm }
    }

    fn bend_1pm(&self, s_m: f64) -> f64 {
        self.bends_1pm.get(s_m.max(0.0) as usize).copied().unwrap_or(0.0)
    }
}

/// The ego in the frame of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Way along the line, its change and the change of that: m, m/s, m/s².
    pub along: [f64; 3],
    /// Offset to the left and its two derivatives by the way along, m, 1, 1/m.
    pub aside: [f64; 3],
}

impl Start {
    /// Returns the start for a rear axle's pose, speed, acceleration and curvature; `None` against the line, or where it bends too much.
    pub fn of(reference: &Reference, at: Pose, [v, a, curvature_1pm]: [f64; 3]) -> Option<Start> {
        let (s_m, _) = reference.line.project(at.position);
        let foot = reference.line.at(s_m);
        let bend = reference.bend_1pm(s_m);
        let d = Vec2::from_heading(foot.heading_rad).cross(at.position - foot.position);
        let turn = num::wrap_angle(at.heading_rad - foot.heading_rad);
        let (inside, (sine, cosine)) = (1.0 - bend * d, num::sin_cos(turn));
        if inside < INSIDE_MIN || cosine < INSIDE_MIN {
            return None;
        }
        let (tangent, swing) = (sine / cosine, curvature_1pm * inside / cosine - bend);
        let by_way = inside * tangent;
        let by_way_2 = -bend * by_way * tangent + inside / (cosine * cosine) * swing;
        let speed = v * cosine / inside;
        let pull = speed * speed / cosine * (inside * tangent * swing - bend * by_way);
        Some(Start { along: [s_m, speed, (a - pull) * cosine / inside], aside: [d, by_way, by_way_2] })
    }
}

/// The planned state of the ego at a step of a manoeuvre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planned {
    /// Pose of the rear axle.
    pub pose: Pose,
    pub speed_mps: f64,
}

/// Limits of the car.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Abilities {
    pub engine_mps2: f64,
    pub brake_mps2: f64,
    pub curvature_1pm: f64,
}

/// A manoeuvre: a way to go on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Manoeuvre {
    along: Polynomial,
    aside: Polynomial,
    end_s: f64,
    /// Way along up to its end where `aside` is a function of that way.
    reach_m: Option<f64>,
}

impl Manoeuvre {
    /// Makes a manoeuvre to a speed and an offset after some steps.
    pub fn to(start: &Start, speed_mps: f64, offset_m: f64, end_step: usize, is_slow: bool) -> Manoeuvre {
        let end_s = end_step as f64 * STEP_S;
        let along = Polynomial::to_speed(start.along, speed_mps, end_s);
        let [d, by_way, by_way_2] = start.aside;
        if is_slow {
            let way_m = along.at(end_s)[0] - start.along[0];
            let reach_m = if way_m > 0.0 { way_m } else { end_s };
            return Manoeuvre {
                along,
                aside: Polynomial::to_rest(start.aside, offset_m, reach_m),
                end_s,
                reach_m: Some(reach_m),
            };
        }
        let [_, v, a] = start.along;
        let aside = Polynomial::to_rest([d, by_way * v, by_way_2 * v * v + by_way * a], offset_m, end_s);
        Manoeuvre { along, aside, end_s, reach_m: None }
    }

    /// Returns way, speed and acceleration along, offset and its two derivatives by the way, at a step; `None` where it slides aside.
    fn at(&self, step: usize) -> Option<([f64; 3], [f64; 3])> {
        let t = step as f64 * STEP_S;
        let mut along = self.along.at(t.min(self.end_s));
        if t > self.end_s {
            along = [along[0] + along[1] * (t - self.end_s), along[1], 0.0];
        }
        let aside = match self.reach_m {
            Some(reach_m) => self.aside.at((along[0] - self.along.at(0.0)[0]).clamp(0.0, reach_m)),
            None => {
                let ([d, v, a], [_, s_v, s_a]) = (self.aside.at(t.min(self.end_s)), along);
                if s_v > CRAWL_MPS {
                    [d, v / s_v, (a - v / s_v * s_a) / (s_v * s_v)]
                } else if v.abs() > CRAWL_MPS {
                    return None;
                } else {
                    [d, 0.0, 0.0]
                }
            }
        };
        Some((along, aside))
    }

    /// Returns the cost of aiming at a speed by it; `None` where the car cannot do it.
    pub fn cost(&self, reference: &Reference, aimed_mps: f64, car: &Abilities, settings: &Settings) -> Option<f64> {
        let (mut cost, mut last_mps) = (0.0, 0.0);
        for step in 0..STATES {
            let (along, aside) = self.at(step)?;
            if along[1] < -0.1 || along[2] > car.engine_mps2.max(car.brake_mps2) {
                return None;
            }
            let bend = reference.bend_1pm(along[0]);
            let inside = 1.0 - bend * aside[0];
            if inside < INSIDE_MIN {
                return None;
            }
            let tangent = aside[1] / inside;
            let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
            let turned = (aside[2] + bend * aside[1] * tangent) * cosine * cosine / inside + bend;
            let (curvature_1pm, speed_mps) = (turned * cosine / inside, (along[1] * inside / cosine).max(0.0));
            let acceleration_mps2 = if step == 0 { 0.0 } else { (speed_mps - last_mps) / STEP_S };
            let is_sharp = curvature_1pm.abs() > car.curvature_1pm
                || speed_mps * speed_mps * curvature_1pm.abs() > settings.across_mps2;
            if step > 0 && (is_sharp || !(-car.brake_mps2..=car.engine_mps2).contains(&acceleration_mps2)) {
                return None;
            }
            last_mps = speed_mps;
            let turn = num::atan(tangent);
            let off = speed_mps - aimed_mps;
            let [all, end, middle] = settings.speed_weights;
            let is_end = f64::from(step == STEPS);
            cost += settings.acceleration_weight * acceleration_mps2 * acceleration_mps2
                + (all + end * is_end + middle * f64::from(step == STATES / 2)) * off * off
                + (settings.offset_weights[0] + settings.offset_weights[1] * is_end) * aside[0] * aside[0]
                + (settings.turn_weights[0] + settings.turn_weights[1] * is_end) * turn * turn;
        }
        Some(cost)
    }

    /// Returns its states; those that slide aside keep the line's heading.
    pub fn states(&self, reference: &Reference) -> [Planned; STATES] {
        std::array::from_fn(|step| {
            let (along, aside) = self.at(step).unwrap_or((self.along.at(self.end_s), [0.0; 3]));
            planned(reference, along, aside)
        })
    }
}

fn planned(reference: &Reference, along: [f64; 3], aside: [f64; 3]) -> Planned {
    let foot = reference.line.at(along[0]);
    let inside = 1.0 - reference.bend_1pm(along[0]) * aside[0];
    let turn = num::atan2(aside[1], inside);
    let position = foot.position + Vec2::from_heading(foot.heading_rad).left() * aside[0];
    let speed_mps = (along[1] * num::hypot(inside, aside[1])).max(0.0);
    Planned { pose: Pose { position, heading_rad: foot.heading_rad + turn }, speed_mps }
}

/// Returns the states under full brakes at the present offset.
pub fn stop(reference: &Reference, start: &Start, brake_mps2: f64) -> [Planned; STATES] {
    let [s_m, v, _] = start.along;
    std::array::from_fn(|step| {
        let t = (step as f64 * STEP_S).min(v / brake_mps2);
        let along = [s_m + v * t - 0.5 * brake_mps2 * t * t, v - brake_mps2 * t, 0.0];
        planned(reference, along, [start.aside[0], 0.0, 0.0])
    })
}
