"""Axes with units, in one style.

Displacements are shown in mm, residuals in nm, times in s.

matplotlib is imported for the first figure. Figures use its object interface, so the plotting state of the user is not
changed and no display is needed.
"""

import functools
import io
import os
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError, nearest
from .files import write_bytes
from .units import display_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette: red-green colour-blind readers can distinguish these colours.
STYLE: dict[str, Any] = {
    "colours": ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"),
    "line_width": 1.1,
    "width": 7.0,
    "row_height": 2.6,
    "font_size": 9.0,
    "grid": {"color": "#D9D9D9", "linewidth": 0.6},
}

_LETTERS = 34  # number of letters that fit below axes of one column

type Style = str | Mapping[str, Any]
"""Name of one of the `STYLES`, or a mapping with the same keys."""
STYLES: dict[str, dict[str, Any]] = {
    "screen": {},
    "column": {"width": 85 / 25.4, "font_size": 8.0, "titles": False},
    "page": {"width": 178 / 25.4, "font_size": 8.0, "titles": False},
}
"""Styles of a figure by name; "column" and "page" have the width [in] of one and two columns of a journal."""


def figure(
    rows: int = 1, columns: int = 1, *, share_x: bool = False, heights: tuple[float, ...] | None = None
) -> tuple["Figure", np.ndarray]:
    """Create a figure with a grid of styled axes.

    Args:
        rows: number of rows of axes.
        columns: number of columns of axes.
        share_x: whether the axes of a column share their abscissa.
        heights: relative heights of the rows; None: equal.

    Returns:
        The figure and its axes, an object array of shape (rows, columns).

    Examples:
        >>> from fricjax.show import axis_label, figure
        >>> drawing, axes = figure(2, share_x=True)
        >>> axes.shape
        (2, 1)
        >>> label = axes[1, 0].set_xlabel(axis_label("Time", "s"))
    """
    size = (STYLE["width"], STYLE["row_height"] * rows)
    made = _notebook_figure()(figsize=size, layout="constrained")
    shared = "col" if share_x else False
    axes = made.subplots(rows, columns, squeeze=False, sharex=shared, gridspec_kw={"height_ratios": heights})
    for each in axes.flat:
        style(each)
    return made, axes


@functools.cache
def _notebook_figure() -> type["Figure"]:
    """Return a class of figures that notebooks display without pyplot."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    class NotebookFigure(Figure):
        """A figure with a PNG representation for rich output."""

        def __init__(self, *args: object, **kwargs: object) -> None:
            super().__init__(*args, **kwargs)  # pyright: ignore[reportArgumentType]
            FigureCanvasAgg(self)

        def _repr_png_(self) -> bytes:
            buffer = io.BytesIO()
            self.savefig(buffer, format="png", dpi=110)
            return buffer.getvalue()

    return NotebookFigure


def style(axes: "Axes") -> None:
    """Apply the common colours, line width, grid and fonts to axes."""
    from cycler import cycler

    axes.set_prop_cycle(cycler(linewidth=[STYLE["line_width"]]) * cycler(color=STYLE["colours"]))
    axes.grid(True, **STYLE["grid"])
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=STYLE["font_size"])
    for text in (axes.xaxis.label, axes.yaxis.label, axes.title):
        text.set_fontsize(STYLE["font_size"])


def styled(drawing: "Figure", style: Style = "screen") -> "Figure":
    """Adapt width and font size of a finished figure for print.

    Args:
        drawing: the figure; it is changed in place.
        style: "screen": unchanged. "column" and "page": one and two columns of a journal, 85 mm and 178 mm wide, 8 pt,
            without titles, because the caption replaces them. Or a mapping with any of the keys `width` [in],
            `font_size` [pt] and `titles`.

    Returns:
        The same figure.

    Raises:
        UsageError: the style is unknown, or one of its keys.

    Examples:
        >>> from fricjax.show import figure, styled
        >>> drawing, axes = figure()
        >>> [round(25.4 * float(size)) for size in styled(drawing, "column").get_size_inches()]
        [85, 46]
    """
    if isinstance(style, str) and style not in STYLES:
        raise UsageError(f"There is no style {style!r}.{nearest(style, STYLES)} Known are {', '.join(STYLES)}.")
    settings = STYLES[style] if isinstance(style, str) else style
    known = ("width", "font_size", "titles")
    for key in settings:
        if key not in known:
            raise UsageError(f"A style has no {key!r}.{nearest(key, known)} It has {', '.join(known)}.")
    if "width" in settings:
        width, height = drawing.get_size_inches()
        share = settings["width"] / width
        # A narrow figure keeps more of its height; otherwise too little space would remain between the labels.
        drawing.set_size_inches(settings["width"], height * share**0.5)
        if settings["width"] < STYLE["width"] / 2:
            _narrow(drawing)
    if not settings.get("titles", True):
        drawing.suptitle("")
        for axes in drawing.axes:
            axes.set_title("", loc="left")
            axes.set_title("")
    if "font_size" in settings:
        from matplotlib.text import Text

        for text in drawing.findobj(Text):
            text.set_fontsize(settings["font_size"])  # pyright: ignore[reportAttributeAccessIssue]
    return drawing


def _narrow(drawing: "Figure") -> None:
    """Reduce the ticks and wrap the labels of narrow axes."""
    from matplotlib.ticker import AutoLocator

    for axes in drawing.axes:
        place = axes.get_subplotspec()
        columns = 1 if place is None else place.get_gridspec().ncols
        axes.set_xlabel(textwrap.fill(axes.get_xlabel(), _LETTERS // columns))
        if isinstance(axes.xaxis.get_major_locator(), AutoLocator):
            axes.locator_params(axis="x", nbins=3)


def axis_label(name: str, unit: str) -> str:
    """Compose an axis label, such as `Displacement [mm]`.

    Args:
        name: name of the quantity.
        unit: its unit; if empty, the label is the name alone.

    Examples:
        >>> from fricjax.show import axis_label
        >>> axis_label("Displacement", "mm"), axis_label("Coefficient of friction", "")
        ('Displacement [mm]', 'Coefficient of friction')
    """
    return f"{name} [{unit}]" if unit else name


def scaled(values: Any, unit: str) -> tuple[np.ndarray, str]:
    """Scale values to a unit with a suitable SI prefix.

    Args:
        values: numbers in `unit`, any shape; the largest finite value determines the prefix.
        unit: an SI unit as text, e.g. "m".

    Returns:
        The values as a float64 array of the same shape, and their unit, e.g. "mm".

    Examples:
        >>> from fricjax.show import scaled
        >>> scaled([1e-3, 2e-3], "m")
        (array([1., 2.]), 'mm')
    """
    array = np.asarray(values, dtype=np.float64)
    finite = np.abs(array[np.isfinite(array)])
    factor, shown = display_unit(float(finite.max(initial=0.0)), unit)
    return array * factor, shown


def save(figure: "Figure", path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Write a figure atomically, in the format of the suffix.

    Args:
        figure: the figure.
        path: the file, with the suffix `.png`, `.svg`, `.pdf` or another format that matplotlib can write.
        overwrite: replace an existing file.

    Returns:
        The path.

    Raises:
        ValueError: the suffix names no picture format.
        FileExistsError: the file exists, and `overwrite` is False.
        OSError: the file cannot be written; an existing file is unchanged.

    Examples:
        >>> import tempfile
        >>> from fricjax.show import figure, save
        >>> drawing, axes = figure()
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     save(drawing, f"{folder}/empty.png").name
        'empty.png'
    """
    path = Path(path)
    known = figure.canvas.get_supported_filetypes()
    ending = path.suffix[1:].lower()
    if ending not in known:
        endings = ", ".join(f".{name}" for name in sorted(known))
        raise ValueError(f"A plot cannot be written as '{path.name}': give it one of the endings {endings}.")
    drawn = io.BytesIO()
    figure.savefig(drawn, format=ending, dpi=150)
    return write_bytes(path, drawn.getbuffer(), overwrite=overwrite)
