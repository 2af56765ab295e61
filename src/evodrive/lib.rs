//! EvoDrive evolves programs that generate safety-critical driving scenarios. LLM agents propose the changes; a seeded
//! closed-loop simulator and a Pareto archive decide about them. A run is a function of its experiment file, its scenes
//! and its cassette of recorded answers, and replays bit for bit.
//!
//! Import a scenario, prepare it once, drive through it, and look at what happened:
//!
//! ```
//! use evodrive::{ego::Policy, formats, sim};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let name = "tests/fixtures/commonroad/two_lanes_2018b.xml";
//! let summary = formats::import_files(&[(name, std::fs::read(name)?)]);
//! for scene in &summary.scenes {
//!     let plant = sim::Plant::new(scene)?;
//!     let mut driver = Policy::Idm.driver();
//!     let outcome = sim::rollout(&plant, &sim::Intervention::default(), driver.as_mut())?;
//!     println!("{}: {:?} after {} steps of 0.1 s", scene.id, outcome.end, outcome.steps);
//!     # assert!(outcome.steps > 0);
//! }
//! # assert_eq!(summary.scenes.len(), 1, "{:?}", summary.left_out);
//! # Ok(())
//! # }
//! ```
//!
//! The empty intervention leaves the traffic as recorded. A program of a family, compiled for the scene
//! ([`compiler::compile`]), gives an intervention that changes it.
//!
//! # The rooms
//!
//! A module of this crate is called a *room*. A room uses only rooms that stand above it in this list;
//! `docs/ARCHITECTURE.md` says which. `docs/GLOSSARY.md` lists the nouns, and `docs/EXTENDING.md` says how to add a
//! driver, a metric, a family, a format or a model.
//!
//! Ground: what determinism rests on.
//! - [`kernel`]: float functions with the same bits on every machine, named random streams, geometry, canonical bytes,
//!   digests, and the ordered parallel map.
//! - [`text`]: comparisons of texts: the nearest known word, unified diffs.
//! - [`statistics`]: intervals of means over scenes and seeds.
//! - [`store`]: all disk access: objects named by their digest, the memo of requests, the transcript of a run, and
//!   their check.
//!
//! Plant: scenes and what happens in them.
//! - [`learn`]: training of learned egos: soft actor-critic in our own simulator.
//! - [`backend`]: who simulates rollouts for labels: our own simulator, or another one behind worker processes, recorded and
//!   replayed.
//! - [`draw`]: drawings (SVG) and player pages (HTML) of scenes and rollouts.
//! - [`ego`]: the drivers under test: IDM, the recorded motion, and networks with frozen weights.
//! - [`formats`]: the file formats of scenarios, import and export.
//! - [`scene`]: what a scenario is: road, tracks, lights, ego and route, with validation, lane graph, features and
//!   pools.
//! - [`sim`]: the seeded closed-loop simulator: it applies an intervention to a scene and measures the outcome.
//! - [`synth`]: generated roads and their traffic, and SafeBench's traffic families on generated roads.
//!
//! Language: what is evolved, and how it becomes an intervention.
//! - [`adapters`]: contracts of families, the features that expressions may read, and checks of a program against its
//!   contract.
//! - [`compiler`]: from a program to the decision and the intervention for one scene.
//! - [`families`]: the source families: contract, parent program and signature mechanism of each published method.
//! - [`llm`]: requests to models, their keys, cassettes, replay and recording; real models under the feature `live`.
//! - [`motion`]: what moves: vehicle models, motion priors, offsets, tokens and scripts, and the candidates that they
//!   give.
//! - [`objects`]: the nouns that travel between rooms: program, patch, review, attempt, score, card and the events of
//!   a run.
//! - [`scripted`]: the scripted model: a rule-based stand-in for a language model. It sees the text of a prompt,
//!   nothing else.
//! - [`search`]: what searches among motions: gradients, particle swarms, queries and CAT's posterior.
//! - [`stage`]: what a family works on: a scene against an ego, the adversaries, and the parts of a decision in the
//!   making.
//!
//! Stages: each does one step of an epoch; none imports another.
//! - [`agents`]: the LLM agents: actor, critics, repair, attacker agent and template agent. The only room that asks a
//!   model.
//! - [`archive`]: the Pareto archive: the non-dominated front, its hypervolume, the acceptance gates and the selector.
//! - [`candidates`]: from a patch to an admitted candidate: applies the patch and runs the eight gates.
//! - [`evaluation`]: from rollouts to scores: one file a metric, one file a protocol.
//! - [`lineage`]: chains of parents, promotion of children, and the check of their continuity.
//! - [`memory`]: memory cards from attempts, and their retrieval.
//! - [`world`]: the world evaluator: predicts scores before a rollout and routes candidates. It never labels.
//!
//! Conduct: what runs the stages, and what people see of it.
//! - [`bundle`]: a run as one file that travels: manifest, archive, RO-Crate metadata, signature.
//! - [`cli`]: arguments, and one file a command.
//! - [`epoch`]: the epochs of a run: the state, the frozen snapshot, the workers and the serial acceptor.
//! - [`evidence`]: from recorded runs to the report and the tables.
//! - [`shard`]: missing work of a run as files that travel, and the union of their results.
//! - [`suite`]: frozen scenes for planners: what is chosen, what came of a planner, thresholds, comparisons.
//! - [`experiment`]: reads, checks and resolves experiment files, their scenes and their models.

#![forbid(unsafe_code)]

#[doc(inline)]
pub use evodrive_core::{kernel, objects, scene, statistics, store, synth, text};

#[doc(inline)]
pub use evodrive_sim::{backend, ego, learn, sim};

#[doc(inline)]
pub use evodrive_lang::{adapters, candidates};

#[doc(inline)]
pub use evodrive_generators::{compiler, families, motion, search, stage};

#[doc(inline)]
pub use evodrive_formats::{draw, formats};

#[doc(inline)]
pub use evodrive_models::{agents, llm, scripted};

#[doc(inline)]
pub use evodrive_stages::{archive, lineage, memory, world};

#[doc(inline)]
pub use evodrive_packs::{bundle, suite};

#[doc(inline)]
pub use evodrive_evolve::{epoch, experiment, shard};

#[doc(inline)]
pub use evodrive_labels::evaluation;

#[doc(inline)]
pub use evodrive_lab::evidence;

pub mod cli;
#[cfg(feature = "live")]
pub mod live;

// Compiles and runs the programs of the page with `cargo test --doc`.
#[cfg(doctest)]
#[doc = include_str!("../../docs/EXTENDING.md")]
pub struct Extending;
