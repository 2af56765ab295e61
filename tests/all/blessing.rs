//! One piece of the paper made anew: the goldens that it belongs to stay as they are otherwise.

use crate::harness::{copy_dir, home, run};
use crate::quickstart::copied;

#[test]
fn a_piece_that_was_damaged_is_blessed_alone_and_with_all_of_its_run_where_that_has_moved() {
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
    // Of a run that has moved every piece is made, so that no two goldens show two roots of it.
    let surface = read("quickstart-patch-surface.svg");
    damaged("provenance.toml", &root, &"0".repeat(64));
    damaged("quickstart-patch-surface.svg", "<svg", "<!-- older --><svg");
    let moved = bless("quickstart-credit");
    assert!(
        moved.code == 0 && moved.stdout.contains("another root than the goldens had: quickstart"),
        "{}",
        moved.stderr
    );
    assert!(
        touched[..2].iter().map(|name| read(name)).eq(before[..2].iter().cloned()),
        "the same run, the same pieces"
    );
    assert!(read("quickstart-patch-surface.svg") == surface, "another piece of the run");
    let now = String::from_utf8(read("provenance.toml")).unwrap();
    assert!(now.contains(&root) && now.contains("[older]\nclaims = [\"quickstart\"]"), "{now}");
    let both = run(&["paper", "--bless", "--figure", "quickstart-credit", "--out", dir.path().to_str().unwrap()]);
    assert!(both.code == 2 && both.stderr.contains("one of the two"), "{}", both.stderr);
    assert_eq!(run(&["paper", "--check", "--bless"]).code, 2);
}

#[test]
fn numbers_of_another_check_s_golden_are_missed_where_they_are_outdated_and_blessed_alone() {
    let dir = tempfile::tempdir().unwrap();
    let (golden, text) = (dir.path().join("golden"), dir.path().join("paper"));
    for of in ["paper", "readings"] {
        copy_dir(&home().join("golden").join(of), &golden.join(of));
    }
    // No piece, so that nothing is drawn here.
    std::fs::create_dir(&text).unwrap();
    let plan = "[[numbers]]\nname = \"published-sac-gains\"\ngolden = \"readings/published-sac-gains.md\"\n";
    let page = "\\documentclass{article}\n\\begin{document}\nNothing.\n\\end{document}\n";
    for (name, content) in [("plan.toml", format!("run = []\npiece = []\n{plan}")), ("evodrive.tex", page.into())] {
        std::fs::write(text.join(name), content).unwrap();
    }
    let paper = |words: &[&str]| {
        run(&[&["paper", "--golden", golden.to_str().unwrap(), "--paper", text.to_str().unwrap()], words].concat())
    };
    let file = |name: &str| golden.join("paper").join(name);
    let read = || ["numbers.tex", "provenance.toml"].map(|name| std::fs::read(file(name)).unwrap());
    let before = read();
    let numbers = String::from_utf8(before[0].clone()).unwrap();
    let name = "evo:published-sac-gains:AT:attack_change";
    assert!(numbers.contains(name));
    std::fs::write(file("numbers.tex"), numbers.replacen(name, "evo:published-sac-gains:AT:no_such", 1)).unwrap();
    let missed = paper(&["--short", "--check"]);
    assert_eq!(missed.code, 4, "{}{}", missed.stdout, missed.stderr);
    for said in ["published-sac-gains.md", "has 2 numbers of it otherwise", "--bless --figure published-sac-gains"] {
        assert!(missed.stdout.contains(said), "{said}: {}", missed.stdout);
    }
    let blessed = paper(&["--bless", "--figure", "published-sac-gains"]);
    assert_eq!(blessed.code, 0, "{}", blessed.stderr);
    assert!(read() == before, "as they were, the digest too");
    assert!(!paper(&["--short", "--check"]).stdout.contains("of it otherwise"));
}
