//! Every key of an experiment file, in the order in which a file is written: the one list behind the check and the page.

use super::key::{Key, Need, Range};
use super::place::POLICIES;
use crate::archive::{PromotionRule, search::Method};
use crate::ego::Setting;
use crate::evaluation::{Counts, DIAGNOSTICS, Diagnostic};
use crate::families;
use crate::llm::client::{ANTHROPIC, COMMAND, DRAWN, EXCHANGE, OPENAI_COMPATIBLE, SCRIPTED};
use crate::objects::{
    AcceptanceRequirement, AttackRequirement, FrontOf, FrontPer, GatesAsked, JudgedOn, OverEgos, RealismMean,
    ReportedBy, Taking, Ties, UnreadableCritic, UnreadablePatch,
};
use crate::scene::safebench::TrafficFamily;
use crate::sim::ContactClass;
use crate::synth::WorldKind;
use Need::{Always, Of, Optional, With, Without};
use Range::{Above, Any, Ends, Name, Number, Pair, Subset, Text, Texts, Truth, Unshown, Whole, Wholes, Word, Words};

const LIVE: &[&str] = &[OPENAI_COMPATIBLE, ANTHROPIC];
/// The largest whole number that is an f64 and all those below it are too.
const WHOLE_MAX: f64 = 9_007_199_254_740_992.0;
/// A length or tolerance, in the unit of its key.
const TOLERANCE: Range = Above(0.0, 1000.0);
const BOUND: Range = Number(0.0, 1000.0);
const SHARE: Range = Number(0.0, 1.0);
const WEIGHT: Range = Number(0.0, 1000.0);

/// The list.
pub fn keys() -> Vec<Key> {
    [
        study(),
        scenes(),
        models(),
        simulator(),
        selection(),
        of_kind(),
        backend(),
        driver(),
        metadrive(),
        safebench(),
        acceptance(),
        world(),
        search(),
    ]
    .into_iter()
    .flatten()
    .collect()
}

type Row = (&'static str, &'static str, &'static str, Range, &'static str);

/// Keys with one need.
fn table(need: fn() -> Need, rows: Vec<Row>) -> Vec<Key> {
    let key = |(key, symbol, unit, range, meaning)| Key { key, symbol, unit, range, need: need(), meaning };
    rows.into_iter().map(key).collect()
}

fn words<const N: usize>(words: [&str; N]) -> Vec<String> {
    words.map(String::from).to_vec()
}

fn family_names() -> Vec<String> {
    families::registry().iter().map(|family| family.contract.family.to_string()).collect()
}

/// The drivers that a file can name.
fn ego_names() -> Vec<String> {
    words(["idm", "idm-lights", "pdm", "frenet", "replay", "learned", "command"])
}

/// Those of them that several may be: the weights that the program carries by their names, too.
fn several_names() -> Vec<String> {
    let carried = POLICIES.iter().map(|(name, _)| (*name).to_string());
    words(["idm", "idm-lights", "pdm", "frenet", "replay", "learned"]).into_iter().chain(carried).collect()
}

fn study() -> Vec<Key> {
    let mut keys = required(vec![
        ("name", "", "", Name, "Names the run folder."),
        ("describes", "", "", Text(500), "One sentence for reports; that of a base is not inherited."),
        (
            "seed",
            "",
            "",
            Whole(0, i64::MAX),
            "Root of the random streams of split, search and programs; scenes and models have seeds of their own.",
        ),
        (
            "seeds",
            "",
            "",
            Whole(1, 100),
            "How often each lineage is repeated, with draws of its own: the seeds that tables count.",
        ),
        ("cassette", "", "", Text(1000), "File of the recorded answers, relative to the file that names it."),
        ("split.held_out", "", "scenes", Whole(1, 100_000), "Scenes that stay closed until evolution is over."),
        ("split.window", "", "scenes", Whole(1, 100_000), "Scenes of the rotating development window of an epoch."),
        ("budget.epochs", "T", "epochs", Whole(1, 1000), "Epochs of each lineage."),
        ("budget.slots", "K", "proposals", Whole(1, 1000), "Parallel proposals of an epoch."),
        ("budget.max_repair_rounds", "K_r", "rounds", Whole(0, 8), "Times that a proposal may be repaired."),
        (
            "budget.probe_scenes",
            "",
            "scenes",
            Whole(1, 1000),
            "Most scenes on which a program is compiled before any rollout: three, and more while it does what its parent does.",
        ),
        (
            "budget.finalists",
            "",
            "programs",
            Whole(1, 1000),
            "Accepted descendants that are measured on all evolution scenes before one is chosen.",
        ),
        ("lineage[].id", "", "", Name, "Names the lineage."),
        ("lineage[].family", "b", "", Word(family_names), "The source family that is evolved."),
        ("lineage[].ego", "", "", Word(ego_names), "The driver under test; with `egos` the first of these."),
    ]);
    keys.extend(table(
        || Optional,
        vec![
            (
                "budget.rehearsals",
                "",
                "rollouts",
                Whole(1, i64::from(families::grammar::REHEARSALS_MAX)),
                "Most candidates of a scene that a program may roll out against the ego before it chooses (`rehearsed_choice`); not offered without it.",
            ),
            (
                "seed_note",
                "",
                "",
                Text(500),
                "How a seed of this file was chosen: summary, tables and comparisons repeat it. A file with this one as its base does not \
                 have it, nor has a run with another seed by `--set`.",
            ),
            (
                "fixed_bodies",
                "",
                "",
                Truth,
                "Whether no patch brings in a sort of road user (vehicle, cyclist, pedestrian) that its parent does not insert.",
            ),
            (
                "questions",
                "",
                "",
                Word(|| words(["plain", "detailed", "compact"])),
                "Form of the questions to the roles that evolve programs: `detailed` says how each scene came about, why an edit did nothing and why a child was not accepted; `compact` says the same in fewer tokens.",
            ),
            (
                "split.evolution.count",
                "",
                "scenes",
                Whole(1, 100_000),
                "Scenes that evolution may see; this or `share`.",
            ),
            (
                "split.evolution.share",
                "",
                "",
                Above(0.0, 1.0),
                "Share of the usable scenes that are not held out; this or `count`.",
            ),
            (
                "split.plain_contacts",
                "",
                "",
                Word(|| words(["keep", "drop"])),
                "`drop` leaves out scenes in which an ego under test meets somebody although no program acts; `keep` without it.",
            ),
            ("lineage[].parent.*", "", "", Any, "A parameter in which the lineage's parent differs from its family's."),
            (
                "lineage[].policy",
                "",
                "",
                Any,
                "For ego `learned`: weights by name (evodrive:sac-chatscene, which SafeBench's families take without it), or { file, digest }, relative to the file that names them.",
            ),
            (
                "lineage[].egos",
                "",
                "",
                Words(several_names),
                "Several drivers, in place of `ego`: every scene is played against each, and label, table and report say against whom. A learned one by its `policy` or its weights' name.",
            ),
            (
                "lineage[].over_egos",
                "",
                "",
                Word(|| words(OverEgos::NAMES)),
                "With `egos`: a scene's attack is the `mean` over them (without it) or the `worst`, that against whom the program does least.",
            ),
            (
                "lineage[].parent_program",
                "",
                "",
                Any,
                "A program file, as `evodrive program export` or `program new` writes it, relative to the file that names it: the lineage starts from its program.",
            ),
            (
                "lineage[].published",
                "",
                "",
                Truth,
                "For families advsim, adv_traj and chatscene: whether the lineage starts from the control sequences or optimised ranges that their authors publish, and searches nothing at first.",
            ),
        ],
    ));
    keys.extend(table(
        || With("counsel"),
        vec![
            ("counsel.rounds", "", "rounds", Whole(1, 8), "Sets of attackers that are tried in a scene, at most."),
            ("counsel.vehicles", "", "vehicles", Whole(1, 32), "Vehicles that the attacker agent is shown."),
        ],
    ));
    keys.extend(table(
        || With("composition"),
        vec![(
            "composition.rounds",
            "",
            "rounds",
            Whole(1, 8),
            "Questions for a template: one more after each answer that cannot be used, or whose template, tried in the simulator, spares the ego in some scene.",
        )],
    ));
    keys.extend(table(
        || Optional,
        vec![(
            "composition.descriptions.*",
            "",
            "",
            Text(2000),
            "What is to happen in this kind of scenario, in prose.",
        )],
    ));
    keys
}

fn scenes() -> Vec<Key> {
    let mut keys = table(
        || Always,
        vec![(
            "scenes.source",
            "",
            "",
            Word(|| words(["synth", "safebench", "files", "pool"])),
            "Where scenes come from: generated worlds, generated SafeBench families, scenario files, a pool.",
        )],
    );
    keys.extend(table(
        || Of("scenes.source", &["synth", "safebench"]),
        vec![("scenes.seed", "", "", Whole(0, i64::MAX), "Root of the random streams of the generated scenes.")],
    ));
    keys.extend(table(
        || Of("scenes.source", &["files"]),
        vec![(
            "scenes.paths",
            "",
            "",
            Texts { empty: false },
            "Scenario files, folders or pools, relative to the file that names them.",
        )],
    ));
    keys.extend(table(
        || Of("scenes.source", &["pool"]),
        vec![("scenes.path", "", "", Text(1000), "Pool file, relative to the file that names it.")],
    ));
    keys.extend(table(
        || Of("scenes.source", &["safebench"]),
        vec![
            (
                "scenes.options.families",
                "",
                "",
                Words(|| words(TrafficFamily::ALL.map(TrafficFamily::name))),
                "Traffic families, in the order of the pool, each once.",
            ),
            ("scenes.options.routes", "", "", Wholes(4, 13), "Route numbers, each once."),
            ("scenes.options.draws", "", "scenes", Whole(1, 100), "Scenes of each family and route."),
        ],
    ));
    keys.extend(table(|| Of("scenes.source", &["synth"]), worlds()));
    keys.extend(table(|| With("scenes.options.traffic"), traffic()));
    keys
}

/// Bounds between which each generated scene draws.
fn traffic() -> Vec<Row> {
    vec![
        (
            "scenes.options.traffic.users",
            "",
            "road users",
            Ends(4.0, 400.0),
            "Road users of a scene, in place of `tracks_per_scene`.",
        ),
        (
            "scenes.options.traffic.room",
            "",
            "",
            Ends(0.2, 4.0),
            "What the lane metres of a road user are multiplied by.",
        ),
        ("scenes.options.traffic.range_m", "", "m", Ends(30.0, 1000.0), "How far from the ego others are recorded."),
        (
            "scenes.options.traffic.lanes",
            "",
            "lanes",
            Ends(0.0, 3.0),
            "Further lanes of a direction; half as many where roads meet.",
        ),
        ("scenes.options.traffic.limit", "", "", Ends(0.3, 1.5), "What speed limits are multiplied by."),
        (
            "scenes.options.traffic.pedals_mps2",
            "",
            "m/s²",
            Ends(0.0, 3.0),
            "Standard deviation of what drivers' pedals add to the acceleration that they want.",
        ),
        ("scenes.options.traffic.weave_m", "", "m", Ends(0.0, 1.0), "How far drivers wander in their lane."),
        (
            "scenes.options.traffic.place_m",
            "",
            "m",
            Ends(0.0, 1.0),
            "Standard deviation of drivers' places in their lanes.",
        ),
        (
            "scenes.options.traffic.haste",
            "",
            "",
            Ends(0.0, 0.5),
            "Standard deviation of wanted speeds, as a share of the limit.",
        ),
        (
            "scenes.options.traffic.pace",
            "",
            "",
            Ends(0.3, 3.0),
            "What drivers' largest accelerations are multiplied by.",
        ),
        ("scenes.options.traffic.headway", "", "", Ends(0.3, 3.0), "What drivers' time gaps are multiplied by."),
    ]
}

fn worlds() -> Vec<Row> {
    vec![
        ("scenes.count", "", "scenes", Whole(1, 100_000), "Scenes that are generated."),
        (
            "scenes.options.kinds",
            "",
            "",
            Words(|| words(WorldKind::ALL.map(WorldKind::name))),
            "Kinds of world that a pool takes in turn.",
        ),
        ("scenes.options.steps", "", "steps of 0.1 s", Whole(2, 1200), "Samples of a scene."),
        (
            "scenes.options.current_step",
            "",
            "steps of 0.1 s",
            Whole(0, 1198),
            "Last sample of history; it lies before the last sample.",
        ),
        ("scenes.options.warm_up_s", "", "s", Number(0.0, 120.0), "Time simulated before the first sample."),
        ("scenes.options.tracks_per_scene", "", "road users", Whole(4, 2000), "Road users wanted in a scene."),
        ("scenes.options.pedestrian_share", "", "", Number(0.0, 0.5), "Share of them on foot where crosswalks are."),
        ("scenes.options.cyclist_share", "", "", Number(0.0, 0.5), "Share of them on bicycles off motorways."),
        (
            "scenes.options.following_share",
            "",
            "",
            SHARE,
            "Share of scenes in which the interacting vehicle may lead or follow in the ego's lane.",
        ),
        ("scenes.options.ego_travel_m_min", "", "m", Number(0.0, 1000.0), "Distance that the ego travels, at least."),
        (
            "scenes.options.interaction_time_s_max",
            "",
            "s",
            Above(0.0, 120.0),
            "Time between the ego and the interacting vehicle at the same place, at most.",
        ),
        ("scenes.options.interaction_gap_m_max", "", "m", Above(0.0, 1000.0), "Smallest gap between the two, at most."),
        ("scenes.options.attempts_max", "", "attempts", Whole(1, 1000), "Sub-seeds that are tried for a scene."),
    ]
}

fn models() -> Vec<Key> {
    let mut keys = table(
        || Always,
        vec![
            (
                "models.*.kind",
                "",
                "",
                Word(|| words([SCRIPTED, EXCHANGE, COMMAND, OPENAI_COMPATIBLE, ANTHROPIC, DRAWN])),
                "How the model is asked; `scripted` is the rule-based stand-in.",
            ),
            (
                "models.*.model",
                "",
                "",
                Text(200),
                "The provider's name of the model; of a `drawn` one any word. Critics of `scripted-2` ask for no guards.",
            ),
        ],
    );
    keys.extend(table(
        || Optional,
        vec![
            (
                "models.*.unwrap",
                "",
                "",
                Truth,
                "Take a byte order mark, code fence, think block or end token off around a reply's one JSON object.",
            ),
            (
                "models.*.shares.*",
                "",
                "",
                Above(0.0, 1e6),
                "Of a `drawn` model: how often this other one answers, against the other shares; drawn by the seed for each slot of a role.",
            ),
        ],
    ));
    keys.extend(table(
        || Of("models.*.kind", &[SCRIPTED]),
        vec![
            ("models.*.sampling.malformed_json_rate", "", "", SHARE, "Share of answers that are no JSON."),
            ("models.*.sampling.out_of_range_rate", "", "", SHARE, "Share of patches with a value out of its range."),
            ("models.*.sampling.foreign_mechanism_rate", "", "", SHARE, "Share with another family's mechanism."),
            ("models.*.sampling.stale_hash_rate", "", "", SHARE, "Share that name another parent."),
            ("models.*.sampling.oversight_rate", "", "", SHARE, "Share of a critic's findings that it overlooks."),
        ],
    ));
    keys.extend(table(
        || Of("models.*.kind", &[EXCHANGE, COMMAND]),
        vec![("models.*.provenance", "", "", Text(400), "Who answers, and how: kept with each recorded answer.")],
    ));
    keys.extend(table(
        || Of("models.*.kind", &[COMMAND]),
        vec![
            (
                "models.*.command.program",
                "",
                "",
                Texts { empty: false },
                "Program and arguments, started for each request: JSON on its standard input, the reply on its output.",
            ),
            ("models.*.command.timeout_s", "", "s", Whole(1, 86_400), "Limit of one answer."),
        ],
    ));
    keys.extend(table(
        || Optional,
        vec![
            (
                "models.*.command.files",
                "",
                "",
                Texts { empty: true },
                "Its files, relative to the file: with them workers of a cluster ask the program.",
            ),
            (
                "models.*.command.tries",
                "",
                "",
                Truth,
                "Whether the program may try drafts of a patch; false without it.",
            ),
        ],
    ));
    keys.extend(table(
        || Of("models.*.kind", LIVE),
        vec![(
            "models.*.response_format",
            "",
            "",
            Word(|| {
                words([
                    "json_schema",
                    "json_schema_strict",
                    "json_schema_closed",
                    "json_object_schema",
                    "json_object",
                    "tool",
                    "none",
                ])
            }),
            "How the model is held to the schema of a reply; `anthropic` takes tool or none, the other kind the rest.",
        )],
    ));
    keys.extend(table(
        || Optional,
        vec![
            ("models.*.sampling.seed", "", "", Number(0.0, WHOLE_MAX), "Root of one seed a draw slot; whole."),
            ("models.*.sampling.temperature", "", "", Number(0.0, 2.0), "Sampling temperature."),
            ("models.*.sampling.top_p", "", "", SHARE, "Nucleus sampling."),
            ("models.*.sampling.top_k", "", "tokens", Number(0.0, WHOLE_MAX), "Most likely tokens kept; whole."),
            ("models.*.sampling.min_p", "", "", SHARE, "Least probability against the most likely token."),
            ("models.*.sampling.max_tokens", "", "tokens", Number(1.0, 1e6), "Length of an answer, at most; whole."),
            (
                "models.*.sampling.max_completion_tokens",
                "",
                "tokens",
                Number(1.0, 1e6),
                "The same, for servers that call it so.",
            ),
            ("models.*.sampling.frequency_penalty", "", "", Number(-2.0, 2.0), "Penalty of frequent tokens."),
            ("models.*.sampling.presence_penalty", "", "", Number(-2.0, 2.0), "Penalty of tokens that were used."),
            ("models.*.body.*", "", "", Any, "A further field of a live model's request, sent as it is."),
            (
                "models.*.client.api_key_env",
                "",
                "",
                Unshown,
                "NAME of the environment variable that holds the key, never the key itself.",
            ),
            (
                "models.*.client.api_key_header",
                "",
                "",
                Text(100),
                "Header that carries the bare key, as Azure's `api-key`, in place of the protocol's own.",
            ),
            (
                "models.*.client.query.*",
                "",
                "",
                Text(200),
                "A part of the address behind `?`, as Azure's `api-version`.",
            ),
            ("models.*.client.headers.*", "", "", Text(400), "A header of a gateway's; never a key."),
            (
                "models.*.client.cached_input_usd_per_million",
                "",
                "USD per million tokens",
                Number(0.0, 1e6),
                "Price of a prompt's tokens that the provider read from its cache; as any other without it.",
            ),
            (
                "models.*.client.cache_write_usd_per_million",
                "",
                "USD per million tokens",
                Number(0.0, 1e6),
                "Price of those that it wrote into its cache; as any other without it.",
            ),
        ],
    ));
    keys.extend(table(|| With("models.*.client"), client()));
    keys.extend(table(
        || With("spend"),
        vec![
            ("spend.usd_max", "", "USD", Number(0.0, 1e9), "What all live models may cost together."),
            ("spend.tokens_max", "", "tokens", Whole(0, i64::MAX), "Tokens of all their prompts and answers."),
        ],
    ));
    keys.extend(roles());
    keys
}

fn roles() -> Vec<Key> {
    let mut keys = required(vec![
        ("roles.actor", "", "", Text(200), "Name of the model that proposes patches."),
        ("roles.structural_critic", "", "", Text(200), "Name of the model that reviews structure."),
        ("roles.attack_critic", "", "", Text(200), "Name of the model that reviews attack."),
        ("roles.realism_critic", "", "", Text(200), "Name of the model that reviews realism."),
        ("roles.isolation_critic", "", "", Text(200), "Name of the model that reviews isolation."),
        ("roles.repair", "", "", Text(200), "Name of the model that repairs patches."),
    ]);
    keys.extend(table(
        || Optional,
        vec![
            ("roles.attacker_agent", "", "", Text(200), "Names attackers, where a family takes counsel."),
            ("roles.template_agent", "", "", Text(200), "Composes templates, where [composition] asks for some."),
            ("roles.world_agent", "", "", Text(200), "Changes the world evaluator, where [world_agent] says how."),
        ],
    ));
    keys
}

fn client() -> Vec<Row> {
    vec![
        ("models.*.client.base_url", "", "", Unshown, "Address of the server, without user, password or query."),
        ("models.*.client.timeout_s", "", "s", Whole(1, 3600), "Limit of one attempt, connecting included."),
        ("models.*.client.attempts_max", "", "attempts", Whole(1, 20), "Attempts for one request."),
        ("models.*.client.wait_s_max", "", "s", Whole(0, 3600), "Longest wait between two attempts."),
        (
            "models.*.client.incomplete_replies",
            "",
            "",
            Word(|| words(["keep", "stop"])),
            "Refused, empty or cut answers: kept and read like every reply, or the end of the recording.",
        ),
        ("models.*.client.input_usd_per_million", "", "USD per million tokens", Number(0.0, 1e6), "Price of a prompt."),
        (
            "models.*.client.output_usd_per_million",
            "",
            "USD per million tokens",
            Number(0.0, 1e6),
            "Price of an answer.",
        ),
    ]
}

fn simulator() -> Vec<Key> {
    let avoidance = |key, unit, low, high, meaning| (key, "", unit, Number(low, high), meaning);
    table(
        || Always,
        vec![
            (
                "simulator.plant",
                "",
                "",
                Any,
                "The law of motion: `physical`, `metadrive-0.4.3`, or a table with every option of docs/PLANT.md.",
            ),
            avoidance("simulator.avoidance.horizon_s", "s", 0.1, 10.0, "How far motions are predicted."),
            avoidance("simulator.avoidance.reaction_s", "s", 0.0, 10.0, "From seeing a threat to the first reaction."),
            avoidance("simulator.avoidance.field_of_view_deg", "deg", 1.0, 360.0, "Width of the ego's view."),
            avoidance("simulator.avoidance.brake_mps2", "m/s²", 0.1, 20.0, "Full deceleration."),
            avoidance("simulator.avoidance.brake_rise_s", "s", 0.0, 5.0, "Time in which it builds up."),
            avoidance("simulator.avoidance.swerve_mps2", "m/s²", 0.1, 20.0, "Lateral acceleration of a swerve."),
            avoidance("simulator.avoidance.swerve_m", "m", 0.0, 20.0, "How far a swerve goes aside."),
        ],
    )
}

/// A third part of the scenes.
fn selection() -> Vec<Key> {
    let meaning = "Scenes on which finalists are chosen and which no step of the search sees; without it they are chosen on those of \
                   evolution, where a search that is long enough finds what fits them by chance.";
    table(|| Optional, vec![("split.selection", "", "scenes", Whole(0, 100_000), meaning)])
}

/// Returns the keys of what outcomes say besides.
fn of_kind() -> Vec<Key> {
    let meaning = "Whether outcomes say what of a motion its kind does not do: slides, turns on the spot, speed (docs/OBJECTIVES.md).";
    let place =
        "Whether outcomes say where a motion's kind does not belong: a motorway, behind a kerb; goes with that weight.";
    let scripts = "SafeBench's scripts: `as_run`, in which nobody stops and AT's family 1 rides a bicycle, or `as_defined`, with the stop \
                   conditions that SafeBench calls nowhere and a pedestrian; that without it.";
    table(
        || Optional,
        vec![
            ("simulator.of_kind", "", "", Truth, meaning),
            ("simulator.of_place", "", "", Truth, place),
            (
                "simulator.at_fault",
                "",
                "",
                Truth,
                "Whether outcomes say who is at fault for the ego's contact by nuPlan's rule.",
            ),
            (
                "simulator.jury",
                "",
                "",
                Truth,
                "Whether labels say which reference drivers of UN R157 would have avoided the ego's contact.",
            ),
            (
                "simulator.avoidance.forecast",
                "",
                "",
                Word(|| words(["motion", "lanes"])),
                "Whom the ego expects to meet: who would at constant velocity or turn rate, as without it, or also who may along some way of the lanes.",
            ),
            (
                "simulator.avoidance.lesser_swerves",
                "",
                "",
                Truth,
                "Whether swerves by 0.5, 1 and 2 m may avoid a contact, too.",
            ),
            ("simulator.scripts", "", "", Word(|| words(["as_defined", "as_run"])), scripts),
        ],
    )
}

/// Another simulator than ours, for labels.
fn backend() -> Vec<Key> {
    let meaning =
        "Who simulates rollouts for labels: `evodrive`, or a table of docs/BACKENDS.md that names another simulator.";
    table(|| Optional, vec![("simulator.backend", "", "", Any, meaning)])
}

/// A planner of the experimenter's own.
fn driver() -> Vec<Key> {
    let mut keys = table(
        || With("driver"),
        vec![
            (
                "driver.command",
                "",
                "",
                Texts { empty: false },
                "Program behind the ego `command`, and its arguments; started in the folder of the file (docs/EGOS.md).",
            ),
            (
                "driver.files",
                "",
                "",
                Texts { empty: false },
                "Files whose bytes identify it, relative to the file: its code, its weights.",
            ),
            ("driver.cassette", "", "", Text(1000), "File of its recorded rollouts, relative to the file."),
        ],
    );
    keys.extend(table(
        || Optional,
        vec![
            ("driver.timeout_s", "", "s", Above(0.0, 3600.0), "Longest time for one decision; 10 without it."),
            ("driver.processes", "", "", Whole(1, 64), "Processes at once, at most; 8 without it."),
            (
                "driver.repeat_share",
                "",
                "",
                SHARE,
                "Share of the rollouts that another process plays again when they are recorded, to compare; 0.05 without it.",
            ),
            (
                "driver.observe",
                "",
                "",
                Word(|| words(Setting::ALL.map(Setting::name))),
                "Observation that each step holds, too (docs/EGOS.md).",
            ),
            (
                "driver.blind",
                "",
                "",
                Truth,
                "Whether the planner hears of no program; true without it.",
            ),
            ("driver.digest", "", "", Text(64), "Identity of the program; needed where its files are not at hand."),
            (
                "driver.folder",
                "",
                "",
                Any,
                "Written into run folders, empty: the digest beside it was found when the run began.",
            ),
        ],
    ));
    keys
}

/// Weights of the diagnostics: of those that always count by name, or of the others.
fn weights(always: bool) -> Vec<Row> {
    let those = |of: &&Diagnostic| (of.counts == Counts::Always) == always;
    let mut rows: Vec<Row> =
        DIAGNOSTICS.into_iter().filter(those).map(|of| (of.key, "w_j", "", SHARE, of.weight)).collect();
    rows.sort_by_key(|row| always.then_some(row.0));
    rows
}

fn metadrive() -> Vec<Key> {
    let own = table(
        || Optional,
        vec![
            (
                "evaluation.attack.when",
                "",
                "",
                Text(2000),
                "An expression over the outcome that decides in place of the two lists; see docs/OBJECTIVES.md.",
            ),
            (
                "evaluation.attack.requires",
                "",
                "",
                Subset(|| words(AttackRequirement::NAMES)),
                "What a contact needs besides its class: that it is with an adversary, which acts, and not met in plain replay anyway; all without it.",
            ),
            (
                "evaluation.realism.mean",
                "",
                "",
                Word(|| words(RealismMean::NAMES)),
                "R(c): strict, as without it, or the paper's plain mean over all scenes.",
            ),
            (
                "evaluation.realism.excuses_recordings",
                "",
                "",
                Truth,
                "Whether an adversary is excused as far as its own recording is poor; true without it.",
            ),
            (
                "evaluation.attack.reading",
                "",
                "",
                Word(|| words(["at_fault"])),
                "In its place: contacts for which the ego is at fault by nuPlan's rule; needs `simulator.at_fault`.",
            ),
        ],
    );
    let measured = table(
        || With("evaluation.metrics"),
        vec![(
            "evaluation.metrics.*",
            "",
            "",
            Text(2000),
            "A metric of one's own, by its name: an expression over the outcome, measured in every scene beside the objectives.",
        )],
    );
    let contacts = vec![
        (
            "evaluation.attack.counts",
            "",
            "",
            Subset(|| words(ContactClass::ALL.map(ContactClass::name))),
            "Classes of contact with an adversary that count as a failure of the ego; see docs/OBJECTIVES.md.",
        ),
        (
            "evaluation.attack.counts_if_avoidable",
            "",
            "",
            Subset(|| words(ContactClass::ALL.map(ContactClass::name))),
            "Classes that count where the ego could have avoided the contact.",
        ),
    ];
    let calibration = (
        "evaluation.realism.calibration",
        "ρ_j",
        "",
        Any,
        "Bounds and tolerances from recorded traffic: `evodrive:recorded`, `evodrive:kinds` (with bounds of what a kind does not do), a file that `evodrive calibrate` wrote, or its table.",
    );
    let rows = contacts.into_iter().chain(weights(true)).chain([calibration]).collect();
    let mut keys = table(|| Without("evaluation.safebench"), rows);
    keys.extend(table(|| Optional, weights(false)));
    keys.extend(own);
    keys.extend(measured);
    keys
}

macro_rules! ars {
    ($place:literal) => {
        concat!("evaluation.safebench.ars.", $place)
    };
}

fn safebench() -> Vec<Key> {
    let (bound, beyond) = ("What is still plausible.", "What lies beyond the bound.");
    let mut keys = table(
        || With("evaluation.safebench"),
        vec![
            (
                "evaluation.safebench.selected_per_group",
                "",
                "scenes",
                Whole(1, 100),
                "Scenes that balanced selection keeps of each family and route.",
            ),
            (ars!("kinematics.acceleration.bound"), "", "m/s²", BOUND, bound),
            (ars!("kinematics.acceleration.tolerance"), "", "m/s²", TOLERANCE, beyond),
            (ars!("kinematics.lateral_acceleration.bound"), "", "m/s²", BOUND, bound),
            (ars!("kinematics.lateral_acceleration.tolerance"), "", "m/s²", TOLERANCE, beyond),
            (ars!("kinematics.jerk.bound"), "", "m/s³", BOUND, bound),
            (ars!("kinematics.jerk.tolerance"), "", "m/s³", TOLERANCE, beyond),
            (ars!("map.off_road_tolerance_m"), "", "m", TOLERANCE, "Beyond the drivable area: the diagnostic is 0."),
            (ars!("map.wrong_way_tolerance_m"), "", "m", TOLERANCE, "Against a lane: the diagnostic is 0."),
            (ars!("interaction.impact_speed.bound"), "", "m/s", BOUND, bound),
            (ars!("interaction.impact_speed.tolerance"), "", "m/s", TOLERANCE, beyond),
            (ars!("interaction.approach.bound"), "", "m", BOUND, bound),
            (ars!("interaction.approach.tolerance"), "", "m", TOLERANCE, beyond),
            (ars!("distance.start_gap_m"), "", "m", TOLERANCE, "Gap to the ego at the start that is enough."),
            (ars!("distance.apart_gap_m"), "", "m", TOLERANCE, "Gap between adversaries that is enough."),
            (ars!("distance.jump_tolerance_m"), "", "m", TOLERANCE, "Jump at which the diagnostic is 0."),
            (ars!("validity.jump_m_max"), "", "m", BOUND, "Largest jump of an adversary in a valid scene."),
            (ars!("validity.off_road_m_max"), "", "m", BOUND, "Farthest off the drivable area in a valid scene."),
        ],
    );
    keys.extend(table(
        || Optional,
        vec![(
            ars!("judges_idle"),
            "",
            "",
            Truth,
            "Whether ARS is over all runs; over those that the program acts in without it.",
        )],
    ));
    keys.extend(table(
        || With("evaluation.safebench.preventable"),
        vec![
            (
                "evaluation.safebench.preventable.wrong_way_m_max",
                "",
                "m",
                BOUND,
                "Farthest against a lane in a valid scene. With this table only contacts count that a careful ego would have prevented.",
            ),
            (
                "evaluation.safebench.preventable.unrolled_m_max",
                "",
                "m",
                BOUND,
                "Farthest that anyone but a pedestrian may slide in a valid scene; needs `simulator.of_kind`.",
            ),
        ],
    ));
    keys.extend(table(
        || With("evaluation.safebench.preventable.standing"),
        vec![
            (
                "evaluation.safebench.preventable.standing.visible_s_min",
                "",
                "s",
                BOUND,
                "For how long the ego must have seen a body that stands, so that running into it counts: a careful driver's time to stop.",
            ),
            (
                "evaluation.safebench.preventable.standing.speed_mps_min",
                "",
                "m/s",
                BOUND,
                "How fast whom the ego meets must once have been to count. With this table a body that stands has to have come to stand.",
            ),
        ],
    ));
    keys
}

fn acceptance() -> Vec<Key> {
    let mut keys = table(
        || Optional,
        vec![
            (
                "archive.race",
                "",
                "",
                Number(0.5, 0.999),
                "Confidence of the gain over its parent that a child must show before it leads, on as many evolution scenes as that takes.",
            ),
            (
                "archive.requires",
                "",
                "",
                Subset(|| words(AcceptanceRequirement::NAMES)),
                "What a child needs besides a gate: `acts` in some scene, `differs` from its parent's labels; both without it.",
            ),
            (
                "archive.front",
                "",
                "",
                Word(|| words(FrontOf::NAMES)),
                "Whose points are the front: of accepted programs, as without it, or of all evaluated ones.",
            ),
            (
                "archive.front_per",
                "",
                "",
                Word(|| words(FrontPer::NAMES)),
                "Who has a front of its own: a lineage, as without it, or each group of traffic family and route of SafeBench's protocol.",
            ),
            (
                "archive.judged_on",
                "",
                "",
                Word(|| words(JudgedOn::NAMES)),
                "Scenes on which a child is compared: the window, and where a gate holds there all windows so far, which decide; or the window alone. The first without it.",
            ),
            (
                "archive.ties",
                "",
                "",
                Word(|| words(Ties::NAMES)),
                "Which of equals stand on the front; `first` without it.",
            ),
            (
                "archive.portfolio",
                "",
                "",
                Truth,
                "Whether every third slot edits another member of the front than the leader; true without it.",
            ),
            (
                "archive.challengers",
                "",
                "programs",
                Whole(0, 64),
                "Most children that later epochs measure on, whose gain was measured and not shown; 0 without it.",
            ),
            (
                "archive.parent_counts",
                "",
                "",
                Truth,
                "Whether a child must surpass its parent in ΔHV and local push also where that is not on the front; true without it.",
            ),
            (
                "selector.rule",
                "",
                "",
                Word(|| words(ReportedBy::NAMES)),
                "Who is reported of those with `realism_min`: the most realistic within `tolerance` of the best attack, as without it, or the best attack.",
            ),
            ("selector.must_act", "", "", Truth, "Whether whoever acts nowhere is never reported; true without it."),
            (
                "selector.fills_up",
                "",
                "",
                Truth,
                "Whether less realistic programs count for PF-Area@3 where fewer than three reach `realism_min`; true without it.",
            ),
            (
                "memory.taking",
                "",
                "",
                Word(|| words(Taking::NAMES)),
                "Which scored cards are shown: successes of the front first, half of a kind and one of an attempt at most, as without it; or the M best.",
            ),
            (
                "proposals.effect_gate",
                "",
                "",
                Truth,
                "Whether a child that does what its parent does on all probe scenes is refused; true without it.",
            ),
            (
                "proposals.gates",
                "",
                "",
                Word(|| words(GatesAsked::NAMES)),
                "When gates judge a patch: before its critics, who hear of it, with repair of what they refuse, as without it; or once, after them.",
            ),
            (
                "proposals.unreadable_critic",
                "",
                "",
                Word(|| words(UnreadableCritic::NAMES)),
                "A critic whose review cannot be read: is asked again and `abstains`, as without it, or `blocks` the proposal.",
            ),
            (
                "proposals.unreadable_patch",
                "",
                "",
                Word(|| words(UnreadablePatch::NAMES)),
                "A patch that cannot be read: is `repaired` while rounds are left, as without it, or `ends` the proposal.",
            ),
            (
                "selector.also_at",
                "",
                "",
                Pair(0.0, 1.0),
                "Two further values of `realism_min` at which tables give the attack that the finalists reach.",
            ),
        ],
    );
    keys.splice(0..0, acceptance_always());
    keys
}

fn acceptance_always() -> Vec<Key> {
    required(vec![
        ("archive.reference", "", "", Pair(0.0, 1.0), "Reference point of the hypervolume: attack, realism."),
        ("archive.r0", "r_0", "", SHARE, "Where the high-realism region begins."),
        ("archive.a0", "a_0", "", SHARE, "Where the high-attack region begins."),
        ("archive.epsilon_r", "ε_R", "", SHARE, "Realism that a child may lose for more attack."),
        ("archive.epsilon_a", "ε_A", "", SHARE, "Attack that a child may lose for more realism."),
        ("archive.epsilon_pf", "ε", "", Above(0.0, 1.0), "Least parent hypervolume that PF-Area divides by."),
        ("archive.level", "", "", Number(0.5, 0.999), "Confidence at which a paired difference counts as a gain."),
        (
            "archive.coverage_floor",
            "",
            "",
            SHARE,
            "Share of the parent's coverage that a child must keep: coverage is the share of scenes acted in.",
        ),
        (
            "archive.promotion",
            "",
            "",
            Word(|| words(PromotionRule::NAMES)),
            "Which accepted children lead the lineage: the largest gain, the last one, or an attack and a realism anchor in turn.",
        ),
        ("selector.realism_min", "", "", SHARE, "Least realism of the active generator."),
        ("selector.tolerance", "ε", "", SHARE, "Share of the best attack that may be given up for realism."),
        ("memory.alpha_lineage", "α_1", "", WEIGHT, "Weight of a card of the same lineage."),
        ("memory.alpha_family", "α_2", "", WEIGHT, "Weight of a card of the same family."),
        ("memory.alpha_mechanism", "α_3", "", WEIGHT, "Weight of mechanism tags in common."),
        ("memory.alpha_scene", "α_4", "", WEIGHT, "Weight of scene tags in common."),
        ("memory.alpha_recency", "α_5", "", WEIGHT, "Weight of recency."),
        (
            "memory.alpha_future",
            "α_6",
            "",
            WEIGHT,
            "Penalty of a card from the future. It cannot act, because no card of a later epoch is there when cards are drawn: any value gives the same run. It goes with the next change of meaning.",
        ),
        ("memory.top_m", "M", "cards", Whole(0, 1000), "Cards that an actor is shown."),
        ("curation.attack_low", "", "", SHARE, "Attack below which a candidate counts as weak."),
        ("curation.realism_low", "", "", SHARE, "Realism below which a candidate counts as implausible."),
        ("curation.digits", "", "decimals", Whole(0, 9), "Decimals of every number on a card."),
        ("curation.text_chars", "", "characters", Whole(1, 10_000), "Longest text of a card."),
    ])
}

fn world() -> Vec<Key> {
    let mut keys = required(vec![
        ("world.excluded_columns", "", "", Texts { empty: true }, "Feature columns left out of the regression."),
        (
            "world.model",
            "",
            "",
            Word(|| words(["ridge", "boosted", "simulator"])),
            "What predicts the difference from the parent; `simulator` with [simulator.backend].",
        ),
        (
            "world.ridge_lambda",
            "λ",
            "",
            Above(0.0, 1e9),
            "Ridge penalty on standardised columns; of `simulator`, labels that a slope of 1 counts for.",
        ),
        ("world.trees", "", "trees", Whole(0, 1000), "Trees of the boosted model."),
        ("world.learning_rate", "", "", Above(0.0, 1.0), "Share of its prediction that each tree adds."),
        ("world.beta_attack", "β_A", "", SHARE, "Weight of the raw prediction of attack against its group's mean."),
        ("world.beta_realism", "β_R", "", SHARE, "The same of realism."),
        (
            "world.calibration_group",
            "",
            "",
            Word(|| words(["family", "mechanism_class"])),
            "Whose mean difference calibrates a prediction.",
        ),
        ("world.group_labels_min", "", "labels", Whole(0, 1_000_000), "Labels below which a group's mean is not used."),
        ("world.interval_level", "", "", Number(0.5, 0.99), "Share of candidates whose labels an interval is to hold."),
        ("world.realism_weight", "", "", Number(0.0, 1000.0), "Weight of realism against attack in the rank."),
        ("world.explore", "", "", Number(0.0, 1000.0), "Weight of the uncertainty in the rank."),
        (
            "world.routing.rollout_budget",
            "",
            "candidates",
            Whole(1, 1_000_000),
            "Candidates simulated an epoch, with audits.",
        ),
        (
            "world.routing.choice",
            "",
            "",
            Word(|| words(["ranked", "random"])),
            "Who gets the budget: the first by rank with some audits, or a random draw.",
        ),
        ("world.routing.lambda_a", "λ_A", "", SHARE, "Predicted loss of attack against the parent that is allowed."),
        ("world.routing.lambda_r", "λ_R", "", SHARE, "Predicted loss of realism that is allowed."),
        ("world.routing.lambda_u", "λ_U", "", Above(0.0, 1e9), "Largest uncertainty at which a loss counts."),
        ("world.routing.audit_share", "", "", SHARE, "Share of the budget drawn at random among those left out."),
        (
            "world.routing.min_labels",
            "",
            "labels",
            Whole(0, 1_000_000),
            "Labelled candidates below which nobody is ranked.",
        ),
    ]);
    keys.extend(table(
        || With("world.routing.pilot"),
        vec![
            (
                "world.routing.pilot.scenes",
                "",
                "scenes",
                Whole(1, 1000),
                "Scenes of the window in which every admitted candidate is simulated before anybody is ranked, at most.",
            ),
            (
                "world.routing.pilot.prior_scenes",
                "",
                "scenes",
                Above(0.0, 1e6),
                "How many scenes the prediction counts for beside those that were seen.",
            ),
        ],
    ));
    keys.extend(table(
        || With("world.pairs"),
        vec![
            (
                "world.pairs.aggregate",
                "Agg",
                "",
                Number(0.5, 1.0),
                "Quantile of the uncertainties of a candidate's scenes that is the candidate's; 1 is the largest. This table makes the evaluator the paper's: a row a pair of candidate and scene, routing by value and uncertainty.",
            ),
            (
                "world.pairs.abstain_above",
                "",
                "",
                Above(0.0, 1.0),
                "Uncertainty of a candidate above which the evaluator abstains: it expects what the parent does, and audits.",
            ),
        ],
    ));
    keys.extend(table(
        || With("world_agent"),
        vec![
            (
                "world_agent.rounds",
                "",
                "rounds",
                Whole(1, 8),
                "Questions of a turn: one more after each answer that is no patch of the update surface.",
            ),
            (
                "world_agent.fit_labels_min",
                "",
                "labels",
                Whole(1, 1_000_000),
                "Labelled candidates of earlier epochs from which on an epoch is held for the judge.",
            ),
            (
                "world_agent.held_labels_min",
                "",
                "labels",
                Whole(1, 1_000_000),
                "Held candidates below which nobody is asked and nothing is promoted.",
            ),
            (
                "world_agent.coverage_slack_pct",
                "",
                "%",
                Number(0.0, 50.0),
                "How much farther from `world.interval_level` coverage may come to lie; also how much nearer it must come to be a gain.",
            ),
            ("world_agent.gain_errors", "", "standard errors", Number(0.0, 10.0), "How many of its own a gain must exceed."),
            (
                "world_agent.audit_share",
                "",
                "",
                Ends(0.0, 1.0),
                "Ends between which the share of audits may be changed.",
            ),
        ],
    ));
    keys
}

/// Other ways to search, and parts that a run does without (docs/ABLATIONS.md).
fn search() -> Vec<Key> {
    const ONE_SCORE: &[&str] = &["openevolve", "hill_climbing"];
    let mut keys = table(
        || With("search"),
        vec![(
            "search.method",
            "",
            "",
            Word(|| Method::ALL.map(|method| method.name().to_string()).to_vec()),
            "Who decides what is kept and edited; `pareto` is the archive's own, as without this table. `random_proposals` and `shuffled_labels` are null searches: the archive's own with random patches, or with another candidate's labels; `numbers` is the control of `search.tuning`.",
        )],
    );
    keys.extend(table(
        || With("search.tuning"),
        vec![
            ("search.tuning.draws", "", "settings", Whole(2, 256), "Settings of a patch's free constants that are tried."),
            (
                "search.tuning.scenes",
                "",
                "scenes",
                Whole(1, 10_000),
                "Scenes outside the window in which all settings are labelled; the better half goes on to twice as many.",
            ),
        ],
    ));
    keys.extend(table(
        || Of("search.method", ONE_SCORE),
        vec![("search.attack_weight", "w", "", SHARE, "The one score is w A + (1 - w) R.")],
    ));
    keys.extend(table(
        || Of("search.method", &["nsga2"]),
        vec![("search.population", "", "programs", Whole(2, 1000), "Most members of the population.")],
    ));
    keys.extend(table(
        || Of("search.method", &["random", "random_proposals", "numbers"]),
        vec![("search.edits_max", "", "edits", Whole(1, 8), "Most edits of a random patch.")],
    ));
    keys.extend(table(|| Of("search.method", &["openevolve"]), openevolve()));
    keys.extend(table(
        || Optional,
        vec![
            (
                "search.rollouts",
                "",
                "rollouts",
                Whole(1, 1_000_000_000),
                "Distinct rollouts on evolution scenes that a lineage may use; a lineage that cannot pay for a candidate stops.",
            ),
            ("without.critics", "", "", Truth, "No critic is asked."),
            ("without.repair", "", "", Truth, "No patch is repaired."),
            ("without.memory", "", "", Truth, "No memory card is written or shown."),
            ("without.conditions", "", "", Truth, "The scene-conditioned policy is closed to patches."),
            ("without.mechanisms", "", "", Truth, "Mechanism modules are closed to patches."),
            ("without.isolation", "", "", Truth, "Neither the isolation gate nor its critic."),
            ("without.audit", "", "", Truth, "No rollouts are drawn among candidates that the router leaves out."),
            ("without.tradeoff", "", "", Truth, "The parent trade-off gate accepts nobody."),
            (
                "without.sight",
                "",
                "",
                Truth,
                "No question says what the driver under test sees and how it drives; its name stays.",
            ),
        ],
    ));
    keys
}

/// OpenEvolve's options under its own names.
fn openevolve() -> Vec<Row> {
    let axes = Words(|| words(["complexity", "diversity", "attack", "realism"]));
    vec![
        ("search.openevolve.num_islands", "", "islands", Whole(1, 100), "Populations that evolve apart."),
        ("search.openevolve.archive_size", "", "programs", Whole(1, 100_000), "Places of the archive of the best."),
        ("search.openevolve.population_size", "", "programs", Whole(2, 100_000), "Most programs over all islands."),
        ("search.openevolve.feature_dimensions", "", "", axes, "Axes of the grid."),
        ("search.openevolve.feature_bins", "", "cells", Whole(1, 1000), "Cells of an axis."),
        (
            "search.openevolve.migration_interval",
            "",
            "programs",
            Whole(1, 100_000),
            "Programs of an island between migrations.",
        ),
        ("search.openevolve.migration_rate", "", "", SHARE, "Share of an island that migrates."),
        (
            "search.openevolve.diversity_reference_size",
            "",
            "texts",
            Whole(1, 1000),
            "Texts that diversity is measured against.",
        ),
        ("search.openevolve.exploration_ratio", "", "", SHARE, "Share of parents drawn from their whole island."),
        ("search.openevolve.exploitation_ratio", "", "", SHARE, "Share of parents drawn from the archive."),
        (
            "search.openevolve.elite_selection_ratio",
            "",
            "",
            SHARE,
            "Share of the inspirations that are their island's best.",
        ),
    ]
}

fn required(rows: Vec<Row>) -> Vec<Key> {
    table(|| Always, rows)
}
