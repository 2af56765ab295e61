//! Progress of a run on stderr, from its start: which epoch of how many, the share done, the rate, the time left until the run ends, with the
//! choice of programs and the held-out scenes that follow the epochs. On a terminal
//! one moving line, which names the run folder too where there is room, and a line that stays for each epoch; in a file or pipe
//! a line for each piece of news. A model that takes its time is told of answer by answer: an epoch of a small local model
//! is an hour.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crate::cli::terminal::outside::escaped;
use crate::cli::terminal::width::{USUAL, stderr_width};
use crate::cli::terminal::{answer::progress, result_text, timed::timed};
use crate::epoch::{Progress, RolloutCounts, Study};
use crate::llm::{Ask, AskError, DraftJudge, DrawSlot, Reply, Request};
use crate::text::counted;

/// The bar, whose words are cut to the room beside it before they are shown.
const LOOK: &str = "{bar:10} {wide_msg}";
/// Characters of a line that the bar takes.
const BAR: usize = 11;
/// The least that is worth showing of a folder's name.
const NAME_MIN: usize = 7;

/// Answers that take at least this long are reported, which recorded answers and those from rules do not.
const SLOW: Duration = Duration::from_secs(2);

/// Tells what happens in a run.
pub struct MovingLine {
    /// `None` where stderr is no terminal.
    bar: Option<ProgressBar>,
    /// Name of the run folder.
    place: String,
    way: Way,
    begun: Instant,
    /// Proposals that were judged, those of them that were accepted, and rollouts that were simulated for them.
    done: AtomicU64,
    accepted: AtomicU64,
    simulated: AtomicU64,
    /// Proposals among them of an earlier try, while nothing had to be simulated, and the milliseconds that they took.
    again: (AtomicU64, AtomicU64),
    /// Answers that took their time.
    answered: AtomicU64,
}

impl MovingLine {
    /// Begins to tell of a run in this folder.
    #[allow(clippy::disallowed_methods)]
    pub fn new(study: &Study, folder: &Path) -> MovingLine {
        let way = Way::of(study);
        let bar = std::io::stderr().is_terminal().then(|| bar(way.proposals(), ProgressDrawTarget::stderr()));
        let place = folder.file_name().unwrap_or(folder.as_os_str()).to_string_lossy().into_owned();
        let line = MovingLine {
            bar,
            place,
            way,
            begun: Instant::now(),
            done: 0.into(),
            accepted: 0.into(),
            simulated: 0.into(),
            again: Default::default(),
            answered: 0.into(),
        };
        match &line.bar {
            Some(bar) => {
                bar.set_message(line.words(&[]));
                bar.tick();
            }
            None => progress(line.standing().whole),
        }
        line
    }

    /// One piece of news, and the rollouts that the run rested on so far.
    pub fn tell(&self, news: &Progress, rollouts: RolloutCounts) {
        if let Progress::Attempt { accepted, .. } = news {
            self.done.fetch_add(1, Ordering::Relaxed);
            self.accepted.fetch_add(u64::from(*accepted), Ordering::Relaxed);
            self.simulated.store(rollouts.simulated as u64, Ordering::Relaxed);
        }
        if rollouts.simulated == 0 {
            self.again.0.store(self.done.load(Ordering::Relaxed), Ordering::Relaxed);
            self.again.1.store(self.begun.elapsed().as_millis() as u64, Ordering::Relaxed);
        }
        let text = result_text::progress(news);
        match (&self.bar, news) {
            (Some(bar), Progress::Attempt { .. }) => {
                bar.set_position(self.done.load(Ordering::Relaxed));
                let rollouts = counted(rollouts.reused + rollouts.simulated, "rollout");
                bar.set_message(self.words(&[&rollouts, text.trim()]));
            }
            (Some(bar), Progress::Choosing { done, all } | Progress::Opening { done, all }) => {
                bar.set_length(*all as u64);
                bar.set_position(*done as u64);
                bar.set_message(self.words(&[text.trim()]));
            }
            (Some(bar), _) => bar.suspend(|| progress(text)),
            (None, Progress::Settled { .. }) => progress(format!("{text}; {}", self.standing().whole)),
            (None, _) => progress(text),
        }
    }

    /// Returns the text of the moving line, cut to the terminal.
    fn words(&self, news: &[&str]) -> String {
        let room = stderr_width().unwrap_or(USUAL).saturating_sub(BAR);
        escaped(&words(&self.standing(), &self.place, news, room)).into_owned()
    }

    fn standing(&self) -> Standing {
        let of = |count: &AtomicU64| count.load(Ordering::Relaxed);
        let (done, seconds) = (of(&self.done), self.begun.elapsed().as_secs_f64());
        let again = (of(&self.again.0), of(&self.again.1) as f64 / 1e3);
        let labels = self.way.labels_behind(done, of(&self.accepted));
        let label_s = if of(&self.simulated) == 0 { 0.0 } else { (seconds - again.1) / of(&self.simulated) as f64 };
        self.way.standing(done, seconds, again, labels * label_s)
    }

    /// A model that told its answer, or failed to, after so long.
    fn heard(&self, request: &Request, took: Duration) {
        let count = self.answered.fetch_add(1, Ordering::Relaxed) + 1;
        let text = answer_text(count, &request.slot, took);
        match &self.bar {
            Some(bar) => bar.set_message(self.words(&[&text])),
            None => progress(text),
        }
    }

    /// Takes the line away, so that what follows stands alone.
    pub fn finish(&self) {
        self.bar.iter().for_each(ProgressBar::finish_and_clear);
    }
}

/// Whoever answers, with the line that tells of slow answers.
pub struct Heard<'a> {
    /// Source of the answers.
    pub ask: &'a dyn Ask,
    /// Line that tells of slow answers.
    pub line: &'a MovingLine,
}

impl Ask for Heard<'_> {
    fn ask_with(&self, request: &Request, judge: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
        let (reply, took) = timed(|| self.ask.ask_with(request, judge));
        if took >= SLOW {
            self.line.heard(request, took);
        }
        reply
    }
}

/// A failed run takes its line away too.
impl Drop for MovingLine {
    fn drop(&mut self) {
        self.finish();
    }
}

/// Work that lies before a run. Proposals are the unit: their number is known from the start.
#[derive(Clone, Copy, Debug)]
struct Way {
    epochs: u64,
    /// Proposals of all lineages in an epoch.
    each: u64,
    lineages: u64,
    /// Most programs of a lineage among which is chosen, beside the parent.
    finalists: u64,
    /// Scenes on which is chosen and on which accepted programs have no labels yet, and held-out ones.
    choosing: u64,
    held_out: u64,
}

/// Programs of a lineage that meet the held-out scenes: the parent, the chosen one and the two behind it.
const REPORTED: f64 = 4.0;

impl Way {
    fn of(study: &Study) -> Way {
        let lineages = study.lineages.len() as u64;
        let known = study.judged_on(study.budget.epochs.saturating_sub(1));
        let unseen = study.choosing().iter().filter(|place| !known.contains(place));
        Way {
            epochs: u64::from(study.budget.epochs),
            each: u64::from(study.budget.slots) * lineages,
            lineages,
            finalists: study.budget.finalists as u64,
            choosing: unseen.count() as u64,
            held_out: study.held_out.len() as u64,
        }
    }

    /// Returns the number of labels that choice and held-out scenes may need, if proposals are accepted as often as so far.
    fn labels_behind(self, done: u64, accepted: u64) -> f64 {
        let share = accepted as f64 / done.max(1) as f64;
        let descendants = share * self.proposals() as f64 / self.lineages.max(1) as f64;
        let finalists = 1.0 + descendants.min(self.finalists as f64);
        let reported = REPORTED.min(finalists);
        self.lineages as f64 * (finalists * self.choosing as f64 + reported * self.held_out as f64)
    }

    fn proposals(self) -> u64 {
        self.epochs * self.each
    }

    /// Returns the standing of a run that has judged so many proposals in so many seconds. The rate is the mean since
    /// it began. If it goes on from an earlier try, `again` of them were only read, and the rate is that of the others. What follows the
    /// epochs takes `behind_s`, s.
    fn standing(self, done: u64, seconds: f64, again: (u64, f64), behind_s: f64) -> Standing {
        let all = self.proposals();
        if done >= all {
            let (all, epochs) = (counted(all as usize, "proposal"), counted(self.epochs as usize, "epoch"));
            return Standing::of(format!("all of {all} in {epochs} judged"), "100 %".into());
        }
        let epoch = done / self.each.max(1) + 1;
        let share = 100.0 * done as f64 / all as f64;
        let begun = format!("epoch {epoch} of {}, {share:.0} % of {}", self.epochs, counted(all as usize, "proposal"));
        let short = format!("{share:.0} %");
        let (known, known_s) = if again.0 < done { again } else { (0, 0.0) };
        if done == 0 || seconds <= known_s {
            return Standing::of(begun, short);
        }
        let rate = (done - known) as f64 / (seconds - known_s);
        let pace = format!("{}, {} left", rated(rate), lasting((all - done) as f64 / rate + behind_s));
        Standing::of(format!("{begun}, {pace}"), format!("{short}, {pace}"))
    }
}

/// Standing of a run: share, rate and time left, with epoch and number of proposals and without.
struct Standing {
    whole: String,
    short: String,
}

impl Standing {
    fn of(whole: String, short: String) -> Standing {
        Standing { whole, short }
    }
}

/// The words of the moving line: the standing always, then as much of the folder's name and of the news as there is room for.
fn words(standing: &Standing, place: &str, news: &[&str], room: usize) -> String {
    let length = |text: &str| text.chars().count();
    let mut out = if length(&standing.whole) <= room { standing.whole.clone() } else { standing.short.clone() };
    for part in news.iter().filter(|part| !part.is_empty()) {
        if length(&out) + 2 + length(part) + 2 + NAME_MIN <= room {
            out.push_str(&format!(", {part}"));
        }
    }
    let left = room.saturating_sub(length(&out) + 2);
    match length(place) {
        short if short <= left => out.push_str(&format!("  {place}")),
        _ if left >= NAME_MIN => out.push_str(&format!("  {}…", place.chars().take(left - 1).collect::<String>())),
        _ => {}
    }
    out
}

/// Returns what is said of an answer; answers are counted since the command began.
fn answer_text(count: u64, of: &DrawSlot, took: Duration) -> String {
    let seconds = lasting(took.as_secs_f64());
    format!("answer {count}: {}/e{}s{} {} round {}, after {seconds}", of.lineage, of.epoch, of.slot, of.role, of.round)
}

/// A rate in the unit in which it is at least one.
fn rated(per_s: f64) -> String {
    match per_s {
        fast if fast >= 1.0 => format!("{fast:.1} a second"),
        slow if slow * 60.0 >= 1.0 => format!("{:.1} a minute", slow * 60.0),
        rare => format!("{:.1} an hour", rare * 3600.0),
    }
}

/// A time in the unit in which two digits say enough.
fn lasting(seconds: f64) -> String {
    match seconds {
        short if short < 120.0 => format!("{short:.0} s"),
        longer if longer < 7200.0 => format!("{:.0} min", longer / 60.0),
        long => format!("{:.1} h", long / 3600.0),
    }
}

fn bar(proposals: u64, target: ProgressDrawTarget) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(proposals), target);
    let style = ProgressStyle::with_template(LOOK).unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.set_style(style);
    bar
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_standing_names_epoch_share_rate_and_time_left() {
        let way = way(4, 10);
        let standing = |done, seconds| way.standing(done, seconds, (0, 0.0), 0.0).whole;
        assert_eq!(standing(0, 3.0), "epoch 1 of 4, 0 % of 40 proposals");
        assert_eq!(standing(9, 3.0), "epoch 1 of 4, 22 % of 40 proposals, 3.0 a second, 10 s left");
        assert_eq!(standing(10, 100.0), "epoch 2 of 4, 25 % of 40 proposals, 6.0 a minute, 5 min left");
        assert_eq!(standing(39, 390_000.0), "epoch 4 of 4, 98 % of 40 proposals, 0.4 an hour, 2.8 h left");
        assert_eq!(standing(40, 1.0), "all of 40 proposals in 4 epochs judged");
        // What follows the epochs counts, too: 31 proposals at 3 a second and 50 s.
        assert!(way.standing(9, 3.0, (0, 0.0), 50.0).whole.ends_with("3.0 a second, 60 s left"));
    }

    fn way(epochs: u64, each: u64) -> Way {
        Way { epochs, each, lineages: 2, finalists: 6, choosing: 100, held_out: 50 }
    }

    #[test]
    fn labels_behind_the_epochs_are_those_of_who_may_be_chosen() {
        let way = way(4, 10);
        assert_eq!(way.labels_behind(10, 0), 2.0 * (100.0 + 50.0), "the parents alone");
        assert_eq!(way.labels_behind(10, 1), 2.0 * (3.0 * 100.0 + 3.0 * 50.0), "two of twenty a lineage");
        assert_eq!(way.labels_behind(10, 10), 2.0 * (7.0 * 100.0 + 4.0 * 50.0), "as many as the budget takes");
    }

    #[test]
    fn a_moving_line_always_says_share_rate_and_time_left() {
        let standing = way(6, 18).standing(24, 12.0, (0, 0.0), 0.0);
        let news = ["3344 rollouts", "adv_bmt-idm/e5s4   evaluated attack 0.375  realism 0.8984  accepted"];
        let place = "a_study_with_a_long_name_of_its_own-58c89c47";
        for room in 40..120 {
            let text = words(&standing, place, &news, room);
            assert!(text.chars().count() <= room, "{room}: {text}");
            assert!(text.contains("22 %") && text.contains("2.0 a second, 42 s left"), "{room}: {text}");
        }
        let at_80 = words(&standing, place, &news, 80 - BAR);
        assert_eq!(at_80, "epoch 2 of 6, 22 % of 108 proposals, 2.0 a second, 42 s left  a_stud…");
        let wide = words(&standing, "mine-12", &news, 160);
        assert!(
            wide.ends_with(
                "42 s left, 3344 rollouts, adv_bmt-idm/e5s4   evaluated attack 0.375  realism 0.8984  accepted  mine-12"
            ),
            "{wide}"
        );
    }

    #[test]
    fn what_was_only_read_again_is_no_part_of_the_rate() {
        let way = way(4, 10);
        // 20 read in a second, then 4 in 40 seconds: 16 more take 160.
        assert_eq!(
            way.standing(24, 41.0, (20, 1.0), 0.0).whole,
            "epoch 3 of 4, 60 % of 40 proposals, 6.0 a minute, 3 min left"
        );
        // Nothing but reading so far: at that rate.
        assert_eq!(
            way.standing(20, 1.0, (20, 1.0), 0.0).whole,
            "epoch 3 of 4, 50 % of 40 proposals, 20.0 a second, 1 s left"
        );
    }

    #[test]
    fn an_answer_is_told_with_whose_it_is_and_how_long_it_took() {
        let of = DrawSlot { lineage: "cat-idm".into(), epoch: 2, slot: 3, role: "repair".into(), round: 1 };
        let answer = answer_text(7, &of, Duration::from_millis(95_400));
        assert_eq!(answer, "answer 7: cat-idm/e2s3 repair round 1, after 95 s");
    }
}
