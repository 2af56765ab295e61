//! The simulator against hand calculations, oracles and its own promises.

mod avoidance;
mod contacts;
mod driving;
mod egos;
mod laws;
mod obedience;
mod plant;
mod recorded;
mod rollouts;
mod sprung;
mod timeline;
mod triggered;
mod world;
