//! Basis of determinism: float functions, named random streams, geometry, canonical bytes, digests, formulas in
//! total arithmetic, products of matrices, and the one ordered parallel map. This room does not know driving.

pub mod canon;
pub mod digest;
pub mod formula;
pub mod game;
pub mod geom;
pub mod hex;
pub mod kept;
pub mod linear;
pub mod num;
pub mod rng;
pub mod threads;
pub mod total;

pub use canon::canonical_bytes;
pub use digest::{Digest, Hashing};
pub use formula::Formula;
pub use geom::{Extent, OrientedBox, Polyline, Pose, Vec2};
pub use kept::LruCache;
pub use rng::{Seed, Stream};
pub use threads::Threads;
