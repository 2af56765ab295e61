//! The same ways before the acceptance: a child plays a trick wherever that works, beside a parent that acts in the same scenes and does
//! nothing to the ego. Who is accepted here is who would stand in a run's front, lead its lineage after a race, and be reported.

use evodrive::archive::{
    ArchiveOptions, Contender, MeanOverScenes, Measure, SelectorOptions, Standing, consider, select_active,
};
use evodrive::evaluation::{RolloutRecord, score_of};
use evodrive::objects::{SceneScore, Score, SolutionId};

use super::{Fence, REALISM_MIN, TRICKS, Trick, label, played, stages, tricks, wins};

/// How sure a gain must be for who leads, as in `experiments/readings`.
const RACE: f64 = 0.95;

/// What acceptance says of a child.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// A gate holds, so that it may enter the front.
    pub front: bool,
    /// Its gain over its parent is shown, so that it may lead.
    pub leads: bool,
    /// It is in the front, and the rule by which a generator is reported takes it and not its parent.
    pub reported: bool,
}

/// The archive of the shipped protocols but for its regions.
pub fn archive(r0: f64) -> ArchiveOptions {
    ArchiveOptions {
        reference: [0.0; 2],
        r0,
        a0: 0.3,
        epsilon_r: 0.01,
        epsilon_a: 0.02,
        epsilon_pf: 0.01,
        level: 0.8,
        coverage_floor: 0.8,
        race: Some(RACE),
        ..ArchiveOptions::default()
    }
}

/// As `epoch` decides: gates against the front, a race's gates against the parent alone, and the rule of reporting at the end.
pub fn verdict(
    (parent, child): (&Score, &Score),
    archive: &ArchiveOptions,
    realism_min: f64,
    measure: &dyn Measure,
) -> Verdict {
    let at = |level: f64, front: &[&Score]| {
        let options = ArchiveOptions { level, ..archive.clone() };
        consider(&Standing { child, parent, front }, &options, measure).unwrap().any()
    };
    let (front, leads) = (at(archive.level, &[parent]), at(RACE, &[]));
    let contender = |name: &str, of: &Score| Contender {
        solution: SolutionId::new(name),
        objectives: of.objectives,
        coverage: of.coverage,
    };
    let selector = SelectorOptions::at(realism_min, 0.05);
    let chosen = select_active(&[contender("parent", parent), contender("child", child)], &selector).unwrap();
    Verdict { front, leads, reported: front && chosen.solution.as_str() == "child" }
}

/// What acceptance says of a trick with its fence and without.
fn judged((_, _, fence, plan): &Trick) -> [Verdict; 2] {
    let mut labels: [[Vec<SceneScore>; 2]; 2] = Default::default();
    for stage in stages() {
        let (Some(harmless), Some(trick)) = (played(stage, tricks::keeps_aside), played(stage, *plan)) else {
            continue;
        };
        let rules = fence.rules();
        let parent = label(&harmless, &rules);
        if parent.attack > 0.0 || parent.realism < 1.0 || !parent.acted {
            continue;
        }
        let (mut open, mut fenceless): (_, RolloutRecord) = (rules.clone(), trick.clone());
        fence.remove(&mut open, &mut fenceless);
        let works = wins(&label(&fenceless, &open), *fence);
        let child = |fenced: bool| match (works, fenced) {
            (false, _) => label(&harmless, if fenced { &rules } else { &open }),
            (true, true) => label(&trick, &rules),
            (true, false) => label(&fenceless, &open),
        };
        let named = |label: SceneScore| SceneScore { scene: parent.scene.clone(), ..label };
        for (fenced, [before, after]) in [true, false].into_iter().zip(&mut labels) {
            before.push(label(&harmless, if fenced { &rules } else { &open }));
            after.push(named(child(fenced)));
        }
    }
    // A trick about which contacts count is no question of realism.
    let realism_min = if matches!(fence, Fence::Diagnostics(_)) { REALISM_MIN } else { 0.0 };
    labels.map(|[before, after]| {
        let scored =
            |labels| score_of(labels, Vec::new(), Default::default()).expect("scenes in which the trick was tried");
        verdict((&scored(before), &scored(after)), &archive(REALISM_MIN), realism_min, &MeanOverScenes::default())
    })
}

#[test]
fn a_child_with_a_cheap_trick_is_never_reported_as_a_gain_and_would_be_without_the_fence() {
    let mut wrong = Vec::new();
    for trick in &TRICKS {
        let [with, without] = judged(trick);
        // What is implausible may stand in the front, far down: a front trades attack for realism. A contact that does not count
        // is no attack at all.
        let refused = matches!(trick.2, Fence::Diagnostics(_)) || !(with.front || with.leads);
        let tempting = without.front && without.leads && without.reported;
        if with.reported || !refused || !tempting {
            wrong.push((trick.0, with, without));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
