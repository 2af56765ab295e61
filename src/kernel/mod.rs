//! What determinism rests on: float functions, named random streams, geometry, canonical bytes, digests and the one
//! ordered parallel map. This room does not know driving.

pub mod canon;
pub mod digest;
pub mod geom;
pub mod num;
pub mod rng;
pub mod threads;

pub use canon::canonical_bytes;
pub use digest::Digest;
pub use geom::{OrientedBox, Polyline, Pose, Vec2};
pub use rng::{Seed, Stream};
pub use threads::Threads;
