//! Continuity: whether what a lineage says of its descent is true of the programs it stores.

use super::{
    record::{AttemptRecord, Leader, Lineage},
    store::LineageStore,
};
use crate::objects::Program;

impl LineageStore {
    /// Every break of a chain, as a sentence; empty where all lineages are continuous. Reads everything, changes
    /// nothing: for a store that came from disk.
    pub fn verify_continuity(&self) -> Vec<String> {
        let mut problems = Vec::new();
        for lineage in self.lineages.values() {
            check_leaders(lineage, &mut problems);
            for (id, program) in &lineage.solutions {
                if *id != program.solution_id {
                    problems
                        .push(format!("{id}: the program stored under this name calls itself {}", program.solution_id));
                }
                check_program(lineage, program, &mut problems);
            }
            lineage.attempts.iter().for_each(|record| check_attempt(lineage, record, &mut problems));
        }
        problems
    }
}

/// Each leader is where its promotions lead, one after the other, from the parent.
fn check_leaders(lineage: &Lineage, problems: &mut Vec<String>) {
    let anchor = lineage.realism_anchor.as_ref().unwrap_or(&lineage.parent);
    for (leader, name, leads) in
        [(Leader::Active, "active", &lineage.active), (Leader::RealismAnchor, "realism anchor", anchor)]
    {
        let (mut last, mut epoch) = (&lineage.parent, 0);
        for promotion in lineage.promotions.iter().filter(|promotion| promotion.leader == leader) {
            if promotion.from != *last {
                problems.push(format!("{}: promotion of {} is not from the leader {last}", lineage.id, promotion.to));
            }
            if promotion.epoch < epoch {
                problems.push(format!("{}: promotion of {} comes before the one it follows", lineage.id, promotion.to));
            }
            if !lineage.may_lead(&promotion.to) {
                problems.push(format!("{}: {} leads but was never accepted", lineage.id, promotion.to));
            }
            (last, epoch) = (&promotion.to, promotion.epoch);
        }
        if leads != last {
            problems.push(format!("{}: {name} is {leads}, the promotions lead to {last}", lineage.id));
        }
    }
    for needed in [&lineage.parent, &lineage.active] {
        if !lineage.solutions.contains_key(needed) {
            problems.push(format!("{}: program {needed} is missing", lineage.id));
        }
    }
}

fn check_program(lineage: &Lineage, program: &Program, problems: &mut Vec<String>) {
    let id = &program.solution_id;
    if program.source_family != lineage.family {
        problems.push(format!("{id}: family {} in a lineage of {}", program.source_family, lineage.family));
    }
    if program.lineage_id != lineage.id {
        problems.push(format!("{id}: names lineage {}, lies in {}", program.lineage_id, lineage.id));
    }
    if program.generation as usize != program.ancestor_chain.len() {
        problems.push(format!("{id}: generation {}, {} ancestors", program.generation, program.ancestor_chain.len()));
    }
    match program.ancestor_chain.first() {
        Some(first) if first.solution_id != lineage.parent => {
            problems.push(format!("{id}: its chain starts at {}, not at {}", first.solution_id, lineage.parent));
        }
        None if *id != lineage.parent => problems.push(format!("{id}: has no ancestors and is not the parent")),
        _ => {}
    }
    for (place, ancestor) in program.ancestor_chain.iter().enumerate() {
        let Some(stored) = lineage.solutions.get(&ancestor.solution_id) else {
            problems.push(format!("{id}: ancestor {} is missing", ancestor.solution_id));
            continue;
        };
        if stored.hash().ok() != Some(ancestor.program_hash) {
            problems.push(format!("{id}: ancestor {} is not the program that was edited", ancestor.solution_id));
        }
        if stored.ancestor_chain.as_slice() != &program.ancestor_chain[..place] {
            problems.push(format!("{id}: ancestor {} descends from others", ancestor.solution_id));
        }
    }
}

fn check_attempt(lineage: &Lineage, record: &AttemptRecord, problems: &mut Vec<String>) {
    let name = &record.attempt;
    match lineage.solutions.get(&record.parent).map(|program| program.hash().ok()) {
        None => problems.push(format!("{name}: its parent {} is missing", record.parent)),
        Some(hash) if hash != Some(record.parent_hash) => {
            problems.push(format!("{name}: its parent {} is not the program it was shown", record.parent));
        }
        _ => {}
    }
    let Some(child) = &record.child else { return };
    match lineage.solutions.get(child).map(|program| program.ancestor_chain.last()) {
        None => problems.push(format!("{name}: its child {child} is missing")),
        Some(last) => {
            let expected = last.map(|ancestor| (&ancestor.solution_id, Some(ancestor.patch_hash)));
            if expected != Some((&record.parent, record.patch_hash)) {
                problems.push(format!("{name}: its child {child} tells of another parent or patch"));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::store::LineageError;
    use super::*;
    use crate::kernel::Digest;
    use crate::objects::*;
    use std::collections::BTreeMap;

    fn parent(family: &str) -> Program {
        Program {
            solution_id: SolutionId::new("unnamed"),
            lineage_id: LineageId::new("unnamed"),
            source_family: FamilyName::new(family),
            generation: 0,
            parameters: BTreeMap::from([("gain".to_string(), ParameterValue::Number(1.0))]),
            operator_graph: BTreeMap::new(),
            scenario_conditioned_policy: Vec::new(),
            mechanism_modules: BTreeMap::new(),
            compile_contract: CompileContract { backend: "metadrive".into(), constraints: Vec::new() },
            ancestor_chain: Vec::new(),
        }
    }

    fn line() -> LineageId {
        LineageId::new("cat-idm")
    }

    fn store() -> LineageStore {
        let mut store = LineageStore::default();
        store.adopt(line(), parent("cat")).unwrap();
        store
    }

    fn child_of(program: &Program, epoch: u32, slot: u32) -> Program {
        let patch_hash = Digest::of_bytes(&[epoch as u8, slot as u8]);
        let mut child = program.clone();
        child.solution_id = SolutionId::new(format!("cat-idm/e{epoch}s{slot}"));
        child.generation += 1;
        child.parameters.insert("gain".into(), ParameterValue::Number(2.0 + f64::from(epoch * 100 + slot)));
        child.ancestor_chain.push(Ancestor {
            solution_id: program.solution_id.clone(),
            program_hash: program.hash().unwrap(),
            patch_hash,
        });
        child
    }

    fn attempt_of(program: &Program, child: Program, epoch: u32, slot: u32, accepted: bool) -> Attempt {
        let gates = AcceptanceGates {
            densification: Densification { holds: accepted, non_dominated: accepted, ..Densification::default() },
            coverage: CoverageFloor { holds: true, ..CoverageFloor::default() },
            differing_scenes: 1,
            ..AcceptanceGates::default()
        };
        let objectives = Objectives { attack: 0.5, realism: 0.9 };
        let candidate = Candidate {
            program_hash: child.hash().unwrap(),
            patch_hash: child.ancestor_chain.last().map_or(Digest::of_bytes(b""), |a| a.patch_hash),
            mechanism_tags: Vec::new(),
            program: child,
        };
        Attempt {
            id: AttemptId::at(&line(), epoch, slot),
            lineage: line(),
            epoch,
            slot,
            parent: program.solution_id.clone(),
            parent_hash: program.hash().unwrap(),
            target: String::new(),
            memory_shown: Vec::new(),
            proposal: Proposal::default(),
            exit: Exit::Evaluated {
                gates: GateReport::default(),
                candidate: Box::new(candidate),
                route: Route {
                    decision: RouteDecision::Select,
                    reason: String::new().into(),
                    snapshot: Digest::of_bytes(b"w"),
                    predicted: objectives,
                    uncertainty: 0.0,
                    half_width: None,
                    rank_score: None,
                    weight: None,
                    pilot: None,
                },
                score: Score {
                    objectives,
                    realism_all: objectives.realism,
                    coverage: 1.0,
                    scenes: Vec::new(),
                    failures: Vec::new(),
                    benchmark: None,
                    rules: Default::default(),
                },
                decision: Decision { promoted: accepted, on_front: accepted, gates: Box::new(gates), race: None },
            },
        }
    }

    /// Three generations, one of which also has a sibling that was not accepted.
    fn grown() -> LineageStore {
        let mut store = store();
        for epoch in 1..=3 {
            let active = store.active(&line()).unwrap().clone();
            let sibling = child_of(&active, epoch, 0);
            store.attach(&attempt_of(&active, sibling, epoch, 0, false)).unwrap();
            let child = child_of(&active, epoch, 1);
            let name = child.solution_id.clone();
            store.attach(&attempt_of(&active, child, epoch, 1, true)).unwrap();
            store.promote(&line(), Leader::Active, &name, epoch).unwrap();
        }
        store
    }

    #[test]
    fn a_grown_lineage_is_continuous_and_its_chain_runs_from_the_parent() {
        let store = grown();
        assert_eq!(store.verify_continuity(), Vec::<String>::new());
        let chain = store.chain(&line(), &SolutionId::new("cat-idm/e3s1")).unwrap();
        let names: Vec<&str> = chain.iter().map(|link| link.solution.as_str()).collect();
        assert_eq!(names, ["cat-idm/parent", "cat-idm/e1s1", "cat-idm/e2s1", "cat-idm/e3s1"]);
        assert_eq!(chain[1].patch_hash, Some(Digest::of_bytes(&[2, 1])));
        assert_eq!(chain[3].patch_hash, None);
    }

    #[test]
    fn a_child_of_another_family_is_refused() {
        let mut store = store();
        let active = store.active(&line()).unwrap().clone();
        let mut child = child_of(&active, 1, 0);
        child.source_family = FamilyName::new("at");
        let refused = store.attach(&attempt_of(&active, child, 1, 0, true));
        assert!(matches!(refused, Err(LineageError::CrossFamily { .. })));
        assert!(store.get(&line()).unwrap().attempts.is_empty());
    }

    #[test]
    fn a_child_with_a_stale_parent_hash_is_refused() {
        let mut store = store();
        let active = store.active(&line()).unwrap().clone();
        let mut child = child_of(&active, 1, 0);
        child.ancestor_chain[0].program_hash = Digest::of_bytes(b"older");
        assert!(matches!(store.attach(&attempt_of(&active, child, 1, 0, true)), Err(LineageError::Broken { .. })));
    }

    #[test]
    fn only_an_accepted_child_can_lead() {
        let mut store = grown();
        let sibling = SolutionId::new("cat-idm/e1s0");
        assert!(matches!(store.promote(&line(), Leader::Active, &sibling, 4), Err(LineageError::NotAccepted { .. })));
    }

    #[test]
    fn a_realism_anchor_has_a_chain_of_its_own_that_begins_with_the_parent() {
        let mut store = grown();
        for (solution, epoch) in [("cat-idm/e2s1", 4), ("cat-idm/parent", 5)] {
            store.promote(&line(), Leader::RealismAnchor, &SolutionId::new(solution), epoch).unwrap();
        }
        assert_eq!(store.verify_continuity(), Vec::<String>::new());
        let lineage = store.lineages.get_mut(&line()).unwrap();
        assert_eq!(lineage.active.as_str(), "cat-idm/e3s1");
        lineage.realism_anchor = Some(SolutionId::new("cat-idm/e1s1"));
        let problems = store.verify_continuity().join("\n");
        assert!(
            problems.contains("realism anchor is cat-idm/e1s1, the promotions lead to cat-idm/parent"),
            "{problems}"
        );
    }

    #[test]
    fn an_attempt_is_attached_once() {
        let mut store = store();
        let active = store.active(&line()).unwrap().clone();
        let attempt = attempt_of(&active, child_of(&active, 1, 0), 1, 0, true);
        store.attach(&attempt).unwrap();
        assert_eq!(store.attach(&attempt), Err(LineageError::AttachedTwice(attempt.id.clone())));
    }

    #[test]
    fn a_changed_ancestor_is_found() {
        let mut store = grown();
        let lineage = store.lineages.get_mut(&line()).unwrap();
        let program = lineage.solutions.get_mut(&SolutionId::new("cat-idm/e1s1")).unwrap();
        program.parameters.insert("gain".into(), ParameterValue::Number(9.0));
        let problems = store.verify_continuity();
        assert!(problems.iter().any(|p| p.starts_with("cat-idm/e3s1: ancestor cat-idm/e1s1")), "{problems:?}");
    }

    #[test]
    fn a_wrong_generation_family_or_leader_is_found() {
        let mut store = grown();
        let lineage = store.lineages.get_mut(&line()).unwrap();
        lineage.active = lineage.parent.clone();
        let last = lineage.solutions.get_mut(&SolutionId::new("cat-idm/e3s1")).unwrap();
        last.generation = 7;
        last.source_family = FamilyName::new("at");
        let problems = store.verify_continuity().join("\n");
        for part in ["generation 7, 3 ancestors", "family at in a lineage of cat", "active is cat-idm/parent"] {
            assert!(problems.contains(part), "{problems}");
        }
    }
}
