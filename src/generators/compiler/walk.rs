//! A scene's way through the operator graph: select, actor, timing, motion, search, filters, law, choice. Ways may part and
//! meet again; a way that is not taken is not walked.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::actions::actions;
use super::flow::Flow;
use super::merge::{self, Branch};
use super::{
    CompileFailure, Compiled, Decision, FilterReport, Prepared, actors, choice, constraints, filters, law, rehearse,
    reshape, timing,
};
use crate::kernel::{Digest, canon::CanonError};
use crate::objects::{Counsel, OperatorNode, ParameterValue, Slot};
use crate::sim::{Intervention, Scripts};
use crate::stage::{Part, Settings, Stage, StageError};

/// The way through one graph in one scene.
struct Walk<'w, 'p> {
    prepared: &'w Prepared<'p>,
    stage: &'w Stage<'w>,
    rules: Vec<usize>,
    parameters: BTreeMap<String, ParameterValue>,
    /// Flows of nodes that feed more than one other.
    kept: BTreeMap<&'p str, Flow>,
    decision: Decision,
}

pub(super) fn walk(prepared: &Prepared<'_>, stage: &Stage<'_>) -> Result<Compiled, CompileFailure> {
    let rules = prepared.rules(&stage.situation.scene_values);
    let parameters = prepared.parameters(&rules);
    let mode = rules.iter().map(|rule| prepared.rule_name(*rule).to_string()).collect();
    let decision = Decision { mode, ..Decision::default() };
    let mut walk = Walk { prepared, stage, rules, parameters, kept: BTreeMap::new(), decision };
    let flow = match prepared.last_node() {
        Some(end) => walk.to(end)?,
        None => Flow { stop: Some("the graph is empty".into()), ..Flow::default() },
    };
    let mut decision = walk.decision;
    if let Some(reason) = flow.stop {
        decision.reason = reason;
        return Ok(Compiled { decision, intervention: Intervention::default() });
    }
    finish(prepared, stage, decision, &flow)
}

impl<'p> Walk<'_, 'p> {
    /// Returns the decisions up to and including a node. The contract's check has ruled out circles and bounded the graph's size.
    fn to(&mut self, name: &'p str) -> Result<Flow, CompileFailure> {
        if let Some(flow) = self.kept.get(name) {
            return Ok(flow.clone());
        }
        let Some(node) = self.prepared.node(name) else { return Ok(Flow::default()) };
        let flow = match node.inputs.as_slice() {
            [one, other] => self.merged(name, node, [one.as_str(), other.as_str()])?,
            inputs => {
                let before = match inputs.first() {
                    Some(input) => self.to(input.as_str())?,
                    None => Flow::default(),
                };
                if before.stop.is_some() { before } else { self.step(name, node, before)? }
            }
        };
        if self.prepared.feeds(name) > 1 {
            self.kept.insert(name, flow.clone());
        }
        Ok(flow)
    }

    /// Returns the one of two ways that the node takes, or both merged.
    fn merged(
        &mut self,
        name: &'p str,
        node: &'p OperatorNode,
        [one, other]: [&'p str; 2],
    ) -> Result<Flow, CompileFailure> {
        let settings = self.settings(name, node);
        let failed = |source| CompileFailure::Node { node: name.to_string(), source };
        let branch = match merge::before_walking(&node.kind, &settings).map_err(failed)? {
            Some(branch) => branch,
            None => {
                let first = self.to(one)?;
                let branch = merge::after_first(self.stage.situation, &node.kind, &settings, &first).map_err(failed)?;
                match branch {
                    Branch::First => {
                        self.took(name, one);
                        return Ok(first);
                    }
                    Branch::Both => {
                        let second = self.to(other)?;
                        return Ok(merge::united(first, second));
                    }
                    Branch::Second => {
                        let second = self.to(other)?;
                        // Something refused is still more than nothing.
                        let taken =
                            if second.stop.is_some() && first.stop.is_none() { (one, first) } else { (other, second) };
                        self.took(name, taken.0);
                        return Ok(taken.1);
                    }
                }
            }
        };
        let taken = if branch == Branch::First { one } else { other };
        self.took(name, taken);
        self.to(taken)
    }

    fn took(&mut self, name: &str, taken: &str) {
        self.decision.branches.push(format!("{name}: {taken}"));
    }

    fn settings(&self, name: &str, node: &OperatorNode) -> Settings {
        self.prepared.settings(name, node, &self.rules, &self.parameters, &self.stage.situation.scene_values)
    }

    fn step(&mut self, name: &str, node: &OperatorNode, mut flow: Flow) -> Result<Flow, CompileFailure> {
        let settings = self.settings(name, node);
        let failed = |source| CompileFailure::Node { node: name.to_string(), source };
        let reason = self.stepped(name, node, &settings, &mut flow).map_err(failed)?;
        flow.stop = reason.map(|reason| format!("{name}: {reason}"));
        Ok(flow)
    }

    /// Returns the parts that a motion or search node makes.
    fn searched(&self, name: &str, kind: &str, settings: &Settings, parts: Vec<Part>) -> Result<Vec<Part>, StageError> {
        let operators = &self.prepared.source().operators;
        let operator = operators.get(kind).ok_or_else(|| StageError::Missing(format!("operator {kind}")))?;
        let run = |mut parts: Vec<Part>| {
            operator(self.stage, settings, &mut parts)?;
            parts.retain(|part| !part.candidates.is_empty());
            Ok(parts)
        };
        // Without a key there is nothing to look up by, and nothing is lost but time.
        let known = self.prepared.searched().and_then(|searched| Some((searched, self.key(name).ok()?)));
        let Some((searched, key)) = known else { return run(parts) };
        searched.of(key, || run(parts).map(Arc::from)).map(|parts| parts.to_vec())
    }

    /// Returns the digest of all that decides a node's result. The scene's id is part of it, because random streams are named by it: scenes of
    /// one content under two ids are searched apart, whichever is asked for first. A gate in front of everything is no part of it:
    /// where it is shut, nobody comes as far as a search.
    fn key(&self, name: &str) -> Result<Digest, CanonError> {
        let situation = self.stage.situation;
        let counsel = self.stage.counsel.map(Counsel::digest).transpose()?;
        let scene = (situation.scene_id(), situation.digest());
        let place = (scene, situation.policy.digest(), self.stage.seed.0, counsel);
        Digest::of("evodrive/searched/2", &(place, self.upstream(name)?))
    }

    /// Digest of a node as it takes effect here and of all nodes that feed it.
    fn upstream(&self, name: &str) -> Result<Digest, CanonError> {
        let inputs = self.prepared.node(name).map(|node| node.inputs.as_slice()).unwrap_or_default();
        let fed = |input: &String| {
            let opens =
                self.prepared.node(input).is_some_and(|node| node.slot == Slot::Select && node.inputs.is_empty());
            if opens { Ok(None) } else { self.upstream(input).map(Some) }
        };
        let fed = inputs.iter().map(fed).collect::<Result<Vec<_>, _>>()?;
        Digest::of("evodrive/upstream/1", &(self.prepared.taking_effect(name, &self.rules, &self.parameters), fed))
    }

    /// Carries a node out. Why nothing is left behind it; `None` where there is something.
    fn stepped(
        &mut self,
        name: &str,
        node: &OperatorNode,
        settings: &Settings,
        flow: &mut Flow,
    ) -> Result<Option<&'static str>, StageError> {
        let (kind, stage) = (node.kind.as_str(), self.stage);
        let nothing = |empty: bool, reason: &'static str| empty.then_some(reason);
        Ok(match node.slot {
            Slot::Select => {
                let shut = kind == "gated_scenes" && !settings.module("gate")?.boolean(vec![]);
                nothing(shut, "the gate does not hold")
            }
            Slot::Actor => {
                flow.actors = actors::select(self.prepared.source(), stage, kind, settings)?;
                nothing(flow.actors.is_empty(), "no vehicle is eligible")
            }
            Slot::Timing => {
                for (index, actor) in flow.actors.iter().enumerate() {
                    let place = (index, flow.actors.len());
                    let window = timing::window(stage.situation, *actor, place, kind, settings)?;
                    let part = |window| Part {
                        actor: *actor,
                        window,
                        candidates: vec![],
                        offsets: None,
                        driven: None,
                        simulated: 0,
                    };
                    flow.parts.extend(window.map(part));
                }
                nothing(flow.parts.is_empty(), "no window of a second fits into the scene and the actor's log")
            }
            Slot::Motion | Slot::Search => {
                flow.parts = self.searched(name, kind, settings, std::mem::take(&mut flow.parts))?;
                nothing(flow.parts.is_empty(), "no candidate")
            }
            Slot::Filter if kind == "reshape" => {
                reshape::apply(stage.situation, settings, &mut flow.parts);
                None
            }
            Slot::Filter => {
                let before = flow.parts.iter().map(|part| part.candidates.len()).sum();
                let violation = filters::apply(stage.situation, kind, settings, &mut flow.parts)?;
                flow.parts.retain(|part| !part.candidates.is_empty());
                let after = flow.parts.iter().map(|part| part.candidates.len()).sum();
                flow.forced |= violation.is_some();
                self.decision.filters.push(FilterReport { node: name.to_string(), before, after, violation });
                nothing(flow.parts.is_empty(), "no candidate passes")
            }
            Slot::Law => {
                law::give(kind, settings, &mut flow.parts)?;
                None
            }
            Slot::Diversity if kind == "rehearsed_choice" => {
                let rehearsed = rehearse::choose(stage, settings, &flow.parts, choice::by_score(&flow.parts))?;
                (flow.chosen, flow.rehearsed) = (rehearsed.chosen, rehearsed.rollouts);
                None
            }
            Slot::Diversity => {
                flow.chosen = choice::choose(stage, kind, settings, &flow.parts)?;
                None
            }
        })
    }
}

fn finish(
    prepared: &Prepared<'_>,
    stage: &Stage<'_>,
    mut decision: Decision,
    flow: &Flow,
) -> Result<Compiled, CompileFailure> {
    for (part, chosen) in flow.parts.iter().zip(&flow.chosen) {
        let candidate = &part.candidates[*chosen];
        constraints::check(stage.situation, part, candidate, prepared.constraints())?;
        decision.actors.push(choice::report(stage.situation, part, *chosen));
    }
    let actions = actions(stage.situation, &flow.parts, &flow.chosen);
    decision.applies = true;
    let simulated = flow.rehearsed + flow.parts.iter().map(|part| part.simulated).sum::<usize>();
    let counted = flow.rehearsed > 0
        || stage.situation.scene.staging.is_some() && stage.situation.plant.options().scripts == Scripts::AsRun;
    decision.search_rollouts = counted.then_some(simulated);
    Ok(Compiled { decision, intervention: Intervention { actions } })
}
