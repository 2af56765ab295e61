//! A result as a file: one JSON object, a scene a line, so that two results can be compared by eye too.

use super::result::SuiteResult;

/// Name and version of the format; another one is refused.
pub const RESULT_FORMAT: &str = "evodrive-suite-result/1";

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

/// The text of a result.
///
/// # Errors
/// A number in it that JSON cannot hold.
pub fn result_to_bytes(result: &SuiteResult) -> Result<Vec<u8>, serde_json::Error> {
    let head = SuiteResult { cases: Vec::new(), ..result.clone() };
    let head = serde_json::to_string(&head)?;
    let lines = result.cases.iter().map(serde_json::to_string).collect::<Result<Vec<_>, _>>()?;
    // The list of cases is the last field, and empty in the head.
    let head = head.strip_suffix("[]}").unwrap_or(&head);
    Ok(format!("{head}[\n{}\n]}}\n", lines.join(",\n")).into_bytes())
}

/// A result from its text; `file` is its name in messages.
///
/// # Errors
/// Bytes that are no result, or one of another format or release.
pub fn result_from_bytes(file: &str, bytes: &[u8]) -> Result<SuiteResult, ResultError> {
    let shape = |error: serde_json::Error| ResultError::Shape { file: file.into(), problem: error.to_string() };
    let value: serde_json::Value = serde_json::from_slice(bytes).map_err(shape)?;
    if value.get("format").and_then(serde_json::Value::as_str) != Some(RESULT_FORMAT) {
        let found =
            value.get("format").map_or("nothing".to_string(), |found| found.to_string().chars().take(80).collect());
        return Err(ResultError::Format { file: file.into(), found });
    }
    let result: SuiteResult = serde_json::from_slice(bytes).map_err(shape)?;
    let outside = |drive: &super::result::Drive| !(0.0..=1.0).contains(&drive.completion);
    match result.cases.iter().find(|played| played.drive().is_some_and(outside)) {
        Some(played) => {
            let problem = format!("case {:?} has a completion outside 0 to 1", played.case);
            Err(ResultError::Shape { file: file.into(), problem })
        }
        None => Ok(result),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::fixture::result;

    #[test]
    fn a_result_comes_back_from_its_text_a_case_a_line() {
        let result = result("a", &[1, 0, 2, 3, 4]);
        let bytes = result_to_bytes(&result).unwrap();
        assert_eq!(result_from_bytes("r", &bytes).unwrap(), result);
        assert_eq!(String::from_utf8_lossy(&bytes).lines().count(), 7);
        let none = SuiteResult { cases: Vec::new(), ..result };
        assert_eq!(result_from_bytes("r", &result_to_bytes(&none).unwrap()).unwrap(), none);
    }

    #[test]
    fn another_format_and_another_shape_are_refused() {
        let text = String::from_utf8(result_to_bytes(&result("a", &[1])).unwrap()).unwrap();
        let read = |text: &str| result_from_bytes("r.json", text.as_bytes()).unwrap_err().to_string();
        assert!(read(&text.replace("result/1", "result/2")).contains("found \"evodrive-suite-result/2\""));
        assert!(read("{}").contains("found nothing") && read("[1").contains("r.json"));
        assert!(read(&text.replace("\"steps\"", "\"stepz\"")).contains("stepz"));
        assert!(read(&text.replace("\"completion\":0.5", "\"completion\":7.5")).contains("outside 0 to 1"));
    }
}
