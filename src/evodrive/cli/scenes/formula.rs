//! A condition on scenes: an expression over the quantities of a scene, in the language of mechanisms (`docs/LANGUAGE.md`).

use crate::adapters::vocabulary;
use crate::objects::ValueType;
use crate::objects::expr::{Compiled, Expr, Scope};
use crate::scene::SceneFeatures;

/// An expression over a scene, ready to evaluate.
#[derive(Clone, Debug)]
pub struct SceneFormula(Compiled);

/// A text that is no condition on a scene.
#[derive(Debug, thiserror::Error)]
#[error(
    "{text:?} is not a valid condition on a scene: {problem}; `evodrive features` lists what it may read (the lines of `scene`)"
)]
pub struct SceneFormulaError {
    text: String,
    problem: String,
}

impl SceneFormula {
    /// Reads a condition.
    ///
    /// # Errors
    /// A text that is no expression, a name that no scene has, a value that is no truth value.
    pub fn parse(text: &str) -> Result<SceneFormula, SceneFormulaError> {
        let scope = Scope::new(vocabulary::SCENE.iter().map(|feature| (feature.name, feature.value)));
        let read = Expr::parse(text).and_then(|expr| expr.compile(&scope));
        let wrong = |problem: String| SceneFormulaError { text: text.into(), problem };
        match read {
            Ok(code) if code.value_type() == ValueType::Boolean => Ok(SceneFormula(code)),
            Ok(_) => Err(wrong("expected a truth value, e.g. vehicle_count >= 5, found a number".into())),
            Err(error) => Err(wrong(error.to_string())),
        }
    }

    /// Returns `true` if it holds for a scene with these quantities.
    pub fn holds(&self, features: &SceneFeatures) -> bool {
        let values: Vec<f64> =
            vocabulary::SCENE.iter().map(|feature| features.value(feature.name).unwrap_or_default()).collect();
        self.0.boolean(&values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::LaneGraph;
    use crate::scene::fixture::two_lane_scene;

    #[test]
    fn a_condition_holds_where_its_quantities_say_so() {
        let scene = two_lane_scene();
        let features = SceneFeatures::of(&scene, &LaneGraph::of(&scene.road));
        let holds = |text: &str| SceneFormula::parse(text).map(|formula| formula.holds(&features));
        let count = features.vehicle_count;
        for feature in vocabulary::SCENE {
            assert!(features.value(feature.name).is_some(), "{}", feature.name);
        }
        assert!(holds(&format!("vehicle_count >= {count} and not has_light")).unwrap());
        assert!(!holds(&format!("vehicle_count > {count}")).unwrap());
        for (bad, expected) in
            [("vehicle_count", "found a number"), ("vehicle_cuont > 1", "vehicle_cuont"), ("1 +", "1 +")]
        {
            let refused = holds(bad).unwrap_err().to_string();
            assert!(refused.contains(expected) && refused.contains("evodrive features"), "{refused}");
        }
    }
}
