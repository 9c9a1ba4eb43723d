"""Compiled functions that a later process need not trace: their lowered programs are kept beside the compiled ones.

What XLA has compiled JAX keeps by itself, but to know which of it is wanted, each process traces and lowers the
function anew, which for a bristle law takes longer than its fits. So what was lowered is kept in the same folder, in
the exchange format of JAX, under a name made of all that it depends on: the source of this package, the versions of
those that it is built on, and the classes, settings and array shapes of the arguments. Only arguments made of classes
of this package are known by their names; with a law that somebody else wrote everything is as without a folder, for
its source may change while its name does not. Whoever changes functions or constants of this package in a running
process switches the folder off.
"""

import contextlib
import dataclasses
import functools
import gc
import hashlib
import threading
import weakref
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Sequence
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
from jax import export
from jax.core import Tracer

from ..show.working import working
from .cache import keep, recall
from .kernels import OPTIONS, in_few_kernels
from .session import processor, ready, waiting

# A program of a fit holds four to eight hundred mappings of memory, of which a process may have 65,530, and there are
# three functions. What goes is loaded again in half a second; few sessions see as many laws and shapes.
MOST = 24

# Tracing holds the lock of the interpreter, so that threads which trace by turns all have to wait for all of it; one
# after the other, the first compiles while the next one traces.
_TRACING = threading.RLock()


@contextlib.contextmanager
def _tracing() -> Iterator[None]:
    """Trace, one thread at a time, and without looking for garbage.

    Tracing makes a million objects that stay until its end, among which there is nothing to collect: looking for it
    takes a fifth of the time.
    """
    with _TRACING:
        collects = gc.isenabled()
        gc.disable()
        try:
            yield
        finally:
            if collects:
                gc.enable()


class _Bare(eqx.Module):
    """A module without fields, to see what equinox keeps of one beside them."""


_NOTHING = tuple(map(type, jax.tree.structure(_Bare()).node_data()[1]))
_PLAIN = (type(None), bool, int, float, str, *_NOTHING)
_CONTAINERS = (tuple, list, dict, type(None))
# Of what JAX is set to, what changes the program that a function is traced to.
_SETTINGS = ("jax_enable_x64", "jax_default_matmul_precision", "jax_numpy_dtype_promotion", "jax_random_seed_offset")
# Under these nothing is kept: they put checks into a program, or run it step by step.
_WATCHED = ("jax_debug_nans", "jax_debug_infs", "jax_disable_jit", "jax_enable_checks")


_PROGRAMS: "weakref.WeakSet[Program]" = weakref.WeakSet()


def forget_programs() -> None:
    """Let go of all compiled programs of this package, as `jax.clear_caches` does of those of JAX."""
    for program in list(_PROGRAMS):
        program.forget()


class Shape(NamedTuple):
    """What arguments must share with others to share a compiled program.

    Attributes:
        structure: of the arguments as a pytree.
        settings: their leaves that are no arrays, each in its place, with None for those that are.
        arrays: shape and kind of number of each array.
    """

    structure: Any
    settings: tuple[Any, ...]
    arrays: tuple[tuple[tuple[int, ...], Any], ...]


def split(args: Any) -> tuple[Shape, list[Any]]:
    """Shape of a pytree, and its arrays."""
    leaves, structure = jax.tree.flatten(args)
    arrays = [leaf for leaf in leaves if _is_array(leaf)]
    settings = tuple([None if _is_array(leaf) else leaf for leaf in leaves])
    return Shape(structure, settings, tuple([(leaf.shape, leaf.dtype) for leaf in arrays])), arrays


def of_shape(shape: Shape, arrays: Sequence[Any]) -> Any:
    """The pytree of a shape with some arrays."""
    rest = iter(arrays)
    return jax.tree.unflatten(
        shape.structure, [next(rest) if setting is None else setting for setting in shape.settings]
    )


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, np.ndarray | np.generic | jax.Array)


class Program[*Arguments, Result]:
    """A function compiled for each shape of its arguments, as `equinox.filter_jit` does, and kept.

    The programs used last are held, `most` of them, so that a process may see any number of shapes.

    Args:
        function: what to compile; its arguments and its result are pytrees.
        like: from the same arguments a pytree of the structure that the result has, whatever its leaves.
        most: how many programs are held.
        kernels: whether operations are gathered into few kernels. Not so for a loop that fills long arrays step by
            step, which a kernel copies at each.

    Examples:
        >>> twice = Program(lambda x: 2 * x, like=lambda x: x)
        >>> twice(np.arange(3.0)).tolist()
        [0.0, 2.0, 4.0]
    """

    def __init__(
        self,
        function: Callable[[*Arguments], Result],
        like: Callable[[*Arguments], Any],
        most: int = MOST,
        *,
        kernels: bool = True,
    ) -> None:
        self._function, self._like, self._most, self._kernels = function, like, most, kernels
        self._programs: OrderedDict[Hashable, _Compiled] = OrderedDict()
        self._lock = threading.Lock()
        functools.update_wrapper(self, function)
        _PROGRAMS.add(self)

    def forget(self) -> None:
        """Let go of what is held."""
        with self._lock:
            self._programs.clear()

    def __call__(self, *args: *Arguments) -> Result:
        shape, arrays = split(args)
        if any(isinstance(leaf, Tracer) for leaf in arrays):
            return self._function(*args)
        return self._program(shape).of(args, shape, arrays)

    def is_compiled(self, *args: *Arguments) -> bool:
        """Whether a program for such arguments is at hand, so that a call waits for its result alone.

        Examples:
            >>> Program(lambda x: 2 * x, like=lambda x: x).is_compiled(np.arange(3.0))
            False
        """
        with self._lock:
            known = self._programs.get(split(args)[0])
        return known is not None and known.is_compiled

    def compile_beside(self, *args: *Arguments) -> None:
        """Begin to compile for arguments of such shapes, by a thread of its own while the caller goes on.

        A call that comes before its end waits for it, and tells what was wrong.

        Examples:
            >>> twice = Program(lambda x: 2 * x, like=lambda x: x)
            >>> twice.compile_beside(np.zeros(3))
            >>> twice(np.arange(3.0)).tolist()
            [0.0, 2.0, 4.0]
        """
        shape, arrays = split(args)
        compiled = self._program(shape)

        def work() -> None:
            with contextlib.suppress(Exception):
                compiled.compiled(args, shape, arrays)

        threading.Thread(target=work, name=f"compiling {self._function.__name__}").start()

    def _program(self, shape: Shape) -> "_Compiled":
        with self._lock:
            if shape not in self._programs:
                self._programs[shape] = _Compiled(self._function, self._like, self._kernels)
            self._programs.move_to_end(shape)
            while len(self._programs) > self._most:
                self._programs.popitem(last=False)
            return self._programs[shape]


class _Compiled:
    """A function for one shape of arguments: compiled once, whichever thread comes first."""

    def __init__(self, function: Callable, like: Callable, kernels: bool) -> None:
        self._function, self._like, self._kernels = function, like, kernels
        self._lock = threading.Lock()
        self._call: Callable | None = None
        self._structure: Any = None

    @property
    def is_compiled(self) -> bool:
        return self._call is not None

    def of(self, args: tuple, shape: Shape, arrays: list[Any]) -> Any:
        results = self.compiled(args, shape, arrays)(arrays)
        return jax.tree.unflatten(self._structure, results)

    def compiled(self, args: tuple, shape: Shape, arrays: list[Any]) -> Callable:
        if self._call is None:
            with waiting(), self._lock:
                if self._call is None:
                    ready()
                    with working("compiling"), jax.default_device(processor()):
                        self._call = self._made(args, shape, arrays)
        return self._call

    def _made(self, args: tuple, shape: Shape, arrays: list[Any]) -> Callable:
        def flat(arrays: list[Any]) -> list[Any]:
            result, self._structure = jax.tree.flatten(self._function(*of_shape(shape, arrays)))
            return result

        flat.__name__ = self._function.__name__
        if self._kernels:
            # What XLA refuses to put into a kernel is compiled operation by operation.
            with contextlib.suppress(jax.errors.JaxRuntimeError):
                return self._kept(in_few_kernels(flat), args, shape, arrays).compile(OPTIONS)
            return jax.jit(flat).lower(arrays).compile()
        return self._kept(flat, args, shape, arrays).compile()

    def _kept(self, flat: Callable, args: tuple, shape: Shape, arrays: list[Any]) -> Any:
        """The lowered program, recalled or kept for another time."""
        place = _place(self._function, shape)
        if place is None:
            return _lowered(flat, arrays)
        likely = jax.tree.structure(self._like(*args))
        data = recall(place)
        traced = None if data is None else export.deserialize(bytearray(data))
        if traced is None or len(traced.out_avals) != likely.num_leaves:
            try:
                with _tracing():
                    traced = export.export(jax.jit(flat), platforms=["cpu"])(arrays)
            except NotImplementedError:
                # It calls the host, where only this process knows what to call.
                return _lowered(flat, arrays)
            if self._structure != likely:
                raise TypeError(f"{flat.__name__} returns {self._structure}, and its programs are kept as {likely}.")
            keep(place, bytes(traced.serialize()))
        self._structure = likely
        traced = _bare(traced)

        def kept(arrays: list[Any]) -> Any:
            return traced.call(arrays)

        kept.__name__ = flat.__name__
        return jax.jit(kept).lower(arrays)


def _lowered(flat: Callable, arrays: list[Any]) -> Any:
    with _tracing():
        return jax.jit(flat).lower(arrays)


def _bare(traced: export.Exported) -> export.Exported:
    """A traced program that asks for no LAPACK where it calls none.

    JAX gets that of SciPy ready for whatever was traced for a CPU, and what it imports for it takes as long as the
    rest of a first fit. So such a program is no longer said to be traced for one, and called all the same.
    """
    if b"lapack" in traced.mlir_module_serialized:
        return traced
    checks = (*traced.disabled_safety_checks, export.DisabledSafetyCheck.platform())
    return dataclasses.replace(traced, platforms=("any",), disabled_safety_checks=checks)


def _place(function: Callable, shape: Shape) -> Path | None:
    """The file of a traced program; None where it cannot be kept."""
    folder = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    source = _source()
    watched = any(getattr(jax.config, each) for each in _WATCHED)
    if source is None or not folder or not Path(folder).is_dir() or watched or not _is_ours(function):
        return None
    # What is kept was traced for the processor.
    if processor() is None:
        return None
    try:
        parts = [*_names(shape.structure), *map(_plain, shape.settings)]
    except TypeError:
        return None
    known = [
        function.__module__,
        function.__qualname__,
        source,
        *(str(getattr(jax.config, each)) for each in _SETTINGS),
    ]
    arrays = [f"{dtype}{sizes}" for sizes, dtype in shape.arrays]
    digest = hashlib.blake2b("\n".join([*known, *parts, *arrays]).encode(), digest_size=16)
    return Path(folder) / f"fricjax-traced-{digest.hexdigest()}"


def _names(structure: Any) -> list[str]:
    """Classes and settings of all nodes of a structure.

    Raises:
        TypeError: a class that is not of this package, or a setting that is no plain value.
    """
    node = structure.node_data()
    if node is None:
        return ["*"]
    kind, settings = node
    if not (_is_ours(kind) or kind in _CONTAINERS):
        raise TypeError(kind)
    text = f"{kind.__module__}.{kind.__qualname__} {_plain(settings)}"
    return [text, *(part for child in structure.children() for part in _names(child)), "."]


def _is_ours(value: Any) -> bool:
    """Whether something is a class or a function of this package."""
    return isinstance(value, type | FunctionType) and value.__module__.split(".")[0] == __name__.split(".")[0]


def _plain(value: Any) -> str:
    """The text of a setting made of plain values.

    Raises:
        TypeError: it is made of something else, whose text may not tell all of it.
    """
    if isinstance(value, tuple | list):
        return f"({','.join(map(_plain, value))})"
    if type(value) in _PLAIN or (isinstance(value, type) and _is_ours(value)):
        return repr(value)
    raise TypeError(value)


@functools.cache
def _source() -> str | None:
    """A digest of the source of this package and the versions of what it is built on; None where it is in no folder."""
    from importlib.metadata import version

    digest = hashlib.blake2b(digest_size=16)
    for library in ("jax", "jaxlib", "equinox", "diffrax", "lineax", "optimistix", "numpy"):
        digest.update(f"{library} {version(library)}\n".encode())
    root = Path(__file__).parents[1]
    if not root.is_dir():
        return None
    for path in sorted(root.rglob("*.py")):
        digest.update(str(path.relative_to(root)).encode() + path.read_bytes())
    return digest.hexdigest()
