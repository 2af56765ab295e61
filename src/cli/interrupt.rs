//! Ctrl-C. No other file handles signals. After the first Ctrl-C, work in progress is finished and kept, no new work begins, and the
//! command ends with exit code 130. The second one ends the program at once; records on disk survive that.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::exit::Failure;
use crate::llm::{Ask, AskError, Reply, Request};

/// Whether Ctrl-C was pressed since somebody began to listen.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

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

    /// Whether it was pressed.
    pub fn is_asked(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }

    /// Notes that it was pressed, and says whether it was so before.
    #[cfg(any(unix, test))]
    fn ask(&self) -> bool {
        self.0.swap(true, Ordering::SeqCst)
    }
}

#[cfg(unix)]
fn hear(interrupt: Interrupt) -> Result<(), Failure> {
    use super::answer::progress;
    use super::exit::Exit;
    let mut signals = signal_hook::iterator::Signals::new([signal_hook::consts::SIGINT]).map_err(Failure::internal)?;
    crate::kernel::threads::beside(move || {
        for _ in signals.forever() {
            if interrupt.ask() {
                std::process::exit(Exit::Interrupted as i32);
            }
            progress("stopping: work in progress is finished and kept; press Ctrl-C again to stop at once");
        }
    })
    .map_err(Failure::internal)
}

/// Elsewhere the system ends the program, and the records are as after a kill.
#[cfg(not(unix))]
fn hear(_: Interrupt) -> Result<(), Failure> {
    Ok(())
}

/// Models that are asked nothing more once Ctrl-C was pressed. Answers that are under way are waited for: they were paid for.
pub struct Until<'a> {
    /// Who answers before that.
    pub ask: &'a dyn Ask,
    pub interrupt: &'a Interrupt,
}

impl Ask for Until<'_> {
    fn ask(&self, request: &Request) -> Result<Reply, AskError> {
        match self.interrupt.is_asked() {
            true => Err(AskError::Stopped),
            false => self.ask.ask(request),
        }
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
}
