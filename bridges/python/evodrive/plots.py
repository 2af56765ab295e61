"""Figures. They need matplotlib, which nothing else here does."""

from .shown import shown


def plot_front(run, lineage=None, ax=None):
    """Attack against realism of a run's lineages on its held-out scenes: parent, front (development labels) and the program
    that was chosen. `lineage` takes one alone. Gives the matplotlib figure."""
    import matplotlib.pyplot as plt

    figure, ax = (ax.figure, ax) if ax else plt.subplots(figsize=(5, 4))
    chosen = [of for of in run.result["lineages"] if lineage in (None, of["lineage"])]
    if not chosen:
        known = ", ".join(of["lineage"] for of in run.result["lineages"])
        raise ValueError(f"no lineage {shown(lineage)}, expected one of {known}")
    for of in chosen:
        (colour,) = {line.get_color() for line in ax.plot([], [])}
        at = {name: of[name]["objectives"] for name in ("parent", "evolved")}
        front = sorted((point["objectives"] for point in of["front"]), key=lambda point: point["realism"])
        ax.plot([p["realism"] for p in front], [p["attack"] for p in front], ".:", color=colour, alpha=0.6)
        for name, marker in (("parent", "o"), ("evolved", "*")):
            label = f"{of['lineage']}, {name}"
            ax.plot(at[name]["realism"], at[name]["attack"], marker, color=colour, markersize=10, label=label)
    ax.set_xlabel("realism")
    ax.set_ylabel("attack")
    ax.legend(fontsize="small")
    ax.set_title("held-out scenes; dotted: fronts on development scenes", fontsize="small")
    figure.tight_layout()
    return figure
