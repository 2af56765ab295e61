//! Work named ahead of a run, for whoever does it elsewhere.

pub(super) mod carried;
pub(super) mod plan;
pub(super) mod prefetch;
pub(super) mod walk;
pub(super) mod walker;
pub(super) mod wanted;
pub(super) mod work;
