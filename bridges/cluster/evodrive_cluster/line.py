"""One moving line on a terminal; elsewhere a line now and then."""

import sys
import time

SECONDS_BETWEEN_LINES = 10


class Line:
    """What stands on the last line."""

    def __init__(self, to=sys.stderr):
        self.to = to
        self.moves = to.isatty()
        self.length = 0
        self.last = 0.0

    def show(self, text, now=False):
        if self.moves:
            print("\r" + text.ljust(self.length), end="", file=self.to, flush=True)
            self.length = len(text)
        elif now or time.monotonic() - self.last >= SECONDS_BETWEEN_LINES:
            print(text, file=self.to, flush=True)
            self.last = time.monotonic()

    def say(self, text):
        """A line that stays."""
        if self.moves and self.length:
            print("\r" + " " * self.length + "\r", end="", file=self.to)
            self.length = 0
        print(text, file=self.to, flush=True)

    def end(self):
        if self.moves and self.length:
            print(file=self.to, flush=True)
            self.length = 0


def told(round_number, done, all_of_them, under_way, seconds):
    """Share, rate and time left of a round."""
    share = done / all_of_them if all_of_them else 1.0
    text = f"round {round_number}: {done} of {all_of_them} shards ({share:.0%}), {under_way} under way"
    if done and seconds > 0:
        rate = done / seconds
        text += f", {60 * rate:.3g} a minute, about {duration((all_of_them - done) / rate)} left"
    return text


def duration(seconds):
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
