"""Small SVG pictures for the tables of a notebook.

They have a few kilobytes and are drawn on display, without matplotlib. Text and axes take the text colour of the page.
The colours of curves are visible on white and on black, and red-green colour-blind readers can distinguish them.
"""

import itertools
import math
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np

from .axes import axis_label
from .numbers import plain
from .units import display_unit

# Middle tones of Okabe and Ito's blue and orange. The originals are too dark on black or too pale on white.
COLOURS = ("#3A93D6", "#E06A1B")
_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 460, 150, 58, 10, 10, 36
# A curve is divided into this many columns. Only the lowest and the highest point of each column are visible and drawn.
_COLUMNS = 200
_TICKS = 5
_ROOM = 0.04  # between curves and frame, as a fraction of the axis
_BAR = 18
_NAME = 150


class Curve(NamedTuple):
    """A curve of a thumbnail, or points with error bars.

    Attributes:
        x, y: shape (n,); a value that is not finite leaves a gap.
        std: half-lengths of error bars, shape (n,). With error bars the curve is drawn as points.
        points: whether to draw points and no line.
        broad: whether the line is broad and pale, as a background for another curve.
    """

    x: Any
    y: Any
    std: Any = None
    points: bool = False
    broad: bool = False


def curves_svg(curves: Iterable[Curve], x: tuple[str, str], y: tuple[str, str], *, log_x: bool = False) -> str:
    """Draw curves over one abscissa as an SVG element.

    Args:
        curves: the curves; at most two have different colours.
        x: name and SI unit of the abscissa.
        y: name and SI unit of the ordinate.
        log_x: whether the abscissa is logarithmic; points that are not positive are left out.

    Returns:
        The SVG element; an empty string if no point is finite, or if their distance is not.

    Examples:
        >>> from fricjax.show.thumbnail import Curve, curves_svg
        >>> picture = curves_svg([Curve([0.0, 1.0], [0.0, 2e-3])], ("Time", "s"), ("Displacement", "m"))
        >>> picture[:4], "Displacement [mm]" in picture
        ('<svg', True)
    """
    finite = [_finite(curve, log_x) for curve in curves]
    drawn = [curve for curve in finite if curve.x.size and np.isfinite(curve.y).any()]
    if not drawn:
        return ""
    stacked = lambda name: np.concatenate([np.asarray(getattr(curve, name)) for curve in drawn])
    (factor_x, unit_x), (factor_y, unit_y) = (
        # Times are shown in seconds, as in the plots.
        (1.0, unit) if unit == "s" else display_unit(float(np.nanmax(np.abs(stacked(name)))), unit)
        for name, unit in (("x", x[1]), ("y", y[1]))
    )
    bounds_y = [edge for curve in drawn for edge in (curve.y - curve.std, curve.y + curve.std)]
    at_x = _Axis.of(factor_x * stacked("x"), _LEFT, _WIDTH - _RIGHT, log=log_x)
    at_y = _Axis.of(factor_y * np.concatenate(bounds_y), _HEIGHT - _BOTTOM, _TOP)
    if not math.isfinite(at_x.high - at_x.low) or not math.isfinite(at_y.high - at_y.low):
        return ""
    parts = [_frame(at_x, at_y, axis_label(x[0], unit_x), axis_label(y[0], unit_y))]
    for i, curve in enumerate(drawn):
        scaled_curve = curve._replace(x=factor_x * curve.x, y=factor_y * curve.y, std=factor_y * curve.std)
        parts.append(_marks(scaled_curve, at_x, at_y, COLOURS[i % len(COLOURS)]))
    return _svg(_HEIGHT, f"{y[0]} against {x[0]}", parts)


def bars_svg(names: Sequence[str], values: Any, label: str) -> str:
    """Draw values as horizontal bars, in the given order.

    Args:
        names: label of each bar.
        values: shape (n,), not negative; a value that is not finite has a label but no bar.
        label: name and unit of the values.

    Returns:
        The SVG element, or an empty string if no value is finite.

    Examples:
        >>> from fricjax.show.thumbnail import bars_svg
        >>> bars_svg(["normal force", "noise"], [99.0, 1.0], "Share [%]").count("<rect")
        2
    """
    sizes = np.asarray(values, float)
    if not np.isfinite(sizes).any():
        return ""
    height = _BAR * len(names) + 24
    longest = float(np.nanmax(np.where(np.isfinite(sizes), sizes, np.nan))) or 1.0
    parts = []
    for i, (name, size) in enumerate(zip(names, sizes.tolist(), strict=True)):
        middle = _BAR * i + 13
        shown = name if len(name) <= 24 else f"{name[:23]}…"
        parts.append(_text(_NAME - 6, middle + 4, shown, "end"))
        if math.isfinite(size):
            length = (_WIDTH - _NAME - 60) * size / longest
            parts.append(
                f'<rect x="{_NAME}" y="{middle - 6}" width="{max(length, 0.5):.1f}" height="12" fill="{COLOURS[0]}"/>'
            )
            parts.append(_text(_NAME + length + 5, middle + 4, f"{size:.2g}", "start"))
    parts.append(_text(_NAME, height - 4, label, "start"))
    return _svg(height, label, parts)


def _finite(curve: Curve, log_x: bool) -> Curve:
    """Reduce a curve to the lowest and highest point of each column."""
    x, y = np.asarray(curve.x, float).ravel(), np.asarray(curve.y, float).ravel()
    std = np.zeros(y.size) if curve.std is None else np.nan_to_num(np.asarray(curve.std, float).ravel(), posinf=0.0)
    kept = np.isfinite(x) & (x > 0 if log_x else True)
    if curve.points or curve.std is not None:
        kept &= np.isfinite(y)
    x, y, std = x[kept], y[kept], std[kept]
    if x.size > 2 * _COLUMNS:
        line = curve.std is None and not curve.points
        at = sketched(y, 2 * _COLUMNS) if line else np.linspace(0, x.size - 1, _COLUMNS).astype(int)
        x, y, std = x[at], y[at], std[at]
    return Curve(x, y, std, curve.points or curve.std is not None, curve.broad)


def sketched(values: np.ndarray, points: int) -> np.ndarray:
    """Select the samples that a picture needs.

    The selection contains the highest and the lowest sample of each group of neighbours.

    Args:
        values: shape (n,); NaN for a missing value.
        points: maximum number of indices.

    Returns:
        Increasing indices, shape (min(n, points),) or fewer.

    Examples:
        >>> import numpy as np
        >>> from fricjax.show.thumbnail import sketched
        >>> sketched(np.array([0.0, 5.0, 1.0, -3.0, 2.0, 0.0]), 2)
        array([1, 3])
    """
    if values.size <= points:
        return np.arange(values.size)
    edges = np.linspace(0, values.size, points // 2 + 1).astype(int)
    known = np.where(np.isfinite(values), values, 0.0)
    spans = list(itertools.pairwise(edges))
    return np.unique([begin + extreme(known[begin:end]) for begin, end in spans for extreme in (np.argmin, np.argmax)])


class _Axis(NamedTuple):
    """Map from values to positions [px]."""

    low: float
    high: float
    begin: float
    end: float
    log: bool

    @classmethod
    def of(cls, values: np.ndarray, begin: float, end: float, *, log: bool = False) -> "_Axis":
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        if log:
            room = (high / low) ** _ROOM if high > low else 2.0
            return cls(low / room, high * room, begin, end, log)
        room = _ROOM * (high - low) if high > low else abs(low) / 2 or 1.0
        return cls(low - room, high + room, begin, end, log)

    def at(self, values: Any) -> np.ndarray:
        low, high, values = (np.log(np.asarray(each)) if self.log else each for each in (self.low, self.high, values))
        return self.begin + (self.end - self.begin) * (np.asarray(values) - low) / (high - low)

    def ticks(self) -> list[float]:
        if self.log:
            decades = range(math.ceil(math.log10(self.low)), math.floor(math.log10(self.high)) + 1)
            return [10.0**each for each in decades] or [self.low, self.high]
        rough = (self.high - self.low) / _TICKS
        size = 10.0 ** math.floor(math.log10(rough))
        step = next(size * factor for factor in (1, 2, 5, 10) if size * factor >= rough)
        return [step * each for each in range(math.ceil(self.low / step), math.floor(self.high / step) + 1)]


def _frame(x: _Axis, y: _Axis, x_label: str, y_label: str) -> str:
    """Draw axes, ticks with numbers, and axis labels."""
    line = '<path d="{}" stroke="currentColor" stroke-opacity="{}" fill="none"/>'
    parts = [line.format(f"M{_LEFT} {_TOP}V{_HEIGHT - _BOTTOM}H{_WIDTH - _RIGHT}", 0.6)]
    for tick, place in zip(x.ticks(), x.at(x.ticks()).tolist(), strict=True):
        parts.append(line.format(f"M{place:.1f} {_TOP}V{_HEIGHT - _BOTTOM}", 0.15))
        parts.append(_text(place, _HEIGHT - _BOTTOM + 13, _number(tick), "middle"))
    for tick, place in zip(y.ticks(), y.at(y.ticks()).tolist(), strict=True):
        parts.append(line.format(f"M{_LEFT} {place:.1f}H{_WIDTH - _RIGHT}", 0.15))
        parts.append(_text(_LEFT - 5, place + 4, _number(tick), "end"))
    parts.append(_text((_LEFT + _WIDTH - _RIGHT) / 2, _HEIGHT - 8, x_label, "middle"))
    middle = (_TOP + _HEIGHT - _BOTTOM) / 2
    parts.append(_text(12, middle, y_label, "middle", f' transform="rotate(-90 12 {middle:.0f})"'))
    return "".join(parts)


def _number(value: float) -> str:
    """Write the number of a tick without trailing zeros."""
    return f"{value:.6g}" if abs(value) < 1e5 else plain(value, 3)


def _marks(curve: Curve, x: _Axis, y: _Axis, colour: str) -> str:
    places = np.column_stack([x.at(curve.x), y.at(curve.y)])
    if not curve.points:
        gaps = ~np.isfinite(places).all(axis=1)
        moves = np.append(True, gaps[:-1])
        path = "".join(
            f"{'M' if move else 'L'}{px:.1f} {py:.1f}"
            for (px, py), move, gap in zip(places.tolist(), moves.tolist(), gaps.tolist(), strict=True)
            if not gap
        )
        width, opacity = (4.5, 0.5) if curve.broad else (1.3, 1)
        return f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="{width}" stroke-opacity="{opacity}"/>'
    low, high = y.at(curve.y - curve.std), y.at(curve.y + curve.std)
    bars = "".join(f"M{px:.1f} {a:.1f}V{b:.1f}" for (px, _), a, b in zip(places.tolist(), low, high, strict=True))
    dots = "".join(f'<circle cx="{px:.1f}" cy="{py:.1f}" r="2.5"/>' for px, py in places.tolist())
    return f'<g fill="{colour}" stroke="{colour}"><path d="{bars}"/>{dots}</g>'


def _text(x: float, y: float, text: str, anchor: str, more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{more}>{escape(text)}</text>'


def _svg(height: int, title: str, parts: Iterable[str]) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" width="{_WIDTH}" height="{height}" '
        'role="img" style="display:block;max-width:100%;margin:4px 0" font-family="sans-serif" font-size="11" '
        f'fill="currentColor"><title>{escape(title)}</title>{"".join(parts)}</svg>'
    )
