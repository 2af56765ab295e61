//! EvoDrive: deterministic, replay-first evolution of driving-scenario generators by LLM agents.
//!
//! A run is a function of (experiment, scenes, cassette). `docs/ARCHITECTURE.md` is the map of the rooms below.

pub mod kernel;
pub mod store;

pub mod draw;
pub mod ego;
pub mod formats;
pub mod scene;
pub mod sim;
pub mod synth;

pub mod adapters;
pub mod compiler;
pub mod families;
pub mod llm;
pub mod motion;
pub mod objects;
pub mod scripted;
pub mod search;
pub mod stage;

pub mod agents;
pub mod archive;
pub mod candidates;
pub mod evaluation;
pub mod lineage;
pub mod memory;
pub mod world;

pub mod cli;
pub mod epoch;
pub mod evidence;
pub mod experiment;
