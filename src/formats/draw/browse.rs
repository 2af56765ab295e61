//! A page of many scenes as cards with a plan view each, which filters and sorts them in a browser, offline. Plan views are drawn from a few
//! hundred whole numbers a scene, so that the page stays small.

use serde::Serialize;

use super::player::{escaped, script_json};
use crate::kernel::geom::{beside_piece, needed_points};
use crate::kernel::{Extent, Vec2, num};
use crate::scene::{AgentKind, LaneKind, Scene, Track};

const JS: &str = include_str!("assets/browse.js");
const CSS: &str = include_str!("assets/browse.css");

/// Most points of lanes, and most road users, of a plan view.
const LANE_POINTS_MAX: usize = 320;
const OTHERS_MAX: usize = 14;
/// Largest distance at which a line may be drawn beside its true course, metres.
const BESIDE_M: f64 = 0.6;
/// Half the edge of a plan view, least and most, and its margin around the ego's path, metres.
const HALF_MIN_M: f64 = 35.0;
const HALF_MAX_M: f64 = 110.0;
const AROUND_M: f64 = 18.0;

/// A scene as the page describes and draws it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Card {
    /// The id, as commands take it.
    pub id: String,
    /// A name for people.
    pub name: String,
    /// The kind of place.
    pub place: String,
    /// Source of the scene: a format, or the family of a suite's case.
    pub source: String,
    /// Class of the contact or threat, where one is known.
    pub class: String,
    /// Number of road users beside the ego.
    pub users: usize,
    /// Speed of the ego at the start, m/s.
    pub speed_mps: f64,
    /// Duration of the scene, s.
    pub duration_s: f64,
    /// The command that shows it.
    pub command: String,
    /// Plan view that is drawn.
    pub plan: Plan,
}

/// A plan view: lines as x, y, x, y, .. in decimetres from the lower left corner of a square.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Plan {
    /// Edge of the square, decimetres.
    pub size: i32,
    /// Centre lines of lanes.
    pub lanes: Vec<Vec<i32>>,
    /// The way of the ego.
    pub ego: Vec<i32>,
    /// The ways of others by the first letter of their kind.
    pub others: Vec<(char, Vec<i32>)>,
}

impl Plan {
    /// Returns the plan view of a scene around the ego's way: its recorded motion, or its route where no motion was recorded.
    pub fn of(scene: &Scene) -> Plan {
        let drove = way(&scene.ego.track, scene.ego.start_step);
        let moved = drove.first().zip(drove.last()).is_some_and(|(first, last)| first.distance(*last) > 2.0);
        let ego = if moved { drove } else { scene.ego.route.clone() };
        let frame = Frame::around(&ego);
        let others = scene.tracks.iter().filter_map(|track| {
            let way: Vec<Vec2> = way(track, 0).into_iter().filter(|at| frame.holds(*at)).collect();
            let near =
                way.iter().flat_map(|at| ego.iter().map(move |own| own.distance(*at))).fold(f64::INFINITY, f64::min);
            (!way.is_empty()).then_some((near, letter(track.kind), way))
        });
        let mut others: Vec<(f64, char, Vec<Vec2>)> = others.collect();
        others.sort_by(|a, b| a.0.total_cmp(&b.0));
        others.truncate(OTHERS_MAX);
        Plan {
            size: frame.dm(2.0 * frame.half_m),
            lanes: lanes(scene, &frame),
            ego: frame.line(&ego),
            others: others.into_iter().map(|(_, letter, way)| (letter, frame.line(&way))).collect(),
        }
    }
}

fn letter(kind: AgentKind) -> char {
    match kind {
        AgentKind::Vehicle => 'v',
        AgentKind::Pedestrian => 'p',
        AgentKind::Cyclist => 'c',
        AgentKind::Static => 's',
    }
}

fn way(track: &Track, from: usize) -> Vec<Vec2> {
    track.samples.iter().skip(from).flatten().map(|sample| sample.position).collect()
}

/// Returns the lanes in a frame, those nearest to its centre first, as many as there is room for.
fn lanes(scene: &Scene, frame: &Frame) -> Vec<Vec<i32>> {
    let roads = scene.road.lanes.iter().filter(|lane| lane.kind != LaneKind::Other);
    let mut all: Vec<(f64, Vec<i32>)> = Vec::new();
    for piece in roads.flat_map(|lane| lane.centre.split(|at| !frame.holds(*at))).filter(|piece| piece.len() > 1) {
        let near_m = piece.iter().map(|at| at.distance(frame.centre)).fold(f64::INFINITY, f64::min);
        all.push((near_m, frame.line(piece)));
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = 2 * LANE_POINTS_MAX;
    let fits = |(_, line): &(f64, Vec<i32>)| {
        left = left.checked_sub(line.len())?;
        Some(line.clone())
    };
    all.iter().map_while(fits).collect()
}

/// The square that a plan view shows.
struct Frame {
    centre: Vec2,
    half_m: f64,
}

impl Frame {
    fn around(way: &[Vec2]) -> Frame {
        let first = way.first().copied().unwrap_or(Vec2::ZERO);
        let near = way.iter().filter(|at| at.distance(first) < 2.0 * HALF_MAX_M);
        let Extent { low, high } = Extent::around(near.copied().chain([first]));
        let half_m = (0.5 * (high.x - low.x).max(high.y - low.y) + AROUND_M).clamp(HALF_MIN_M, HALF_MAX_M);
        Frame { centre: (low + high) * 0.5, half_m }
    }

    fn holds(&self, at: Vec2) -> bool {
        (at.x - self.centre.x).abs() <= self.half_m && (at.y - self.centre.y).abs() <= self.half_m
    }

    fn dm(&self, metres: f64) -> i32 {
        num::rounded(10.0 * metres, 0) as i32
    }

    /// Returns a line of as few points as keep its course.
    fn line(&self, points: &[Vec2]) -> Vec<i32> {
        let corner = self.centre - Vec2::new(self.half_m, self.half_m);
        simplified(points).into_iter().map(|at| at - corner).flat_map(|at| [self.dm(at.x), self.dm(at.y)]).collect()
    }
}

/// Returns the ends of a line, and the points without which it would take another course.
fn simplified(points: &[Vec2]) -> Vec<Vec2> {
    let beside = |a: usize, b: usize, k: usize| beside_piece(points[a], points[b], points[k]).0 / BESIDE_M;
    let needed = needed_points(points.len(), beside);
    let kept: Vec<Vec2> = points.iter().zip(needed).filter(|(_, needed)| *needed).map(|(at, _)| *at).collect();
    // A road user that stands gives a place and no line.
    match kept[..] {
        [first, last] if first.distance(last) < BESIDE_M => vec![first],
        _ => kept,
    }
}

/// Returns the page; `note` says what it shows and what it leaves out.
pub fn browse_html(cards: &[Card], title: &str, note: &str) -> String {
    let (title, note) = (escaped(title), escaped(note));
    let filter = |name: &str, id: &str| {
        format!("<label>{name} <select id=\"{id}\"><option value=\"\">all</option></select></label>\n")
    };
    let range = |name: &str, id: &str, step: &str| {
        let field = |end: &str, hint: &str| {
            format!(
                "<input id=\"{id}-{end}\" type=\"number\" step=\"{step}\" placeholder=\"{hint}\" aria-label=\"{name}, {hint}\">"
            )
        };
        format!("<label>{name} {} to {}</label>\n", field("min", "least"), field("max", "most"))
    };
    let filters = [
        filter("place", "place"),
        filter("source", "source"),
        filter("contact or threat", "class"),
        range("road users", "users", "1"),
        range("ego's speed, m/s", "speed", "0.1"),
        "<label>name or id <input id=\"text\" type=\"search\"></label>\n".to_string(),
        "<label>order <select id=\"order\"><option value=\"\">as in the file</option><option value=\"users\">most road users</option>\
         <option value=\"speed\">fastest</option><option value=\"class\">contact or threat</option></select></label>\n"
            .to_string(),
    ];
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n<style>\n{CSS}</style>\n</head>\n<body>\n\
         <h1>{title}</h1>\n<p>{note}</p>\n<form id=\"filters\">\n{}</form>\n<p id=\"count\"></p>\n<div id=\"cards\"></div>\n\
         <button id=\"more\" type=\"button\" hidden>show more</button>\n<dialog id=\"one\"></dialog>\n\
         <noscript>This page draws with a script.</noscript>\n\
         <script type=\"application/json\" id=\"scenes\">{}</script>\n<script>\n{JS}</script>\n</body>\n</html>\n",
        filters.concat(),
        script_json(cards)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::fixture::two_lane_scene;

    #[test]
    fn a_line_keeps_its_bends_and_loses_what_lies_between_them() {
        let bend: Vec<Vec2> = (0..=20).map(|k| Vec2::new(f64::from(k.min(10)), f64::from((k - 10).max(0)))).collect();
        assert_eq!(simplified(&bend), [Vec2::new(0.0, 0.0), Vec2::new(10.0, 0.0), Vec2::new(10.0, 10.0)]);
        let stands = [Vec2::new(1.0, 1.0), Vec2::new(1.1, 1.0), Vec2::new(1.0, 1.1)];
        assert_eq!(simplified(&stands), [Vec2::new(1.0, 1.0)]);
        assert!(simplified(&[]).is_empty());
    }

    #[test]
    fn a_plan_view_lies_in_its_square_and_is_small_however_much_a_scene_has() {
        let mut scene = two_lane_scene();
        let lane = scene.road.lanes[0].clone();
        let wavy = |k: usize| Vec2::new(0.5 * k as f64, if k.is_multiple_of(2) { 0.0 } else { 3.0 });
        for _ in 0..50 {
            scene.road.lanes.push(crate::scene::Lane { centre: (0..200).map(wavy).collect(), ..lane.clone() });
        }
        for _ in 0..100 {
            scene.tracks.push(scene.ego.track.clone());
        }
        let plan = Plan::of(&scene);
        let points: usize = plan.lanes.iter().map(Vec::len).sum();
        assert!(points <= 2 * LANE_POINTS_MAX && plan.others.len() == OTHERS_MAX, "{points} {}", plan.others.len());
        let all = plan.lanes.iter().chain([&plan.ego]).chain(plan.others.iter().map(|of| &of.1)).flatten();
        assert!(all.count() > 0);
        assert!(plan.others.iter().flat_map(|of| &of.1).all(|x| (0..=plan.size).contains(x)), "{plan:?}");
    }
}
