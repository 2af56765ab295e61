//! A cassette: recorded exchanges in a text file that people can review. This module does not know models or the store.
//!
//! JSON lines, one object a line, optionally compressed (a name that ends in `.zst`). Line 1 is the header
//! `{"format":"evodrive-cassette","version":"1.0","name":..,"models":[ModelSpec..]}`. Message texts and schemas stand
//! once, before the first exchange that uses them: `{"text":"<BLAKE3 of the text>","body":"..."}` and
//! `{"schema":"<digest>","body":{..}}` (domain `evodrive/schema/1`). An exchange is
//! `{"exchange":"<key>","adapter_version":N,"slot":{..},"model":"<name>",
//! "messages":[{"role":..,"text":"<digest>"}..],"schema":"<digest>","response":"<BLAKE3 of the bytes>","reply":"..."}`,
//! with `reply_hex` in place of `reply` where the bytes are not UTF-8. Version 1.1 adds, to exchanges with a live
//! model, `"metadata":{..}` and its digest `"metadata_digest"`; a cassette without any is written as 1.0. Version 1.2 has
//! nothing more in it: runs seal the digests of its metadata, which those of 1.1 did not. A reader accepts every minor version
//! of its major version.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{DrawSlot, Message, Metadata, ModelSpec, Request, Schema, Text, client::SCRIPTED};
use crate::{
    kernel::{Digest, Threads, hex},
    store::{self, StoreError, TextFault},
};

const FORMAT: &str = "evodrive-cassette";
const VERSION: &str = "1.0";
/// The minor version with metadata that no run seals, and with the newer model settings.
const VERSION_LIVE: &str = "1.1";
/// The minor version whose metadata runs seal.
const VERSION_SEALED: &str = "1.2";
const MAJOR: &str = "1";
/// Limits of a cassette that is read, in bytes after decompression.
const MAX_BYTES: u64 = 1 << 30;
/// Bytes of the first line, and of all schemas: their values take many times that in memory.
const MAX_HEADER_BYTES: usize = 1 << 20;
const MAX_SCHEMA_BYTES: usize = 1 << 20;
/// Bytes of lines that are read together.
const BATCH_BYTES: usize = 1 << 20;

/// Why a cassette cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum CassetteError {
    /// A line is not what was written.
    #[error("{file} line {line}: expected {expected}, found {found}; {remedy}")]
    Damaged {
        /// Name of the file.
        file: String,
        /// Number of the line, from 1.
        line: usize,
        /// Content that was expected there.
        expected: String,
        /// Content that was found there.
        found: String,
        /// Remedy.
        remedy: &'static str,
    },
    /// Another version of the format wrote the file.
    #[error(
        "{file} is a cassette of format {found}, this build reads {MAJOR}.x; use the release that wrote it, or record anew"
    )]
    Version {
        /// Name of the file.
        file: String,
        /// The version that it names.
        found: String,
    },
    /// Two different model settings have this name.
    #[error("two model settings are called {0}; give them different names in the experiment file")]
    TwoModels(String),
    /// One request has two recorded answers.
    #[error("request {key} has two different recorded answers; keep one of them")]
    TwoAnswers {
        /// The request.
        key: Digest,
    },
    /// An exchange cannot be put into text; it holds the reason.
    #[error("an exchange cannot be written: {0}")]
    Unwritable(String),
    /// The disk did not do what was asked.
    #[error(transparent)]
    Store(#[from] StoreError),
}

const REMEDY: &str = "restore the file from version control, or record the missing answers anew";

/// One recorded exchange. Texts that several exchanges share are in memory once.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Key of the request.
    pub key: Digest,
    /// `ADAPTER_VERSION` when it was recorded.
    pub adapter_version: u32,
    /// Position of the question in the run.
    pub slot: DrawSlot,
    /// Model that answered.
    pub model: Arc<ModelSpec>,
    /// (role, text) of each message.
    pub messages: Vec<(String, Text)>,
    /// Schema that the answer was asked to keep.
    pub schema: Schema,
    /// Raw bytes of the answer and their digest.
    pub response: Digest,
    /// The answer, raw.
    pub bytes: Vec<u8>,
    /// Metadata of the provider about the answer; no key and no result depends on it.
    pub metadata: Option<Metadata>,
}

impl Recorded {
    /// The request as it was asked.
    pub fn request(&self) -> Request {
        Request {
            adapter_version: self.adapter_version,
            slot: self.slot.clone(),
            model: ModelSpec::clone(&self.model),
            messages: self
                .messages
                .iter()
                .map(|(role, text)| Message { role: role.clone(), text: text.clone() })
                .collect(),
            schema: self.schema.clone(),
        }
    }
}

/// Recorded exchanges in transcript order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cassette {
    /// As messages name it: the file's path, or what it was recorded for.
    pub name: String,
    exchanges: Vec<Recorded>,
    by_key: BTreeMap<Digest, usize>,
    texts: BTreeMap<Digest, Text>,
    schemas: BTreeMap<Digest, Schema>,
    models: BTreeMap<String, Arc<ModelSpec>>,
    /// It was written before runs sealed metadata.
    is_early: bool,
    /// It has metadata that runs do not seal: the roots of its runs stay what they were.
    has_unsealed_metadata: bool,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    format: String,
    version: String,
    name: String,
    models: Vec<ModelSpec>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TextLine {
    text: Digest,
    body: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SchemaLine {
    schema: Digest,
    body: Value,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ExchangeLine {
    exchange: Digest,
    adapter_version: u32,
    slot: DrawSlot,
    model: String,
    messages: Vec<MessageRef>,
    schema: Digest,
    response: Digest,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    reply: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    reply_hex: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    metadata: Option<Metadata>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    metadata_digest: Option<Digest>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MessageRef {
    role: String,
    text: Digest,
}

/// The fault of a line: what was expected, and what was found.
type Wrong = (String, String);

/// Counts the bytes of schemas, all of which together are limited.
fn at_most_schemas(line: Line, bytes: &mut usize) -> Result<Line, Wrong> {
    if let Line::Schema(.., own) = &line {
        *bytes += own;
        if *bytes > MAX_SCHEMA_BYTES {
            return Err((format!("at most {MAX_SCHEMA_BYTES} bytes of schemas in all"), "more".to_string()));
        }
    }
    Ok(line)
}

fn damaged(file: &str, line: usize, expected: String, found: String) -> CassetteError {
    let file = file.to_string();
    if line == 1 && expected == VERSION {
        return CassetteError::Version { file, found };
    }
    CassetteError::Damaged { file, line, expected, found, remedy: REMEDY }
}

/// A line that was read without those ahead of it. What is named by a digest has it.
enum Line {
    Header(Box<Header>),
    Text(Digest, Text),
    /// With the length of its line.
    Schema(Digest, Schema, usize),
    Exchange(Box<ExchangeLine>),
}

fn read_alone(i: usize, line: &[u8]) -> Result<Line, Wrong> {
    let at_most = |bytes: usize, of: &str| {
        if line.len() > bytes {
            Err((format!("at most {bytes} bytes in {of}"), line.len().to_string()))
        } else {
            Ok(())
        }
    };
    // The first key says what the line holds; serde reports faults inside it.
    if i == 0 {
        at_most(MAX_HEADER_BYTES, "the header of a cassette")?;
        Ok(Line::Header(Box::new(parsed(line, "the header of a cassette")?)))
    } else if line.starts_with(b"{\"text\"") {
        let TextLine { text, body } = parsed(line, "a text")?;
        let body = Text::from(body);
        same("digest of the text", text, body.digest())?;
        Ok(Line::Text(text, body))
    } else if line.starts_with(b"{\"schema\"") {
        at_most(MAX_SCHEMA_BYTES, "a schema")?;
        let SchemaLine { schema, body } = parsed(line, "a schema")?;
        let body = Schema::new(body).map_err(|error| ("a schema".to_string(), error.to_string()))?;
        same("digest of the schema", schema, body.digest())?;
        Ok(Line::Schema(schema, body, line.len()))
    } else {
        Ok(Line::Exchange(Box::new(parsed(line, "an exchange, a text or a schema")?)))
    }
}

impl Cassette {
    /// An empty cassette. Error messages show the name.
    pub fn new(name: impl Into<String>) -> Cassette {
        Cassette { name: name.into(), ..Cassette::default() }
    }

    /// Reads a cassette file and verifies every digest and every key.
    pub fn load(path: &Path) -> Result<Cassette, CassetteError> {
        Cassette::load_on(path, None)
    }

    /// The same with threads that read its lines.
    pub fn load_on(path: &Path, threads: Option<&Threads>) -> Result<Cassette, CassetteError> {
        let file = path.display().to_string();
        let mut lines = store::text_lines(path, MAX_BYTES)?;
        Cassette::read_on(&mut || lines.next_line(), &file, threads)
    }

    /// Reads the text of a cassette; `file` is its name in messages and afterwards.
    pub fn parse(mut bytes: &[u8], file: &str) -> Result<Cassette, CassetteError> {
        let io = |source| StoreError::Io { action: "read", path: file.into(), source, remedy: REMEDY };
        Cassette::read_on(&mut || store::next_line(&mut bytes).map_err(|error| TextFault::Store(io(error))), file, None)
    }

    /// Reads lines a piece at a time, and none behind the first bad one.
    fn read_on(
        next: &mut dyn FnMut() -> Result<Option<store::Line>, TextFault>,
        file: &str,
        threads: Option<&Threads>,
    ) -> Result<Cassette, CassetteError> {
        let mut cassette = Cassette::new(file);
        let (mut read, mut schema_bytes) = (0, 0);
        loop {
            // What stands ahead of a fault is told first: its line has a smaller number.
            let mut fault = None;
            let lines = store::batch(
                || {
                    Ok::<_, CassetteError>(next().unwrap_or_else(|error| {
                        fault = Some(error);
                        None
                    }))
                },
                BATCH_BYTES,
            )?;
            let none = lines.is_empty() && fault.is_none();
            // A file without a line lacks the header.
            let lines = if none && read == 0 { vec![store::Line { bytes: Vec::new(), ended: false }] } else { lines };
            let alone = |i: usize, line: &store::Line| read_alone(read + i, &line.bytes);
            let alone: Vec<Result<Line, Wrong>> = match threads {
                Some(threads) => threads.map(&lines, alone),
                None => lines.iter().enumerate().map(|(i, line)| alone(i, line)).collect(),
            };
            for line in alone {
                read += 1;
                let line = line.and_then(|line| at_most_schemas(line, &mut schema_bytes));
                line.and_then(|line| cassette.take(line))
                    .map_err(|(expected, found)| damaged(file, read, expected, found))?;
            }
            match fault {
                Some(TextFault::Store(error)) => return Err(error.into()),
                Some(TextFault::Wrong(expected, found)) => return Err(damaged(file, read + 1, expected, found)),
                None if none => return Ok(cassette),
                None => {}
            }
        }
    }

    fn take(&mut self, line: Line) -> Result<(), Wrong> {
        match line {
            Line::Header(header) => self.take_header(*header),
            Line::Text(text, body) => {
                self.texts.insert(text, body);
                Ok(())
            }
            Line::Schema(schema, body, _) => {
                self.schemas.insert(schema, body);
                Ok(())
            }
            Line::Exchange(line) => {
                let recorded = self.read_exchange(*line)?;
                let key = recorded.key;
                self.has_unsealed_metadata |= self.is_early && recorded.metadata.is_some();
                self.insert(recorded)
                    .map_err(|_| ("one answer for a request".to_string(), format!("a second one for {key}")))
            }
        }
    }

    fn take_header(&mut self, header: Header) -> Result<(), Wrong> {
        if header.format != FORMAT {
            return Err((format!("format {FORMAT}"), store::shortened(&header.format)));
        }
        if header.version.split('.').next() != Some(MAJOR) {
            return Err((VERSION.to_string(), store::shortened(&header.version)));
        }
        self.is_early = [VERSION, VERSION_LIVE].contains(&header.version.as_str());
        for model in header.models {
            let name = model.name.clone();
            if self.models.insert(name.clone(), Arc::new(model)).is_some() {
                return Err(("each model once".to_string(), format!("{} twice", store::shortened(&name))));
            }
        }
        Ok(())
    }

    fn read_exchange(&self, line: ExchangeLine) -> Result<Recorded, Wrong> {
        let absent = |what: &str, name: &str| (format!("{what} {name} in a line before"), "none".to_string());
        let model = self.models.get(&line.model).ok_or_else(|| absent("model", &store::shortened(&line.model)))?;
        let schema = self.schemas.get(&line.schema).ok_or_else(|| absent("schema", &line.schema.to_hex()))?;
        let mut messages = Vec::new();
        for message in line.messages {
            let text = self.texts.get(&message.text).ok_or_else(|| absent("text", &message.text.to_hex()))?;
            messages.push((message.role, text.clone()));
        }
        let bytes = match (line.reply, line.reply_hex) {
            (Some(text), None) => text.into_bytes(),
            (None, Some(digits)) => {
                hex::decoded(&digits).ok_or_else(|| ("hex digits in reply_hex".to_string(), "others".to_string()))?
            }
            _ => return Err(("either reply or reply_hex".to_string(), "both or none".to_string())),
        };
        same("digest of the reply", line.response, Digest::of_bytes(&bytes))?;
        match (&line.metadata, line.metadata_digest) {
            (None, None) => {}
            (Some(metadata), Some(written)) => {
                let computed = metadata.digest().map_err(|e| ("metadata with a digest".to_string(), e.to_string()))?;
                same("digest of the metadata", written, computed)?;
            }
            _ => return Err(("metadata and metadata_digest".to_string(), "one of them".to_string())),
        }
        if line.metadata.is_some() && model.kind == SCRIPTED {
            let expected = "no metadata: the scripted model has no provider that could say something";
            return Err((expected.to_string(), "some".to_string()));
        }
        let recorded = Recorded {
            key: line.exchange,
            adapter_version: line.adapter_version,
            slot: line.slot,
            model: model.clone(),
            messages,
            schema: schema.clone(),
            response: line.response,
            bytes,
            metadata: line.metadata,
        };
        let key = recorded.request().key().map_err(|error| ("a request with a key".to_string(), error.to_string()))?;
        same("key of the request in this line", line.exchange, key)?;
        Ok(recorded)
    }

    /// Appends an exchange, unless it is there already.
    pub fn push(&mut self, request: &Request, bytes: Vec<u8>) -> Result<(), CassetteError> {
        self.push_with(request, bytes, None)
    }

    /// `push` with what the provider said about the answer.
    pub fn push_with(
        &mut self,
        request: &Request,
        bytes: Vec<u8>,
        metadata: Option<Metadata>,
    ) -> Result<(), CassetteError> {
        let unwritable = |reason: String| CassetteError::Unwritable(reason);
        let key = request.key().map_err(|error| unwritable(error.to_string()))?;
        let model =
            self.models.entry(request.model.name.clone()).or_insert_with(|| Arc::new(request.model.clone())).clone();
        if *model != request.model {
            return Err(CassetteError::TwoModels(request.model.name.clone()));
        }
        let schema = self.schemas.entry(request.schema.digest()).or_insert_with(|| request.schema.clone()).clone();
        let mut messages = Vec::new();
        for message in &request.messages {
            let text = self.texts.entry(message.text.digest()).or_insert_with(|| message.text.clone());
            messages.push((message.role.clone(), text.clone()));
        }
        self.insert(Recorded {
            key,
            adapter_version: request.adapter_version,
            slot: request.slot.clone(),
            model,
            messages,
            schema,
            response: Digest::of_bytes(&bytes),
            bytes,
            metadata,
        })
    }

    fn insert(&mut self, recorded: Recorded) -> Result<(), CassetteError> {
        if let Some(first) = self.get(&recorded.key) {
            return if first.response == recorded.response {
                Ok(())
            } else {
                Err(CassetteError::TwoAnswers { key: recorded.key })
            };
        }
        self.by_key.insert(recorded.key, self.exchanges.len());
        self.exchanges.push(recorded);
        Ok(())
    }

    /// The exchange recorded under a key.
    pub fn get(&self, key: &Digest) -> Option<&Recorded> {
        self.by_key.get(key).and_then(|i| self.exchanges.get(*i))
    }

    /// The digest of what a provider said about an answer, where runs seal it.
    pub fn sealed_metadata(&self, of: &Recorded) -> Option<Digest> {
        of.metadata.as_ref().filter(|_| !self.has_unsealed_metadata)?.digest().ok()
    }

    /// Returns `true` if runs seal what providers said about its answers.
    pub fn seals_metadata(&self) -> bool {
        !self.has_unsealed_metadata
    }

    /// The same, of which runs seal what providers said or do not.
    pub(super) fn sealing_metadata(self, seals: bool) -> Cassette {
        Cassette { has_unsealed_metadata: !seals, ..self }
    }

    /// All exchanges in the order of the file.
    pub fn exchanges(&self) -> &[Recorded] {
        &self.exchanges
    }

    /// The text of the file. Equal exchanges in equal order give equal bytes.
    pub fn to_bytes(&self, name: &str) -> Result<Vec<u8>, CassetteError> {
        let mut out = Vec::new();
        let models = self.models.values().map(|model| ModelSpec::clone(model)).collect();
        let version = self.version().into();
        line(&mut out, &Header { format: FORMAT.into(), version, name: name.into(), models })?;
        let mut written = std::collections::BTreeSet::new();
        for exchange in &self.exchanges {
            let mut messages = Vec::new();
            for (role, text) in &exchange.messages {
                let digest = text.digest();
                if written.insert(digest) {
                    line(&mut out, &TextLine { text: digest, body: text.to_string() })?;
                }
                messages.push(MessageRef { role: role.clone(), text: digest });
            }
            let schema = exchange.schema.digest();
            if written.insert(schema) {
                line(&mut out, &SchemaLine { schema, body: Value::clone(&exchange.schema) })?;
            }
            line(&mut out, &exchange_line(exchange, messages, schema)?)?;
        }
        Ok(out)
    }

    /// The lowest version that can hold what is in it.
    fn version(&self) -> &'static str {
        let new_settings = |model: &Arc<ModelSpec>| model.response_format.is_some() || !model.body.is_empty();
        let said = self.exchanges.iter().any(|e| e.metadata.is_some());
        if said && !self.has_unsealed_metadata {
            VERSION_SEALED
        } else if said || self.models.values().any(new_settings) {
            VERSION_LIVE
        } else {
            VERSION
        }
    }

    /// Writes the file, whole or not at all; compressed when its name ends in `.zst`.
    pub fn save(&self, path: &Path, name: &str) -> Result<(), CassetteError> {
        Ok(store::write_text(path, &self.to_bytes(name)?)?)
    }
}

fn exchange_line(
    exchange: &Recorded,
    messages: Vec<MessageRef>,
    schema: Digest,
) -> Result<ExchangeLine, CassetteError> {
    let digest = exchange.metadata.as_ref().map(Metadata::digest).transpose();
    let metadata_digest = digest.map_err(|error| CassetteError::Unwritable(error.to_string()))?;
    let reply = std::str::from_utf8(&exchange.bytes).ok().map(str::to_string);
    Ok(ExchangeLine {
        exchange: exchange.key,
        adapter_version: exchange.adapter_version,
        slot: exchange.slot.clone(),
        model: exchange.model.name.clone(),
        messages,
        schema,
        response: exchange.response,
        reply_hex: if reply.is_none() { Some(hex::encoded(&exchange.bytes)) } else { None },
        reply,
        metadata: exchange.metadata.clone(),
        metadata_digest,
    })
}

fn line(out: &mut Vec<u8>, value: &impl Serialize) -> Result<(), CassetteError> {
    serde_json::to_writer(&mut *out, value).map_err(|error| CassetteError::Unwritable(error.to_string()))?;
    out.push(b'\n');
    Ok(())
}

fn parsed<'a, T: Deserialize<'a>>(line: &'a [u8], expected: &str) -> Result<T, Wrong> {
    serde_json::from_slice(line).map_err(|error| (expected.to_string(), error.to_string()))
}

fn same(what: &str, written: Digest, computed: Digest) -> Result<(), Wrong> {
    if written == computed { Ok(()) } else { Err((format!("{what} {computed}"), written.to_hex())) }
}
