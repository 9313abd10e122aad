"""Errors that reach a user: one line each, saying what is wrong, where, and what to do next."""


class GyrocalError(Exception):
    """Anything else that fails; ``exit_code`` is what the command line returns."""

    exit_code = 1


class InputError(GyrocalError):
    """Bad usage or bad input: a file, a row, an option."""

    exit_code = 2


class DeviceError(GyrocalError):
    """The device or its port failed."""

    exit_code = 3


def first_line(error: BaseException) -> str:
    """What another library's exception says, in one line."""
    return (str(error).strip() or type(error).__name__).splitlines()[0]
