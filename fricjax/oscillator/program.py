"""Compiled functions that a later process need not trace again.

JAX keeps the programs that XLA has compiled. To find one, each process traces and lowers the function again, which for
a bristle law takes longer than its fits. `Program` therefore keeps the lowered programs as well, in the same folder and
in the exchange format of JAX. The file name is a digest of everything the program depends on: the source of this
package, the versions of its dependencies, and the classes, settings and array shapes of the arguments. Programs are
kept only if all classes of the arguments belong to this package: the source of a class from elsewhere may change under
the same name. If you change functions or constants of this package in a running process, switch the folder off.
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
from .session import processor, ready, waiting

try:
    from . import kernels
except ImportError:  # the marks are made of experimental names of JAX; without them programs compile as they are
    kernels = None

# A program of a fit holds 400 to 800 memory mappings, a process may have 65,530, and there are three functions. A
# dropped program is loaded again in half a second.
MOST = 24

# Tracing holds the lock of the interpreter. One thread traces at a time, so that the first one compiles while the next
# one traces.
_TRACING = threading.RLock()


@contextlib.contextmanager
def _tracing() -> Iterator[None]:
    """Let one thread trace, without garbage collection.

    Tracing makes a million objects that stay until its end, so garbage collection would waste a fifth of the time.
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
    """Module without fields; shows the settings that Equinox adds to each module."""


_NOTHING = tuple(map(type, jax.tree.structure(_Bare()).node_data()[1]))
_PLAIN = (type(None), bool, int, float, str, *_NOTHING)
_CONTAINERS = (tuple, list, dict, type(None))
# Settings of JAX that change a traced program.
_SETTINGS = ("jax_enable_x64", "jax_default_matmul_precision", "jax_numpy_dtype_promotion", "jax_random_seed_offset")
# Settings that put checks into a program or run it step by step; such programs are not kept.
_WATCHED = ("jax_debug_nans", "jax_debug_infs", "jax_disable_jit", "jax_enable_checks")


_PROGRAMS: "weakref.WeakSet[Program]" = weakref.WeakSet()


def forget_programs() -> None:
    """Drop all compiled programs of this package, as `jax.clear_caches` does for JAX."""
    for program in list(_PROGRAMS):
        program.forget()


class Shape(NamedTuple):
    """Key of a compiled program: arguments with the same shape share it.

    Attributes:
        structure: pytree structure of the arguments.
        settings: leaves that are not arrays, in order, with None for each array.
        arrays: shape and dtype of each array.
    """

    structure: Any
    settings: tuple[Any, ...]
    arrays: tuple[tuple[tuple[int, ...], Any], ...]


def split(args: Any) -> tuple[Shape, list[Any]]:
    """Split a pytree into its shape and its arrays."""
    leaves, structure = jax.tree.flatten(args)
    arrays = [leaf for leaf in leaves if _is_array(leaf)]
    settings = tuple([None if _is_array(leaf) else leaf for leaf in leaves])
    return Shape(structure, settings, tuple([(leaf.shape, leaf.dtype) for leaf in arrays])), arrays


def of_shape(shape: Shape, arrays: Sequence[Any]) -> Any:
    """Rebuild a pytree from its shape and arrays."""
    rest = iter(arrays)
    return jax.tree.unflatten(
        shape.structure, [next(rest) if setting is None else setting for setting in shape.settings]
    )


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, np.ndarray | np.generic | jax.Array)


class Program[*Arguments, Result]:
    """Function that is compiled for each shape of its arguments and kept.

    It works as `equinox.filter_jit`, and holds the `most` programs used last.

    Args:
        function: the function to compile; its arguments and its result are pytrees.
        like: maps the same arguments to a pytree with the structure of the result; its leaves are ignored.
        most: number of programs to hold.
        kernels: collect operations into few kernels. Use False for a loop that fills long arrays step by step, because
            a kernel copies such an array at each step.

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
        """Drop the programs that are held."""
        with self._lock:
            self._programs.clear()

    def __call__(self, *args: *Arguments) -> Result:
        shape, arrays = split(args)
        if any(isinstance(leaf, Tracer) for leaf in arrays):
            return self._function(*args)
        return self._program(shape).of(args, shape, arrays)

    def is_compiled(self, *args: *Arguments) -> bool:
        """Return True if a program for such arguments is compiled.

        Examples:
            >>> Program(lambda x: 2 * x, like=lambda x: x).is_compiled(np.arange(3.0))
            False
        """
        with self._lock:
            known = self._programs.get(split(args)[0])
        return known is not None and known.is_compiled

    def compile_beside(self, *args: *Arguments) -> None:
        """Start compiling for such arguments in a background thread.

        A call during compilation waits for its end, and raises its error.

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
    """Function for one shape of arguments, compiled once by the first thread."""

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
        if self._kernels and kernels is not None and kernels.enabled():
            # If XLA rejects a kernel, the program is compiled without kernels.
            with contextlib.suppress(jax.errors.JaxRuntimeError):
                lowered = self._kept(kernels.in_few_kernels(flat), "few kernels", args, shape, arrays)
                return lowered.compile(kernels.OPTIONS)
            return jax.jit(flat).lower(arrays).compile()
        return self._kept(flat, "plain", args, shape, arrays).compile()

    def _kept(self, flat: Callable, form: str, args: tuple, shape: Shape, arrays: list[Any]) -> Any:
        """Return the lowered program, from the folder if possible."""
        place = _place(self._function, form, shape)
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
                # A host callback belongs to this process.
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
    """Remove the request for LAPACK from a program without LAPACK calls.

    JAX imports the LAPACK of SciPy for each program that was traced for a CPU, which takes as long as the rest of a
    first fit. This function declares the program as traced for any platform, which prevents the import.
    """
    if b"lapack" in traced.mlir_module_serialized:
        return traced
    checks = (*traced.disabled_safety_checks, export.DisabledSafetyCheck.platform())
    return dataclasses.replace(traced, platforms=("any",), disabled_safety_checks=checks)


def _place(function: Callable, form: str, shape: Shape) -> Path | None:
    """Return the file of a traced program, None if not kept."""
    folder = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    source = _source()
    watched = any(getattr(jax.config, each) for each in _WATCHED)
    if source is None or not folder or not Path(folder).is_dir() or watched or not _is_ours(function):
        return None
    # Programs are traced for the CPU.
    if processor() is None:
        return None
    try:
        parts = [*_names(shape.structure), *map(_plain, shape.settings)]
    except TypeError:
        return None
    known = [
        function.__module__,
        function.__qualname__,
        form,
        source,
        *(str(getattr(jax.config, each)) for each in _SETTINGS),
    ]
    arrays = [f"{dtype}{sizes}" for sizes, dtype in shape.arrays]
    digest = hashlib.blake2b("\n".join([*known, *parts, *arrays]).encode(), digest_size=16)
    return Path(folder) / f"fricjax-traced-{digest.hexdigest()}"


def _names(structure: Any) -> list[str]:
    """List classes and settings of all nodes of a pytree structure.

    Raises:
        TypeError: a class does not belong to this package, or a setting is not a plain value.
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
    """Return True for a class or a function of this package."""
    return isinstance(value, type | FunctionType) and value.__module__.split(".")[0] == __name__.split(".")[0]


def _plain(value: Any) -> str:
    """Return a setting as text.

    Raises:
        TypeError: the setting contains more than plain values, so its text may be incomplete.
    """
    if isinstance(value, tuple | list):
        return f"({','.join(map(_plain, value))})"
    if type(value) in _PLAIN or (isinstance(value, type) and _is_ours(value)):
        return repr(value)
    raise TypeError(value)


@functools.cache
def _source() -> str | None:
    """Return a digest of source and dependency versions, None without source folder."""
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
