//! Words quoted for a shell, and short commands built from them for messages.

use std::path::Path;

/// A word as a shell reads it back.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-/=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_string()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

/// The command that shows, draws or exports one rollout of a run, with options of its own at the end.
pub fn rollout_command(action: &str, run: &Path, attempt: &str, scene: &str, options: &str) -> String {
    let [run, attempt, scene] = [&run.to_string_lossy(), attempt, scene].map(quoted);
    format!("evodrive scenes {action} --run {run} --attempt {attempt} --scene {scene} {options}")
}
