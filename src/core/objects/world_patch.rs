//! A change of the world evaluator's configuration as an agent proposes it, and the surface that it may touch (paper, algorithm
//! world_agent_update; appendix World Evaluator and Evaluator Evolution).

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

use super::world::{FeatureGroup, FeatureSchema, WorldConfiguration};

/// Δφ: new values of some keys of the surface, and why. It can name nothing else of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldPatch {
    /// Key of the surface -> its new value.
    pub changes: BTreeMap<String, Value>,
    /// Fault of the active evaluator, in the agent's words.
    pub hypothesis: String,
    /// Which measure of the judge should gain.
    pub expected_gain: String,
    /// Why predictions should be calibrated so.
    pub rationale: String,
    /// How audits should be drawn.
    pub audit_policy: String,
    /// Risks of the change.
    pub risk_notes: Vec<String>,
}

/// The values that a key may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SurfaceRange {
    /// A number from the first to the second.
    Number(f64, f64),
    /// A whole number from the first to the second.
    Whole(u64, u64),
    /// One of the words.
    Word(&'static [&'static str]),
    /// A list of names of columns.
    Columns,
    /// A list of names of feature groups.
    Groups,
}

/// One key of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceKey {
    /// Its name in a patch.
    pub name: &'static str,
    /// Its values.
    pub range: SurfaceRange,
    /// Effect of the key, in a sentence, for the prompt.
    pub meaning: &'static str,
}

/// Why a patch cannot be tried.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PatchRefusal {
    /// It names something that no evaluator may change.
    #[error(
        "`{0}` is protected: a patch changes the evaluator's own configuration and nothing else; expected one of {1}"
    )]
    Protected(String, String),
    /// No key of the surface has this name.
    #[error("`{0}` is no key of the update surface; expected one of {1}")]
    Unknown(String, String),
    /// A value that its key does not take.
    #[error("{name}: found {found}, expected {expected}")]
    Range {
        /// The key.
        name: String,
        /// Its value.
        found: String,
        /// Values that the key takes, in words.
        expected: String,
    },
    /// The patch leaves the configuration as it is.
    #[error(
        "nothing is changed: the active configuration has these values; expected another value of one key at least"
    )]
    Unchanged,
}

/// Words that name what the judge protects: generators, ego, simulator, labels, acceptance and budgets.
const PROTECTED: [&str; 24] = [
    "generator",
    "generators",
    "program",
    "programs",
    "patch",
    "ego",
    "ego_policy",
    "simulator",
    "evaluation",
    "label",
    "labels",
    "archive",
    "selector",
    "lineage",
    "lineages",
    "memory",
    "scenes",
    "seed",
    "budget",
    "rollout_budget",
    "choice",
    "min_labels",
    "pilot",
    "judge",
];

/// Keys that stand in the configuration's table `routing`.
const ROUTING: [&str; 4] = ["lambda_a", "lambda_r", "lambda_u", "audit_share"];
/// Keys that stand in the table of an evaluator of pairs.
const PAIRS: [&str; 2] = ["aggregate", "abstain_above"];
/// Keys that an evaluator of pairs does not read: its regression is the ridge line.
const NOT_OF_PAIRS: [&str; 3] = ["model", "trees", "learning_rate"];

/// Returns the surface U_W. `audit_share` holds the bounds of the audit share that the experiment declares. An evaluator with columns
/// of our own simulator may also rank by these; an evaluator of pairs has its own keys.
pub fn update_surface(audit_share: [f64; 2], schema: &FeatureSchema) -> Vec<SurfaceKey> {
    use SurfaceRange::{Columns, Groups, Number, Whole, Word};
    let key = |name, range, meaning| SurfaceKey { name, range, meaning };
    let model = match schema.place_of(FeatureGroup::Simulated) {
        None => key("model", Word(&["ridge", "boosted"]), "Regression: a ridge line, or boosted trees of depth 3."),
        Some(_) => key(
            "model",
            Word(&["ridge", "boosted", "simulator"]),
            "Regression: a ridge line, boosted trees of depth 3, or one slope on the columns `simulated`.",
        ),
    };
    let of_pairs = schema.place_of(FeatureGroup::Ego).is_some();
    let mut surface = vec![
        key(
            "excluded_groups",
            Groups,
            "Feature groups left out of the regression, all of their columns. Together with `excluded_columns` the whole of what is left out.",
        ),
        key("excluded_columns", Columns, "Single columns left out of the regression."),
        model,
        key(
            "ridge_lambda",
            Number(0.1, 1e5),
            "Penalty of the ridge line; larger pulls predictions to the mean. The trees do not read it.",
        ),
        key("trees", Whole(0, 200), "Trees of the boosted model."),
        key("learning_rate", Number(0.005, 0.5), "Share of its prediction that each tree adds."),
        key(
            "beta_attack",
            Number(0.0, 1.0),
            "Weight of the predicted difference of attack against the mean difference of its group.",
        ),
        key("beta_realism", Number(0.0, 1.0), "The same for realism."),
        key("calibration_group", Word(&["family", "mechanism_class"]), "Whose mean difference that is."),
        key(
            "group_labels_min",
            Whole(1, 10_000),
            "Labels below which a group's mean is not used but that of all labels.",
        ),
        key(
            "interval_level",
            Number(0.5, 0.95),
            "Share of labels that the intervals are made to hold, as errors among the labels of the fit say it.",
        ),
        key(
            "realism_weight",
            Number(0.0, 5.0),
            "Weight of the predicted difference of realism against that of attack in the rank.",
        ),
        key(
            "explore",
            Number(0.0, 2.0),
            "Weight of the half widths of the intervals in the rank: what is little known is tried first.",
        ),
        key("lambda_a", Number(0.0, 1.0), "Predicted loss of attack beyond which a candidate is weak."),
        key("lambda_r", Number(0.0, 1.0), "Predicted loss of realism beyond which a candidate is weak."),
        key(
            "lambda_u",
            Number(0.01, 1.0),
            "Half width up to which a weak candidate is turned away even where the budget has room.",
        ),
        key(
            "audit_share",
            Number(audit_share[0], audit_share[1]),
            "Share of the budget drawn among those that the rank leaves out.",
        ),
    ];
    if of_pairs {
        surface.retain(|key| !NOT_OF_PAIRS.contains(&key.name));
        let agg = "Quantile of the uncertainties of a candidate's scenes that is the candidate's; 1 is the largest.";
        let abstain = "Uncertainty of a candidate above which the evaluator abstains: it expects what the parent does, and audits.";
        surface.push(key("aggregate", Number(0.5, 1.0), agg));
        surface.push(key("abstain_above", Number(0.01, 1.0), abstain));
    }
    surface
}

/// Returns the table of the configuration in which a key stands; `None` for a key that stands in none.
fn table_of(name: &str) -> Option<&'static str> {
    if ROUTING.contains(&name) {
        return Some("routing");
    }
    PAIRS.contains(&name).then_some("pairs")
}

impl SurfaceRange {
    /// Returns the range in words.
    pub fn describe(&self) -> String {
        match self {
            SurfaceRange::Number(low, high) => format!("a number from {low} to {high}"),
            SurfaceRange::Whole(low, high) => format!("a whole number from {low} to {high}"),
            SurfaceRange::Word(words) => format!("one of {}", words.join(", ")),
            SurfaceRange::Columns => "a list of names of columns".into(),
            SurfaceRange::Groups => "a list of names of feature groups".into(),
        }
    }

    fn holds(&self, value: &Value, schema: &FeatureSchema) -> bool {
        let each = |holds: &dyn Fn(&str) -> bool| {
            value.as_array().is_some_and(|items| items.iter().all(|item| item.as_str().is_some_and(holds)))
        };
        match self {
            SurfaceRange::Number(low, high) => value.as_f64().is_some_and(|x| (*low..=*high).contains(&x)),
            SurfaceRange::Whole(low, high) => value.as_u64().is_some_and(|x| (*low..=*high).contains(&x)),
            SurfaceRange::Word(words) => value.as_str().is_some_and(|word| words.contains(&word)),
            SurfaceRange::Columns => each(&|name| schema.columns.iter().any(|column| column.name == name)),
            SurfaceRange::Groups => each(&|name| FeatureGroup::ALL.iter().any(|group| group.name() == name)),
        }
    }
}

impl WorldPatch {
    /// Returns the configuration with the patch applied.
    ///
    /// # Errors
    /// A key outside the surface, a value outside its range, a patch that changes nothing.
    pub fn applied(
        &self,
        active: &WorldConfiguration,
        schema: &FeatureSchema,
        surface: &[SurfaceKey],
    ) -> Result<WorldConfiguration, PatchRefusal> {
        let unreadable = |error: serde_json::Error| PatchRefusal::Range {
            name: "the configuration".into(),
            found: error.to_string(),
            expected: "values that fit together".into(),
        };
        let mut whole = json!(active);
        for (name, value) in &self.changes {
            let key = surface.iter().find(|key| key.name == name).ok_or_else(|| outside(name, surface))?;
            if !key.range.holds(value, schema) {
                let (found, expected) = (value.to_string(), key.range.describe());
                return Err(PatchRefusal::Range { name: name.clone(), found, expected });
            }
            match key.range {
                SurfaceRange::Columns | SurfaceRange::Groups => {}
                _ => match table_of(key.name) {
                    Some(table) => whole[table][key.name] = value.clone(),
                    None => whole[key.name] = value.clone(),
                },
            }
        }
        if let Some(excluded) = self.excluded(schema) {
            whole["excluded_columns"] = json!(excluded);
        }
        let changed: WorldConfiguration = serde_json::from_value(whole).map_err(unreadable)?;
        if changed == *active { Err(PatchRefusal::Unchanged) } else { Ok(changed) }
    }

    /// Returns the columns that it leaves out, in the order of the schema, if it says anything about them.
    fn excluded(&self, schema: &FeatureSchema) -> Option<Vec<String>> {
        let list = |name: &str| self.changes.get(name).and_then(Value::as_array);
        let names = |list: Option<&Vec<Value>>, name: &str| {
            list.is_some_and(|items| items.iter().any(|item| item.as_str() == Some(name)))
        };
        let (groups, columns) = (list("excluded_groups"), list("excluded_columns"));
        groups.or(columns)?;
        let left_out =
            schema.columns.iter().filter(|column| names(groups, column.group.name()) || names(columns, &column.name));
        Some(left_out.map(|column| column.name.clone()).collect())
    }
}

fn outside(name: &str, surface: &[SurfaceKey]) -> PatchRefusal {
    let known: Vec<&str> = surface.iter().map(|key| key.name).collect();
    let mut parts = name.split(['.', '/', ' ']);
    if parts.any(|part| PROTECTED.contains(&part.to_ascii_lowercase().as_str())) {
        PatchRefusal::Protected(name.into(), known.join(", "))
    } else {
        PatchRefusal::Unknown(name.into(), known.join(", "))
    }
}

/// Returns the present values of the keys of the surface.
pub fn surface_values(configuration: &WorldConfiguration, schema: &FeatureSchema, surface: &[SurfaceKey]) -> Value {
    let whole = json!(configuration);
    let excluded = |name: &String| configuration.excluded_columns.contains(name);
    let of = |group: FeatureGroup| schema.columns.iter().filter(move |column| column.group == group);
    let is_out = |group: &FeatureGroup| of(*group).next().is_some() && of(*group).all(|column| excluded(&column.name));
    let groups: Vec<FeatureGroup> = FeatureGroup::ALL.into_iter().filter(is_out).collect();
    let single = schema.columns.iter().filter(|column| excluded(&column.name) && !groups.contains(&column.group));
    let columns: Vec<&String> = single.map(|column| &column.name).collect();
    let value = |key: &SurfaceKey| match key.range {
        SurfaceRange::Groups => json!(groups.iter().map(|group| group.name()).collect::<Vec<_>>()),
        SurfaceRange::Columns => json!(columns),
        _ => table_of(key.name).map_or(&whole, |table| &whole[table])[key.name].clone(),
    };
    Value::Object(surface.iter().map(|key| (key.name.to_string(), value(key))).collect::<Map<_, _>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::objects::world::FeatureColumn;
    use crate::objects::{CalibrationGroup, FamilyName, RoutingChoice, RoutingOptions, WorldModel};

    fn active() -> WorldConfiguration {
        WorldConfiguration {
            excluded_columns: vec![],
            model: WorldModel::Boosted,
            ridge_lambda: 300.0,
            trees: 60,
            learning_rate: 0.08,
            beta_attack: 0.9,
            beta_realism: 0.9,
            calibration_group: CalibrationGroup::Family,
            group_labels_min: 20,
            interval_level: 0.8,
            realism_weight: 1.0,
            explore: 0.25,
            routing: RoutingOptions {
                rollout_budget: 6,
                choice: RoutingChoice::Ranked,
                lambda_a: 0.15,
                lambda_r: 0.15,
                lambda_u: 0.2,
                audit_share: 0.33,
                min_labels: 30,
                pilot: None,
            },
            pairs: None,
        }
    }

    fn schema() -> FeatureSchema {
        let column = |(name, group): (&str, FeatureGroup)| FeatureColumn { name: name.into(), group };
        let columns = [("a", FeatureGroup::Edit), ("b", FeatureGroup::Edit), ("c", FeatureGroup::Probe)];
        FeatureSchema { families: vec![FamilyName::new("cat")], columns: columns.map(column).to_vec() }
    }

    fn applied(changes: Value) -> Result<WorldConfiguration, PatchRefusal> {
        let Value::Object(changes) = changes else { panic!("{changes}") };
        let patch = WorldPatch {
            changes: changes.into_iter().collect(),
            hypothesis: "h".into(),
            expected_gain: "g".into(),
            rationale: "r".into(),
            audit_policy: "p".into(),
            risk_notes: vec![],
        };
        patch.applied(&active(), &schema(), &update_surface([0.2, 0.5], &schema()))
    }

    #[test]
    fn a_patch_changes_its_keys_and_nothing_else() {
        let changed = applied(json!({"model": "ridge", "lambda_u": 0.3, "trees": 80, "audit_share": 0.25})).unwrap();
        let mut wanted = active();
        (wanted.model, wanted.trees) = (WorldModel::Ridge, 80);
        (wanted.routing.lambda_u, wanted.routing.audit_share) = (0.3, 0.25);
        assert_eq!(changed, wanted);
        let out = applied(json!({"excluded_groups": ["edit"], "excluded_columns": ["c"]})).unwrap();
        assert_eq!(out.excluded_columns, ["a", "b", "c"]);
        let values = surface_values(&out, &schema(), &update_surface([0.2, 0.5], &schema()));
        assert_eq!((&values["excluded_groups"], &values["excluded_columns"]), (&json!(["edit", "probe"]), &json!([])));
    }

    #[test]
    fn what_is_protected_has_no_path_and_says_so() {
        for name in
            ["rollout_budget", "routing.rollout_budget", "ego", "simulator.plant", "labels", "generator", "choice"]
        {
            let refused = applied(json!({"explore": 0.1, name: 3})).unwrap_err();
            assert!(matches!(&refused, PatchRefusal::Protected(found, _) if found == name), "{refused}");
            assert!(refused.to_string().contains("is protected") && refused.to_string().contains("beta_attack"));
        }
        assert!(matches!(applied(json!({"epsilon": 1})), Err(PatchRefusal::Unknown(..))));
    }

    #[test]
    fn values_outside_their_ranges_are_refused_with_what_is_expected() {
        for (changes, expected) in [
            (json!({"audit_share": 1.0}), "a number from 0.2 to 0.5"),
            (json!({"audit_share": 0.0}), "a number from 0.2 to 0.5"),
            (json!({"interval_level": 0.99}), "a number from 0.5 to 0.95"),
            (json!({"trees": 10.5}), "a whole number from 0 to 200"),
            (json!({"trees": -1}), "a whole number from 0 to 200"),
            (json!({"model": "oracle"}), "one of ridge, boosted"),
            (json!({"excluded_columns": ["no_such"]}), "a list of names of columns"),
            (json!({"excluded_groups": "edit"}), "a list of names of feature groups"),
            (json!({"explore": null}), "a number from 0 to 2"),
        ] {
            let refused = applied(changes).unwrap_err().to_string();
            assert!(refused.ends_with(expected), "{refused}");
        }
        assert_eq!(applied(json!({"explore": 0.25, "excluded_groups": []})), Err(PatchRefusal::Unchanged));
        assert_eq!(applied(json!({})), Err(PatchRefusal::Unchanged));
    }
}
