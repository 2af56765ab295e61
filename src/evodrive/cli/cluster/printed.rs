//! Shows each text that planners print once on the terminal: a broken planner prints the same in every scene.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use crate::cli::scenes::left_out::without_numbers;
use crate::cli::terminal::answer::progress;

/// Texts printed so far. When it is dropped, it says how many further texts were like those that it showed.
#[derive(Debug, Default)]
pub struct Printed {
    /// Keyed by the text without its numbers: whom the first such text was about, and how many followed it.
    shown: Mutex<BTreeMap<String, (String, usize)>>,
}

impl Printed {
    /// Returns `true` if nothing like it was printed before, so that it is to be shown.
    pub fn is_new(&self, about: &str, printed: &str) -> bool {
        let mut shown = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
        match shown.get_mut(&without_numbers(printed)) {
            Some((_, more)) => {
                *more += 1;
                false
            }
            None => shown.insert(without_numbers(printed), (about.to_string(), 0)).is_none(),
        }
    }

    /// A line for each text that was printed again.
    fn more(&self) -> Vec<String> {
        let shown = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
        let again = shown.values().filter(|(_, more)| *more > 0);
        again.map(|(about, more)| format!("{about}: and {more} more like it")).collect()
    }
}

impl Drop for Printed {
    fn drop(&mut self) {
        self.more().into_iter().for_each(progress);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_text_is_shown_once_and_counted_whatever_its_numbers_and_its_scene() {
        let printed = Printed::default();
        let new = [("scene a", "line 3: no weights"), ("scene b", "line 12: no weights"), ("scene c", "no file")];
        assert_eq!(new.map(|(about, text)| printed.is_new(about, text)), [true, false, true]);
        assert!(!printed.is_new("scene d", "line 3: no weights"));
        assert_eq!(printed.more(), ["scene a: and 2 more like it"]);
    }
}
