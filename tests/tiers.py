"""Cases of a parametrised test, divided into core and slow ones."""

from collections.abc import Iterable
from typing import Any

import pytest


def cases(values: Iterable[Any], core: Iterable[Any]) -> list[Any]:
    """Mark all values as slow that are not in `core`."""
    core = list(core)
    return [pytest.param(value, marks=() if value in core else pytest.mark.slow) for value in values]
