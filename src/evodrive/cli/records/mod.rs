//! Run folders and bundles: by which name they are asked for, and whether their bytes hold.

pub mod bundle;
pub mod bundle_replay;
pub mod covered;
pub mod folder;
pub mod fsck;
pub mod kept;
pub mod redacted;
pub mod run_name;
pub mod setting;
