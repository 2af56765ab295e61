"""evodrive as the driver calls it."""

import json
import subprocess


class Failed(Exception):
    """A command that ended badly, with its exit code and what it said."""

    def __init__(self, command, code, said):
        super().__init__(f"`{command}` ended with {code}: {said}")
        self.code = code
        self.said = said


class Evodrive:
    """The command on this machine."""

    def __init__(self, words, jobs=None):
        self.words = list(words)
        self.jobs = [] if jobs is None else ["--jobs", str(jobs)]

    def json(self, *arguments, may=(0,)):
        """What a command says as JSON, with its exit code, which must be one of `may`."""
        ended = subprocess.run([*self.words, *self.jobs, "--json", *arguments], capture_output=True, text=True, check=False)
        text = ended.stdout.strip()
        try:
            said = json.loads(text) if text else {}
        except ValueError:
            said = {}
        if ended.returncode in may and said and "error" not in said:
            return said, ended.returncode
        told = ended.stderr.strip() or json.dumps(said.get("error", text))
        raise Failed(" ".join(["evodrive", *arguments]), ended.returncode, told[-4000:])

    def shown(self, *arguments):
        """Runs a command whose output belongs on the terminal: its exit code."""
        return subprocess.run([*self.words, *self.jobs, *arguments], check=False).returncode
