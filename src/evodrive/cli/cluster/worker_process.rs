//! The one place that starts processes: workers of a backend, spoken to by lines over their standard input and output, and
//! programs that answer one request. What a worker writes on standard error is shown; of a program it is kept if it fails. All that they
//! say there goes through `redacted`.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::time::{Duration, Instant};

use crate::backend::{Broken, Line, Start};
use crate::cli::cluster::printed::Printed;
use crate::cli::records::redacted;
use crate::cli::terminal::answer::progress;
use crate::cli::terminal::interrupt::{Interrupt, Waited, now};
use crate::kernel::threads;
use crate::llm::command::{Ended, Run};
use crate::store;

/// A line longer than this is refused, bytes.
const LINE_BYTES_MAX: usize = 16 << 20;
/// Lines that are read ahead of whoever asks.
const LINES_AHEAD: usize = 2;

/// Starts worker processes and programs. They are waited for until Ctrl-C, where somebody listens to it.
#[derive(Clone, Debug, Default)]
pub struct Processes {
    interrupt: Interrupt,
    /// File that keeps what they print, beside the terminal: no record speaks for it.
    kept: Option<PathBuf>,
    /// Texts that are on the terminal already.
    printed: Arc<Printed>,
}

impl Processes {
    /// Processes that are not waited for long once Ctrl-C was pressed.
    pub fn until(interrupt: &Interrupt) -> Processes {
        Processes { interrupt: interrupt.clone(), ..Processes::default() }
    }

    /// Writes what they print into this file, too.
    pub fn kept_in(self, file: PathBuf) -> Processes {
        Processes { kept: Some(file), ..self }
    }
}

impl Start for Processes {
    fn start(&self, command: &[String]) -> Result<Box<dyn Line>, String> {
        self.spoken_to(command, true, |prepared| prepared)
    }

    fn start_in(&self, command: &[String], folder: &Path, variables: &[(&str, &str)]) -> Result<Box<dyn Line>, String> {
        self.spoken_to(command, false, |prepared| prepared.current_dir(folder).envs(variables.iter().copied()))
    }

    fn show(&self, about: &str, printed: &str) {
        let text = redacted::redacted(&format!("{about}\n{printed}"));
        if self.printed.is_new(about, printed) {
            progress(&text);
        }
        if let Some(file) = &self.kept
            && let Err(error) = store::append(file, format!("{}\n", text.trim_end()).as_bytes())
        {
            progress(error);
        }
    }
}

/// A program that a terminal's Ctrl-C does not reach: it is for us to end it, when what it does is done. Killed by it, a planner
/// would look like one that failed in its scene.
fn apart(program: &str) -> Command {
    #[allow(unused_mut)]
    let mut command = Command::new(program);
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command
}

impl Processes {
    /// Starts a process that is spoken to by lines; `how` says what else is to be prepared, `shown` whether its standard error is shown
    /// as it comes.
    fn spoken_to(
        &self,
        command: &[String],
        shown: bool,
        how: impl FnOnce(&mut Command) -> &mut Command,
    ) -> Result<Box<dyn Line>, String> {
        let Some((program, arguments)) = command.split_first() else { return Err("an empty command".into()) };
        let mut prepared = apart(program);
        how(prepared.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()));
        let mut child = prepared.spawn().map_err(|error| format!("`{program}` cannot be started: {error}"))?;
        let pipes = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let (Some(input), Some(output), Some(errors)) = pipes else {
            return Err(format!("`{program}` has no standard input, output or error"));
        };
        let (to, lines) = channel();
        let (sender, from) = sync_channel(LINES_AHEAD);
        let failed = |error: std::io::Error| format!("no thread for `{program}`: {error}");
        let complaints = if shown { shown_lines(errors) } else { kept_end(errors) }.map_err(failed)?;
        threads::beside(move || write_lines(input, &lines)).map_err(failed)?;
        threads::beside(move || read_lines(output, &sender)).map_err(failed)?;
        Ok(Box::new(Process { child, to, from, complaints, shown, interrupt: self.interrupt.clone() }))
    }
}

/// The end of what a process will have written on standard error.
fn kept_end(errors: ChildStderr) -> std::io::Result<Receiver<Vec<u8>>> {
    let (complained, complaints) = sync_channel(1);
    threads::beside(move || drop(complained.send(read_end(errors))))?;
    Ok(complaints)
}

/// Shows what a process writes on standard error, line by line, and of what goes beyond all measure its end. Nothing comes when it has
/// closed it.
fn shown_lines(errors: ChildStderr) -> std::io::Result<Receiver<Vec<u8>>> {
    let (ended, end) = sync_channel(1);
    threads::beside(move || {
        let mut errors = BufReader::new(errors);
        let show = |bytes: &[u8]| {
            progress(redacted::redacted(String::from_utf8_lossy(bytes).trim_end_matches(['\n', '\r'])));
        };
        let (mut shown, mut line) = (0, Vec::new());
        while shown < STDERR_SHOWN_BYTES {
            line.clear();
            match (&mut errors).take(STDERR_LINE_BYTES).read_until(b'\n', &mut line) {
                Ok(count @ 1..) => shown += count,
                _ => break,
            }
            show(&line);
        }
        let rest = read_end(errors);
        if !rest.is_empty() {
            show(&rest);
        }
        drop(ended.send(Vec::new()));
    })?;
    Ok(end)
}

/// Something that the process started may still hold the pipe, so this is not waited for long.
fn last_complaint(complaints: &Receiver<Vec<u8>>) -> String {
    let kept = complaints.recv_timeout(LAST_WORDS).unwrap_or_default();
    redacted::redacted(&String::from_utf8_lossy(&kept))
}

/// A running worker.
struct Process {
    child: Child,
    to: Sender<String>,
    from: Receiver<Result<Vec<u8>, Broken>>,
    /// The end of its standard error; empty where that is shown.
    complaints: Receiver<Vec<u8>>,
    shown: bool,
    interrupt: Interrupt,
}

impl Line for Process {
    fn send(&mut self, line: String) {
        // A worker that has ended shows itself when its answer is read.
        let _ = self.to.send(line);
    }

    fn receive(&mut self, limit: Duration) -> Result<Vec<u8>, Broken> {
        match self.interrupt.wait(&self.from, Some(now() + limit)) {
            Ok(line) => line,
            Err(Waited::Late) => Err(Broken::Late),
            Err(Waited::Gone) => Err(Broken::Ended),
            Err(Waited::Stopped) => Err(Broken::Stopped),
        }
    }

    fn early(&mut self) -> Option<Result<Vec<u8>, Broken>> {
        self.from.try_recv().ok()
    }

    fn complaint(&mut self) -> String {
        let _ = self.child.kill();
        last_complaint(&self.complaints)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended by itself; either way it is waited for, so that it leaves nothing behind.
        let _ = self.child.kill();
        let _ = self.child.wait();
        if self.shown {
            // Its last words come before whatever is said of its end.
            let _ = self.complaints.recv_timeout(LAST_WORDS);
        }
    }
}

fn write_lines(mut input: ChildStdin, lines: &Receiver<String>) {
    while let Ok(line) = lines.recv() {
        if writeln!(input, "{line}").and_then(|()| input.flush()).is_err() {
            return;
        }
    }
}

fn read_lines(output: ChildStdout, found: &SyncSender<Result<Vec<u8>, Broken>>) {
    let mut output = BufReader::new(output);
    loop {
        let line = read_line(&mut output);
        let over = line.is_err();
        if found.send(line).is_err() || over {
            return;
        }
    }
}

fn read_line(output: &mut impl BufRead) -> Result<Vec<u8>, Broken> {
    let mut line = Vec::new();
    let read = output.take(LINE_BYTES_MAX as u64 + 1).read_until(b'\n', &mut line);
    match line.pop() {
        Some(b'\n') if read.is_ok() => Ok(line),
        Some(_) if line.len() >= LINE_BYTES_MAX => Err(Broken::TooLong(LINE_BYTES_MAX)),
        Some(_) => Err(Broken::HalfLine(line.len() + 1)),
        None => Err(Broken::Ended),
    }
}

/// Bytes of a program's output that are kept.
const OUTPUT_BYTES_MAX: usize = 1 << 20;
/// Bytes of the end of its standard error that are kept.
const STDERR_BYTES: usize = 4 << 10;
/// Bytes of a line of standard error that are shown together, and of all of it that are shown as they come.
const STDERR_LINE_BYTES: u64 = 16 << 10;
const STDERR_SHOWN_BYTES: usize = 64 << 10;
/// How long the end of standard error is waited for behind the end of its process.
const LAST_WORDS: Duration = Duration::from_secs(1);
/// How often a program that has closed its output is asked whether it has ended.
const LOOK: Duration = Duration::from_millis(10);

/// How often that is done which is to be done while a program runs.
const MEANWHILE: Duration = Duration::from_millis(200);

impl Run for Processes {
    fn run_beside(&self, program: &[String], input: Vec<u8>, limit: Duration, meanwhile: &mut dyn FnMut()) -> Ended {
        match Running::start(program, input) {
            Ok(running) => running.end(now() + limit, &self.interrupt, meanwhile),
            Err(reason) => Ended::Unstarted(reason),
        }
    }
}

/// A program that answers one request.
struct Running {
    child: Child,
    output: Receiver<Result<Vec<u8>, String>>,
    complaints: Receiver<Vec<u8>>,
}

impl Running {
    fn start(command: &[String], input: Vec<u8>) -> Result<Running, String> {
        let Some((program, arguments)) = command.split_first() else { return Err("an empty command".into()) };
        let mut prepared = apart(program);
        prepared.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = prepared.spawn().map_err(|error| format!("`{program}` cannot be started: {error}"))?;
        let pipes = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let (Some(mut to), Some(from), Some(errors)) = pipes else {
            return Err(format!("`{program}` has no standard input, output or error"));
        };
        let failed = |error: std::io::Error| format!("no thread for `{program}`: {error}");
        let (printed, output) = sync_channel(1);
        // A program may answer without reading all it is told.
        threads::beside(move || drop(to.write_all(&input))).map_err(failed)?;
        threads::beside(move || drop(printed.send(read_output(from)))).map_err(failed)?;
        let complaints = kept_end(errors).map_err(failed)?;
        Ok(Running { child, output, complaints })
    }

    /// Waits for its end and returns what it printed. It is stopped at the deadline, and not long after Ctrl-C.
    fn end(mut self, deadline: Instant, interrupt: &Interrupt, meanwhile: &mut dyn FnMut()) -> Ended {
        let left = || deadline.saturating_duration_since(now());
        let printed = loop {
            match interrupt.wait(&self.output, Some(deadline.min(now() + MEANWHILE))) {
                Ok(Ok(printed)) => break printed,
                Ok(Err(reason)) => return Ended::Unread(reason),
                // Dropped, it is killed.
                Err(Waited::Stopped) => return Ended::Stopped,
                Err(Waited::Late) if !left().is_zero() => meanwhile(),
                Err(Waited::Late | Waited::Gone) => return self.late(),
            }
        };
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) if status.success() => return Ended::Well(printed),
                Ok(Some(status)) => return Ended::Badly { code: status.code(), stderr: self.complaints() },
                Ok(None) if left().is_zero() => return self.late(),
                Ok(None) if interrupt.is_overdue() => return Ended::Stopped,
                Ok(None) => std::thread::sleep(LOOK),
                Err(error) => return Ended::Unread(format!("it cannot be waited for: {error}")),
            }
        }
    }

    fn late(mut self) -> Ended {
        let _ = self.child.kill();
        let _ = self.child.wait();
        Ended::Late { stderr: self.complaints() }
    }

    fn complaints(&self) -> String {
        last_complaint(&self.complaints)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn read_output(from: impl Read) -> Result<Vec<u8>, String> {
    let mut printed = Vec::new();
    let read = from.take(OUTPUT_BYTES_MAX as u64 + 1).read_to_end(&mut printed);
    match read {
        Ok(_) if printed.len() > OUTPUT_BYTES_MAX => Err(format!("it prints more than {OUTPUT_BYTES_MAX} bytes")),
        Ok(_) => Ok(printed),
        Err(error) => Err(format!("its output cannot be read: {error}")),
    }
}

/// Runs a program in this terminal, as an editor is, and waits until it has ended; says how it ended where not well.
pub fn in_terminal(command: &[String]) -> Result<(), String> {
    let Some((program, arguments)) = command.split_first() else { return Err("an empty command".into()) };
    match Command::new(program).args(arguments).status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("`{program}` ended with {status}")),
        Err(error) => Err(format!("`{program}` cannot be started: {error}")),
    }
}

/// The end of what is read, and before it how much is left out. It begins with a whole word: a part of a key would be known by nobody.
fn read_end(mut from: impl Read) -> Vec<u8> {
    let (mut kept, mut piece, mut left_out) = (Vec::new(), [0; 4096], 0);
    while let Ok(count @ 1..) = from.read(&mut piece) {
        kept.extend_from_slice(&piece[..count]);
        let over = kept.len().saturating_sub(STDERR_BYTES);
        kept.drain(..over);
        left_out += over;
    }
    if left_out > 0 {
        let word = kept.iter().position(u8::is_ascii_whitespace).unwrap_or_default();
        kept.drain(..word);
        kept.splice(..0, format!("[{} bytes are left out here]", left_out + word).into_bytes());
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str, input: &str, limit: Duration) -> Ended {
        Processes::default().run(&["sh".into(), "-c".into(), script.into()], input.into(), limit)
    }

    const LONG: Duration = Duration::from_secs(60);

    #[test]
    fn a_program_answers_from_its_input_and_fails_with_its_code_and_complaint() {
        assert_eq!(shell("read x; echo got $x", "word\n", LONG), Ended::Well(b"got word\n".to_vec()));
        let badly = Ended::Badly { code: Some(5), stderr: "no\n".into() };
        assert_eq!(shell("echo ignored; echo no >&2; exit 5", "", LONG), badly);
        assert!(matches!(Processes::default().run(&["/no/such/program".into()], vec![], LONG), Ended::Unstarted(_)));
    }

    #[test]
    fn of_a_complaint_without_end_the_end_is_told_without_a_part_of_a_word() {
        let long = "head -c 300000 /dev/zero | tr '\\0' a >&2; echo ' last words' >&2; exit 5";
        let badly = Ended::Badly { code: Some(5), stderr: "[300000 bytes are left out here] last words\n".into() };
        assert_eq!(shell(long, "", LONG), badly);
    }

    #[test]
    fn a_program_beyond_its_limit_is_stopped() {
        let late = shell("echo slow >&2; exec sleep 60", "", Duration::from_millis(300));
        assert_eq!(late, Ended::Late { stderr: "slow\n".into() });
        let quiet = shell("exec 1>&-; exec sleep 60", "", Duration::from_millis(300));
        assert!(matches!(quiet, Ended::Late { .. }), "closing its output is no end: {quiet:?}");
    }

    #[test]
    fn what_a_process_printed_goes_to_the_kept_file_and_a_line_that_came_unasked_is_there_early() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("processes.log");
        Processes::default().kept_in(file.clone()).show("scene 7", "Traceback in /home/alice/mine.py");
        let kept = std::fs::read_to_string(&file).unwrap();
        assert_eq!(kept, "scene 7\nTraceback in ~/mine.py\n");
        let command = ["sh", "-c", "echo one; echo two; read x"].map(String::from);
        let mut line = Processes::default().start(&command).unwrap();
        assert_eq!(line.receive(LONG).unwrap(), b"one");
        let early = (0..500).find_map(|_| {
            std::thread::sleep(LOOK);
            line.early()
        });
        assert_eq!(early, Some(Ok(b"two".to_vec())));
        assert_eq!(line.early(), None);
    }
}
