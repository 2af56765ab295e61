//! Non-dominated front, hypervolume, acceptance gates, active selector.
