//! How a rollout ends.

use serde::{Deserialize, Serialize};

/// How a rollout ends; what comes first counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// The ego touched somebody or something.
    Contact,
    /// The ego left its route: by 4 m to the side, in a staged scene by SafeBench's rule.
    OffRoad,
    /// The ego came to the end of its route.
    Arrived,
    /// The scene's last step was simulated, or a replayed recording ended.
    Horizon,
}
