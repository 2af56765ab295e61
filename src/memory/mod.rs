//! Cards from attempts, causal retrieval.
