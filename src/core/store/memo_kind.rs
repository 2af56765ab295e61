//! Kinds of requests in the memo.

use serde::{Deserialize, Serialize};

/// Kind of a memo entry's request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MemoKind {
    /// A question to a model -> its raw answer.
    Llm,
    /// A simulation -> its outcome.
    Rollout,
    /// A program tried on a scene by the compile gate -> the compiler's answer.
    Compile,
}

impl MemoKind {
    const ALL: [MemoKind; 3] = [MemoKind::Llm, MemoKind::Rollout, MemoKind::Compile];

    /// Returns the name as printed and as stored in the index.
    pub fn name(self) -> &'static str {
        match self {
            MemoKind::Llm => "llm",
            MemoKind::Rollout => "rollout",
            MemoKind::Compile => "compile",
        }
    }

    pub(super) fn code(self) -> u8 {
        match self {
            MemoKind::Llm => 1,
            MemoKind::Rollout => 2,
            MemoKind::Compile => 3,
        }
    }

    pub(super) fn of_code(code: u8) -> Option<MemoKind> {
        MemoKind::ALL.into_iter().find(|kind| kind.code() == code)
    }

    pub(super) fn of_name(name: &str) -> Option<MemoKind> {
        MemoKind::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

impl std::fmt::Display for MemoKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
