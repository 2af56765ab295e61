//! Output for people: answers, failures, progress, widths, and words to copy.

pub mod answer;
pub mod counting_line;
pub mod examples;
pub mod exit;
pub mod exit_from;
pub mod groups;
pub mod interrupt;
pub mod moving_line;
pub mod output;
pub mod outside;
pub mod result_text;
pub mod shell;
pub mod timed;
pub mod typed;
pub mod width;
