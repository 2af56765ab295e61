//! A result as a file: one JSON object, one scene per line, so that two results can be compared by eye too. Its seal is the digest of all
//! the rest of it, which shows that nothing was changed since.

use super::result::{Drive, Played, SuiteResult};
use crate::kernel::{Digest, canon::CanonError};
use crate::sim::End;

/// Name and version of the format.
pub const RESULT_FORMAT: &str = "evodrive-suite-result/2";
/// The format before it: without a seal, a selection and digests of recordings. It can be read, and is reported as unsealed.
const UNSEALED_FORMAT: &str = "evodrive-suite-result/1";

/// Why bytes are no result.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ResultError {
    #[error(
        "{file} is no result of a suite: expected `format` {RESULT_FORMAT:?}, found {found}; make one with `evodrive suite run SUITE --out FILE`"
    )]
    Format { file: String, found: String },
    #[error("{file}: expected a result of a suite as `evodrive suite run` writes it, found: {problem}; make it anew")]
    Shape { file: String, problem: String },
}

/// The text of a result, sealed.
///
/// # Errors
/// A number in it that JSON cannot hold.
pub fn result_to_bytes(result: &SuiteResult) -> Result<Vec<u8>, CanonError> {
    let mut sealed = SuiteResult { format: RESULT_FORMAT.into(), ..result.clone() };
    sealed.seal = Some(seal_of(&sealed)?);
    let other = |error: serde_json::Error| CanonError::Other(error.to_string());
    let lines = sealed.cases.iter().map(serde_json::to_string).collect::<Result<Vec<_>, _>>().map_err(other)?;
    let head = serde_json::to_string(&SuiteResult { cases: Vec::new(), ..sealed }).map_err(other)?;
    // The list of cases is the last field, and empty in the head.
    let head = head.strip_suffix("[]}").unwrap_or(&head);
    Ok(format!("{head}[\n{}\n]}}\n", lines.join(",\n")).into_bytes())
}

fn seal_of(result: &SuiteResult) -> Result<Digest, CanonError> {
    Digest::of("evodrive/suite-result/2", &SuiteResult { seal: None, ..result.clone() })
}

/// Returns `true` if a result is as it was written; `None` where it has no seal.
///
/// # Errors
/// A number in it that has no canonical bytes.
pub fn is_as_sealed(result: &SuiteResult) -> Result<Option<bool>, CanonError> {
    match result.seal {
        None => Ok(None),
        Some(seal) => Ok(Some(seal == seal_of(result)?)),
    }
}

/// Reads a result from its text; `file` is its name in messages. Its seal is not checked here, but by [`is_as_sealed`].
///
/// # Errors
/// Bytes that are no result, or one of another format or release.
pub fn result_from_bytes(file: &str, bytes: &[u8]) -> Result<SuiteResult, ResultError> {
    let wrong = |problem: String| ResultError::Shape { file: file.into(), problem };
    let shape = |error: serde_json::Error| wrong(error.to_string());
    let value: serde_json::Value = serde_json::from_slice(bytes).map_err(shape)?;
    let format = value.get("format").and_then(serde_json::Value::as_str);
    if !format.is_some_and(|format| [RESULT_FORMAT, UNSEALED_FORMAT].contains(&format)) {
        let found =
            value.get("format").map_or("nothing".to_string(), |found| found.to_string().chars().take(80).collect());
        return Err(ResultError::Format { file: file.into(), found });
    }
    let result: SuiteResult = serde_json::from_slice(bytes).map_err(shape)?;
    let unmarked = result.recordings.iter().any(|recording| recording.digest.is_none());
    if result.format == RESULT_FORMAT && (result.seal.is_none() || result.selection.is_none() || unmarked) {
        return Err(wrong(format!("no `seal`, `selection` or `digest` of a recording, which {RESULT_FORMAT:?} has")));
    }
    let fault = |drive: &Drive| {
        if !(0.0..=1.0).contains(&drive.completion) {
            return Some("a completion outside 0 to 1");
        }
        ((drive.end == End::Contact) != drive.contact.is_some())
            .then_some("a contact without that end, or the end without one")
    };
    let fault = |played: &Played| {
        let realism = played.realism.is_some_and(|realism| !(0.0..=1.0).contains(&realism));
        if realism { Some("a realism outside 0 to 1") } else { fault(played.drive()?) }
    };
    match result.cases.iter().find_map(|played| Some((&played.case, fault(played)?))) {
        Some((case, fault)) => Err(wrong(format!("case {case:?} has {fault}"))),
        None => Ok(result),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::fixture::result;
    use crate::suite::{Recording, Selected};

    fn written(result: &SuiteResult) -> SuiteResult {
        result_from_bytes("r", &result_to_bytes(result).unwrap()).unwrap()
    }

    #[test]
    fn a_result_comes_back_from_its_text_a_case_a_line() {
        let result = result("a", &[1, 0, 2, 3, 4]);
        let bytes = result_to_bytes(&result).unwrap();
        let back = result_from_bytes("r", &bytes).unwrap();
        assert_eq!(is_as_sealed(&back), Ok(Some(true)));
        assert_eq!(SuiteResult { seal: None, ..back }, result);
        assert_eq!(String::from_utf8_lossy(&bytes).lines().count(), 7);
        let none = SuiteResult { cases: Vec::new(), ..result };
        assert_eq!(SuiteResult { seal: None, ..written(&none) }, none);
    }

    #[test]
    fn every_change_of_a_result_breaks_its_seal() {
        let result = result("a", &[1, 0, 2, 3, 4, 5]);
        let sealed = written(&result);
        type Change = fn(&mut SuiteResult);
        let changes: [Change; 13] = [
            |of| drop(of.cases.remove(0)),
            |of| of.cases.push(of.cases[0].clone()),
            |of| of.cases.swap(0, 1),
            |of| of.cases[0].case.push('x'),
            |of| of.cases[0].family.push('x'),
            |of| of.cases[0].came = of.cases[1].came.clone(),
            |of| of.cases[0].realism = Some(0.5),
            |of| of.driver.name.push('x'),
            |of| of.driver.digest = Digest::of_bytes(b"other"),
            |of| of.suite.digest = Digest::of_bytes(b"other"),
            |of| of.simulator += 1,
            |of| of.selection = Some(Selected { family: vec!["cat".into()], ..Selected::default() }),
            |of| of.recordings.push(Recording { rules: 0, file: "r".into(), digest: None }),
        ];
        for (k, change) in changes.into_iter().enumerate() {
            let mut changed = sealed.clone();
            change(&mut changed);
            assert_eq!(is_as_sealed(&changed), Ok(Some(false)), "change {k}");
        }
    }

    #[test]
    fn another_format_and_another_shape_are_refused_and_the_format_before_has_no_seal() {
        let text = String::from_utf8(result_to_bytes(&result("a", &[1])).unwrap()).unwrap();
        let read = |text: &str| result_from_bytes("r.json", text.as_bytes()).unwrap_err().to_string();
        assert!(read(&text.replace("result/2", "result/3")).contains("found \"evodrive-suite-result/3\""));
        assert!(read("{}").contains("found nothing") && read("[1").contains("r.json"));
        assert!(read(&text.replace("\"steps\"", "\"stepz\"")).contains("stepz"));
        assert!(read(&text.replace("\"completion\":0.5", "\"completion\":7.5")).contains("outside 0 to 1"));
        assert!(
            read(&text.replace("\"end\":\"contact\"", "\"end\":\"arrived\"")).contains("a contact without that end")
        );
        let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
        let object = value.as_object_mut().unwrap();
        object.remove("seal");
        assert!(read(&serde_json::to_string(&object).unwrap()).contains("no `seal`"));
        object.remove("selection");
        object.insert("format".into(), "evodrive-suite-result/1".into());
        let old = result_from_bytes("r.json", serde_json::to_string(&object).unwrap().as_bytes()).unwrap();
        assert_eq!((is_as_sealed(&old), old.selection), (Ok(None), None));
    }
}
