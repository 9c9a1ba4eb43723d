"""``fricjax map``: coefficients from initial and final displacements, by routes 2 and 3."""

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
    """What is fitted to the map."""

    PANEL: ClassVar = "Map"

    free: Annotated[str, Option(help="Free coefficients, as mu or mu,damping.")] = "mu"
    start: Annotated[str, Option(help="Of records: first_reversal, which no release biases, or release.")] = (
        "first_reversal"
    )
    mu_scatter: Annotated[float, Option(help="Relative scatter of mu from run to run, as 0.02.")] = 0.0


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
    mapping: Mapping,
    plot: Plot = None,
) -> None:
    """Friction from final against initial displacements: mu by route 2 and 3, mu_s between stops and non-stops."""
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
        assert choice.rig is not None, "a map is not asked for without a rig"
        how = {"half_cycles": pairs.half_cycles, "sigma": pairs.sigma, "mu_scatter": mapping.mu_scatter}
        fit = fit_final_displacements(pairs.x0, pairs.xf, choice.oscillator, choice.free, **how)
        triangle = fit_triangle_map(pairs.x0, pairs.xf, choice.rig, half_cycles=pairs.half_cycles)
    data = {"final_displacements": fit.to_dict(), "triangle_map": triangle.to_dict()}
    text = f"{fit.summary()}\n\n{triangle.summary()}"
    failed = "" if fit.converged else fit.status
    deliver(output, data, text, lambda: write_picture(output, plot, fit.plot), failed=failed)


def _chosen(files: list[Path], reading: Reading, machine: Machine, mapping: Mapping) -> "Choice":
    """The machine, once files and names are known to fit."""
    from ..data.files import check_file
    from ..fitting.names import chosen
    from ..fitting.settings import check_start
    from ..machine.choose import choose

    # One file may be a table of pairs, of which the options of records say nothing.
    if len(files) == 1:
        check_file(files[0])
    else:
        check_records(files, reading)
    if machine.rig is None and None in (machine.normal_force, machine.mass, machine.stiffness):
        raise UsageError("A map tells mu only with its rig: give --rig, or --mass, --stiffness and --normal-force.")
    check_start(mapping.start, "first_reversal or release")
    choice = choose(machine, mapping.free)
    chosen(choice.free, choice.model.leaves, choice.model.bracketable)
    return choice
