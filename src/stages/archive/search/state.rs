//! Memory that a method has of a lineage from epoch to epoch, and its two decisions: which programs the slots edit, and whether
//! a labelled child is kept. Random numbers come from outside.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

use super::super::openevolve::{Database, Member};
use super::nsga2::{before, ordered};
use super::options::{Method, SearchOptions};
use crate::kernel::Stream;
use crate::objects::{Objectives, SolutionId};

/// Programs that a question of OpenEvolve shows: inspirations, and the best of the parent's island.
const INSPIRATIONS: usize = 2;
const TOP_PROGRAMS: usize = 3;

/// A method's memory; methods that need none have no state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SearchState {
    /// OpenEvolve's database.
    OpenEvolve(Box<Database>),
    /// NSGA-II's population, in the order in which it was joined.
    Nsga2(Vec<(SolutionId, Objectives)>),
}

/// A labelled program.
#[derive(Clone, Debug)]
pub struct Child<'a> {
    pub solution: &'a SolutionId,
    pub objectives: Objectives,
    /// The program's text, without identity and descent.
    pub text: String,
    /// The iteration it was made in, counted over all slots of the lineage; it says the island.
    pub iteration: usize,
}

/// The program that a slot edits, and those that its question shows beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct SlotDraw {
    pub parent: SolutionId,
    pub shown: Vec<SolutionId>,
}

impl SearchState {
    /// The beginning, with the lineage's parent; `None` for methods that remember nothing.
    pub fn begin(options: &SearchOptions, parent: Child<'_>, stream: &mut Stream) -> Option<SearchState> {
        match options.method {
            Method::OpenEvolve => {
                let mut database = Database::new(options.openevolve.clone()?);
                database.add(member(options, parent), 0, &mut || stream.unit());
                Some(SearchState::OpenEvolve(Box::new(database)))
            }
            Method::Nsga2 => Some(SearchState::Nsga2(vec![(parent.solution.clone(), parent.objectives)])),
            Method::Pareto
            | Method::AttackOnly
            | Method::Random
            | Method::HillClimbing
            | Method::RandomProposals
            | Method::Numbers
            | Method::ShuffledLabels => None,
        }
    }

    /// Draws the parent of an iteration.
    pub fn draw(&mut self, iteration: usize, stream: &mut Stream) -> Option<SlotDraw> {
        match self {
            SearchState::OpenEvolve(database) => {
                // The islands take turns.
                let drawn = database.sample(iteration, INSPIRATIONS, &mut || stream.unit())?;
                let mut shown: Vec<SolutionId> = Vec::new();
                for id in drawn.inspirations.into_iter().chain(database.top(&drawn.parent, TOP_PROGRAMS)) {
                    let solution = solution(database, &id);
                    if !shown.contains(&solution) {
                        shown.push(solution);
                    }
                }
                Some(SlotDraw { parent: solution(database, &drawn.parent), shown })
            }
            SearchState::Nsga2(population) => {
                let points: Vec<[f64; 2]> = population.iter().map(|(_, at)| [at.attack, at.realism]).collect();
                let (order, one, other) =
                    (ordered(&points), stream.below(points.len().max(1)), stream.below(points.len().max(1)));
                let winner = if before(*order.get(other)?, *order.get(one)?) { other } else { one };
                Some(SlotDraw { parent: population.get(winner)?.0.clone(), shown: Vec::new() })
            }
        }
    }

    /// Takes a child in; whether it stays.
    pub fn consider(&mut self, options: &SearchOptions, child: Child<'_>, stream: &mut Stream) -> bool {
        match self {
            SearchState::OpenEvolve(database) => {
                let (id, island) = (child.solution.to_string(), child.iteration);
                database.add(member(options, child), island, &mut || stream.unit());
                database.advance(island, &mut || stream.unit());
                database.member(&id).is_some()
            }
            SearchState::Nsga2(population) => {
                let most = options.population.unwrap_or(1).max(1);
                let id = child.solution.clone();
                population.push((id.clone(), child.objectives));
                if population.len() > most {
                    let points: Vec<[f64; 2]> = population.iter().map(|(_, at)| [at.attack, at.realism]).collect();
                    let order = ordered(&points);
                    // Of those that stand alike the latest goes.
                    let keeps = |worst: usize, next: usize| {
                        !before(order[worst], order[next]) && before(order[next], order[worst])
                    };
                    let worst = (1..order.len()).fold(0, |worst, next| if keeps(worst, next) { worst } else { next });
                    population.remove(worst);
                }
                population.iter().any(|(kept, _)| *kept == id)
            }
        }
    }
}

fn member(options: &SearchOptions, child: Child<'_>) -> Member {
    let Objectives { attack, realism } = child.objectives;
    let metrics = BTreeMap::from([("attack".to_string(), attack), ("realism".to_string(), realism)]);
    let fitness = options.scalar(child.objectives);
    Member { id: child.solution.to_string(), code: child.text, metrics, fitness, copy_of: None }
}

/// The program behind a member, which may be a copy that migrated.
fn solution(database: &Database, id: &str) -> SolutionId {
    let original = database.member(id).and_then(|member| member.copy_of.clone());
    SolutionId::new(original.unwrap_or_else(|| id.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Seed;

    fn options(method: Method) -> SearchOptions {
        SearchOptions {
            method,
            rollouts: None,
            attack_weight: Some(0.5),
            population: Some(3),
            edits_max: None,
            tuning: None,
            openevolve: None,
        }
    }

    fn child(solution: &SolutionId, [attack, realism]: [f64; 2]) -> Child<'_> {
        Child { solution, objectives: Objectives { attack, realism }, text: solution.to_string(), iteration: 1 }
    }

    #[test]
    fn nsga2_keeps_the_spread_of_the_front_and_refuses_who_is_dominated() {
        let options = options(Method::Nsga2);
        let mut stream = Seed(1).stream(&["test"]);
        let names: Vec<SolutionId> = ["parent", "a", "b", "c", "d"].map(SolutionId::new).to_vec();
        let mut state = SearchState::begin(&options, child(&names[0], [0.1, 0.9]), &mut stream).unwrap();
        assert!(state.consider(&options, child(&names[1], [0.9, 0.1]), &mut stream));
        assert!(state.consider(&options, child(&names[2], [0.5, 0.5]), &mut stream));
        // Dominated by the last one: the population is full.
        assert!(!state.consider(&options, child(&names[3], [0.4, 0.4]), &mut stream));
        // Dominates it: takes its place.
        assert!(state.consider(&options, child(&names[4], [0.6, 0.6]), &mut stream));
        let SearchState::Nsga2(population) = &state else { panic!("a population") };
        assert_eq!(population.iter().map(|(id, _)| id.as_str()).collect::<Vec<_>>(), ["parent", "a", "d"]);
    }

    #[test]
    fn nsga2_keeps_the_earlier_of_two_that_stand_alike() {
        let options = SearchOptions { population: Some(2), ..options(Method::Nsga2) };
        let mut stream = Seed(1).stream(&["test"]);
        let names: Vec<SolutionId> = ["parent", "behind", "copy"].map(SolutionId::new).to_vec();
        let mut state = SearchState::begin(&options, child(&names[0], [0.5, 0.5]), &mut stream).unwrap();
        assert!(state.consider(&options, child(&names[1], [0.4, 0.4]), &mut stream));
        assert!(!state.consider(&options, child(&names[2], [0.4, 0.4]), &mut stream));
    }

    #[test]
    fn what_prompts_are_told_of_the_score_names_its_weights() {
        let described = |method, attack_weight| SearchOptions { attack_weight, ..options(method) }.described();
        assert_eq!(described(Method::Pareto, None), None);
        assert!(described(Method::OpenEvolve, Some(0.7)).unwrap().contains("0.7 A + 0.3 R"));
        assert!(described(Method::AttackOnly, None).unwrap().contains("more attack"));
        assert!(described(Method::Nsga2, None).unwrap().contains("NSGA-II"));
    }

    #[test]
    fn a_score_weighs_attack_against_realism_and_is_attack_alone_without_a_weight() {
        let weighed = |attack_weight| SearchOptions { attack_weight, ..options(Method::HillClimbing) };
        let of = Objectives { attack: 0.75, realism: 0.5 };
        assert_eq!(weighed(Some(0.25)).scalar(of), 0.5625, "a quarter of 0.75 and three quarters of 0.5");
        assert_eq!((weighed(Some(1.0)).scalar(of), weighed(None).scalar(of)), (0.75, 0.75));
    }

    #[test]
    fn openevolves_islands_take_turns_and_its_question_shows_others_and_the_best() {
        let openevolve = super::super::super::openevolve::OpenEvolveOptions {
            num_islands: 2,
            archive_size: 10,
            population_size: 100,
            feature_dimensions: vec!["attack".into()],
            feature_bins: 10,
            migration_interval: 50,
            migration_rate: 0.1,
            diversity_reference_size: 20,
            exploration_ratio: 1.0,
            exploitation_ratio: 0.0,
            elite_selection_ratio: 0.1,
        };
        let options = SearchOptions { openevolve: Some(openevolve), ..options(Method::OpenEvolve) };
        let mut stream = Seed(1).stream(&["test"]);
        let names: Vec<SolutionId> = ["parent", "a", "b", "c", "d"].map(SolutionId::new).to_vec();
        let mut state = SearchState::begin(&options, child(&names[0], [0.1, 0.1]), &mut stream).unwrap();
        for (iteration, (name, attack)) in names[1..].iter().zip([0.9, 0.3, 0.7, 0.8]).enumerate() {
            let child = Child { iteration: iteration + 1, ..child(name, [attack, attack]) };
            assert!(state.consider(&options, child, &mut stream));
        }
        let found = serde_json::to_value(&state).unwrap();
        assert_eq!(found["open_evolve"]["islands"], serde_json::json!([["parent", "b", "d"], ["a", "c"]]));
        assert_eq!(found["open_evolve"]["generations"], serde_json::json!([2, 2]));
        for iteration in 0..40 {
            let drawn = state.draw(iteration, &mut stream).unwrap();
            let island: &[&str] = [&["parent", "b", "d"] as &[&str], &["a", "c"]][iteration % 2];
            assert!(island.contains(&drawn.parent.as_str()), "{iteration}: {drawn:?}");
            let mut shown: Vec<&str> = drawn.shown.iter().map(SolutionId::as_str).collect();
            assert_eq!(shown.len(), island.len(), "nobody twice: {shown:?}");
            shown.sort_by_key(|name| island.iter().position(|other| other == name));
            assert_eq!(shown, island, "inspirations and the best three are all of a small island");
        }
    }

    #[test]
    fn a_tournament_prefers_the_front() {
        let population = vec![
            (SolutionId::new("front"), Objectives { attack: 0.9, realism: 0.9 }),
            (SolutionId::new("behind"), Objectives { attack: 0.1, realism: 0.1 }),
        ];
        let mut state = SearchState::Nsga2(population);
        let mut stream = Seed(1).stream(&["test"]);
        let won = (0..400).filter(|_| state.draw(0, &mut stream).unwrap().parent.as_str() == "front").count();
        // Only a tournament of the other with itself lets it win: a quarter.
        assert!((260..=340).contains(&won), "{won}");
    }
}
