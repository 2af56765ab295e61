//! Features that expressions may read, with units: one name, one meaning, for every family.

use serde::Serialize;

use crate::objects::ValueType;

/// A named quantity of a scene, an actor or a candidate trajectory.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Feature {
    /// The name in expressions; it ends with the unit.
    pub name: &'static str,
    /// Number or truth value.
    pub value: ValueType,
    /// SI; `1` for counts, shares and log-probabilities, empty for booleans.
    pub unit: &'static str,
    /// Description of the quantity, for prompts.
    pub describes: &'static str,
}

const fn number(name: &'static str, unit: &'static str, describes: &'static str) -> Feature {
    Feature { name, value: ValueType::Number, unit, describes }
}

const fn boolean(name: &'static str, describes: &'static str) -> Feature {
    Feature { name, value: ValueType::Boolean, unit: "", describes }
}

const ADVERSARY_INDEX: Feature =
    number("adversary_index", "1", "0 for the first adversary of the scene, 1 for the second, ...");
const ADVERSARY_COUNT: Feature = number("adversary_count", "1", "adversaries of the scene");

/// Features of an adversary among those of its scene, in order of rank.
pub const GROUP: &[Feature] = &[ADVERSARY_INDEX, ADVERSARY_COUNT];

/// Features of a scene at its current step; computed by `scene::features`.
pub const SCENE: &[Feature] = &[
    number("vehicle_count", "1", "vehicles observed now"),
    number("pedestrian_count", "1", "pedestrians observed now"),
    number("cyclist_count", "1", "cyclists observed now"),
    number("ego_speed_mps", "m/s", "speed of the ego at its start"),
    number("ego_route_length_m", "m", "length of the ego's route"),
    number("route_curvature_max_1pm", "1/m", "largest curvature of the ego's route"),
    number("traffic_speed_mps", "m/s", "mean speed of the vehicles now"),
    number("nearest_vehicle_gap_m", "m", "centre distance of ego and nearest vehicle; 200 if none"),
    number("log_distance_m_min", "m", "smallest distance of a vehicle's path to the ego's route; 200 if none"),
    number("conflict_count", "1", "vehicles whose path crosses the ego's route"),
    number("speed_limit_mps", "m/s", "speed limit of the ego's lane; 13.9 if unknown"),
    number("lane_count", "1", "lanes of the ego's direction at its start"),
    boolean("has_light", "a traffic light on the ego's route"),
    boolean("is_junction", "the ego's route crosses or merges with another lane's path"),
];

/// Features of a non-ego actor relative to the ego at the current step.
pub const ACTOR: &[Feature] = &[
    number("gap_m", "m", "distance between the two boxes"),
    number("closing_speed_mps", "m/s", "rate at which the centre distance shrinks"),
    number("time_to_conflict_s", "s", "until the actor, as logged, is nearest to the ego's rollout"),
    number("arrival_difference_s", "s", "actor's minus ego's arrival where their paths meet; 20 if never"),
    number("path_distance_m_min", "m", "smallest distance of the actor's log and the ego's rollout at equal times"),
    number("actor_speed_mps", "m/s", "speed of the actor"),
    number("heading_difference_rad", "rad", "absolute heading difference, 0..pi"),
    number("longitudinal_offset_m", "m", "place along the ego's heading, positive ahead"),
    number("lateral_offset_m", "m", "place across the ego's heading, positive to the left"),
    number("moved_m", "m", "way that it drives in its log from now on"),
    number("observed_share", "1", "share of later steps at which it was observed"),
    boolean("paths_cross", "the actor's log crosses the ego's route"),
    boolean("same_lane", "in the ego's lane or one into or out of it"),
    boolean("adjacent_lane", "in a lane beside it, same direction"),
    boolean("behind", "behind the ego"),
    boolean("object_of_interest", "marked by the data set as interacting"),
];

/// Features of a moment of a candidate that is reshaped.
pub const SHAPE: &[Feature] = &[
    number("progress", "1", "share of the candidate's time that has passed, 0..1"),
    number("progress_s", "s", "time since the window's start"),
    number("candidate_speed_mps", "m/s", "the candidate's own speed then, before it is changed"),
];

/// Features that an adversary under a law observes at a decision step of the rollout (every 0.1 s), in the order of `sim::Observed`.
pub const LAW: &[Feature] = &[
    number("since_onset_s", "s", "time since the law took over; 0 until then"),
    number("own_speed_mps", "m/s", "the adversary's speed now"),
    number("own_path_left_m", "m", "way left along the candidate's path; 0 beyond its end"),
    number("own_lane_offset_m", "m", "place across the nearest lane of its direction, positive to the left"),
    number("own_off_road_m", "m", "how far a corner is off the road"),
    number("road_left_m", "m", "road to the left of it, 0..5 in half metres"),
    number("road_right_m", "m", "road to the right of it, 0..5 in half metres"),
    number("planned_acceleration_mps2", "m/s^2", "what brings it to the candidate's speed of the next step"),
    number("seen_gap_m", "m", "distance between its box and the ego's now"),
    number("seen_closing_mps", "m/s", "rate at which the centre distance shrinks"),
    number("seen_ttc_s", "s", "until they touch if both keep velocity and heading; 20 if never"),
    number("seen_ego_speed_mps", "m/s", "the ego's speed now"),
    number("seen_ego_acceleration_mps2", "m/s^2", "the ego's, over the last step"),
    number("seen_ego_heading_rad", "rad", "the ego's heading minus its own, -pi..pi"),
    number("seen_ego_ahead_m", "m", "place of the ego along its own heading, positive ahead"),
    number("seen_ego_left_m", "m", "place of the ego across its own heading, positive to the left"),
    number(
        "ego_to_conflict_m",
        "m",
        "the ego's way to where the candidate's path meets its route; negative when past, 200 if never",
    ),
    number("own_to_conflict_m", "m", "its own way to that place, likewise"),
    number("others_gap_m", "m", "distance to the nearest one but the ego; 50 if nobody is near"),
    number("others_ahead_gap_m", "m", "distance to the nearest one but the ego in its way ahead; 50 if nobody is"),
    ADVERSARY_INDEX,
    ADVERSARY_COUNT,
];

/// Features of a candidate trajectory of the chosen actor.
pub const CANDIDATE: &[Feature] = &[
    number("prior_log_probability", "1", "log-probability under the family's motion prior"),
    number("ego_distance_m_min", "m", "smallest distance to the ego's rollout at equal times"),
    number("closest_approach_s", "s", "when it is nearest to the ego's rollout, from now"),
    number("closest_speed_mps", "m/s", "relative speed then"),
    number("collision_likelihood", "1", "discounted overlap with the ego's rollout, 0..1"),
    number("acceleration_mps2_max", "m/s^2", "largest longitudinal acceleration or deceleration"),
    number("lateral_acceleration_mps2_max", "m/s^2", "largest lateral acceleration"),
    number("jerk_mps3_max", "m/s^3", "largest longitudinal jerk"),
    number("yaw_rate_radps_max", "rad/s", "largest yaw rate"),
    number("speed_mps_max", "m/s", "largest speed"),
    number("heading_change_rad", "rad", "total change of heading, absolute"),
    number("off_road_m_max", "m", "how far a corner leaves the drivable area"),
    number("lane_deviation_m_max", "m", "largest distance from the nearest lane's centre line"),
    number("log_deviation_m_max", "m", "largest distance from the actor's log at equal times"),
    number("bystander_gap_m_min", "m", "smallest distance to anyone else's log; 50 if none comes near"),
    number(
        "contact_angle_rad",
        "rad",
        "its course against the ego's heading at the predicted contact or closest approach",
    ),
    boolean("meets_ego_front", "predicted contact at the ego's front"),
    boolean("meets_ego_flank", "predicted contact at the ego's flank"),
    boolean("meets_ego_rear", "predicted contact at the ego's rear"),
    boolean("strikes_ego", "at the predicted contact it drives into the ego, not the ego into it"),
    boolean("struck_by_ego", "at the predicted contact the ego drives into it, not it into the ego"),
    number("seen_coming_s", "s", "how long before the predicted contact it is in the ego's way ahead and in sight"),
    number("wrong_way_m", "m", "way driven against the direction of lanes"),
    number("off_road_added_m", "m", "farther off the road than the actor's log"),
    number("acceleration_added_mps2", "m/s^2", "harder acceleration or braking than the actor's log"),
    number("jerk_added_mps3", "m/s^3", "more jerk than the actor's log"),
    number("log_way_share", "1", "share of the actor's logged way that it drives by the predicted contact or its end"),
];

/// Features of a candidate's own rollout against the ego, in the order of `compiler::rehearse`: the definitions are those of labels.
pub const REHEARSED: &[Feature] = &[
    boolean("rehearsed_met", "the ego met an adversary"),
    boolean("rehearsed_avoidable", "and a careful ego would have avoided that contact"),
    boolean("rehearsed_preventable", "and besides it is no ram from behind: the preventable count"),
    boolean("rehearsed_from_behind", "and the adversary ran into the ego's rear"),
    boolean("rehearsed_standing", "and the ego ran into an adversary that stood"),
    boolean("rehearsed_anyway", "and the ego meets the same road user in plain replay"),
    boolean("rehearsed_acted", "an adversary moved otherwise than recorded"),
    boolean("rehearsed_struck_others", "an adversary overlapped somebody at the start or touched others on its way"),
    number("rehearsed_visible_s", "s", "how long before the contact the ego could see it coming; 0 without a contact"),
    number("rehearsed_contact_s", "s", "time of the contact, or of the rollout's end"),
    number("rehearsed_impact_mps", "m/s", "relative speed at the contact; 0 without one"),
    number("rehearsed_distance_m_min", "m", "smallest distance of the ego to an adversary; 200 if there is none"),
    number("rehearsed_ego_route_share", "1", "share of its route that the ego drove, 0..1"),
    number(
        "rehearsed_route_share",
        "1",
        "share of its recorded way that an adversary drove, the least; 1 where that is short",
    ),
    number("rehearsed_off_road_m", "m", "farther off the road than recorded, the most of an adversary"),
    number("rehearsed_wrong_way_m", "m", "way driven against lanes beyond the recorded one, likewise"),
    number(
        "rehearsed_acceleration_mps2",
        "m/s^2",
        "harder acceleration than recorded, as realism measures it, likewise",
    ),
    number("rehearsed_jerk_mps3", "m/s^3", "more jerk than recorded, as realism measures it, likewise"),
    number("rehearsed_slip_mps", "m/s", "more sliding across the heading than recorded, likewise"),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{LaneGraph, SceneFeatures, fixture::two_lane_scene};

    #[test]
    fn every_scene_feature_has_a_value_and_no_other_name_has() {
        let scene = two_lane_scene();
        let features = SceneFeatures::of(&scene, &LaneGraph::of(&scene.road));
        for feature in SCENE {
            assert!(features.value(feature.name).is_some_and(f64::is_finite), "{}", feature.name);
        }
        assert_eq!(features.value("tags"), None);
        assert_eq!(features.value("gap_m"), None);
    }
}
