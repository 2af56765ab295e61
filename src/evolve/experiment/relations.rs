//! Relations between options: who is asked where a family needs it, weights that sum to one, models that are named.

use std::collections::BTreeSet;

use super::{ContractMark, Experiment, LineageOptions, ModelOptions, OptionError, ParentProgram, SceneSource};
use crate::adapters::Contract;
use crate::archive::search::Method;
use crate::evaluation::{Counts, EvaluationOptions, metrics::place_of_kind};
use crate::families;
use crate::llm::client;
use crate::objects::{FamilyName, FrontOf, FrontPer, OverEgos, Program, Role, WorldModel, world_audit::WORLD_LINE};
use crate::scene::EvolutionSize;
use crate::stage::{Asks, Sources};
use crate::world;

/// An experiment that fits the list of keys and still cannot be carried out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Problem {
    Option(OptionError),
    /// Several options that do not fit together, in words.
    Several(String),
}

impl From<OptionError> for Problem {
    fn from(error: OptionError) -> Problem {
        Problem::Option(error)
    }
}

/// Checks what the list of keys cannot say.
pub fn check(experiment: &Experiment) -> Result<(), Problem> {
    lineages(experiment)?;
    let asides = [
        (Role::AttackerAgent, counselled(experiment)?),
        (Role::TemplateAgent, composes(experiment)?),
        (Role::WorldAgent, evolves(experiment)?),
    ];
    let always = Role::CRITICS.into_iter().chain([Role::Actor, Role::Repair]);
    for role in always.chain(asides.into_iter().filter_map(|(role, asked)| asked.then_some(role))) {
        named_model(experiment, role)?;
    }
    models(experiment)?;
    scenes(experiment)?;
    simulator(experiment)?;
    labels(experiment)?;
    searched(experiment)?;
    let several = |error: &dyn std::fmt::Display| Problem::Several(error.to_string());
    experiment.archive.validate().map_err(|error| several(&error))?;
    experiment.memory.validate().map_err(|error| several(&error))?;
    let families: Vec<FamilyName> = experiment.lineages.iter().map(|lineage| lineage.family.clone()).collect();
    let egos: Vec<String> = experiment.lineages.iter().map(|lineage| lineage.ego.clone()).collect();
    predicts(experiment)?;
    let schema = world::schema_of(&experiment.world, &families, &egos);
    world::validate(&experiment.world, &schema).map_err(|error| several(&error))
}

/// Our own simulator predicts labels of another one alone, and of egos that it can drive.
fn predicts(experiment: &Experiment) -> Result<(), OptionError> {
    if experiment.world.model != WorldModel::Simulator {
        return Ok(());
    }
    let refused = |why| Err(OptionError::new("world.model", "\"simulator\"", why));
    match &experiment.simulator.backend {
        None => refused(
            "\"ridge\" or \"boosted\": our own simulator makes the labels; \"simulator\" needs [simulator.backend]",
        ),
        Some(backend) if backend.drives() => {
            refused("\"ridge\" or \"boosted\": a planner drives, and our own simulator knows no other ego like it")
        }
        Some(_) => Ok(()),
    }
}

/// A method other than the archive's own takes the MetaDrive protocol, and shares of its draws that leave nothing negative.
fn searched(experiment: &Experiment) -> Result<(), OptionError> {
    if experiment.without.is_some_and(|without| without.audit) && experiment.world_agent.is_some() {
        let why = "nothing: [world_agent] may change the share of audits; remove one of the two";
        return Err(OptionError::new("without.audit", true, why));
    }
    if experiment.world.routing.pilot.is_some()
        && let Some(rollouts) = experiment.search.as_ref().and_then(|search| search.rollouts)
    {
        let why = "nothing: it would not count the rollouts of [world.routing.pilot]; remove one of the two";
        return Err(OptionError::new("search.rollouts", rollouts, why));
    }
    let method = experiment.search.as_ref().map_or(Method::Pareto, |search| search.method);
    let tunes = experiment.search.as_ref().is_some_and(|search| search.tuning.is_some());
    if method == Method::Numbers && !tunes {
        let why = "another method, or [search.tuning] beside it: it leaves numbers free, which that sets";
        return Err(OptionError::new("search.method", "\"numbers\"", why));
    }
    if method == Method::ShuffledLabels && tunes {
        let why =
            "nothing: it would see the labels that search.method = \"shuffled_labels\" hides; remove one of the two";
        return Err(OptionError::new("search.tuning", "a table", why));
    }
    let own_gates = method != Method::ShuffledLabels && !method.replaces_gates();
    if experiment.archive.challengers > 0 && !(own_gates && experiment.archive.front_per == FrontPer::Lineage) {
        let why = "0: later looks go by the archive's own gates and true labels, over a front of the whole lineage; remove it, or \
                   search.method, or archive.front_per";
        return Err(OptionError::new("archive.challengers", experiment.archive.challengers, why));
    }
    if experiment.archive.front_per == FrontPer::Group {
        let refused = |why: &str| Err(OptionError::new("archive.front_per", "\"group\"", why));
        if experiment.evaluation.safebench().is_none() {
            return refused(
                "\"lineage\": groups of family and route are those of [evaluation.safebench]; add that table, or remove this",
            );
        }
        let all = match experiment.split.evolution {
            EvolutionSize::Count(count) => experiment.split.window >= count,
            EvolutionSize::Share(_) => false,
        };
        if !all {
            let why = "\"lineage\" beside a split.window smaller than split.evolution: a group's archive compares labels of all its \
                       scenes; widen the window, or remove this";
            return refused(why);
        }
    }
    let Some(search) = experiment.search.as_ref().filter(|search| search.method.replaces_gates()) else {
        return Ok(());
    };
    if experiment.archive.front == FrontOf::Evaluated {
        let why =
            format!("\"accepted\" beside search.method = {:?}, which decides whom it keeps", search.method.name());
        return Err(OptionError::new("archive.front", "\"evaluated\"", why));
    }
    if experiment.evaluation.safebench().is_some() {
        let why = "\"pareto\" under SafeBench's protocol, whose archive keeps scenes by group";
        return Err(OptionError::new("search.method", format!("{:?}", search.method.name()), why));
    }
    match &search.openevolve {
        Some(of) if of.exploration_ratio + of.exploitation_ratio > 1.0 => Err(OptionError::new(
            "search.openevolve.exploitation_ratio",
            of.exploitation_ratio,
            format!("at most 1 - exploration_ratio = {}", 1.0 - of.exploration_ratio),
        )),
        _ => Ok(()),
    }
}

/// Lineages have names of their own, and parents that their families' contracts allow.
fn lineages(experiment: &Experiment) -> Result<(), Problem> {
    if experiment.lineages.is_empty() {
        return Err(OptionError::new("lineage", "empty", "at least one [[lineage]]: a family and its ego").into());
    }
    let sources = families::sources_by_hand();
    let mut seen = BTreeSet::new();
    for (i, lineage) in experiment.lineages.iter().enumerate() {
        let id = lineage.id.as_str();
        if !seen.insert(id) {
            return Err(OptionError::new(
                format!("lineage[{i}].id"),
                format!("{id:?}"),
                "an id that no other lineage has",
            )
            .into());
        }
        let place = format!("lineage[{i}].ego");
        let unfit = |error| OptionError::new(place, format!("{:?}", lineage.ego), format!("a driver ({error})"));
        lineage.driver().map_err(unfit)?;
        several_egos(experiment, i)?;
        one_learned_ego(experiment, i)?;
        let Some(family) = sources.get(&lineage.family) else { continue };
        let published = published_of(i, lineage, &sources)?;
        if let Some(start) = &lineage.parent_program {
            start_of(i, lineage, start, &family.contract)?;
            continue;
        }
        let mut parent = published.unwrap_or(&family.parent).adopted(&lineage.id);
        if let Some(unknown) = lineage.parent.keys().find(|name| !parent.parameters.contains_key(*name)) {
            let known: Vec<String> = parent.parameters.keys().cloned().collect();
            return Err(OptionError::unknown(format!("lineage[{i}].parent.{unknown}"), unknown, &known).into());
        }
        parent.parameters.extend(lineage.parent.clone());
        if let Some(problem) = family.contract.check_program(&parent).first() {
            return Err(Problem::Several(format!("lineage[{i}].parent: {problem}")));
        }
    }
    Ok(())
}

/// Several drivers are different ones that our own simulator drives, the first of which is the lineage's `ego`.
fn several_egos(experiment: &Experiment, i: usize) -> Result<(), OptionError> {
    let lineage = &experiment.lineages[i];
    let refused = |found: String, expected: String| OptionError::new(format!("lineage[{i}].egos"), found, expected);
    if lineage.egos.is_empty() {
        let unsaid = lineage.over_egos == OverEgos::default();
        let why = "nothing: it says how several drivers count; write egos = [\"idm\", \"pdm\"], or take it out";
        return if unsaid { Ok(()) } else { Err(OptionError::new(format!("lineage[{i}].over_egos"), "given", why)) };
    }
    let names = format!("{:?}", lineage.egos);
    if lineage.egos.len() < 2 {
        return Err(refused(names, "two drivers at least; with one write ego in its place".into()));
    }
    let distinct: BTreeSet<&String> = lineage.egos.iter().collect();
    if distinct.len() < lineage.egos.len() {
        return Err(refused(names, "each driver once; an experiment has one learned ego".into()));
    }
    if lineage.egos.first() != Some(&lineage.ego) {
        return Err(refused(names, format!("{:?}, the lineage's ego, first; or take ego out", lineage.ego)));
    }
    if experiment.evaluation.safebench().is_some() {
        return Err(refused(names, "one ego under SafeBench's protocol, whose scores are of groups of runs".into()));
    }
    if experiment.simulator.backend.is_some() || experiment.driver.is_some() {
        let why = "one ego where another simulator or a planner of your own makes the rollouts; take [simulator.backend] or [driver] out";
        return Err(refused(names, why.into()));
    }
    let unfit = |error| refused(names.clone(), format!("drivers ({error})"));
    lineage.drivers().map(drop).map_err(unfit)
}

/// Rollouts are kept apart by the ego's name, so that an experiment has one learned ego.
fn one_learned_ego(experiment: &Experiment, i: usize) -> Result<(), OptionError> {
    let digest = |of: &LineageOptions| of.policy.as_ref().map(|policy| policy.digest);
    let Some(own) = digest(&experiment.lineages[i]) else { return Ok(()) };
    match experiment.lineages.iter().find_map(|of| digest(of).filter(|other| *other != own)) {
        None => Ok(()),
        Some(other) => {
            let expected = format!("{other}, as another lineage names; an experiment has one learned ego");
            Err(OptionError::new(format!("lineage[{i}].policy.digest"), own, expected))
        }
    }
}

/// The published program that a lineage asks for: of a family that has one, and in place of no program file.
fn published_of<'s>(
    i: usize,
    lineage: &LineageOptions,
    sources: &'s Sources,
) -> Result<Option<&'s Program>, OptionError> {
    let refused = |expected: String| OptionError::new(format!("lineage[{i}].published"), "true", expected);
    let known = || sources.iter().filter_map(|source| Some((&source.contract.family, source.published.as_ref()?)));
    match (lineage.published, &lineage.parent_program) {
        (false, _) => Ok(None),
        (true, Some(_)) => {
            Err(refused("false: parent_program already names the whole parent; remove one of the two".into()))
        }
        (true, None) => match known().find(|(family, _)| **family == lineage.family) {
            Some((_, published)) => Ok(Some(&published.program)),
            None => {
                let names: Vec<&str> = known().map(|(family, _)| family.as_str()).collect();
                let family = &lineage.family;
                Err(refused(format!(
                    "false: nothing is published for {family}, only for {}; take it out",
                    names.join(", ")
                )))
            }
        },
    }
}

/// A lineage that starts from a program file: a program of its family, under the contract of now, as the file had it.
fn start_of(i: usize, lineage: &LineageOptions, start: &ParentProgram, contract: &Contract) -> Result<(), Problem> {
    let place = |field: &str| format!("lineage[{i}].parent_program{field}");
    if !lineage.parent.is_empty() {
        let why = "nothing: parent_program already names the whole parent; remove one of the two";
        return Err(OptionError::new(format!("lineage[{i}].parent"), "given", why).into());
    }
    let several = |error: &dyn std::fmt::Display| Problem::Several(format!("{}: {error}", place("")));
    let now = ContractMark::of(contract).map_err(|error| several(&error))?;
    if let Some(changed) = start.contract.broken_by(&now) {
        let why = "a program of this version's contract; continue the run with the version of evodrive that began it";
        return Err(OptionError::new(place(".contract"), changed, why).into());
    }
    let hash = start.program.hash().map_err(|error| several(&error))?;
    if hash != start.program_hash {
        let why = format!("{}, which the file says; name the program file again", start.program_hash);
        return Err(OptionError::new(place(".program"), hash, why).into());
    }
    match contract.check_program(&start.program).first() {
        Some(problem) => Err(several(problem)),
        None => Ok(()),
    }
}

fn named_model(experiment: &Experiment, role: Role) -> Result<(), OptionError> {
    let place = format!("roles.{}", role.name());
    let known: Vec<String> = experiment.models.keys().cloned().collect();
    match experiment.roles.get(&role) {
        None => Err(OptionError::new(place, "missing", format!("the name of a model: {}", known.join(", ")))),
        Some(name) if !experiment.models.contains_key(name) => Err(OptionError::word(place, name, &known)),
        Some(_) => Ok(()),
    }
}

/// Returns what a family asks of agents besides patches; nothing if no family has this name.
fn asks_of(family: &FamilyName) -> Asks {
    families::sources().get(family).map(|source| source.asks).unwrap_or_default()
}

/// Returns `true` if a lineage's family takes counsel: then, and only then, the file says how and from which model.
fn counselled(experiment: &Experiment) -> Result<bool, OptionError> {
    let takes = experiment.lineages.iter().find(|lineage| asks_of(&lineage.family).counsel.is_some());
    let role = Role::AttackerAgent;
    match (takes, &experiment.counsel) {
        (Some(lineage), None) => Err(OptionError::new(
            "counsel",
            "missing",
            format!(
                "a table with rounds and vehicles, because {} takes counsel, and a model for roles.{}",
                lineage.id,
                role.name()
            ),
        )),
        (None, Some(_)) => {
            Err(OptionError::new("counsel", "given", "nothing: no lineage's family takes counsel; take [counsel] out"))
        }
        (None, None) if experiment.roles.contains_key(&role) => Err(OptionError::new(
            format!("roles.{}", role.name()),
            "given",
            format!("nothing: no lineage's family takes counsel; take {} out of [roles]", role.name()),
        )),
        (takes, _) => Ok(takes.is_some()),
    }
}

/// Returns `true` if templates are composed: the file describes some and a lineage's family takes them.
fn composes(experiment: &Experiment) -> Result<bool, OptionError> {
    // A lineage that starts from a program file or a published one has its templates.
    let has_none = |lineage: &&LineageOptions| lineage.parent_program.is_none() && !lineage.published;
    let composed = experiment.lineages.iter().filter(has_none);
    let templates = composed.filter_map(|lineage| asks_of(&lineage.family).templates);
    let forms = templates.flat_map(|asks| (asks.forms)());
    let kinds: Vec<String> = forms.map(|form| form.kind.to_string()).collect();
    let role = Role::TemplateAgent;
    let Some(options) = &experiment.composition else {
        return if experiment.roles.contains_key(&role) {
            Err(OptionError::new(
                format!("roles.{}", role.name()),
                "given",
                format!("nothing: nothing is composed without [composition]; take {} out of [roles]", role.name()),
            ))
        } else {
            Ok(false)
        };
    };
    if kinds.is_empty() {
        let why = "nothing: no lineage's family takes templates; take [composition] out";
        return Err(OptionError::new("composition", "given", why));
    }
    if let Some(kind) = options.descriptions.keys().find(|kind| !kinds.contains(kind)) {
        return Err(OptionError::unknown(format!("composition.descriptions.{kind}"), kind, &kinds));
    }
    let known: Vec<&str> = kinds.iter().map(String::as_str).collect();
    match options.fault(&known) {
        Some((field, expected)) => Err(OptionError::new(format!("composition.{field}"), "unfit", expected)),
        None => Ok(true),
    }
}

/// Returns `true` if the world evaluator evolves: the file has a table for it, and only then a model for it.
fn evolves(experiment: &Experiment) -> Result<bool, OptionError> {
    let place = format!("roles.{}", Role::WorldAgent.name());
    let Some(options) = &experiment.world_agent else {
        return if experiment.roles.contains_key(&Role::WorldAgent) {
            Err(OptionError::new(place, "given", "nothing without [world_agent]; add that table, or take this out"))
        } else {
            Ok(false)
        };
    };
    let ([low, high], founding) = (options.audit_share, experiment.world.routing.audit_share);
    if !(0.0 <= low && low <= founding && founding <= high && high <= 1.0) {
        let expected = format!("low <= world.routing.audit_share = {founding} <= high, between 0 and 1");
        return Err(OptionError::new("world_agent.audit_share", format!("[{low}, {high}]"), expected));
    }
    match experiment.lineages.iter().position(|lineage| lineage.id.as_str() == WORLD_LINE) {
        Some(i) => Err(OptionError::new(
            format!("lineage[{i}].id"),
            format!("{WORLD_LINE:?}"),
            "another id: turns of the world evaluator have that name",
        )),
        None => Ok(true),
    }
}

/// Whom a model of kind `drawn` stands for: others, each with a share, and no such model again.
fn shares(experiment: &Experiment, name: &str, options: &ModelOptions) -> Result<(), OptionError> {
    let place = format!("models.{name}.shares");
    let of = &options.shares;
    let drawn = |options: &ModelOptions| options.kind == client::DRAWN;
    if drawn(options) == of.is_empty() {
        let found = if of.is_empty() { "missing" } else { "given" };
        return Err(OptionError::new(place, found, "shares of other models where the kind is drawn, and only there"));
    }
    let plain = experiment.models.iter().filter(|(_, options)| !drawn(options));
    let plain: Vec<String> = plain.map(|(name, _)| name.clone()).collect();
    if let Some(other) = of.keys().find(|other| !plain.contains(other)) {
        return Err(OptionError::word(format!("{place}.{other}"), other.as_str(), &plain));
    }
    match of.iter().find(|(_, share)| !(share.is_finite() && **share > 0.0)) {
        Some((other, share)) => Err(OptionError::new(format!("{place}.{other}"), share.to_string(), "a share above 0")),
        None => Ok(()),
    }
}

/// Settings of models that rest on their kind, and the cap that live ones need.
fn models(experiment: &Experiment) -> Result<(), Problem> {
    for (name, options) in &experiment.models {
        // It names folders of a run.
        if !super::key::is_name(name) {
            return Err(Problem::Several(format!("models.{name:?}: expected a name of {}", super::key::Range::Name)));
        }
        client::check(&options.spec(name), options.client.as_ref()).map_err(Problem::Several)?;
        shares(experiment, name, options)?;
        let scripted = options.kind == client::SCRIPTED;
        if scripted && !client::SCRIPTED_MODELS.contains(&options.model.as_str()) {
            let known = client::SCRIPTED_MODELS.map(String::from);
            return Err(OptionError::word(format!("models.{name}.model"), &options.model, &known).into());
        }
        if scripted && !options.sampling.contains_key("seed") {
            let place = format!("models.{name}.sampling.seed");
            return Err(OptionError::new(place, "missing", "the root of its random streams, a whole number").into());
        }
    }
    let live = experiment.models.values().any(|options| client::is_live(&options.kind));
    match &experiment.spend {
        None if live => Err(Problem::Several("a live model needs a table [spend] with usd_max and tokens_max".into())),
        _ => Ok(()),
    }
}

fn scenes(experiment: &Experiment) -> Result<(), Problem> {
    let checked = match &experiment.scenes {
        SceneSource::Synth { options, .. } => options.check(),
        SceneSource::Safebench { options, .. } => options.check(),
        SceneSource::Files { .. } | SceneSource::Pool { .. } => Ok(()),
    };
    checked.map_err(|error| Problem::Several(format!("scenes.options: {error}")))
}

fn simulator(experiment: &Experiment) -> Result<(), Problem> {
    experiment.simulator.rules().check().map_err(|error| Problem::Several(error.to_string()))?;
    let Some(backend) = &experiment.simulator.backend else { return Ok(()) };
    if experiment.evaluation.safebench().is_some() {
        let why = if backend.drives() {
            "SafeBench's rules cannot be checked on a planner's recorded rollouts; remove [driver]"
        } else {
            "SafeBench's rules are our own simulator's; write simulator.backend = \"evodrive\""
        };
        return Err(Problem::Several(why.into()));
    }
    match backend.fault() {
        None => Ok(()),
        Some((field, found, expected)) => {
            Err(OptionError::new(format!("simulator.backend.{field}"), found, expected).into())
        }
    }
}

fn labels(experiment: &Experiment) -> Result<(), Problem> {
    let weighed = |counts| match &experiment.evaluation {
        EvaluationOptions::Metadrive(of) => of.realism.counting(counts),
        EvaluationOptions::Safebench { .. } => Vec::new(),
    };
    let simulator = &experiment.simulator;
    let asked = [
        (Counts::OfKind, "simulator.of_kind", simulator.of_kind),
        (Counts::OfPlace, "simulator.of_place", simulator.of_place),
    ];
    for (counts, key, says) in asked {
        let weighed = weighed(counts).join(" or ");
        if !weighed.is_empty() && !says {
            let expected = format!("true, because a weight of {weighed} reads what outcomes say then");
            return Err(OptionError::new(key, "missing", expected).into());
        }
    }
    if simulator.of_place && weighed(Counts::OfPlace).is_empty() {
        let expected = "a share from 0 to 1, because simulator.of_place is for nothing else; or remove that";
        return Err(OptionError::new(place_of_kind::ROW.key, "missing", expected).into());
    }
    match &experiment.evaluation {
        EvaluationOptions::Metadrive(options) => {
            let mut formulas = options.attack.when.iter().chain(options.metrics.values());
            if formulas.any(|of| of.asks_at_fault()) && !experiment.simulator.at_fault {
                let expected =
                    "true, because an expression over outcomes or evaluation.attack.reading reads what they say then";
                return Err(OptionError::new("simulator.at_fault", "missing", expected).into());
            }
            options.realism.check().map_err(|error| Problem::Several(error.to_string()))
        }
        EvaluationOptions::Safebench { safebench } => match safebench.fault() {
            Some((field, expected)) => {
                Err(OptionError::new(format!("evaluation.safebench.{field}"), "unfit", expected).into())
            }
            None if safebench.preventable.is_some() && !experiment.simulator.of_kind => {
                let expected = "true, because evaluation.safebench.preventable reads what outcomes say then";
                Err(OptionError::new("simulator.of_kind", "missing", expected).into())
            }
            None => Ok(()),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// What is said of a shipped experiment once it is changed; empty where nothing is wrong with it.
    fn refused(name: &str, change: impl Fn(&mut Experiment)) -> String {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/arms").join(name);
        let mut experiment = Experiment::read(&file).unwrap();
        assert_eq!(check(&experiment), Ok(()));
        change(&mut experiment);
        check(&experiment).err().map_or(String::new(), |problem| format!("{problem:?}"))
    }

    fn method(experiment: &mut Experiment, method: Method) {
        experiment.search.as_mut().unwrap().method = method;
    }

    #[test]
    fn what_would_see_hidden_labels_or_leave_numbers_open_is_refused() {
        let alone = refused("numbers.toml", |experiment| experiment.search.as_mut().unwrap().tuning = None);
        assert!(alone.contains("it leaves numbers free"), "{alone}");
        let shuffled = refused("tuned.toml", |experiment| method(experiment, Method::ShuffledLabels));
        assert!(shuffled.contains("search.tuning"), "{shuffled}");
        for other in [Method::ShuffledLabels, Method::AttackOnly] {
            let says = refused("challengers.toml", |experiment| method(experiment, other));
            assert!(says.contains("archive.challengers"), "{says}");
        }
        assert_eq!(refused("challengers.toml", |experiment| method(experiment, Method::RandomProposals)), "");
    }
}
