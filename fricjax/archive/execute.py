"""Chunks done in this process, without any server: by threads, so that one reads its files while another fits its runs.

An executor is a generator function from chunks and what is done with each: it yields what became of them, in any order,
with an answer for each chunk, and ends early only where it is closed or interrupted.
"""

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

from ..oscillator import cores
from .plan import Chunk
from .work import Done, Work

type Executor = Callable[[Sequence[Chunk], Work], Generator[tuple[Chunk, Done]]]


def in_this_process(chunks: Sequence[Chunk], work: Work) -> Generator[tuple[Chunk, Done]]:
    """Do chunks by as many threads as there are cores.

    After Ctrl-C no further chunk is begun, and what is at work is still given.
    """
    threads, rest = cores(), iter(chunks)
    flying: dict[Future[Done], Chunk] = {}
    with ThreadPoolExecutor(threads) as pool:
        try:
            # One more than threads, so that none waits for the next; results do not pile up behind a slow disk.
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
    """What became of a chunk, also where the program failed with it: what a worker does, wherever it is."""
    try:
        return work(chunk)
    except Exception as error:
        return work.failed(chunk, error)
