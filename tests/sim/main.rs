//! The simulator held against the world.

use evodrive::{ego, kernel, scene, sim};

mod driving;
mod egos;
mod laws;
mod recorded;
mod rollouts;
mod scenes;
mod triggered;
mod world;
