"""The one error that means: the user's input is wrong."""


class InputError(ValueError):
    """Bad input; the message names what is wrong, where, and what is allowed.

    The command line prints the message as one line on standard error and exits with 2.
    """
