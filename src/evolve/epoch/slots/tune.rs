//! A numeric search sets the constants that a patch leaves free (`[search.tuning]`), before the child competes: structure by who
//! proposes, numbers by search. Successive halving: settings are drawn, half of them near the patch's own; all are labelled in a few
//! scenes, the better half in twice as many, until one is left.
//!
//! The scenes are evolution scenes outside all windows so far, as long as there are enough: a child that was chosen on the scenes that
//! judge it would look better than it is. A setting is better by the rule of reporting: whoever keeps the floor of realism, or its
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
        let all = self.outside(&snapshot.so_far).or_else(|| self.outside(&snapshot.window));
        let mut scenes = all.unwrap_or_else(|| study.evolution.clone());
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

    /// Evolution scenes that are none of these; `None` where they are fewer than the first look takes.
    fn outside(&self, places: &[usize]) -> Option<Vec<usize>> {
        let others: Vec<usize> = self.study.evolution.iter().filter(|place| !places.contains(place)).copied().collect();
        (others.len() >= self.options.scenes).then_some(others)
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
                Ok(Some(score.objectives))
            }
            // What no scene can label is found, and said, where it is labelled on the window.
            Err(RunError::Evaluation(EvaluationError::NoLabel(_))) => Ok(None),
            Err(error) => Err(error),
        };
        let before = labelled(labelling.score(parent.hashed(), places))?;
        let floor = before.map_or(0.0, |before| before.realism).min(study.selector.realism_min);
        let mut shown: Vec<(usize, Objectives)> = Vec::new();
        for at in left {
            let Some(child) = settings[at].candidate() else { continue };
            if let Some(objectives) = labelled(labelling.score(child.hashed(), places))? {
                settings[at].looks.push(objectives);
                shown.push((at, objectives));
            }
        }
        // Of those that stand alike the earlier one: the sort is stable.
        shown.sort_by(|(_, a), (_, b)| better(a, b, floor));
        shown.truncate(shown.len().div_ceil(2));
        Ok(shown.into_iter().map(|(at, _)| at).collect())
    }
}

/// Orders the better one first, by the rule of reporting.
fn better(a: &Objectives, b: &Objectives, floor: f64) -> Ordering {
    let key =
        |of: &Objectives| if of.realism >= floor { [1.0, of.attack, of.realism] } else { [0.0, of.realism, of.attack] };
    let (a, b) = (key(a), key(b));
    b.iter().zip(&a).map(|(b, a)| b.total_cmp(a)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_keeps_the_floor_comes_first_then_more_attack_then_more_realism() {
        let of = |attack, realism| Objectives { attack, realism };
        let mut all = [of(0.9, 0.90), of(0.2, 0.96), of(0.4, 0.95), of(0.4, 0.99), of(0.1, 0.94)];
        all.sort_by(|a, b| better(a, b, 0.95));
        assert_eq!(all, [of(0.4, 0.99), of(0.4, 0.95), of(0.2, 0.96), of(0.1, 0.94), of(0.9, 0.90)]);
    }
}
