"""Arrays with names and units: data sets of xarray, from the results that hold them."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import needed


class Variable(NamedTuple):
    """One array of a data set.

    Attributes:
        dims: names of its axes.
        values: its numbers, or texts.
        unit: SI unit; empty: none.
        meaning: what it is, in words.
    """

    dims: str | Sequence[str]
    values: Any
    unit: str = ""
    meaning: str = ""


def dataset(variables: Mapping[str, Variable], coordinates: Mapping[str, Variable], **facts: Any) -> Any:
    """A data set of xarray that netCDF can hold: units and meanings as attributes of each variable.

    Args:
        variables: the arrays by name.
        coordinates: those that count along the axes.
        **facts: attributes of the whole: texts, numbers, and sequences of texts, which become lines.

    Raises:
        UsageError: xarray is not installed; the sentence says how to.

    Examples:
        >>> from fricjax.show.labelled import Variable, dataset
        >>> time = Variable("t", [0.0, 0.1], "s")
        >>> made = dataset({"x": Variable("t", [0.0, 2e-3], "m")}, {"t": time}, source="run.csv")
        >>> made["x"].attrs["units"], made["x"].sel(t=0.1).item()
        ('m', 0.002)
    """
    xarray = needed("A data set", "xarray", "interchange")

    def labelled(variable: Variable) -> tuple[Any, Any, dict[str, str]]:
        texts = {"units": variable.unit, "long_name": variable.meaning}
        return variable.dims, np.asarray(variable.values), {name: text for name, text in texts.items() if text}

    attributes = {name: "\n".join(fact) if isinstance(fact, list | tuple) else fact for name, fact in facts.items()}
    return xarray.Dataset(
        {name: labelled(each) for name, each in variables.items()},
        {name: labelled(each) for name, each in coordinates.items()},
        # netCDF knows no truth values.
        {name: int(fact) if isinstance(fact, bool) else fact for name, fact in attributes.items()},
    )
