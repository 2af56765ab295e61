//! Ctrl-C, and the limit of a file's size. No other file handles signals. After the first Ctrl-C, work in progress is finished and kept, no new work begins, and the
//! command ends with exit code 130. A reply or a planner's decision that is awaited has a few seconds left. The second one ends the
//! program at once; records on disk survive that.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use crate::cli::terminal::exit::Failure;
use crate::llm::{Ask, AskError, DraftJudge, Reply, Request};

/// How long a reply or a decision that was asked for may still take after Ctrl-C: replies cost money, and most come in time.
const GRACE: Duration = Duration::from_secs(3);
/// How often somebody who waits looks whether that time is over.
const LOOK: Duration = Duration::from_millis(200);

/// Flags that Ctrl-C sets once somebody has begun to listen.
#[derive(Clone, Debug, Default)]
pub struct Interrupt {
    asked: Arc<AtomicBool>,
    /// Nothing from outside is waited for any more.
    overdue: Arc<AtomicBool>,
}

/// Why a wait ended without what was waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Waited {
    /// The time was up.
    Late,
    /// Whoever was waited for is gone.
    Gone,
    /// Ctrl-C was pressed, and the time that was left then is up.
    Stopped,
}

impl Interrupt {
    /// Takes Ctrl-C over from the system until the program ends.
    ///
    /// # Errors
    /// The system gives no handler, or no thread that waits for the signal.
    pub fn listen() -> Result<Interrupt, Failure> {
        let interrupt = Interrupt::default();
        hear(interrupt.clone())?;
        Ok(interrupt)
    }

    /// Returns `true` if Ctrl-C was pressed.
    pub fn is_asked(&self) -> bool {
        self.asked.load(Ordering::SeqCst)
    }

    /// Returns `true` if nothing outside the program is waited for any more.
    pub fn is_overdue(&self) -> bool {
        self.overdue.load(Ordering::SeqCst)
    }

    /// Waits for what somebody outside the program will say: until `deadline`, where there is one, and not long after Ctrl-C.
    ///
    /// # Errors
    /// The reason why the wait ended.
    pub fn wait<T>(&self, from: &Receiver<T>, deadline: Option<Instant>) -> Result<T, Waited> {
        loop {
            // Somebody who always answers at once is stopped too.
            if self.is_overdue() {
                return Err(Waited::Stopped);
            }
            let left = deadline.map_or(LOOK, |deadline| deadline.saturating_duration_since(now()));
            match from.recv_timeout(left.min(LOOK)) {
                Ok(said) => return Ok(said),
                Err(RecvTimeoutError::Disconnected) => return Err(Waited::Gone),
                Err(RecvTimeoutError::Timeout) if deadline.is_some() && left <= LOOK => return Err(Waited::Late),
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// Notes that it was pressed, and says whether it was so before.
    #[cfg(any(unix, test))]
    fn ask(&self) -> bool {
        self.asked.swap(true, Ordering::SeqCst)
    }

    /// Ends every wait when the time that is left is over.
    #[cfg(unix)]
    fn end_waits(&self) {
        let overdue = self.overdue.clone();
        let late = move || {
            std::thread::sleep(GRACE);
            overdue.store(true, Ordering::SeqCst);
        };
        // Without a thread for it nobody is waited for from now on.
        if crate::kernel::threads::beside(late).is_err() {
            self.overdue.store(true, Ordering::SeqCst);
        }
    }
}

/// Makes a write beyond the limit of a file's size (`ulimit -f`) an error, which names the file, and not the program's end.
///
/// # Errors
/// The system gives no handler.
#[cfg(unix)]
pub fn outlive_file_limits() -> std::io::Result<()> {
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default()).map(drop)
}

/// Elsewhere there is no such signal.
#[cfg(not(unix))]
pub fn outlive_file_limits() -> std::io::Result<()> {
    Ok(())
}

/// The clock, for time limits.
#[allow(clippy::disallowed_methods)]
pub fn now() -> Instant {
    Instant::now()
}

#[cfg(unix)]
fn hear(interrupt: Interrupt) -> Result<(), Failure> {
    use crate::cli::terminal::answer::progress;
    use crate::cli::terminal::exit::Exit;
    let mut signals = signal_hook::iterator::Signals::new([signal_hook::consts::SIGINT]).map_err(Failure::internal)?;
    crate::kernel::threads::beside(move || {
        for _ in signals.forever() {
            if interrupt.ask() {
                std::process::exit(Exit::Interrupted as i32);
            }
            interrupt.end_waits();
            progress(format!(
                "stopping: work in progress is finished and kept; replies have {} s left; press Ctrl-C again to stop at once",
                GRACE.as_secs()
            ));
        }
    })
    .map_err(Failure::internal)
}

/// Elsewhere the system ends the program, and the records are as after a kill.
#[cfg(not(unix))]
fn hear(_: Interrupt) -> Result<(), Failure> {
    Ok(())
}

/// Models that are asked nothing more once Ctrl-C was pressed. Answers that are under way are waited for a moment: they were paid
/// for.
pub struct Until<'a> {
    /// Source of the answers before that.
    pub ask: &'a dyn Ask,
    pub interrupt: &'a Interrupt,
}

impl Ask for Until<'_> {
    fn ask_with(&self, request: &Request, judge: Option<&dyn DraftJudge>) -> Result<Reply, AskError> {
        if self.interrupt.is_asked() { Err(AskError::Stopped) } else { self.ask.ask_with(request, judge) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_noted_once_and_every_copy_knows() {
        let interrupt = Interrupt::default();
        let copy = interrupt.clone();
        assert!(!copy.is_asked() && !interrupt.ask());
        assert!(copy.is_asked() && copy.ask());
    }

    #[test]
    fn a_wait_ends_with_what_comes_at_its_deadline_or_when_it_is_overdue() {
        let interrupt = Interrupt::default();
        let (to, from) = std::sync::mpsc::channel();
        to.send(7).unwrap();
        assert_eq!(interrupt.wait(&from, None), Ok(7));
        assert_eq!(interrupt.wait(&from, Some(now())), Err(Waited::Late));
        interrupt.ask();
        to.send(8).unwrap();
        assert_eq!(interrupt.wait(&from, None), Ok(8), "what was asked for is taken");
        interrupt.overdue.store(true, Ordering::SeqCst);
        to.send(9).unwrap();
        assert_eq!(interrupt.wait(&from, None), Err(Waited::Stopped), "who always answers is stopped, too");
        let fresh = Interrupt::default();
        drop(to);
        assert_eq!((fresh.wait(&from, None), fresh.wait(&from, None)), (Ok(9), Err(Waited::Gone)));
    }
}
