//! Fault for a contact by nuPlan's rule (`no_ego_at_fault_collisions.py`, `collision_utils.py` of motional/nuplan-devkit): how
//! it came about, by the first item of a list that holds, and for one item if the ego was in one lane.

use serde::{Deserialize, Serialize};

use crate::kernel::{OrientedBox, Vec2, num};
use crate::scene::{AgentKind, LaneIx};
use crate::sim::prepared::plant::Plant;
use crate::sim::road_users::bicycle::REAR_SHARE;

/// Speed up to which the ego counts as standing, m/s.
pub const EGO_STANDS_MPS: f64 = 0.05;
/// Speed up to which another road user counts as standing, m/s.
pub const OTHER_STANDS_MPS: f64 = 0.005;
/// Angle from the ego's heading, seen from the rear axle, beyond which a road user is behind, radians.
pub const BEHIND_RAD: f64 = 150.0 * num::PI / 180.0;

/// How a contact comes about: nuPlan's collision types, of which the first that holds is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactKind {
    /// The ego stands.
    EgoStands,
    /// The other one stands, or is no road user.
    OtherStands,
    /// The other one is behind.
    Rear,
    /// It touches the ego's front bumper.
    Front,
    /// Neither.
    Side,
}

impl ContactKind {
    /// Returns the type for boxes that touch. `axle` is the ego's rear axle; `other_stands` is true if the other stands or is no road user.
    pub fn of(ego: &OrientedBox, axle: Vec2, speed_mps: f64, other: &OrientedBox, other_stands: bool) -> ContactKind {
        if speed_mps <= EGO_STANDS_MPS {
            return ContactKind::EgoStands;
        }
        if other_stands {
            return ContactKind::OtherStands;
        }
        if seen_at_rad(ego, axle, other) > BEHIND_RAD {
            return ContactKind::Rear;
        }
        let bumper = OrientedBox { center: ego.center + ego.axis * ego.half_length_m, half_length_m: 0.0, ..*ego };
        if bumper.overlaps(other) { ContactKind::Front } else { ContactKind::Side }
    }
}

/// Returns the angle between the ego's heading and the way from its rear axle to somebody's centre, radians.
pub fn seen_at_rad(ego: &OrientedBox, axle: Vec2, other: &OrientedBox) -> f64 {
    let to = other.center - axle;
    num::atan2(ego.axis.cross(to), ego.axis.dot(to)).abs()
}

/// The clause of nuPlan's rule that decides about a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// The ego stands: not at fault.
    StoppedEgo,
    /// The other one stands, or is no road user: at fault.
    StoppedTrack,
    /// The other one is behind: not at fault.
    ActiveRear,
    /// The ego's front bumper touches it: at fault.
    ActiveFront,
    /// Its flank does, in one lane: not at fault.
    ActiveLateral,
    /// Its flank does, in several lanes or off them: at fault.
    ActiveLateralAcross,
}

impl Fault {
    /// Every clause, in the order of the rule.
    pub const ALL: [Fault; 6] = [
        Fault::StoppedEgo,
        Fault::StoppedTrack,
        Fault::ActiveRear,
        Fault::ActiveFront,
        Fault::ActiveLateral,
        Fault::ActiveLateralAcross,
    ];

    /// Returns the name in files.
    pub fn name(self) -> &'static str {
        match self {
            Fault::StoppedEgo => "stopped_ego",
            Fault::StoppedTrack => "stopped_track",
            Fault::ActiveRear => "active_rear",
            Fault::ActiveFront => "active_front",
            Fault::ActiveLateral => "active_lateral",
            Fault::ActiveLateralAcross => "active_lateral_across",
        }
    }

    /// Returns the clause of this name.
    pub fn named(name: &str) -> Option<Fault> {
        Fault::ALL.into_iter().find(|fault| fault.name() == name)
    }

    /// Returns `true` if the ego is at fault.
    pub fn is_egos(self) -> bool {
        matches!(self, Fault::StoppedTrack | Fault::ActiveFront | Fault::ActiveLateralAcross)
    }

    /// Returns the clause in words.
    pub fn in_words(self) -> &'static str {
        match self {
            Fault::StoppedEgo => "the ego stands: not at fault",
            Fault::StoppedTrack => "the other one stands or is no road user: at fault",
            Fault::ActiveRear => "the other one comes from behind: not at fault",
            Fault::ActiveFront => "the ego's front bumper touches it: at fault",
            Fault::ActiveLateral => "the ego's flank touches it, and the ego is in one lane: not at fault",
            Fault::ActiveLateralAcross => {
                "the ego's flank touches it, and the ego is in several lanes or off them: at fault"
            }
        }
    }

    /// Returns the clause for boxes that touch, with the velocities of both.
    pub(in crate::sim) fn of(
        plant: &Plant,
        ego: &OrientedBox,
        ego_velocity: Vec2,
        other: &OrientedBox,
        other_velocity: Vec2,
        kind: AgentKind,
    ) -> Fault {
        let axle = ego.center - ego.axis * (REAR_SHARE * 2.0 * ego.half_length_m);
        let other_stands = kind == AgentKind::Static || other_velocity.norm() <= OTHER_STANDS_MPS;
        match ContactKind::of(ego, axle, ego_velocity.norm(), other, other_stands) {
            ContactKind::EgoStands => Fault::StoppedEgo,
            ContactKind::OtherStands => Fault::StoppedTrack,
            ContactKind::Rear => Fault::ActiveRear,
            ContactKind::Front => Fault::ActiveFront,
            ContactKind::Side if is_in_one_lane(plant, ego) => Fault::ActiveLateral,
            ContactKind::Side => Fault::ActiveLateralAcross,
        }
    }
}

/// Implements nuPlan's lane keeping: all four corners share a lane, or the rear ones share a lane that leads to, or comes from, one that
/// the front ones share. A corner beside all lanes breaks it. On a map without lanes nobody leaves one.
fn is_in_one_lane(plant: &Plant, ego: &OrientedBox) -> bool {
    let lanes = plant.lanes();
    if lanes.lane_count() == 0 {
        return true;
    }
    let at = |ahead: f64, left: f64| -> Vec<LaneIx> {
        let corner = ego.center + ego.axis * (ahead * ego.half_length_m) + ego.axis.left() * (left * ego.half_width_m);
        let touching = lanes.pieces().touching(corner).filter(|(_, piece)| piece.contains(corner));
        touching.map(|(_, piece)| piece.lane()).collect()
    };
    let shared = |ahead: f64| -> Vec<LaneIx> {
        let right = at(ahead, -1.0);
        at(ahead, 1.0).into_iter().filter(|lane| right.contains(lane)).collect()
    };
    let (front, rear) = (shared(1.0), shared(-1.0));
    rear.iter().any(|behind| {
        front.iter().any(|ahead| {
            ahead == behind || lanes.exits(*behind).contains(ahead) || lanes.entries(*behind).contains(ahead)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Lane, Scene};
    use crate::sim::scenes::{car, lane, sample, straight, straight_road};
    use crate::sim::{
        Action, Control, Driver, End, Intervention, SimulatorOptions, View, fault_of, rollout, rollout_traced,
    };

    /// Two lanes along +x about y = 0 and y = 4, and one from the end of the first.
    fn lanes(tracks: Vec<crate::scene::Track>) -> Scene {
        let mut scene = straight_road(81, 8.0, tracks);
        let along =
            |id: &str, from: f64, to: f64, y: f64| Lane { id: id.into(), ..lane(Vec2::new(from, y), Vec2::new(to, y)) };
        scene.road.lanes =
            vec![along("a", -50.0, 60.0, 0.0), along("b", -50.0, 250.0, 4.0), along("c", 60.0, 250.0, 0.0)];
        scene.road.lanes[0].exits = vec![2];
        scene.road.lanes[2].entries = vec![0];
        scene
    }

    /// Drives straight on at its speed and steers as it is told.
    struct Steady(f64);

    impl Driver for Steady {
        fn begin(&mut self, _: &Plant) {}

        fn decide(&mut self, _: &View<'_>) -> Control {
            Control::Drive { acceleration_mps2: 0.0, steering_rad: self.0 }
        }
    }

    /// The worked example of docs/OBJECTIVES.md: the ego's box of 4.5 x 1.9 m at (0, y), its rear axle 1.41 m behind its middle.
    #[test]
    fn each_clause_of_nuplans_rule_decides_where_it_is_the_first_that_holds() {
        let plant = Plant::new(&lanes(vec![])).unwrap();
        let of = |y: f64, speed: f64, at: Vec2, velocity: Vec2, kind: AgentKind| {
            let ego = OrientedBox::new(Vec2::new(0.0, y), 0.0, 4.5, 1.9);
            let other = OrientedBox::new(at, 0.0, 4.5, 1.9);
            Fault::of(&plant, &ego, Vec2::new(speed, 0.0), &other, velocity, kind)
        };
        let (ahead, behind, beside) = (Vec2::new(4.4, 0.2), Vec2::new(-4.4, 0.2), Vec2::new(-0.5, 1.8));
        let (on, car) = (Vec2::new(5.0, 0.0), AgentKind::Vehicle);
        assert_eq!(of(0.0, 0.05, ahead, on, car), Fault::StoppedEgo);
        assert_eq!(of(0.0, 8.0, behind, Vec2::ZERO, car), Fault::StoppedTrack, "standing is asked before the side");
        assert_eq!(of(0.0, 8.0, behind, on, AgentKind::Static), Fault::StoppedTrack);
        assert_eq!(of(0.0, 8.0, behind, on, car), Fault::ActiveRear);
        assert_eq!(of(0.0, 8.0, ahead, on, car), Fault::ActiveFront);
        assert_eq!(of(0.0, 8.0, beside, on, car), Fault::ActiveLateral);
        assert_eq!(of(1.2, 8.0, Vec2::new(-0.5, 3.0), on, car), Fault::ActiveLateralAcross, "between two lanes");
        assert_eq!(
            of(-1.2, 8.0, Vec2::new(-0.5, 0.6), on, car),
            Fault::ActiveLateralAcross,
            "a corner beside the road"
        );
        let blamed = Fault::ALL.map(Fault::is_egos);
        assert_eq!(blamed, [false, true, false, true, false, true]);
        assert!(Fault::ALL.into_iter().all(|fault| Fault::named(fault.name()) == Some(fault)));
    }

    #[test]
    fn one_lane_that_leads_into_another_is_one_lane_and_a_map_without_lanes_is_none_to_leave() {
        let plant = Plant::new(&lanes(vec![])).unwrap();
        let at = |x: f64, y: f64| OrientedBox::new(Vec2::new(x, y), 0.0, 4.5, 1.9);
        assert!(is_in_one_lane(&plant, &at(60.0, 0.0)), "its rear is in the one, its front in the next");
        assert!(!is_in_one_lane(&plant, &at(60.0, 1.2)));
        let mut bare = lanes(vec![]);
        bare.road = crate::scene::Road::default();
        assert!(is_in_one_lane(&Plant::new(&bare).unwrap(), &at(0.0, 9.0)));
    }

    #[test]
    fn an_outcome_says_it_where_it_is_asked_for_and_the_motion_tells_the_same() {
        let standing = car("standing", straight(sample(30.0, 0.0, 0.0, 0.0), 81));
        let faster = car("faster", straight(sample(-30.0, 0.0, 0.0, 16.0), 81));
        let beside = car("beside", straight(sample(-2.0, 4.0, 0.0, 8.0), 81));
        for (track, steering, fault) in [
            (standing, 0.0, Fault::StoppedTrack),
            (faster, 0.0, Fault::ActiveRear),
            (beside, 0.01, Fault::ActiveLateralAcross),
        ] {
            // Drives as it was recorded, even if someone is in its way.
            let samples = track.samples.iter().flatten().copied().collect();
            let act = Intervention { actions: vec![Action::Follow { track: 0, from_step: 0, samples }] };
            let scene = lanes(vec![track]);
            let asking = SimulatorOptions { at_fault: true, ..SimulatorOptions::SHIPPED };
            let prepared = crate::scene::PreparedScene::new(std::sync::Arc::new(scene.clone()));
            let asked = Plant::with_options(prepared, &asking).unwrap();
            let said = rollout(&asked, &act, &mut Steady(steering)).unwrap();
            assert_eq!(said.contact.and_then(|contact| contact.fault), Some(fault), "{said:?}");
            let plant = Plant::new(&scene).unwrap();
            let (silent, motion) = rollout_traced(&plant, &act, &mut Steady(steering)).unwrap();
            assert_eq!((silent.end, silent.contact.and_then(|contact| contact.fault)), (End::Contact, None));
            assert_eq!(fault_of(&plant, &silent, &motion), Some(fault));
            let text = serde_json::to_string(&silent).unwrap();
            assert!(!text.contains("fault"), "what was recorded stays as it was: {text}");
        }
    }
}
