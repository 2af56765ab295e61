"""What was handed over, as an error shows it: a value without end is cut."""

import reprlib

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 200


def shown(value):
    return _SHORT.repr(value)
