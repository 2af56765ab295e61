//! Snapshots of what people and models read: the prompts of every role, the messages of typical mistakes, the data of a
//! report. A mismatch leaves a `.snap.new` beside the snapshot; look at it, then bless it with
//! `INSTA_UPDATE=always cargo test --release --test all snapshots` and say in the commit why it moved. `.ci/run` writes none.

use evodrive::llm::Cassette;
use std::collections::BTreeSet;

use crate::harness::{home, report_data, run, text};
use crate::quickstart::finished;

/// System and user message of the first exchange of every role. The replays of these recordings ask with the same bytes
/// or fail, so what stands here is what the code asks.
fn prompts(cassette: &str, roles: &[&str]) {
    let recorded = Cassette::load(&home().join(cassette)).unwrap();
    let asked: BTreeSet<&str> = recorded.exchanges().iter().map(|exchange| exchange.slot.role.as_str()).collect();
    for role in roles {
        let first = recorded.exchanges().iter().find(|exchange| exchange.slot.role == *role);
        let request = first.unwrap_or_else(|| panic!("{cassette} has no {role}, only {asked:?}")).request();
        let messages = request.messages.iter().map(|message| format!("[{}]\n{}\n", message.role, &*message.text));
        insta::assert_snapshot!(format!("prompt_{role}"), messages.collect::<Vec<_>>().join("\n"));
    }
}

#[test]
fn prompts_of_the_roles_that_evolve_a_program() {
    let critics = ["structural_critic", "attack_critic", "realism_critic", "isolation_critic"];
    prompts("cassettes/quickstart.jsonl", &[&["actor", "repair"], &critics[..]].concat());
}

#[test]
fn prompts_of_the_roles_that_see_scenes_and_descriptions() {
    prompts("cassettes/metadrive/llm_attacker-idm.jsonl.zst", &["attacker_agent"]);
    prompts("cassettes/safebench-chatscene-idm.jsonl.zst", &["template_agent"]);
}

#[test]
fn the_prompt_of_the_role_that_sees_the_world_evaluator() {
    prompts("cassettes/world/short.jsonl.zst", &["world_agent"]);
}

#[test]
fn messages_of_typical_mistakes() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_string();
    let quickstart = text("experiments/quickstart.toml");
    std::fs::write(at("family.toml"), quickstart.replace("family = \"at\"", "family = \"atx\"")).unwrap();
    std::fs::write(at("cut.jsonl"), &text("cassettes/quickstart.jsonl")[..1000]).unwrap();
    let folder = finished().1.to_str().unwrap().to_string();
    let mistakes: [(&str, Vec<String>); 7] = [
        ("a command that does not exist", vec!["frobnicate".into()]),
        ("an experiment file that does not exist", vec!["run".into(), "no/such/file.toml".into()]),
        (
            "a family that does not exist",
            ["run", &at("family.toml"), "--out", &at("runs"), "--cassette", "cassettes/quickstart.jsonl"]
                .map(String::from)
                .to_vec(),
        ),
        (
            "a cassette that is cut off",
            ["run", "experiments/quickstart.toml", "--out", &at("runs"), "--cassette", &at("cut.jsonl")]
                .map(String::from)
                .to_vec(),
        ),
        (
            "an attempt that the run does not have",
            ["show", "cat-idm/e99s0", "--run", &folder].map(String::from).to_vec(),
        ),
        ("a table of the other protocol", ["table", "safebench-main", "--run", &folder].map(String::from).to_vec()),
        ("a folder that is no run", ["fsck", &at("nowhere")].map(String::from).to_vec()),
    ];
    let mut printed = String::new();
    for (mistake, args) in &mistakes {
        let ran = run(&args.iter().map(String::as_str).collect::<Vec<_>>());
        printed += &format!("# {mistake}\nexit {}\n{}\n", ran.code, ran.stderr.trim_end());
    }
    let printed = printed.replace(&folder, "RUN").replace(dir.path().to_str().unwrap(), "DIR");
    let printed = printed.replace(env!("CARGO_BIN_EXE_evodrive"), "evodrive");
    insta::assert_snapshot!("mistakes", printed);
}

/// The data that the page's script draws, but for the cost, which differs in every run: the scalars, the findings, and of
/// each list its first element.
#[test]
fn data_of_the_report() {
    let page = std::fs::read_to_string(finished().1.join("report.html")).unwrap();
    let whole = report_data(&page);
    let mut shown = whole[0].as_object().unwrap().clone();
    shown.remove("cost").expect("what it cost");
    for (name, value) in &mut shown {
        if let serde_json::Value::Array(all) = value
            && name != "findings"
        {
            all.truncate(1);
        }
    }
    insta::assert_snapshot!("report_data", serde_json::to_string_pretty(&shown).unwrap());
}
