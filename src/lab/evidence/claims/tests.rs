use super::judge::{holm, rules};
use super::*;
use std::collections::BTreeMap;

use crate::archive::ArchiveOptions;
use crate::evidence::recorded_run::RecordedRun;
use crate::evidence::tables::recorded_unseen;
use crate::evidence::tables::tests::{CAT, End, add, run};
use crate::kernel::Threads;
use crate::objects::{FrontOf, JudgedOn};

const FILE: &str = r#"
level = 0.05
[runs]
made = "made"
[[claim]]
id = "realism"
label = "tab:any"
text = "CAT's penalty falls."
run = "made"
table = "metadrive-policy"
column = "rp_change_pp"
rows = ["CAT"]
direction = "below"
threshold = 0.0
[[claim]]
id = "learned"
label = "tab:any"
text = "The same against the learned ego."
run = "made"
table = "metadrive-policy"
column = "rp_change_pp"
rows = ["CAT / RL"]
direction = "below"
threshold = 0.0
[[claim]]
id = "elsewhere"
label = "tab:any"
text = "Of a run that is not there."
run = "ablations"
measure = "edits_structural_pct"
direction = "above"
threshold = 50.0
"#;

fn recorded() -> RecordedRun {
    let mut recorded = run("made", &[("actor", "scripted (s, s)")]);
    add(&mut recorded, &CAT);
    recorded
}

fn of(runs: &[RecordedRun], id: &str) -> Judged {
    let verdicts = judge(&read("claims.toml", FILE).unwrap(), runs, &BTreeMap::new(), &Threads::none()).unwrap();
    verdicts.claims.into_iter().find(|claim| claim.id == id).unwrap()
}

/// The run with parent and evolved program of every lineage in each other's place.
fn swapped(mut recorded: RecordedRun) -> RecordedRun {
    for lineage in &mut recorded.result.as_mut().unwrap().lineages {
        std::mem::swap(&mut lineage.parent, &mut lineage.evolved);
    }
    recorded
}

#[test]
fn a_fall_in_every_scene_is_supported_and_its_parts_can_be_asked_for() {
    let claim = of(&[recorded()], "realism");
    assert_eq!(claim.verdict, Verdict::Supported, "{claim:?}");
    assert_eq!(claim.parts[0].cell.as_deref(), Some("metadrive-policy:cat:rp_change_pp"));
    assert_eq!(claim.root, Some(recorded().root.to_hex()));
}

#[test]
fn with_parent_and_evolved_swapped_the_claim_fails_and_stands_first() {
    let verdicts =
        judge(&read("claims.toml", FILE).unwrap(), &[swapped(recorded())], &BTreeMap::new(), &Threads::none()).unwrap();
    assert_eq!((verdicts.claims[0].id.as_str(), verdicts.claims[0].verdict), ("realism", Verdict::NotSupported));
    let text = markdown(&verdicts);
    assert!(text.find("## Not supported") < text.find("## Not testable here"), "{text}");
    assert!(text.contains("scripted stand-in") && text.contains("one seed of every search, so that its intervals"));
    let mut repeated = recorded();
    repeated.result.as_mut().unwrap().lineages[0].replica = 1;
    let text =
        markdown(&judge(&read("claims.toml", FILE).unwrap(), &[repeated], &BTreeMap::new(), &Threads::none()).unwrap());
    assert!(!text.contains("one seed of every search"), "{text}");
}

#[test]
fn a_run_that_only_reports_its_parents_supports_nothing() {
    let mut still = run("made", &[]);
    add(&mut still, &End { evolved: None, ..CAT });
    assert_eq!(of(&[still], "realism").verdict, Verdict::NotSupported);
}

#[test]
fn an_effect_that_is_surely_less_than_the_papers_is_called_smaller_and_one_that_may_be_as_large_undecided() {
    let judged = |off: f64| {
        let before = [0.9, 0.8, 0.9, 0.8];
        let change = [off, -off, 0.5 * off, -0.5 * off];
        let at = |realism: f64| Some((1.0, realism));
        let mut recorded = run("made", &[]);
        let evolved = std::array::from_fn(|scene| at(before[scene] + change[scene]));
        add(&mut recorded, &End { parent: before.map(at), evolved: Some(evolved), ..CAT });
        let file = FILE.replace("metadrive-policy", "metadrive-main");
        let verdicts =
            judge(&read("claims.toml", &file).unwrap(), &[recorded], &BTreeMap::new(), &Threads::none()).unwrap();
        (verdicts.claims.iter().find(|claim| claim.id == "realism").unwrap().clone(), markdown(&verdicts))
    };
    // The paper has 6.81 points less; here it is none, and 0.1 or 20 points to either side.
    let (claim, text) = judged(0.001);
    assert_eq!((claim.verdict, claim.parts[0].paper), (Verdict::Smaller, Some(-6.81)), "{claim:?}");
    assert!(
        text.contains("## Smaller than in the paper") && text.contains("for less of it than in the paper 0.0"),
        "{text}"
    );
    let (claim, _) = judged(0.1);
    assert_eq!(claim.verdict, Verdict::Undecided, "{claim:?}");
    assert!(claim.p_smaller.is_some_and(|p| p > 0.05), "{claim:?}");
}

#[test]
fn a_claim_that_a_number_exceeds_0_which_is_never_below_says_so() {
    let file = FILE.replace("rp_change_pp", "pf_area_at_3_pct").replace("\"below\"", "\"above\"");
    // One seed gives an area no interval; what a repeated search would show is written in.
    let said = |file: &str| {
        let mut verdicts =
            judge(&read("claims.toml", file).unwrap(), &[recorded()], &BTreeMap::new(), &Threads::none()).unwrap();
        let place = verdicts.claims.iter().position(|claim| claim.id == "realism").unwrap();
        verdicts.claims[place].verdict = Verdict::Supported;
        (verdicts.claims[place].never_negative, markdown(&verdicts))
    };
    let (never_negative, text) = said(&file);
    assert!(text.contains("Supported as more than 0 of a number that is never negative: 1."), "{text}");
    assert!(never_negative && text.contains("- this number is never negative"));
    // Neither more than a size that it can miss, nor of a number that can fall.
    for other in [file.replace("threshold = 0.0", "threshold = 1.0"), FILE.to_string()] {
        let (never_negative, text) = said(&other);
        assert!(!never_negative && !text.contains("never negative"), "{text}");
    }
}

#[test]
fn what_is_not_measured_is_not_testable_and_says_why() {
    for (id, reason) in [("learned", "CAT / RL"), ("elsewhere", "ablations")] {
        let claim = of(&[recorded()], id);
        assert_eq!((claim.verdict, claim.parts.len()), (Verdict::NotTestable, 0));
        assert!(claim.reason.unwrap().contains(reason));
    }
    assert_eq!(of(&[], "realism").verdict, Verdict::NotTestable);
}

#[test]
fn holm_steps_down_and_never_falls() {
    // Three tests: 0.01 * 3, 0.02 * 2, 0.04 * 1 -> 0.03, 0.04, 0.04.
    let close = |found: Vec<f64>, wanted: &[f64]| {
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    };
    close(holm(&[0.04, 0.01, 0.02]), &[0.04, 0.03, 0.04]);
    close(holm(&[0.9, 0.8]), &[1.0, 1.0]);
    assert!(holm(&[]).is_empty());
}

#[test]
fn a_file_that_cannot_be_used_is_refused_with_what_was_expected() {
    for (from, to, text) in [
        ("level = 0.05", "level = 2.0", "less than 1"),
        ("id = \"learned\"", "id = \"realism\"", "twice"),
        ("\"metadrive-policy\"", "\"metadrive-polcy\"", "there are metadrive-main"),
        ("edits_structural_pct", "edits", "there are edits_structural_pct"),
        ("direction = \"above\"\n", "", "direction"),
        ("threshold = 50.0", "threshold = nan", "finite threshold"),
    ] {
        let error = read("claims.toml", &FILE.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(error.contains("claims.toml") && error.contains(text), "{error}");
    }
}

#[test]
fn the_shipped_claims_can_be_read() {
    let text = include_str!("../../../../paper/claims.toml");
    assert!(read("paper/claims.toml", text).unwrap().claims.len() > 20);
}

#[test]
fn each_run_is_told_with_the_rules_by_which_its_programs_were_judged() {
    let with = |archive: ArchiveOptions| {
        let mut run = recorded();
        run.declared.archive = Some(archive);
        let found = judge(&read("claims.toml", FILE).unwrap(), &[run], &BTreeMap::new(), &Threads::none()).unwrap();
        markdown(&found)
    };
    let ours = with(ArchiveOptions { level: 0.8, race: Some(0.95), ..ArchiveOptions::default() });
    assert!(
        ours.contains("; our rules: level 0.8, coverage floor 0, race 0.95, strict realism, front of accepted"),
        "{ours}"
    );
    let window = ArchiveOptions { judged_on: JudgedOn::Window, front: FrontOf::Evaluated, ..ArchiveOptions::default() };
    assert!(with(window).contains("no race, strict realism, front of all evaluated programs, judged on the window"));
    // SafeBench's realism is the paper's, too.
    let papers = ArchiveOptions { level: 0.5, front: FrontOf::Evaluated, ..ArchiveOptions::default() };
    let mut safebench = recorded();
    safebench.declared.archive = Some(papers);
    assert!(rules(&safebench).unwrap().starts_with("our rules: level 0.5"), "strict realism is ours");
    safebench.rounds = recorded_unseen().rounds.clone();
    assert!(rules(&safebench).unwrap().starts_with("the paper's rules: level 0.5, coverage floor 0, no race, ARS"));
    let unsaid = judge(&read("claims.toml", FILE).unwrap(), &[recorded()], &BTreeMap::new(), &Threads::none()).unwrap();
    assert!(!markdown(&unsaid).contains("rules"), "of a run without its experiment nothing is said");
}

/// Two runs behind one name answer together, as the paper averages over egos; where one is missing, nothing is tested.
#[test]
fn runs_of_several_experiments_answer_together() {
    let file =
        FILE.replace("made = \"made\"", "made = [\"made\", \"other\"]").replace("metadrive-policy", "metadrive-main");
    let of = |runs: &[RecordedRun]| {
        let verdicts = judge(&read("claims.toml", &file).unwrap(), runs, &BTreeMap::new(), &Threads::none()).unwrap();
        verdicts.claims.into_iter().find(|claim| claim.id == "realism").unwrap()
    };
    let alone = of(&[recorded()]);
    assert_eq!(alone.reason.as_deref(), Some("no run of the experiment other was given"));
    let mut other = run("other", &[("actor", "scripted (s, s)")]);
    add(&mut other, &End { id: "cat-sac", ego: "learned", ..CAT });
    let one = judge(
        &read("claims.toml", &FILE.replace("metadrive-policy", "metadrive-main")).unwrap(),
        &[recorded()],
        &BTreeMap::new(),
        &Threads::none(),
    );
    let one = one.unwrap().claims.into_iter().find(|claim| claim.id == "realism").unwrap().parts[0].estimate.value;
    let both = of(&[recorded(), swapped(other)]).parts[0].estimate.value;
    assert!(one < 0.0 && both.abs() < 1e-9, "one ego {one}, the mean with an ego of the opposite change {both}");
    let none = FILE.replace("made = \"made\"", "made = []");
    assert!(read("claims.toml", &none).unwrap_err().to_string().contains("runs.made names no experiment"));
}
