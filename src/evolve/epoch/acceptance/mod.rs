//! Steps behind the barrier: the serial acceptor, other search methods, and the end of a run.

pub(super) mod challengers;
pub(super) mod consider;
pub(super) mod evolve;
pub(super) mod finale;
pub(super) mod groups;
pub(super) mod race;
pub(super) mod redraw;
pub(super) mod rival;
pub(super) mod rounds;
pub(super) mod seal;
pub(super) mod search;
pub(super) mod settle;
pub(super) mod shuffled;
