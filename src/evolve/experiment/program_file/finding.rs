//! Faults of a program that somebody wrote: gate, place, line.

use serde::Serialize;
use std::fmt;

use super::lines::line_of;
use crate::adapters::{Contract, Problem};
use crate::objects::{Gate, Program};

/// One fault.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// The gate that would refuse it.
    pub gate: Gate,
    /// Line of the TOML text, from 1; none in JSON.
    pub line: Option<usize>,
    #[serde(flatten)]
    pub problem: Problem,
}

impl Finding {
    /// A fault of a text, with its line if that is TOML.
    pub fn at(gate: Gate, problem: Problem, text: Option<&str>) -> Finding {
        let line = text.and_then(|text| line_of(text, &problem.place));
        Finding { gate, line, problem }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Problem { place, found, expected } = &self.problem;
        let line = self.line.map_or(String::new(), |line| format!("line {line}, "));
        write!(f, "{line}{place}: found {found}, expected {expected} (gate {})", self.gate.name())
    }
}

/// Returns the problems that the family's contract finds in a program, each with the gate that asks about it.
pub fn by_contract(contract: &Contract, program: &Program) -> Vec<(Gate, Problem)> {
    let mechanism = [contract.check_mechanisms(program), contract.check_conditions(program)].concat();
    let all = contract.check_program(program).into_iter();
    all.map(|problem| (if mechanism.contains(&problem) { Gate::Mechanism } else { Gate::Interface }, problem)).collect()
}
