//! Searches: gradient descent over motions of several adversaries, Adam, particle swarms, black-box queries, and CAT's
//! collision posterior. A search knows losses and candidates, but no family.

pub mod adam;
pub mod descent;
pub mod gradient;
pub mod posterior;
pub mod pso;
pub mod query_search;
pub mod ranking;
