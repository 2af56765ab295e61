//! The reference line: poses along lines, arcs, clothoids and parametric cubics.

use super::ROAD_LENGTH_MAX_M;
use crate::formats::import_error::ImportError;
use crate::formats::xml_read::Element;
use crate::kernel::{Pose, Vec2, num};

const GEOMETRIES_MAX: usize = 100_000;
/// Clothoids are integrated by Simpson's rule in steps of this length, metres: errors stay far below a millimetre on any road.
const CLOTHOID_STEP_M: f64 = 0.25;

/// One stretch of a reference line.
pub(super) struct Geometry {
    pub s_m: f64,
    start: Pose,
    length_m: f64,
    shape: Shape,
}

enum Shape {
    Line,
    Arc {
        curvature: f64,
    },
    /// Curvature changes evenly with the way.
    Clothoid {
        from: f64,
        to: f64,
    },
    /// u and v as cubics of p; p runs from 0 to 1, or to the length.
    Cubic {
        u: [f64; 4],
        v: [f64; 4],
        normalized: bool,
    },
}

/// The stretches of a road, sorted by their start.
pub(super) fn read(road: &Element<'_>) -> Result<Vec<Geometry>, ImportError> {
    let view = road.needed_child("planView")?;
    let mut stretches = Vec::new();
    for element in view.named("geometry") {
        if stretches.len() >= GEOMETRIES_MAX {
            return Err(element.refuse(format!("at most {GEOMETRIES_MAX} geometries")));
        }
        let number = |name: &str| element.number_attribute(name);
        let length_m = number("length")?;
        if !(0.0..=ROAD_LENGTH_MAX_M).contains(&length_m) {
            return Err(element.refuse(format!("a length from 0 to {ROAD_LENGTH_MAX_M} m, found {length_m}")));
        }
        let position = Vec2::new(number("x")?, number("y")?);
        let start = Pose { position, heading_rad: number("hdg")? };
        stretches.push(Geometry { s_m: number("s")?, start, length_m, shape: shape(&element)? });
    }
    if stretches.is_empty() {
        return Err(view.refuse("at least one <geometry>"));
    }
    stretches.sort_by(|a: &Geometry, b| a.s_m.total_cmp(&b.s_m));
    Ok(stretches)
}

fn shape(element: &Element<'_>) -> Result<Shape, ImportError> {
    for given in element.children() {
        let number = |name: &str| given.number_attribute(name);
        return Ok(match given.name() {
            "line" => Shape::Line,
            "arc" => Shape::Arc { curvature: number("curvature")? },
            "spiral" => Shape::Clothoid { from: number("curvStart")?, to: number("curvEnd")? },
            "paramPoly3" => Shape::Cubic {
                u: [number("aU")?, number("bU")?, number("cU")?, number("dU")?],
                v: [number("aV")?, number("bV")?, number("cV")?, number("dV")?],
                normalized: given.attribute("pRange") != Some("arcLength"),
            },
            "userData" | "include" | "dataQuality" => continue,
            _ => return Err(element.refuse("a line, arc, spiral or paramPoly3")),
        });
    }
    Err(element.refuse("a line, arc, spiral or paramPoly3"))
}

/// Poses at stations sorted upwards, each on the last stretch that starts at or before it.
pub(super) fn poses(stretches: &[Geometry], stations: &[f64]) -> Vec<Pose> {
    let mut poses = Vec::with_capacity(stations.len());
    let mut clothoid = Clothoid { stretch: usize::MAX, along_m: 0.0, place: Vec2::ZERO };
    for &s_m in stations {
        let after = stretches.partition_point(|stretch| stretch.s_m <= s_m + 1e-9);
        let ix = after.saturating_sub(1);
        let stretch = &stretches[ix];
        let along_m = (s_m - stretch.s_m).clamp(0.0, stretch.length_m);
        let (place, turn) = match &stretch.shape {
            Shape::Line => (Vec2::new(along_m, 0.0), 0.0),
            Shape::Arc { curvature } => arc(*curvature, along_m),
            Shape::Clothoid { from, to } => clothoid.to(ix, *from, *to, stretch.length_m, along_m),
            Shape::Cubic { u, v, normalized } => {
                let p = if *normalized { along_m / stretch.length_m.max(1e-9) } else { along_m };
                parametric(u, v, p)
            }
        };
        poses.push(Pose {
            position: stretch.start.position + place.rotated(stretch.start.heading_rad),
            heading_rad: num::wrap_angle(stretch.start.heading_rad + turn),
        });
    }
    poses
}

fn arc(curvature: f64, along_m: f64) -> (Vec2, f64) {
    let turn = curvature * along_m;
    if turn.abs() < 1e-12 {
        return (Vec2::new(along_m, 0.0), turn);
    }
    let (sin, cos) = num::sin_cos(turn);
    (Vec2::new(sin / curvature, (1.0 - cos) / curvature), turn)
}

fn parametric(u: &[f64; 4], v: &[f64; 4], p: f64) -> (Vec2, f64) {
    let value = |k: &[f64; 4]| k[0] + p * (k[1] + p * (k[2] + p * k[3]));
    let slope = |k: &[f64; 4]| k[1] + p * (2.0 * k[2] + p * 3.0 * k[3]);
    (Vec2::new(value(u), value(v)), num::atan2(slope(v), slope(u)))
}

/// Integration of one clothoid, continued from station to station.
struct Clothoid {
    stretch: usize,
    along_m: f64,
    place: Vec2,
}

impl Clothoid {
    fn to(&mut self, stretch: usize, from: f64, to: f64, length_m: f64, along_m: f64) -> (Vec2, f64) {
        if self.stretch != stretch || along_m < self.along_m {
            *self = Clothoid { stretch, along_m: 0.0, place: Vec2::ZERO };
        }
        let change = (to - from) / length_m.max(1e-9);
        let heading = |s: f64| s * (from + 0.5 * change * s);
        let way = along_m - self.along_m;
        let steps = (way / CLOTHOID_STEP_M).ceil() as usize;
        for k in 0..steps {
            let a = self.along_m + way * k as f64 / steps as f64;
            let b = self.along_m + way * (k + 1) as f64 / steps as f64;
            let [start, middle, end] = [a, 0.5 * (a + b), b].map(|s| Vec2::from_heading(heading(s)));
            self.place = self.place + (start + middle * 4.0 + end) * ((b - a) / 6.0);
        }
        self.along_m = along_m;
        (self.place, heading(along_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stretch(length_m: f64, shape: Shape) -> Geometry {
        Geometry { s_m: 0.0, start: Pose::default(), length_m, shape }
    }

    #[test]
    fn a_clothoid_without_change_is_an_arc() {
        let stations: Vec<f64> = (0..=40).map(f64::from).collect();
        let arc = poses(&[stretch(40.0, Shape::Arc { curvature: 0.04 })], &stations);
        let clothoid = poses(&[stretch(40.0, Shape::Clothoid { from: 0.04, to: 0.04 })], &stations);
        for (a, c) in arc.iter().zip(&clothoid) {
            assert!(a.position.distance(c.position) < 1e-8 && (a.heading_rad - c.heading_rad).abs() < 1e-12);
        }
    }

    #[test]
    fn a_clothoid_ends_where_fresnel_s_integrals_say() {
        // Heading s^2 / 2 from curvature 0 to 1: C and S of Fresnel, scaled; values from Abramowitz and Stegun 7.3.
        let length = num::pow(num::PI, 0.5);
        let end = poses(&[stretch(length, Shape::Clothoid { from: 0.0, to: length })], &[length])[0];
        let expected = Vec2::new(0.779_893_400_4, 0.438_259_147_4) * length;
        assert!(end.position.distance(expected) < 1e-4, "{end:?}");
        assert!((end.heading_rad - num::FRAC_PI_2).abs() < 1e-9);
    }

    #[test]
    fn a_cubic_runs_over_its_range() {
        let cubic =
            |normalized, k: f64| Shape::Cubic { u: [0.0, k, 0.0, 0.0], v: [0.0, 0.0, k * k / 100.0, 0.0], normalized };
        let by_share = poses(&[stretch(10.0, cubic(true, 10.0))], &[5.0])[0];
        let by_way = poses(&[stretch(10.0, cubic(false, 1.0))], &[5.0])[0];
        assert!(by_share.position.distance(by_way.position) < 1e-12);
        assert!((by_way.position.y - 0.25).abs() < 1e-12 && (by_way.heading_rad - num::atan2(0.1, 1.0)).abs() < 1e-12);
    }
}
