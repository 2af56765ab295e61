//! Descent: the lineages are built anew from the recorded parents, attempts and promotions, as the acceptor built them,
//! and compared with what the record says of them.

use std::collections::BTreeMap;

use super::finding::Finding;
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::Digest;
use crate::lineage::{Leader, LineageStore};
use crate::objects::{Attempt, AttemptId, Program, SolutionId, event::Settled};

const CHECK: &str = "continuity";

pub fn check(run: &RecordedRun, findings: &mut Vec<Finding>) {
    let mut lineages = LineageStore::default();
    for parent in &run.parents {
        hash(&parent.program, parent.program_hash, findings);
        match lineages.adopt(parent.lineage.clone(), parent.program.clone()) {
            Err(error) => findings.push(Finding::breach(CHECK, &parent.lineage, error.to_string())),
            Ok(adopted) if adopted.solutions.get(&adopted.parent) != Some(&parent.program) => {
                let what = "the lineage's first program is not a parent: its id, generation or ancestors are wrong";
                findings.push(Finding::breach(CHECK, &parent.program.solution_id, what));
            }
            Ok(_) => {}
        }
    }
    for attempt in &run.attempts {
        if let Some(candidate) = attempt.exit.candidate() {
            hash(&candidate.program, candidate.program_hash, findings);
        }
        if let Err(error) = lineages.attach(attempt) {
            findings.push(Finding::breach(CHECK, &attempt.id, error.to_string()));
        }
    }
    promotions(run, &mut lineages, findings);
    findings.extend(lineages.verify_continuity().into_iter().map(|what| Finding::breach(CHECK, "lineages", what)));
}

fn hash(program: &Program, recorded: Digest, findings: &mut Vec<Finding>) {
    match program.hash() {
        Ok(hash) if hash == recorded => {}
        Ok(hash) => {
            let what = format!("its hash is {}, recorded is {}", hash.short(16), recorded.short(16));
            findings.push(Finding::breach(CHECK, &program.solution_id, what));
        }
        Err(error) => findings.push(Finding::breach(CHECK, &program.solution_id, error.to_string())),
    }
}

/// Follows the leaders of each lineage: an epoch edits the leader, and its promotion gives the next one.
fn promotions(run: &RecordedRun, lineages: &mut LineageStore, findings: &mut Vec<Finding>) {
    let attempts: BTreeMap<&AttemptId, &Attempt> = run.attempts.iter().map(|attempt| (&attempt.id, attempt)).collect();
    for frozen in &run.frozen {
        let place = format!("{} epoch {}", frozen.lineage, frozen.epoch);
        let leads = |lineages: &LineageStore, recorded: &SolutionId, what: &str| {
            let leader = lineages.active(&frozen.lineage).map(|program| &program.solution_id).ok();
            let named = leader.map_or("nobody", SolutionId::as_str);
            (leader != Some(recorded))
                .then(|| Finding::breach(CHECK, &place, format!("{what} is {recorded}, the leader is {named}")))
        };
        findings.extend(leads(lineages, &frozen.parent, "the program that was edited"));
        let of_epoch = |settled: &&Settled| settled.lineage == frozen.lineage && settled.epoch == frozen.epoch;
        let Some(settled) = run.settled.iter().find(of_epoch) else { continue };
        if let Some(promoted) = &settled.promoted
            && attempts.get(promoted).and_then(|attempt| attempt.exit.candidate()).is_none()
        {
            findings.push(Finding::breach(CHECK, promoted, "was promoted, but admitted no program"));
        }
        let leaders =
            [(Leader::Active, Some(&settled.active)), (Leader::RealismAnchor, settled.realism_anchor.as_ref())];
        for (leader, solution) in leaders.into_iter().filter_map(|(leader, solution)| Some((leader, solution?))) {
            if let Err(error) = lineages.promote(&frozen.lineage, leader, solution, frozen.epoch) {
                findings.push(Finding::breach(CHECK, &place, error.to_string()));
            }
        }
        findings.extend(leads(lineages, &settled.active, "the active program after it"));
    }
}
