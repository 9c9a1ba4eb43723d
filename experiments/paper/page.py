"""The page that lists each number of the paper beside ours, as Markdown and as text tables."""

from collections.abc import Mapping, Sequence

from common import Number, Study

import fricjax as fj

HEAD = ("Quantity", "Unit", "Paper prints", "Closed form", "fricjax", "fricjax - paper", "fricjax - closed form")
INTRODUCTION = """# The paper's figures, computed anew

Lomascolo, Ziegert and Schmitz, *Displacement-based measurement of static and dynamic coefficients of friction*. The
text at hand has lost its digits 0 and the stiffness of the simulation: k = 5000 N/m and g = 9.81 m/s^2 are what its
other numbers leave. "Closed form" is the half-cycle map in plain Python. The printed final displacements lie within
0.0015 mm of it, but no limiting displacement gives both of them to all printed digits. Figures 1, 5 and 8 are a sketch,
photographs and a design.
"""


def markdown(studies: Mapping[str, Study]) -> str:
    """The whole page."""
    return "\n".join([INTRODUCTION, *(_section(name, study) for name, study in studies.items())])


def table(study: Study) -> fj.show.Table:
    """The numbers of one study."""
    return fj.show.Table(HEAD, [_cells(number) for number in study.numbers], study.title)


def _section(name: str, study: Study) -> str:
    rows = [HEAD, ("---",) * len(HEAD), *(_cells(number) for number in study.numbers)]
    lines = [f"## {study.title}\n", f"![{study.title}]({name}.png)\n", f"{study.note}\n", *map(_line, rows)]
    return "\n".join([*lines, f"\nData: [{name}.csv]({name}.csv)\n"])


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _cells(number: Number) -> tuple[str, ...]:
    """Lengths in mm, as in the paper."""
    factor, unit = (1e3, "mm") if number.unit == "m" else (1.0, number.unit)
    printed = number.printed
    return (
        number.quantity,
        unit,
        "" if printed is None else f"{factor * printed:g}",
        f"{factor * number.reference:.10g}",
        f"{factor * number.ours:.10g}",
        "" if printed is None else f"{factor * (number.ours - printed):+.2g}",
        f"{factor * (number.ours - number.reference):+.1e}",
    )
