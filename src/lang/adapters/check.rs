//! V_b without scenes: checks a program against its family's contract, part by part.

use super::{contract::Contract, problem::Problem};
use crate::objects::Program;

impl Contract {
    /// All findings; empty means that the program is admissible for the family. Bounds are checked first, so that the
    /// other checks only see programs of bounded size.
    pub fn check_program(&self, program: &Program) -> Vec<Problem> {
        let mut problems = self.check_limits(program);
        if problems.is_empty() {
            problems.extend(self.check_inherited(program));
            problems.extend(self.check_parameters(program));
            problems.extend(self.check_graph(program));
            problems.extend(self.check_policy(program));
            problems.extend(self.check_mechanisms(program));
        }
        problems
    }

    /// Checks the number of nodes, rules and modules.
    pub fn check_limits(&self, program: &Program) -> Vec<Problem> {
        [
            ("/operator_graph", program.operator_graph.len(), self.limits.nodes, "nodes"),
            ("/scenario_conditioned_policy", program.scenario_conditioned_policy.len(), self.limits.rules, "rules"),
            ("/mechanism_modules", program.mechanism_modules.len(), self.limits.modules, "modules"),
        ]
        .into_iter()
        .filter(|(_, count, most, _)| count > most)
        .map(|(place, count, most, what)| Problem::new(place, format!("{count} {what}"), format!("at most {most}")))
        .collect()
    }

    /// Checks that b and κ are those of the family.
    pub fn check_inherited(&self, program: &Program) -> Vec<Problem> {
        let mut problems = Vec::new();
        if program.source_family != self.family {
            problems.push(Problem::new(
                "/source_family",
                format!("`{}`", program.source_family),
                format!("`{}`", self.family),
            ));
        }
        let kept = &program.compile_contract;
        if kept.backend != self.backend {
            problems.push(Problem::new(
                "/compile_contract/backend",
                format!("`{}`", kept.backend),
                format!("`{}`", self.backend),
            ));
        }
        if kept.constraints != self.constraints {
            let (found, expected) = (kept.constraints.join(", "), self.constraints.join(", "));
            problems.push(Problem::new("/compile_contract/constraints", found, expected));
        }
        problems
    }
}
