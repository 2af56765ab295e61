//! Data of the page, as one JSON value: the story of the run in the shapes that the page's script draws.

use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

use super::super::choice::Choice;
use super::super::recorded_run::RecordedRun;
use super::super::tables::compared;
use super::beside::Beside;
use super::headline::Headline;
use super::manoeuvre::Gained;
use super::stage::Stage;
use super::terms::terms;
use super::{credit, growth, mechanism, pairs, spread, trust};
use crate::evidence::evaluator::Evolution;
use crate::evidence::realism::Realisms;
use crate::evidence::{audit, unlabelled};
use crate::kernel::num;
use crate::objects::replay::ReplayRow;
use crate::objects::{
    Attempt, Counselled, Exchange, Exit, LineageId, Origin, Role, Round, SceneScore, edit_categories, event::Measured,
    program_diff, program_text,
};

/// Attempts that a page tells in full. Of a larger run it does so of the accepted ones, and the others in short: a page of ten
/// thousand whole stories has forty megabytes, and `evodrive show` tells any of them.
const IN_FULL_MAX: usize = 1000;

const ROLES: [Role; 7] = [
    Role::Actor,
    Role::StructuralCritic,
    Role::AttackCritic,
    Role::RealismCritic,
    Role::IsolationCritic,
    Role::Repair,
    Role::WorldAgent,
];

/// Everything but the player's scenes.
pub fn of(run: &RecordedRun, headlines: &[Headline], stage: &Stage, beside: &Beside<'_>) -> Value {
    let names = Names::of(run);
    let lineages: Vec<Value> = run.parents.iter().map(|p| lineage(run, &p.lineage, &names, stage, beside)).collect();
    let mut page = json!({
        "name": run.opened.name,
        "root": run.root,
        "sealed": run.result.is_some(),
        "safebench": !run.rounds.is_empty(),
        "models": run.models(),
        "scripted_roles": run.scripted_roles(),
        "versions": run.opened.versions,
        "experiment": run.opened.experiment,
        "pool": run.opened.pool,
        "evolution_scenes": run.opened.evolution_scenes.len(),
        "held_out_scenes": run.opened.held_out_scenes.len(),
        "exits": run.result.as_ref().map(|r| r.exits),
        "rollouts": run.result.as_ref().map(|r| r.rollouts),
        "replay": run.replays.iter().map(|replayed| replay_row(run, &replayed.row)).collect::<Vec<_>>(),
        "headlines": headlines,
        "badges": trust::badges(run, stage),
        "realism_min": beside.selector.realism_min,
        "classes": names.classes,
        "programs": programs(run, headlines),
        "lineages": lineages,
        "counsels": run.counsels.iter().map(counsel).collect::<Vec<_>>(),
        "cost": beside.cost,
        "findings": audit(run),
        "unlabelled": unlabelled(run),
        "attack": run.opened.attack,
        "scenes": names.scenes,
        "diagnostics": names.diagnostics,
        "metrics": names.metrics,
        "model_names": names.models,
        "roles": ROLES.map(Role::name),
        "terms": terms(),
        "meanings": beside.words.meanings,
        "attempts": attempts(run, &names, IN_FULL_MAX),
    });
    if let Some(evolution) = Evolution::of(run) {
        page["evolution"] = json!(evolution);
    }
    if let Some(live) = beside.live {
        page["live"] = json!(live);
    }
    if let Some(agreement) = beside.agreement {
        page["agreement"] = json!(agreement);
    }
    if !beside.others.is_empty() {
        page["others"] = json!(beside.others);
    }
    page
}

/// Texts of the programs that were measured on the held-out scenes, so that a reader compares any two; of a search that is repeated those of
/// the repetition that is shown.
fn programs(run: &RecordedRun, headlines: &[Headline]) -> BTreeMap<String, String> {
    let own = run.held_out.iter().filter(|of| headlines.iter().any(|headline| headline.lineage == of.lineage));
    own.filter_map(|of| Some((of.solution.to_string(), program_text(run.program(&of.solution)?)))).collect()
}

fn lineage(run: &RecordedRun, id: &LineageId, names: &Names, stage: &Stage, beside: &Beside<'_>) -> Value {
    let parent = run.parents.iter().find(|p| p.lineage == *id);
    let result = run.result_of(id);
    let frozen = || run.frozen.iter().filter(|f| f.lineage == *id);
    let epochs: Vec<Value> = run
        .settled
        .iter()
        .filter(|s| s.lineage == *id)
        .map(|s| json!({"epoch": s.epoch, "hypervolume": s.hypervolume, "front": s.front, "active": s.active}))
        .collect();
    let windows: Vec<Value> = frozen().map(|f| json!([f.epoch, f.window.len(), f.scenes_so_far])).collect();
    let held_out: Vec<Value> = run
        .held_out
        .iter()
        .filter(|of| of.lineage == *id)
        .map(|of| {
            let realisms = Realisms::of(&of.score);
            json!({
                "measured": Measured::new(of.solution.clone(), &of.score),
                "realism_acted": realisms.realism_acted,
                "failing_share": realisms.failing_share,
                "strict_realism": realisms.strict_realism,
                "roles": of.roles,
                "scenes": of.score.scenes.len(),
                "spread": spread::of(&of.score.scenes, of.score.rules.mean).filter(|_| of.score.benchmark.is_none()).map(|of| short(json!(of))),
            })
        })
        .collect();
    let parent_scores: Vec<Value> = frozen()
        .map(|f| json!({"epoch": f.epoch, "solution": f.parent, "objectives": f.parent_score.objectives}))
        .collect();
    let mut object = json!({
        "id": id,
        "family": parent.map(|p| &p.program.source_family),
        "ego": parent.map(|p| run.ego_name(&p.ego)),
        "parent": parent.map(|p| &p.program.solution_id),
        "active": run.active(id),
        "epochs": epochs,
        "parent_scores": parent_scores,
        "windows": windows,
        "held_out": held_out,
        "choice": Choice::of(run, id, beside.selector),
        "result": result,
    });
    if let Some(growth) = growth::of(run, id) {
        object["growth"] = short(growth);
    }
    if let Some(result) = result {
        object["group"] = json!(result.group);
        object["pairs"] = pairs::of(run, result, &names.scenes, &names.classes).into();
        object["mechanism"] = json!(mechanism::of(run, result, beside.words));
        let gained = stage.gained.get(&result.evolved.solution).map(Gained::says).filter(|says| !says.is_empty());
        object["gains_by"] = json!(gained);
    }
    // SafeBench's scores are of whole sets of runs: the tables of that protocol have their intervals.
    if let Some(result) = result.filter(|_| run.rounds.is_empty()) {
        object["compared"] = json!(compared((run, &result.parent.solution), (run, &result.evolved.solution)));
    }
    if let Some(credit) = result.and_then(|result| credit::of(beside.credits, &result.evolved.solution)) {
        object["credit"] = credit;
    }
    // Only where the parent is no published one.
    if let Some(adopted) = parent.filter(|adopted| !adopted.origins.is_empty()) {
        object["origins"] = adopted.origins.iter().map(Origin::to_string).collect();
    }
    object
}

/// The recorded scenes without a program, with the ego by the name that people know it by.
fn replay_row(run: &RecordedRun, row: &ReplayRow) -> Value {
    let mut object = json!(row);
    object["ego"] = json!(run.ego_name(&row.ego));
    object["attack"] = json!(row.attack(&run.label_rules()));
    object
}

fn counsel(counselled: &Counselled) -> Value {
    let rounds = counselled.rounds.iter().map(|round| {
        json!({
            "attackers": round.attackers,
            "reason": round.reason,
            "by": round.proposed_by,
            "outcome": round.trial.code(),
            "distance_m": Some(round.trial.distance_m()).filter(|m| m.is_finite()),
        })
    });
    json!({
        "lineage": counselled.lineage,
        "scene": counselled.scene,
        "rounds": rounds.collect::<Vec<_>>(),
        "advised": counselled.chosen().map(|round| &round.attackers),
        "refused": counselled.exchanges.iter().filter_map(|asked| Some(json!([asked.round, asked.refusal.as_ref()?]))).collect::<Vec<_>>(),
    })
}

/// Texts that would stand in the attempts thousands of times; these name their places in the sorted lists.
struct Names {
    scenes: Vec<String>,
    diagnostics: Vec<String>,
    metrics: Vec<String>,
    models: Vec<String>,
    classes: Vec<String>,
}

impl Names {
    fn of(run: &RecordedRun) -> Names {
        let labelled = || run.attempts.iter().filter_map(|a| a.exit.score()).flat_map(|score| &score.scenes);
        let held_out = || run.held_out.iter().flat_map(|of| &of.score.scenes);
        let sorted = |names: &mut dyn Iterator<Item = &String>| -> Vec<String> {
            names.collect::<BTreeSet<&String>>().into_iter().cloned().collect()
        };
        Names {
            scenes: sorted(&mut labelled().chain(held_out()).map(|scene| &scene.scene)),
            classes: sorted(
                &mut labelled().chain(held_out()).filter_map(|of| of.contact.as_ref()).map(|met| &met.class),
            ),
            diagnostics: sorted(&mut labelled().flat_map(|scene| scene.diagnostics.keys())),
            metrics: sorted(&mut labelled().flat_map(|scene| scene.metrics.keys())),
            models: sorted(
                &mut run.attempts.iter().flat_map(|a| &a.proposal.exchanges).map(|exchange| &exchange.model),
            ),
        }
    }

    /// `[role, round, model, request, response, refusal]`; digests are cut as the page prints them.
    fn exchange(&self, exchange: &Exchange) -> Value {
        let (request, response) = (exchange.request.short(12), exchange.response.short(12));
        let model = self.models.binary_search(&exchange.model).ok();
        json!([role(exchange.role), exchange.round, model, request, response, exchange.refusal])
    }

    /// `[scene, attack, realism, applied, [[diagnostic, value], ...], [metric, ...]]`, of the diagnostics only those below 1; the metrics in
    /// the order of their names, where the experiment declares any.
    fn label(&self, label: &SceneScore) -> Value {
        let place = |names: &[String], name: &String| names.binary_search(name).ok();
        let below = label.diagnostics.iter().filter(|(_, value)| **value < 1.0);
        let below: Vec<Value> =
            below.map(|(name, value)| json!([place(&self.diagnostics, name), num::rounded(*value, 3)])).collect();
        let mut row = vec![
            json!(place(&self.scenes, &label.scene)),
            json!(num::rounded(label.attack, 3)),
            json!(num::rounded(label.realism, 4)),
            json!(u8::from(label.intervened)),
            json!(below),
        ];
        if !self.metrics.is_empty() {
            let measured = self.metrics.iter().map(|name| label.metrics.get(name).map(|value| num::rounded(*value, 4)));
            row.push(json!(measured.collect::<Vec<_>>()));
        }
        Value::Array(row)
    }
}

fn attempts(run: &RecordedRun, names: &Names, in_full_max: usize) -> Vec<Value> {
    let all = run.attempts.len() <= in_full_max;
    let accepted = |attempt: &Attempt| attempt.exit.decision().is_some_and(|decision| decision.gates.any());
    let shown = |of: &Attempt| if all || accepted(of) { attempt(run, names, of) } else { in_short(names, of) };
    run.attempts.iter().map(shown).collect()
}

/// Returns what the charts, the tree and the list show of an attempt.
fn fields(names: &Names, attempt: &Attempt) -> Value {
    let candidate = attempt.exit.candidate();
    // `[class, how many]` of the contacts that count as attacks.
    let mut met: BTreeMap<usize, usize> = BTreeMap::new();
    let labels = attempt.exit.score().into_iter().flat_map(|score| score.scenes.iter().flat_map(SceneScore::each));
    for label in labels.filter(|label| label.attack > 0.0) {
        let class = label.contact.as_ref().and_then(|contact| names.classes.binary_search(&contact.class).ok());
        class.into_iter().for_each(|class| *met.entry(class).or_default() += 1);
    }
    json!({
        "id": attempt.id,
        "lineage": attempt.lineage,
        "epoch": attempt.epoch,
        "slot": attempt.slot,
        "parent": attempt.parent,
        "exit": attempt.exit.name(),
        // By its attempt's name, as all but those of older records are: ten thousand times the same text twice would be felt.
        "solution": candidate.map(|c| match c.program.solution_id.as_str() == attempt.id.as_str() { true => json!(true), false => json!(c.program.solution_id) }),
        "objectives": attempt.exit.score().map(|s| short(json!(s.objectives))),
        "met": Some(met.into_iter().collect::<Vec<_>>()).filter(|met| !met.is_empty()),
    })
}

fn in_short(names: &Names, attempt: &Attempt) -> Value {
    let mut object = fields(names, attempt);
    object["in_short"] = true.into();
    drop_nothing(&mut object);
    object
}

fn attempt(run: &RecordedRun, names: &Names, attempt: &Attempt) -> Value {
    let patch = attempt.proposal.patch();
    let candidate = attempt.exit.candidate();
    let change = candidate
        .and_then(|c| run.program(&attempt.parent).map(|parent| program_diff(parent, &c.program)))
        .unwrap_or_default();
    let reason = match &attempt.exit {
        Exit::Declined { reason } => Some(reason),
        _ => None,
    };
    // A reader sees the patch where there is no change of a program to show.
    let operations = patch.filter(|_| change.is_empty()).map(|p| &p.operations);
    let score = attempt.exit.score();
    let mut object = fields(names, attempt);
    let rest = json!({
        "target": attempt.target,
        "reason": reason,
        "hypothesis": patch.map(|p| &p.hypothesis),
        "operations": operations,
        "categories": patch.map(|p| edit_categories(p).into_iter().map(|s| s.name()).collect::<Vec<_>>()),
        "tags": candidate.map(|c| &c.mechanism_tags),
        "memory": attempt.memory_shown,
        "exchanges": attempt.proposal.exchanges.iter().map(|x| names.exchange(x)).collect::<Vec<_>>(),
        "tuned": attempt.proposal.tuned.as_ref().map(|tuned| tuned.in_words()),
        "reviews": attempt.proposal.rounds.iter().map(reviews).collect::<Vec<_>>(),
        "gates": attempt.exit.gates().map(|g| g.verdicts.iter().map(|v| json!([v.gate, v.problems])).collect::<Vec<_>>()),
        "route": attempt.exit.route().map(|r| short(json!({
            "decision": r.decision, "reason": r.reason, "predicted": r.predicted, "uncertainty": r.uncertainty,
        }))),
        "scenes": score.map(|s| s.scenes.iter().map(|label| names.label(label)).collect::<Vec<_>>()),
        "failures": score.map(|s| &s.failures),
        "decision": attempt.exit.decision().map(|d| short(json!(d))),
        "diff": change,
    });
    if let (Some(object), Value::Object(more)) = (object.as_object_mut(), rest) {
        object.extend(more);
    }
    drop_nothing(&mut object);
    object
}

/// Nothing is what most attempts have of most of it.
fn drop_nothing(object: &mut Value) {
    if let Some(fields) = object.as_object_mut() {
        fields.retain(|_, value| !value.is_null() && value.as_str() != Some(""));
    }
}

/// A role's place in the page's list of roles.
fn role(role: Role) -> Option<usize> {
    ROLES.iter().position(|known| *known == role)
}

/// `[role, decision, blockers]` of each critic.
fn reviews(round: &Round) -> Vec<Value> {
    round.reviews.iter().map(|review| json!([role(review.role), review.decision, review.blockers])).collect()
}

/// Rounds to six decimals: more than any chart or line of the page shows.
fn short(value: Value) -> Value {
    match value {
        Value::Number(n) if n.is_f64() => json!(num::rounded(n.as_f64().unwrap_or_default(), 6)),
        Value::Array(items) => items.into_iter().map(short).collect(),
        Value::Object(fields) => fields.into_iter().map(|(name, value)| (name, short(value))).collect(),
        other => other,
    }
}
