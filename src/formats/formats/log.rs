//! A scene as a log holds it, in the log's own coordinates and times: all logged formats are read into it.

use super::centreline::Across;
use super::read_as::Conventions;
pub use super::read_as::SampleTimes;
use crate::kernel::Vec2;
use crate::scene::{AgentKind, LaneKind, LightState, Origin, Sample};

/// Largest distance of a sample time from the 0.1 s grid on which it counts as lying, seconds.
pub const ON_GRID_WITHIN_S: f64 = 0.02;

/// A scene as the log holds it, in the log's coordinates.
#[derive(Default)]
pub struct Log {
    /// Id of the scene.
    pub id: String,
    /// Source of the scene.
    pub origin: Origin,
    /// Time of each sample, seconds, increasing.
    pub times_s: Vec<f64>,
    /// Index of the current step in `times_s`.
    pub current: usize,
    /// Origin of the local frame; `None` takes the ego's place at the current step.
    pub frame: Option<Vec2>,
    /// Everyone, the ego included.
    pub tracks: Vec<LogTrack>,
    /// Index of the ego in `tracks`.
    pub ego: usize,
    /// Ids of tracks.
    pub objects_of_interest: Vec<String>,
    /// The lanes of its map.
    pub lanes: Vec<LogLane>,
    /// Curbs and other edges, each a line.
    pub edges: Vec<Vec<Vec2>>,
    /// Crosswalks, each an outline.
    pub crosswalks: Vec<Vec<Vec2>>,
    /// Place of each stop sign, and ids of the lanes for which it holds.
    pub stop_signs: Vec<(Vec2, Vec<String>)>,
    /// The traffic lights of its map.
    pub lights: Vec<LogLight>,
    /// How headings and velocities are read; `None` takes them as they are, as in an export of ours.
    pub conventions: Option<Conventions>,
}

impl Log {
    /// Applies sample times to the log. Returns the log, and `true` if its times are different now.
    pub fn timed(mut self, times: SampleTimes) -> (Log, bool) {
        let SampleTimes::Every(step_s) = times else { return (self, false) };
        let every: Vec<f64> = (0..self.times_s.len()).map(|k| k as f64 * step_s).collect();
        let differ = every.iter().zip(&self.times_s).any(|(grid_s, own_s)| {
            let off_s = (own_s - self.times_s[0] - grid_s).abs();
            // NaN is a time that the log does not give.
            off_s.is_nan() || off_s > ON_GRID_WITHIN_S
        });
        self.times_s = every;
        (self, differ)
    }
}

/// Samples at the log's times.
pub struct LogTrack {
    /// Id in the log.
    pub id: String,
    /// Kind of road user; `Err` with the log's name for it where that is not known.
    pub kind: Result<AgentKind, String>,
    /// Length, metres; 0 where the log gives none.
    pub length_m: f64,
    /// Width, metres; 0 where the log gives none.
    pub width_m: f64,
    /// Samples, one a time of the log; `None` where it was not observed. NaN stands for values that the log lacks. `[times]`
    pub samples: Vec<Option<Sample>>,
    /// Height of its middle at each time, metres; NaN where the log lacks it, empty where it never has it. `[times]`
    pub heights_m: Vec<f64>,
}

/// A lane with links by id. A link to a lane that the log does not hold leads out of the map.
pub struct LogLane {
    /// Id in the log.
    pub id: String,
    /// Kind of lane.
    pub kind: LaneKind,
    /// Points of the centre line, in driving direction.
    pub points: Vec<Across>,
    /// Lanes that lead into it.
    pub entries: Vec<String>,
    /// Lanes that it leads into.
    pub exits: Vec<String>,
    /// Lanes to its left, the one that is beside it for the longest way first.
    pub left: Vec<String>,
    /// Lanes to its right, likewise.
    pub right: Vec<String>,
    /// Speed limit where the log gives one, m/s.
    pub speed_limit_mps: Option<f64>,
}

/// States at the log's times.
pub struct LogLight {
    /// Id of its lane.
    pub lane: String,
    /// Point where traffic stops; `None` where the log does not give it.
    pub stop_point: Option<Vec2>,
    /// One state a time of the log. `[times]`
    pub states: Vec<LightState>,
}

/// Parts of a log, each with what became of it.
pub type Parts = Vec<(String, String)>;
