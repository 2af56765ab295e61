//! Defines what a program of the family may contain, and its parent.

use super::words::{INSERTED_ACTOR, NAME, REJECTION, REVERSE_TOKENS};
use crate::adapters::{Family, OperatorSpec};
use crate::families::grammar::{self, choice, integer, number, optional, required, slot};
use crate::families::interface::{self, FamilySpec, OwnParameter, own, word};
use crate::kernel::num;
use crate::objects::{OperatorNode, Slot, ValueType};

/// Contract and parent.
pub fn family() -> Family {
    let (motion, search) = (motion_parameters(), search_parameters());
    FamilySpec {
        name: NAME,
        title: "ADV-BMT: bidirectional motion generation (Liu et al. 2026)",
        describes: "Inserts a road user that was not recorded. A collision with the ego's rollout is imposed at the \
                    end of the window, headed as a lane there is; from it the motion is grown backward in time over \
                    tokens of acceleration and yaw rate. Of several samples the first is used that moves enough, does \
                    not turn too sharply and stays on the road."
            .into(),
        words: vec![INSERTED_ACTOR, REVERSE_TOKENS, REJECTION, "sample_score"],
        operators: vec![
            (Slot::Actor, actor_operator()),
            (Slot::Motion, motion_operator(&motion)),
            (Slot::Search, search_operator(&search)),
        ],
        without_shared: &[Slot::Actor, Slot::Law],
        mechanism_slots: vec![slot(
            "sample_score",
            ValueType::Number,
            grammar::candidate_features(),
            "A score of a sampled motion; the search operator says whether it is added to the order of drawing or \
             replaces it. What is rejected stays below what is not.",
        )],
        graph: parent_graph(&motion, &search),
        parameters: motion.into_iter().chain(search).collect(),
    }
    .family()
}

fn actor_operator() -> OperatorSpec {
    let shape = required(
        "shape",
        choice(&["vehicle", "cyclist", "pedestrian"]),
        "what is inserted: a vehicle of the ego's size, a cyclist, a pedestrian",
    );
    interface::operator(Slot::Actor, INSERTED_ACTOR, vec![shape], "A road user that was not recorded.")
}

fn motion_parameters() -> Vec<OwnParameter> {
    let of = |name, low, high, unit, describes, value| own(name, number(low, high, unit), describes, value);
    vec![
        own("sample_count", integer(1, 12, "1"), "backward rollouts; 8 in ADV-BMT", 8.0),
        of("nucleus_share", 0.3, 1.0, "1", "top-p of the token draw; 0.95 in ADV-BMT", 0.95),
        of("token_temperature", 0.3, 3.0, "1", "temperature of the token draw; 1 in ADV-BMT", 1.0),
        of(
            "heading_spread_rad",
            0.05,
            7.0,
            "rad",
            "standard deviation of a drawn heading about the lane's; 2 pi in ADV-BMT, that is any",
            num::TAU,
        ),
        of("impact_speed_share", 0.0, 1.5, "1", "imposed speed as a share of the ego's; 0.5 in ADV-BMT", 0.5),
        of("impact_speed_spread_mps", 0.0, 3.0, "m/s", "its standard deviation; 0.5 in ADV-BMT", 0.5),
        of("impact_forward_m", -3.0, 3.0, "m", "imposed centre ahead of the ego's centre; 0 in ADV-BMT", 0.0),
        of("impact_left_m", -1.5, 1.5, "m", "imposed centre to the left of the ego's; 0 in ADV-BMT", 0.0),
        of("linger_s", 0.0, 4.0, "s", "how long it drives on after the imposed collision; 0 in ADV-BMT", 0.0),
        of("token_acceleration_scale_mps2", 0.3, 5.0, "m/s^2", "scale of acceleration tokens", 1.5),
        of("token_yaw_scale_radps", 0.05, 1.0, "rad/s", "scale of yaw rate beyond what the lane asks for", 0.2),
        of("token_lane_scale_m", 0.2, 6.0, "m", "scale of the distance from a lane's centre line", 1.0),
        of("token_heading_scale_rad", 0.1, 2.0, "rad", "scale of the heading against the lane's", 0.35),
        of("token_road_scale_m", 0.1, 10.0, "m", "scale of the depth of the body beside the road", 0.5),
        of(
            "token_acceleration_change_mps2",
            0.3,
            20.0,
            "m/s^2",
            "scale of the change of acceleration from token to token",
            1.25,
        ),
        of("token_yaw_change_radps", 0.05, 3.0, "rad/s", "scale of the change of yaw rate from token to token", 0.2),
        of("token_speed_scale_mps", 1.0, 15.0, "m/s", "scale of the speed about half the limit", 6.0),
    ]
}

fn search_parameters() -> Vec<OwnParameter> {
    vec![
        own(
            "mean_speed_mps_min",
            number(0.0, 6.0, "m/s"),
            "net displacement over time below which a sample is rejected; 1 in ADV-BMT",
            1.0,
        ),
        own(
            "curvature_1pm_max",
            number(0.05, 2.0, "1/m"),
            "largest change of heading a metre before a sample is rejected; 0.8 in ADV-BMT",
            0.8,
        ),
        own(
            "road_departure_m_max",
            number(0.0, 20.0, "m"),
            "how far a corner may leave the road before a sample is rejected",
            0.5,
        ),
    ]
}

fn motion_operator(parameters: &[OwnParameter]) -> OperatorSpec {
    let mut settings: Vec<_> = parameters.iter().map(interface::follows).collect();
    settings.extend([
        required(
            "headings",
            choice(&["drawn", "lane_aligned"]),
            "imposed headings: drawn, or those of the lanes at the ego's place in turn: along it, across it, against it",
        ),
        required(
            "meeting",
            choice(&["window_end", "drawn"]),
            "imposed time: the last step of window and ego rollout, or drawn before it",
        ),
    ]);
    interface::operator(
        Slot::Motion,
        REVERSE_TOKENS,
        settings,
        "Backward rollouts over 33 x 33 tokens of acceleration and yaw rate from an imposed collision.",
    )
}

fn search_operator(parameters: &[OwnParameter]) -> OperatorSpec {
    let mut settings: Vec<_> = parameters.iter().map(interface::follows).collect();
    settings.extend([
        optional("score", "sample_score", "a score of the family's own"),
        required("combine", choice(&["add", "replace"]), "what a given score does to the order of drawing"),
    ]);
    interface::operator(
        Slot::Search,
        REJECTION,
        settings,
        "Rejects samples that hardly move, turn too sharply or leave the road; the first of the others scores highest.",
    )
}

fn parent_graph(motion: &[OwnParameter], search: &[OwnParameter]) -> Vec<(String, OperatorNode)> {
    let mut backward = interface::from_parameters(motion);
    backward.extend([word("headings", "lane_aligned"), word("meeting", "window_end")]);
    let mut rejection = interface::from_parameters(search);
    rejection.push(word("combine", "add"));
    vec![
        interface::node("select", Slot::Select, "every_scene", &[], vec![]),
        interface::node("actor", Slot::Actor, INSERTED_ACTOR, &["select"], vec![word("shape", "vehicle")]),
        interface::after_history(),
        interface::node("motion", Slot::Motion, REVERSE_TOKENS, &["timing"], backward),
        interface::node("search", Slot::Search, REJECTION, &["motion"], rejection),
        interface::best_of_search(),
    ]
}
