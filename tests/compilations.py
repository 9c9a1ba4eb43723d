"""Counter of XLA compilations."""

import contextlib
from collections.abc import Iterator

import jax

_COMPILED: list[str] = []


def _note(event: str, duration_secs: float, **kwargs: str | int) -> None:
    if event == "/jax/core/compile/backend_compile_duration":
        _COMPILED.append(str(kwargs.get("fun_name", event)))


jax.monitoring.register_event_duration_secs_listener(_note)


@contextlib.contextmanager
def compilations() -> Iterator[list[str]]:
    """Yield the list of programs that XLA compiles inside the block."""
    _COMPILED.clear()
    seen: list[str] = []
    yield seen
    seen += _COMPILED
