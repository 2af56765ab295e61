//! `scenes` and `calibrate`: pools in, out and beside each other.

pub mod best;
pub mod browse;
pub mod calibrate;
pub mod command;
pub mod compare;
pub mod contradictions;
pub mod draw;
pub mod export;
pub mod files;
pub mod formula;
pub mod grid;
pub mod left_out;
pub mod pools;
pub mod readable;
pub mod recorded_crash;
pub mod show;
