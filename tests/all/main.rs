//! The tests of the library and its binary, in one program: linking one takes seconds and 60 MB. Alone are
//! `architecture`, which reads sources only, `sim_allocations`, which replaces the allocator, `store`, whose locks a started
//! command would hold for a moment, and `skipped`.

use evodrive::{ego, kernel, scene, sim};

mod archive_hypervolume;
mod audit;
mod backends;
mod counsel;
mod evaluation;
mod exchange;
mod experiments;
mod families_gradient;
mod families_isolation;
mod families_signatures;
mod harness;
mod language;
mod ledger;
#[cfg(feature = "live")]
mod live;
mod models;
mod nudge;
mod parents;
mod programs;
mod quickstart;
mod realism;
mod recorded_traffic;
mod scene_commonroad;
mod scene_export;
mod scene_opendrive;
mod scene_safebench;
mod scene_scenarionet;
mod scenes;
mod shards;
mod simulator;
mod snapshots;
mod worlds;
