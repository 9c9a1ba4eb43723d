"""Names of the losses, known without their formulas."""

from ..errors import UsageError, nearest

LOSSES: tuple[str, ...] = ("squares", "huber", "soft_l1", "cauchy")


def check_loss(name: str) -> None:
    """Refuse a name that no loss has.

    Raises:
        UsageError: names those that there are.
    """
    if name not in LOSSES:
        raise UsageError(f"There is no loss {name!r}.{nearest(name, LOSSES)} Choose one of {', '.join(LOSSES)}.")
