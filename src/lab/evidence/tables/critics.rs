//! tab:actor-critic-diagnostic: what critics did with proposals before anything was simulated, a row a source family and ego.

use super::error::TableError;
use super::layout::{Head, Table};
use super::paper::metadrive as printed;
use super::shares::{self, Holds, Share, Spec, percent};
use crate::evidence::recorded_run::RecordedRun;
use crate::objects::{Advice, Attempt, Exit, Review, Role};

/// A critic has read a patch of it.
pub const REVIEWED: Holds = |of| first_reviews(of).next().is_some();
/// A critic objected to the first patch that was reviewed.
pub const INTERVENED: Holds = |of| first_reviews(of).any(objects);
/// A revised patch that could be read came behind a review.
pub const REPAIRED: Holds = |of| {
    let behind = of.proposal.rounds.iter().skip_while(|round| round.reviews.is_empty()).skip(1);
    behind.into_iter().any(|round| round.patch.is_some())
};
/// The critics or the gates stopped it before any rollout: the paper's rejected ones.
pub const STOPPED: Holds = |of| matches!(of.exit, Exit::Declined { .. } | Exit::Invalid { .. });

const SHARES: [Share; 8] = [
    percent(printed::CRITIC_COLUMNS[0], "Of reviewed", "Intervened", REVIEWED, INTERVENED),
    percent(printed::CRITIC_COLUMNS[1], "Of reviewed", "Repaired", REVIEWED, REPAIRED),
    percent(printed::CRITIC_COLUMNS[2], "Of reviewed", "Stopped", REVIEWED, STOPPED),
    percent("structural_pct", "Objections by critic", "Structural", REVIEWED, |of| by(of, Role::StructuralCritic)),
    percent("attack_pct", "Objections by critic", "Attack", REVIEWED, |of| by(of, Role::AttackCritic)),
    percent("realism_pct", "Objections by critic", "Realism", REVIEWED, |of| by(of, Role::RealismCritic)),
    percent("isolation_pct", "Objections by critic", "Isolation", REVIEWED, |of| by(of, Role::IsolationCritic)),
    percent("evaluated_pct", "Of reviewed", "Evaluated", REVIEWED, |of| of.exit.score().is_some()),
];

/// The table.
const SPEC: Spec = Spec {
    name: "actor-critic",
    title: "Critics before simulation",
    source: Some(printed::CRITICS_LABEL),
    shares: &SHARES,
    counts: &[
        (Head { key: "reviewed", head: "Reviewed" }, REVIEWED),
        (Head { key: "attempts", head: "Proposed" }, |_| true),
    ],
    figures: printed::critic_figures,
    note: "Reviewed: proposals with a patch that a critic read. Intervened: a critic objected to the first of these patches; by critic, \
           who it was (several may be). Repaired: a revised patch that could be read came behind a review, also where a gate and no critic \
           had asked for it. Stopped: it ended there, by a critic's objection, an unreadable answer or a gate; the paper calls it rejected.",
};

/// The reviews of the first patch that was reviewed.
fn first_reviews(attempt: &Attempt) -> impl Iterator<Item = &Review> {
    attempt.proposal.rounds.iter().find(|round| !round.reviews.is_empty()).into_iter().flat_map(|round| &round.reviews)
}

fn objects(review: &Review) -> bool {
    review.decision != Advice::Approve
}

fn by(attempt: &Attempt, critic: Role) -> bool {
    first_reviews(attempt).any(|review| review.role == critic && objects(review))
}

/// Makes the table of what critics did in these runs.
pub fn actor_critic(runs: &[RecordedRun]) -> Result<Table, TableError> {
    shares::table(&SPEC, runs)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{CAT, add, attempt, run, simulated};
    use super::actor_critic;
    use crate::objects::attempt::Round;
    use crate::objects::{Advice, Attempt, Exit, FamilyName, ProgramPatch, Review, Role, RouteDecision, SolutionId};

    fn patch() -> ProgramPatch {
        ProgramPatch {
            source_baseline: FamilyName::new("cat"),
            parent_solution_id: SolutionId::new("cat-idm/parent"),
            parent_program_hash: String::new(),
            operations: vec![],
            hypothesis: String::new(),
            memory_refs_used: vec![],
            cluster_refs_used: vec![],
            repair_summary: None,
            free: Default::default(),
        }
    }

    fn review(role: Role, decision: Advice) -> Review {
        let none = Vec::new;
        let scope = "pre_simulation".to_string();
        Review { role, decision, blockers: none(), repair_hints: none(), risk_tags: none(), scope }
    }

    /// A proposal whose rounds were judged so: `None` is a reply that held no patch.
    fn judged(slot: u32, exit: Exit, rounds: &[Option<[Advice; 2]>]) -> Attempt {
        let mut attempt = attempt("cat-idm", slot, exit);
        let round = |judged: &Option<[Advice; 2]>| match judged {
            None => Round { patch: None, reviews: vec![] },
            Some([structural, realism]) => Round {
                patch: Some(patch()),
                reviews: vec![review(Role::StructuralCritic, *structural), review(Role::RealismCritic, *realism)],
            },
        };
        attempt.proposal.rounds = rounds.iter().map(round).collect();
        attempt
    }

    #[test]
    fn shares_are_of_what_critics_read_and_the_paper_stands_beside() {
        use Advice::{Approve, Reject, Repair};
        let mut recorded = run("made", &[("actor", "scripted (s, s)")]);
        add(&mut recorded, &CAT);
        let declined = || Exit::Declined { reason: "blocked".into() };
        let evaluated = || simulated(RouteDecision::Select, false, 0.0);
        recorded.attempts = vec![
            judged(0, declined(), &[None]),
            judged(1, evaluated(), &[Some([Approve, Approve])]),
            judged(2, evaluated(), &[Some([Approve, Repair]), Some([Approve, Approve])]),
            judged(3, declined(), &[Some([Repair, Repair]), Some([Approve, Reject])]),
            // The reply could not be read; the repaired one was the first to be reviewed, so nothing was repaired behind a review.
            judged(4, evaluated(), &[None, Some([Approve, Approve])]),
            // A gate refused whom all critics approved.
            judged(5, Exit::Invalid { gates: Default::default() }, &[Some([Approve, Approve])]),
        ];
        let table = actor_critic(&[recorded]).unwrap();
        let row = table.rows().next().unwrap();
        let share = |key: &str| row.cell(key).ours.unwrap().value;
        assert_eq!(row.counts, [5, 6, 1]);
        assert_eq!([share("intervened_pct"), share("repaired_pct"), share("stopped_pct")], [40.0, 40.0, 40.0]);
        assert_eq!([share("structural_pct"), share("realism_pct"), share("isolation_pct")], [20.0, 40.0, 0.0]);
        assert_eq!(share("evaluated_pct"), 60.0);
        assert_eq!(row.cell("intervened_pct").paper, Some(89.0));
    }
}
