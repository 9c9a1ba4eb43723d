"""What a comparison may rank by, and the names of its candidates."""

from collections.abc import Sequence

from ..errors import UsageError, nearest

CRITERIA = ("bic", "aicc", "held_out")


def check_criterion(criterion: str, held_out: bool) -> None:
    """Refuse a criterion that does not exist, or of which nothing is computed.

    Raises:
        UsageError: names those that there are.
    """
    if criterion not in CRITERIA:
        raise UsageError(
            f"There is no ranking by {criterion!r}.{nearest(criterion, CRITERIA)} Choose one of {', '.join(CRITERIA)}."
        )
    if criterion == "held_out" and not held_out:
        raise UsageError("There is no ranking by 'held_out' with held_out=False: leave it out, or rank by 'bic'.")


def check_different(names: Sequence[str]) -> None:
    """Refuse two candidates of one name.

    Raises:
        UsageError: names all of them.
    """
    if len(set(names)) < len(names):
        raise UsageError(f"The names {', '.join(names)} are not all different. Give each candidate its own.")
