//! From bytes to a program file, with every fault named: first its form, then its contract, last its digests.

use std::path::Path;

use serde_json::{Value, error::Category};

use super::contract::source_of;
use super::error::shown;
use super::finding::{self, Finding};
use super::{ContractMark, FORMAT, ProgramFile, ProgramFileError, hand};
use crate::ego::{Policy, PolicyError};
use crate::evaluation::EvaluationOptions;
use crate::kernel::canon::CanonError;
use crate::objects::{FamilyName, Origin, Program};
use crate::stage::Source;
use crate::store::{self, StoreError};

/// Bytes that a program file may have.
const FILE_BYTES_MAX: u64 = 8 << 20;
/// Characters of a name or label in it.
const TEXT_CHARS_MAX: usize = 400;
/// How JSON's neighbours spell what is no number in JSON.
const NOT_NUMBERS: [&str; 5] = ["NaN", "nan", "Infinity", "inf", "Inf"];

impl ProgramFile {
    /// Reads a file that `evodrive program` wrote, or somebody by hand: TOML where its name ends so, else JSON.
    ///
    /// # Errors
    /// See [`ProgramFileError`]: a file that is too large, cut off, no program file, of another version, of a contract that
    /// changed, or damaged.
    pub fn read(path: &Path) -> Result<ProgramFile, ProgramFileError> {
        ProgramFile::from_bytes(&path.display().to_string(), &ProgramFile::bytes_of(path)?)
    }

    /// The bytes of a file that may be a program's.
    ///
    /// # Errors
    /// A file that cannot be read, or is too large.
    pub fn bytes_of(path: &Path) -> Result<Vec<u8>, ProgramFileError> {
        let file = path.display().to_string();
        store::read_bounded(path, FILE_BYTES_MAX).map_err(|error| match error {
            StoreError::TooLarge { max_bytes, .. } => ProgramFileError::TooLarge { file, bytes_max: max_bytes },
            other => ProgramFileError::Store(other),
        })
    }

    /// Returns `true` if a file of this name holds TOML.
    pub fn is_toml(file: &str) -> bool {
        Path::new(file).extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
    }

    /// The same from TOML.
    ///
    /// # Errors
    /// Those of [`ProgramFile::read`]; every place that does not fit, with its line.
    pub fn from_toml(file: &str, text: &str) -> Result<ProgramFile, ProgramFileError> {
        let read = hand::read(file, text)?;
        let source = source_of(file, &read.family)?;
        let own = finding::by_contract(&source.contract, &read.program).into_iter();
        let of_parent = finding::by_contract(&source.contract, &read.parent).into_iter();
        let within_parent = of_parent.map(|(gate, problem)| (gate, problem.below("/parent")));
        let findings: Vec<Finding> =
            own.chain(within_parent).map(|(gate, problem)| Finding::at(gate, problem, Some(text))).collect();
        if findings.is_empty() {
            read.checked(file, &source)
        } else {
            Err(ProgramFileError::Findings { file: file.into(), findings })
        }
    }

    /// The same from bytes; `file` is the name, also for messages.
    pub fn from_bytes(file: &str, bytes: &[u8]) -> Result<ProgramFile, ProgramFileError> {
        if ProgramFile::is_toml(file) {
            let text = std::str::from_utf8(bytes).map_err(|error| ProgramFileError::NotToml {
                file: file.into(),
                reason: format!("byte {} is not UTF-8", error.valid_up_to()),
            })?;
            return ProgramFile::from_toml(file, text);
        }
        let value: Value = serde_json::from_slice(bytes).map_err(|error| unread(file, bytes, &error))?;
        let source = about(file, &value)?;
        let read: ProgramFile = serde_json::from_slice(bytes).map_err(|error| shape(file, &error))?;
        read.checked(file, &source)
    }

    fn checked(self, file: &str, source: &Source) -> Result<ProgramFile, ProgramFileError> {
        let own = [("program.source_family", &self.program), ("parent.source_family", &self.parent)];
        for (place, program) in own {
            if program.source_family != self.family {
                return Err(ProgramFileError::Family {
                    file: file.into(),
                    place,
                    found: shown(program.source_family.as_str()),
                    expected: format!("`{}`, which `family` says", self.family),
                });
            }
        }
        self.check_texts(file)?;
        self.check_options(file)?;
        let unprintable =
            |error: CanonError| ProgramFileError::Options { file: file.into(), reason: error.to_string() };
        let (hash, digest) = (self.program.hash().map_err(unprintable)?, self.computed().map_err(unprintable)?);
        for (what, found, computed) in [("the program", self.program_hash, hash), ("its content", self.digest, digest)]
        {
            if found != computed {
                let (found, computed) = (found.to_hex(), computed.to_hex());
                return Err(ProgramFileError::Digest { file: file.into(), what, found, computed });
            }
        }
        let broken = |program: &Program| source.contract.check_program(program).into_iter().next();
        match broken(&self.program).or_else(|| broken(&self.parent)) {
            Some(problem) => Err(ProgramFileError::Program { file: file.into(), problem: problem.to_string() }),
            None => Ok(self),
        }
    }

    /// Names and labels that messages and tables repeat: of bounded length, without control characters.
    fn check_texts(&self, file: &str) -> Result<(), ProgramFileError> {
        let programs = [&self.program, &self.parent].into_iter();
        let named = programs.flat_map(|program| [program.solution_id.as_str(), program.lineage_id.as_str()]);
        let origins = self.origins.iter().flat_map(Origin::texts);
        let strange = |text: &&str| text.chars().count() > TEXT_CHARS_MAX || text.chars().any(char::is_control);
        let backend = self.conditions.backend.iter().flat_map(|mark| [mark.name.as_str(), mark.version.as_str()]);
        let all = named.chain(origins).chain(backend).chain([self.conditions.ego.as_str()]);
        match all.into_iter().find(strange) {
            None => Ok(()),
            Some(text) => Err(ProgramFileError::Options {
                file: file.into(),
                reason: format!(
                    "the text \"{}\" is longer than {TEXT_CHARS_MAX} characters or holds control characters",
                    shown(text)
                ),
            }),
        }
    }

    /// Options of simulator and evaluation as an experiment file's are checked, and a driver that exists.
    fn check_options(&self, file: &str) -> Result<(), ProgramFileError> {
        let conditions = &self.conditions;
        let evaluation = match &conditions.evaluation {
            EvaluationOptions::Metadrive(options) => options.realism.check().map_err(|error| error.to_string()),
            EvaluationOptions::Safebench { safebench } => safebench.fault().map_or(Ok(()), |(field, expected)| {
                Err(format!("conditions.evaluation.safebench.{field} is unfit, expected {expected}"))
            }),
        };
        let sequences = self.unfit_sequence().map_or(Ok(()), Err);
        let simulator = conditions.simulator.check().map_err(|error| error.to_string());
        // Weights and planners are not in the file: who plays it names them.
        let ego = match conditions.ego.parse::<Policy>() {
            Ok(_) | Err(PolicyError::NoWeights | PolicyError::NoProgram) => Ok(()),
            Err(error) => Err(format!("conditions.ego: {error}")),
        };
        let all = ego.and(simulator).and(evaluation).and(sequences);
        all.map_err(|reason| ProgramFileError::Options { file: file.into(), reason })
    }
}

/// The family's code, if the file is of this format and its program means the same under the family's contract as it is now.
fn about(file: &str, value: &Value) -> Result<Source, ProgramFileError> {
    let format = value.get("format");
    if format.and_then(Value::as_str) != Some(FORMAT) {
        let found = format.map_or("missing".to_string(), |format| shown(&format.to_string()));
        return Err(ProgramFileError::Format { file: file.into(), found, expected: FORMAT });
    }
    let field = |name: &'static str| {
        value
            .get(name)
            .ok_or_else(|| ProgramFileError::Shape { file: file.into(), reason: format!("missing field `{name}`") })
    };
    let family: FamilyName = serde_json::from_value(field("family")?.clone()).map_err(|error| shape(file, &error))?;
    let source = source_of(file, &family)?;
    let mark: ContractMark = serde_json::from_value(field("contract")?.clone()).map_err(|error| shape(file, &error))?;
    let now = ContractMark::of(&source.contract)
        .map_err(|error| ProgramFileError::Options { file: file.into(), reason: error.to_string() })?;
    match mark.broken_by(&now) {
        Some(changed) => Err(ProgramFileError::Contract { file: file.into(), family: family.to_string(), changed }),
        None => Ok(source),
    }
}

fn shape(file: &str, error: &serde_json::Error) -> ProgramFileError {
    ProgramFileError::Shape { file: file.into(), reason: shown(&error.to_string()) }
}

/// Bytes that are no JSON value: cut off, a number that is none, or something else altogether.
fn unread(file: &str, bytes: &[u8], error: &serde_json::Error) -> ProgramFileError {
    let file = file.to_string();
    let (line, column) = (error.line(), error.column());
    if error.classify() == Category::Eof {
        return ProgramFileError::Truncated { file, bytes: bytes.len() };
    }
    if error.to_string().starts_with("number out of range") {
        return ProgramFileError::NotFinite { file, line, column, found: "a number beyond any float".into() };
    }
    let text = bytes.split(|byte| *byte == b'\n').nth(line.saturating_sub(1)).unwrap_or_default();
    // The parser stops at the word's first or second character.
    let near = String::from_utf8_lossy(text.get(column.saturating_sub(2)..).unwrap_or_default());
    let near = near.trim_start_matches([' ', ':', '-', '[', ',']);
    match NOT_NUMBERS.into_iter().find(|word| near.starts_with(word)) {
        Some(word) => ProgramFileError::NotFinite { file, line, column, found: word.into() },
        None => ProgramFileError::NotJson { file, reason: error.to_string() },
    }
}
