//! Which model of an experiment plays which role.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::Experiment;
use crate::llm::{Drawn, Here, ModelSpec};
use crate::objects::Role;

/// The model of each role.
pub fn by_role(experiment: &Experiment) -> BTreeMap<Role, ModelSpec> {
    experiment.roles.iter().filter_map(|(role, name)| Some((*role, spec(experiment, name)?))).collect()
}

/// A model with those that are drawn in its place.
fn spec(experiment: &Experiment, name: &str) -> Option<ModelSpec> {
    let plain = |name: &str| Some(experiment.models.get(name)?.spec(name));
    let model = plain(name)?;
    let shares = &experiment.models.get(name)?.shares;
    if shares.is_empty() {
        return Some(model);
    }
    let of = shares.iter().filter_map(|(name, share)| Some((*share, plain(name)?))).collect();
    let drawn = Some(Arc::new(Drawn { seed: experiment.seed, of }));
    Some(ModelSpec { here: Here { drawn, ..model.here }, ..model })
}

/// The names of all models that may be asked: those of roles, and those that are drawn in their place.
pub fn asked(experiment: &Experiment) -> BTreeSet<&str> {
    let options = |name: &String| experiment.models.get(name);
    let drawn = experiment.roles.values().filter_map(options).flat_map(|options| options.shares.keys());
    experiment.roles.values().chain(drawn).map(String::as_str).collect()
}

/// Which models answered which roles, in one line.
pub fn provenance(experiment: &Experiment) -> String {
    let mut roles_of: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for (role, spec) in by_role(experiment) {
        roles_of.entry(spec.label()).or_default().push(role.name());
    }
    if let [label] = roles_of.keys().collect::<Vec<_>>().as_slice() {
        return label.to_string();
    }
    let parts = roles_of.iter().map(|(label, roles)| format!("{label} as {}", roles.join(", ")));
    parts.collect::<Vec<_>>().join("; ")
}
