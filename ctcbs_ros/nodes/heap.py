"""A heap that does not grow through a day: what is large goes back to the system when it is done.

glibc takes what a program frees for what it will want again, and lets blocks of up to 32 MB grow
the heap, where smaller ones that stay keep them from being given back (mallopt(3)). The matrices
of a motion's stability are such blocks.
"""

import ctypes

# M_MMAP_THRESHOLD of glibc's malloc.h, and from which size on blocks are apart [bytes]: what glibc
# begins with, and keeps once it is told.
_OPTION, _APART = -3, 128 * 1024


def keep_large_blocks_apart() -> bool:
    """Set it for this process; whether that was possible, which it is with glibc alone."""
    try:
        return bool(ctypes.CDLL(None).mallopt(_OPTION, _APART))
    except (AttributeError, OSError):
        return False
