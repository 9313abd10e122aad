"""A few cases of the work part, drawn once."""

from __future__ import annotations

import pytest

from .drawn import Case, Draw


@pytest.fixture(scope="session")
def edge() -> Case:
    """A bias over temperature beside a thermal lag, on a stated constant rate."""
    return Draw("work", "edge", 0).case()


@pytest.fixture(scope="session")
def misspecified() -> Case:
    return Draw("work", "misspecified", 1).case()
