//! The counsel for one scene as text: the sets that were tried, what became of them, and who was advised.

use std::fmt::Write as _;

use super::attempt_text::{Exchanged, exchanges};
use crate::objects::Exchange;
use crate::objects::counsel::{Counselled, Proposer, Trial};

/// The whole story of a scene's counsel. `texts` gives prompt and reply of an exchange; `full` prints prompts uncut.
pub fn counsel(counselled: &Counselled, texts: &dyn Fn(&Exchange) -> Option<Exchanged>, full: bool) -> String {
    let Counselled { lineage, scene, program, .. } = counselled;
    let mut out = format!("counsel for {scene} of {lineage}\ntried with program {}\n", program.short(16));
    if counselled.rounds.is_empty() {
        out.push_str("\nno vehicle can attack, so no model was asked\n");
    }
    exchanges(&mut out, &counselled.exchanges, texts, full);
    if !counselled.rounds.is_empty() {
        out.push_str("\nsets tried:\n");
    }
    for (place, round) in counselled.rounds.iter().enumerate() {
        let by = if round.proposed_by == Proposer::Rules { "  (by the rules)" } else { "" };
        let _ = writeln!(out, "  {place}  {:<24} {}{by}", round.attackers.join(", "), outcome(&round.trial));
        let _ = writeln!(out, "     {}", round.reason);
    }
    let advised = counselled.chosen().map_or("nobody".to_string(), |round| round.attackers.join(", "));
    let _ = writeln!(out, "\nadvised: {advised}   digest {}", counselled.digest.short(16));
    out
}

/// Says in a few words what became of a set.
fn outcome(trial: &Trial) -> String {
    match trial {
        Trial::Contact => trial.code().to_string(),
        Trial::Missed { distance_m_min: None, .. } => trial.code().to_string(),
        Trial::Missed { distance_m_min: Some(distance_m), .. } => {
            format!("{}, nearest {distance_m:.1} m", trial.code())
        }
        Trial::Refused { reason } => format!("{}: {reason}", trial.code()),
    }
}
