"""Errors that reach a user: one line each, saying what is wrong, where, and what to do next."""

from collections.abc import Iterable

INSTALL_TRAIN = "pip install 'gyrocal[train]' --extra-index-url https://download.pytorch.org/whl/cpu"
"""Installs what training needs, with PyTorch for the CPU: PyPI's brings gigabytes of GPU libraries on Linux."""


class GyrocalError(Exception):
    """A failure that is neither the user's nor the device's. ``exit_code`` is what the command line returns."""

    exit_code = 1


class InputError(GyrocalError):
    """A mistake in the usage or the input: in a file, a row or an option."""

    exit_code = 2


class DeviceError(GyrocalError):
    """The device or its port failed."""

    exit_code = 3


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """The nearest name in words, " (did you mean x?)"; empty where none is near."""
    from difflib import get_close_matches

    known = list(names)
    near = get_close_matches(word, known, 1) or [name for name in known if len(word) > 1 and name.startswith(word)]
    return f" (did you mean {near[0]}?)" if near else ""


def first_line(error: BaseException) -> str:
    """The message of another library's exception, in one line."""
    return (str(error).strip() or type(error).__name__).splitlines()[0]
