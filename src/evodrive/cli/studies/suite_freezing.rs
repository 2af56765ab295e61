//! Plays programs in scenes around a driver, in a form that may be frozen.

use crate::backend::{Backend, DriveContext, NoOutcome, ProgramContext};
use crate::cli::evolve::behind::{self, Asked};
use crate::cli::studies::suite_programs::Planned;
use crate::cli::studies::suite_stage::under;
use crate::cli::terminal::exit::Failure;
use crate::ego::Policy;
use crate::epoch::{Applied, SceneEntry, cluster_of};
use crate::evaluation::RealismOptions;
use crate::evaluation::metrics::realism::realism;
use crate::kernel::{Digest, Seed, Threads};
use crate::sim::{ContactClass, Intervention, Outcome, Plant, SimulatorOptions};
use crate::suite::{Candidate, PLAIN, class_of};

/// Part of a scene that may be frozen.
pub struct Freezable {
    pub candidate: Candidate,
    pub program: Option<usize>,
    pub rules: usize,
    pub intervention: Intervention,
    pub label: Outcome,
}

/// Driver around which it is frozen, and the conditions.
pub struct Freezing<'a> {
    /// For planners' random numbers.
    pub seed: u64,
    /// True if only contacts are frozen that a careful ego avoids.
    pub preventable_only: bool,
    /// Least realism of what a program does, and how it is scored.
    pub floor: Option<(f64, &'a RealismOptions)>,
    /// The classes of contact with an adversary of which one is frozen; empty where all are.
    pub classes: &'a [ContactClass],
    pub ego: &'a Policy,
    pub asked: Option<&'a Asked>,
    pub threads: &'a Threads,
}

impl Freezing<'_> {
    /// Returns what one program does in the scenes of its protocol, and the number of those scenes.
    pub fn of_program(
        &self,
        planned: &Planned,
        program: usize,
        rules: usize,
        entries: &[SceneEntry],
        reasons: &mut Vec<(String, String)>,
    ) -> Result<(Vec<Freezable>, usize), Failure> {
        let fit: Vec<usize> =
            (0..entries.len()).filter(|&i| entries[i].scene().staging.is_some() == planned.is_staged()).collect();
        if fit.is_empty() {
            let what = if planned.is_staged() { "staged for SafeBench" } else { "recorded or generated traffic" };
            reasons.push((
                planned.member.name.to_string(),
                format!("none of the scenes is {what}, which its family plays"),
            ));
        }
        let planners = self.asked.map(Asked::planners);
        let backend = behind::asked(self.asked, planners.as_ref());
        let applied = Applied {
            source: &planned.source,
            ego: self.ego,
            seed: planned.seed(),
            simulator: &planned.rules,
            backend,
            counsels: &planned.counsels,
            evaluation: &planned.evaluation,
        };
        let one = |_: usize, &place: &usize| -> Result<(Intervention, Outcome), NoOutcome> {
            let entry = &entries[place];
            let own = std::slice::from_ref(entry);
            let made = applied.interventions(&[&planned.program], own, &Threads::none());
            let made = made.map_err(|error| error.to_string())?;
            let intervention = made.into_iter().flatten().next();
            let intervention = intervention.unwrap_or_else(|| Err("no intervention".into()))?;
            let under = under(&planned.member);
            let label = self.label(entry, &applied.backend, applied.simulator, &intervention, under)?;
            Ok((intervention, label))
        };
        let played = self.threads.map(&fit, one);
        let mut kept = Vec::new();
        for (&place, played) in fit.iter().zip(played) {
            let entry = &entries[place];
            match played {
                Ok((_, label)) if self.keeps(&label) && self.is_below_floor(&label) => {
                    let reason = "what the program does is less realistic than --min-realism asks for".to_string();
                    reasons.push((format!("{} in {}", planned.member.name, entry.scene().id), reason));
                }
                Ok((intervention, label)) if self.keeps(&label) => {
                    let candidate = candidate(entry, planned.member.family.as_str(), planned.member.program, &label);
                    kept.push(Freezable { candidate, program: Some(program), rules, intervention, label });
                }
                Ok(_) => {}
                Err(NoOutcome::Scene(why)) => {
                    reasons.push((format!("{} in {}", planned.member.name, entry.scene().id), why.to_string()));
                }
                Err(NoOutcome::Stop(error)) => return Err(error.into()),
            }
        }
        Ok((kept, fit.len()))
    }

    /// The scenes as they are.
    pub fn plain(
        &self,
        rules: usize,
        simulator: &SimulatorOptions,
        entries: &[SceneEntry],
        reasons: &mut Vec<(String, String)>,
    ) -> Result<Vec<Freezable>, Failure> {
        let planners = self.asked.map(Asked::planners);
        let backend = behind::asked(self.asked, planners.as_ref());
        let unstaged: Vec<&SceneEntry> = entries.iter().filter(|entry| entry.scene().staging.is_none()).collect();
        // Scenes of SafeBench's families have no traffic to speak of without a program.
        let own: Vec<&SceneEntry> = if unstaged.is_empty() { entries.iter().collect() } else { unstaged };
        let (nothing, under) = (Intervention::default(), ProgramContext::Plain);
        let labels = self.threads.map(&own, |_, entry| self.label(entry, &backend, simulator, &nothing, under));
        let mut kept = Vec::new();
        for (entry, label) in own.into_iter().zip(labels) {
            match label {
                Ok(label) => {
                    // A control is to be what the pool is: its contacts are not chosen by.
                    let any = candidate(entry, PLAIN, Digest::of_bytes(b""), &label);
                    let candidate = Candidate { class: String::new(), ..any };
                    kept.push(Freezable {
                        candidate,
                        program: None,
                        rules,
                        intervention: Intervention::default(),
                        label,
                    });
                }
                Err(NoOutcome::Scene(why)) => reasons.push((format!("plain in {}", entry.scene().id), why.to_string())),
                Err(NoOutcome::Stop(error)) => return Err(error.into()),
            }
        }
        Ok(kept)
    }

    fn label(
        &self,
        entry: &SceneEntry,
        backend: &Backend<'_>,
        simulator: &SimulatorOptions,
        intervention: &Intervention,
        under: ProgramContext,
    ) -> Result<Outcome, NoOutcome> {
        let plant = Plant::with_options(entry.prepared.clone(), simulator)?;
        backend.rollout(&plant, intervention, self.ego, DriveContext { seed: Seed(self.seed), under })
    }

    fn is_below_floor(&self, label: &Outcome) -> bool {
        self.floor.is_some_and(|(floor, options)| realism(label, options).1 < floor)
    }

    /// A program that does nothing in a scene makes no case of it.
    fn keeps(&self, label: &Outcome) -> bool {
        let preventable =
            || label.contact.is_some_and(|contact| contact.adversary && contact.preventable() == Some(true));
        let asked_for =
            || label.contact.is_some_and(|contact| contact.adversary && self.classes.contains(&contact.class));
        label.acted() && (!self.preventable_only || preventable()) && (self.classes.is_empty() || asked_for())
    }
}

fn candidate(entry: &SceneEntry, family: &str, program: Digest, label: &Outcome) -> Candidate {
    Candidate {
        family: family.to_string(),
        scene: entry.scene().id.clone(),
        cluster: entry.group().map_or_else(
            || cluster_of(entry.features()).to_string(),
            |(traffic_family, _)| traffic_family.name().to_string(),
        ),
        class: class_of(label).to_string(),
        program,
        digest: entry.digest,
    }
}
