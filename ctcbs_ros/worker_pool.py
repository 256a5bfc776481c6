"""Processes on every core, that end with their parent and stop at once when it is interrupted."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager


@contextmanager
def worker_pool() -> Iterator[ProcessPoolExecutor]:
    """A pool of worker processes; whatever ends the block early ends them, too.

    Yields
    ------
    ProcessPoolExecutor
        With as many workers as there are cores.
    """
    # Spawned, not forked: the parent may run ROS's threads.
    context = multiprocessing.get_context("spawn")
    with _Pool(mp_context=context, initializer=_end_with_parent) as pool:
        try:
            yield pool
        except BaseException:
            # A worker may be compiling for ten seconds: the user has said stop.
            for worker in multiprocessing.active_children():
                worker.terminate()
            # Waited for: a pool left behind complains of its closed pipe when Python exits.
            pool.shutdown(cancel_futures=True)
            raise


class _Pool(ProcessPoolExecutor):
    """A pool whose workers never see SIGINT.

    A terminal sends it to them as well, and each would print its traceback.
    """

    def submit(self, *call, **arguments):
        """Submit a call; a worker that is started for it inherits the blocked signal."""
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            with _interrupt_put_off():
                return super().submit(*call, **arguments)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _interrupt_put_off() -> Iterator[None]:
    """Put SIGINT and SIGTERM off to the end of the block.

    Another thread may take a signal that this one blocks (a progress bar has one), and a worker
    half started complains that its pipe is empty.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came = []
    before = {
        number: signal.signal(number, lambda number, _: came.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


def _end_with_parent() -> None:
    """End this worker when its parent is killed: the pool alone would wait for work for ever."""
    def wait():
        multiprocessing.parent_process().join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
