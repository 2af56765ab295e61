//! One piece of the paper made anew: the goldens that it belongs to stay as they are otherwise.

use crate::harness::{copy_dir, home, run};
use crate::quickstart::copied;

#[test]
fn a_piece_that_was_damaged_is_blessed_alone_and_only_of_the_runs_of_the_goldens() {
    let dir = tempfile::tempdir().unwrap();
    let (golden, runs) = (dir.path().join("golden"), dir.path().join("runs"));
    copy_dir(&home().join("golden/paper"), &golden.join("paper"));
    std::fs::create_dir(&runs).unwrap();
    copied(&runs);
    let read = |name: &str| std::fs::read(golden.join("paper").join(name)).unwrap();
    let touched = ["quickstart-credit.csv", "numbers.tex", "provenance.toml"];
    let before = touched.map(read);
    let damaged = |name: &str, from: &str, to: &str| {
        let text = String::from_utf8(read(name)).unwrap();
        assert!(text.contains(from), "{name} has no {from}");
        std::fs::write(golden.join("paper").join(name), text.replacen(from, to, 1)).unwrap();
    };
    damaged("quickstart-credit.csv", "program,edit", "programme,edit");
    damaged("numbers.tex", "evo:quickstart-credit:", "evo:quickstart-credit:no-such-row ");
    let bless = |label: &str| {
        let (golden, runs) = (golden.to_str().unwrap(), runs.to_str().unwrap());
        let words = ["paper", "--bless", "--figure", label, "--as-recorded", "--golden", golden, "--runs", runs];
        run(&words)
    };
    let ran = bless("quickstart-credit");
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(touched.map(read) == before, "as it was, digests and numbers too");
    let provenance = String::from_utf8(read("provenance.toml")).unwrap();
    let root = crate::quickstart::golden_root();
    assert!(provenance.contains(&root));
    damaged("provenance.toml", &root, &"0".repeat(64));
    let refused = bless("quickstart-credit");
    assert!(
        refused.code == 2 && refused.stderr.contains("run quickstart: expected the root 000"),
        "{}",
        refused.stderr
    );
    let both = run(&["paper", "--bless", "--figure", "quickstart-credit", "--out", dir.path().to_str().unwrap()]);
    assert!(both.code == 2 && both.stderr.contains("one of the two"), "{}", both.stderr);
    assert_eq!(run(&["paper", "--check", "--bless"]).code, 2);
}
