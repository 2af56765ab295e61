//! Reasons to believe the page, as far as it knows them: badges, each with what it rests on and what it does not say.

use serde::Serialize;

use super::super::recorded_run::RecordedRun;
use super::stage::Stage;
use crate::evidence::{Gravity, audit};
use crate::text::{counted, in_words};

/// One badge.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Badge {
    pub standing: Standing,
    /// Verdict in a few words.
    pub says: String,
    /// Basis of the badge, and the command that goes further.
    pub rests_on: String,
}

/// Weight of a badge for or against the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// It was looked at and holds.
    Holds,
    /// Something that a reader should weigh.
    Note,
    /// It speaks against the result.
    Against,
    /// The page does not know.
    Unknown,
}

/// All badges of a page.
pub fn badges(run: &RecordedRun, stage: &Stage) -> Vec<Badge> {
    let badge = |standing, says: String, rests_on: &str| Badge { standing, says, rests_on: rests_on.into() };
    let mut badges = vec![proposers(run)];
    let chain = "Every event of the record holds the hash of the one before it, and the last hash is the root: the page was made from a chain \
                 that is whole. `evodrive check` derives the run again from its recorded answers and compares the root.";
    badges.push(match run.result {
        Some(_) => badge(Standing::Holds, format!("sealed, root {}", run.root.short(8)), chain),
        None => badge(
            Standing::Note,
            "not finished".into(),
            "Held-out scenes are opened after the last epoch. `evodrive resume` goes on.",
        ),
    });
    let findings = audit(run);
    let breaches = findings.iter().filter(|finding| finding.gravity == Gravity::Breach).count();
    let audited = "The audit recounts what the record says of itself: labels, fronts, choices, held-out scenes that stayed closed. `evodrive fsck` prints the same.";
    badges.push(match (breaches, findings.len()) {
        (0, 0) => badge(Standing::Holds, "audit: no findings".into(), audited),
        (0, notes) => badge(Standing::Note, format!("audit: sound, {}", counted(notes, "note")), audited),
        (breaches, _) => badge(Standing::Against, format!("audit: {}", counted(breaches, "breach")), audited),
    });
    let checked: Vec<bool> = stage.rollouts.iter().filter_map(|rollout| rollout.as_recorded).collect();
    let same = checked.iter().filter(|same| **same).count();
    let rests = "The rollouts that this page plays were simulated anew when it was made, and compared with the digest that the record holds of \
                 each. `evodrive verify` does so with all of the run.";
    badges.push(match (checked.len(), same) {
        (0, _) => badge(Standing::Unknown, "no rollout simulated again".into(), rests),
        (all, same) if same == all => badge(
            Standing::Holds,
            format!("{} shown here simulated again, equal to the record", counted(all, "rollout")),
            rests,
        ),
        (all, same) => badge(
            Standing::Against,
            format!("{} of {all} rollouts shown here differ from the record", all - same),
            rests,
        ),
    });
    badges.push(badge(
        Standing::Unknown,
        "no signature here".into(),
        "A run folder carries none. `evodrive bundle create --sign KEY` makes a signed file of it, `evodrive bundle verify --key` checks one.",
    ));
    badges
}

/// Makes the badge on who proposed the patches.
fn proposers(run: &RecordedRun) -> Badge {
    let (models, scripted) = (run.models(), run.scripted_roles());
    let actor = models.get("actor").map_or("nobody", String::as_str);
    let (all, count) = (models.len(), scripted.len());
    let stand_in = "A rule-based stand-in, which is no language model: its results show that the loop works and say nothing about what language models find.";
    if count == all {
        let (says, rests_on) = ("proposed by the scripted stand-in".into(), stand_in.into());
        return Badge { standing: Standing::Note, says, rests_on };
    }
    let (says, standing) = match run.proposer().as_str() {
        "scripted" => ("proposed by the scripted stand-in".to_string(), Standing::Note),
        "random" => ("random legal patches: nobody was asked for a proposal".to_string(), Standing::Note),
        _ => {
            let critics = if scripted.iter().any(|role| role.ends_with("critic")) { "; critics are rules" } else { "" };
            (format!("proposed by a model: {actor}{critics}"), Standing::Holds)
        }
    };
    let roles: Vec<String> = scripted.iter().map(|role| in_words(role)).collect();
    let rests_on = if roles.is_empty() && run.proposer() == "random" {
        "A null search: patches are drawn by the experiment's seed, so what it gains comes by chance.".to_string()
    } else if roles.is_empty() {
        "The models' answers are recorded: the run replays without them.".to_string()
    } else {
        format!(
            "The models' answers are recorded: the run replays without them. The scripted stand-in, which is no language model, answered as {}.",
            super::mechanism::joined(&roles)
        )
    };
    Badge { standing, says, rests_on }
}
