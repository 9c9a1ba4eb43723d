"""``fricjax map``: coefficients from initial and final displacements (routes 2 and 3)."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from typer import Argument, Option

from ..errors import UsageError
from .options import Machine, Plot, Reading, Writing
from .output import deliver, prepare, working
from .records import check_records, read_records, warn_of_doubts
from .targets import PICTURES, check_targets, write_picture

if TYPE_CHECKING:
    from ..machine.choose import Choice


@dataclasses.dataclass(frozen=True)
class Mapping:
    """Options for the map."""

    PANEL: ClassVar = "Map"

    free: Annotated[str, Option(help="Free coefficients, such as mu or mu,damping.")] = "mu"
    start: Annotated[
        str, Option(help="Start of the motion in records: first_reversal (without bias from the release), or release.")
    ] = "first_reversal"
    mu_scatter: Annotated[float, Option(help="Relative scatter of mu from run to run, such as 0.02.")] = 0.0


def map_(
    files: Annotated[
        list[Path],
        Argument(
            help="Table of initial and final displacements (x0, xf), or records of two or more runs.",
            show_default=False,
        ),
    ],
    reading: Reading,
    machine: Machine,
    output: Writing,
    mapping: Mapping,
    plot: Plot = None,
) -> None:
    """Find friction from final against initial displacements.

    The results are mu by routes 2 and 3, and an interval of mu_s between stops and non-stops.
    """
    from ..settings import check_scatter

    check_targets(output, ("--plot", plot, PICTURES))
    choice = _chosen(files, reading, machine, mapping)
    check_scatter(mapping.mu_scatter)
    with working(output, "Fitting the map"):
        records = None if len(files) == 1 and reading.run is None else read_records(files, reading)
        prepare(output)
        from ..pairs import fit_final_displacements, fit_triangle_map, pairs_of, read_pairs

        warn_of_doubts(records or ())
        pairs = read_pairs(files[0]) if records is None else pairs_of(records, start=mapping.start)
        assert choice.rig is not None, "`_chosen` refuses a map without a rig"
        how = {"half_cycles": pairs.half_cycles, "sigma": pairs.sigma, "mu_scatter": mapping.mu_scatter}
        fit = fit_final_displacements(pairs.x0, pairs.xf, choice.oscillator, choice.free, **how)
        triangle = fit_triangle_map(pairs.x0, pairs.xf, choice.rig, half_cycles=pairs.half_cycles)
    data = {
        "schema": "fricjax.map/1",
        "final_displacements": fit.to_dict(),
        "triangle_map": triangle.to_dict(),
    }
    text = f"{fit.summary()}\n\n{triangle.summary()}"
    failed = "" if fit.converged else fit.status
    deliver(output, data, text, lambda: write_picture(output, plot, fit.plot), failed=failed)


def _chosen(files: list[Path], reading: Reading, machine: Machine, mapping: Mapping) -> "Choice":
    """Check files and names, and return the machine."""
    from ..data.files import check_file
    from ..fitting.names import chosen
    from ..fitting.settings import check_start
    from ..machine.choose import choose

    # One file may be a table of pairs, and the reading options do not apply to it.
    if len(files) == 1:
        check_file(files[0])
    else:
        check_records(files, reading)
    if machine.rig is None and None in (machine.normal_force, machine.mass, machine.stiffness):
        raise UsageError("A map needs its rig to find mu: give --rig, or --mass, --stiffness and --normal-force.")
    check_start(mapping.start, "first_reversal or release")
    choice = choose(machine, mapping.free)
    chosen(choice.free, choice.model.leaves, choice.model.bracketable)
    return choice
