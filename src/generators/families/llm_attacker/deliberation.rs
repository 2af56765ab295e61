//! Propose, evaluate, reflect: sets of attackers with a candidate each, tried against the driver.

use std::collections::BTreeSet;

use super::reflection::{Evaluation, evaluate, mean_speed_mps, timing};
use super::words::COUNSEL_WEIGHT;
use crate::motion::Candidate;
use crate::objects::Counsel;
use crate::objects::counsel::Failure;
use crate::scene::TrackIx;
use crate::search::posterior;
use crate::sim::{self, Action, Intervention};
use crate::stage::judged::Judged;
use crate::stage::{Part, Settings, Situation, Stage, StageError};

/// Steps by which the ego may be early or late when it is asked whether an attacker can reach it at all (1 s).
const REACH_STEPS: usize = 10;
/// Another way is one this far from the failed one on the mean, metres.
const OTHER_WAY_M: f64 = 2.0;
/// Raises the candidate that was found to work above all others of its attacker.
const CHOSEN: f64 = 1e4;

/// Attackers with the candidate that each of them drives: places in `parts` and in their candidates.
type Attack = Vec<(usize, usize)>;

/// Settings of the search.
struct Rules {
    attackers: usize,
    rounds: usize,
    discount: f64,
    reach_weight: f64,
    /// Weight of being advised.
    trust: f64,
    replaces: bool,
}

/// Leaves the attackers of the best attack with their candidate on top; the others lose their candidates.
pub fn search(stage: &Stage<'_>, settings: &Settings, parts: &mut [Part]) -> Result<(), StageError> {
    let rules = Rules {
        attackers: settings.count("attacker_count")?.max(1),
        rounds: settings.count("reflection_rounds")?,
        discount: settings.number("attack_discount")?,
        reach_weight: settings.number("reach_weight")?,
        trust: settings.number(COUNSEL_WEIGHT)?,
        replaces: settings.word("combine")? == "replace",
    };
    let counsel = stage.counsel.filter(|_| rules.trust > 0.0);
    let order = propose(stage, settings, &rules, counsel, parts);
    let attack = deliberate(stage.situation, &rules, parts, &order, first(&rules, counsel, parts, &order));
    for (place, part) in parts.iter_mut().enumerate() {
        match attack.iter().find(|(attacker, _)| *attacker == place) {
            Some((_, chosen)) => part.candidates[*chosen].score += CHOSEN,
            None => part.candidates.clear(),
        }
    }
    Ok(())
}

/// Scores every candidate by CAT's posterior and orders the pool: its own order, with those first that can reach the ego or
/// are advised.
fn propose(
    stage: &Stage<'_>,
    settings: &Settings,
    rules: &Rules,
    counsel: Option<&Counsel>,
    parts: &mut [Part],
) -> Vec<usize> {
    let adversaries: Vec<usize> = parts.iter().map(|part| part.actor).collect();
    let mut ranks: Vec<(usize, f64)> = Vec::with_capacity(parts.len());
    for (place, part) in parts.iter_mut().enumerate() {
        let from_step = part.window.from_step;
        let candidates = &mut part.candidates;
        let reaches = reaches(stage.situation, part.actor, from_step, rules.discount, candidates);
        posterior::score(stage.situation, part.actor, from_step, rules.discount, 0, candidates);
        let judged = Judged { situation: stage.situation, actor: part.actor, from_step, adversaries: &adversaries };
        if let Some(module) = settings.optional("score") {
            for candidate in candidates {
                let own = module.of_candidate(candidate, &judged);
                candidate.score = if rules.replaces { own } else { candidate.score + own };
            }
        }
        let advised = counsel.is_some_and(|counsel| counsel.rank(part.actor).is_some());
        // The pool comes in order of promise: a place is worth as much as the smallest of its weights.
        let worth = |holds: bool, weight: f64| if holds { weight } else { 0.0 };
        ranks.push((place, worth(reaches, rules.reach_weight) + worth(advised, rules.trust) - 0.5 * place as f64));
    }
    ranks.sort_by(|a, b| b.1.total_cmp(&a.1));
    ranks.into_iter().map(|(place, _)| place).collect()
}

/// Returns `true` if an actor can meet the ego's rollout at all, up to a second earlier or later. The scores that it leaves mean no more.
pub(super) fn reaches(
    situation: &Situation,
    actor: TrackIx,
    from_step: usize,
    discount: f64,
    candidates: &mut [Candidate],
) -> bool {
    posterior::score(situation, actor, from_step, discount, REACH_STEPS, candidates);
    candidates.iter().any(|c| c.score > posterior::NO_CONTACT)
}

/// The first proposal: the first of the order; if it is advised, all that are advised, in the counsel's order.
fn first(rules: &Rules, counsel: Option<&Counsel>, parts: &[Part], order: &[usize]) -> Attack {
    let on_its_best = |place: usize| Some((place, best(&parts[place])?));
    let Some(leader) = order.iter().find_map(|place| on_its_best(*place)) else { return vec![] };
    let Some(counsel) = counsel.filter(|c| c.rank(parts[leader.0].actor).is_some()) else { return vec![leader] };
    let place_of = |attacker: &TrackIx| parts.iter().position(|part| part.actor == *attacker);
    counsel.attackers.iter().filter_map(place_of).filter_map(on_its_best).take(rules.attackers).collect()
}

/// Rounds until an attack works, nothing untried is left, or the rounds are used up; then the best one.
fn deliberate(situation: &Situation, rules: &Rules, parts: &[Part], order: &[usize], first: Attack) -> Attack {
    if first.is_empty() {
        return first;
    }
    let mut tried: BTreeSet<Attack> = BTreeSet::new();
    let mut attack = first;
    let mut best = (f64::INFINITY, attack.clone());
    for round in 0..=rules.rounds {
        tried.insert(sorted(&attack));
        if rules.rounds == 0 {
            break;
        }
        let evaluation = rehearse(situation, parts, &attack);
        if evaluation.distance_m_min < best.0 {
            best = (evaluation.distance_m_min, attack.clone());
        }
        let (Some(failure), true) = (evaluation.failure, round < rules.rounds) else { break };
        let modified = modifications(rules, parts, order, &attack, failure);
        let Some(next) = modified.into_iter().find(|attack| !tried.contains(&sorted(attack))) else { break };
        attack = next;
    }
    best.1
}

fn sorted(attack: &Attack) -> Attack {
    let mut attack = attack.clone();
    attack.sort_unstable();
    attack
}

/// Tries an attack against the driver in the simulator.
fn rehearse(situation: &Situation, parts: &[Part], attack: &Attack) -> Evaluation {
    let action = |(place, chosen): &(usize, usize)| {
        let part = &parts[*place];
        let samples = part.candidates[*chosen].samples.clone();
        Action::Follow { track: part.actor, from_step: part.window.from_step, samples }
    };
    let intervention = Intervention { actions: attack.iter().map(action).collect() };
    let nothing = Evaluation { contact: false, distance_m_min: f64::INFINITY, failure: Some(Failure::NeverClose) };
    let Some((place, chosen)) = attack.first() else { return nothing };
    let part = &parts[*place];
    // An attack that the simulator refuses is refused by the constraints, with its reason, when it is chosen.
    match sim::rollout(&situation.plant, &intervention, situation.policy.driver().as_mut()) {
        Ok(outcome) => {
            let way = &part.candidates[*chosen].samples;
            evaluate(situation, &outcome, || timing(situation, part.window.from_step, way))
        }
        Err(_) => nothing,
    }
}

/// Returns what may be tried next, most fitting first; the next attacker of the order is always among it.
fn modifications(rules: &Rules, parts: &[Part], order: &[usize], attack: &Attack, failure: Failure) -> Vec<Attack> {
    let (leader, chosen) = attack[0];
    let with_leader = |candidate: usize| {
        let mut next = attack.clone();
        next[0] = (leader, candidate);
        next
    };
    let candidates = &parts[leader].candidates;
    let speed = mean_speed_mps(&candidates[chosen]);
    let paced = |faster: bool| {
        let fits =
            move |c: &Candidate| (mean_speed_mps(c) > speed + 0.5) == faster && (mean_speed_mps(c) - speed).abs() > 0.5;
        ranked(&parts[leader]).into_iter().filter(|c| fits(&candidates[*c])).map(with_leader).collect::<Vec<_>>()
    };
    let another = || {
        let free = order.iter().filter(|place| attack.iter().all(|(attacker, _)| attacker != *place));
        free.filter_map(|place| Some((*place, best(&parts[*place])?))).collect::<Vec<_>>()
    };
    let mut next = match failure {
        Failure::NeverClose => vec![],
        Failure::Late => paced(true),
        Failure::Early => paced(false),
        Failure::EgoYielded if attack.len() < rules.attackers => {
            another().into_iter().map(|second| [attack.clone(), vec![second]].concat()).collect()
        }
        Failure::EgoYielded => paced(true),
        Failure::Blocked => {
            let other_way = |c: &usize| candidates[*c].mean_distance_m(&candidates[chosen]) > OTHER_WAY_M;
            ranked(&parts[leader]).into_iter().filter(other_way).map(with_leader).collect()
        }
    };
    next.extend(another().into_iter().map(|one| vec![one]));
    next
}

/// Candidates of a part by score, best first; equals in their order.
fn ranked(part: &Part) -> Vec<usize> {
    let mut order: Vec<usize> = (0..part.candidates.len()).collect();
    order.sort_by(|a, b| part.candidates[*b].score.total_cmp(&part.candidates[*a].score));
    order
}

fn best(part: &Part) -> Option<usize> {
    ranked(part).first().copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Vec2;
    use crate::motion::Window;
    use crate::scene::Sample;

    const RULES: Rules =
        Rules { attackers: 2, rounds: 3, discount: 0.99, reach_weight: 2.0, trust: 4.0, replaces: false };

    /// Two attackers with a slow, a middling and a fast candidate each; the middling one scores best.
    fn parts() -> Vec<Part> {
        let candidate = |speed: f64, score: f64| {
            let at = |k: usize| Sample {
                position: Vec2::new(0.1 * speed * k as f64, 0.0),
                heading_rad: 0.0,
                velocity: Vec2::new(speed, 0.0),
            };
            Candidate { score, ..Candidate::new((0..20).map(at).collect(), 0.0) }
        };
        let part = |actor| Part {
            actor,
            window: Window { from_step: 1, steps: 20 },
            candidates: vec![candidate(2.0, 1.0), candidate(6.0, 3.0), candidate(10.0, 2.0)],
            offsets: None,
            driven: None,
            simulated: 0,
        };
        vec![part(4), part(7)]
    }

    fn first(failure: Failure, attack: Attack) -> Attack {
        modifications(&RULES, &parts(), &[0, 1], &attack, failure).remove(0)
    }

    #[test]
    fn advised_attackers_begin_together_where_the_program_lets_them_lead() {
        let begin = |order: &[usize], attackers: Vec<TrackIx>| {
            super::first(&RULES, Some(&Counsel { attackers, ..Counsel::default() }), &parts(), order)
        };
        assert_eq!(begin(&[0, 1], vec![7, 4]), [(1, 1), (0, 1)], "the counsel's leader leads");
        assert_eq!(begin(&[1, 0], vec![7]), [(1, 1)]);
        assert_eq!(begin(&[0, 1], vec![7]), [(0, 1)], "the program's order stands above the counsel");
        assert_eq!(begin(&[0, 1], vec![9, 4]), [(0, 1)], "who is not in the pool does not attack");
        assert_eq!(super::first(&RULES, None, &parts(), &[1, 0]), [(1, 1)]);
        let alone = Rules { attackers: 1, ..RULES };
        assert_eq!(
            super::first(&alone, Some(&Counsel { attackers: vec![7, 4], ..Counsel::default() }), &parts(), &[0, 1]),
            [(1, 1)]
        );
    }

    #[test]
    fn each_failure_has_its_modification() {
        assert_eq!(first(Failure::NeverClose, vec![(0, 1)]), [(1, 1)]);
        assert_eq!(first(Failure::Late, vec![(0, 1)]), [(0, 2)]);
        assert_eq!(first(Failure::Early, vec![(0, 1)]), [(0, 0)]);
        assert_eq!(first(Failure::EgoYielded, vec![(0, 1)]), [(0, 1), (1, 1)]);
        // With two attackers the set is full: the leader is to be faster.
        assert_eq!(first(Failure::EgoYielded, vec![(0, 1), (1, 1)]), [(0, 2), (1, 1)]);
        // The fast candidate ends 8 m farther on: another way.
        assert_eq!(first(Failure::Blocked, vec![(0, 1)]), [(0, 2)]);
        // Nothing slower is left: the next attacker.
        assert_eq!(first(Failure::Early, vec![(0, 0)]), [(1, 1)]);
    }
}
