//! Which parts of a program have an effect in the scenes of a window: which rules hold there, and in which scenes two programs must
//! do the same.

use crate::compiler::{CompileFailure, Prepared};
use crate::epoch::RunError;
use crate::epoch::setting::study::{LineageSpec, Study};
use crate::kernel::{Digest, canon::CanonError};
use crate::objects::Program;
use crate::stage::scene_values;

/// Parts of a program that have an effect in one scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InScene {
    /// Digest of all that decides there: two programs that are alike here compile to the same, bit for bit, and have one label.
    pub digest: Digest,
    /// Places of the rules that hold.
    pub rules: Vec<usize>,
    /// True if its select gate opens the scene.
    pub opens: bool,
}

impl InScene {
    /// In a scene with these values of `vocabulary::SCENE`.
    pub fn of(prepared: &Prepared<'_>, scene_values: &[f64]) -> Result<InScene, CanonError> {
        let (rules, opens) = (prepared.rules(scene_values), prepared.opens(scene_values));
        Ok(InScene { digest: prepared.in_effect(scene_values)?, rules, opens })
    }
}

/// A program in each scene of a window, in its order. The first error says that the program does not keep its contract.
pub fn in_effect(
    study: &Study,
    spec: &LineageSpec,
    program: &Program,
    window: &[usize],
) -> Result<Result<Vec<InScene>, CompileFailure>, RunError> {
    let prepared = match Prepared::new(program, study.source(spec)?) {
        Ok(prepared) => prepared,
        Err(failure) => return Ok(Err(failure)),
    };
    let of = |&place: &usize| Ok(InScene::of(&prepared, &scene_values(study.scenes[place].features()))?);
    window.iter().map(of).collect::<Result<_, RunError>>().map(Ok)
}
