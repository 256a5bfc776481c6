"""Linear algebra on one thread: the solver's matrices only lose by a second one.

Beside other work a second thread costs tenfold: it is waited for.
"""

from contextlib import AbstractContextManager
from functools import lru_cache

from threadpoolctl import ThreadpoolController


def one_blas_thread() -> AbstractContextManager:
    """A block in which BLAS and LAPACK use one thread."""
    return _libraries().limit(limits=1, user_api="blas")


@lru_cache(maxsize=1)
def _libraries() -> ThreadpoolController:
    # Looking for the loaded libraries takes milliseconds.
    return ThreadpoolController()
