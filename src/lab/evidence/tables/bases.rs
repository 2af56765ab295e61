//! The basis of every cell of every table, found by its row and its column.

use std::collections::BTreeMap;

use super::archives::{self, LineageArchive, Scores};
use super::basis::{Combine, Derivation, LabelRead, Leaf, Repetition, Selected};
use super::error::TableError;
use super::frontier::Spanned;
use super::key::{Kept, Of, Reads, RowKey, Side};
use super::labels::{self, LineageLabels, ReplayLabels};
use super::layout::{Row, Table};
use super::shares::Spec;
use super::{contacts, critics, gains, metadrive, paper, proposals, readings, safebench, unseen};
use crate::evaluation::{Group, group_name};
use crate::evidence::recorded_run::RecordedRun;
use crate::kernel::num;
use crate::objects::benchmark::HeldOutRun;
use crate::objects::event::LineageResult;
use crate::objects::replay::{Replayed, Suite};
use crate::objects::{LineageId, SceneScore, SolutionId};

/// Where the cells of a table come from.
pub struct Derivations<'s> {
    pub(super) recorded_runs: &'s [RecordedRun],
    /// By run: labels by program and scene.
    labels: Vec<BTreeMap<(&'s SolutionId, &'s str), &'s SceneScore>>,
    lineages: Vec<LineageLabels>,
    /// By run: its lineages, in tables that compare runs.
    pub(super) searched: Vec<Vec<LineageLabels>>,
    archives: Vec<LineageArchive>,
    replays: Vec<ReplayLabels>,
}

impl<'s> Derivations<'s> {
    /// Of a table that was made from these runs.
    pub fn of(table: &Table, recorded_runs: &'s [RecordedRun]) -> Result<Derivations<'s>, TableError> {
        let labelled = |recorded_run: &'s RecordedRun| {
            let scores = recorded_run.scores();
            scores.flat_map(|(_, of, _, score)| score.scenes.iter().map(move |l| ((of, l.scene.as_str()), l))).collect()
        };
        let (recorded, staged) = (table.name.starts_with("metadrive"), table.name.starts_with("safebench"));
        let compared = matches!(table.name, "attack-only" | "without" | "kwidth" | gains::NAME);
        let recorded = recorded && !compared;
        let own = |place| labels::of_run(recorded_runs, place);
        Ok(Derivations {
            recorded_runs,
            searched: if compared { (0..recorded_runs.len()).map(own).collect::<Result<_, _>>()? } else { Vec::new() },
            labels: recorded_runs.iter().map(labelled).collect(),
            lineages: if recorded { labels::lineages(recorded_runs)? } else { Vec::new() },
            archives: match table.name {
                unseen::NAME => archives::held_out(recorded_runs)?,
                _ if staged => archives::lineages(recorded_runs)?,
                _ => Vec::new(),
            },
            replays: if recorded { labels::replays(recorded_runs)? } else { Vec::new() },
        })
    }

    /// The label of a program of a run in a scene.
    pub fn label(&self, run: usize, solution: &SolutionId, scene: &str) -> Option<&'s SceneScore> {
        self.labels.get(run)?.get(&(solution, scene)).copied()
    }

    /// The basis of a cell; `None` for a cell without a number of ours.
    pub fn basis(&self, table: &Table, row: &Row, key: &str) -> Option<Derivation> {
        let replay = matches!(row.key, RowKey::Replay { .. });
        match table.name {
            "metadrive-main" | "metadrive-policy" if replay => self.replayed(row, metadrive::read_of_replay(key)?),
            "metadrive-main" | "metadrive-policy" => self.of_labels(row, key),
            "metadrive-contacts" if replay => self.replayed(row, |scene| Some(labels::share(scene.contact))),
            "metadrive-contacts" => {
                let side = row.key.side()?;
                let (_, read) = contacts::readings().into_iter().find(|(column, _)| column.key == key)?;
                Some(self.means(row, side, key, read))
            }
            "metadrive-readings" if replay => self.replayed(row, |_| Some(0.0)),
            "metadrive-readings" => {
                let (side, read) = readings::read_of(key)?;
                Some(self.means(row, side, key, Box::new(read)))
            }
            gains::NAME => self.of_gains(row, key),
            "safebench-main" | "safebench-rounds" if replay => self.replay_row(row, key),
            "safebench-main" if safebench::FRONTIERS.contains(&key) => Some(self.gains(row, key)),
            "safebench-main" => {
                let side = |side: &str| key.starts_with(side) || key.contains("_change_");
                let reads = |kept: Kept, at: u32, last: u32| match kept {
                    Kept::Redrawn => at == last && side("redrawn_"),
                    _ => at == last && side("evolved_") || at == 0 && key.starts_with("parent_"),
                };
                Some(self.of_rounds(row, key, &|scores| safebench::main_number(key, scores), (&reads, |_| true)))
            }
            "safebench-rounds" => {
                let RowKey::Lineages { reads: Reads::Round { metric, round, of }, .. } = row.key else { return None };
                let number = |scores: &Scores| safebench::round_number(metric, round, of, key, scores);
                let reads = |kept: Kept, at: u32, _| at as usize == round && (of == kept || of == Kept::Change);
                let group = |group: &str| key == paper::safebench::AVERAGE || group.split('/').next() == Some(key);
                Some(self.of_rounds(row, key, &number, (&reads, group)))
            }
            unseen::NAME => self.unseen(row, key),
            "proposals" => Some(self.counted(&proposals::SPEC, row, key)),
            "actor-critic" => Some(self.counted(&critics::SPEC, row, key)),
            "attack-only" | "without" | "kwidth" => self.of_searches(table, row, key),
            _ => None,
        }
    }

    /// What a number of ours without a basis rests on, in words.
    pub fn without_parts(key: &str) -> &'static str {
        if super::ablations::is_wall_clock(key) {
            return "wall clocks are the counted answers and rollouts times the seconds that the table's note declares; for the counts \
                    ask for `proposed` or `simulated` of that row";
        }
        "it comes from the resamples of all differences of the table together; ask for the difference itself, `attack_change` or \
         `realism_change`"
    }

    /// The lineages of a row.
    fn lineages_of(&self, row: &Row) -> impl Iterator<Item = &LineageLabels> {
        self.lineages.iter().filter(|l| row.key.has(l.place, &l.lineage))
    }

    fn of_labels(&self, row: &Row, key: &str) -> Option<Derivation> {
        let [relative, change, before] = metadrive::RELATIVE;
        if key == relative {
            let terms = [change, before].into_iter().map(|key| self.of_labels(row, key)).collect::<Option<_>>()?;
            let formula = format!("100 {change} / {before}");
            return Some(Derivation { terms, ..Derivation::of(formula, Combine::Percent, Vec::new()) });
        }
        if key == metadrive::FRONTIER {
            return Some(self.frontier(self.lineages_of(row)));
        }
        let (side, reading) = metadrive::read_of(key)?;
        if side == Side::Endpoint && self.lineages_of(row).any(|l| l.endpoint.is_none()) {
            return None;
        }
        Some(self.means(row, side, key, Box::new(reading)))
    }

    fn means(&self, row: &Row, side: Side, key: &str, read: LabelRead) -> Derivation {
        self.means_of(self.lineages_of(row), side, &words(key), read)
    }

    /// Means of a reading over held-out labels.
    pub(super) fn means_of<'l>(
        &self,
        lineages: impl Iterator<Item = &'l LineageLabels>,
        side: Side,
        what: &str,
        read: LabelRead,
    ) -> Derivation {
        let part = |l: &LineageLabels| -> Option<Repetition> {
            let (run, recorded_run, result) = self.result(l.place, &l.lineage)?;
            let programs = programs(side, result);
            let leaf = |scene: &String| {
                let number = |of: &SolutionId| read(self.label(run, of, scene)?);
                let value = match programs.as_slice() {
                    [one] => number(one),
                    [before, after] => number(before).zip(number(after)).map(|(before, after)| after - before),
                    _ => None,
                };
                Leaf::scene(scene, &programs, value)
            };
            let leaves: Vec<Leaf> = recorded_run.opened.held_out_scenes.iter().map(leaf).collect();
            let value = num::mean(&leaves.iter().filter_map(|leaf| leaf.value).collect::<Vec<f64>>());
            Some(part_of(l, run, programs, value, leaves))
        };
        let parts = lineages.filter_map(part).collect();
        let change = if side == Side::Change { "evolved minus parent, scene by scene, of " } else { "" };
        let formula = format!("{MEANS} {change}{what}");
        Derivation { read: Some(read), ..Derivation::of(formula, Combine::Means, parts) }
    }

    /// PF-Area@3, worked out again from the held-out objectives of the parent and of the chosen descendants, or as the sealed
    /// results have it where the archive's options are not at hand.
    pub(super) fn frontier<'l>(&self, lineages: impl Iterator<Item = &'l LineageLabels>) -> Derivation {
        let formula = format!(
            "{SEARCHES} PF-Area@3, a number of a lineage: 100 times the frontier area that the first three finalists by the reporting rule add to the parent's, over the parent's, on held-out objectives"
        );
        self.spanned(lineages, formula, |spanned, result| {
            spanned.map_or(Some(result.pf_area_at_3_pct), |of| Some(of.gain_pct))
        })
    }

    /// A number of what spans each lineage's held-out front.
    pub(super) fn spanned<'l>(
        &self,
        lineages: impl Iterator<Item = &'l LineageLabels>,
        formula: String,
        number: impl Fn(Option<&Spanned>, &LineageResult) -> Option<f64>,
    ) -> Derivation {
        let part = |l: &LineageLabels| -> Option<Repetition> {
            let (run, recorded_run, result) = self.result(l.place, &l.lineage)?;
            let counts = |roles: &[String]| roles.iter().any(|role| role == "parent" || role == "descendant");
            let own = recorded_run.held_out.iter().filter(|h| h.lineage == l.lineage && counts(&h.roles));
            let programs: Vec<SolutionId> = own.map(|held_out| held_out.solution.clone()).collect();
            let leaf = |scene: &String| Leaf::scene(scene, &programs, None);
            let leaves = recorded_run.opened.held_out_scenes.iter().map(leaf).collect();
            let spanned = Spanned::of(recorded_run, result);
            let value = number(spanned.as_ref(), result);
            let steps = spanned.map_or(Vec::new(), |spanned| spanned.steps);
            Some(Repetition { steps, ..part_of(l, run, programs.clone(), value, leaves) })
        };
        Derivation::of(formula, Combine::Means, lineages.filter_map(part).collect())
    }

    /// Means over the scenes without a program.
    fn replayed(&self, row: &Row, read: fn(&crate::objects::replay::ReplayScene) -> Option<f64>) -> Option<Derivation> {
        let RowKey::Replay { egos, .. } = &row.key else { return None };
        let of = |replay: &&ReplayLabels| egos.contains(&replay.key());
        let part = |replay: &ReplayLabels| -> Repetition {
            let leaves: Vec<Leaf> = replay
                .scenes
                .iter()
                .flatten()
                .map(|scene| {
                    let note = format!(
                        "contact {}, realism {}",
                        scene.contact,
                        scene.realism.map_or("none".into(), |r| r.to_string())
                    );
                    Leaf { note: Some(note), ..Leaf::scene(&scene.scene, &[], read(scene)) }
                })
                .collect();
            let value = num::mean(&leaves.iter().filter_map(|leaf| leaf.value).collect::<Vec<f64>>());
            let lineage = format!("replay/{}", replay.ego);
            Repetition {
                search: format!("{} {}", replay.suite, replay.ego),
                run: replay.place,
                lineage,
                replica: 0,
                programs: Vec::new(),
                value,
                leaves,
                steps: Vec::new(),
            }
        };
        let parts = self.replays.iter().filter(of).map(part).collect();
        let formula =
            "mean over runs with other scenes or egos of the mean over held-out scenes played without a program"
                .to_string();
        Some(Derivation::of(formula, Combine::Means, parts))
    }

    /// SafeBench's row without a program, which is recorded as a whole.
    fn replay_row(&self, row: &Row, key: &str) -> Option<Derivation> {
        let RowKey::Replay { egos, metric } = &row.key else { return None };
        let Of { run, of: ego } = egos.first()?;
        let own = |replayed: &&Replayed| replayed.row.suite == Suite::Evolution && replayed.row.ego == *ego;
        let replayed = self.recorded_runs.get(*run)?.replays.iter().find(own)?;
        let known = replayed.row.benchmark?;
        let metric = match key {
            "parent_attack" => "Attack",
            "parent_ars" => "ARS",
            "parent_cr" => "CR",
            "parent_os" => "OS",
            _ => (*metric)?,
        };
        let value = match metric {
            "Attack" => known.attack,
            "ARS" => known.realism,
            "CR" => known.collision_rate,
            "OS" => known.overall_score,
            _ => return None,
        };
        let leaves = replayed.scenes.iter().map(|scene| Leaf::scene(&scene.scene, &[], None)).collect();
        let part = Repetition {
            search: "replay".into(),
            run: *run,
            lineage: row.lineages.join(" "),
            replica: 0,
            programs: Vec::new(),
            value: Some(value),
            leaves,
            steps: Vec::new(),
        };
        Some(Derivation::of(
            format!("{metric} of the empty program on the evolution scenes, recorded as a whole"),
            Combine::Means,
            vec![part],
        ))
    }

    fn archives_of(&self, row: &Row) -> impl Iterator<Item = &LineageArchive> {
        self.archives.iter().filter(|archive| row.key.has(archive.place, &archive.lineage))
    }

    /// A number of the archive's rounds, which is of the selected runs together. `reads` says of the search's runs and of the redrawn ones
    /// which rounds it is of; the second says which groups.
    fn of_rounds(
        &self,
        row: &Row,
        key: &str,
        number: Number<'_>,
        (reads, group): (&dyn Fn(Kept, u32, u32) -> bool, impl Fn(&str) -> bool),
    ) -> Derivation {
        let part = |archive: &LineageArchive| -> Option<Repetition> {
            let (run, recorded_run, _) = self.result(archive.place, &archive.lineage)?;
            let last = archive.rounds.len().saturating_sub(1) as u32;
            let evolved = recorded_run.rounds.iter().filter(|r| r.lineage == archive.lineage);
            let evolved = evolved.filter(|r| reads(Kept::Evolved, r.round, last)).map(|r| (r, ""));
            let redrawn = recorded_run.redrawn.iter().filter(|of| of.lineage == archive.lineage);
            let redrawn = redrawn.flat_map(|of| &of.rounds).filter(|r| reads(Kept::Redrawn, r.round, last));
            let redrawn = redrawn.map(|r| (r, ", the parent redrawn"));
            let leaves: Vec<Leaf> = evolved
                .chain(redrawn)
                .flat_map(|(r, drawn)| {
                    let read = r.selected.iter().filter(|selected| group(&selected.group));
                    read.map(move |selected| Leaf {
                        selected: Some(Selected { round: r.round, run: selected.run }),
                        note: Some(format!(
                            "{} after round {}{drawn}: attack {:.3}, ARS {:.3}",
                            selected.group, r.round, selected.attack, selected.realism
                        )),
                        ..Leaf::scene(&selected.scene, std::slice::from_ref(&selected.solution), None)
                    })
                })
                .collect();
            let mut programs: Vec<SolutionId> = leaves.iter().flat_map(|leaf| leaf.programs.clone()).collect();
            programs.sort();
            programs.dedup();
            Some(part_of_archive(archive, run, programs, number(&archive.scores()), leaves))
        };
        let parts = self.archives_of(row).filter_map(part).collect();
        let formula = format!(
            "mean over repetitions of {} of all runs that balanced selection keeps, families weighing alike (docs/OBJECTIVES.md)",
            rounds_words(key, row)
        );
        Derivation::of(formula, Combine::MeansOfAll, parts)
    }

    /// A number of one program's runs on held-out routes, or of its labels on those that evolution saw.
    fn unseen(&self, row: &Row, key: &str) -> Option<Derivation> {
        let seen = unseen::seen_of(key);
        let parts = self.archives_of(row).filter_map(|archive| -> Option<Repetition> {
            let (run, recorded_run, result) = self.result(archive.place, &archive.lineage)?;
            let [parent, evolved] = [&result.parent.solution, &result.evolved.solution];
            let sides = [(0, parent, !key.contains("evolved_")), (1, evolved, !key.contains("parent_"))];
            let wanted: Vec<(u32, &SolutionId)> =
                sides.into_iter().filter(|(.., wanted)| *wanted).map(|(round, of, _)| (round, of)).collect();
            let programs: Vec<SolutionId> = wanted.iter().map(|(_, of)| (*of).clone()).collect();
            if let Some(read) = seen {
                let leaves =
                    recorded_run.opened.evolution_scenes.iter().map(|scene| Leaf::scene(scene, &programs, None));
                let value = unseen::seen(recorded_run, result).and_then(|both| read(&both));
                return Some(part_of_archive(archive, run, programs.clone(), value, leaves.collect()));
            }
            let runs = wanted.iter().flat_map(|(round, of)| {
                let held_out =
                    recorded_run.held_out.iter().find(|h| h.lineage == archive.lineage && h.solution == **of);
                held_out.into_iter().flat_map(|held_out| &held_out.runs).map(|one| (*round, *of, one))
            });
            let leaf = |(round, of, one): (u32, &SolutionId, &HeldOutRun)| Leaf {
                selected: one.run.map(|run| Selected { round, run }),
                note: Some(match one.run {
                    Some(_) => one.group.clone(),
                    None => format!("{}: could not be run, counts as invalid", one.group),
                }),
                ..Leaf::scene(&one.scene, std::slice::from_ref(of), None)
            };
            let leaves = runs.map(leaf).collect();
            Some(part_of_archive(archive, run, programs, safebench::main_number(key, &archive.scores()), leaves))
        });
        let (parts, where_): (Vec<Repetition>, _) =
            (parts.collect(), if seen.is_some() { "that evolution saw" } else { "held out" });
        let formula = format!(
            "mean over repetitions of {key} of all runs on the routes {where_}, families weighing alike (docs/OBJECTIVES.md)"
        );
        Some(Derivation::of(formula, Combine::MeansOfAll, parts))
    }

    /// PF-Area@3 of SafeBench: the mean over groups, as sealed in the results; of the redrawn parent; and the first less the second.
    fn gains(&self, row: &Row, key: &str) -> Derivation {
        let [redrawn, evolved, _] = safebench::FRONTIERS;
        let part = |archive: &LineageArchive| -> Option<Repetition> {
            let (run, ..) = self.result(archive.place, &archive.lineage)?;
            let leaf = |group: Group| {
                let of = |gains: &BTreeMap<Group, f64>| gains.get(&group).copied();
                let [before, after] = [of(&archive.redrawn_gains_pct), of(&archive.gains_pct)];
                let value = match key {
                    _ if key == redrawn => before,
                    _ if key == evolved => after,
                    _ => before.zip(after).map(|(before, after)| after - before),
                };
                Leaf::scene(&group_name(group), &[], value)
            };
            let leaves: Vec<Leaf> = archive.gains_pct.keys().copied().map(leaf).collect();
            let value = safebench::main_number(key, &archive.scores());
            Some(part_of_archive(archive, run, Vec::new(), value, leaves))
        };
        let what = match key {
            _ if key == redrawn => "frontier gain of the redrawn parent",
            _ if key == evolved => "frontier gain, as sealed in the results",
            _ => "frontier gain, as sealed in the results, less that of the redrawn parent",
        };
        let formula = format!("mean over repetitions of the mean over groups of the {what}");
        Derivation::of(formula, Combine::Means, self.archives_of(row).filter_map(part).collect())
    }

    /// A share of proposals.
    fn counted(&self, spec: &Spec, row: &Row, key: &str) -> Derivation {
        let mut parts = Vec::new();
        for (run, recorded_run) in self.recorded_runs.iter().enumerate() {
            for parent in recorded_run.parents.iter().filter(|parent| row.key.has(run, &parent.lineage)) {
                let attempts = recorded_run.attempts.iter().filter(|attempt| attempt.lineage == parent.lineage);
                let leaf = |attempt: &crate::objects::Attempt| {
                    let (counts, holds) = spec.counted(key, attempt)?;
                    let value = counts.then(|| labels::share(holds));
                    Some(Leaf { attempt: Some(attempt.id.clone()), ..Leaf::scene(attempt.id.as_str(), &[], value) })
                };
                let leaves: Vec<Leaf> = attempts.filter_map(leaf).collect();
                let counted: Vec<f64> = leaves.iter().filter_map(|leaf| leaf.value).collect();
                let lineage = parent.lineage.to_string();
                parts.push(Repetition {
                    search: parent.program.source_family.to_string(),
                    run,
                    lineage,
                    replica: 0,
                    programs: Vec::new(),
                    value: num::mean(&counted).map(|share| 100.0 * share),
                    leaves,
                    steps: Vec::new(),
                });
            }
        }
        Derivation::of(
            "100 times the proposals that it holds of, over all that count, of all lineages together".into(),
            Combine::Pooled,
            parts,
        )
    }

    fn result(&self, place: usize, lineage: &LineageId) -> Option<(usize, &'s RecordedRun, &'s LineageResult)> {
        let recorded_run = self.recorded_runs.get(place)?;
        Some((place, recorded_run, recorded_run.result_of(lineage)?))
    }
}

/// A number of one repetition's scores.
type Number<'a> = &'a dyn Fn(&Scores) -> Option<f64>;

const SEARCHES: &str = "mean over searches of the mean over their repetitions of";
const MEANS: &str = "mean over searches of the mean over their repetitions of the mean over held-out scenes of";

fn part_of(
    l: &LineageLabels,
    run: usize,
    programs: Vec<SolutionId>,
    value: Option<f64>,
    leaves: Vec<Leaf>,
) -> Repetition {
    let (search, lineage) = (format!("{} {}", l.name, l.ego), l.lineage.to_string());
    Repetition { search, run, lineage, replica: l.replica, programs, value, leaves, steps: Vec::new() }
}

fn part_of_archive(
    archive: &LineageArchive,
    run: usize,
    programs: Vec<SolutionId>,
    value: Option<f64>,
    leaves: Vec<Leaf>,
) -> Repetition {
    let (search, lineage) = (archive.name.clone(), archive.lineage.to_string());
    Repetition { search, run, lineage, replica: archive.replica, programs, value, leaves, steps: Vec::new() }
}

fn programs(side: Side, result: &LineageResult) -> Vec<SolutionId> {
    let (parent, evolved) = (result.parent.solution.clone(), result.evolved.solution.clone());
    match side {
        Side::Parent => vec![parent],
        Side::Evolved => vec![evolved],
        Side::Endpoint => result.endpoint.iter().map(|endpoint| endpoint.solution.clone()).collect(),
        Side::AtFloor(place) => result.at_realism.get(place).map(|of| of.chosen.solution.clone()).into_iter().collect(),
        Side::Change => vec![parent, evolved],
    }
}

/// What is read off a label for a column.
fn words(key: &str) -> String {
    let bare = ["parent_", "evolved_", "endpoint_"].iter().find_map(|side| key.strip_prefix(side)).unwrap_or(key);
    let note = match bare {
        "attack" | "attack_change" => "attack",
        "any_contact" => "1 where the ego meets anyone, else 0",
        "rp_pct" | "rp_change_pp" => "100 (1 - realism) where the program acts",
        "success_rp_pct" => "100 (1 - realism) where the program succeeds",
        "rp_all_pct" => "100 (1 - realism)",
        "coverage" => "1 where the program acts, else 0",
        "avoidable_contact" => "1 where the ego meets an adversary and could have avoided it, else 0",
        "met_anyway" => "1 where the ego meets an adversary that it also meets in plain replay, else 0",
        "adversary_contact" => "1 where the ego meets an adversary, else 0",
        class => return format!("1 where the ego meets an adversary in a contact of class {class}, else 0"),
    };
    note.to_string()
}

fn rounds_words(key: &str, row: &Row) -> String {
    match row.key {
        RowKey::Lineages { reads: Reads::Round { metric, round, of }, .. } => {
            let whose = match of {
                Kept::Evolved => "",
                Kept::Redrawn => " of the redrawn parent",
                Kept::Change => " less that of the redrawn parent",
            };
            format!("{metric} after round {round} in {key}{whose},")
        }
        _ => format!("{key},"),
    }
}
