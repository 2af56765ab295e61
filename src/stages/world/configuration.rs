//! Bounds of an evaluator's update surface: the configurations that it can have.

use super::slope;
use crate::objects::{FeatureSchema, WorldConfiguration, WorldModel};

/// A configuration that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConfigurationError {
    /// An option is out of its range.
    #[error("world option {option} is {value}; expected {expected}: correct it in the experiment file")]
    Range {
        /// Name of the option.
        option: &'static str,
        /// Its value.
        value: f64,
        /// Values that it may have.
        expected: &'static str,
    },
    /// No column of the schema has this name.
    #[error("world option excluded_columns names {0:?}, which is not a column of the feature schema")]
    UnknownColumn(String),
    /// It ranks by our own simulator, and the schema has no columns of that, or the configuration leaves one out.
    #[error(
        "world option model is \"simulator\" and reads the columns `simulated`, which {0}; take another model, or leave them in"
    )]
    NotSimulated(&'static str),
    /// Two options of which one takes away what the other rests on.
    #[error("world option {0} beside [world.pairs]: {1}; remove one of the two")]
    BesidePairs(&'static str, &'static str),
}

/// Refuses numbers outside their range and columns that do not exist.
pub fn validate(configuration: &WorldConfiguration, schema: &FeatureSchema) -> Result<(), ConfigurationError> {
    let (c, r) = (configuration, &configuration.routing);
    let positive = "a number in (0, 1e9]";
    let share = "a number in [0, 1]";
    let checks = [
        ("ridge_lambda", c.ridge_lambda, c.ridge_lambda > 0.0 && c.ridge_lambda <= 1e9, positive),
        ("beta_attack", c.beta_attack, (0.0..=1.0).contains(&c.beta_attack), share),
        ("beta_realism", c.beta_realism, (0.0..=1.0).contains(&c.beta_realism), share),
        ("learning_rate", c.learning_rate, c.learning_rate > 0.0 && c.learning_rate <= 1.0, "a number in (0, 1]"),
        ("interval_level", c.interval_level, (0.5..=0.99).contains(&c.interval_level), "a number in [0.5, 0.99]"),
        ("realism_weight", c.realism_weight, (0.0..=1e3).contains(&c.realism_weight), "a number in [0, 1000]"),
        ("explore", c.explore, (0.0..=1e3).contains(&c.explore), "a number in [0, 1000]"),
        ("trees", f64::from(c.trees), c.trees <= 1000, "a whole number up to 1000"),
        ("routing.lambda_a", r.lambda_a, (0.0..=1.0).contains(&r.lambda_a), share),
        ("routing.lambda_r", r.lambda_r, (0.0..=1.0).contains(&r.lambda_r), share),
        ("routing.lambda_u", r.lambda_u, r.lambda_u > 0.0 && r.lambda_u <= 1e9, positive),
        ("routing.audit_share", r.audit_share, (0.0..=1.0).contains(&r.audit_share), share),
    ];
    let pilot = r.pilot.map(|pilot| {
        let (scenes, prior) = (pilot.scenes, pilot.prior_scenes);
        [
            ("routing.pilot.scenes", f64::from(scenes), (1..=1000).contains(&scenes), "a whole number from 1 to 1000"),
            ("routing.pilot.prior_scenes", prior, prior > 0.0 && prior <= 1e6, "a number in (0, 1000000]"),
        ]
    });
    for (option, value, holds, expected) in checks.into_iter().chain(pilot.into_iter().flatten()) {
        if !holds {
            return Err(ConfigurationError::Range { option, value, expected });
        }
    }
    if let Some(pairs) = &c.pairs {
        let (aggregate, abstain) = (pairs.aggregate, pairs.abstain_above);
        let ranges = [
            ("pairs.aggregate", aggregate, (0.5..=1.0).contains(&aggregate), "a number in [0.5, 1]"),
            ("pairs.abstain_above", abstain, abstain > 0.0 && abstain <= 1.0, "a number in (0, 1]"),
        ];
        if let Some((option, value, _, expected)) = ranges.into_iter().find(|(_, _, holds, _)| !holds) {
            return Err(ConfigurationError::Range { option, value, expected });
        }
        let besides = ConfigurationError::BesidePairs;
        if c.model != WorldModel::Ridge {
            return Err(besides(
                "model",
                "the uncertainty of a pair is that of the ridge line; write model = \"ridge\"",
            ));
        }
        if r.pilot.is_some() {
            return Err(besides("routing.pilot", "a pilot corrects the rank of candidates, and pairs go by value"));
        }
    }
    if c.model == WorldModel::Simulator {
        let places = slope::places(schema).ok_or(ConfigurationError::NotSimulated("are not in the schema"))?;
        if places.iter().any(|place| c.excluded_columns.contains(&schema.columns[*place].name)) {
            return Err(ConfigurationError::NotSimulated("excluded_columns leaves out"));
        }
    }
    match c.excluded_columns.iter().find(|name| !schema.columns.iter().any(|column| column.name == **name)) {
        Some(unknown) => Err(ConfigurationError::UnknownColumn(unknown.clone())),
        None => Ok(()),
    }
}
