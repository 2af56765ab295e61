//! Findings of the gates, as critics and repair are shown them. Each critic sees those of its own side; all see how many probe
//! scenes the patch changes.

use serde_json::{Map, Value, json};

use crate::objects::{GateReport, GateVerdict, Role, attempt::Gate};

/// Findings of the deterministic gates and the compiler on a patch, before its critics are asked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    /// Verdict of each gate.
    pub gates: GateReport,
    /// Probe scenes of the window on which the child was compiled beside its parent, with the parent's random draws.
    pub compared: usize,
    /// Number of them in which its motion differs from the parent's.
    pub differing: usize,
}

/// Gates that look at a patch's family, parent and surface.
const OF_ISOLATION: [Gate; 3] = [Gate::Parent, Gate::Isolation, Gate::Protected];
/// Gates that say whether a patch does anything.
const OF_MOTION: [Gate; 2] = [Gate::Compile, Gate::Effect];

/// The findings as one critic sees them.
pub fn for_critic(role: Role, findings: Option<&Findings>) -> Value {
    let Some(findings) = findings else { return not_asked() };
    match role {
        Role::IsolationCritic => shown(findings, |gate| OF_ISOLATION.contains(&gate)),
        Role::AttackCritic | Role::RealismCritic => shown(findings, |gate| OF_MOTION.contains(&gate)),
        _ => shown(findings, |_| true),
    }
}

/// All findings.
pub fn for_repair(findings: Option<&Findings>) -> Value {
    findings.map_or_else(not_asked, |findings| shown(findings, |_| true))
}

fn not_asked() -> Value {
    json!({"gates": "asked once the critics approve"})
}

fn shown(findings: &Findings, of: impl Fn(Gate) -> bool) -> Value {
    let name = |verdict: &GateVerdict| format!("{:?}", verdict.gate).to_lowercase();
    let verdicts = findings.gates.verdicts.iter().filter(|verdict| of(verdict.gate));
    let (passed, refused): (Vec<&GateVerdict>, Vec<&GateVerdict>) =
        verdicts.partition(|verdict| verdict.problems.is_empty());
    let gates: Map<String, Value> =
        refused.into_iter().map(|verdict| (name(verdict), json!(verdict.problems))).collect();
    json!({
        "gates": gates,
        "passed": passed.into_iter().map(name).collect::<Vec<String>>().join(", "),
        "probe_scenes": {"compiled": findings.compared, "motion_differs_from_parent": findings.differing},
    })
}
