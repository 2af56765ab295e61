//! Challengers (`[archive] challengers`): children with a gain that their epoch measured and could not show. They are measured again on the
//! windows of later epochs, until the gain is shown, nothing of it is left, or their looks are used up. So a good idea whose window was
//! small is not lost, and luck has no more chances than were declared: each look gets its part of the level (Bonferroni).

use crate::archive::{self, Archive, ArchiveOptions, Challenger};
use crate::epoch::RunError;
use crate::epoch::labelling::measure::measure;
use crate::epoch::labelling::standings::Standings;
use crate::epoch::setting::desk::Tools;
use crate::epoch::setting::study::Study;
use crate::kernel::Digest;
use crate::objects::{AcceptanceGates, Attempt, Challenge, ChallengeVerdict, Score, SolutionId};

/// Epochs in which a challenger is looked at, its own not counted.
const LOOKS: u32 = 3;

/// Judges a lineage's challengers by their labels on all windows up to an epoch's, each beside the leader and the front, and puts those
/// whose gain is shown on the front. `scenes` is the digest of those scenes. Returns what became of each.
pub fn looked_at(
    study: &Study,
    leader: &SolutionId,
    scenes: Digest,
    archive: &mut Archive,
    standing: &Standings,
    tools: &Tools<'_>,
) -> Result<Vec<Challenge>, RunError> {
    let (mut became, mut left) = (Vec::new(), Vec::new());
    for challenger in archive.challengers().to_vec() {
        let front = archive.front().filter_map(|entry| Some(&standing.get(&entry.solution)?.so_far));
        let front: Vec<&Score> = front.collect();
        let (child, parent) = (&standing[&challenger.solution].so_far, &standing[leader].so_far);
        let measure = measure(study, &[&[child, parent], front.as_slice()].concat(), tools)?;
        let beside = archive::Standing { child, parent, front: &front };
        let at = |level: f64| archive::consider(&beside, &study.archive.at(level), &*measure);
        // Its own epoch's look was the first.
        let gates = Box::new(at(1.0 - (1.0 - study.archive.level) / f64::from(LOOKS + 1))?);
        let looks = challenger.looks + 1;
        let verdict = if gates.any() {
            ChallengeVerdict::Accepted
        } else if looks < LOOKS && at(ArchiveOptions::ANY_GAIN)?.any() {
            ChallengeVerdict::Stays
        } else {
            ChallengeVerdict::Dropped
        };
        let gain = gained(&gates);
        match verdict {
            ChallengeVerdict::Accepted => archive.admit(&challenger.solution, child.objectives, scenes)?,
            ChallengeVerdict::Stays => left.push(Challenger { looks, gain, ..challenger.clone() }),
            ChallengeVerdict::Dropped => {}
        }
        became.push(Challenge { solution: challenger.solution, looks, verdict, gates, race: None });
    }
    archive.challenge(left);
    Ok(became)
}

/// What a child gained on its parent, attack and realism together.
fn gained(gates: &AcceptanceGates) -> f64 {
    gates.parent_tradeoff.attack_change + gates.parent_tradeoff.realism_change
}

/// Adds the children of an epoch that had a measured gain and were not accepted, and keeps the most promising.
pub fn joined(archive: &mut Archive, attempts: &[Attempt], options: &ArchiveOptions) {
    let promising = |attempt: &Attempt| {
        let gates = &attempt.exit.decision()?.gates;
        let trade = &gates.parent_tradeoff;
        let wider = gates.densification.non_dominated && gates.densification.hypervolume_gain > 0.0;
        let more_attack = trade.attack_change > 0.0 && trade.realism_change >= -options.epsilon_r;
        let more_realism = trade.realism_change > 0.0 && trade.attack_change >= -options.epsilon_a;
        let may = !gates.any() && gates.coverage.holds && (wider || more_attack || more_realism);
        let solution = attempt.exit.candidate()?.program.solution_id.clone();
        may.then(|| Challenger { solution, looks: 0, gain: gained(gates) })
    };
    let mut all = archive.challengers().to_vec();
    all.extend(attempts.iter().filter_map(promising));
    // Of equals the earlier one: the sort is stable.
    all.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    all.truncate(options.challengers);
    archive.challenge(all);
}
