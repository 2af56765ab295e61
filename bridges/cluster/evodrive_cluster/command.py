"""evodrive as the driver calls it."""

import json
import subprocess
import time

from .work import LOCKED, die_with_parent

# How long a command of a driver that was killed may hold the run folder.
HELD_S = 60.0


class Failed(Exception):
    """A command that ended badly, with its exit code and what it said."""

    def __init__(self, command, code, said):
        super().__init__(f"`{command}` ended with {code}: {said}")
        self.code = code
        self.said = said


class Evodrive:
    """The command on this machine. It ends with its driver."""

    def __init__(self, words):
        self.words = list(words)

    def json(self, *arguments, may=(0,)):
        """What a command says as JSON, with its exit code, which must be one of `may`."""
        until = time.monotonic() + HELD_S
        while True:
            try:
                ended = subprocess.run([*self.words, "--json", *arguments], capture_output=True, text=True, check=False,
                                       preexec_fn=die_with_parent)
            except OSError as error:
                raise Failed(self.words[0], 127, f"--evodrive {self.words[0]}: {error.strerror}; build it with `cargo build --release`, or name "
                             "the program that is there") from None
            text = ended.stdout.strip()
            try:
                said = json.loads(text) if text else {}
            except ValueError:
                said = {}
            if ended.returncode in may and said and "error" not in said:
                return said, ended.returncode
            told = ended.stderr.strip() or str(said.get("error", text))
            if LOCKED not in told or time.monotonic() > until:
                raise Failed(" ".join(["evodrive", *arguments]), ended.returncode, told[-4000:])
            time.sleep(1.0)

    def shown(self, *arguments):
        """Runs a command whose output belongs on the terminal: its exit code."""
        return subprocess.run([*self.words, *arguments], check=False, preexec_fn=die_with_parent).returncode
