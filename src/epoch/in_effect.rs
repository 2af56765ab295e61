//! In which scenes two programs are known to do the same.

use super::{
    RunError,
    study::{LineageSpec, Study},
};
use crate::compiler::{CompileFailure, Prepared};
use crate::kernel::Digest;
use crate::objects::Program;
use crate::stage::scene_values;

/// All of a program that decides in each scene: two that are alike there compile to the same, bit for bit, and have one label.
pub fn in_effect(
    study: &Study,
    spec: &LineageSpec,
    program: &Program,
    places: &[usize],
) -> Result<Vec<Digest>, RunError> {
    let unfit = |error: CompileFailure| RunError::Study(format!("{}: {error}", program.solution_id));
    let prepared = Prepared::new(program, study.source(spec)?).map_err(unfit)?;
    let of = |&place: &usize| Ok(prepared.in_effect(&scene_values(study.scenes[place].features()))?);
    places.iter().map(of).collect()
}
