//! A model behind a folder: requests appear as files, replies are picked up. For a person, an agent or a tool that has no API.
//!
//! A question is `<n>.request.json` (messages, schema, key) and `<n>.request.md` (the same to read). Its answer is
//! `<n>.reply.txt`: the bare reply, written under another name and renamed. Nothing waits for a limited time. The numbers are
//! kept in the folder: the same question asked again, after an interruption too, is the same file, and an answer that is there
//! already is taken. Of a question that a patch answers drafts can be tried before: `<n>.try-<k>.txt` is judged while the
//! reply is waited for, and `<n>.try-<k>.said.json` holds what gates and compiler say.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::{Deserialize, Serialize};

use super::{
    Completion, DraftJudge, DrawSlot, Message, Metadata, Model, ModelError, Request, Schema, Tried, TriedDraft, reply,
};
use crate::{kernel::Digest, store};

const FORMAT: &str = "evodrive-exchange/1";
const REQUEST: &str = ".request.json";
/// Bytes of a request file that is read back.
const REQUEST_BYTES_MAX: u64 = 16 << 20;

/// Waits a moment before the folder is looked at again, and says whether it should be. The clock is the caller's.
pub type Pause = Arc<dyn Fn() -> bool + Send + Sync>;
/// Told of each request file that waits for its reply.
pub type Tell = Arc<dyn Fn(&Path) + Send + Sync>;

/// Contents of a request file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    format: String,
    number: u64,
    /// Name of the file that the reply is expected in.
    reply_file: String,
    key: Digest,
    slot: DrawSlot,
    /// Label of the model.
    model: String,
    messages: Vec<Message>,
    /// JSON schema that the reply must satisfy.
    schema: Schema,
}

/// One question of a folder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Entry {
    /// Its number.
    pub number: u64,
    /// Position of the question in the run.
    pub slot: DrawSlot,
    /// True if its reply is there.
    pub answered: bool,
    /// The file to read.
    pub request: PathBuf,
    /// The file that holds, or will hold, the reply.
    pub reply: PathBuf,
}

/// A folder with questions, of which drafts are tried.
pub struct Desk {
    dir: PathBuf,
    numbers: Mutex<BTreeMap<Digest, u64>>,
    /// True if each question is also written as a page.
    pages: bool,
}

impl Desk {
    /// Opens a folder whose questions somebody else is asked: it holds them for drafts alone.
    pub fn open(dir: &Path) -> Result<Desk, ModelError> {
        Desk::opened(dir, false)
    }

    /// Opens a folder, which is made where it is not there. What was asked in it keeps its numbers.
    fn opened(dir: &Path, pages: bool) -> Result<Desk, ModelError> {
        store::create_plain_dir(dir).map_err(|error| on_disk(dir, &error))?;
        let known = written(dir)?.into_iter().map(|written| (written.key, written.number)).collect();
        Ok(Desk { dir: dir.to_path_buf(), numbers: Mutex::new(known), pages })
    }

    /// The number of a question. A new one is written out before it has one.
    fn number(&self, request: &Request) -> Result<u64, ModelError> {
        let key =
            request.key().map_err(|error| ModelError::Unanswerable { reason: format!("it has no key: {error}") })?;
        let mut numbers = self.numbers.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(number) = numbers.get(&key) {
            return Ok(*number);
        }
        let mut written = Written {
            format: FORMAT.into(),
            number: numbers.values().max().map_or(1, |last| last + 1),
            reply_file: String::new(),
            key,
            slot: request.slot.clone(),
            model: request.model.label(),
            messages: request.messages.clone(),
            schema: request.schema.clone(),
        };
        loop {
            written.reply_file = reply_name(written.number);
            if self.put(&written)? {
                numbers.insert(key, written.number);
                return Ok(written.number);
            }
            // Whoever else has the number keeps it, and its reply.
            written.number += 1;
        }
    }

    /// Writes a question out under its number, and says whether the number was free. The page first: who sees the JSON finds both.
    fn put(&self, written: &Written) -> Result<bool, ModelError> {
        let json = serde_json::to_vec_pretty(written).map_err(|error| on_disk(&self.dir, &error))?;
        let page = self.pages.then(|| (".request.md", page(written).into_bytes()));
        if store::is_taken(&self.dir.join(&written.reply_file)) {
            return Ok(false);
        }
        for (ending, bytes) in page.into_iter().chain([(REQUEST, json)]) {
            let path = self.dir.join(format!("{}{ending}", written.number));
            let is_new = store::write_new(&path, &bytes).map_err(|error| on_disk(&path, &error))?;
            // A page may be there of this question, whose writer was killed before its JSON.
            let same = || store::read_bounded(&path, bytes.len() as u64).is_ok_and(|there| there == bytes);
            if !is_new && (ending == REQUEST || !same()) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Says what there is to say of each draft that waits for it.
    fn judge(&self, number: u64, judge: &dyn DraftJudge) -> Result<(), ModelError> {
        for Draft { bytes, said } in drafts(&self.dir, number)? {
            if !store::is_plain_file(&said).map_err(|error| on_disk(&said, &error))? {
                let text = serde_json::to_vec_pretty(&judge.tried(&bytes)).map_err(|error| on_disk(&said, &error))?;
                store::write_atomic(&said, &text).map_err(|error| on_disk(&said, &error))?;
            }
        }
        Ok(())
    }

    /// Has drafts judged while somebody answers: `answer` gets the file of the question and something to call now and then. Beside the
    /// answer come the tries.
    ///
    /// # Errors
    /// The folder cannot be read or written.
    pub fn beside<T>(
        &self,
        request: &Request,
        judge: &dyn DraftJudge,
        answer: impl FnOnce(&Path, &mut dyn FnMut()) -> T,
    ) -> Result<(T, Vec<TriedDraft>), ModelError> {
        let number = self.number(request)?;
        let mut looked = Ok(());
        let answered = answer(&self.dir.join(format!("{number}{REQUEST}")), &mut || {
            if looked.is_ok() {
                looked = self.judge(number, judge);
            }
        });
        looked?;
        Ok((answered, tries(&self.dir, number)?))
    }
}

/// A folder with questions, and who waits for their replies.
pub struct Exchange {
    desk: Desk,
    /// Note on who answers, and how: kept with every answer.
    provenance: String,
    pause: Pause,
    tell: Tell,
    /// Why one of the questions cannot be answered: no other one is waited for then, since its recording ends.
    broken: Mutex<Option<ModelError>>,
}

impl Exchange {
    /// Opens a folder, which is made where it is not there. What was asked in it keeps its numbers.
    pub fn open(dir: &Path, provenance: &str, pause: Pause, tell: Tell) -> Result<Exchange, ModelError> {
        let (desk, provenance) = (Desk::opened(dir, true)?, provenance.into());
        Ok(Exchange { desk, provenance, pause, tell, broken: Mutex::default() })
    }
}

impl Model for Exchange {
    fn complete(&self, request: &Request) -> Result<Completion, ModelError> {
        self.noted(self.awaited(request, None))
    }

    fn complete_with(&self, request: &Request, judge: &dyn DraftJudge) -> Result<Completion, ModelError> {
        self.noted(self.awaited(request, Some(judge)))
    }
}

impl Exchange {
    fn broken(&self) -> MutexGuard<'_, Option<ModelError>> {
        self.broken.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// An answer as it is; why there is none is kept for whoever else waits.
    fn noted(&self, completed: Result<Completion, ModelError>) -> Result<Completion, ModelError> {
        if let Err(error) = &completed {
            self.broken().get_or_insert_with(|| error.clone());
        }
        completed
    }

    /// Writes the question out and waits for its reply; drafts are tried while it waits.
    fn awaited(&self, request: &Request, judge: Option<&dyn DraftJudge>) -> Result<Completion, ModelError> {
        let number = self.desk.number(request)?;
        let dir = &self.desk.dir;
        let path = dir.join(reply_name(number));
        let mut announced = false;
        loop {
            if let Some(bytes) = replied(&path)? {
                let tries = tries(dir, number)?;
                let metadata = Metadata { model: self.provenance.clone(), tries, ..Metadata::default() };
                return Ok(Completion { bytes, metadata: Some(metadata) });
            }
            if let Some(judge) = judge {
                self.desk.judge(number, judge)?;
            }
            if !announced {
                (self.tell)(&dir.join(format!("{number}.request.md")));
                announced = true;
            }
            if let Some(error) = &*self.broken() {
                return Err(error.clone());
            }
            if !(self.pause)() {
                let reason = format!("{} is no longer waited for; the question stays", path.display());
                return Err(ModelError::Unanswerable { reason });
            }
        }
    }
}

/// Drafts of one question that are tried at most.
pub const TRIES_MAX: u32 = 8;

/// Puts a draft where it is tried: the file in which it will be said what it is worth. The same draft is tried once.
///
/// # Errors
/// `question` is no question of an exchange that waits for a patch, is answered already, or was tried often enough.
pub fn try_draft(question: &Path, draft: &[u8]) -> Result<PathBuf, ModelError> {
    let refused = |reason: String| ModelError::Unanswerable { reason };
    let name = question.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let number = name.strip_suffix(".request.md").or_else(|| name.strip_suffix(REQUEST)).and_then(|n| n.parse().ok());
    let (Some(number), Some(dir)) = (number, question.parent()) else {
        let expected = "a question of an exchange, e.g. 7.request.md; `evodrive exchange status` lists them";
        return Err(refused(format!("{}: expected {expected}", question.display())));
    };
    let dir = if dir.as_os_str().is_empty() { Path::new(".") } else { dir };
    let asked = written(dir)?.into_iter().find(|one| one.number == number);
    let Some(asked) = asked else {
        let expected = format!("the question {number}{REQUEST} beside it");
        return Err(refused(format!("{}: expected {expected}; it is not there", question.display())));
    };
    if !is_tried(&asked.slot) {
        return Err(refused(format!(
            "{}: the question is for {}; gates judge patches, so only drafts of the actor and of the repair are tried",
            question.display(),
            asked.slot.role
        )));
    }
    if draft.is_empty() {
        return Err(refused("the draft is empty: expected a reply as it would be given".into()));
    }
    if replied(&dir.join(&asked.reply_file))?.is_some() {
        return Err(refused(format!("{}: it is answered already, in {}", question.display(), asked.reply_file)));
    }
    // Each draft has a file of its own, whoever else tries one now: the first number that is free.
    for nth in 1..=TRIES_MAX {
        let (path, said) = (dir.join(draft_name(number, nth)), dir.join(said_name(number, nth)));
        // What was said of a draft that is gone is said of no other one.
        let is_free = !store::is_taken(&path) && !store::is_taken(&said);
        if is_free && store::write_new(&path, draft).map_err(|error| on_disk(&path, &error))?
            || replied(&path)?.is_some_and(|there| there == draft)
        {
            return Ok(said);
        }
    }
    Err(refused(format!("{}: {TRIES_MAX} drafts were tried, and no more are; answer it", question.display())))
}

/// Returns what was said of a draft; `None` while it waits.
///
/// # Errors
/// Returns an error if the file cannot be read.
pub fn said_of(said: &Path) -> Result<Option<Tried>, ModelError> {
    let Some(bytes) = replied(said)? else { return Ok(None) };
    serde_json::from_slice(&bytes).map(Some).map_err(|error| on_disk(said, &error))
}

/// Returns `true` if the answer is a patch, which gates can judge.
fn is_tried(slot: &DrawSlot) -> bool {
    ["actor", "repair"].contains(&slot.role.as_str())
}

/// A draft that lies in the folder, and the file for what is said of it.
struct Draft {
    bytes: Vec<u8>,
    said: PathBuf,
}

/// The drafts of a question, in their order.
fn drafts(dir: &Path, number: u64) -> Result<Vec<Draft>, ModelError> {
    let mut drafts = Vec::new();
    for nth in 1..=TRIES_MAX {
        // One that is still empty is being written, or its writer was killed.
        let Some(bytes) = replied(&dir.join(draft_name(number, nth)))? else { continue };
        drafts.push(Draft { bytes, said: dir.join(said_name(number, nth)) });
    }
    Ok(drafts)
}

/// Those of them that were judged.
fn tries(dir: &Path, number: u64) -> Result<Vec<TriedDraft>, ModelError> {
    let mut tries = Vec::new();
    for Draft { bytes, said } in drafts(dir, number)? {
        let Some(said) = said_of(&said)? else { continue };
        tries.push(TriedDraft { draft: Digest::of_bytes(&bytes), passes: said.passes });
    }
    Ok(tries)
}

fn draft_name(number: u64, nth: u32) -> String {
    format!("{number}.try-{nth}.txt")
}

fn said_name(number: u64, nth: u32) -> String {
    format!("{number}.try-{nth}.said.json")
}

/// The questions of a folder, in the order of their numbers.
pub fn status(dir: &Path) -> Result<Vec<Entry>, ModelError> {
    let entry = |written: Written| {
        let (request, reply) = (dir.join(format!("{}.request.md", written.number)), dir.join(written.reply_file));
        let answered = replied(&reply)?.is_some();
        Ok(Entry { number: written.number, slot: written.slot, answered, request, reply })
    };
    written(dir)?.into_iter().map(entry).collect()
}

fn reply_name(number: u64) -> String {
    format!("{number}.reply.txt")
}

/// The reply; none where the file is missing or still empty.
fn replied(path: &Path) -> Result<Option<Vec<u8>>, ModelError> {
    if !store::is_plain_file(path).map_err(|error| on_disk(path, &error))? {
        return Ok(None);
    }
    let bytes = store::read_bounded(path, reply::MAX_BYTES as u64).map_err(|error| on_disk(path, &error))?;
    Ok((!bytes.is_empty()).then_some(bytes))
}

/// Reads the questions that were asked in a folder, in the order of their numbers.
fn written(dir: &Path) -> Result<Vec<Written>, ModelError> {
    let mut questions = Vec::new();
    for path in store::list_entries(dir, REQUEST).map_err(|error| on_disk(dir, &error))? {
        store::is_plain_file(&path).map_err(|error| on_disk(&path, &error))?;
        let bytes = store::read_bounded(&path, REQUEST_BYTES_MAX).map_err(|error| on_disk(&path, &error))?;
        let one: Written = serde_json::from_slice(&bytes).map_err(|error| on_disk(&path, &error))?;
        if one.format != FORMAT {
            return Err(on_disk(&path, &format!("format {}, this build reads {FORMAT}", one.format)));
        }
        // The file says where its reply is looked for: nowhere but beside it, under its own number.
        let (number, own) = (one.number, path.file_name().map(|name| name.to_string_lossy().into_owned()));
        if own.as_deref() != Some(&format!("{number}{REQUEST}")) || one.reply_file != reply_name(number) {
            let expected = "the number of the file's name, and its reply beside it";
            return Err(on_disk(&path, &format!("expected {expected}, found number {number} and another name")));
        }
        questions.push(one);
    }
    questions.sort_by_key(|one| one.number);
    Ok(questions)
}

fn on_disk(path: &Path, error: &dyn std::fmt::Display) -> ModelError {
    let reason = format!("{}: {error}; correct or remove the file and repeat the command", path.display());
    ModelError::Unanswerable { reason }
}

/// The question to read.
fn page(written: &Written) -> String {
    let Written { number, slot, model, messages, schema, reply_file, .. } = written;
    let mut page = format!(
        "# Question {number}: {} of {}, epoch {}, slot {}, round {} (for {model})\n\n\
         Write the reply, one JSON object that matches the schema at the end, into a file of another name and rename it to \
         `{reply_file}`.\n",
        slot.role, slot.lineage, slot.epoch, slot.slot, slot.round
    );
    if is_tried(slot) {
        page.push_str(&format!(
            "Before that you may try up to {TRIES_MAX} drafts: `evodrive ask {number}.request.md DRAFT` says whether a draft can be read, passes the \
             gates and compiles. It says nothing of attack or realism, and how often you tried is recorded.\n"
        ));
    }
    for message in messages {
        page.push_str(&format!("\n---- {} ----\n\n{}\n", message.role, message.text.trim_end()));
    }
    page.push_str(&format!("\n---- schema of the reply ----\n\n{}\n", **schema));
    page
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::llm::ModelSpec;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn request(slot: u32) -> Request {
        let model = ModelSpec {
            name: "agent".into(),
            kind: "exchange".into(),
            model: "somebody".into(),
            sampling: BTreeMap::new(),
            response_format: None,
            body: BTreeMap::new(),
            here: Default::default(),
        };
        let slot = DrawSlot { lineage: "cat-idm".into(), epoch: 1, slot, role: "actor".into(), round: 0 };
        let messages = vec![Message { role: "system".into(), text: "The handbook.".into() }];
        Request { adapter_version: 1, slot, model, messages, schema: Schema::new(serde_json::json!({})).unwrap() }
    }

    /// A folder in which somebody answers what is open while the model waits: at every third look.
    fn answered(dir: &Path) -> (Exchange, Arc<AtomicUsize>) {
        let (looks, home) = (Arc::new(AtomicUsize::new(0)), dir.to_path_buf());
        let counted = looks.clone();
        // Several threads wait at once; one person answers.
        let answering = std::sync::Mutex::new(());
        let pause = move || {
            let _one = answering.lock().unwrap();
            if counted.fetch_add(1, Ordering::Relaxed) % 3 == 2 {
                for entry in status(&home).unwrap().into_iter().filter(|entry| !entry.answered) {
                    let text = format!("reply to {} of slot {}", entry.number, entry.slot.slot);
                    store::write_atomic(&entry.reply, text.as_bytes()).unwrap();
                }
            }
            true
        };
        (Exchange::open(dir, "by hand", Arc::new(pause), Arc::new(|_: &Path| {})).unwrap(), looks)
    }

    #[test]
    fn questions_wait_as_files_and_replies_are_picked_up() {
        let dir = tempfile::tempdir().unwrap();
        let (exchange, looks) = answered(dir.path());
        let completion = exchange.complete(&request(7)).unwrap();
        assert_eq!(completion.bytes, b"reply to 1 of slot 7");
        assert_eq!(completion.metadata.unwrap().model, "by hand");
        assert_eq!(looks.load(Ordering::Relaxed), 3, "it waited");
        let page = std::fs::read_to_string(dir.path().join("1.request.md")).unwrap();
        assert!(page.contains("The handbook.") && page.contains("1.reply.txt") && page.contains("slot 7"), "{page}");
        assert_eq!(exchange.complete(&request(8)).unwrap().bytes, b"reply to 2 of slot 8");
        assert!(status(dir.path()).unwrap().iter().all(|entry| entry.answered));
    }

    #[test]
    fn an_interrupted_question_keeps_its_number_and_an_empty_reply_is_waited_for() {
        let dir = tempfile::tempdir().unwrap();
        let stops = Exchange::open(dir.path(), "", Arc::new(|| false), Arc::new(|_: &Path| {})).unwrap();
        assert!(stops.complete(&request(3)).is_err(), "it is no longer waited for");
        std::fs::write(dir.path().join("1.reply.txt"), "").unwrap();
        assert!(!status(dir.path()).unwrap()[0].answered);
        let (exchange, _) = answered(dir.path());
        assert_eq!(exchange.complete(&request(4)).unwrap().bytes, b"reply to 2 of slot 4", "another question");
        assert_eq!(exchange.complete(&request(3)).unwrap().bytes, b"reply to 1 of slot 3");
        assert_eq!(status(dir.path()).unwrap().len(), 2);
    }

    #[test]
    fn where_one_reply_cannot_be_read_no_other_one_is_waited_for_and_both_say_why() {
        let dir = tempfile::tempdir().unwrap();
        let looks = AtomicUsize::new(0);
        // Long enough for the other one, and not for ever.
        let pause = move || {
            std::thread::sleep(std::time::Duration::from_millis(1));
            looks.fetch_add(1, Ordering::Relaxed) < 5000
        };
        let exchange = Exchange::open(dir.path(), "nobody", Arc::new(pause), Arc::new(|_| ())).unwrap();
        exchange.desk.number(&request(0)).unwrap();
        std::fs::create_dir(dir.path().join("1.reply.txt")).unwrap();
        std::thread::scope(|scope| {
            let asked = [0, 1].map(|slot| {
                scope.spawn({
                    let exchange = &exchange;
                    move || exchange.complete(&request(slot)).unwrap_err().to_string()
                })
            });
            for error in asked.map(|asked| asked.join().unwrap()) {
                assert!(error.contains("1.reply.txt"), "{error}");
            }
        });
    }

    #[test]
    fn several_questions_are_open_at_once() {
        let dir = tempfile::tempdir().unwrap();
        let (exchange, _) = answered(dir.path());
        let threads = crate::kernel::Threads::new(4).unwrap();
        let slots: Vec<u32> = (0..4).collect();
        let replies = threads.map(&slots, |_, slot| exchange.complete(&request(*slot)).unwrap().bytes);
        for (slot, reply) in replies.into_iter().enumerate() {
            assert!(String::from_utf8(reply).unwrap().ends_with(&format!("slot {slot}")));
        }
        assert_eq!(status(dir.path()).unwrap().len(), 4);
    }

    /// A folder in which one question was asked.
    fn asked() -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        let stops = Exchange::open(dir.path(), "", Arc::new(|| false), Arc::new(|_: &Path| {})).unwrap();
        assert!(stops.complete(&request(3)).is_err(), "it is no longer waited for");
        dir
    }

    #[cfg(unix)]
    #[test]
    fn a_link_out_of_the_folder_is_no_reply_and_no_question() {
        let outside = tempfile::tempdir().unwrap();
        let secret = outside.path().join("secret");
        std::fs::write(&secret, "of somebody").unwrap();
        let dir = asked();
        std::os::unix::fs::symlink(&secret, dir.path().join("1.reply.txt")).unwrap();
        let error = status(dir.path()).unwrap_err().to_string();
        assert!(error.contains("1.reply.txt") && error.contains("expected a plain file, found a link"), "{error}");
        let dir = asked();
        std::os::unix::fs::symlink(dir.path().join("1.request.json"), dir.path().join("2.request.json")).unwrap();
        assert!(status(dir.path()).unwrap_err().to_string().contains("found a link"));
        let linked = outside.path().join("linked");
        std::os::unix::fs::symlink(dir.path(), &linked).unwrap();
        let opened = Exchange::open(&linked, "", Arc::new(|| false), Arc::new(|_: &Path| {}));
        assert!(opened.is_err_and(|error| error.to_string().contains("found a link")));
    }

    #[test]
    fn a_question_that_sends_its_reply_elsewhere_is_refused() {
        let dir = asked();
        let path = dir.path().join("1.request.json");
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.replace("1.reply.txt", "../other.txt")).unwrap();
        let error = status(dir.path()).unwrap_err().to_string();
        assert!(error.contains("its reply beside it"), "{error}");
    }

    /// Passes what begins with a brace.
    struct Braces(AtomicUsize);

    impl DraftJudge for Braces {
        fn tried(&self, draft: &[u8]) -> Tried {
            self.0.fetch_add(1, Ordering::Relaxed);
            Tried { passes: draft.starts_with(b"{"), says: "looked at".into() }
        }
    }

    #[test]
    fn so_many_drafts_are_tried_each_once_and_no_question_of_a_critic_is() {
        let dir = tempfile::tempdir().unwrap();
        let (exchange, _) = answered(dir.path());
        let mut critic = request(1);
        critic.slot.role = "attack_critic".into();
        for asked in [&request(0), &critic] {
            exchange.desk.number(asked).unwrap();
        }
        let (question, judge) = (dir.path().join("1.request.md"), Braces(AtomicUsize::new(0)));
        for nth in 1..=TRIES_MAX {
            let said = try_draft(&question, format!("{{{nth}").as_bytes()).unwrap();
            assert_eq!(said_of(&said).unwrap(), None, "nobody looked yet");
            exchange.desk.judge(1, &judge).unwrap();
            assert!(said_of(&said).unwrap().unwrap().passes);
        }
        let known = try_draft(&question, b"{3").unwrap();
        exchange.desk.judge(1, &judge).unwrap();
        assert!(said_of(&known).unwrap().is_some());
        assert_eq!(judge.0.load(Ordering::Relaxed), TRIES_MAX as usize, "a draft is judged once");
        let refused = |question: &Path| try_draft(question, b"{another").unwrap_err().to_string();
        assert!(refused(&question).contains("8 drafts were tried"), "{}", refused(&question));
        let critics = dir.path().join("2.request.md");
        assert!(refused(&critics).contains("the question is for attack_critic"), "{}", refused(&critics));
        assert!(!page(&written(dir.path()).unwrap()[1]).contains("evodrive ask"));
        assert_eq!(tries(dir.path(), 1).unwrap().len(), TRIES_MAX as usize);
    }

    #[test]
    fn drafts_that_are_tried_at_once_have_a_file_and_a_verdict_each() {
        let dir = tempfile::tempdir().unwrap();
        let (exchange, _) = answered(dir.path());
        let question = dir.path().join("1.request.md");
        for slot in 0..20 {
            exchange.desk.number(&request(slot)).unwrap();
            let question = question.with_file_name(format!("{}.request.md", slot + 1));
            let drafts: Vec<String> =
                (0..TRIES_MAX).map(|nth| format!("{}{nth}", ["{", "no "][nth as usize % 2])).collect();
            let at_once = std::sync::Barrier::new(drafts.len());
            let said: Vec<PathBuf> = std::thread::scope(|scope| {
                let tried = |draft| {
                    let (question, at_once) = (&question, &at_once);
                    scope.spawn(move || {
                        at_once.wait();
                        try_draft(question, String::as_bytes(draft)).unwrap()
                    })
                };
                let tried: Vec<_> = drafts.iter().map(tried).collect();
                tried.into_iter().map(|of| of.join().unwrap()).collect()
            });
            exchange.desk.judge(u64::from(slot) + 1, &Braces(AtomicUsize::new(0))).unwrap();
            for (draft, said) in drafts.iter().zip(&said) {
                assert_eq!(said_of(said).unwrap().unwrap().passes, draft.starts_with('{'), "{draft}");
            }
        }
    }

    #[test]
    fn nobody_takes_a_number_a_page_or_a_reply_that_somebody_has() {
        let dir = tempfile::tempdir().unwrap();
        let exchange = Exchange::open(dir.path(), "", Arc::new(|| false), Arc::new(|_: &Path| {})).unwrap();
        // Another recording asks in the same folder, somebody has a page of that name, and a reply lies there from before.
        let other = Exchange::open(dir.path(), "", Arc::new(|| false), Arc::new(|_: &Path| {})).unwrap();
        assert_eq!(other.desk.number(&request(1)).unwrap(), 1);
        for (name, text) in [("2.request.md", "a page"), ("3.reply.txt", "a reply")] {
            std::fs::write(dir.path().join(name), text).unwrap();
        }
        assert_eq!(exchange.desk.number(&request(2)).unwrap(), 4);
        assert_eq!(written(dir.path()).unwrap().iter().map(|of| of.slot.slot).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(std::fs::read(dir.path().join("2.request.md")).unwrap(), b"a page");
        // A page whose writer was killed before its JSON is this question's still.
        std::fs::remove_file(dir.path().join("4.request.json")).unwrap();
        assert_eq!(
            Exchange::open(dir.path(), "", Arc::new(|| false), Arc::new(|_| ()))
                .unwrap()
                .desk
                .number(&request(2))
                .unwrap(),
            4
        );
    }
}
