"""How many starts of a fit look: the report, and the waterfall."""

from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from ..show import figure, plain

if TYPE_CHECKING:
    from .multistart import Multistart


def summary(found: "Multistart") -> str:
    """The report of the best fit, and what the starts say of it."""
    from .show import summary as of_fit

    return f"{of_fit(found.best)}\n\n" + "\n".join(f"{name + ':':<13}{text}" for name, text in facts(found))


def facts(found: "Multistart") -> list[tuple[str, str]]:
    """The lines about the starts."""
    total, reached = found.excess.size, int(found.reached.sum())
    others = found.excess[~found.reached & np.isfinite(found.excess)]
    lines = [("starts", f"{reached} of {total} reached this optimum; {_automatic(found)}")]
    if others.size:
        lines.append(("next optimum", f"chi^2 larger by {plain(float(others[0]), 3)}"))
    held = Counter(name for names in found.at_bounds for name in names)
    if held:
        lines.append(("bounds", ", ".join(f"{name} in {count} of {total} starts" for name, count in held.items())))
    return lines


def _automatic(found: "Multistart") -> str:
    if found.reached[found.automatic]:
        return "the automatic start is one of them"
    return f"the automatic start ended at a chi^2 larger by {plain(float(found.excess[found.automatic]), 3)}"


def plot(found: "Multistart") -> Any:
    """The waterfall: reduced chi^2 of all starts in ascending order, the automatic one marked."""
    drawing, grid = figure()
    axes = grid[0, 0]
    rank = np.arange(1, found.excess.size + 1)
    reduced = (found.best.chi2 + found.excess) / found.best.dof
    shown = np.where(np.isfinite(reduced), reduced, np.nan)
    axes.plot(rank, shown, marker="o", markersize=4)
    axes.plot(rank[found.automatic], shown[found.automatic], marker="s", markersize=7, fillstyle="none", linestyle="")
    axes.set_yscale("log")
    axes.set_xlabel("Start, in order of its fit")
    axes.set_ylabel("Reduced $\\chi^2$")
    axes.set_title(
        f"{int(found.reached.sum())} of {found.excess.size} starts reach the best optimum; square: automatic start",
        fontsize=9,
        loc="left",
    )
    return drawing
