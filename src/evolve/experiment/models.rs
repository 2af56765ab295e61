//! Models of an experiment by the roles that they play.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::Experiment;
use crate::llm::{Drawn, Here, ModelSpec, client::SCRIPTED};
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

/// Returns `true` if every question goes to the scripted model, which answers it alike every time: such answers need not be kept.
pub fn is_scripted(experiment: &Experiment) -> bool {
    let scripted = |name: &&str| experiment.models.get(*name).is_some_and(|options| options.kind == SCRIPTED);
    asked(experiment).iter().all(scripted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn quickstart() -> Experiment {
        Experiment::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/quickstart.toml")).unwrap()
    }

    #[test]
    fn a_role_of_several_models_asks_them_all_and_draws_by_the_seed() {
        let mut experiment = quickstart();
        let other = experiment.models["scripted"].clone();
        let shares = BTreeMap::from([("other".to_string(), 2.0), ("scripted".to_string(), 1.0)]);
        let mix = super::super::ModelOptions { kind: "drawn".into(), shares, ..other.clone() };
        experiment.models.extend([("other".to_string(), other), ("mix".to_string(), mix)]);
        experiment.roles.insert(Role::Actor, "mix".into());
        let drawn = by_role(&experiment)[&Role::Actor].here.drawn.clone().unwrap();
        let of: Vec<(f64, &str)> = drawn.of.iter().map(|(share, model)| (*share, model.name.as_str())).collect();
        assert_eq!((drawn.seed, of), (experiment.seed, vec![(2.0, "other"), (1.0, "scripted")]));
        assert_eq!(asked(&experiment), BTreeSet::from(["mix", "other", "scripted"]));
        let label = by_role(&experiment)[&Role::Actor].label();
        assert!(label.starts_with("drawn (mix: 2 scripted (other, "), "{label}");
    }

    #[test]
    fn how_replies_are_read_counts_into_the_experiment_and_not_into_its_models() {
        let (plain, mut unwrapping) = (quickstart(), quickstart());
        unwrapping.models.get_mut("scripted").unwrap().unwrap = true;
        assert_ne!(plain.digest().unwrap(), unwrapping.digest().unwrap());
        assert_eq!(by_role(&plain), by_role(&unwrapping));
        assert!(by_role(&unwrapping)[&Role::Actor].here.unwrap);
    }
}
