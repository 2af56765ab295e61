use super::{figure, page, table};
use crate::kernel::Digest;
use crate::objects::downstream::{
    Downstream, Examination, FORMAT, FixedSet, FixedSets, Opening, Reference, SetDriven, SetName, Trained,
};

const SCENES: usize = 40;

/// A record in which arm `none` crashes in every second adversarial scene, and `evolved` in `crashes` of the `SCENES`.
fn record(crashes: usize) -> Downstream {
    let digest = Digest::of_bytes(b"set");
    let scenes: Vec<String> = (0..SCENES).map(|i| format!("scene-{i}")).collect();
    let set = |name| FixedSet { name, digest, scenes: scenes.clone(), groups: vec![] };
    let all = [SetName::Plain, SetName::Original, SetName::Evolved];
    let arms = vec![("none".to_string(), vec![SetName::Plain]), ("evolved".to_string(), vec![SetName::Evolved])];
    let opening = Opening {
        format: FORMAT.into(),
        name: "made".into(),
        describes: "A made study".into(),
        recipe: digest,
        program: digest,
        generator: "g".into(),
        proposals: "scripted".into(),
        sets: FixedSets { training: all.map(set).to_vec(), evaluation: all.map(set).to_vec() },
        arms,
        seeds: vec![1, 2],
        updates: 20,
        plain_updates: 0,
        families: vec![],
        references: vec![],
    };
    let driven = |set, crashes: usize| SetDriven {
        set,
        ends: (0..SCENES).map(|i| if i * crashes % SCENES < crashes { 'c' } else { 'a' }).collect(),
        completion: vec![0.5; SCENES],
        score: vec![],
    };
    let examined = |updates, adversarial: usize| Examination {
        updates,
        steps: 4 * updates,
        sets: vec![
            driven(SetName::Plain, 0),
            driven(SetName::Original, adversarial),
            driven(SetName::Evolved, adversarial),
        ],
    };
    let trained = |arm: &str, seed, crashes| Trained {
        family: None,
        arm: arm.into(),
        seed,
        weights: digest,
        examinations: vec![examined(10, SCENES), examined(20, crashes)],
    };
    let of_arms = [("none", SCENES / 2), ("evolved", crashes)];
    let trainings = of_arms.iter().flat_map(|(arm, crashes)| [1, 2].map(|seed| trained(arm, seed, *crashes))).collect();
    Downstream { opening, trainings }
}

#[test]
fn an_arm_that_crashes_in_fewer_scenes_is_said_to() {
    let tabled = table(&record(5));
    let rows: Vec<(&str, f64, f64)> = tabled
        .rows()
        .map(|row| {
            let value = |key: &str| row.cell(key).ours.unwrap().value;
            (row.labels[0].as_str(), value("crash_adversarial"), value("crash_plain"))
        })
        .collect();
    assert_eq!(rows, [("none", 0.5, 0.0), ("evolved", 0.125, 0.0), ("evolved less none", -0.375, 0.0)]);
    let [low, high] = tabled.rows().last().unwrap().cell("crash_adversarial").ours.unwrap().interval.unwrap();
    assert!(low < -0.375 && -0.375 < high && high < 0.0, "{low} {high}");
    assert!(
        tabled
            .notes
            .iter()
            .any(|note| note.starts_with("evolved against none: crashes less and way undecided in adversarial scenes"))
    );
}

/// The pairing decides: the same arm under another name is no better, and a worse one is told as worse.
#[test]
fn a_toy_arm_wins_nothing() {
    let note = |crashes: usize| table(&record(crashes)).notes.last().unwrap().clone();
    assert!(note(SCENES / 2).starts_with("evolved against none: crashes undecided"), "{}", note(SCENES / 2));
    assert!(note(SCENES).starts_with("evolved against none: crashes more"), "{}", note(SCENES));
}

#[test]
fn the_figure_has_a_curve_an_arm_and_panel() {
    let drawn = figure(&record(5));
    let curves = drawn.shapes.iter().filter(|shape| matches!(shape, crate::draw::Shape::Path(points, ink) if points.len() == 2 && ink.stroke.is_some_and(|(_, width)| width == 1.2)));
    assert_eq!(curves.count(), 2 * 4);
    assert!(drawn.svg().contains("Crash rate") && drawn.svg().contains("A made study"));
}

/// Text of a file may not become markup, and every cell of the table stands in the page.
#[test]
fn the_page_has_figure_table_digests_and_no_markup_of_a_file() {
    let mut made = record(5);
    made.opening.describes = "</title><script>x</script>".into();
    made.opening.arms[1].0 = "<b>evolved".into();
    made.trainings.iter_mut().filter(|of| of.arm == "evolved").for_each(|of| of.arm = "<b>evolved".into());
    let shown = page(&made);
    assert!(!shown.contains("<script") && !shown.contains("<b>") && shown.contains("&lt;b&gt;evolved less none"));
    assert!(shown.contains(&figure(&made).svg()));
    assert!(
        shown.contains(&made.trainings[0].weights.to_string())
            && shown.contains("<th class=\"group\" colspan=\"3\">Adversarial</th>")
    );
    let columns = table(&made).columns.len();
    let first = shown.split("<tbody>").nth(1).unwrap().split("</tr>").next().unwrap();
    assert_eq!(first.matches("<td").count(), 1 + columns + 3, "{first}");
    for open in ["table", "tbody", "tr>", "figure", "ul"] {
        assert_eq!(shown.matches(&format!("<{open}")).count(), shown.matches(&format!("</{open}")).count(), "{open}");
    }
}

/// An arm that crashes nowhere because it drives nowhere is told so, and the one that stands by design has a row beside it.
#[test]
fn who_stands_is_told_apart_from_who_learned_to_avoid() {
    let mut still = record(1);
    for trained in still.trainings.iter_mut().filter(|trained| trained.arm == "evolved") {
        let driven = trained.examinations.iter_mut().flat_map(|examination| &mut examination.sets);
        driven.for_each(|driven| driven.completion = vec![0.05; SCENES]);
    }
    let standing = |set| SetDriven { set, ends: "h".repeat(SCENES), completion: vec![0.0; SCENES], score: vec![] };
    let sets = [SetName::Plain, SetName::Original, SetName::Evolved].map(standing).to_vec();
    still.opening.references = vec![Reference { driver: "stands still".into(), sets }];
    let tabled = table(&still);
    assert_eq!(
        tabled.notes.last().unwrap(),
        "evolved against none: crashes less and drives less of its route in adversarial scenes; drives less of its route in plain ones."
    );
    let row = tabled.rows().find(|row| row.labels[0] == "stands still").unwrap();
    assert_eq!(row.cell("crash_adversarial").ours.unwrap().value, 0.0);
    assert!(crate::evidence::tables::markdown(&tabled).contains("| stands still | 0.000"));
}

/// The same arms as a study by family: the family in which the evolved arm is better is told apart from the one in which it is not.
#[test]
fn families_are_told_apart_and_their_mean_is_over_them() {
    let (better, same) = (record(5), record(SCENES / 2));
    let families = ["right_turn", "red_light_running"].map(String::from);
    let mut both = better.clone();
    both.opening.families = families.to_vec();
    for set in both.opening.sets.training.iter_mut().chain(&mut both.opening.sets.evaluation) {
        set.scenes = [set.scenes.clone(), set.scenes.iter().map(|scene| format!("{scene}-b")).collect()].concat();
        set.groups = [vec![families[0].clone(); SCENES], vec![families[1].clone(); SCENES]].concat();
    }
    let of = |record: &Downstream, family: &String| -> Vec<Trained> {
        let named = |trained: &Trained| Trained { family: Some(family.clone()), ..trained.clone() };
        record.trainings.iter().map(named).collect()
    };
    both.trainings = [of(&better, &families[0]), of(&same, &families[1])].concat();
    for trained in &mut both.trainings {
        let examined = trained.examinations.iter_mut().flat_map(|examination| &mut examination.sets);
        examined.for_each(|driven| driven.score = vec![0.75; SCENES]);
    }
    let text = both.to_text().unwrap();
    let tabled = table(&Downstream::read(&text).unwrap());
    let row = tabled.rows().find(|row| row.labels[0] == "evolved less none").unwrap();
    let value = |key: &str| row.cell(key).ours.map(|ours| ours.value);
    assert_eq!([value("right_turn"), value("red_light_running")], [Some(-0.375), Some(0.0)]);
    assert_eq!((value("average"), value("lane_changing")), (Some(-0.1875), None));
    let scores = tabled.rows().filter(|row| row.labels[0] == "evolved").nth(1).unwrap();
    assert_eq!(scores.cell("average").ours.unwrap().value, 0.75);
    assert_eq!(scores.cell("average").paper, Some(0.884));
}
