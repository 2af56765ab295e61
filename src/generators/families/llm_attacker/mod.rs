//! LLM-Attacker (Mei et al. 2025): who attacks is searched with feedback. A few vehicles are proposed, each is given CAT's
//! trajectory, the attack is tried against the driver, and what went wrong decides who attacks how in the next round.
//!
//! The paper's agents propose the attackers of a scene, reflect on what became of them and modify the set; their texts and
//! code are not public. So they do here, before any program of a lineage meets the scene: a model is shown the vehicles
//! and answers with attackers, the parent program carries them out with no search of its own (`counsel`), and the model
//! is told why the attack failed and answers again. What worked best is the scene's counsel: recorded, and from then
//! on an input of every compilation for that scene. `counsel_weight` says how far a program trusts it, from 0 for not
//! at all, and the program's own expressions may read who was advised (`counsel_rank`), so both can be evolved.
//! Compiling stays pure: within it, proposal, reflection and modification are rules (`deliberation`) that begin with the
//! advised set and go on by themselves, and that stand alone where nobody gave counsel.

pub mod contract;
pub mod counsel;
pub mod deliberation;
mod promise;
pub mod reflection;
mod words;

pub use contract::family;

use self::promise::{known, promise, weights};
use self::words::{COUNSEL_WEIGHT, PRIOR};
use super::prior;
use crate::scene::TrackIx;
use crate::stage::actors::ActorFacts;
use crate::stage::{AskCounsel, Asks, Part, Settings, Source, Stage, StageError};

pub use deliberation::search;
pub use words::{ATTACKER_POOL, ATTACKER_PRIOR, COUNSEL_RANK, DELIBERATION, NAME};

const SEARCH_IN_WORDS: &str = "The search plays up to 4 attacks of up to 3 vehicles (`pool_size`) with 32 trajectories each, scored as \
     log prior plus log contact (-5 to -1.5; below -1000 without): the leader's best, then, by why it failed, \
     another trajectory or vehicle. The first contact, else the nearest, gets +10000, so no temperature \
     matters. `attack_score` (added or replacing) orders a vehicle's own trajectories; `attacker_score` \
     (pool's own: -0.5 to 2.5) orders vehicles, a place counting 0.5 against 2 for reach and `counsel_weight` \
     4. A `reshape` before the search is played; behind it, the changed motion is untried. Example: \
     `attack_score` `if(struck_by_ego, 2, 0)` tries those first.";

/// The family as it is registered: what it declares, and the code that carries it out.
pub fn source() -> Source {
    let counsel = AskCounsel {
        blind: counsel::blind,
        attackers_max: counsel::attackers_max,
        vehicles: counsel::vehicles,
        trial: |situation, outcome, way| counsel::trial(situation, outcome, way),
    };
    let asks = Asks { counsel: Some(counsel), ..Asks::default() };
    Source {
        asks,
        ..Source::new(family(), SEARCH_IN_WORDS)
            .actor(ATTACKER_POOL, pool)
            .operator(ATTACKER_PRIOR, motion)
            .operator(DELIBERATION, search)
    }
}

/// Vehicles by the first proposal's score (all of it but whether they can reach the ego, which only candidates tell).
pub fn pool(stage: &Stage<'_>, settings: &Settings) -> Result<Vec<TrackIx>, StageError> {
    let size = settings.count("pool_size")?;
    let weights = weights(settings)?;
    let trust = settings.number(COUNSEL_WEIGHT)?;
    let replaces = settings.word("combine")? == "replace";
    let rank_of = |track: TrackIx| stage.counsel.and_then(|counsel| counsel.rank(track)).unwrap_or(0) as f64;
    let readable = |(track, facts): (TrackIx, &ActorFacts)| [&facts.values[..], &[rank_of(track)]].concat();
    let score = |(track, facts): (TrackIx, &ActorFacts)| {
        let own = settings.optional("score").map(|module| module.number(readable((track, facts))));
        let promised = match own {
            Some(own) if replaces => own,
            Some(own) => own + promise(facts, &weights),
            None => promise(facts, &weights),
        };
        promised + if rank_of(track) > 0.0 { trust } else { 0.0 }
    };
    let guard = settings.optional("guard");
    let admitted = known(stage).filter(|vehicle| guard.is_none_or(|guard| guard.boolean(readable(*vehicle))));
    let mut ranked: Vec<(TrackIx, f64)> = admitted.map(|vehicle| (vehicle.0, score(vehicle))).collect();
    ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
    ranked.truncate(size.max(1));
    Ok(ranked.into_iter().map(|(track, _)| track).collect())
}

/// Candidates of the lane-graph prior for every vehicle of the pool.
pub fn motion(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    prior::propose(stage, &prior::options(settings, PRIOR)?, parts);
    Ok(())
}

#[cfg(test)]
mod tests;
