//! `evodrive watch`: the page grows with the run, says how far the run is, and ends as the report.

use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;

use serde_json::Value;

use crate::backends::experiment;
use crate::harness::{Recorded, evodrive, record, report_data, run};

/// Longer than any of these steps takes; a test that waits so long has failed.
const AT_MOST: u32 = 1200;

fn recorded() -> Recorded {
    record(|folder| {
        let path = experiment(folder, "watched", "");
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.replace("slots = 1", "slots = 3")).unwrap();
        path
    })
}

/// Starts to follow a run; whoever fails ends it.
struct Watching(Child);

impl Watching {
    fn begin(run: &Path) -> Watching {
        let args = ["watch", run.to_str().unwrap(), "--every", "0.2"];
        Watching(evodrive().args(args).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap())
    }
}

impl Drop for Watching {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Waits until the page shows what is wanted of it.
fn shows(page: &Path, wanted: impl Fn(&Value) -> bool) -> Value {
    for _ in 0..AT_MOST {
        if let Some(data) = std::fs::read_to_string(page).ok().map(|text| report_data(&text)[0].clone()).filter(&wanted)
        {
            return data;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    panic!("{} never showed it", page.display());
}

#[test]
fn a_page_follows_the_events_of_a_run_and_ends_as_its_report() {
    let recorded = recorded();
    let (transcript, page) = (recorded.run.join("transcript.jsonl"), recorded.run.join("report.html"));
    let (events, report) = (std::fs::read_to_string(&transcript).unwrap(), std::fs::read(&page).unwrap());
    let lines: Vec<&str> = events.split_inclusive('\n').collect();
    let attempts: Vec<usize> =
        (0..lines.len()).filter(|at| lines[*at].contains("\"kind\":\"attempt\"")).map(|at| at + 1).collect();
    let [second, last] = [attempts[1], attempts[attempts.len() - 1]];
    // As another process would leave it that is still writing: not sealed, the last line half there.
    let half = |line: &str| line[..line.len() / 2].to_string();
    for gone in ["result.json", "report.html"] {
        std::fs::remove_file(recorded.run.join(gone)).unwrap();
    }
    std::fs::write(&transcript, lines[..second].concat() + &half(lines[second])).unwrap();
    let mut watching = Watching::begin(&recorded.run);
    let early = shows(&page, |data| data["attempts"].as_array().unwrap().len() == 2);
    assert_eq!(early["sealed"], false);
    let live = &early["live"];
    assert_eq!(live["reload_s"], 0.2);
    assert_eq!(live["proposals"].as_u64().unwrap() as usize, attempts.len(), "all that there will be");
    // It goes on, and the page with it.
    std::fs::write(&transcript, lines[..last].concat()).unwrap();
    let later = shows(&page, |data| data["attempts"].as_array().unwrap().len() == attempts.len());
    assert!(later["live"].is_object() && later["sealed"] == false);
    // Sealed: the report, and the command ends well.
    std::fs::write(&transcript, &events).unwrap();
    shows(&page, |data| data["sealed"] == true && data["live"].is_null());
    let status = watching.0.wait().unwrap();
    assert_eq!(status.code(), Some(0));
    assert_eq!(std::fs::read(&page).unwrap(), report, "the page is what the run wrote");
    // Of a finished run it is the report at once.
    std::fs::remove_file(&page).unwrap();
    let again = run(&["watch", recorded.run.to_str().unwrap()]);
    assert!(again.code == 0 && again.stdout.contains(&recorded.root), "{}", again.stderr);
    assert_eq!(std::fs::read(&page).unwrap(), report);
}

#[test]
fn what_cannot_be_watched_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let none = run(&["watch", folder.path().to_str().unwrap()]);
    assert!(none.code == 2 && none.stderr.contains("is not a run folder"), "{}", none.stderr);
    let pause = run(&["watch", folder.path().to_str().unwrap(), "--every", "0"]);
    assert!(pause.code == 2 && pause.stderr.contains("expected 0.2 to 3600 seconds"), "{}", pause.stderr);
}

#[test]
#[cfg(unix)]
fn who_watches_a_run_that_fails_or_presses_ctrl_c_is_told() {
    let recorded = recorded();
    let transcript = recorded.run.join("transcript.jsonl");
    let events = std::fs::read_to_string(&transcript).unwrap();
    let begun: String = events.split_inclusive('\n').take(6).collect();
    std::fs::write(&transcript, begun).unwrap();
    std::fs::remove_file(recorded.run.join("result.json")).unwrap();
    let page = recorded.run.join("report.html");
    std::fs::remove_file(&page).unwrap();
    let mut watching = Watching::begin(&recorded.run);
    shows(&page, |data| data["live"].is_object());
    let asked = std::process::Command::new("kill").args(["-INT", &watching.0.id().to_string()]).status().unwrap();
    assert!(asked.success());
    assert_eq!(watching.0.wait().unwrap().code(), Some(130));
    std::fs::remove_file(&page).unwrap();
    let mut watching = Watching::begin(&recorded.run);
    shows(&page, |data| data["live"].is_object());
    std::fs::remove_dir_all(&recorded.run).unwrap();
    assert_eq!(watching.0.wait().unwrap().code(), Some(2), "the folder is gone");
}
