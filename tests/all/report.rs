//! Contents of the report on runs of any size.

use evodrive::archive::SelectorOptions;
use evodrive::evidence::RecordedRun;
use evodrive::evidence::report::{Beside, Playable, Stage, Words, html};
use evodrive::store::read_events;
use serde_json::Value;

use crate::harness::report_data;
use crate::quickstart::finished;

/// The quickstart's selector.
const SELECTOR: SelectorOptions = SelectorOptions::at(0.95, 0.05);

fn page(run: &RecordedRun, stage: &Stage) -> String {
    let words = Words::default();
    let beside = Beside {
        selector: &SELECTOR,
        cost: None,
        credits: &[],
        agreement: None,
        others: &[],
        words: &words,
        live: None,
    };
    html(run, stage, &beside)
}

fn attempts(run: &RecordedRun) -> Vec<Value> {
    report_data(&page(run, &Stage::default()))[0]["attempts"].as_array().unwrap().clone()
}

fn quickstart() -> RecordedRun {
    RecordedRun::read(&read_events(&finished().1.join("transcript.jsonl")).unwrap()).unwrap()
}

/// Returns the part of the page before its data: a reader has it at once, and without a script.
fn first_screen(page: &str) -> &str {
    page.split_once("<script id=\"data\"").expect("the data").0
}

#[test]
fn the_first_screen_claims_what_the_paired_labels_say_and_needs_no_script() {
    let page = page(&quickstart(), &Stage::default());
    let (screen, data) = (first_screen(&page), report_data(&page));
    let headlines = data[0]["headlines"].as_array().unwrap();
    let of = |name: &str| headlines.iter().find(|of| of["group"] == name).unwrap();
    let lineage =
        |name: &str| data[0]["lineages"].as_array().unwrap().iter().find(|of| of["id"] == name).unwrap().clone();
    assert_eq!(headlines[0]["group"], "adv_bmt-idm", "the one that gained comes first");
    let quantities = lineage("adv_bmt-idm")["compared"]["quantities"].clone();
    for name in ["attack", "realism"] {
        let row = quantities.as_array().unwrap().iter().find(|row| row["quantity"] == name).unwrap().clone();
        assert_eq!(headlines[0][name], row["difference"], "{name}");
    }
    assert_eq!(of("adv_bmt-idm")["verdict"], "gain");
    assert_eq!(of("cat-idm")["verdict"], "parent");
    assert_eq!(of("at-idm")["verdict"], "unsure", "a difference of 0.000 is no gain");
    for headline in headlines {
        assert!(screen.contains(headline["says"].as_str().unwrap()), "{headline}");
    }
    let gain = of("adv_bmt-idm")["mechanism"].as_str().unwrap();
    assert!(gain.contains("cyclist") && screen.contains(gain), "the body that carries the gain is named: {gain}");
    assert!(screen.contains("proposed by the scripted stand-in"));
    // Every held-out scene has a row, and each growth is of one set of scenes.
    for id in ["cat-idm", "at-idm", "adv_bmt-idm"] {
        let lineage = lineage(id);
        assert_eq!(lineage["pairs"].as_array().unwrap().len(), 80, "{id}");
        let areas: Vec<f64> =
            lineage["growth"]["points"].as_array().unwrap().iter().map(|point| point[1].as_f64().unwrap()).collect();
        assert!(areas.windows(2).all(|two| two[0] <= two[1]), "{id}: {areas:?}");
        assert_eq!(lineage["growth"]["scenes"], 60);
    }
}

#[test]
fn the_first_screen_says_what_a_reader_should_weigh() {
    let mut run = quickstart();
    let gained = |run: &RecordedRun| report_data(&page(run, &Stage::default()))[0]["headlines"][0].clone();
    let before = gained(&run);
    assert_eq!((&before["weigh"], &before["lineage"]), (&false.into(), &"adv_bmt-idm".into()));
    assert!(!first_screen(&page(&run, &Stage::default())).contains("Weigh:"));
    // Rams from behind that nobody could have avoided, and one scene of the parent's more.
    let result = run.result.as_ref().unwrap().lineages.iter().find(|of| of.lineage.as_str() == "adv_bmt-idm").unwrap();
    let (chosen, parent) = (result.evolved.solution.clone(), result.parent.solution.clone());
    let lost = |shares: &Value| -> u32 {
        let words = shares.as_str().unwrap().split(" gained, ").nth(1).unwrap();
        words.trim_end_matches(" lost").parse().unwrap()
    };
    let labels = |run: &mut RecordedRun, of: &evodrive::objects::SolutionId, scene: usize| {
        let held_out = run.held_out.iter_mut().find(|held_out| held_out.solution == *of).unwrap();
        held_out.score.scenes[scene].attack = 1.0;
    };
    let attacks = |run: &RecordedRun, of: &evodrive::objects::SolutionId| -> Vec<bool> {
        let held_out = run.held_out.iter().find(|held_out| held_out.solution == *of).unwrap();
        held_out.score.scenes.iter().map(|label| label.attack > 0.0).collect()
    };
    let nobody = attacks(&run, &chosen).into_iter().zip(attacks(&run, &parent)).position(|of| of == (false, false));
    labels(&mut run, &parent, nobody.unwrap());
    let held_out = run.held_out.iter_mut().find(|held_out| held_out.solution == chosen).unwrap();
    for met in held_out.score.scenes.iter_mut().filter_map(|label| label.contact.as_mut()) {
        (met.class, met.avoidable) = ("rear_end_ego_struck".into(), Some(false));
    }
    let after = gained(&run);
    assert_eq!(after["weigh"], true);
    let says = after["contacts_say"].as_str().unwrap();
    assert!(says.starts_with("Only 0 % of its contacts are preventable (its parent's: "), "{says}");
    assert!(says.ends_with("; 100 % are rams from behind."), "{says}");
    assert_eq!(lost(&after["shares"]), lost(&before["shares"]) + 1);
    let page = page(&run, &Stage::default());
    assert!(
        first_screen(&page).contains("</b> 100 % of the contacts that count are not preventable in 1 of 3 lines"),
        "{}",
        first_screen(&page)
    );
    // One of them avoidable: as a ram from behind it is not preventable, else the share moves with it.
    let mut made_avoidable = |class: &str| {
        let held_out = run.held_out.iter_mut().find(|held_out| held_out.solution == chosen).unwrap();
        let counting = held_out.score.scenes.iter_mut().filter(|label| label.attack > 0.0);
        let met = counting.filter_map(|label| label.contact.as_mut()).next().unwrap();
        (met.class, met.avoidable) = (class.into(), Some(true));
        gained(&run)["preventable"].clone()
    };
    assert_eq!(made_avoidable("rear_end_ego_struck")[0], 0);
    let of = made_avoidable("head_on");
    let share = format!("{:.0} % of the contacts that count", 100.0 * (1.0 - 1.0 / of[1].as_f64().unwrap()));
    assert_eq!(of[0], 1);
    assert!(first_screen(&self::page(&run, &Stage::default())).contains(&share), "{share}");
    // Each chosen program whose realism is below the rule's is counted.
    assert!(first_screen(&page).contains("falls short of the rule's 0.95"));
    for of in &mut run.result.as_mut().unwrap().lineages {
        of.evolved.objectives.realism = 0.96;
    }
    assert!(!first_screen(&self::page(&run, &Stage::default())).contains("short of the rule"));
}

#[test]
fn what_happens_in_the_scenes_gained_is_said_of_those_that_were_gained() {
    let report = std::fs::read_to_string(finished().1.join("report.html")).unwrap();
    let line = first_screen(&report).split("<li class=").find(|line| line.contains("adv_bmt-idm")).expect("a line");
    let number = |before: &str, after: &str| -> usize {
        let ends =
            line.match_indices(after).find_map(|(at, _)| line[..at].rsplit_once(before)).map(|(_, number)| number);
        ends.and_then(|number| number.trim().parse().ok()).unwrap_or_else(|| panic!("{before} … {after}: {line}"))
    };
    let gained = number("%): ", " scenes gained");
    assert_eq!(number("In the ", " scenes gained the ego m"), gained, "{line}");
    assert!(line.contains(" s before the contact (medians)."), "{line}");
    // Without rollouts nobody knows.
    assert!(!first_screen(&page(&quickstart(), &Stage::default())).contains(" scenes gained the ego "));
}

#[test]
fn searches_of_one_lineage_are_one_line_with_their_range_and_how_many_fall_short() {
    let mut run = quickstart();
    let lineages = &mut run.result.as_mut().unwrap().lineages;
    for (of, (attack, realism)) in lineages.iter_mut().zip([(0.1, 0.99), (0.4, 0.90), (0.2, 0.94)]) {
        of.group = evodrive::objects::LineageId::new("one");
        of.parent.objectives.attack = 0.15;
        (of.evolved.objectives.attack, of.evolved.objectives.realism) = (attack, realism);
    }
    let best = lineages[1].lineage.to_string();
    let page = page(&run, &Stage::default());
    let (screen, data) = (first_screen(&page), report_data(&page));
    let headlines = data[0]["headlines"].as_array().unwrap();
    assert_eq!((headlines.len(), &headlines[0]["lineage"]), (1, &best.as_str().into()));
    let says = headlines[0]["says"].as_str().unwrap();
    assert!(says.contains("mean of 3 searches (single ones: attack −0.050 to +0.250"), "{says}");
    assert!(screen.contains("2 of 3 chosen programs fall short") && screen.contains("on these scenes, this one too."));
    // Steps are drawn of the search that is shown, not of the first ones.
    let titles: Vec<&str> = data[2].as_array().unwrap().iter().map(|of| of["title"].as_str().unwrap()).collect();
    let steps: Vec<&&str> = titles.iter().filter(|title| title.starts_with("Evolution of ")).collect();
    assert!(matches!(steps[..], [one] if one.starts_with("Evolution of AT (")), "{titles:?}");
}

#[test]
fn names_from_outside_stand_on_the_first_screen_as_text() {
    let mut run = quickstart();
    run.opened.name = "<img src=x onerror=alert(1)>".into();
    run.opened.models.insert("actor".into(), "chat <script>".into());
    let page = page(&run, &Stage::default());
    let screen = first_screen(&page);
    assert!(screen.contains("&lt;img src=x") && !screen.contains("<img"), "the name");
    assert!(screen.contains("chat &lt;script&gt;") && !screen.contains("chat <script>"), "the model");
}

#[test]
fn a_badge_says_no_more_than_what_was_looked_at() {
    let mut run = quickstart();
    let badges = |run: &RecordedRun, same: &[Option<bool>]| -> Vec<(String, String)> {
        let rollout = |as_recorded: &Option<bool>| Playable {
            solution: "cat-idm/parent".into(),
            role: "parent".into(),
            scene: "synth/merge/7/4".into(),
            changed: vec![],
            contact: None,
            caption: String::new(),
            as_recorded: *as_recorded,
        };
        let stage = Stage { rollouts: same.iter().map(rollout).collect(), ..Stage::default() };
        let badges = report_data(&page(run, &stage))[0]["badges"].as_array().unwrap().clone();
        let text = |of: &Value| of.as_str().unwrap().to_string();
        badges.iter().map(|badge| (text(&badge["standing"]), text(&badge["says"]))).collect()
    };
    let of = |all: &[(String, String)], what: &str| all.iter().find(|(_, says)| says.contains(what)).unwrap().0.clone();
    assert_eq!(of(&badges(&run, &[]), "no rollout simulated again"), "unknown");
    assert_eq!(
        of(&badges(&run, &[Some(true), None]), "1 rollout shown here simulated again, equal"),
        "holds",
        "the replay has no label"
    );
    assert_eq!(of(&badges(&run, &[Some(true), Some(false)]), "1 of 2 rollouts shown here differ"), "against");
    assert_eq!(of(&badges(&run, &[]), "signature"), "unknown");
    assert_eq!(of(&badges(&run, &[]), "audit: no findings"), "holds");
    run.held_out.remove(0);
    assert_eq!(of(&badges(&run, &[]), "audit: "), "against", "a result without its labels");
    run.result = None;
    assert_eq!(of(&badges(&run, &[]), "not finished"), "note");
    assert!(first_screen(&page(&run, &Stage::default())).contains("The run is not finished"));
}

/// A page of ten thousand whole stories has forty megabytes, so only the accepted attempts of a large run are told in full. None is left
/// out, and the charts draw the same of each.
#[test]
fn attempts_of_a_large_run_are_told_in_short_but_for_the_accepted_ones() {
    let mut run = quickstart();
    let whole = attempts(&run);
    assert_eq!(whole.len(), run.attempts.len());
    assert!(whole.iter().all(|attempt| attempt.get("in_short").is_none()), "a small run is told whole");
    let accepted: Vec<bool> =
        run.attempts.iter().map(|a| a.exit.decision().is_some_and(|decision| decision.gates.any())).collect();
    assert!(accepted.contains(&true) && accepted.contains(&false), "the run has both");

    let copies = 1_000 / whole.len() + 1;
    run.attempts = std::iter::repeat_n(run.attempts.clone(), copies).flatten().collect();
    let large = attempts(&run);
    assert_eq!(large.len(), run.attempts.len());
    for (at, attempt) in large.iter().enumerate() {
        let before = &whole[at % whole.len()];
        if accepted[at % whole.len()] {
            assert_eq!(attempt, before);
            continue;
        }
        assert_eq!(attempt["in_short"], true, "{}", attempt["id"]);
        assert!(attempt.get("reviews").is_none() && attempt.get("exchanges").is_none(), "{}", attempt["id"]);
        for field in ["id", "lineage", "epoch", "slot", "parent", "exit", "solution", "objectives"] {
            assert_eq!(attempt.get(field), before.get(field), "{field}");
        }
    }
}
