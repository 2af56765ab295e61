//! A numeric search sets the constants that a patch leaves free (`[search.tuning]`), before the child competes: structure by who
//! proposes, numbers by search. Successive halving: settings are drawn, half of them near the patch's own; all are labelled in a few
//! scenes, the better half in twice as many, until one is left.
//!
//! The scenes are evolution scenes outside all windows so far, as long as there are enough: a child that was chosen on the scenes that
//! judge it would look better than it is. Whoever acts too rarely to be accepted comes last: where nobody hits, doing nothing would be the
//! most realistic. Then, as in the choice of who is reported but without its tolerance, whoever keeps the floor of realism, or its
//! parent's where that is lower, comes first, then who has more attack.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

use super::admit::{admission, judged};
use super::draft::{Draft, Reached, Verdict};
use crate::archive::search::TuningOptions;
use crate::candidates::{FreeRange, free_ranges};
use crate::epoch::RunError;
use crate::epoch::acceptance::search::{requests, stream};
use crate::epoch::freeze::Snapshot;
use crate::epoch::labelling::labels::Labelling;
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::Study;
use crate::evaluation::EvaluationError;
use crate::kernel::Digest;
use crate::objects::{Candidate, Objectives, Program, ProgramPatch, Score, Tuned, TunedDraw};

/// Sets the free constants of an admitted patch; leaves alone a draft without any.
pub fn tune(study: &Study, snapshot: &Snapshot<'_>, draft: Draft, tools: &Tools<'_>) -> Result<Draft, RunError> {
    let (Some(options), Reached::Admitted { admitted, .. }) = (study.tuning(), &draft.reached) else {
        return Ok(draft);
    };
    if admitted.patch.free.is_empty() {
        return Ok(draft);
    }
    let slot = draft.head.slot;
    let search = Tuning { study, snapshot, slot, options, tools };
    let mut settings = search.drawn(&admitted.patch)?;
    let mut spent = BTreeSet::new();
    let looks = search.looks(settings.len());
    let mut left: Vec<usize> = (0..settings.len()).filter(|&at| settings[at].candidate().is_some()).collect();
    for places in &looks {
        if left.len() < 2 {
            break;
        }
        left = search.better_half(&mut settings, left, places, &mut spent)?;
    }
    let taken = left.first().copied().unwrap_or(0);
    let scenes = looks.iter().map(Vec::len).collect();
    let draws = settings.iter().map(|of| TunedDraw { values: of.values.clone(), looks: of.looks.clone() }).collect();
    let Setting { patch, verdict, .. } = settings.swap_remove(taken);
    let mut head = draft.head;
    head.proposal.tuned = Some(Box::new(Tuned { patch: patch.clone(), scenes, draws, taken, rollouts: spent.len() }));
    head.tuning = spent;
    Ok(Draft { head, reached: judged(Box::new(patch), verdict) })
}

/// Values of the free constants, and what is known of the child that has them.
struct Setting {
    values: BTreeMap<String, f64>,
    patch: ProgramPatch,
    verdict: Verdict,
    looks: Vec<Objectives>,
}

impl Setting {
    /// The child; `None` where a gate refuses it.
    fn candidate(&self) -> Option<&Candidate> {
        self.verdict.admission.candidate.as_ref()
    }
}

struct Tuning<'t> {
    study: &'t Study,
    snapshot: &'t Snapshot<'t>,
    slot: u32,
    options: TuningOptions,
    tools: &'t Tools<'t>,
}

impl Tuning<'_> {
    /// Draws the settings, the patch's own first. Each is judged by all gates; what two have in common is tried once.
    fn drawn(&self, patch: &ProgramPatch) -> Result<Vec<Setting>, RunError> {
        let Tuning { study, snapshot, slot, options, tools } = *self;
        let contract = &study.source(snapshot.spec)?.contract;
        let ranges = free_ranges(&snapshot.parent_of(slot).program, patch, contract).unwrap_or_default();
        let mut stream = stream(study, snapshot.spec, snapshot.event.epoch, slot, "tune");
        let mut settings: Vec<Setting> = Vec::new();
        for draw in 0..options.draws {
            let value = |range: &FreeRange, stream: &mut _| match draw {
                0 => range.start,
                _ => range.draw(draw % 2 == 1, stream),
            };
            let values: BTreeMap<String, f64> =
                ranges.iter().map(|(name, range)| (name.clone(), value(range, &mut stream))).collect();
            if settings.iter().any(|other| other.values == values) {
                continue;
            }
            let patch = patch.bound(&values);
            let verdict = admission(study, snapshot, slot, &patch, tools)?;
            settings.push(Setting { values, patch, verdict, looks: Vec::new() });
        }
        Ok(settings)
    }

    /// The scenes of each look. They end with the scenes, and with what a declared budget of rollouts leaves to a slot.
    fn looks(&self, settings: usize) -> Vec<Vec<usize>> {
        let Tuning { study, snapshot, options, .. } = *self;
        let mut scenes = others(&study.evolution, [&snapshot.so_far, &snapshot.window], options.scenes);
        let epoch = snapshot.event.epoch;
        // All slots look at the same scenes, so the parent is labelled there once.
        stream(study, snapshot.spec, epoch, 0, "tuning scenes").shuffle(&mut scenes);
        let budget = study.search.as_ref().and_then(|search| search.rollouts);
        let allowed =
            budget.map(|budget| budget.saturating_sub(snapshot.spent.len()) / study.budget.slots.max(1) as usize);
        let (mut looks, mut left, mut many, mut cost) = (Vec::new(), settings, options.scenes, 0);
        while left > 1 {
            let many_here = many.min(scenes.len());
            // The parent is in each look, too. A child needs rollouts in its window yet.
            cost += (left + 1) * many_here;
            if allowed.is_some_and(|allowed| cost + snapshot.window.len() > allowed) {
                break;
            }
            looks.push(scenes[..many_here].to_vec());
            if many_here == scenes.len() {
                break;
            }
            (left, many) = (left.div_ceil(2), 2 * many);
        }
        looks
    }

    /// Labels settings in these scenes and keeps the better half of them, the best first.
    fn better_half(
        &self,
        settings: &mut [Setting],
        left: Vec<usize>,
        places: &[usize],
        spent: &mut BTreeSet<Digest>,
    ) -> Result<Vec<usize>, RunError> {
        let Tuning { study, snapshot, slot, tools, .. } = *self;
        let labelling = Labelling { study, spec: snapshot.spec, counsels: &snapshot.counsels, tools };
        let parent = snapshot.parent_of(slot);
        let children = left.iter().filter_map(|&at| settings[at].candidate()).map(|child| &child.program);
        labelling.ahead(&children.chain([&parent.program]).collect::<Vec<&Program>>(), places)?;
        let mut labelled = |score: Result<Score, RunError>| match score {
            Ok(score) => {
                spent.extend(requests(&score));
                Ok(Some(Shown { objectives: score.objectives, coverage: score.coverage }))
            }
            // What no scene can label is found, and said, where it is labelled on the window.
            Err(RunError::Evaluation(EvaluationError::NoLabel(_))) => Ok(None),
            Err(error) => Err(error),
        };
        let before = labelled(labelling.score(parent.hashed(), places))?;
        let before = before.unwrap_or(Shown { objectives: Objectives { attack: 0.0, realism: 0.0 }, coverage: 0.0 });
        let floors = Floors {
            realism: before.objectives.realism.min(study.selector.realism_min),
            coverage: study.archive.coverage_floor * before.coverage,
        };
        let mut shown: Vec<(usize, Shown)> = Vec::new();
        for at in left {
            let Some(child) = settings[at].candidate() else { continue };
            if let Some(of) = labelled(labelling.score(child.hashed(), places))? {
                settings[at].looks.push(of.objectives);
                shown.push((at, of));
            }
        }
        // Of those that stand alike the earlier one: the sort is stable.
        shown.sort_by(|(_, a), (_, b)| better(a, b, &floors));
        shown.truncate(shown.len().div_ceil(2));
        Ok(shown.into_iter().map(|(at, _)| at).collect())
    }
}

/// Evolution scenes that are none of the first of these, or where that leaves fewer than the first look takes, none of the second; all of
/// them where that does, too.
fn others(evolution: &[usize], judging: [&[usize]; 2], least: usize) -> Vec<usize> {
    let outside = |places: &[usize]| evolution.iter().filter(|place| !places.contains(place)).copied().collect();
    let enough = |scenes: &Vec<usize>| scenes.len() >= least;
    judging.into_iter().map(outside).find(enough).unwrap_or_else(|| evolution.to_vec())
}

/// Labels of a setting at a look.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Shown {
    objectives: Objectives,
    coverage: f64,
}

/// Least values of a setting that is to be preferred.
struct Floors {
    realism: f64,
    coverage: f64,
}

/// Orders the better one first.
fn better(a: &Shown, b: &Shown, floors: &Floors) -> Ordering {
    let key = |of: &Shown| {
        let Objectives { attack, realism } = of.objectives;
        let acts = f64::from(u8::from(of.coverage > 0.0 && of.coverage >= floors.coverage));
        if realism >= floors.realism { [acts, 1.0, attack, realism] } else { [acts, 0.0, realism, attack] }
    };
    let (a, b) = (key(a), key(b));
    b.iter().zip(&a).map(|(b, a)| b.total_cmp(a)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scenes_that_choose_numbers_are_none_of_those_that_judge_as_long_as_there_are_enough() {
        let all: Vec<usize> = (10..20).collect();
        let (so_far, window) = (&all[..6], &all[4..6]);
        assert_eq!(others(&all, [so_far, window], 4), all[6..]);
        assert_eq!(others(&all, [so_far, window], 5), [&all[..4], &all[6..]].concat());
        assert_eq!(others(&all, [so_far, window], 9), all);
    }

    #[test]
    fn whoever_keeps_the_floor_comes_first_then_more_attack_then_more_realism() {
        let of = |attack, realism| Shown { objectives: Objectives { attack, realism }, coverage: 0.8 };
        let floors = Floors { realism: 0.95, coverage: 0.8 };
        let mut all = [of(0.9, 0.90), of(0.2, 0.96), of(0.4, 0.95), of(0.4, 0.99), of(0.1, 0.94)];
        all.sort_by(|a, b| better(a, b, &floors));
        assert_eq!(all, [of(0.4, 0.99), of(0.4, 0.95), of(0.2, 0.96), of(0.1, 0.94), of(0.9, 0.90)]);
    }

    #[test]
    fn a_setting_that_does_nothing_or_acts_too_rarely_comes_last_however_realistic_it_is() {
        let of = |attack, realism, coverage| Shown { objectives: Objectives { attack, realism }, coverage };
        let (acts, rarely, nothing) = (of(0.0, 0.96, 0.9), of(0.3, 0.99, 0.4), of(0.0, 1.0, 0.0));
        let least = |all: &mut [Shown], coverage| {
            all.sort_by(|a, b| better(a, b, &Floors { realism: 0.95, coverage }));
            *all.last().unwrap()
        };
        assert_eq!(least(&mut [nothing, acts], 0.8), nothing);
        assert_eq!(least(&mut [rarely, acts], 0.8), rarely);
        // Nor where the parent acts nowhere itself.
        assert_eq!(least(&mut [nothing, acts], 0.0), nothing);
    }
}
