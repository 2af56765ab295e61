//! Counts and times the work of a run by lineage. The caller provides the clock; nothing that is counted here reaches an event or a
//! decision.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::llm::{Ask, AskError, DraftJudge, Reply, Request};
use crate::objects::{LineageId, cost::Work};

/// Time since a moment of the caller's choice.
pub type Clock<'a> = &'a (dyn Fn() -> Duration + Sync);

/// Cost of a run so far.
#[derive(Default)]
pub struct Meter<'a> {
    clock: Option<Clock<'a>>,
    spent: Mutex<Spent>,
}

#[derive(Default)]
struct Spent {
    /// When the last turn ended.
    turned: Duration,
    lineages: BTreeMap<LineageId, Work>,
}

impl<'a> Meter<'a> {
    /// Times from now on. [`Meter::default`] has no clock: it counts, and every time is 0.
    pub fn new(clock: Clock<'a>) -> Meter<'a> {
        Meter { clock: Some(clock), spent: Mutex::new(Spent { turned: clock(), lineages: BTreeMap::new() }) }
    }

    /// Returns the cost of each lineage so far.
    pub fn lineages(&self) -> BTreeMap<LineageId, Work> {
        self.spent().lineages.clone()
    }

    /// Ends a lineage's turn and charges it the time since the last turn's end.
    pub(in crate::epoch) fn turn(&self, lineage: &LineageId) {
        self.turns(&[lineage]);
    }

    /// Ends a turn that lineages had together: each is given an equal share of its time.
    pub(in crate::epoch) fn turns(&self, lineages: &[&LineageId]) {
        let now = self.now();
        let mut spent = self.spent();
        let took_s = now.saturating_sub(spent.turned).as_secs_f64() / lineages.len().max(1) as f64;
        spent.turned = now;
        for lineage in lineages {
            spent.lineages.entry((*lineage).clone()).or_default().wall_s += took_s;
        }
    }

    /// Does what compiles a program for one scene.
    pub(in crate::epoch) fn compile<T>(&self, lineage: &LineageId, work: impl FnOnce() -> T) -> T {
        let (done, took_s) = self.timed(work);
        self.add(lineage, |work| {
            work.compiled += 1;
            work.compile_s += took_s;
        });
        done
    }

    /// Does what simulates one rollout.
    pub(in crate::epoch) fn rollout<T>(&self, lineage: &LineageId, work: impl FnOnce() -> T) -> T {
        let (done, took_s) = self.timed(work);
        self.add(lineage, |work| {
            work.rollouts += 1;
            work.rollout_s += took_s;
        });
        done
    }

    /// Whoever answers, with what its answers to this lineage cost.
    pub(super) fn asking<'m>(&'m self, ask: &'m dyn Ask, lineage: &'m LineageId) -> Asking<'m, 'a> {
        Asking { meter: self, ask, lineage }
    }

    fn timed<T>(&self, work: impl FnOnce() -> T) -> (T, f64) {
        let start = self.now();
        let done = work();
        (done, self.now().saturating_sub(start).as_secs_f64())
    }

    fn now(&self) -> Duration {
        self.clock.map_or(Duration::ZERO, |clock| clock())
    }

    fn add(&self, lineage: &LineageId, more: impl FnOnce(&mut Work)) {
        more(self.spent().lineages.entry(lineage.clone()).or_default());
    }

    fn spent(&self) -> MutexGuard<'_, Spent> {
        self.spent.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An [`Ask`] whose answers are counted.
pub(in crate::epoch) struct Asking<'m, 'a> {
    meter: &'m Meter<'a>,
    ask: &'m dyn Ask,
    lineage: &'m LineageId,
}

impl Ask for Asking<'_, '_> {
    fn ask_with(&self, request: &Request, judge: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
        let (reply, took_s) = self.meter.timed(|| self.ask.ask_with(request, judge));
        let said = reply.as_ref().ok().and_then(|reply| reply.metadata.as_ref());
        let tokens = said.map_or((None, None), |metadata| (metadata.input_tokens, metadata.output_tokens));
        self.meter.add(self.lineage, |work| {
            work.answers += 1;
            work.model_s += took_s;
            work.input_tokens = work.input_tokens.saturating_add(tokens.0.unwrap_or(0));
            work.output_tokens = work.output_tokens.saturating_add(tokens.1.unwrap_or(0));
            let cached = said.and_then(|metadata| metadata.cached_input_tokens).unwrap_or(0);
            work.cached_input_tokens = work.cached_input_tokens.saturating_add(cached);
            work.cut_prompts += usize::from(said.is_some_and(|said| said.prompt_was_cut(request.prompt_bytes())));
        });
        reply
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::llm::{DrawSlot, Message, Metadata, ModelSpec, Schema};
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn work_and_turns_are_counted_by_lineage() {
        let ticks = AtomicU64::new(0);
        // Every look at this clock finds it a second later.
        let clock = || Duration::from_secs(ticks.fetch_add(1, Ordering::Relaxed));
        let meter = Meter::new(&clock);
        let (cat, king) = (LineageId::new("cat-idm"), LineageId::new("king-idm"));
        assert_eq!(meter.compile(&cat, || 7), 7);
        meter.rollout(&cat, || ());
        meter.rollout(&cat, || ());
        meter.turn(&cat);
        meter.turn(&king);
        let found = meter.lineages();
        let expected =
            Work { wall_s: 7.0, compiled: 1, compile_s: 1.0, rollouts: 2, rollout_s: 2.0, ..Work::default() };
        assert_eq!(found[&cat], expected);
        assert_eq!(found[&king], Work { wall_s: 1.0, ..Work::default() });
    }

    /// Says that it read this many tokens, of which some came from a cache.
    struct Says(u64);

    impl Ask for Says {
        fn ask_with(&self, request: &Request, _: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
            let metadata =
                Metadata { input_tokens: Some(self.0), cached_input_tokens: Some(self.0 / 2), ..Metadata::default() };
            let request = request.key().unwrap();
            Ok(Reply {
                request,
                response: request,
                bytes: b"{}".to_vec(),
                metadata: Some(metadata),
                sealed_metadata: None,
            })
        }
    }

    #[test]
    fn prompts_that_a_server_cut_are_counted() {
        let (meter, cat) = (Meter::default(), LineageId::new("cat-idm"));
        let message = Message { role: "user".into(), text: "word ".repeat(6_200).as_str().into() };
        let request = Request {
            adapter_version: 1,
            slot: DrawSlot { lineage: "cat-idm".into(), epoch: 0, slot: 0, role: "actor".into(), round: 0 },
            model: ModelSpec {
                name: "m".into(),
                kind: "openai_compatible".into(),
                model: "m".into(),
                sampling: BTreeMap::new(),
                response_format: None,
                body: BTreeMap::new(),
                here: Default::default(),
            },
            messages: vec![message],
            schema: Schema::new(serde_json::json!({})).unwrap(),
        };
        for tokens in [2048, 9_000, 2048] {
            meter.asking(&Says(tokens), &cat).ask(&request).unwrap();
        }
        let work = meter.lineages()[&cat];
        assert_eq!((work.answers, work.cut_prompts, work.cached_input_tokens), (3, 2, 2048 + 4_500));
    }

    #[test]
    fn a_clock_that_runs_backwards_takes_no_time() {
        let ticks = AtomicU64::new(1000);
        let clock = || Duration::from_secs(ticks.fetch_sub(1, Ordering::Relaxed));
        let meter = Meter::new(&clock);
        let cat = LineageId::new("cat-idm");
        meter.rollout(&cat, || ());
        meter.turn(&cat);
        assert_eq!(meter.lineages()[&cat], Work { rollouts: 1, ..Work::default() });
    }
}
