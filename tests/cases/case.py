"""What the tests know of a friction law."""

from typing import NamedTuple

from fricjax.friction import AbstractFriction

LOAD = 2.0


class LawCase(NamedTuple):
    """A law, and how it behaves at 2 N load."""

    law: AbstractFriction
    static: float  # largest force at rest
    kinetic: float  # force of fast sliding without its viscous and quadratic parts
    passive: bool = True  # whether it takes out energy along every path
    parity: float = -1.0  # factor of the internal states where the motion is mirrored
