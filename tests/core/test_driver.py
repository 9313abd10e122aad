"""The LSM6DSO's driver against the emulated register file."""

from .conftest import HERE, Build, run


def test_driver_against_the_emulated_part(build: Build) -> None:
    run(build(HERE / "driver.c"), "")
