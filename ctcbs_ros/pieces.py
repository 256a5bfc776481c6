"""Searches piece by piece: generators that yield now and then and return what they have found."""

from collections.abc import Generator


def drained(search: Generator):
    """What a search returns, once it has been run through."""
    while True:
        try:
            next(search)
        except StopIteration as found:
            return found.value
