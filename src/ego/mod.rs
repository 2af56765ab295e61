//! The fixed drivers under test.
