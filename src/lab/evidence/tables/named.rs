//! All tables by their names.

use super::ablations::{attack_only, kwidth, without};
use super::contacts::metadrive_contacts;
use super::critics::actor_critic;
use super::error::TableError;
use super::gains::metadrive_gains;
use super::layout::Table;
use super::metadrive::{metadrive_main, metadrive_policy};
use super::proposals::proposals;
use super::readings::metadrive_readings;
use super::safebench::{safebench_main, safebench_rounds};
use super::unseen::safebench_held_out;
use crate::evidence::recorded_run::RecordedRun;

/// Function that makes a table from runs.
pub type Make = fn(&[RecordedRun]) -> Result<Table, TableError>;

/// All tables by their names.
pub const NAMED: [(&str, Make); 13] = [
    ("metadrive-main", metadrive_main),
    ("metadrive-policy", metadrive_policy),
    ("metadrive-contacts", metadrive_contacts),
    ("metadrive-readings", metadrive_readings),
    ("metadrive-gains", metadrive_gains),
    ("safebench-main", safebench_main),
    ("safebench-rounds", safebench_rounds),
    ("safebench-held-out", safebench_held_out),
    ("proposals", proposals),
    ("actor-critic", actor_critic),
    ("attack-only", attack_only),
    ("without", without),
    ("kwidth", kwidth),
];
