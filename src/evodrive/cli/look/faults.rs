//! Finds who is at fault for the held-out contacts of a run that was labelled without that question: parents and reported programs
//! are played there again, and the answers stand beside their labels. They are reported, and nothing is searched by them.

use std::collections::{BTreeMap, BTreeSet};

use crate::cli::records::folder::RunFolder;
use crate::cli::scenes::files;
use crate::cli::studies::{apply, packed};
use crate::cli::terminal::exit::Failure;
use crate::ego::Policy;
use crate::epoch::SceneEntry;
use crate::evidence::RecordedRun;
use crate::experiment::ProgramFile;
use crate::families;
use crate::kernel::Threads;
use crate::objects::event::LineageResult;
use crate::objects::{SceneScore, Score};
use std::sync::Arc;

/// A finished run whose held-out labels say who is at fault and which drivers avoid a contact.
///
/// # Errors
/// An unfinished run, one on SafeBench's routes, of another simulator or of a planner of one's own; labels that come out otherwise.
pub fn recorded(folder: &RunFolder, jobs: usize) -> Result<RecordedRun, Failure> {
    let (mut run, threads) = (folder.recorded()?, files::threads(jobs)?);
    let place = folder.dir.display();
    let experiment = folder.read_experiment()?;
    if experiment.simulator.backend.is_some() || experiment.evaluation.safebench().is_some() {
        return Err(Failure::bad_input(format!(
            "{place}: --at-fault plays contacts again in our own simulator on recorded or generated traffic; take this run out, or --at-fault"
        )));
    }
    let pool = folder.read_pool()?;
    let closed = run.opened.held_out_scenes.iter().filter_map(|id| pool.scene(id)).cloned().map(Arc::new);
    let scenes: Vec<_> = closed.collect();
    let entries = threads.map(&scenes, |_, scene| SceneEntry::new(scene.clone()));
    let lineages = run.result.as_ref().map_or_else(Vec::new, |result| result.lineages.clone());
    for lineage in &lineages {
        add(folder, &mut run, lineage, &entries, &threads)?;
    }
    Ok(run)
}

/// Adds what is said of one lineage's contacts.
fn add(
    folder: &RunFolder,
    run: &mut RecordedRun,
    lineage: &LineageResult,
    entries: &[SceneEntry],
    threads: &Threads,
) -> Result<(), Failure> {
    let mut file = packed::packed_of(folder, run, lineage.evolved.solution.as_str())?;
    (file.conditions.simulator.at_fault, file.conditions.simulator.jury) = (true, true);
    for (name, ego) in drivers(folder, run, &file)? {
        let (sources, counsels) = (families::sources_by_hand(), apply::counsels(&file, entries));
        let applied = apply::as_conditioned(&file, &sources, &ego, &counsels)?;
        let labelled = applied.label(&[&file.parent, &file.program], entries, threads)?;
        for (solution, labelled) in [&lineage.parent.solution, &lineage.evolved.solution].into_iter().zip(labelled) {
            let own = run.held_out.iter_mut().filter(|of| of.lineage == lineage.lineage && of.solution == *solution);
            for held_out in own {
                say(&mut held_out.score, &name, &labelled.score)?;
            }
        }
    }
    Ok(())
}

/// The lineage's drivers by the names that its labels have.
fn drivers(folder: &RunFolder, run: &RecordedRun, file: &ProgramFile) -> Result<Vec<(String, Policy)>, Failure> {
    let labels = run.held_out.iter().flat_map(|of| of.score.scenes.iter().map(move |label| (&of.lineage, label)));
    let own = labels.filter(|(lineage, _)| **lineage == file.program.lineage_id).map(|(_, label)| label);
    let names: Vec<String> = own.flat_map(|label| label.by_ego.keys().cloned()).collect();
    let names = if names.is_empty() { vec![file.conditions.ego.clone()] } else { names };
    let distinct: BTreeSet<String> = names.into_iter().collect();
    let of = |name: String| {
        let learned = packed::own_weights(folder, file)?.filter(|_| name == "learned");
        let ego = learned.map_or_else(|| apply::driver(&name), Ok)?;
        Ok((name, ego))
    };
    distinct.into_iter().map(of).collect()
}

/// Takes over what the same contacts, played again, are said to be.
fn say(score: &mut Score, ego: &str, again: &Score) -> Result<(), Failure> {
    let played: BTreeMap<&str, &SceneScore> = again.scenes.iter().map(|label| (label.scene.as_str(), label)).collect();
    for label in &mut score.scenes {
        let Some(played) = played.get(label.scene.as_str()) else { continue };
        if let Some(alone) = label.by_ego.get_mut(ego) {
            said(alone, played)?;
        }
        // The label of a scene with several drivers shows the contact of the first.
        let is_first =
            label.by_ego.is_empty() || label.by_ego.get(ego).is_some_and(|alone| alone.request == label.request);
        if is_first {
            said(label, played)?;
        }
    }
    Ok(())
}

fn said(label: &mut SceneScore, played: &SceneScore) -> Result<(), Failure> {
    match (&mut label.contact, &played.contact) {
        (None, None) => Ok(()),
        (Some(met), Some(again)) if (&met.class, met.adversary) == (&again.class, again.adversary) => {
            (met.fault, met.avoided_by) = (again.fault.clone(), again.avoided_by);
            Ok(())
        }
        _ => Err(Failure::divergence(format!(
            "scene {}: played again its contact is another one than was recorded; use the release that made the run",
            label.scene
        ))),
    }
}
