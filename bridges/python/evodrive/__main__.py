"""The program `evodrive`, as the wheel carries it: `python -m evodrive` and the script of that name."""

import sys

from . import _evodrive


def main():
    """Runs it with the arguments of this process, and ends as it ends."""
    code = _evodrive.main(["evodrive", *sys.argv[1:]])
    sys.exit(code)


if __name__ == "__main__":
    main()
