//! The quickstart cut short: its three families on a quarter of its scenes, two epochs of four proposals. Tests that read, damage and
//! derive a run many times over need what every run has, and not the length of that one.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::harness::{Recorded, copy_dir, experiment, folder_below, record, run, set, write_small};

/// The experiment, composed and cut short.
pub fn table() -> toml::Table {
    let mut table = experiment("quickstart.toml");
    table["split"]["evolution"].as_table_mut().unwrap().insert("count".into(), 16.into());
    set(
        &mut table,
        &[
            ("scenes", "count", 40.into()),
            ("split", "held_out", 20.into()),
            ("split", "window", 8.into()),
            ("budget", "epochs", 2.into()),
            ("budget", "slots", 4.into()),
            ("budget", "probe_scenes", 4.into()),
            ("budget", "finalists", 2.into()),
        ],
    );
    table
}

/// One finished run of it from its cassette, shared: tests that change something copy its folder.
pub fn finished() -> &'static Recorded {
    static RUN: OnceLock<Recorded> = OnceLock::new();
    RUN.get_or_init(|| {
        let mut recorded = record(|folder| write_small(folder, table()));
        let out = recorded.experiment.with_file_name("replayed");
        let ran = run(&["run", recorded.experiment.to_str().unwrap(), "--out", out.to_str().unwrap()]);
        assert_eq!(ran.root(), recorded.root);
        recorded.run = folder_below(&out);
        recorded
    })
}

/// A copy of its folder.
pub fn copied(to: &Path) -> PathBuf {
    let from = &finished().run;
    let folder = to.join(from.file_name().unwrap());
    copy_dir(from, &folder);
    folder
}
