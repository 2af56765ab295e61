//! Commands that print what there is: keys, families, formats, pages of the manual.

pub mod known;
pub mod manual;
pub mod options;
pub mod page;
