//! The one place that starts processes: workers of a backend, spoken to by lines over their standard input and output. What
//! they write on standard error is shown.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::time::Duration;

use crate::backend::{Broken, Line, Start};
use crate::kernel::threads;

/// A line longer than this is refused, bytes.
const LINE_BYTES_MAX: usize = 16 << 20;
/// Lines that are read ahead of whoever asks.
const LINES_AHEAD: usize = 2;

/// Starts worker processes.
pub struct Processes;

impl Start for Processes {
    fn start(&self, command: &[String]) -> Result<Box<dyn Line>, String> {
        let Some((program, arguments)) = command.split_first() else { return Err("an empty command".into()) };
        let mut prepared = Command::new(program);
        prepared.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = prepared.spawn().map_err(|error| format!("`{program}` cannot be started: {error}"))?;
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(format!("`{program}` has no standard input or output"));
        };
        let (to, lines) = channel();
        let (found, from) = sync_channel(LINES_AHEAD);
        let failed = |error: std::io::Error| format!("no thread for `{program}`: {error}");
        threads::beside(move || write_lines(input, &lines)).map_err(failed)?;
        threads::beside(move || read_lines(output, &found)).map_err(failed)?;
        Ok(Box::new(Process { child, to, from }))
    }
}

/// A running worker.
struct Process {
    child: Child,
    to: Sender<String>,
    from: Receiver<Result<Vec<u8>, Broken>>,
}

impl Line for Process {
    fn send(&mut self, line: String) {
        // A worker that has ended shows itself when its answer is read.
        let _ = self.to.send(line);
    }

    fn receive(&mut self, limit: Duration) -> Result<Vec<u8>, Broken> {
        match self.from.recv_timeout(limit) {
            Ok(line) => line,
            Err(RecvTimeoutError::Timeout) => Err(Broken::Late),
            Err(RecvTimeoutError::Disconnected) => Err(Broken::Ended),
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended by itself; either way it is waited for, so that it leaves nothing behind.
        let _ = self.child.kill();
        let _ = self.child.wait();
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
