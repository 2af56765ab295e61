//! All lineages of a run: adopting parents, attaching attempts, promoting children. Written by the serial acceptor only.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::record::{AttemptRecord, Leader, Lineage, Link, Promotion};
use crate::kernel::canon::CanonError;
use crate::objects::{Attempt, AttemptId, Exit, FamilyName, LineageId, Program, SolutionId};

/// Lineages by name, and the order in which they were adopted, which is the order of their turns.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineageStore {
    pub(super) lineages: BTreeMap<LineageId, Lineage>,
    order: Vec<LineageId>,
}

/// Why the store did not change.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LineageError {
    #[error("lineage {0} is not known; adopt its parent program first")]
    Unknown(LineageId),
    #[error("lineage {0} exists already; give the new one another name")]
    Adopted(LineageId),
    #[error("solution {solution} is not in lineage {lineage}")]
    UnknownSolution { lineage: LineageId, solution: SolutionId },
    #[error("solution {0} is in its lineage already; a solution id names one program")]
    Twice(SolutionId),
    #[error("attempt {0} is attached already; attempts are sealed once")]
    AttachedTwice(AttemptId),
    #[error(
        "attempt {attempt}: child belongs to family {found}, lineage {lineage} is of family {expected}; a lineage never changes family"
    )]
    CrossFamily { attempt: AttemptId, lineage: LineageId, found: FamilyName, expected: FamilyName },
    #[error("attempt {attempt}: the child does not descend from {parent} in lineage {lineage}: {problem}")]
    Broken { attempt: AttemptId, lineage: LineageId, parent: SolutionId, problem: String },
    #[error("solution {solution} of lineage {lineage} was never accepted, so it cannot lead")]
    NotAccepted { lineage: LineageId, solution: SolutionId },
    #[error("a program has no hash: {0}")]
    Hash(#[from] CanonError),
}

impl LineageStore {
    /// Starts a lineage from a family's parent program, which takes the lineage's identity, generation 0 and no
    /// ancestors.
    pub fn adopt(&mut self, id: LineageId, mut program: Program) -> Result<&Lineage, LineageError> {
        if self.lineages.contains_key(&id) {
            return Err(LineageError::Adopted(id));
        }
        program.hash()?;
        let parent = SolutionId::new(format!("{id}/parent"));
        program.solution_id = parent.clone();
        program.lineage_id = id.clone();
        program.generation = 0;
        program.ancestor_chain.clear();
        self.order.push(id.clone());
        Ok(self.lineages.entry(id.clone()).or_insert(Lineage {
            id,
            family: program.source_family.clone(),
            active: parent.clone(),
            realism_anchor: None,
            solutions: BTreeMap::from([(parent.clone(), program)]),
            parent,
            attempts: Vec::new(),
            promotions: Vec::new(),
        }))
    }

    /// A store with this lineage alone.
    pub fn only(&self, id: &LineageId) -> Result<LineageStore, LineageError> {
        let own = self.get(id)?.clone();
        Ok(LineageStore { lineages: BTreeMap::from([(id.clone(), own)]), order: vec![id.clone()] })
    }

    pub fn get(&self, id: &LineageId) -> Result<&Lineage, LineageError> {
        self.lineages.get(id).ok_or_else(|| LineageError::Unknown(id.clone()))
    }

    fn get_mut(&mut self, id: &LineageId) -> Result<&mut Lineage, LineageError> {
        self.lineages.get_mut(id).ok_or_else(|| LineageError::Unknown(id.clone()))
    }

    /// In order of adoption.
    pub fn iter(&self) -> impl Iterator<Item = &Lineage> {
        self.order.iter().filter_map(|id| self.lineages.get(id))
    }

    /// The program whose turn it is to be edited in a lineage.
    pub fn active(&self, id: &LineageId) -> Result<&Program, LineageError> {
        let lineage = self.get(id)?;
        self.program(id, &lineage.active)
    }

    pub fn program(&self, id: &LineageId, solution: &SolutionId) -> Result<&Program, LineageError> {
        self.get(id)?
            .solutions
            .get(solution)
            .ok_or_else(|| LineageError::UnknownSolution { lineage: id.clone(), solution: solution.clone() })
    }

    /// Attaches an attempt, however it ended, and keeps its admitted program. Refuses a child of another family or
    /// one that does not descend from the parent it names.
    pub fn attach(&mut self, attempt: &Attempt) -> Result<(), LineageError> {
        let lineage = self.get(&attempt.lineage)?;
        if lineage.attempts.iter().any(|known| known.attempt == attempt.id) {
            return Err(LineageError::AttachedTwice(attempt.id.clone()));
        }
        let parent = self.program(&attempt.lineage, &attempt.parent)?;
        let child = match &attempt.exit {
            Exit::Rejected { candidate, .. } | Exit::Evaluated { candidate, .. } => Some(&candidate.program),
            Exit::Declined { .. } | Exit::Invalid { .. } => None,
        };
        if let Some(child) = child {
            check_descent(lineage, parent, child, attempt)?;
        }
        let record = AttemptRecord::of(attempt);
        let lineage = self.get_mut(&attempt.lineage)?;
        lineage.attempts.push(record);
        if let Some(child) = child {
            lineage.solutions.insert(child.solution_id.clone(), child.clone());
        }
        Ok(())
    }

    /// Records that a later epoch accepted a child that its own did not.
    pub fn accept(&mut self, id: &LineageId, solution: &SolutionId) -> Result<(), LineageError> {
        self.program(id, solution)?;
        let lineage = self.get_mut(id)?;
        let own = lineage.attempts.iter_mut().filter(|record| record.child.as_ref() == Some(solution));
        own.for_each(|record| record.accepted = true);
        Ok(())
    }

    /// Makes p_0 or an accepted child a leader from the next epoch on. Does nothing where it leads already.
    pub fn promote(
        &mut self,
        id: &LineageId,
        leader: Leader,
        solution: &SolutionId,
        epoch: u32,
    ) -> Result<(), LineageError> {
        self.program(id, solution)?;
        let lineage = self.get_mut(id)?;
        if !lineage.may_lead(solution) {
            return Err(LineageError::NotAccepted { lineage: id.clone(), solution: solution.clone() });
        }
        let from = match leader {
            Leader::Active => std::mem::replace(&mut lineage.active, solution.clone()),
            Leader::RealismAnchor => {
                let before = lineage.realism_anchor.replace(solution.clone());
                before.unwrap_or_else(|| lineage.parent.clone())
            }
        };
        if from != *solution {
            lineage.promotions.push(Promotion { epoch, leader, from, to: solution.clone() });
        }
        Ok(())
    }

    /// p_0 -> ... -> the solution, with the digests of programs and patches.
    pub fn chain(&self, id: &LineageId, solution: &SolutionId) -> Result<Vec<Link>, LineageError> {
        let program = self.program(id, solution)?;
        let mut links = Vec::with_capacity(program.ancestor_chain.len() + 1);
        for (generation, ancestor) in (0u32..).zip(&program.ancestor_chain) {
            links.push(Link {
                solution: ancestor.solution_id.clone(),
                program_hash: ancestor.program_hash,
                generation,
                patch_hash: Some(ancestor.patch_hash),
            });
        }
        links.push(Link {
            solution: solution.clone(),
            program_hash: program.hash()?,
            generation: program.generation,
            patch_hash: None,
        });
        Ok(links)
    }
}

fn check_descent(lineage: &Lineage, parent: &Program, child: &Program, attempt: &Attempt) -> Result<(), LineageError> {
    if child.source_family != lineage.family {
        return Err(LineageError::CrossFamily {
            attempt: attempt.id.clone(),
            lineage: lineage.id.clone(),
            found: child.source_family.clone(),
            expected: lineage.family.clone(),
        });
    }
    if lineage.solutions.contains_key(&child.solution_id) {
        return Err(LineageError::Twice(child.solution_id.clone()));
    }
    let broken = |problem: &str| LineageError::Broken {
        attempt: attempt.id.clone(),
        lineage: lineage.id.clone(),
        parent: attempt.parent.clone(),
        problem: problem.to_string(),
    };
    if child.lineage_id != lineage.id {
        return Err(broken("it names another lineage"));
    }
    if Some(child.generation) != parent.generation.checked_add(1) {
        return Err(broken("its generation is not the parent's plus one"));
    }
    let Some((last, before)) = child.ancestor_chain.split_last() else {
        return Err(broken("it has no ancestors"));
    };
    if before != parent.ancestor_chain.as_slice() || last.solution_id != parent.solution_id {
        return Err(broken("its ancestors are not the parent's and the parent"));
    }
    if last.program_hash != parent.hash()? {
        return Err(broken("the hash it gives of the parent is not the parent's"));
    }
    Ok(())
}
