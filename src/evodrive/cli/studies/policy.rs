//! `policy`: weights of learned egos that were trained elsewhere.

use clap::{Args, Subcommand};
use serde_json::json;
use std::path::PathBuf;

use crate::cli::terminal::output::Output;
use crate::cli::terminal::{answer::Answer, exit::Failure};
use crate::ego::{Actor, Weights, checkpoint};
use crate::formats::torch;
use crate::kernel::Digest;
use crate::store;

/// Bytes that a checkpoint may have.
const CHECKPOINT_BYTES_MAX: u64 = 256 << 20;

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Read the actor of a checkpoint of SafeBench or ChatScene (SAC, PPO, TD3, DDPG by four numbers) and write it as weights that drive
    /// here; nothing of the file is run.
    Import(ImportOptions),
}

#[derive(Debug, Args)]
pub struct ImportOptions {
    /// A file of torch.save: model.pt, model.sac.0100.torch.
    pub file: PathBuf,
    /// File of weights to write (.safetensors).
    #[arg(long)]
    pub out: PathBuf,
    #[command(flatten)]
    pub output: Output,
}

pub fn run(command: &Command) -> Result<Answer, Failure> {
    let Command::Import(ImportOptions { file, out, output }) = command;
    let bytes = store::read_bounded(file, CHECKPOINT_BYTES_MAX)?;
    let name = file.display().to_string();
    let tensors = torch::state_dict(&name, &bytes, &checkpoint::ACTORS).map_err(Failure::bad_input)?;
    let borrowed: Vec<_> = tensors.iter().map(|of| (of.name.as_str(), &of.shape[..], &of.values[..])).collect();
    let weights = checkpoint::weights(&borrowed).map_err(|error| Failure::bad_input(format!("{name}: {error}")))?;
    let read = Weights::from_bytes(&weights).map_err(Failure::internal)?;
    let Actor::Layers(actor, _) = &read.actor else {
        return Err(Failure::internal("weights that are no layers"));
    };
    output.write(out, &weights)?;
    let widths: Vec<String> = actor.layers.iter().map(|layer| layer.inputs.to_string()).collect();
    let (digest, observation, shown) = (Digest::of_bytes(&weights), read.setting.name(), out.display());
    let text = format!(
        "{name}: an actor of {}-2 that drives by {observation}\nwritten to {shown}\npolicy = {{ file = \"{shown}\", digest = \"{digest}\" }}\n",
        widths.join("-")
    );
    Ok(Answer::new(text, json!({"file": file, "weights": out, "digest": digest, "observation": observation})))
}
