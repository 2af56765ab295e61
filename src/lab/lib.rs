//! Outputs made from recorded runs: the report, tables, figures and the claims of the paper.

#![forbid(unsafe_code)]

pub(crate) use evodrive_core::{kernel, objects, scene, statistics, store, text};
pub(crate) use evodrive_formats::draw;
pub(crate) use evodrive_labels::evaluation;
pub(crate) use evodrive_sim::sim;
pub(crate) use evodrive_stages::{archive, lineage, world};

pub mod evidence;
