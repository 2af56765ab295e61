//! `shard withdraw`: one record is taken out of a run by name, so that it is asked for again.

use clap::Args;
use serde_json::json;

use crate::cli::evolve::held::Held;
use crate::cli::records::run_name::OneRun;
use crate::cli::terminal::typed::resume_command;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::kernel::Digest;
use crate::shard::Withdrawn;
use crate::store::MemoKind;

/// Digits of a name that are enough where only one record has them.
const DIGITS_MIN: usize = 8;

#[derive(Debug, Args)]
#[command(allow_missing_positional = true)]
pub struct WithdrawOptions {
    #[command(flatten)]
    pub run: OneRun,
    /// The record: the digest of its request (its task's key) or of its bytes, or the first digits of either.
    pub record: String,
    /// Why, for who reads the run later.
    #[arg(long)]
    pub reason: String,
}

pub fn run(options: &WithdrawOptions) -> Result<Answer, Failure> {
    let Held { folder, objects, .. } = Held::of(options.run.folder()?)?;
    let name = options.record.to_lowercase();
    let fits = |digest: &Digest| digest.to_hex().starts_with(&name);
    let (mut found, place) = (objects.recorded(), folder.dir.display().to_string());
    found.retain(|(kind, key, object)| *kind != MemoKind::Llm && (fits(key) || fits(object)));
    let (kind, request, record) = match (found.as_slice(), name.len() >= DIGITS_MIN) {
        ([one], true) => *one,
        (_, false) => {
            return Err(Failure::bad_input(format!(
                "{}: expected at least {DIGITS_MIN} hex digits of a record's name",
                options.record
            )));
        }
        ([], _) => {
            return Err(Failure::bad_input(format!(
                "{}: no record of {place} is called that; `evodrive why` names those that a number rests on",
                options.record
            )));
        }
        (several, _) => {
            let named: Vec<String> = several.iter().map(|(kind, key, _)| format!("{kind} {key}")).collect();
            return Err(Failure::bad_input(format!("{}: several records: {}", options.record, named.join(", "))));
        }
    };
    let withdrawn = Withdrawn { kind, request, record, reason: options.reason.clone() };
    // Noted first: a record that is gone without a note would be loss.
    withdrawn.note(&folder.withdrawn())?;
    objects.withdraw(kind, &request)?;
    let text = format!(
        "{place}: withdrawn: {kind} request {request}, record {record}\n  noted in {}; the run asks for it again: {}\n",
        folder.withdrawn().display(),
        resume_command(&folder.dir)
    );
    Ok(Answer::new(text, json!({"folder": folder.dir, "withdrawn": withdrawn})))
}
