"""Signatures of modules of equinox: their fields are arguments, as those of dataclasses are."""

from collections.abc import Iterator
from typing import Any

import griffe
from griffe import Expr, ExprCall, ExprName


def _of_dataclasses(name: str) -> ExprName:
    return ExprName(name, parent=ExprName("dataclasses"))


class Fields(griffe.Extension):
    """Tells griffe that what derives from `equinox.Module` is a dataclass, which it does not see in the source."""

    def on_package(self, *, pkg: griffe.Module, **kwargs: Any) -> None:
        """Marks the classes before griffe makes the signatures of dataclasses."""
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
