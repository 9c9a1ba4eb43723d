"""Execution of chunks in this process by threads.

Reading files overlaps with fitting. An executor is a generator function of chunks and their work. It yields the result
of each chunk, in any order. It ends early only if it is closed or interrupted.
"""

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

from ..oscillator import cores
from .plan import Chunk
from .work import Done, Work

type Executor = Callable[[Sequence[Chunk], Work], Generator[tuple[Chunk, Done]]]


def in_this_process(chunks: Sequence[Chunk], work: Work) -> Generator[tuple[Chunk, Done]]:
    """Process chunks by as many threads as there are cores.

    After Ctrl-C no further chunk starts, and running chunks are still completed.
    """
    threads, rest = cores(), iter(chunks)
    flying: dict[Future[Done], Chunk] = {}
    with ThreadPoolExecutor(threads) as pool:
        try:
            # One chunk more than threads keeps them busy; more would let results pile up behind a slow disk.
            while True:
                for chunk in rest:
                    flying[pool.submit(attempt, work, chunk)] = chunk
                    if len(flying) > threads:
                        break
                if not flying:
                    return
                for future in wait(flying, return_when=FIRST_COMPLETED).done:
                    yield flying.pop(future), future.result()
        except KeyboardInterrupt:
            running = {future: chunk for future, chunk in flying.items() if not future.cancel()}
            for future, chunk in running.items():
                yield chunk, future.result()
            raise
        finally:
            for future in flying:
                future.cancel()


def attempt(work: Work, chunk: Chunk) -> Done:
    """Process a chunk; an unexpected error gives failed rows."""
    try:
        return work(chunk)
    except Exception as error:
        return work.failed(chunk, error)
