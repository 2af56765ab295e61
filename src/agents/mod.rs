//! Actor, critics, repair: the only room that asks the llm.
