"""Errors that reach a user: one line each, saying what is wrong, where, and what to do next."""

from collections.abc import Iterable

INSTALL_TRAIN = "pip install 'gyrocal[train]' --extra-index-url INDEX"
INDEX_IS = "INDEX is the address of PyTorch's builds for the CPU, which its installation page gives"
"""How to install what training needs. PyPI's PyTorch brings gigabytes of GPU libraries on Linux."""
MOST_NAMED = 14
"""More names than these make a line too long for a terminal."""


class GyrocalError(Exception):
    """A failure that is neither the user's nor the device's. ``exit_code`` is what the command line returns."""

    exit_code = 1


class InputError(GyrocalError):
    """A mistake in the usage or the input: in a file, a row or an option.

    ``proposed`` are lines that the user may take from: options to give, one a line.
    """

    exit_code = 2

    def __init__(self, text: str, proposed: Iterable[str] = ()) -> None:
        super().__init__(text)
        self.proposed = tuple(proposed)


class DeviceError(GyrocalError):
    """The device or its port failed."""

    exit_code = 3


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """The nearest name in words, " (did you mean x?)"; empty where none is near."""
    from difflib import get_close_matches

    known = list(names)
    near = get_close_matches(word, known, 1) or [name for name in known if len(word) > 1 and name.startswith(word)]
    return f" (did you mean {near[0]}?)" if near else ""


def there_are(names: Iterable[str], listed_by: str) -> str:
    """The names in words, or the command that lists them where they are too many for a line."""
    known = list(names)
    return f"there are {', '.join(known)}" if len(known) <= MOST_NAMED else f"{listed_by} lists them"


def first_line(error: BaseException) -> str:
    """The message of another library's exception, in one line."""
    return (str(error).strip() or type(error).__name__).splitlines()[0]
