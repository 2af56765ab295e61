//! All disk: objects by digest, memo (request -> object), transcript (append-only), atomic files.

mod canonical;
mod difference;
mod error;
mod file;
mod fsck;
mod index;
mod objects;
mod pack;
mod text;
mod transcript;

pub use canonical::{reader, write_filled};
pub use difference::{first_difference, shortened};
pub use error::{Damage, Divergence, StoreError};
pub use file::{
    copy, create_dir, length, list_dirs, list_files, read_bounded, read_head, remove_dir, remove_empty_dir,
    remove_file, rename, write_atomic,
};
pub use fsck::{FsckReport, fsck};
pub use objects::{MemoKind, Opening, Store};
pub use text::{read_text, write_text};
pub use transcript::{Event, SEALED, Transcript, each_event, each_event_on, fsck_transcript, read_events};
