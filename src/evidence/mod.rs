//! From recorded attempts to reports.
