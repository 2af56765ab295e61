//! Readers of what comes from elsewhere, given real files that were changed: nothing panics, and none takes more than 256 MiB.
//!
//! Each target changes a seed a few times: in its bytes (flips, cuts, doubled and swapped stretches, hostile words), and where it is
//! JSON in its tree (hostile values, fields gone, doubled or renamed, other nesting). `PROPTEST_CASES=20000 cargo test --release
//! --test fuzz` draws more; a case that fails is printed, and belongs into `crashes` for ever.

// An allocator that counts: `GlobalAlloc` is an unsafe trait.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;
use std::sync::OnceLock;

use evodrive::agents::reply;
use evodrive::backend::{RolloutCassette, serve};
use evodrive::bundle;
use evodrive::ego::Policy;
use evodrive::experiment::{Experiment, ProgramFile};
use evodrive::formats::import_files;
use evodrive::kernel::{Digest, Formula};
use evodrive::llm::Cassette;
use evodrive::objects::Role;
use evodrive::objects::expr::Expr;
use evodrive::scene::pool;
use evodrive::shard::Shard;
use evodrive::sim::{Law, Plant};
use evodrive::store;
use proptest::prelude::*;
use serde_json::{Value, json};

/// Bytes that a reader may hold at once.
const HELD_BYTES_MAX: isize = 256 << 20;

struct Counting;

thread_local! {
    static HELD: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

fn count(bytes: isize) {
    // A thread that ends frees after its counters are gone.
    let held = HELD.try_with(|held| {
        held.set(held.get() + bytes);
        held.get()
    });
    if let Ok(held) = held {
        let _ = PEAK.try_with(|peak| peak.set(peak.get().max(held)));
    }
}

unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Runs a reader and returns how much more it held at its peak than before.
fn peak(read: impl FnOnce()) -> isize {
    let before = HELD.with(Cell::get);
    PEAK.with(|peak| peak.set(before));
    read();
    PEAK.with(Cell::get) - before
}

fn file(path: &str) -> Vec<u8> {
    let home = Path::new(env!("CARGO_MANIFEST_DIR"));
    std::fs::read(home.join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The first lines of a file that is long.
fn head(path: &str, lines: usize) -> Vec<u8> {
    let bytes = file(path);
    let ends = bytes.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(at, _)| at + 1);
    bytes[..ends.take(lines).last().unwrap_or(bytes.len())].to_vec()
}

/// A reader with the files that it is given changed.
struct Target {
    name: &'static str,
    seeds: Vec<Vec<u8>>,
    read: fn(&[u8]),
}

/// All targets, made once.
fn targets() -> &'static [Target] {
    static TARGETS: OnceLock<Vec<Target>> = OnceLock::new();
    TARGETS.get_or_init(make_targets)
}

fn make_targets() -> Vec<Target> {
    let laws: Vec<Vec<u8>> = [
        json!({"acceleration": [{"load": 2}, {"constant": 0.5}, "times", {"constant": -6.0}, {"constant": 3.0}, "clamp"]}),
        json!({"onset": [{"load": 0}, {"constant": 1.0}, "more"], "acceleration": [{"constant": 1.0}], "offset": [{"load": 1}, "minus"]}),
    ]
    .map(|law| law.to_string().into_bytes())
    .to_vec();
    let expressions = [
        "clamp(0.5 * gap_m / max(speed_mps, 0.1), 0, 1)",
        "if(time_to_conflict_s < 2.5 and not is_parked, -exp(-x), 3.0)",
        "-(a + b) * c / (1 - d) >= 2 or e == 1",
    ];
    let fixtures = [
        "tests/fixtures/commonroad/two_lanes_2018b.xml",
        "tests/fixtures/commonroad/crossing_2020a.xml",
        "tests/fixtures/scenarionet/waymo_form_4.pkl",
    ];
    vec![
        Target {
            name: "cassette",
            seeds: vec![head("cassettes/quickstart.jsonl", 14)],
            read: |bytes| drop(Cassette::parse(bytes, "seed.jsonl")),
        },
        Target { name: "patch", seeds: vec![patch()], read: read_patch },
        Target {
            name: "expression",
            seeds: expressions.map(|text| text.as_bytes().to_vec()).to_vec(),
            read: |bytes| drop(std::str::from_utf8(bytes).map(Expr::parse)),
        },
        Target { name: "law", seeds: laws, read: read_law },
        Target { name: "scene", seeds: [fixtures.map(file).to_vec(), descriptions()].concat(), read: |bytes| drop(import_files(&[("seed", bytes)])) },
        Target { name: "pool", seeds: vec![pooled()], read: |bytes| drop(pool::decode("seed.pool", bytes)) },
        Target {
            name: "program file",
            seeds: vec![json!({"format": "evodrive-program/1", "digest": Digest::of_bytes(b""), "family": "cat", "program": {}}).to_string().into()],
            read: |bytes| drop(ProgramFile::from_bytes("seed.json", bytes)),
        },
        Target {
            name: "rollout cassette",
            seeds: vec![br#"{"format":"evodrive-rollouts","version":"1.0","name":"x"}"#.to_vec()],
            read: |bytes| drop(RolloutCassette::parse(bytes, "seed.jsonl")),
        },
        Target {
            name: "shard",
            seeds: vec![br#"{"format":"evodrive-shard","version":"1.0","study":{},"programs":0,"tasks":0}"#.to_vec()],
            read: |bytes| drop(Shard::parse(bytes, "seed.shard")),
        },
        Target { name: "transcript", seeds: vec![of_bundle("transcript.jsonl")], read: read_transcript },
        Target { name: "bundle", seeds: vec![file(BUNDLE)], read: read_bundle },
        Target { name: "pack", seeds: vec![of_bundle("store/objects.pack")], read: read_pack },
        Target { name: "worker request", seeds: vec![request()], read: |bytes| drop(serve(bytes)) },
        Target {
            name: "experiment",
            seeds: ["quickstart", "own_ego", "live_example"].map(experiment).to_vec(),
            read: |bytes| as_file("seed.toml", bytes, |path| drop(Experiment::read(path))),
        },
        Target { name: "weights", seeds: vec![weights()], read: |bytes| drop(Policy::learned(bytes)) },
    ]
}

const BUNDLE: &str = "golden/bundles/frozen-2.evodrive";

/// One file of a bundle.
fn of_bundle(name: &str) -> Vec<u8> {
    let inside = zstd::decode_all(file(BUNDLE).as_slice()).unwrap();
    let mut archive = tar::Archive::new(inside.as_slice());
    let mut entry = archive.entries().unwrap().map(Result::unwrap).find(|of| of.path().unwrap() == Path::new(name));
    let mut bytes = Vec::new();
    std::io::Read::read_to_end(entry.as_mut().expect("a file of the bundle"), &mut bytes).unwrap();
    bytes
}

/// Gives a reader a file with these bytes, in a folder of its own.
fn as_file(name: &str, bytes: &[u8], read: impl FnOnce(&Path)) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read(&path);
}

fn read_transcript(bytes: &[u8]) {
    as_file("transcript.jsonl", bytes, |path| drop(store::read_events(path)));
}

fn read_bundle(bytes: &[u8]) {
    as_file("seed.evodrive", bytes, |path| drop(bundle::open(path, 1 << 30, None)));
}

fn read_pack(bytes: &[u8]) {
    as_file("objects.pack", bytes, |path| drop(store::fsck(path.parent().unwrap(), true)));
}

/// Small scenes in the JSON of ScenarioNet and of GPUDrive, a line each.
fn descriptions() -> Vec<Vec<u8>> {
    let track = |x: f64| {
        json!({"type": "VEHICLE", "state": {
            "position": (0..30).map(|k| json!([x + f64::from(k), 0.5, 0.0])).collect::<Vec<_>>(), "heading": vec![0.0; 30],
            "velocity": vec![json!([10.0, 0.0]); 30], "valid": vec![1; 30], "length": 4.5, "width": 1.9,
        }})
    };
    let lane = |exits: &[&str]| json!({"type": "LANE_SURFACE_STREET", "polyline": [[-20.0, 0.0], [40.0, 0.0], [90.0, 0.0]], "exit_lanes": exits, "speed_limit_kmh": "50kmh"});
    let scenarionet = json!({
        "id": "s", "version": "x", "length": 30, "tracks": {"1": track(0.0), "2": track(20.0)},
        "map_features": {"10": lane(&["11"]), "11": lane(&[])},
        "dynamic_map_states": {"10": {"lane": "10", "state": {"object_state": ["LANE_STATE_GO"]}}},
        "metadata": {"ts": (0..30).map(|k| 0.1 * f64::from(k)).collect::<Vec<_>>(), "sdc_id": "1", "objects_of_interest": ["2"]},
    });
    let object = |id: i64, x: f64| {
        json!({
            "id": id, "type": "vehicle", "length": 4.6, "width": 1.9, "heading": vec![0.0; 30], "valid": vec![true; 30],
            "position": (0..30).map(|k| json!({"x": x + f64::from(k), "y": 0.0, "z": 0.0})).collect::<Vec<_>>(),
            "velocity": vec![json!({"x": 10.0, "y": 0.0}); 30],
        })
    };
    let gpudrive = json!({
        "name": "g.json", "scenario_id": "g", "objects": [object(7, 0.0), object(9, 20.0)],
        "roads": [{"id": 50, "map_element_id": 2, "type": "lane", "geometry": [{"x": -20.0, "y": 0.0}, {"x": 90.0, "y": 0.0}]}],
        "tl_states": {"50": {"state": ["stop"], "x": [40.0], "y": [0.0], "time_index": [3]}},
        "metadata": {"sdc_track_index": 0, "objects_of_interest": [9]},
    });
    [scenarionet, gpudrive].map(|scene| scene.to_string().into_bytes()).to_vec()
}

/// A reply of an actor.
fn patch() -> Vec<u8> {
    let operations = json!([
        {"op": "replace", "path": "/parameters/duration_s", "value": 2.5},
        {"op": "add", "path": "/mechanism_modules/lean", "value": {"slot": "actor_score", "expression": "0.5 * gap_m"}},
    ]);
    let patch = json!({
        "source_baseline": "cat", "parent_solution_id": "cat-idm/parent", "parent_program_hash": "ab".repeat(32), "operations": operations,
        "hypothesis": "a longer push", "memory_refs_used": [], "cluster_refs_used": ["dense"],
    });
    json!({"response_id": "r1", "program_patch": patch}).to_string().into_bytes()
}

fn read_patch(bytes: &[u8]) {
    drop(reply::patch(bytes, Role::Actor));
    drop(reply::patch(bytes, Role::Repair));
}

fn read_law(bytes: &[u8]) {
    drop(serde_json::from_slice::<Formula>(bytes));
    let Ok(law) = serde_json::from_slice::<Law>(bytes) else { return };
    for formula in [Some(law.acceleration), law.onset, law.offset].into_iter().flatten() {
        for values in [[0.0; 8], [f64::NAN; 8], [f64::MAX; 8]] {
            assert!(formula.value(&values).is_finite());
            assert!(formula.value(&values[..1]).is_finite());
        }
    }
}

/// A pool of the scenes of a fixture.
fn pooled() -> Vec<u8> {
    let imported = import_files(&[("seed.xml", file("tests/fixtures/commonroad/two_lanes_2018b.xml"))]);
    assert!(!imported.scenes.is_empty());
    pool::encode(&pool::Pool::new(imported.scenes, Vec::new()).unwrap())
}

/// A request to a worker.
fn request() -> Vec<u8> {
    let scene = pool::decode("seed.pool", &pooled()).unwrap().scenes.swap_remove(0);
    let plant = Plant::new(&scene).unwrap();
    let (first_step, steps) = (plant.first_step(), plant.steps());
    let sample = scene.ego.track.samples[0];
    let away = json!({"who": {"track": 0}, "kind": "vehicle", "length_m": 4.5, "width_m": 1.9, "samples": [sample, null, sample]});
    json!({
        "request": Digest::of_bytes(b""), "scene": scene, "first_step": first_step, "steps": steps, "ego": "idm", "seed": 7,
        "adversaries": [away], "options": {"plant": "physical"},
    })
    .to_string()
    .into_bytes()
}

/// An experiment of this repository.
fn experiment(name: &str) -> Vec<u8> {
    match name {
        "own_ego" => file("examples/own_ego/idm.toml"),
        name => file(&format!("experiments/{name}.toml")),
    }
}

/// The frame of a file of weights.
fn weights() -> Vec<u8> {
    let header = br#"{"__metadata__":{"setting":"four_numbers"},"actor.0.weight":{"dtype":"F32","shape":[2,2],"data_offsets":[0,16]}}"#;
    [&(header.len() as u64).to_le_bytes()[..], header, &[0; 16]].concat()
}

/// One change of a file. Places are shares of its length, in 1/65536.
#[derive(Clone, Debug)]
enum Change {
    Flip(u16, u8),
    Cut(u16),
    Drop(u16, u16),
    Double(u16, u16),
    Swap(u16, u16),
    Insert(u16, usize),
    /// A node of the JSON tree: which one, what becomes of it, with which hostile value.
    Node(u16, u8, usize),
}

/// Words that break parsers.
const WORDS: [&str; 26] = [
    "1e999",
    "-1",
    "18446744073709551616",
    "1e308",
    "-0.0",
    "NaN",
    "null",
    "[[[[[[[[",
    "{\"\":",
    "\u{0}",
    "\"",
    "\\ud800",
    "\n",
    "((((((((",
    "-----",
    "&a;",
    "<!DOCTYPE x [<!ENTITY a \"b\">]>",
    "../../../../etc/passwd",
    "/etc/passwd",
    "4294967295",
    "999999999999",
    "\u{feff}",
    "\u{1b}[2J",
    "if(if(if(",
    "1e-999",
    "~1~0/-",
];

fn hostile(place: usize) -> Value {
    let deep = |n: usize| (0..n).fold(json!(0), |inner, _| json!([inner]));
    let all = [
        json!(null),
        json!(-1),
        json!(u64::MAX),
        json!(1e308),
        json!(5e-324),
        json!(""),
        json!("../../x"),
        json!([]),
        json!({}),
        json!(true),
        json!("\u{0}\u{1b}[2J"),
        json!(i64::MIN),
        json!(vec![0; 2000]),
        deep(120),
        json!("a".repeat(100_000)),
        json!({"a": {"b": {"c": 1}}}),
        json!("clamp(clamp(clamp("),
        json!(0.1),
        json!(["add", "add", "add"]),
        json!([{"load": 99_999_999}]),
        json!([{"constant": 1e308}, "exp", "exp"]),
    ];
    all[place % all.len()].clone()
}

fn change() -> impl Strategy<Value = Change> {
    prop_oneof![
        (any::<u16>(), any::<u8>()).prop_map(|(at, bit)| Change::Flip(at, bit % 8)),
        any::<u16>().prop_map(Change::Cut),
        (any::<u16>(), any::<u16>()).prop_map(|(at, length)| Change::Drop(at, length % 4096)),
        (any::<u16>(), any::<u16>()).prop_map(|(at, length)| Change::Double(at, length % 8192)),
        (any::<u16>(), any::<u16>()).prop_map(|(one, other)| Change::Swap(one, other)),
        (any::<u16>(), 0..WORDS.len()).prop_map(|(at, word)| Change::Insert(at, word)),
        (any::<u16>(), any::<u8>(), 0..64usize).prop_map(|(node, how, value)| Change::Node(node, how, value)),
        (any::<u16>(), any::<u8>(), 0..64usize).prop_map(|(node, how, value)| Change::Node(node, how, value)),
    ]
}

fn place(share: u16, length: usize) -> usize {
    usize::from(share) * length / 65536
}

fn changed(seed: &[u8], changes: &[Change]) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for change in changes {
        let length = bytes.len();
        match *change {
            Change::Flip(at, bit) if length > 0 => bytes[place(at, length)] ^= 1 << bit,
            Change::Cut(at) => bytes.truncate(place(at, length)),
            Change::Drop(at, span) => {
                drop(bytes.drain(place(at, length)..(place(at, length) + usize::from(span)).min(length)))
            }
            Change::Double(at, span) => {
                let stretch = bytes[place(at, length)..(place(at, length) + usize::from(span)).min(length)].to_vec();
                drop(bytes.splice(place(at, length)..place(at, length), stretch));
            }
            Change::Swap(one, other) if length > 0 => bytes.swap(place(one, length), place(other, length)),
            Change::Insert(at, word) => drop(bytes.splice(place(at, length)..place(at, length), WORDS[word].bytes())),
            Change::Node(node, how, value) => replant(&mut bytes, node, how, value),
            _ => {}
        }
    }
    bytes
}

/// Changes a node in one line of JSON.
fn replant(bytes: &mut Vec<u8>, node: u16, how: u8, value: usize) {
    let mut lines: Vec<Vec<u8>> = bytes.split(|byte| *byte == b'\n').map(<[u8]>::to_vec).collect();
    let chosen = usize::from(node) % lines.len();
    let Ok(mut tree) = serde_json::from_slice::<Value>(&lines[chosen]) else { return };
    let mut count = 0;
    nodes(&mut tree, &mut |_| count += 1);
    let (wanted, mut at) = (usize::from(node / 7) % count.max(1), 0);
    nodes(&mut tree, &mut |found| {
        if at == wanted {
            alter(found, how, value);
        }
        at += 1;
    });
    lines[chosen] = tree.to_string().into_bytes();
    *bytes = lines.join(&b'\n');
}

fn nodes(tree: &mut Value, each: &mut dyn FnMut(&mut Value)) {
    match tree {
        Value::Array(items) => items.iter_mut().for_each(|item| nodes(item, each)),
        Value::Object(map) => map.iter_mut().for_each(|(_, item)| nodes(item, each)),
        _ => {}
    }
    each(tree);
}

fn alter(node: &mut Value, how: u8, value: usize) {
    match (how % 5, &mut *node) {
        (1, Value::Object(map)) => {
            let key = map.keys().nth(value % map.len().max(1)).cloned();
            if let Some(key) = key {
                map.remove(&key);
            }
        }
        (2, Value::Object(map)) => drop(map.insert(WORDS[value % WORDS.len()].into(), hostile(value))),
        (2, Value::Array(items)) => items.push(hostile(value)),
        (3, Value::Array(items)) if !items.is_empty() => {
            let item = items[value % items.len()].clone();
            items.extend(vec![item; 50]);
        }
        (4, _) => *node = json!([node.take()]),
        _ => *node = hostile(value),
    }
}

/// Reads changed seeds of the target of this name.
fn held_to_the_bound(name: &str, changes: &[Change], seed: usize) {
    let target = targets().iter().find(|target| target.name == name).expect("a target");
    let bytes = changed(&target.seeds[seed % target.seeds.len()], changes);
    let held = peak(|| (target.read)(&bytes));
    assert!(held <= HELD_BYTES_MAX, "{name}: {held} bytes held for a file of {}", bytes.len());
}

macro_rules! fuzzed {
    ($($test:ident: $target:literal,)*) => {$(
        proptest! {
            #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
            #[test]
            fn $test(changes in prop::collection::vec(change(), 1..6), seed in 0..8usize) {
                held_to_the_bound($target, &changes, seed);
            }
        }
    )*};
}

fuzzed! {
    a_changed_cassette_is_read_or_refused: "cassette",
    a_changed_patch_is_read_or_refused: "patch",
    a_changed_expression_is_read_or_refused: "expression",
    a_changed_law_is_read_or_refused: "law",
    a_changed_scene_is_read_or_refused: "scene",
    a_changed_pool_is_read_or_refused: "pool",
    a_changed_program_file_is_read_or_refused: "program file",
    a_changed_rollout_cassette_is_read_or_refused: "rollout cassette",
    a_changed_shard_is_read_or_refused: "shard",
    a_changed_transcript_is_read_or_refused: "transcript",
    a_changed_bundle_is_read_or_refused: "bundle",
    a_changed_pack_is_read_or_refused: "pack",
    a_changed_worker_request_is_answered_or_refused: "worker request",
    a_changed_experiment_is_read_or_refused: "experiment",
    changed_weights_are_read_or_refused: "weights",
}

/// Test of whether a seed is whole.
type IsRead = fn(&[u8]) -> bool;

#[test]
fn every_seed_is_read_as_it_is() {
    let whole: [(&str, IsRead); 7] = [
        ("cassette", |bytes| Cassette::parse(bytes, "seed").is_ok()),
        ("patch", |bytes| reply::patch(bytes, Role::Actor).is_ok()),
        ("expression", |bytes| Expr::parse(std::str::from_utf8(bytes).unwrap()).is_ok()),
        ("law", |bytes| serde_json::from_slice::<Law>(bytes).is_ok()),
        ("scene", |bytes| !import_files(&[("seed", bytes)]).scenes.is_empty()),
        ("pool", |bytes| pool::decode("seed", bytes).is_ok()),
        ("worker request", |bytes| serve(bytes).is_ok_and(|said| String::from_utf8_lossy(&said).contains("\"ego\""))),
    ];
    for (name, is_read) in whole {
        let target = targets().iter().find(|target| target.name == name).unwrap();
        for (place, seed) in target.seeds.iter().enumerate() {
            assert!(is_read(seed), "{name} {place}");
        }
    }
}

#[test]
fn the_allocator_counts_what_a_reader_holds() {
    let held = peak(|| drop(std::hint::black_box(vec![1u8; 3 << 20])));
    assert!((3 << 20..4 << 20).contains(&held), "{held}");
}
