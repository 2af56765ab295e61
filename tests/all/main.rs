//! The tests of the library and its binary, in one program: linking one takes seconds and 60 MB. Alone are
//! `architecture`, which reads sources only, `sim_allocations`, which replaces the allocator, `store`, whose locks a started
//! command would hold for a moment, and `skipped`.

use evodrive::{ego, kernel, learn, scene, sim};

mod archive_hypervolume;
mod audit;
mod backends;
mod best;
mod bundle;
mod by_hand;
mod cheap_winners;
mod commands;
mod counsel;
mod credit;
mod damage;
mod data;
mod downstream;
mod episodes;
mod evaluation;
mod evolving;
mod exchange;
mod experiments;
mod families_gradient;
mod families_isolation;
mod families_signatures;
mod full_disk;
mod harness;
mod language;
mod ledger;
#[cfg(feature = "live")]
mod live;
mod models;
mod naming_runs;
mod not_losing_work;
mod openevolve;
mod own_ego;
mod own_ego_page;
mod own_metrics;
mod parents;
mod piloting;
mod plan;
mod pools;
mod programs;
mod quickstart;
mod readme;
mod realism;
mod recorded_traffic;
mod report;
mod sac;
mod scene_commonroad;
mod scene_export;
mod scene_opendrive;
mod scene_safebench;
mod scene_scenarionet;
mod scenes;
mod shards;
mod shards_lineage;
mod shuffled;
mod simulator;
mod snapshots;
mod suites;
mod tamper;
mod training;
mod two_realisms;
mod watching;
mod why;
mod worlds;
