"""The page that compares the numbers of the paper with fricjax.

It exists as Markdown and as text tables.
"""

from collections.abc import Mapping, Sequence

from common import Number, Study

import fricjax as fj

HEAD = ("Quantity", "Unit", "Paper prints", "Closed form", "fricjax", "fricjax - paper", "fricjax - closed form")
INTRODUCTION = """# The figures of the paper, computed by fricjax

Lomascolo, Ziegert and Schmitz, *Displacement-based measurement of static and dynamic coefficients of friction*. The
available text has no digit 0 and no stiffness of the simulation. Its other numbers imply k = 5000 N/m and
g = 9.81 m/s^2. "Closed form" is the half-cycle map in plain Python. The printed final displacements lie within
0.0015 mm of it, but no limiting displacement gives both of them to all printed digits. Figures 1, 5 and 8 are a sketch,
photographs and a design.
"""


def markdown(studies: Mapping[str, Study]) -> str:
    """Format the whole page."""
    return "\n".join([INTRODUCTION, *(_section(name, study) for name, study in studies.items())])


def table(study: Study) -> fj.show.Table:
    """Tabulate the numbers of one study."""
    return fj.show.Table(HEAD, [_cells(number) for number in study.numbers], study.title)


def _section(name: str, study: Study) -> str:
    rows = [HEAD, ("---",) * len(HEAD), *(_cells(number) for number in study.numbers)]
    lines = [f"## {study.title}\n", f"![{study.title}]({name}.png)\n", f"{study.note}\n", *map(_line, rows)]
    return "\n".join([*lines, f"\nData: [{name}.csv]({name}.csv)\n"])


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _cells(number: Number) -> tuple[str, ...]:
    """Format one number, with lengths in mm as in the paper."""
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
