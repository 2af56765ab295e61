//! Tracks as obstacles: a track that never moves is static, any other has a trajectory from the file's step 0 on.

use std::ops::Range;

use super::ids::Ids;
use super::standing::stands;
use super::{exact, point, rectangle};
use crate::formats::export_error::Note;
use crate::formats::staging::stretches;
use crate::formats::xml_write::{Xml, decimal};
use crate::kernel::Vec2;
use crate::scene::validate::COORDINATE_MAX_M;
use crate::scene::{AgentKind, Sample, Scene, Track};

/// A vehicle longer than this is called a truck, metres.
const CAR_LENGTH_M_MAX: f64 = 6.5;
/// A road user that has not come yet, or has gone, waits this far from the road, metres.
const WAITING_AWAY_M: f64 = 500.0;
/// Slower motion across the heading is a rounding error, m/s.
const LATERAL_MPS_MIN: f64 = 1e-9;

pub(super) fn write(xml: &mut Xml, scene: &Scene, ids: &Ids, notes: &mut Vec<Note>) {
    for (edge, &id) in scene.road.edges.iter().zip(&ids.edges) {
        if let Some((centre, heading_rad, length_m, width_m)) = as_box(edge) {
            boundary(xml, centre, heading_rad, length_m, width_m, id);
        }
    }
    let start = scene.ego.start_step;
    for (track, ids) in scene.tracks.iter().zip(&ids.tracks).filter(|(track, _)| stands(track)) {
        let Some(sample) = track.at(0) else { continue };
        xml.within("staticObstacle", &[("id", &ids[0])], |xml| {
            xml.leaf("type", "unknown");
            shape(xml, track);
            xml.within("initialState", &[], |xml| state(xml, sample, 0, false));
        });
    }
    let mut waiting = Waiting::beside(scene);
    for ((ix, track), ids) in scene.tracks.iter().enumerate().zip(&ids.tracks).filter(|((_, t), _)| !stands(t)) {
        let parts = stretches(track, start);
        note(ix, track, &parts, start, notes);
        for (part, id) in parts.iter().zip(ids) {
            dynamic(xml, track, part.clone(), *id, start, &mut waiting);
        }
    }
}

fn note(ix: usize, track: &Track, parts: &[Range<usize>], start: usize, notes: &mut Vec<Note>) {
    let what = format!("tracks[{ix}] {:?}", track.id);
    let mut say = |reason: &str| notes.push(Note::new(what.clone(), reason));
    if track.samples.iter().take(start).any(Option::is_some) {
        say("its history before the ego's start stands in <?evodrive?> alone: step 0 of the file is that start");
    }
    match parts {
        [] => say("it is seen only before the ego's start, so the file has no obstacle for it"),
        [part] if part.start > start => {
            say("it comes after step 0; until then it waits beside the map, since the format asks for a state there")
        }
        [_] => {}
        _ => say("it is not seen at every step; each stretch is an obstacle of its own"),
    }
}

fn dynamic(xml: &mut Xml, track: &Track, part: Range<usize>, id: u32, start: usize, waiting: &mut Waiting) {
    let kind = match track.kind {
        AgentKind::Vehicle if track.length_m > CAR_LENGTH_M_MAX => "truck",
        AgentKind::Vehicle => "car",
        AgentKind::Pedestrian => "pedestrian",
        AgentKind::Cyclist => "bicycle",
        AgentKind::Static => "unknown",
    };
    let mut states: Vec<(usize, Sample)> = part.filter_map(|step| Some((step - start, *track.at(step)?))).collect();
    if states.first().is_none_or(|(step, _)| *step > 0) {
        states.insert(0, (0, waiting.place(track)));
    }
    if let [(only, _)] = states[..] {
        states.push((only + 1, waiting.place(track)));
    }
    // All states of a trajectory must have the same fields.
    let slides = states.iter().any(|(_, sample)| lateral_mps(sample).abs() > LATERAL_MPS_MIN);
    xml.within("dynamicObstacle", &[("id", &id)], |xml| {
        xml.leaf("type", kind);
        shape(xml, track);
        xml.within("initialState", &[], |xml| state(xml, &states[0].1, 0, slides));
        xml.within("trajectory", &[], |xml| {
            for (step, sample) in &states[1..] {
                xml.within("state", &[], |xml| state(xml, sample, *step, slides));
            }
        });
    });
}

fn shape(xml: &mut Xml, track: &Track) {
    xml.within("shape", &[], |xml| rectangle(xml, track.length_m, track.width_m, 0.0, None));
}

fn lateral_mps(sample: &Sample) -> f64 {
    sample.velocity.dot(Vec2::from_heading(sample.heading_rad).left())
}

fn state(xml: &mut Xml, sample: &Sample, step: usize, slides: bool) {
    let ahead = Vec2::from_heading(sample.heading_rad);
    xml.within("position", &[], |xml| point(xml, "point", sample.position));
    exact(xml, "orientation", decimal(sample.heading_rad));
    exact(xml, "time", step);
    exact(xml, "velocity", decimal(sample.velocity.dot(ahead)));
    if slides {
        exact(xml, "velocityY", decimal(lateral_mps(sample)));
    }
}

/// Places off the road, one beside the other.
struct Waiting {
    next: Vec2,
    /// Away from the road.
    away: f64,
}

impl Waiting {
    fn beside(scene: &Scene) -> Waiting {
        let points = || scene.road.lanes.iter().flat_map(|lane| lane.left.iter().chain(&lane.right));
        let high = points().map(|p| p.x).fold(f64::MIN, f64::max);
        let low = points().fold(Vec2::new(f64::MAX, f64::MAX), |m, p| Vec2::new(m.x.min(p.x), m.y.min(p.y)));
        if high + 2.0 * WAITING_AWAY_M < COORDINATE_MAX_M {
            return Waiting { next: Vec2::new(high + WAITING_AWAY_M, low.y), away: 1.0 };
        }
        Waiting { next: Vec2::new(low.x - WAITING_AWAY_M, low.y), away: -1.0 }
    }

    fn place(&mut self, track: &Track) -> Sample {
        let half = Vec2::new(self.away * (0.5 * track.length_m + 0.5), 0.0);
        let position = self.next + half;
        self.next = position + half;
        Sample { position, heading_rad: 0.0, velocity: Vec2::ZERO }
    }
}

/// Centre, heading, length and width of a closed rectangle.
fn as_box(line: &[Vec2]) -> Option<(Vec2, f64, f64, f64)> {
    let [a, b, c, d, e] = *line else { return None };
    let (along, across) = (a - b, c - b);
    let (length, width) = (along.norm(), across.norm());
    let is_closed = a == e && d.distance(c + along) < 1e-6;
    let is_upright = length > 1e-3 && width > 1e-3 && along.dot(across).abs() < 1e-6 * length * width;
    (is_closed && is_upright).then(|| (a.lerp(c, 0.5), along.heading(), length, width))
}

fn boundary(xml: &mut Xml, centre: Vec2, heading_rad: f64, length_m: f64, width_m: f64, id: u32) {
    xml.within("staticObstacle", &[("id", &id)], |xml| {
        xml.leaf("type", "roadBoundary");
        xml.within("shape", &[], |xml| rectangle(xml, length_m, width_m, 0.0, None));
        xml.within("initialState", &[], |xml| {
            state(xml, &Sample { position: centre, heading_rad, velocity: Vec2::ZERO }, 0, false)
        });
    });
}
