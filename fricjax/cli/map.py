"""``fricjax map``: coefficients from initial and final displacements, by routes 2 and 3."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from .failure import InvalidFit
from .options import Machine, Plot, Reading, Writing
from .output import PICTURES, check_targets, deliver, working, write_picture
from .records import read_records, tell_doubts
from .runtime import prepare

if TYPE_CHECKING:
    from ..pairs import RouteFit
    from ..rig import Rig
    from .machine import Choice

_MAP = "Map"


def map_(
    files: Annotated[
        list[Path],
        Argument(
            help="A table of initial and final displacements (x0, xf), or the records of two or more runs.",
            show_default=False,
        ),
    ],
    reading: Reading,
    machine: Machine,
    output: Writing,
    free: Annotated[str, Option(help="Free coefficients, as mu or mu,damping.", rich_help_panel=_MAP)] = "mu",
    start: Annotated[
        str, Option(help="Of records: first_reversal, which no release biases, or release.", rich_help_panel=_MAP)
    ] = "first_reversal",
    mu_scatter: Annotated[
        float, Option(help="Relative scatter of mu from run to run, as 0.02.", rich_help_panel=_MAP)
    ] = 0.0,
    plot: Plot = None,
) -> None:
    """Friction from final against initial displacements: mu by route 2 and 3, mu_s between stops and non-stops."""
    from ..pairs.settings import check_scatter

    check_targets(output, ("--plot", plot, PICTURES))
    chosen = _chosen(files, reading, machine, free, start)
    check_scatter(mu_scatter)
    with working(output, "Fitting the map"):
        records = None if len(files) == 1 and reading.run is None else read_records(files, reading)
        prepare(output)
        from ..pairs import fit_final_displacements, fit_triangle_map, pairs_of, read_pairs

        tell_doubts(records or ())
        pairs = read_pairs(files[0]) if records is None else pairs_of(records, start=start)
        rig = _rig(chosen)
        how = {"half_cycles": pairs.half_cycles, "sigma": pairs.sigma, "mu_scatter": mu_scatter}
        found = fit_final_displacements(pairs.x0, pairs.xf, chosen.oscillator, chosen.free, **how)
        shape = fit_triangle_map(pairs.x0, pairs.xf, rig, half_cycles=pairs.half_cycles)
    _tell(output, found, shape, plot)
    if not found.converged:
        raise InvalidFit(f"The fit is not valid, {found.status}")


def _chosen(files: list[Path], reading: Reading, machine: Machine, free: str, start: str) -> "Choice":
    """The machine, once files and names are known to fit."""
    from ..data.files import check_file
    from ..errors import UsageError
    from ..fitting.names import chosen
    from ..fitting.settings import check_start
    from .files import check_records
    from .machine import choose

    if len(files) == 1:
        check_file(files[0])
    else:
        check_records(files, reading)
    given = machine.rig is not None or None not in (machine.normal_force, machine.mass, machine.stiffness)
    if not given:
        raise UsageError("A map tells mu only with its rig: give --rig, or --mass, --stiffness and --normal-force.")
    check_start(start, "first_reversal or release")
    choice = choose(machine, free)
    chosen(choice.free, choice.model.leaves, choice.model.bracketable)
    return choice


def _rig(choice: "Choice") -> "Rig":
    """The rig, without whose numbers the period of a map tells no coefficient."""
    assert choice.rig is not None, "a map is not asked for without a rig"
    return choice.rig


def _tell(output: Writing, found: "RouteFit", shape: "RouteFit", plot: Path | None) -> None:
    data = {"final_displacements": found.to_dict(), "triangle_map": shape.to_dict()}
    text = f"{found.summary()}\n\n{shape.summary()}"
    deliver(output, data, text, lambda: write_picture(output, plot, found.plot))
