//! Tokens that live models have used, kept on disk, and the cap over them. A call is reserved at its upper bound before it is made.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use super::protocol::unanswerable;
use crate::llm::{ClientOptions, ModelError, SpendCap};
use crate::store;

const FORMAT: &str = "evodrive-spend/1";
const FILE_BYTES_MAX: u64 = 1 << 20;

/// Tokens of prompts and of answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tokens {
    /// Tokens of the prompts, those of caches included.
    pub input: u64,
    /// Tokens of the answers.
    pub output: u64,
    /// Those of the prompts that were read from a cache.
    #[serde(default, skip_serializing_if = "is_none")]
    pub cached: u64,
    /// Those of the prompts that were written into one.
    #[serde(default, skip_serializing_if = "is_none")]
    pub written: u64,
}

fn is_none(tokens: &u64) -> bool {
    *tokens == 0
}

impl Tokens {
    /// Tokens of a prompt without a cache, and of its answer.
    pub const fn new(input: u64, output: u64) -> Tokens {
        Tokens { input, output, cached: 0, written: 0 }
    }

    fn plus(self, other: Tokens) -> Tokens {
        self.with(other, u64::saturating_add)
    }

    fn minus(self, other: Tokens) -> Tokens {
        self.with(other, u64::saturating_sub)
    }

    fn with(self, other: Tokens, of: impl Fn(u64, u64) -> u64) -> Tokens {
        Tokens {
            input: of(self.input, other.input),
            output: of(self.output, other.output),
            cached: of(self.cached, other.cached),
            written: of(self.written, other.written),
        }
    }
}

/// US dollars per million tokens.
#[derive(Clone, Copy, Debug)]
struct Price {
    input: f64,
    output: f64,
    cached: f64,
    written: f64,
}

impl Price {
    /// Returns the declared prices. Tokens that a cache reads or writes cost as much as any prompt if nothing else is declared.
    fn of(options: &ClientOptions) -> Price {
        let input = options.input_usd_per_million;
        Price {
            input,
            output: options.output_usd_per_million,
            cached: options.cached_input_usd_per_million.unwrap_or(input),
            written: options.cache_write_usd_per_million.unwrap_or(input),
        }
    }

    fn usd(self, tokens: Tokens) -> f64 {
        let plain = tokens.input.saturating_sub(tokens.cached).saturating_sub(tokens.written);
        let prompt =
            plain as f64 * self.input + tokens.cached as f64 * self.cached + tokens.written as f64 * self.written;
        (prompt + tokens.output as f64 * self.output) / 1e6
    }
}

/// The file: what is spent, and what a killed process may have spent.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Page {
    format: String,
    models: BTreeMap<String, Tokens>,
}

#[derive(Default)]
struct State {
    /// By model, with open reservations.
    used: BTreeMap<String, Tokens>,
    open: usize,
}

/// The ledger of one run folder.
pub struct Ledger {
    path: PathBuf,
    cap: SpendCap,
    prices: BTreeMap<String, Price>,
    state: Mutex<State>,
    settled: Condvar,
}

impl Ledger {
    /// Continues the file at `path`, if there is one. `models` gives the prices.
    pub fn open<'m>(
        path: PathBuf,
        cap: SpendCap,
        models: impl IntoIterator<Item = (&'m str, &'m ClientOptions)>,
    ) -> Result<Ledger, ModelError> {
        let prices = models.into_iter().map(|(name, options)| (name.to_string(), Price::of(options))).collect();
        let mut used = BTreeMap::new();
        if path.exists() {
            let bytes = store::read_bounded(&path, FILE_BYTES_MAX).map_err(unanswerable)?;
            let page: Page = serde_json::from_slice(&bytes).map_err(|error| {
                unanswerable(format!("{}: {error}; restore the file, or delete it to count from zero", path.display()))
            })?;
            if page.format != FORMAT {
                return Err(unanswerable(format!("{}: format {:?}, expected {FORMAT}", path.display(), page.format)));
            }
            used = page.models;
        }
        let state = Mutex::new(State { used, open: 0 });
        Ok(Ledger { path, cap, prices, state, settled: Condvar::new() })
    }

    /// Reserves the upper bound of a call. If only running calls prevent that, it waits until they are settled.
    pub fn reserve(&self, model: &str, bound: Tokens) -> Result<Reservation<'_>, ModelError> {
        let mut state = self.lock();
        loop {
            let mut after = state.used.clone();
            let entry = after.entry(model.to_string()).or_default();
            *entry = entry.plus(bound);
            match self.over(&after, &state.used) {
                None => {
                    // It is on disk before the call is made, so a killed process cannot lose what it may have spent.
                    self.write(&after)?;
                    *state = State { used: after, open: state.open + 1 };
                    return Ok(Reservation { ledger: self, model: model.to_string(), bound, settled: false });
                }
                Some(reason) if state.open == 0 => return Err(ModelError::SpendCap { reason }),
                Some(_) => state = self.settled.wait(state).unwrap_or_else(PoisonError::into_inner),
            }
        }
    }

    /// Returns the tokens used so far, by model, open reservations included.
    pub fn used(&self) -> BTreeMap<String, Tokens> {
        self.lock().used.clone()
    }

    /// US dollars of `used`, by the prices of the experiment file.
    pub fn usd(&self, used: &BTreeMap<String, Tokens>) -> f64 {
        used.iter().filter_map(|(name, tokens)| Some(self.prices.get(name)?.usd(*tokens))).sum()
    }

    /// Why `after` exceeds the cap, if it does.
    fn over(&self, after: &BTreeMap<String, Tokens>, before: &BTreeMap<String, Tokens>) -> Option<String> {
        let tokens = |used: &BTreeMap<String, Tokens>| {
            used.values().fold(0_u64, |sum, t| sum.saturating_add(t.input).saturating_add(t.output))
        };
        let (tokens_before, tokens_after) = (tokens(before), tokens(after));
        if tokens_after > self.cap.tokens_max {
            let most = self.cap.tokens_max;
            return Some(format!(
                "{tokens_before} tokens are used, the next request could take {} more, spend.tokens_max is {most}",
                tokens_after - tokens_before
            ));
        }
        let (usd_before, usd_after) = (self.usd(before), self.usd(after));
        (usd_after > self.cap.usd_max).then(|| {
            let (next, most) = (usd_after - usd_before, self.cap.usd_max);
            format!("{usd_before:.4} USD are used, the next request could cost {next:.4} more, spend.usd_max is {most}")
        })
    }

    fn settle(&self, model: &str, bound: Tokens, actual: Tokens) {
        let mut state = self.lock();
        let entry = state.used.entry(model.to_string()).or_default();
        *entry = entry.minus(bound).plus(actual);
        state.open = state.open.saturating_sub(1);
        // If this cannot be written, the file still holds the upper bound, so it never holds too little.
        let _ = self.write(&state.used);
        self.settled.notify_all();
    }

    fn write(&self, used: &BTreeMap<String, Tokens>) -> Result<(), ModelError> {
        let page = Page { format: FORMAT.into(), models: used.clone() };
        let bytes = serde_json::to_vec_pretty(&page).map_err(unanswerable)?;
        store::write_atomic(&self.path, &bytes).map_err(unanswerable)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The reserved upper bound of a call. If it is dropped without settlement it counts in full, because the fate of the
/// call is unknown.
pub struct Reservation<'a> {
    ledger: &'a Ledger,
    model: String,
    bound: Tokens,
    settled: bool,
}

impl Reservation<'_> {
    /// Replaces the bound by what was used.
    pub fn settle(mut self, actual: Tokens) {
        self.settled = true;
        self.ledger.settle(&self.model, self.bound, actual);
    }
}

impl Drop for Reservation<'_> {
    fn drop(&mut self) {
        if !self.settled {
            self.ledger.settle(&self.model, self.bound, self.bound);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ledger(dir: &std::path::Path, usd_max: f64, tokens_max: u64) -> Ledger {
        let options = ClientOptions {
            input_usd_per_million: 1.0,
            output_usd_per_million: 10.0,
            ..ClientOptions::at("http://localhost")
        };
        Ledger::open(dir.join("spend.json"), SpendCap { usd_max, tokens_max }, [("m", &options)]).unwrap()
    }

    const CALL: Tokens = Tokens::new(1_000, 100);

    #[test]
    fn what_a_cache_read_or_wrote_has_a_price_of_its_own() {
        let tokens = Tokens { input: 1_000_000, output: 0, cached: 600_000, written: 300_000 };
        let price = Price { input: 3.0, output: 15.0, cached: 0.3, written: 3.75 };
        let usd = price.usd(tokens);
        assert!((usd - (0.1 * 3.0 + 0.6 * 0.3 + 0.3 * 3.75)).abs() < 1e-9, "{usd}");
        let mut options = ClientOptions::at("http://localhost");
        options.input_usd_per_million = 3.0;
        assert_eq!(Price::of(&options).usd(tokens), 3.0);
    }

    #[test]
    fn a_call_that_could_exceed_the_cap_is_not_made() {
        let dir = tempfile::tempdir().unwrap();
        // A call costs at most 0.002 USD; it turns out to cost 0.0006.
        let ledger = ledger(dir.path(), 0.0025, u64::MAX);
        ledger.reserve("m", CALL).unwrap().settle(Tokens::new(500, 10));
        assert_eq!(ledger.usd(&ledger.used()), 0.0006);
        let Err(ModelError::SpendCap { reason }) = ledger.reserve("m", CALL).map(|_| ()) else {
            panic!("expected the cap")
        };
        assert_eq!(reason, "0.0006 USD are used, the next request could cost 0.0020 more, spend.usd_max is 0.0025");
    }

    #[test]
    fn tokens_are_capped_where_they_cost_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let ledger = ledger(dir.path(), f64::MAX, 2_000);
        ledger.reserve("free", CALL).unwrap().settle(CALL);
        assert!(matches!(ledger.reserve("free", CALL), Err(ModelError::SpendCap { .. })));
    }

    #[test]
    fn a_killed_call_counts_in_full_and_the_count_goes_on() {
        let dir = tempfile::tempdir().unwrap();
        let first = ledger(dir.path(), 1.0, 10_000);
        std::mem::forget(first.reserve("m", CALL).unwrap());
        let second = ledger(dir.path(), 1.0, 10_000);
        assert_eq!(second.used()["m"], CALL);
        drop(second.reserve("m", CALL).unwrap());
        second.reserve("m", CALL).unwrap().settle(Tokens::default());
        assert_eq!(ledger(dir.path(), 1.0, 10_000).used()["m"], CALL.plus(CALL));
    }

    #[test]
    fn a_call_waits_for_one_under_way_before_it_is_denied() {
        let dir = tempfile::tempdir().unwrap();
        let ledger = ledger(dir.path(), 1.0, 1_200);
        let first = ledger.reserve("m", CALL).unwrap();
        let second = std::thread::scope(|threads| {
            let waiting = threads.spawn(|| ledger.reserve("m", CALL).map(|call| call.settle(CALL)).is_ok());
            first.settle(Tokens::new(50, 50));
            waiting.join().unwrap()
        });
        assert!(second);
    }

    #[test]
    fn a_ledger_that_cannot_be_read_is_an_error_with_its_path() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("spend.json"), "{}").unwrap();
        let cap = SpendCap { usd_max: 1.0, tokens_max: 1 };
        let error = Ledger::open(dir.path().join("spend.json"), cap, []).err().unwrap();
        assert!(error.to_string().contains("spend.json"), "{error}");
    }
}
