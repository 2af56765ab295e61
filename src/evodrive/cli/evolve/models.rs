//! The models of an experiment, ready to be asked.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use crate::cli::cluster::worker_process::Processes;
use crate::cli::records::folder::{RunFolder, asked_in};
use crate::cli::terminal::{answer::progress, exit::Failure, interrupt::Interrupt};
use crate::experiment::{self, Experiment, ModelOptions};
use crate::llm::{ClientOptions, Command, Desk, Exchange, Model, client};
#[cfg(feature = "live")]
use crate::llm::{Completion, ModelError, Request};
use crate::scripted::Scripted;
use crate::store;

/// How often the folder of an exchange is looked at.
const LOOK: Duration = Duration::from_millis(500);

/// Bytes of an experiment file in which a model that needs another build is looked for.
const EXPERIMENT_BYTES_MAX: u64 = 1 << 20;

/// The models that roles name, ready to be asked. A fresh recording has a name, and folders of its own.
pub fn askable(
    experiment: &Experiment,
    folder: &RunFolder,
    fresh: Option<&str>,
    interrupt: &Interrupt,
) -> Result<BTreeMap<String, Box<dyn Model>>, Failure> {
    let used = experiment::asked(experiment);
    let mut models: BTreeMap<String, Box<dyn Model>> = BTreeMap::new();
    let mut live = Vec::new();
    for (name, options) in experiment.models.iter().filter(|(name, _)| used.contains(name.as_str())) {
        let provenance = options.provenance.as_deref().unwrap_or_default();
        let model: Box<dyn Model> = match (options.kind.as_str(), &options.client, &options.command) {
            (kind, Some(client), _) if client::is_live(kind) => {
                live.push((name.as_str(), kind, client));
                continue;
            }
            (client::EXCHANGE, ..) => {
                // A link in its place would have questions written, and replies read, elsewhere.
                store::create_plain_dir(&folder.exchanges()).map_err(Failure::bad_input)?;
                Box::new(exchange(&folder.exchanges().join(asked_in(name, fresh)), provenance, interrupt)?)
            }
            (client::COMMAND, _, Some(command)) => {
                let at = |file: &Path| {
                    let beside = experiment.beside(file);
                    // A run folder, and a cluster's worker, have it among what travels.
                    if beside.exists() { beside } else { folder.planner().join(file) }
                };
                let beside = |word: &Path| Some(experiment.beside(word)).filter(|beside| beside.is_file());
                let program = Command::new(command.placed(at, beside), provenance, Processes::until(interrupt));
                Box::new(program.with_tries(command.tries.then(|| desk(folder, name, fresh)).transpose()?))
            }
            // Never asked itself.
            (client::DRAWN, ..) => continue,
            _ => Box::new(Scripted),
        };
        models.insert(name.clone(), model);
    }
    if !live.is_empty() {
        models.extend(connected(&live, experiment, folder, interrupt)?);
    }
    Ok(models)
}

/// Most questions that wait in an exchange at the same time, where nobody says otherwise: each has a thread that waits with it.
const OPEN: usize = 256;

/// Returns the number of questions that are open together without `--open`; `None`: as many as there are threads.
/// Whoever answers through files chooses what to answer first, so all that can be asked is there to be read.
pub fn open_by_default(experiment: &Experiment) -> Option<usize> {
    let used = experiment::asked(experiment);
    let through_files =
        |(name, options): (&String, &ModelOptions)| used.contains(name.as_str()) && options.kind == client::EXCHANGE;
    experiment.models.iter().any(through_files).then_some(OPEN)
}

/// Opens the folder in which a program tries drafts of its answers.
fn desk(folder: &RunFolder, model: &str, fresh: Option<&str>) -> Result<Desk, Failure> {
    store::create_plain_dir(&folder.tries()).map_err(Failure::bad_input)?;
    Desk::open(&folder.tries().join(asked_in(model, fresh))).map_err(Failure::bad_input)
}

/// A model behind a folder, which tells of each question that waits; nobody waits any more once Ctrl-C was pressed.
fn exchange(dir: &Path, provenance: &str, interrupt: &Interrupt) -> Result<Exchange, Failure> {
    let tell = |path: &Path| progress(format!("waits for a reply: {}", path.display()));
    let interrupt = interrupt.clone();
    let pause = move || {
        std::thread::sleep(LOOK);
        !interrupt.is_asked()
    };
    Exchange::open(dir, provenance, Arc::new(pause), Arc::new(tell)).map_err(Failure::bad_input)
}

/// Refuses in time what this build cannot ask.
pub fn check_build(experiment: &Experiment) -> Result<(), Failure> {
    let used = experiment::asked(experiment);
    let live =
        experiment.models.iter().find(|(name, options)| client::is_live(&options.kind) && used.contains(name.as_str()));
    match live {
        Some((name, options)) => has_network(name, &options.kind),
        None => Ok(()),
    }
}

/// The same of a file that cannot be read as an experiment, for instance because such a model lacks its address: whoever cannot ask it at
/// all should not look that up first. Only what the file itself says is seen.
pub fn check_build_of(file: &Path) -> Result<(), Failure> {
    let text = store::read_bounded(file, EXPERIMENT_BYTES_MAX).unwrap_or_default();
    let Ok(Ok(content)) = String::from_utf8(text).map(|text| text.parse::<toml::Table>()) else { return Ok(()) };
    let table = |key: &str| content.get(key).and_then(toml::Value::as_table);
    let (Some(models), Some(roles)) = (table("models"), table("roles")) else { return Ok(()) };
    let kind = |name: &str| models.get(name)?.get("kind")?.as_str();
    let live = roles.values().filter_map(toml::Value::as_str).find(|name| kind(name).is_some_and(client::is_live));
    live.map_or(Ok(()), |name| has_network(name, kind(name).unwrap_or_default()))
}

fn has_network(name: &str, kind: &str) -> Result<(), Failure> {
    if cfg!(feature = "live") {
        Ok(())
    } else {
        Err(Failure::bad_input(format!(
            "models.{name}.kind is \"{kind}\", but this build has no network code: it can replay that model's answers, but not ask for new ones; \
             to ask, build with `cargo build --release --features live` and repeat the command, or let a program ask: kind = \"command\" \
             with examples/chat/chat.py (docs/MODELS.md#a-program-command)"
        )))
    }
}

/// A live model: its name, its kind, how it is reached.
type Live<'a> = (&'a str, &'a str, &'a ClientOptions);

#[cfg(not(feature = "live"))]
fn connected(
    _: &[Live<'_>],
    experiment: &Experiment,
    _: &RunFolder,
    _: &Interrupt,
) -> Result<BTreeMap<String, Box<dyn Model>>, Failure> {
    check_build(experiment).map(|()| BTreeMap::new())
}

#[cfg(feature = "live")]
fn connected(
    live: &[Live<'_>],
    experiment: &Experiment,
    folder: &RunFolder,
    interrupt: &Interrupt,
) -> Result<BTreeMap<String, Box<dyn Model>>, Failure> {
    use crate::live::{Ledger, Live, Outside};
    let cap = experiment.spend.ok_or_else(|| Failure::bad_input("a live model needs a table [spend]"))?;
    let prices = live.iter().map(|(name, _, client)| (*name, *client));
    let ledger = Arc::new(Ledger::open(folder.spend(), cap, prices).map_err(Failure::bad_input)?);
    let tell = |line: &str| progress(line);
    let outside = Outside { pause: Arc::new(std::thread::sleep), now: Arc::new(since_1970), tell: Arc::new(tell) };
    let mut models: BTreeMap<String, Box<dyn Model>> = BTreeMap::new();
    for (name, kind, client) in live {
        let key = client.api_key_env.as_deref().map(|variable| key_in(name, variable)).transpose()?;
        let model = Live::new(name, kind, client, key, ledger.clone(), outside.clone()).map_err(Failure::bad_input)?;
        models.insert(name.to_string(), Box::new(NotForEver { model: Arc::new(model), interrupt: interrupt.clone() }));
    }
    Ok(models)
}

/// A model behind the network, whose answer may take minutes: it is left alone not long after Ctrl-C. What it will say is lost then,
/// and counts as spent at its upper bound.
#[cfg(feature = "live")]
struct NotForEver {
    model: Arc<dyn Model + Send + Sync>,
    interrupt: Interrupt,
}

#[cfg(feature = "live")]
impl Model for NotForEver {
    fn complete(&self, request: &Request) -> Result<Completion, ModelError> {
        let (model, asked) = (self.model.clone(), request.clone());
        let (to, from) = std::sync::mpsc::sync_channel(1);
        let ask = move || drop(to.send(model.complete(&asked)));
        let lost = |reason: String| Err(ModelError::Unanswerable { reason });
        if let Err(error) = crate::kernel::threads::beside(ask) {
            return lost(format!("no thread waits for its answer: {error}"));
        }
        self.interrupt
            .wait(&from, None)
            .unwrap_or_else(|_| lost("its answer is not waited for any more; repeat the command to ask again".into()))
    }
}

/// The time since 1970, UTC.
#[cfg(feature = "live")]
#[allow(clippy::disallowed_methods)]
fn since_1970() -> Duration {
    std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default()
}

/// The key in an environment variable. The variable's name is not repeated: somebody may have put the key in its place.
#[cfg(feature = "live")]
#[allow(clippy::disallowed_methods)]
fn key_in(model: &str, variable: &str) -> Result<crate::live::Secret, Failure> {
    let bad = |problem: &str| {
        Failure::bad_input(format!("the environment variable that models.{model}.client.api_key_env names {problem}"))
    };
    let text = std::env::var(variable).map_err(|_| bad("is not set; set it to the api key"))?;
    crate::live::Secret::new(&text).map_err(|problem| bad(&problem))
}
