//! `bundle verify`: the run of a bundle carried out again from nothing but the bundle, and what of it was executed.

use serde_json::json;
use std::collections::BTreeSet;
use std::path::Path;

use crate::bundle::{Opened, key_name, verified};
use crate::cli::evolve::run;
use crate::cli::records::bundle::{VerifyOptions, check_versions, exit_of, key_text, unpack};
use crate::cli::records::covered::{coverage, exchanges};
use crate::cli::records::folder::RunFolder;
use crate::cli::terminal::{answer::Answer, answer::progress, exit::Failure};
use crate::evidence::{Gravity, RecordedRun, audit};
use crate::families::{self, grammar::REHEARSALS_MAX};
use crate::kernel::Digest;
use crate::llm::Cassette;
use crate::objects::FamilyName;
use crate::stage::Source;
use crate::store::{self, Scratch};

pub fn run(options: &VerifyOptions, jobs: usize) -> Result<Answer, Failure> {
    let place = options.scratch.clone().unwrap_or_else(temporary);
    let scratch = Scratch::under(&place, "evodrive-bundle-")?;
    let (opened, folder) = unpack(&options.read, &scratch.dir.join("run"))?;
    let signed = signature(options, &opened)?;
    let bundle = &options.read.bundle;
    let answer = if options.stored {
        stored(&folder, &opened, &signed, bundle)?
    } else {
        executed(&folder, &opened, &signed, bundle, jobs)?
    };
    drop(scratch);
    Ok(answer)
}

/// Returns the system's folder for temporary files.
#[allow(clippy::disallowed_methods)]
fn temporary() -> std::path::PathBuf {
    std::env::temp_dir()
}

/// Describes the signature, which is verified if a key is named.
fn signature(options: &VerifyOptions, opened: &Opened) -> Result<String, Failure> {
    let bundle = options.read.bundle.display().to_string();
    match (&options.key, &opened.signature) {
        (None, None) => Ok("none: nothing shows who made the file".into()),
        (None, Some(_)) => Ok("not checked: name the signer's public key with --key".into()),
        (Some(_), None) => Err(Failure::bad_input(format!(
            "{bundle}: expected a signature, found none; `evodrive bundle create --sign` makes one"
        ))),
        (Some(path), Some(envelope)) => {
            let (file, pem) = (path.display().to_string(), key_text(path)?);
            verified(&bundle, &opened.manifest, &opened.manifest_bytes, envelope, &file, &pem)?;
            Ok(format!("holds, by key {}", key_name(&file, &pem)?))
        }
    }
}

/// Holds the stored bytes against each other.
fn stored(folder: &RunFolder, opened: &Opened, signed: &str, bundle: &Path) -> Result<Answer, Failure> {
    let mut damage: Vec<String> =
        store::fsck_transcript(&folder.transcript())?.iter().map(ToString::to_string).collect();
    let kept = folder.store().join("objects.pack").exists();
    let seen = kept.then(|| store::fsck(&folder.store(), true)).transpose()?;
    damage.extend(seen.iter().flat_map(|seen| &seen.damage).map(ToString::to_string));
    let run = folder.recorded()?;
    damage.extend(coverage(folder, &run, seen.as_ref(), true).damage);
    let findings = audit(&run);
    damage.extend(findings.iter().filter(|of| of.gravity == Gravity::Breach).map(ToString::to_string));
    let clean = damage.is_empty();
    let mut text = match damage.len() {
        0 => format!("whole: {}: its stored bytes agree with each other; nothing was executed\n", bundle.display()),
        count => format!("damaged: {}: {}\n", bundle.display(), format_args!("{count} findings")),
    };
    text.extend(damage.iter().map(|of| format!("damaged: {of}\n")));
    text.push_str("executed again: nothing; files, hash chain, seal and records were checked against each other\n");
    text.push_str(&format!("signature: {signed}\nroot: {}", opened.manifest.root));
    let object = json!({"bundle": bundle, "root": opened.manifest.root, "clean": clean, "damage": damage, "signature": signed,
        "executed": {"events": 0, "rollouts": 0}});
    Ok(Answer { exit: exit_of(clean), ..Answer::new(text, object) })
}

/// Checks that this build's families offer what those of the bundle offered: a contract counts into every question, so
/// another one has no recorded answer. A run that closes parts of a contract passes here; its first event tells of it.
fn check_contracts(run: &RecordedRun, bundle: &Path) -> Result<(), Failure> {
    let sources = families::sources();
    let other = |(family, then): &(&FamilyName, &Digest)| -> bool {
        // A contract offers what a published parent needs only if such a parent takes part.
        let differs = |source: Source| source.contract.digest().is_ok_and(|now| now != **then);
        let rehearsing =
            |source: &Source| (1..=REHEARSALS_MAX).all(|most| differs(families::rehearsing(source.clone(), most)));
        let all = |source: &Source| differs(source.clone()) && rehearsing(source);
        sources.get(family).is_none_or(|source| all(source) && all(&source.clone().offering_for([])))
    };
    let Some((family, _)) = run.opened.contracts.iter().filter(|_| run.opened.without.is_empty()).find(other) else {
        return Ok(());
    };
    Err(Failure::bad_input(format!(
        "{}: made by another version: the contract of family {family} has changed since, and so have the questions to its models. Verify it with the \
         build that made it, or `--stored` to hold the stored bytes against each other",
        bundle.display()
    )))
}

/// Derives every event again and simulates every rollout again.
fn executed(folder: &RunFolder, opened: &Opened, signed: &str, bundle: &Path, jobs: usize) -> Result<Answer, Failure> {
    check_versions(&opened.manifest, bundle)?;
    check_contracts(&folder.recorded()?, bundle)?;
    progress(format!("{}: the run is carried out again from the bundle alone", bundle.display()));
    let done = run::verify_quietly(folder, jobs)?;
    let rollouts = done.json["rollouts"]["simulated"].as_u64().unwrap_or_default();
    let mut events = 0u64;
    store::each_event(&folder.transcript(), &mut |_| events += 1)?;
    let run = folder.recorded()?;
    let asked: BTreeSet<Digest> = exchanges(&run).map(|exchange| exchange.request).collect();
    let kept = Cassette::load(&folder.cassette())?;
    let others = kept.exchanges().iter().filter(|recorded| !asked.contains(&recorded.key)).count();
    let answers = asked.len();
    let models: BTreeSet<String> = run.models().into_values().collect();
    let models: Vec<String> = models.into_iter().collect();
    let elsewhere = folder.rollouts().exists();
    let (simulated, replayed) = if elsewhere {
        ("outcomes summed up again from recorded motion", ", and motion of another simulator (rollouts.jsonl)")
    } else {
        ("simulated again", "")
    };
    let unasked = match others {
        0 => String::new(),
        others => format!("\nnot used: {others} more answers in the cassette, for which this run did not ask"),
    };
    let text = format!(
        "verified: {}: the run of {} comes out of the bundle alone, bit for bit\n\
         executed again: {events} events derived and as recorded (gates, labels, decisions, every number of result.json); {rollouts} rollouts {simulated}\n\
         only replayed: {answers} answers of models ({}){replayed}{unasked}\n\
         signature: {signed}\n\
         root: {}",
        bundle.display(),
        opened.manifest.name,
        models.join("; "),
        opened.manifest.root
    );
    let object = json!({"bundle": bundle, "root": opened.manifest.root, "clean": true, "signature": signed,
        "executed": {"events": events, "rollouts": rollouts, "simulated_here": !elsewhere},
        "replayed": {"answers": answers, "answers_not_asked_for": others, "models": models, "rollouts_of_another_simulator": elsewhere}});
    Ok(Answer::new(text, object))
}
