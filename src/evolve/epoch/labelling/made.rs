//! A cache of compiled programs: what a program does in one scene, kept for the next caller.

use std::sync::OnceLock;

use super::probe::probe;
use crate::compiler::{CompileFailure, Compiled, Prepared, Searched};
use crate::kernel::{Digest, canon::CanonError};
use crate::objects::{Probe, Program};
use crate::stage::{Situation, Source};

/// A compiled program, and what a trial tells of it. Trials of many children ask for the same one.
#[derive(Debug)]
pub struct Made {
    /// Result of the compiler.
    pub compiled: Compiled,
    probed: OnceLock<(Digest, Probe)>,
}

impl Made {
    /// Wraps a compiled program of which no trial has told anything yet.
    pub fn of(compiled: Compiled) -> Made {
        Made { compiled, probed: OnceLock::new() }
    }

    /// Digest of the intervention, and its probe in the scene it was compiled for.
    pub fn probed(&self, situation: &Situation) -> Result<(Digest, Probe), CanonError> {
        if let Some(probed) = self.probed.get() {
            return Ok(*probed);
        }
        let intervention = &self.compiled.intervention;
        let digest = Digest::of("evodrive/intervention/1", intervention)?;
        Ok(*self.probed.get_or_init(|| (digest, probe(situation, intervention))))
    }
}

/// A program that is prepared when it is first needed: never where everything is on record.
#[derive(Debug)]
pub struct Lazy<'p> {
    program: &'p Program,
    prepared: OnceLock<Result<Prepared<'p>, CompileFailure>>,
}

impl<'p> Lazy<'p> {
    /// Nothing is prepared yet.
    pub fn new(program: &'p Program) -> Lazy<'p> {
        Lazy { program, prepared: OnceLock::new() }
    }

    pub fn program(&self) -> &'p Program {
        self.program
    }

    /// The program, prepared for its family.
    pub fn prepared(&self, source: &'p Source, searched: &'p Searched) -> Result<&Prepared<'p>, &CompileFailure> {
        let prepare = || Prepared::new(self.program, source).map(|prepared| prepared.sharing(searched));
        self.prepared.get_or_init(prepare).as_ref()
    }
}
