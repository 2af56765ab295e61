//! A row a question to a model, and a row a critic's review.

use super::super::recorded_run::RecordedRun;
use super::sheet::{Columns, Sheet, joined, word};
use crate::objects::{AttemptId, Exchange, Review};

type Asked<'r> = (&'r AttemptId, usize, &'r Exchange);

pub fn sheet(run: &RecordedRun) -> Sheet {
    let rows: Vec<Asked<'_>> = run
        .attempts
        .iter()
        .flat_map(|attempt| attempt.proposal.exchanges.iter().enumerate().map(move |(k, x)| (&attempt.id, k, x)))
        .collect();
    let columns = Columns::<Asked<'_>>::new()
        .text("attempt", "Of which proposal.", |(attempt, ..)| attempt.to_string())
        .whole("turn", "Place among its questions, from 0.", |(_, turn, _)| *turn)
        .text("role", "Who was asked.", |(.., asked)| asked.role.name())
        .whole("round", "Repair round; the proposal is round 0.", |(.., asked)| asked.round)
        .text("model", "Name of the model in the experiment file.", |(.., asked)| asked.model.clone())
        .text("request", "Key of the request: the cassette's.", |(.., asked)| asked.request)
        .text("response", "Digest of the answer's bytes.", |(.., asked)| asked.response)
        .text("refusal", "Why the answer could not be used.", |(.., asked)| asked.refusal.clone());
    columns.laid_out("exchanges", "a question to a model", &rows)
}

type Reviewed<'r> = (&'r AttemptId, usize, &'r Review);

pub fn reviews(run: &RecordedRun) -> Sheet {
    let rows: Vec<Reviewed<'_>> = run
        .attempts
        .iter()
        .flat_map(|attempt| {
            let rounds = attempt.proposal.rounds.iter().enumerate();
            rounds.flat_map(move |(round, of)| of.reviews.iter().map(move |review| (&attempt.id, round, review)))
        })
        .collect();
    let columns = Columns::<Reviewed<'_>>::new()
        .text("attempt", "Of which proposal.", |(attempt, ..)| attempt.to_string())
        .whole("round", "Which of its patches: 0 is the proposal, later ones are repairs.", |(_, round, _)| *round)
        .text("critic", "Who reviewed.", |(.., review)| review.role.name())
        .text("decision", "What the critic advises.", |(.., review)| word(&review.decision))
        .text("blockers", "What must be corrected first.", |(.., review)| joined(&review.blockers));
    columns.laid_out("reviews", "a review", &rows)
}
