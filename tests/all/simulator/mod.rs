//! The simulator against hand calculations, oracles and its own promises.

mod driving;
mod egos;
mod laws;
mod recorded;
mod rollouts;
mod triggered;
mod world;
