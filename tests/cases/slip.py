"""Laws of elements that stick and slip."""

from tests.cases.case import LawCase

SLIP: dict[str, LawCase] = {}
