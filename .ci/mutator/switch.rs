//! Which mutant is on. This file is part of a copy of the library that `.ci/mutants` tests, and of nothing else.

use std::io::Write;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

const UNREAD: u32 = u32::MAX;
const NOTING: u32 = u32::MAX - 1;

static ON: AtomicU32 = AtomicU32::new(UNREAD);

/// Numbers that were noted. There are fewer mutants than places; a number beyond them is noted each time.
static SEEN: [AtomicBool; 1 << 16] = [const { AtomicBool::new(false) }; 1 << 16];

/// Whether mutant `number` is on: the one that EVODRIVE_MUTANT names, and none where it is absent.
#[inline]
pub fn mutated(number: u32) -> bool {
    match ON.load(Ordering::Relaxed) {
        UNREAD => first(number),
        NOTING => note(number),
        on => on == number,
    }
}

#[cold]
fn first(number: u32) -> bool {
    let noting = std::env::var_os("EVODRIVE_MUTANT_NOTES").is_some();
    let named = std::env::var("EVODRIVE_MUTANT").ok().and_then(|text| text.parse().ok()).unwrap_or(0);
    ON.store(if noting { NOTING } else { named }, Ordering::Relaxed);
    mutated(number)
}

/// Notes that somebody came by. A line is written at once, since a program may end anyhow.
#[cold]
fn note(number: u32) -> bool {
    if !SEEN.get(number as usize).is_some_and(|seen| seen.swap(true, Ordering::Relaxed)) {
        let path = std::env::var_os("EVODRIVE_MUTANT_NOTES").unwrap_or_default();
        let file = std::fs::OpenOptions::new().append(true).create(true).open(path);
        let _ = file.and_then(|mut file| file.write_all(format!("{number}\n").as_bytes()));
    }
    false
}
