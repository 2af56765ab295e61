//! The curator C(a_t): typed, normalised cards instead of raw logs (paper, appendix Archive, Memory, and Retrieval).
//!
//! | exit | cards |
//! |---|---|
//! | declined, invalid | failure |
//! | rejected | none: what was not simulated says nothing about merit |
//! | evaluated, no gate held | failure; a motif that may be shared |
//! | evaluated, a gate held, dominated by the front | failure: a step from its parent that others surpass |
//! | evaluated, a gate held, on the front | success; a motif that may be shared; failure of the world evaluator where it would have turned the candidate away |
//! | any, where a critic objected | critic |
//!
//! Cards with numbers, free text or names of a family's parts stay in their lineage. A motif holds only plain tags of
//! mechanisms and scenes, so other lineages may see it.

use serde::{Deserialize, Serialize};

use super::text::{is_plain_tag, normalised, number, tag_set};
use crate::objects::{
    Advice, Attempt, Candidate, Card, CardId, CardKind, Decision, Exit, FamilyName, GateReport, Objectives, Review,
    Route, RouteDecision, Score,
};

/// How cards are written. Comes from the experiment file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurationOptions {
    /// Attack below which a candidate counts as weak, 1.
    pub attack_low: f64,
    /// Realism below which a candidate counts as implausible, 1.
    pub realism_low: f64,
    /// Decimals of every number.
    pub digits: u32,
    /// Longest text of a card, characters.
    pub text_chars: usize,
}

/// Context that the curator needs besides the attempt.
#[derive(Clone, Copy, Debug)]
pub struct CurationContext<'a> {
    /// Family of the lineage.
    pub family: &'a FamilyName,
    /// Words for the scenes in which the attempt changed an attack, without those that name nearly every scene.
    pub scene_tags: &'a [String],
    /// Words of the family's implementation, which other lineages never see.
    pub private_vocabulary: &'a [String],
    /// When cards are written.
    pub options: &'a CurationOptions,
}

/// Cards of one sealed attempt, numbered in a fixed order.
pub fn curate(attempt: &Attempt, context: &CurationContext<'_>) -> Vec<Card> {
    let mut writer = Writer { attempt, context, cards: Vec::new() };
    match &attempt.exit {
        Exit::Declined { reason } => writer.own(CardKind::Failure, format!("No usable patch: {reason}"), &[]),
        Exit::Invalid { gates } => writer.own(CardKind::Failure, gate_text(gates), &[]),
        Exit::Rejected { .. } => {}
        Exit::Evaluated { candidate, route, score, decision, .. } => {
            writer.evaluated(candidate, route, score, decision);
        }
    }
    writer.critics();
    writer.cards
}

struct Writer<'a> {
    attempt: &'a Attempt,
    context: &'a CurationContext<'a>,
    cards: Vec<Card>,
}

impl Writer<'_> {
    fn push(&mut self, kind: CardKind, text: String, mechanism_tags: Vec<String>, shareable: bool) {
        let options = self.context.options;
        let scene_tags = tag_set(self.context.scene_tags);
        self.cards.push(Card {
            id: CardId::new(format!("{}#{}", self.attempt.id, self.cards.len())),
            kind,
            lineage: self.attempt.lineage.clone(),
            family: self.context.family.clone(),
            epoch: self.attempt.epoch,
            attempt: Some(self.attempt.id.clone()),
            text: normalised(&text, options.digits, options.text_chars),
            mechanism_tags,
            scene_tags: if shareable {
                scene_tags.into_iter().filter(|t| is_plain_tag(t)).collect()
            } else {
                scene_tags
            },
            shareable,
        });
    }

    /// A card that stays in its lineage.
    fn own(&mut self, kind: CardKind, text: String, tags: &[String]) {
        self.push(kind, text, tag_set(tags), false);
    }

    /// A card of plain words only; `None` if no tag may be shared.
    fn motif(&mut self, kind: CardKind, outcome: &str, candidate: &Candidate) {
        let private = self.context.private_vocabulary;
        let crosses = |tag: &&String| is_plain_tag(tag) && !private.contains(tag);
        let tags = tag_set(candidate.mechanism_tags.iter().filter(crosses));
        if tags.is_empty() {
            return;
        }
        let scenes: Vec<String> = tag_set(self.context.scene_tags.iter().filter(|tag| is_plain_tag(tag)));
        let place = if scenes.is_empty() { String::new() } else { format!(" in scenes: {}", scenes.join(", ")) };
        self.push(kind, format!("Mechanism {} {outcome}{place}.", tags.join(" + ")), tags, true);
    }

    fn evaluated(&mut self, candidate: &Candidate, route: &Route, score: &Score, decision: &Decision) {
        let (tags, labels) = (&candidate.mechanism_tags, &score.objectives);
        let change = self.change(decision);
        if decision.gates.any() && !decision.on_front {
            let text = format!("A step from its parent, but dominated by the front: {}, {change}.", self.rates(labels));
            self.own(CardKind::Failure, text, tags);
        } else if decision.gates.any() {
            let gates = gate_names(decision).join(", ");
            self.own(CardKind::Success, format!("Accepted by {gates}: {}, {change}.", self.rates(labels)), tags);
            self.motif(CardKind::Success, "was accepted", candidate);
            let foreseen = route.decision == RouteDecision::Audit && route.half_width.is_some();
            if foreseen && self.weakness(&route.predicted).is_some() {
                let text = format!(
                    "World evaluator was wrong: predicted {}, simulated {}.",
                    self.rates(&route.predicted),
                    self.rates(labels)
                );
                self.own(CardKind::Failure, text, tags);
            }
        } else {
            let gates = &decision.gates;
            let why = if gates.differing_scenes == 0 {
                "had the parent's labels in every scene"
            } else if !gates.coverage.holds {
                "acted in too few scenes"
            } else {
                self.weakness(labels).unwrap_or("brought no new trade-off")
            };
            let digits = self.context.options.digits;
            let coverage = number(gates.coverage.coverage, digits);
            let floor = number(gates.coverage.floor, digits);
            let rates = self.rates(labels);
            let text = format!("Not accepted, {why}: {rates}, coverage {coverage} of at least {floor}, {change}.");
            self.own(CardKind::Failure, text, tags);
            self.motif(CardKind::Failure, why, candidate);
        }
    }

    /// One card with the objections of the last round that had any.
    fn critics(&mut self) {
        let objects = |review: &&Review| review.decision != Advice::Approve || !review.blockers.is_empty();
        let rounds = self.attempt.proposal.rounds.iter().rev();
        let Some(reviews) =
            rounds.map(|round| round.reviews.iter().filter(objects).collect::<Vec<_>>()).find(|r| !r.is_empty())
        else {
            return;
        };
        let notes: Vec<String> = reviews.iter().map(|review| note(review)).collect();
        let tags = match &self.attempt.exit {
            Exit::Rejected { candidate, .. } | Exit::Evaluated { candidate, .. } => candidate.mechanism_tags.clone(),
            Exit::Declined { .. } | Exit::Invalid { .. } => Vec::new(),
        };
        self.own(CardKind::Critic, notes.join("; "), &tags);
    }

    fn rates(&self, objectives: &Objectives) -> String {
        let digits = self.context.options.digits;
        format!("attack {}, realism {}", number(objectives.attack, digits), number(objectives.realism, digits))
    }

    fn change(&self, decision: &Decision) -> String {
        let (digits, trade) = (self.context.options.digits, &decision.gates.parent_tradeoff);
        let (attack, realism) = (number(trade.attack_change, digits), number(trade.realism_change, digits));
        format!("change to the parent: attack {attack}, realism {realism}")
    }

    fn weakness(&self, objectives: &Objectives) -> Option<&'static str> {
        let options = self.context.options;
        match (objectives.attack < options.attack_low, objectives.realism < options.realism_low) {
            (true, true) => Some("had low attack and low realism"),
            (true, false) => Some("had low attack"),
            (false, true) => Some("had low realism"),
            (false, false) => None,
        }
    }
}

fn gate_text(report: &GateReport) -> String {
    let failed: Vec<String> = report
        .failed()
        .map(|v| format!("{:?}: {}", v.gate, v.problems.first().map_or("", String::as_str)).to_lowercase())
        .collect();
    format!("Refused by gates; {}", failed.join("; "))
}

fn gate_names(decision: &Decision) -> Vec<&str> {
    let gates = &decision.gates;
    if let Some(groups) = &gates.groups {
        return groups.iter().map(String::as_str).collect();
    }
    [
        (gates.densification.holds, "densification"),
        (gates.local_push.holds, "local push"),
        (gates.parent_tradeoff.holds, "parent trade-off"),
    ]
    .into_iter()
    .filter(|(holds, _)| *holds)
    .map(|(_, name)| name)
    .collect()
}

fn note(review: &Review) -> String {
    let first = review.blockers.first().or(review.repair_hints.first()).or(review.risk_tags.first());
    format!("{}: {}", review.role.name(), first.map_or("objected without a reason", String::as_str))
}
