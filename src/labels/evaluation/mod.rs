//! From rollouts over scenes to scores: `evaluate.rs` labels a program, `metrics/` reads quantities off an outcome, `protocol/`
//! adds SafeBench's rules.

pub mod calibrate;
pub mod evaluate;
pub mod metrics;
pub mod over_egos;
pub mod protocol;
pub mod record;
pub mod replay_row;
pub mod score;

pub use crate::sim::ContactClass;
pub use calibrate::{CalibrationError, calibrate};
pub use evaluate::{EvaluationError, Labeller, SceneRef, Subject, evaluate, label_one};
pub use metrics::safebench::{PreventableOptions, SafebenchOptions, StandingOptions, staged_run};
pub use metrics::{
    AT_FAULT, AttackOptions, AttackOptionsError, Calibration, Counts, DIAGNOSTICS, Diagnostic, EvaluationOptions,
    Limit, Limits, Measure, MetadriveOptions, OptionsError, OutcomeFormula, ProtocolError, PublishedReadings, Quantity,
    RealismOptions, Weights, outcome_fields,
};
pub use over_egos::{over_egos, scene_over_egos};
pub use protocol::balanced::balanced;
pub use protocol::rounds::{SceneArchive, Selecting, StagedRun, group_name, group_points};
pub use protocol::safebench::{Group, Runs, SafebenchScore, Table, group_score, point_of, recorded_run, safebench_run};
pub use record::{CacheError, RolloutCache, RolloutRecord, Written, request_key};
pub use replay_row::{Playing, replay_row};
pub use score::{SEARCH_ROLLOUTS, scene_score, score_of};

/// Part of a run's first event; rises when a metric or protocol changes meaning.
pub const EVAL_VERSION: u32 = 4;
