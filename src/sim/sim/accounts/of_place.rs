//! Places where no road user of a kind is: on foot or on a bicycle on a motorway, on wheels on the other side of a kerb, a
//! median or a barrier. Only `simulator.of_place` turns this account on, because an outcome with it differs from one without.

use serde::{Deserialize, Serialize};

use crate::kernel::Vec2;
use crate::scene::pieces::{Piece, Pieces};
use crate::scene::{AgentKind, DT_S, LaneKind, Sample};
use crate::sim::prepared::edges::Edges;

/// Motion in places where its kind does not belong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OfPlace {
    /// Time that the centre is on a lane of a motorway and on no other lane, s; 0 for vehicles.
    pub motorway_s: f64,
    /// Largest way of the centre from one carriageway across an edge onto another, metres; 0 for someone on foot. It is the lesser of its
    /// distances from the edge before the crossing and after it.
    pub across_m: f64,
}

impl OfPlace {
    /// Takes the larger of each.
    fn max(self, other: OfPlace) -> OfPlace {
        OfPlace { motorway_s: self.motorway_s.max(other.motorway_s), across_m: self.across_m.max(other.across_m) }
    }
}

/// The road as this account sees it.
#[derive(Clone, Copy, Debug)]
pub(in crate::sim) struct Places<'p> {
    pub lanes: &'p Pieces,
    pub edges: &'p Edges,
}

impl Places<'_> {
    /// Returns the account of a whole recorded motion; a gap begins it anew.
    pub fn of_recording(&self, samples: &[Option<Sample>], kind: AgentKind) -> OfPlace {
        let part = |part: &[Option<Sample>]| {
            let run: Vec<Sample> = part.iter().copied().flatten().collect();
            self.of_motion(&run, 0, kind)
        };
        samples.split(Option::is_none).map(part).fold(OfPlace::default(), OfPlace::max)
    }

    /// Returns the account of samples that lie 0.1 s apart, from sample `from` on.
    pub fn of_motion(&self, samples: &[Sample], from: usize, kind: AgentKind) -> OfPlace {
        let way: Vec<Vec2> = samples.iter().map(|sample| sample.position).collect();
        let (slow, rolls) = match kind {
            AgentKind::Pedestrian => (true, false),
            AgentKind::Cyclist => (true, true),
            AgentKind::Vehicle => (false, true),
            AgentKind::Static => (false, false),
        };
        let on_motorway = way.iter().skip(from).filter(|place| slow && self.is_motorway(**place)).count();
        let on_carriageway = |place: Vec2| self.under(place).any(Piece::is_through);
        OfPlace {
            motorway_s: on_motorway as f64 * DT_S,
            across_m: if rolls { self.edges.across_m(&way, from, on_carriageway) } else { 0.0 },
        }
    }

    /// Yields the pieces of lanes whose surface holds a place.
    fn under(&self, place: Vec2) -> impl Iterator<Item = &Piece> {
        self.lanes.touching(place).map(|(_, piece)| piece).filter(move |piece| piece.contains(place))
    }

    /// Returns `true` if every lane there is a motorway, because a street or a footbridge may lead over one.
    fn is_motorway(&self, place: Vec2) -> bool {
        let mut kinds = self.under(place).map(|piece| piece.kind).peekable();
        kinds.peek().is_some() && kinds.all(|kind| kind == LaneKind::Freeway)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Road;
    use crate::sim::scenes::lane;

    /// Makes a motorway along y = 0, 4 m wide, with a kerb on either side; a street over it along x = 50 and one beside it.
    fn road() -> (Pieces, Edges) {
        let at = Vec2::new;
        let mut lanes = vec![
            lane(at(0.0, 0.0), at(100.0, 0.0)),
            lane(at(50.0, -50.0), at(50.0, 50.0)),
            lane(at(0.0, 4.0), at(100.0, 4.0)),
        ];
        lanes[0].kind = LaneKind::Freeway;
        (
            Pieces::of(&Road { lanes, edges: vec![] }),
            Edges::of(&[vec![at(0.0, 2.0), at(100.0, 2.0)], vec![at(0.0, -2.0), at(100.0, -2.0)]]),
        )
    }

    fn found(kind: AgentKind, from: usize, at: impl Fn(f64) -> Vec2) -> OfPlace {
        let (lanes, edges) = road();
        let sample = |k: usize| Sample { position: at(0.1 * k as f64), heading_rad: 0.0, velocity: Vec2::ZERO };
        let samples: Vec<Sample> = (0..21).map(sample).collect();
        Places { lanes: &lanes, edges: &edges }.of_motion(&samples, from, kind)
    }

    #[test]
    fn the_time_on_a_motorway_is_that_of_its_samples_and_a_bridge_is_no_motorway() {
        let time = |kind, from, x, y| found(kind, from, |_| Vec2::new(x, y)).motorway_s;
        for kind in [AgentKind::Pedestrian, AgentKind::Cyclist] {
            assert!((time(kind, 0, 20.0, 1.0) - 2.1).abs() < 1e-9, "21 samples");
            assert!((time(kind, 11, 20.0, 1.0) - 1.0).abs() < 1e-9, "10 samples");
            assert_eq!(
                (time(kind, 0, 50.0, 0.0), time(kind, 0, 20.0, 4.0), time(kind, 0, 20.0, -2.5)),
                (0.0, 0.0, 0.0)
            );
        }
        assert_eq!((time(AgentKind::Vehicle, 0, 20.0, 1.0), time(AgentKind::Static, 0, 20.0, 1.0)), (0.0, 0.0));
        let runs = found(AgentKind::Pedestrian, 0, |t| Vec2::new(20.0, -3.05 + 2.0 * t));
        assert!(
            (runs.motorway_s - 1.5).abs() < 1e-9,
            "from the border on, which it reaches after 0.6 s: {}",
            runs.motorway_s
        );
    }

    #[test]
    fn what_rolls_over_a_kerb_has_gone_across_as_far_as_it_is_from_it_and_who_walks_has_not() {
        // From 1.5 m below the kerb to 1 m above.
        let goes = |kind| found(kind, 0, |t| Vec2::new(20.0 + t, 0.5 + 1.25 * t)).across_m;
        assert!((goes(AgentKind::Vehicle) - 1.0).abs() < 1e-9);
        assert!((goes(AgentKind::Cyclist) - 1.0).abs() < 1e-9);
        assert_eq!((goes(AgentKind::Pedestrian), goes(AgentKind::Static)), (0.0, 0.0));
        let off_the_road = found(AgentKind::Vehicle, 0, |t| Vec2::new(20.0 + t, -0.5 - 2.0 * t));
        assert_eq!(off_the_road.across_m, 0.0, "over a kerb with no lane behind it");
    }
}
