"""EvoDrive from Python: environments to train and test drivers in, and runs with their tables.

    import evodrive
    run = evodrive.run("experiments/quickstart.toml")
    run.labels().query("acted").groupby("solution").attack.mean()
    evodrive.plot_front(run).savefig("front.svg")

`evodrive.gym` holds the environments, `evodrive.driver` is the helper of planners of one's own (docs/EGOS.md). Nothing is computed
here that the program computes.
"""

from . import _evodrive

__version__ = _evodrive.__version__
__all__ = ["EvodriveError", "Run", "load", "plot_front", "record", "run"]


def __getattr__(name):
    # Data frames and figures are loaded when they are asked for: the program and the environments need neither.
    if name == "plot_front":
        from .plots import plot_front

        return plot_front
    if name in __all__:
        from . import runs

        return getattr(runs, name)
    raise AttributeError(f"module 'evodrive' has no attribute {name!r}")
