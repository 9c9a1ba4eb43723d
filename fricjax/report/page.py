"""Page of a result as one HTML file without external resources."""

import base64
import datetime
import functools
import hashlib
import html
import json
import os
import string
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..archive import Archive, open_archive
from ..errors import DataError, UsageError, nearest
from ..fitting import Fit, load_fit
from ..show import Report, Reported
from ..show.files import write_text
from .columns import columns, packed
from .judgement import reasons, summary
from .pictures import pictures
from .runs_of_fit import runs_of
from .source import ENDINGS, kind_of

if TYPE_CHECKING:
    from pandas import DataFrame

# In the order of execution.
_SCRIPTS = ("dom.js", "data.js", "plot.js", "charts.js", "table.js", "run.js", "main.js")
_NEEDED = ("file", "status")
# Digits of a key in the address of a run; in one of 10^5 archives of a million runs, two runs share them.
_KEY = 16


class _Content(NamedTuple):
    """Content of a page: title, report and optional table of runs."""

    title: str
    report: Report
    runs: "DataFrame | None" = None
    limits: tuple[Any, ...] = ()


def page(source: Any, *, title: str = "") -> str:
    """Create a self-contained HTML page of a result.

    The page of an archive shows the table of runs (sortable and with filters), the coefficients against run, load and
    time with control limits, the reasons of failure, and each run with its fit, residuals, phase plane and friction of
    its half-cycles. The page of a fit shows the report and the same pictures.

    Args:
        source: a fit, an archive, its table as a data frame, another result with `report()`, or the path of the folder
            of an archive or of a saved fit.
        title: heading of the page; empty: the name of the source.

    Returns:
        The text of the page.

    Raises:
        UsageError: the source is not a result.
        DataError: there is no result at the path, or a required column is missing.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fj.report.page(fj.fit(run, machine, ["mu", "damping", "stiffness"]))[:15]
        '<!doctype html>'
    """
    content = _content(source)
    content = content._replace(title=title or content.title)
    style, scripts = _asset("page.css"), [_asset(name) for name in _SCRIPTS]
    data, blocks = _data(content)
    policy = (
        f"default-src 'none'; script-src {' '.join(map(_hash, scripts))}; style-src {_hash(style)}; "
        "base-uri 'none'; form-action 'none'; require-trusted-types-for 'script'; trusted-types 'none'"
    )
    return string.Template(_asset("page.html")).substitute(
        policy=policy,
        # A file name can contain bytes that are not text; the page shows them as escapes.
        title=html.escape(content.title).encode("utf-8", "backslashreplace").decode("utf-8"),
        style=style,
        data=_json(data),
        blocks="\n".join(
            f'<script type="text/plain" id="block-{i}">{block}</script>' for i, block in enumerate(blocks)
        ),
        scripts="\n".join(f"<script>{script}</script>" for script in scripts),
    )


def save(source: Any, path: str | os.PathLike[str], *, title: str = "", overwrite: bool = False) -> Path:
    """Write the page of a result atomically.

    Args:
        source: the result, see :func:`page`.
        path: the file, with the ending .html or .htm.
        title: heading of the page; empty: the name of the source.
        overwrite: replace an existing file.

    Returns:
        The path.

    Raises:
        UsageError: the source is not a result, or the ending is wrong.
        DataError: there is no result at the path, or a required column is missing.
        FileExistsError: the file exists, and `overwrite` is False.
        OSError: the file cannot be written.

    Examples:
        >>> import fricjax as fj
        >>> files = fj.data.example_paths()
        >>> force_map = fj.friction_force_map(files.run, fj.Rig.from_toml(files.rig))
        >>> fj.report.save(force_map, "force_map.html").name
        'force_map.html'
    """
    if Path(path).suffix.lower() not in ENDINGS:
        raise UsageError(f"A page is a file of HTML, but its name is '{path}': give it the ending .html.")
    return write_text(path, page(source, title=title), overwrite=overwrite)


def _content(source: Any) -> _Content:
    """Collect the content of a page from any source."""
    if isinstance(source, str | os.PathLike):
        path = Path(source)
        if kind_of(path) == "archive":
            return _content(open_archive(path))
        return _content(load_fit(path))._replace(title=f"Fit {path.name}")
    if isinstance(source, Fit):
        return _Content(f"Fit of {', '.join(source.labels[:3])}", source.report(), runs_of(source))
    if hasattr(source, "columns") and hasattr(source, "to_numpy"):
        return _of_table(source, "Archive of runs")
    if isinstance(source, Archive):
        return _of_table(source.to_dataframe(), f"Archive {source.path.name}")
    if isinstance(source, Reported):
        report = source.report()
        return _Content(report.heading, report)
    raise UsageError(
        f"A page shows a fit, an archive or another result, not {type(source).__name__}: give one, or its path."
    )


def _of_table(frame: "DataFrame", title: str) -> _Content:
    """Collect the content of a page from the table of an archive."""
    missing = [name for name in _NEEDED if name not in frame]
    if missing:
        hint = nearest(missing[0], map(str, frame.columns))
        raise DataError(f"A table of runs needs the columns {' and '.join(_NEEDED)}; {missing[0]!r} is missing.{hint}")
    if not len(frame):
        raise DataError("The table holds no run: there is nothing to show.")
    report, limits = summary(frame, _quantity(frame))
    return _Content(title, report, frame, tuple(limits))


def _quantity(frame: "DataFrame") -> str:
    """Unit of the displacement of the majority of the runs."""
    known = list(frame["quantity"].dropna()) if "quantity" in frame else []
    return "rad" if 2 * known.count("rad") > len(known) else "m"


def _data(content: _Content) -> tuple[dict[str, Any], list[str]]:
    """Data for the scripts, and the blocks of curves."""
    from .. import __version__

    now = datetime.datetime.now(datetime.UTC)
    data = {
        "title": content.title,
        "made": f"Made on {now:%Y-%m-%d %H:%M} UTC by fricjax {__version__}.",
        "report": _report(content.report),
    }
    frame = content.runs
    if frame is None:
        return data, []
    quantity = _quantity(frame)
    about, blocks = pictures(frame, quantity)
    groups, group_of = reasons(frame)
    return data | {
        "rows": len(frame),
        "keys": _keys(frame),
        "columns": columns(frame, quantity),
        "limits": [limit._asdict() for limit in content.limits],
        "reasons": groups,
        "reasonOf": packed(group_of, "<i4"),
        "pictures": about,
    }, blocks


def _report(report: Report) -> dict[str, Any]:
    """Convert a report to texts."""
    tables = [
        {"title": table.title, "columns": list(table.columns), "rows": table.cells(), "numeric": table.numeric()}
        for table in report.tables
        if table.rows
    ]
    sentences = {kind: list(getattr(report, kind)) for kind in ("notes", "warnings", "errors")}
    return {"tables": tables, "heading": report.heading, "facts": [list(fact) for fact in report.facts], **sentences}


def _keys(frame: "DataFrame") -> list[str]:
    """Names of the runs in addresses.

    They are the first digits of the keys, or the row numbers if the keys are not distinct.
    """
    keys = [str(key)[:_KEY] for key in frame["key"]] if "key" in frame else []
    return keys if len(set(keys)) == len(frame) else [str(i) for i in range(len(frame))]


def _json(data: dict[str, Any]) -> str:
    """Write ASCII JSON that cannot end its HTML element."""
    return json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _hash(text: str) -> str:
    """Hash of a script or style for the content security policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


@functools.cache
def _asset(name: str) -> str:
    """Read a file of the page."""
    return resources.files(__package__).joinpath("assets", name).read_text("utf-8")
