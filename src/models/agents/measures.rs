//! Meaning of the objectives by a run's options: the numbers behind the formulas that prompts show.

use serde_json::{Value, json};

use super::template::{PromptError, fill};
use crate::kernel::num;

/// How programs are labelled and accepted.
#[derive(Clone, Debug, PartialEq)]
pub struct Measures {
    /// Formulas of attack and realism.
    pub protocol: Protocol,
    /// Rule by which a child becomes a member of the lineage.
    pub acceptance: Acceptance,
    /// The rule of acceptance in words, where another method than the gates decides.
    pub rule: Option<String>,
    /// True if a bounded trade with the parent is one of the gates.
    pub tradeoff: bool,
    /// True if what is inserted stays of the parent's kind.
    pub fixed_bodies: bool,
    /// Rules of the run that differ from the text, in words.
    pub otherwise: Vec<&'static str>,
}

/// One of the two protocols.
#[derive(Clone, Debug, PartialEq)]
pub enum Protocol {
    /// Attack by contact classes, realism by weighted diagnostics.
    Metadrive {
        /// Contact classes that count whatever the ego could have done.
        counts: Vec<String>,
        /// Contact classes that count where the ego could have avoided the contact.
        counts_if_avoidable: Vec<String>,
        /// How long after it sees a threat the ego begins to evade, in the trials that decide what was avoidable, s.
        reaction_s: f64,
        /// The experiment's own expression, which decides in their place.
        when: Option<String>,
        /// The experiment's own metrics: name and expression.
        metrics: Vec<(String, String)>,
        /// The diagnostics with their weights.
        diagnostics: Vec<Diagnostic>,
    },
    /// SafeBench's collision rate, overall score and adversarial realism score.
    Safebench {
        /// Bounds and tolerances: a name, the bound, the tolerance.
        limits: Vec<(String, f64, f64)>,
    },
}

/// One diagnostic d_j of realism.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// Its name in outcomes.
    pub name: String,
    /// w_j, 1.
    pub weight: f64,
    /// Meaning of the measure, in words.
    pub meaning: &'static str,
    /// Part of that meaning that its name leaves open.
    pub short: &'static str,
    /// For soft ones: what is measured, its bound and its tolerance for vehicles, in the unit of the name.
    pub limits: Vec<(String, f64, f64)>,
}

/// Options of the archive and of the final choice, all 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acceptance {
    /// r_0: where the region of high realism begins.
    pub r0: f64,
    /// a_0: where the region of high attack begins.
    pub a0: f64,
    /// Realism that a child may lose for more attack.
    pub epsilon_r: f64,
    /// Attack that a child may lose for more realism.
    pub epsilon_a: f64,
    /// Confidence at which a gain counts.
    pub level: f64,
    /// Share of its parent's coverage that a child must keep.
    pub coverage_floor: f64,
    /// Least realism of the program that a run reports.
    pub realism_min: f64,
}

/// Contact classes and what the compact form says of those whose name does not.
const CLASSES: [(&str, &str); 8] = [
    ("ego_strikes", "its front hits one ahead that goes its way"),
    ("ego_sideswipes", "it moves sideways into one beside it"),
    ("stationary_hit", "the other stands"),
    ("cut_in", "one that enters its path less than 2 s before"),
    ("crossing", "45 to 135 degrees"),
    ("head_on", ""),
    ("sideswipe", "the other moves sideways into it"),
    ("rear_end_ego_struck", "it is hit from behind"),
];

impl Measures {
    /// The formulas with their numbers; `compact` says in a mark which contacts count, and each weight once.
    pub fn text(&self, compact: bool) -> Result<String, PromptError> {
        let Acceptance { r0, a0, epsilon_r, epsilon_a, level, coverage_floor, realism_min } = self.acceptance;
        let mut values = json!({
            "r0": r0, "a0": a0, "epsilon_r": epsilon_r, "epsilon_a": epsilon_a, "level": level,
            "coverage_floor": coverage_floor, "realism_min": realism_min, "rule": self.rule, "tradeoff": self.tradeoff,
            "fixed_bodies": self.fixed_bodies, "otherwise": self.otherwise.join("; "),
        });
        match &self.protocol {
            Protocol::Metadrive { counts, counts_if_avoidable, reaction_s, when, metrics, diagnostics } => {
                values["when"] = when.clone().into();
                values["metrics"] =
                    metrics.iter().map(|(name, of)| json!({"name": name, "of": of})).collect::<Vec<_>>().into();
                values["counts"] = listed(counts).into();
                values["reaction_s"] = (*reaction_s).into();
                values["counts_if_avoidable"] = listed(counts_if_avoidable).into();
                let (weight, others) = weights(diagnostics);
                let alike = others.is_empty() && !diagnostics.is_empty();
                values["weight"] = alike.then_some(weight).into();
                values["diagnostics"] =
                    diagnostics.iter().map(|diagnostic| row(diagnostic, compact)).collect::<Vec<Value>>().into();
                if !compact {
                    return fill("objectives_metadrive.md", &values);
                }
                values["classes"] = classes(counts, counts_if_avoidable).into();
                let avoidable = format!(
                    "`?` where the ego could have avoided it by a full brake or a swerve, begun {reaction_s} s after it could see the \
                     adversary on its way into its own; the simulator tries five such manoeuvres"
                );
                let marks = [("`+` counts", counts), (&avoidable, counts_if_avoidable)];
                let marks = marks.into_iter().filter(|(_, names)| when.is_none() && !names.is_empty());
                values["marks"] = marks.map(|(mark, _)| mark).collect::<Vec<&str>>().join(", ").into();
                (values["weight"], values["weights"]) = (weight.into(), others.join(", ").into());
                fill("objectives_metadrive_compact.md", &values)
            }
            Protocol::Safebench { limits } => {
                let shown = limits.iter().map(|(name, bound, tolerance)| format!("{name} ({bound}, {tolerance})"));
                values["limits"] = shown.collect::<Vec<_>>().join("; ").into();
                fill("objectives_safebench.md", &values)
            }
        }
    }
}

/// Each class with a mark: `+` where it counts, `?` where it counts if it could have been avoided.
fn classes(counts: &[String], counts_if_avoidable: &[String]) -> Vec<Value> {
    let has = |of: &[String], name: &str| of.iter().any(|other| other == name);
    let class = |(name, meaning): &(&str, &str)| {
        let mark = if has(counts, name) {
            "+"
        } else if has(counts_if_avoidable, name) {
            "?"
        } else {
            ""
        };
        json!({"name": name, "meaning": meaning, "mark": mark})
    };
    CLASSES.iter().map(class).collect()
}

/// The weight that most diagnostics have, and the others by name.
fn weights(diagnostics: &[Diagnostic]) -> (f64, Vec<String>) {
    let count = |weight: f64| diagnostics.iter().filter(|diagnostic| diagnostic.weight == weight).count();
    let most = diagnostics.iter().map(|diagnostic| diagnostic.weight).max_by_key(|weight| count(*weight));
    let most = most.unwrap_or_default();
    let others = diagnostics.iter().filter(|diagnostic| diagnostic.weight != most);
    (most, others.map(|diagnostic| format!("{} {}", diagnostic.name, diagnostic.weight)).collect())
}

fn listed(names: &[String]) -> String {
    if names.is_empty() { "none".into() } else { names.join(", ") }
}

fn row(diagnostic: &Diagnostic, compact: bool) -> Value {
    let several = diagnostic.limits.len() > 1;
    let limits = diagnostic.limits.iter().map(|(name, bound, tolerance)| {
        let name = if several { format!("{name} ") } else { String::new() };
        format!("{name}{}, {}", num::rounded(*bound, 2), num::rounded(*tolerance, 2))
    });
    json!({
        "name": diagnostic.name,
        "weight": diagnostic.weight,
        "meaning": if compact { diagnostic.short } else { diagnostic.meaning },
        "limits": limits.collect::<Vec<_>>().join("; "),
    })
}
