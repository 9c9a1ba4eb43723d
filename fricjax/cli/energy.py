"""``fricjax energy``: friction from the rate of energy loss."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from ..errors import UsageError
from .options import Plot, Reading, Writing
from .output import deliver, json_text, prepare, working
from .records import check_records, read_record, read_records, warn_of_doubts
from .targets import PICTURES, RESULTS, check_targets, write_picture


def energy(
    files: Annotated[list[Path], Argument(help="One run, or several runs to pool.", show_default=False)],
    reading: Reading,
    output: Writing,
    rig: Annotated[Path | None, Option(help="Rig file (TOML) with mass, stiffness, normal force and damping.")] = None,
    no_contact: Annotated[Path | None, Option(help="Run without contact, used to fit damping and drag.")] = None,
    bins: Annotated[int, Option(help="Number of speed bins.")] = 24,
    plot: Plot = None,
    out: Annotated[Path | None, Option(help="Write the result (.json).", rich_help_panel="Output")] = None,
) -> None:
    """Find friction from the rate of energy loss.

    The results are the friction force against velocity, and the mean force of each half-cycle.
    """
    from ..machine.choose import bench
    from ..settings import check_bins

    check_targets(output, ("--plot", plot, PICTURES), ("--out", out, RESULTS))
    check_records([*files, *([] if no_contact is None else [no_contact])], reading)
    if rig is None:
        raise UsageError("The energy of a run needs mass, stiffness, normal force and damping: give --rig rig.toml.")
    arguments = bench(rig)
    check_bins(bins)
    with working(output, f"Evaluating {', '.join(file.name for file in files)}"):
        records = read_records(files, reading)
        free = None if no_contact is None else read_record(no_contact, reading)
        prepare(output)
        warn_of_doubts(records)
        from ..energy_loss.force_map import friction_force_map
        from ..energy_loss.half_cycles import half_cycle_friction
        from ..rig import Rig

        machine = Rig(**arguments)
        force_map = friction_force_map(records, machine, free, bins=bins)
        # The half-cycles subtract the same losses as the force map.
        calibrated = machine if free is None else machine.replace(damping=force_map.damping, drag=force_map.drag)
        balance = half_cycle_friction(records, calibrated)
    data = {"schema": "fricjax.energy/1", "force_map": force_map.to_dict(), "half_cycles": balance.to_dict()}
    heads = ("Friction force against velocity", "Half-cycles, from their reversals")
    text = "\n\n".join([heads[0], force_map.summary(), heads[1], balance.summary()])

    def write() -> dict[str, str]:
        written = write_picture(output, plot, force_map.plot)
        if out is not None:
            from ..show.files import write_text

            written["result"] = str(write_text(out, json_text(data), overwrite=output.force))
        return written

    deliver(output, data, text, write)
