//! Applies a patch, then the seven gates.
