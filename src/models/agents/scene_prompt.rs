//! The questions to the attacker agent: a message for each scene, which all its rounds share, and one for each round.

use serde_json::{Value, json};

use super::{
    counsel::Case,
    json_text::stable_json,
    prompt::{Aside, rounded},
    template::{PromptError, fill},
};
use crate::{
    kernel::num,
    llm::{Request, Text},
    objects::{
        Role,
        counsel::{CounselRound, EgoPlace, Vehicle},
    },
};

/// Decimals of lengths, times and angles in the table of vehicles.
const TABLE_DECIMALS: u32 = 2;

/// The message about a scene, written once for all rounds.
#[derive(Clone, Debug)]
pub struct SceneText(Text);

impl SceneText {
    /// Writes the scene out.
    pub fn of(case: &Case<'_>) -> Result<SceneText, PromptError> {
        let facts = json!({"scene": case.scene, "ego": case.ego, "attackers_max": case.attackers_max});
        let rows: Vec<Value> = case.vehicles.iter().map(row).collect();
        let vehicles = json!({"columns": COLUMNS, "rows": rows});
        let drive = json!({
            "columns": ["at_s", "ahead_m", "left_m", "speed_mps"],
            "rows": case.drive.iter().map(place).collect::<Vec<Value>>(),
        });
        let blocks = json!({
            "lineage": case.lineage,
            "scene": case.scene,
            "facts": stable_json(&facts),
            "drive": stable_json(&drive),
            "vehicles": stable_json(&vehicles),
        });
        Ok(SceneText(fill("scene.md", &blocks)?.into()))
    }
}

/// Columns of the table of vehicles.
const COLUMNS: [&str; 13] = [
    "id",
    "length_m",
    "ahead_m",
    "left_m",
    "gap_m",
    "speed_mps",
    "heading_difference_rad",
    "lane",
    "time_to_collision_s",
    "conflict",
    "reach",
    "arrives_s",
    "ego_arrives_s",
];

fn shown(x: f64) -> f64 {
    num::rounded(x, TABLE_DECIMALS)
}

fn place(place: &EgoPlace) -> Value {
    json!([place.at_s, place.ahead_m, place.left_m, place.speed_mps].map(shown))
}

fn row(vehicle: &Vehicle) -> Value {
    json!([
        vehicle.id,
        shown(vehicle.length_m),
        shown(vehicle.ahead_m),
        shown(vehicle.left_m),
        shown(vehicle.gap_m),
        shown(vehicle.speed_mps),
        shown(vehicle.heading_difference_rad),
        vehicle.lane,
        vehicle.time_to_collision_s.map(shown),
        vehicle.conflict,
        vehicle.reach,
        vehicle.arrivals_s.map(|[own, _]| shown(own)),
        vehicle.arrivals_s.map(|[_, ego]| shown(ego)),
    ])
}

/// The question about a scene in a round; `tried` holds the results of the earlier sets.
pub fn counsel_request(
    case: &Case<'_>,
    scene: &SceneText,
    round: u32,
    tried: &[CounselRound],
) -> Result<Request, PromptError> {
    let step = if tried.is_empty() { "initialisation" } else { "reflection" };
    let result = |round: &CounselRound| {
        let distance_m = Some(round.trial.distance_m()).filter(|m| m.is_finite());
        json!({"attackers": round.attackers, "outcome": round.trial.code(), "distance_m": distance_m})
    };
    let tried: Vec<Value> = tried.iter().map(result).collect();
    let blocks = if tried.is_empty() { vec![] } else { vec![("Tried", rounded(tried.into()))] };
    let (lineage, slot, model) = (case.lineage, case.slot, case.model);
    let aside = Aside { lineage, epoch: 0, slot, role: Role::AttackerAgent, round, model, shown: &scene.0 };
    aside.request(&[("step", step)], blocks)
}
