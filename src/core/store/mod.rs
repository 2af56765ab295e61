//! All disk access: objects by digest, memo (request -> object), transcript (append-only), atomic files, folders of our own.

mod canonical;
mod difference;
mod error;
mod file;
mod fsck;
mod index;
mod lines;
mod memo_kind;
mod no_file;
mod objects;
mod own;
mod pack;
mod text;
mod transcript;

pub use canonical::{reader, write_filled};
pub use difference::{first_difference, shortened};
pub use error::{Damage, Divergence, StoreError};
pub use file::{
    append, copy, copy_program, create_dir, create_plain_dir, digest_of_file, fits, is_plain_file, is_taken, length,
    list_dirs, list_entries, list_files, open_bounded, read_bounded, read_head, remove_file, rename, write_atomic,
    write_new,
};
pub use fsck::{FsckReport, fsck};
pub use lines::{LINE_BYTES_MAX, Line, batch, next_line, toml_too_large, too_large};
pub use memo_kind::MemoKind;
pub use objects::{Opening, Store};
pub use own::{OwnDir, Scratch, remove_empty_dir};
pub use text::{
    TextFault, TextLines, UNPACKED_FREE, UNPACKED_PER_BYTE, ZSTD_MAGIC, packed, read_text, text_lines,
    unpacked_bytes_max, write_text,
};
pub use transcript::{Event, SEALED, Transcript, each_event, each_event_on, fsck_transcript, read_events};
