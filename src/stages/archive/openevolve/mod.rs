//! OpenEvolve's program database (version 0.4.0, an open implementation of AlphaEvolve's scalar search; paper,
//! tab:attack-only-openevolve-ablation): a MAP-Elites grid an island, an archive of the best, migration around a ring, and
//! the draws of parents and inspirations. Pure data: every random number comes from outside, ids are counted, and ties are
//! broken by the order of insertion, so that one sequence of programs and numbers gives one database.

mod database;
mod diversity;
mod sampling;

pub use database::{Database, Member, OpenEvolveOptions};
pub use sampling::Draw;
