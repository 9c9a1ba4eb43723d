"""Signatures of Equinox modules, built from their fields as for dataclasses."""

from collections.abc import Iterator
from typing import Any

import griffe
from griffe import Expr, ExprCall, ExprName


def _of_dataclasses(name: str) -> ExprName:
    return ExprName(name, parent=ExprName("dataclasses"))


class Fields(griffe.Extension):
    """Mark subclasses of `equinox.Module` as dataclasses.

    griffe cannot see in the source that they are dataclasses.
    """

    def on_package(self, *, pkg: griffe.Module, **kwargs: Any) -> None:
        """Mark the classes before griffe builds the signatures of dataclasses."""
        for cls in _classes(pkg):
            if not _is_equinox(cls):
                continue
            cls.decorators.append(griffe.Decorator(_of_dataclasses("dataclass"), lineno=None, endlineno=None))
            for member in cls.members.values():
                value = member.value if member.is_attribute and not member.is_alias else None
                if isinstance(value, ExprCall) and value.canonical_path == "equinox.field":
                    member.value = ExprCall(_of_dataclasses("field"), value.arguments)
                if member.is_attribute and str(member.annotation).startswith(("AbstractClassVar", "AbstractVar")):
                    member.labels |= {"class-attribute"}
                    member.labels -= {"instance-attribute"}


def _classes(parent: griffe.Module | griffe.Class) -> Iterator[griffe.Class]:
    for member in parent.members.values():
        if not member.is_alias and member.is_class:
            yield member
        if not member.is_alias and (member.is_class or member.is_module):
            yield from _classes(member)


def _is_equinox(cls: griffe.Class) -> bool:
    bases = [base for each in (cls, *cls.mro()) for base in each.bases if isinstance(base, Expr)]
    return any(base.canonical_path == "equinox.Module" for base in bases)
