//! State, frozen snapshot, workers, serial acceptor.
