"""EvoDrive from Python: the binary starts runs and lays them out as tables, this package loads them.

    import evodrive
    run = evodrive.run("experiments/quickstart.toml")
    run.labels().query("acted").groupby("solution").attack.mean()
    evodrive.plot_front(run).savefig("front.svg")

Nothing is computed here that the binary computes. `evodrive.driver` is the helper of planners of one's own (docs/EGOS.md).
"""

from .runs import EvodriveError, Run, load, record, run
from .plots import plot_front

__all__ = ["EvodriveError", "Run", "load", "plot_front", "record", "run"]
