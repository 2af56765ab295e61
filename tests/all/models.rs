//! Experiments that name real models, as every build sees them: read, checked, replayed; asked only under the feature `live`.

use evodrive::llm::{Cassette, ModelSpec, Request, ResponseFormat};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::harness::{Ran, evodrive, text};

fn example() -> String {
    text("experiments/live_example.toml")
}

/// A command with this text as its experiment; run folders and cassette below `dir`.
fn with(dir: &Path, command: &str, experiment: &str, cassette: &str) -> Ran {
    let path = dir.join(format!("{command}.toml"));
    std::fs::write(&path, experiment).unwrap();
    let mut evodrive = evodrive();
    evodrive.arg(command).arg(&path).args(["--no-report", "--out", dir.join("runs").to_str().unwrap()]);
    Ran::of(evodrive.args(["--cassette", dir.join(cassette).to_str().unwrap()]))
}

#[test]
fn the_example_is_read_and_without_a_recording_says_how_to_make_one() {
    let dir = tempfile::tempdir().unwrap();
    let ran = with(dir.path(), "run", &example(), "none.jsonl");
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(
        ran.stderr.contains("none.jsonl")
            && ran.stderr.contains(&format!("to record it: {} record", env!("CARGO_BIN_EXE_evodrive"))),
        "{}",
        ran.stderr
    );
}

#[cfg(not(feature = "live"))]
#[test]
fn recording_a_real_model_without_the_feature_names_it_and_the_command_that_builds_it() {
    let dir = tempfile::tempdir().unwrap();
    // Before it is asked for what such a model needs, too.
    let capped = "[spend]\nusd_max = 2.0\ntokens_max = 3_000_000\n";
    for text in [example(), example().replacen(capped, "", 1)] {
        let ran = with(dir.path(), "record", &text, "none.jsonl");
        assert_eq!(ran.code, 2, "{}", ran.stderr);
        let said = [
            "models.local.kind is \"openai_compatible\"",
            "cargo build --release --features live",
            "examples/chat/chat.py",
        ];
        for word in said {
            assert!(ran.stderr.contains(word), "{word:?} is not in {}", ran.stderr);
        }
    }
}

#[test]
fn settings_that_cannot_work_are_bad_input_with_their_place() {
    let dir = tempfile::tempdir().unwrap();
    let cases = [
        ("kind = \"anthropic\"", "kind = \"claude\"", "models.claude.kind is \"claude\", expected one of scripted"),
        (
            "model = \"scripted-2\"",
            "model = \"scripted-3\"",
            "models.scripted.model is \"scripted-3\", expected one of scripted-1, scripted-2",
        ),
        ("max_tokens = 1500\n", "", "models.local.sampling.max_tokens is missing"),
        ("usd_max = 2.0", "usd_max = -2.0", "spend.usd_max is -2"),
        ("[spend]\nusd_max = 2.0\ntokens_max = 3_000_000\n", "", "needs a table [spend]"),
        ("api_key_env = \"ANTHROPIC_API_KEY\"", "api_key_env = \"sk-ant-12345\"", "never the key itself"),
        ("cache_prompt = false", "stream = true", "models.local.body.stream"),
    ];
    for (from, to, word) in cases {
        assert!(example().contains(from), "{from}");
        let ran = with(dir.path(), "run", &example().replacen(from, to, 1), "none.jsonl");
        assert_eq!(ran.code, 2, "{to}: {}", ran.stderr);
        assert!(ran.stderr.contains(word), "{word:?} is not in {}", ran.stderr);
        assert!(!ran.stderr.contains("sk-ant"), "{}", ran.stderr);
    }
}

/// The example with rules in place of its real model, under the same name.
fn scripted_twin() -> String {
    let text = example().replace("actor = \"local\"", "actor = \"scripted\"");
    text.replace("repair = \"local\"", "repair = \"scripted\"")
}

#[test]
fn every_build_replays_what_a_real_model_answered_and_its_result_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let recorded = with(dir.path(), "record", &scripted_twin(), "twin.jsonl");
    assert_eq!(recorded.code, 0, "{}", recorded.stderr);
    assert!(recorded.stdout.contains("proposals from: scripted; "), "{}", recorded.stdout);
    // The same answers, as if the real model had given them: prompts do not depend on who is asked.
    let twin = Cassette::load(&dir.path().join("twin.jsonl")).unwrap();
    let mut live = Cassette::new("live");
    for exchange in twin.exchanges() {
        let mut request = exchange.request();
        if matches!(request.slot.role.as_str(), "actor" | "repair") {
            request = Request { model: local(), ..request };
        }
        live.push(&request, exchange.bytes.clone()).unwrap();
    }
    live.save(&dir.path().join("live.jsonl"), "live").unwrap();
    let replayed = with(dir.path(), "run", &example(), "live.jsonl");
    assert_eq!(replayed.code, 0, "{}", replayed.stderr);
    let said = "proposals from: openai_compatible (local, qwen2.5-coder-1.5b) as actor, repair; scripted as ";
    assert!(replayed.stdout.contains(said), "{}", replayed.stdout);
    let opened = opened_models(&dir.path().join("runs"), "openai_compatible");
    assert_eq!(opened["actor"], "openai_compatible (local, qwen2.5-coder-1.5b)");
    assert_eq!(opened["attack_critic"], "scripted");
}

/// `models` of the first event of the run in which `word` stands.
fn opened_models(runs: &Path, word: &str) -> serde_json::Value {
    let folders: Vec<PathBuf> = std::fs::read_dir(runs).unwrap().map(|e| e.unwrap().path()).collect();
    let texts = folders.iter().filter_map(|f| std::fs::read_to_string(f.join("transcript.jsonl")).ok());
    let first = texts.filter_map(|t| Some(t.lines().next()?.to_string())).find(|line| line.contains(word)).unwrap();
    let event: serde_json::Value = serde_json::from_str(&first).unwrap();
    event["body"]["models"].clone()
}

/// `[models.local]` of the example.
fn local() -> ModelSpec {
    let sampling = [("temperature", 0.8), ("top_p", 0.95), ("max_tokens", 1500.0), ("seed", 1.0)];
    ModelSpec {
        name: "local".into(),
        kind: "openai_compatible".into(),
        model: "qwen2.5-coder-1.5b".into(),
        sampling: sampling.into_iter().map(|(name, x)| (name.to_string(), x)).collect(),
        response_format: Some(ResponseFormat::JsonSchema),
        body: BTreeMap::from([("cache_prompt".to_string(), serde_json::json!(false))]),
        here: Default::default(),
    }
}

#[test]
fn no_name_passes_the_stand_in_off_as_a_language_model() {
    let mut spec = ModelSpec { name: "gpt-9".into(), kind: "scripted".into(), ..local() };
    assert_eq!(spec.label(), "scripted (gpt-9, qwen2.5-coder-1.5b)");
    spec.name = "scripted".into();
    assert_eq!(spec.label(), "scripted");
    let posing = ModelSpec { name: "scripted".into(), ..local() };
    assert_eq!(posing.label(), "openai_compatible (scripted, qwen2.5-coder-1.5b)");
}
