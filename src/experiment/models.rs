//! Which model of an experiment plays which role.

use std::collections::BTreeMap;

use super::Experiment;
use crate::llm::ModelSpec;
use crate::objects::Role;

/// The model of each role.
pub fn by_role(experiment: &Experiment) -> BTreeMap<Role, ModelSpec> {
    let spec = |name: &String| Some(experiment.models.get(name)?.spec(name));
    experiment.roles.iter().filter_map(|(role, name)| Some((*role, spec(name)?))).collect()
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
