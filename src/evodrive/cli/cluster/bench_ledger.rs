//! `bench ledger`: how fast a store records, reads and verifies, and how fast a missing answer is explained.

use clap::Args;
use serde_json::json;
use std::path::{Path, PathBuf};

use crate::cli::records::folder::open_store;
use crate::cli::terminal::{answer::Answer, exit::Failure, timed::timed};
use crate::kernel::{Digest, Threads};
use crate::llm::{Ask, AskError, Cassette, DrawSlot, Message, ModelSpec, Replay, Request, Schema};
use crate::store::{self, MemoKind, OwnDir, StoreError};

/// Bytes of an object, about those of a rollout record.
const OBJECT_BYTES: usize = 2048;
/// Records between two flushes, about those of an epoch.
const FLUSH_EVERY: usize = 120;
/// From one request whose answer is missing to the next: a prime, so that they lie all over the cassette.
const STRIDE: usize = 7919;

#[derive(Debug, Args)]
pub struct LedgerOptions {
    /// Folder for the trial store; it must not exist, and is removed.
    #[arg(long)]
    pub scratch: PathBuf,
    /// Objects that are recorded, read and verified.
    #[arg(long, default_value_t = 50_000)]
    pub objects: usize,
    /// Exchanges of the cassette in which answers are missing.
    #[arg(long, default_value_t = 50_000)]
    pub exchanges: usize,
    /// Missing answers.
    #[arg(long, default_value_t = 500)]
    pub misses: usize,
}

pub fn run(options: &LedgerOptions, jobs: usize) -> Result<Answer, Failure> {
    let dir = &options.scratch;
    let Some(own) = OwnDir::make(dir, "bench")? else {
        return Err(Failure::bad_input(format!("{}: expected no folder yet, found one", dir.display())));
    };
    let done = store_speed(dir, options.objects, jobs);
    // The first failure is the one to tell.
    let _ = own.remove();
    let [record, get, verify] = done?;
    let misses = misses(options)?;
    let text = format!(
        "{} objects of {OBJECT_BYTES} bytes: durable record {record:.0}/s (a flush every {FLUSH_EVERY}), get {get:.0}/s, verify {verify:.0}/s\n\
         {} misses in {} exchanges: {} with the right record and field, {:.1} ms each, at most {:.1} ms",
        options.objects, options.misses, options.exchanges, misses.right, misses.mean_ms, misses.most_ms
    );
    let object = json!({"objects": options.objects, "record_per_s": record, "get_per_s": get, "verify_per_s": verify,
        "exchanges": options.exchanges, "misses": options.misses, "right": misses.right, "miss_ms_mean": misses.mean_ms,
        "miss_ms_max": misses.most_ms});
    Ok(Answer::new(text, object))
}

/// Records, reads and verified objects a second.
fn store_speed(dir: &Path, count: usize, jobs: usize) -> Result<[f64; 3], Failure> {
    let threads = Threads::new(jobs)?;
    let bodies: Vec<Vec<u8>> = (0..count)
        .map(|i| {
            let seed = Digest::of_bytes(&(i as u64).to_le_bytes());
            seed.as_bytes().iter().copied().cycle().take(OBJECT_BYTES).collect()
        })
        .collect();
    let objects = open_store(dir)?;
    let key = |i: usize| Digest::of_bytes(format!("request {i}").as_bytes());
    let (recorded, record_s) = timed(|| -> Result<Vec<Digest>, StoreError> {
        let mut digests = Vec::with_capacity(count);
        for (i, body) in bodies.iter().enumerate() {
            let digest = objects.put(body)?;
            objects.memo_put(MemoKind::Rollout, &key(i), &digest)?;
            digests.push(digest);
            if i % FLUSH_EVERY == 0 {
                objects.flush()?;
            }
        }
        objects.flush()?;
        Ok(digests)
    });
    let mut digests = recorded?;
    // Not in the order in which they were written.
    digests.sort();
    let (read, get_s) = timed(|| threads.map(&digests, |_, digest| objects.get(digest).map(|bytes| bytes.len())));
    for length in read {
        length?;
    }
    drop(objects);
    let (report, verify_s) = timed(|| store::fsck(dir, true));
    let report = report?;
    if report.objects != count || !report.damage.is_empty() {
        return Err(Failure::internal(format!("expected {count} whole objects, found {}", report.objects)));
    }
    Ok([record_s, get_s, verify_s].map(|took| count as f64 / took.as_secs_f64()))
}

struct Misses {
    right: usize,
    mean_ms: f64,
    most_ms: f64,
}

fn request(i: usize) -> Result<Request, Failure> {
    let shared = "a handbook line that all questions of a lineage share\n".repeat(40);
    let slot = DrawSlot {
        lineage: format!("lineage-{}", i % 10),
        epoch: (i / 1000) as u32,
        slot: (i / 10 % 20) as u32,
        role: ["actor", "attack_critic", "realism_critic", "repair", "isolation_critic"][i / 200 % 5].into(),
        round: 0,
    };
    let own = format!("context\nscene {i} as it was\nthe end of question {i}");
    let messages = [("system", shared), ("user", own)];
    Ok(Request {
        adapter_version: 1,
        slot,
        model: ModelSpec {
            name: "m".into(),
            kind: "scripted".into(),
            model: "m-1".into(),
            sampling: [("temperature".to_string(), 0.5)].into(),
            response_format: None,
            body: Default::default(),
            here: Default::default(),
        },
        messages: messages.map(|(role, text)| Message { role: role.into(), text: text.into() }).into(),
        schema: Schema::new(json!({"type": "object"})).map_err(Failure::internal)?,
    })
}

/// Changes one thing of a recorded request; gives how the message must name it.
fn changed(request: &mut Request, how: usize) -> Result<String, Failure> {
    match how % 5 {
        0 => {
            let text = request.messages[1].text.replace("as it was", "as it is");
            request.messages[1].text = text.into();
            return Ok("message 2 (user) line 2".into());
        }
        1 => request.adapter_version = 2,
        2 => drop(request.model.sampling.insert("temperature".into(), 0.75)),
        3 => request.messages[0].role = "developer".into(),
        _ => request.schema = Schema::new(json!({"type": "array"})).map_err(Failure::internal)?,
    }
    Ok(["", "adapter_version", "model/sampling/temperature", "role of message 1", "schema/type"][how % 5].into())
}

fn misses(options: &LedgerOptions) -> Result<Misses, Failure> {
    let mut cassette = Cassette::new("bench");
    for i in 0..options.exchanges {
        cassette.push(&request(i)?, b"{}".to_vec())?;
    }
    let replay = Replay::new(cassette, "record");
    let mut seconds = Vec::new();
    let mut right = 0;
    for k in 0..options.misses {
        // Recorded requests in an order of their own.
        let which = k * STRIDE % options.exchanges.max(1);
        let mut asked = request(which)?;
        let field = changed(&mut asked, k)?;
        let (answer, took) = timed(|| replay.ask(&asked));
        seconds.push(took.as_secs_f64());
        if let Err(AskError::Miss(miss)) = answer {
            let difference = miss.difference.unwrap_or_default();
            right += usize::from(
                miss.nearest.as_ref() == Some(&asked.slot) && difference.starts_with(&format!("{field}: recorded ")),
            );
        }
    }
    let most = seconds.iter().copied().fold(0.0, f64::max);
    let mean_ms = 1e3 * seconds.iter().sum::<f64>() / seconds.len().max(1) as f64;
    Ok(Misses { right, mean_ms, most_ms: 1e3 * most })
}
