//! A scene as compact bytes and back: the input of its digest and the content of a pool file. Little-endian, every list
//! preceded by its length, floats as bits. This module does not know files.

use super::safebench::{SpawnFrame, Staging, TrafficFamily};
use super::{
    AgentKind, Ego, Lane, LaneKind, Light, LightState, Neighbour, Origin, Road, Sample, Scene, StopSign, Track,
};
use crate::kernel::{Digest, Pose, Vec2, num};

/// Part of the domain of every scene digest: rises with any change of the bytes below.
const SCENE_DOMAIN: &str = "evodrive/scene/1";

/// First byte for the neighbours of a side: none, or a count follows. Any other value is the direction of the only one.
const NO_NEIGHBOUR: u8 = 0;
const NEIGHBOURS: u8 = 3;

impl Scene {
    /// The name of everything that a rollout can see: all fields but `origin`.
    pub fn digest(&self) -> Digest {
        scene_digest_of(&scene_bytes(self))
    }
}

/// The digest of a scene, given its bytes.
pub(super) fn scene_digest_of(bytes: &[u8]) -> Digest {
    struct Plain<'a>(&'a [u8]);
    impl serde::Serialize for Plain<'_> {
        fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            serializer.serialize_bytes(self.0)
        }
    }
    match Digest::of(SCENE_DOMAIN, &Plain(bytes)) {
        Ok(digest) => digest,
        Err(error) => unreachable!("plain bytes hold no float that could be refused: {error}"),
    }
}

/// All of a scene but its origin.
pub(super) fn scene_bytes(scene: &Scene) -> Vec<u8> {
    let mut out = Writer(Vec::with_capacity(4096));
    out.text(&scene.id);
    out.count(scene.steps);
    out.count(scene.current_step);
    out.list(&scene.road.lanes, Writer::lane);
    out.list(&scene.road.edges, |w, line| w.points(line));
    out.list(&scene.tracks, Writer::track);
    out.track(&scene.ego.track);
    out.count(scene.ego.start_step);
    out.points(&scene.ego.route);
    out.optional(scene.ego.target_speed_mps);
    out.counts(&scene.objects_of_interest);
    out.list(&scene.lights, Writer::light);
    out.list(&scene.stop_signs, |w, sign| {
        w.point(sign.position);
        w.counts(&sign.lanes);
    });
    out.list(&scene.crosswalks, |w, polygon| w.points(polygon));
    // A scene of no traffic family writes nothing here, so that its digest does not change.
    if let Some(staging) = &scene.staging {
        out.staging(staging);
    }
    out.0
}

/// The bytes end early, name an unknown variant, or go on after the end.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("at byte {at} of the scene: expected {expected}")]
pub struct NotAScene {
    /// Byte offset of the first fault.
    pub at: usize,
    /// Value that was expected there.
    pub expected: &'static str,
}

/// The inverse of [`scene_bytes`], with the origin given.
pub(super) fn scene_of(bytes: &[u8], origin: Origin) -> Result<Scene, NotAScene> {
    let mut reader = Reader { bytes, at: 0 };
    let scene = reader.scene(origin)?;
    if reader.at != bytes.len() {
        return Err(reader.expected("the end of the scene"));
    }
    Ok(scene)
}

struct Writer(Vec<u8>);

impl Writer {
    fn byte(&mut self, value: u8) {
        self.0.push(value);
    }

    fn count(&mut self, value: usize) {
        self.0.extend_from_slice(&(value as u64).to_le_bytes());
    }

    fn number(&mut self, value: f64) {
        let value = num::stored(value).unwrap_or(value);
        self.0.extend_from_slice(&value.to_bits().to_le_bytes());
    }

    fn optional(&mut self, value: Option<f64>) {
        self.byte(u8::from(value.is_some()));
        if let Some(value) = value {
            self.number(value);
        }
    }

    fn text(&mut self, value: &str) {
        self.count(value.len());
        self.0.extend_from_slice(value.as_bytes());
    }

    fn point(&mut self, point: Vec2) {
        self.number(point.x);
        self.number(point.y);
    }

    fn list<T>(&mut self, items: &[T], write: impl Fn(&mut Writer, &T)) {
        self.count(items.len());
        for item in items {
            write(self, item);
        }
    }

    fn points(&mut self, points: &[Vec2]) {
        self.0.reserve(16 * points.len());
        self.list(points, |w, p| w.point(*p));
    }

    fn counts(&mut self, values: &[usize]) {
        self.list(values, |w, v| w.count(*v));
    }

    /// The only neighbour of a side is written without a count: most lanes have no other.
    fn neighbours(&mut self, side: &[Neighbour]) {
        match side {
            [] => self.byte(NO_NEIGHBOUR),
            [one] => self.neighbour(*one),
            several => {
                self.byte(NEIGHBOURS);
                self.list(several, |w, one| w.neighbour(*one));
            }
        }
    }

    fn neighbour(&mut self, Neighbour { lane, same_direction }: Neighbour) {
        self.byte(if same_direction { 1 } else { 2 });
        self.count(lane);
    }

    fn lane(&mut self, lane: &Lane) {
        self.text(&lane.id);
        self.byte(match lane.kind {
            LaneKind::Street => 0,
            LaneKind::Freeway => 1,
            LaneKind::Bike => 2,
            LaneKind::Other => 3,
        });
        for line in [&lane.centre, &lane.left, &lane.right] {
            self.points(line);
        }
        self.counts(&lane.entries);
        self.counts(&lane.exits);
        self.neighbours(&lane.left_neighbours);
        self.neighbours(&lane.right_neighbours);
        self.optional(lane.speed_limit_mps);
    }

    fn track(&mut self, track: &Track) {
        self.text(&track.id);
        self.byte(match track.kind {
            AgentKind::Vehicle => 0,
            AgentKind::Pedestrian => 1,
            AgentKind::Cyclist => 2,
            AgentKind::Static => 3,
        });
        self.number(track.length_m);
        self.number(track.width_m);
        self.0.reserve(48 * track.samples.len());
        self.list(&track.samples, |w, sample| match sample {
            None => w.byte(0),
            Some(sample) => {
                w.byte(1);
                w.point(sample.position);
                w.number(sample.heading_rad);
                w.point(sample.velocity);
            }
        });
    }

    fn pose(&mut self, pose: Pose) {
        self.point(pose.position);
        self.number(pose.heading_rad);
    }

    fn staging(&mut self, staging: &Staging) {
        self.byte(staging.family.number() as u8);
        self.count(staging.route as usize);
        self.pose(staging.trigger);
        self.list(&staging.spawns, |w, frame| {
            w.number(frame.fwd_m);
            w.number(frame.right_m);
            w.number(frame.yaw_rad);
        });
    }

    fn light(&mut self, light: &Light) {
        self.count(light.lane);
        self.point(light.stop_point);
        self.list(&light.states, |w, state| {
            w.byte(match state {
                LightState::Unknown => 0,
                LightState::Stop => 1,
                LightState::Caution => 2,
                LightState::Go => 3,
            });
        });
    }
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

type Read<T> = Result<T, NotAScene>;

impl Reader<'_> {
    fn expected(&self, expected: &'static str) -> NotAScene {
        NotAScene { at: self.at, expected }
    }

    fn array<const N: usize>(&mut self, expected: &'static str) -> Read<[u8; N]> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let bytes = rest.first_chunk::<N>().ok_or_else(|| self.expected(expected))?;
        self.at += N;
        Ok(*bytes)
    }

    fn byte(&mut self, expected: &'static str) -> Read<u8> {
        self.array::<1>(expected).map(|[b]| b)
    }

    fn count(&mut self) -> Read<usize> {
        let value = u64::from_le_bytes(self.array("a count")?);
        usize::try_from(value).map_err(|_| self.expected("a count"))
    }

    fn number(&mut self) -> Read<f64> {
        let value = f64::from_bits(u64::from_le_bytes(self.array("a number")?));
        if value.is_finite() { Ok(value) } else { Err(self.expected("a finite number")) }
    }

    fn optional(&mut self) -> Read<Option<f64>> {
        match self.byte("0 or 1")? {
            0 => Ok(None),
            1 => self.number().map(Some),
            _ => Err(self.expected("0 or 1")),
        }
    }

    fn text(&mut self) -> Read<String> {
        let length = self.count()?;
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let bytes = rest.get(..length).ok_or_else(|| self.expected("a text of that length"))?;
        let text = std::str::from_utf8(bytes).map_err(|_| self.expected("UTF-8 text"))?.to_string();
        self.at += length;
        Ok(text)
    }

    fn point(&mut self) -> Read<Vec2> {
        Ok(Vec2::new(self.number()?, self.number()?))
    }

    /// A list whose items take at least `item_bytes` each, so that a count is refused before memory is taken for it.
    fn list<T>(&mut self, item_bytes: usize, read: impl Fn(&mut Self) -> Read<T>) -> Read<Vec<T>> {
        let count = self.count()?;
        let left = self.bytes.len() - self.at;
        if count.checked_mul(item_bytes).is_none_or(|needed| needed > left) {
            return Err(self.expected("as many items as the count before them says"));
        }
        let mut items = Vec::with_capacity(count);
        for _ in 0..count {
            items.push(read(self)?);
        }
        Ok(items)
    }

    fn points(&mut self) -> Read<Vec<Vec2>> {
        self.list(16, Self::point)
    }

    fn counts(&mut self) -> Read<Vec<usize>> {
        self.list(8, Self::count)
    }

    fn neighbours(&mut self) -> Read<Vec<Neighbour>> {
        match self.byte("a neighbour")? {
            NO_NEIGHBOUR => Ok(vec![]),
            NEIGHBOURS => {
                let side = self.list(9, |r| {
                    let direction = r.byte("a neighbour")?;
                    r.neighbour(direction)
                })?;
                // Fewer neighbours are written in another way, so that a scene has one form.
                if side.len() < 2 { Err(self.expected("two neighbours or more")) } else { Ok(side) }
            }
            direction => Ok(vec![self.neighbour(direction)?]),
        }
    }

    fn neighbour(&mut self, direction: u8) -> Read<Neighbour> {
        match direction {
            1 => Ok(Neighbour { lane: self.count()?, same_direction: true }),
            2 => Ok(Neighbour { lane: self.count()?, same_direction: false }),
            _ => Err(self.expected("a neighbour: 1 or 2; or before them 0 for none, 3 for several")),
        }
    }

    fn lane(&mut self) -> Read<Lane> {
        Ok(Lane {
            id: self.text()?,
            kind: match self.byte("a lane kind")? {
                0 => LaneKind::Street,
                1 => LaneKind::Freeway,
                2 => LaneKind::Bike,
                3 => LaneKind::Other,
                _ => return Err(self.expected("a lane kind: 0 to 3")),
            },
            centre: self.points()?,
            left: self.points()?,
            right: self.points()?,
            entries: self.counts()?,
            exits: self.counts()?,
            left_neighbours: self.neighbours()?,
            right_neighbours: self.neighbours()?,
            speed_limit_mps: self.optional()?,
        })
    }

    fn sample(&mut self) -> Read<Option<Sample>> {
        match self.byte("0 or 1")? {
            0 => Ok(None),
            1 => Ok(Some(Sample { position: self.point()?, heading_rad: self.number()?, velocity: self.point()? })),
            _ => Err(self.expected("0 or 1")),
        }
    }

    fn track(&mut self) -> Read<Track> {
        Ok(Track {
            id: self.text()?,
            kind: match self.byte("an agent kind")? {
                0 => AgentKind::Vehicle,
                1 => AgentKind::Pedestrian,
                2 => AgentKind::Cyclist,
                3 => AgentKind::Static,
                _ => return Err(self.expected("an agent kind: 0 to 3")),
            },
            length_m: self.number()?,
            width_m: self.number()?,
            samples: self.list(1, Self::sample)?,
        })
    }

    fn light(&mut self) -> Read<Light> {
        Ok(Light {
            lane: self.count()?,
            stop_point: self.point()?,
            states: self.list(1, |r| {
                Ok(match r.byte("a light state")? {
                    0 => LightState::Unknown,
                    1 => LightState::Stop,
                    2 => LightState::Caution,
                    3 => LightState::Go,
                    _ => return Err(r.expected("a light state: 0 to 3")),
                })
            })?,
        })
    }

    fn scene(&mut self, origin: Origin) -> Read<Scene> {
        Ok(Scene {
            id: self.text()?,
            origin,
            steps: self.count()?,
            current_step: self.count()?,
            road: Road { lanes: self.list(60, Self::lane)?, edges: self.list(8, Self::points)? },
            tracks: self.list(33, Self::track)?,
            ego: Ego {
                track: self.track()?,
                start_step: self.count()?,
                route: self.points()?,
                target_speed_mps: self.optional()?,
            },
            objects_of_interest: self.counts()?,
            lights: self.list(32, Self::light)?,
            stop_signs: self.list(24, |r| Ok(StopSign { position: r.point()?, lanes: r.counts()? }))?,
            crosswalks: self.list(8, Self::points)?,
            staging: if self.at < self.bytes.len() { Some(self.staging()?) } else { None },
        })
    }

    fn staging(&mut self) -> Read<Staging> {
        let family = TrafficFamily::of_number(usize::from(self.byte("a traffic family")?));
        let family = family.ok_or_else(|| self.expected("a traffic family: 1 to 8"))?;
        let route = u32::try_from(self.count()?).map_err(|_| self.expected("a route number"))?;
        let trigger = Pose { position: self.point()?, heading_rad: self.number()? };
        let spawns =
            self.list(24, |r| Ok(SpawnFrame { fwd_m: r.number()?, right_m: r.number()?, yaw_rad: r.number()? }))?;
        Ok(Staging { family, route, trigger, spawns })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::fixture::two_lane_scene;

    #[test]
    fn a_scene_comes_back_from_its_bytes() {
        let mut scene = two_lane_scene();
        scene.tracks[0].samples[3] = None;
        scene.lights.push(Light { lane: 1, stop_point: Vec2::new(1.0, 2.0), states: vec![LightState::Caution; 60] });
        scene.stop_signs.push(StopSign { position: Vec2::ZERO, lanes: vec![0, 2] });
        scene.crosswalks.push(vec![Vec2::ZERO, Vec2::new(1.0, 0.0), Vec2::new(0.0, 1.0)]);
        let back = scene_of(&scene_bytes(&scene), scene.origin.clone());
        assert_eq!(back, Ok(scene));
    }

    #[test]
    fn the_staging_of_a_traffic_family_comes_back_and_counts_into_the_digest() {
        let plain = two_lane_scene();
        let staging = Staging {
            family: TrafficFamily::RightTurn,
            route: 7,
            trigger: Pose { position: Vec2::new(3.0, 4.0), heading_rad: 0.5 },
            spawns: vec![SpawnFrame { fwd_m: 28.0, right_m: -20.0, yaw_rad: -1.5 }],
        };
        let scene = Scene { staging: Some(staging), ..plain.clone() };
        let bytes = scene_bytes(&scene);
        assert_eq!(scene_of(&bytes, scene.origin.clone()), Ok(scene.clone()));
        assert_ne!(scene.digest(), plain.digest());
        let whole = scene_bytes(&plain).len();
        for end in whole + 1..bytes.len() {
            assert!(scene_of(&bytes[..end], Origin::default()).is_err(), "{end}");
        }
    }

    #[test]
    fn several_neighbours_of_a_side_come_back_and_one_is_written_as_ever() {
        let one = two_lane_scene();
        let mut scene = one.clone();
        scene.road.lanes[0].left_neighbours.push(Neighbour { lane: 3, same_direction: false });
        let bytes = scene_bytes(&scene);
        assert_eq!(scene_of(&bytes, scene.origin.clone()), Ok(scene.clone()));
        // A count of eight bytes, then the second one.
        assert_eq!(bytes.len(), scene_bytes(&one).len() + 1 + 8 + 9);
        assert_eq!(scene.road.lanes[0].left_neighbours.pop().map(|n| n.lane), Some(3));
        assert_eq!(scene.digest(), one.digest());
    }

    #[test]
    fn every_truncation_is_refused() {
        let bytes = scene_bytes(&two_lane_scene());
        for end in (0..bytes.len()).step_by(7) {
            assert!(scene_of(&bytes[..end], Origin::default()).is_err(), "{end}");
        }
    }

    #[test]
    fn a_huge_count_is_refused_before_memory_is_taken() {
        let mut bytes = scene_bytes(&two_lane_scene());
        // The number of lanes stands after the id (8 + 7 bytes) and two counts.
        bytes[31..39].copy_from_slice(&u64::MAX.to_le_bytes());
        assert!(scene_of(&bytes, Origin::default()).is_err());
    }

    #[test]
    fn the_digest_leaves_out_the_origin_and_nothing_else() {
        let scene = two_lane_scene();
        let with = |change: fn(&mut Scene)| {
            let mut other = scene.clone();
            change(&mut other);
            other.digest()
        };
        assert_eq!(with(|s| s.origin.name = "elsewhere".into()), scene.digest());
        let changes: [fn(&mut Scene); 7] = [
            |s| s.id.push('x'),
            |s| s.current_step = 1,
            |s| s.tracks[1].samples[5] = None,
            |s| s.ego.route[1].x += 1e-9,
            |s| s.road.lanes[0].exits.clear(),
            |s| s.objects_of_interest.clear(),
            |s| s.road.lanes[2].speed_limit_mps = None,
        ];
        for change in changes {
            assert_ne!(with(change), scene.digest());
        }
    }
}
