//! A model that is held to the closed schema of a question cannot give a patch that the gates refuse, whatever of its lists it takes.

use evodrive::agents::{
    Acceptance, Briefing, Cluster, Context, Handbook, HandbookParts, Measures, Omitted, Protocol, Questions, Target,
    TargetKind, Task, contract_text, prompt, reply,
};
use evodrive::candidates::{Judging, Trials, admit};
use evodrive::kernel::Digest;
use evodrive::llm::{ModelSpec, Request, ResponseFormat};
use evodrive::objects::{LineageId, Program, Role, SolutionId};
use evodrive::stage::Source;
use serde_json::{Value, json};
use std::collections::BTreeMap;

fn model(format: ResponseFormat) -> ModelSpec {
    ModelSpec {
        name: "small".into(),
        kind: "openai_compatible".into(),
        model: "small".into(),
        sampling: BTreeMap::new(),
        response_format: Some(format),
        body: BTreeMap::new(),
        here: Default::default(),
    }
}

/// Every value that a schema of lists, objects and texts allows, one choice at a time: of lists of more than one item the first few.
fn values(schema: &Value, free: &Value) -> Vec<Value> {
    if let Some(words) = schema["enum"].as_array() {
        return words.clone();
    }
    if let Some(options) = schema["anyOf"].as_array() {
        return options.iter().flat_map(|option| values(option, free)).collect();
    }
    let Some(members) = schema["properties"].as_object() else { return vec![free.clone()] };
    // The first value of each member; then, of one member after the other, all of them.
    let all: Vec<(&String, Vec<Value>)> = members.iter().map(|(name, of)| (name, values(of, &free[name]))).collect();
    let first: Value =
        all.iter().map(|(name, of)| ((*name).clone(), of[0].clone())).collect::<serde_json::Map<_, _>>().into();
    let mut found = vec![first.clone()];
    for (name, of) in &all {
        found.extend(of.iter().skip(1).map(|value| {
            let mut other = first.clone();
            other[name.as_str()] = value.clone();
            other
        }));
    }
    found
}

/// The question to the actor of a family about its parent.
fn asked(source: &Source, format: ResponseFormat, fixed_bodies: bool) -> (Request, Program) {
    let lineage = LineageId::new("mine");
    let mut parent = source.parent.clone();
    (parent.lineage_id, parent.solution_id) = (lineage.clone(), SolutionId::new("mine/parent"));
    let measures = Measures {
        protocol: Protocol::Safebench { limits: vec![] },
        acceptance: Acceptance {
            r0: 0.95,
            a0: 0.5,
            epsilon_r: 0.0,
            epsilon_a: 0.0,
            level: 0.95,
            coverage_floor: 0.5,
            realism_min: 0.95,
        },
        rule: None,
        tradeoff: true,
        fixed_bodies,
        otherwise: vec![],
    };
    let contract = contract_text(&source.contract);
    let handbook = Handbook::of(&HandbookParts {
        contract: &source.contract,
        contract_text: &contract,
        parent: &source.parent,
        foreign_vocabulary: &[],
        protected_words: &[],
        measures: &measures,
        omitted: Omitted::default(),
        detail: None,
    })
    .unwrap();
    let clusters = [Cluster {
        name: "cluster:dense".into(),
        scenes: 3,
        describes: "many".into(),
        attacked_share: None,
        features: BTreeMap::new(),
        outcomes: BTreeMap::new(),
    }];
    let context = Context {
        lineage: &lineage,
        epoch: 0,
        parent_hash: parent.hash().unwrap(),
        parent: &parent,
        handbook: &handbook,
        ego: "IDM",
        memory: &[],
        clusters: &clusters,
        parent_outcome: None,
        window: &[],
        history: &[],
        front: &[],
        questions: Questions::Plain,
        not_shown: "",
    };
    let briefing = Briefing::of(&context).unwrap();
    let target = Target { kind: TargetKind::RaiseAttack, text: "t".into(), instruction: "i".into() };
    let task = Task {
        briefing: &briefing,
        slot: 0,
        target: &target,
        models: &BTreeMap::new(),
        critics: &[],
        max_repair_rounds: 0,
        gates: Default::default(),
        unreadable_critic: Default::default(),
        unreadable_patch: Default::default(),
        tunes: false,
    };
    (prompt::request(&task, &model(format), Role::Actor, 0, &prompt::Subject::None).unwrap(), parent)
}

#[test]
fn whatever_is_taken_from_a_closed_schema_passes_reader_and_gates() {
    let (sources, registry) = (evodrive::families::sources(), evodrive::families::registry());
    for source in sources.iter() {
        let (request, parent) = asked(source, ResponseFormat::JsonSchemaClosed, true);
        let members = &request.schema["properties"]["program_patch"]["properties"];
        assert_eq!(members["operations"]["maxItems"], 1, "of two edits the second may be of the first one's place");
        let edits = members["operations"]["items"]["anyOf"].as_array().unwrap();
        let judging = Judging { fixed_bodies: true, ..Judging::whole(&source.contract, &registry) };
        let mut count = 0;
        for edit in edits {
            let path = edit["properties"]["path"]["enum"][0].as_str().unwrap();
            // What the module says now, in other words.
            let module = path.strip_prefix("/mechanism_modules/").map(|name| json!(parent.mechanism_modules[name]));
            let free = module.map_or(Value::Null, |mut module| {
                module["expression"] = format!("({})", module["expression"].as_str().unwrap()).into();
                module
            });
            let is_module = !free.is_null();
            for mut operation in values(edit, &json!({"value": free})) {
                if is_module {
                    // Its inputs are those that the expression reads; each is on the list.
                    let listed =
                        edit["properties"]["value"]["properties"]["inputs"]["items"]["enum"].as_array().unwrap();
                    assert!(free["inputs"].as_array().unwrap().iter().all(|input| listed.contains(input)), "{path}");
                    operation["value"] = free.clone();
                }
                let answer = json!({"response_id": "any", "program_patch": {
                    "source_baseline": members["source_baseline"]["enum"][0],
                    "parent_solution_id": members["parent_solution_id"]["enum"][0],
                    "parent_program_hash": members["parent_program_hash"]["enum"][0],
                    "hypothesis": "A value.", "operations": [operation], "memory_refs_used": [],
                    "cluster_refs_used": members["cluster_refs_used"]["items"]["enum"],
                }});
                let patch = reply::patch(answer.to_string().as_bytes(), Role::Actor).unwrap();
                let nothing_compiled = |_: &Program, _: Digest| Trials::default();
                let gates = admit(&parent, &patch, SolutionId::new("mine/e0s0"), &judging, &nothing_compiled).gates;
                let problems: Vec<_> = gates.failed().flat_map(|verdict| verdict.problems.clone()).collect();
                assert!(problems.is_empty(), "{}: {operation}: {problems:?}", source.contract.family);
                count += 1;
            }
        }
        assert!(count > 30, "{}: {count} edits", source.contract.family);
        let bytes = request.schema.to_string().len();
        // Servers make a grammar of it.
        assert!(bytes < 1 << 16, "{}: {bytes} bytes", source.contract.family);
    }
}

#[test]
fn other_formats_keep_the_open_schema_and_their_keys() {
    let source = evodrive::families::sources();
    let source = source.iter().next().unwrap();
    let key = |format| asked(source, format, false).0;
    let (open, closed) = (key(ResponseFormat::JsonSchema), key(ResponseFormat::JsonSchemaClosed));
    assert_eq!(*open.schema, evodrive::agents::schema(Role::Actor));
    assert_ne!(*closed.schema, *open.schema);
    assert_eq!(open.messages, closed.messages);
}
