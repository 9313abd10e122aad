"""The core compiled on this machine: cache, errors, parallel builds."""

import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gyrocal.core import library, networks
from gyrocal.errors import GyrocalError, InputError
from gyrocal_firmware import INCLUDE

NOT_OPTIMISED = "-O0"
"""For what is compiled only to be another build: it takes a third of the time."""


@pytest.fixture(autouse=True)
def cache(require_tool: Callable[[str], str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    require_tool("cc")
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    library.compiler.cache_clear()
    return tmp_path / "cache" / "gyrocal"


def source(folder: Path, value: int) -> Path:
    path = folder / "answer.c"
    path.write_text(f'#include "more.h"\nint answer(void) {{ return {value} + MORE; }}\n')
    return path


def test_a_build_is_kept_and_follows_sources_headers_and_flags(tmp_path: Path, cache: Path) -> None:
    (tmp_path / "more.h").write_text("#define MORE 0\n")
    first = library.build("answer", [source(tmp_path, 1)], [tmp_path], library.SHARED)
    stamp = first.stat().st_mtime_ns
    assert library.build("answer", [source(tmp_path, 1)], [tmp_path], library.SHARED) == first
    assert first.stat().st_mtime_ns == stamp, "not built again"

    second = library.build("answer", [source(tmp_path, 2)], [tmp_path], library.SHARED)
    (tmp_path / "more.h").write_text("#define MORE 1\n")
    third = library.build("answer", [source(tmp_path, 2)], [tmp_path], library.SHARED)
    fourth = library.build("answer", [source(tmp_path, 2)], [tmp_path], (*library.SHARED, "-DOTHER"))
    assert len({first, second, third, fourth}) == 4
    assert {path.name for path in cache.iterdir()} == {p.name for p in (first, second, third, fourth)}


def test_a_refusal_names_the_place_and_leaves_nothing(tmp_path: Path, cache: Path) -> None:
    (tmp_path / "more.h").write_text("#define MORE nonsense\n")
    with pytest.raises(GyrocalError, match=r"answer: .*nonsense") as caught:
        library.build("answer", [source(tmp_path, 1)], [tmp_path], library.SHARED)
    assert caught.value.exit_code == 1
    assert list(cache.iterdir()) == []


def test_no_compiler_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler -O2")
    with pytest.raises(GyrocalError, match=r"no-such-compiler.*install gcc or clang"):
        library.Core()


ZIG = """import subprocess, sys
assert sys.argv[1:3] == ["cc", "-mcpu=baseline"]
sys.exit(subprocess.run([{cc!r}, *sys.argv[3:]]).returncode)
"""


def test_without_a_compiler_of_the_system_that_of_a_package_serves(
    require_tool: Callable[[str], str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A package that is called as ziglang is, and calls this machine's compiler, which is not on the PATH."""
    (tmp_path / "ziglang").mkdir()
    (tmp_path / "ziglang" / "__main__.py").write_text(ZIG.format(cc=require_tool("cc")))
    (tmp_path / "more.h").write_text("#define MORE 0\n")
    find = shutil.which
    monkeypatch.setattr(shutil, "which", lambda name: None if name == "cc" else find(name))
    with pytest.raises(GyrocalError, match=r"pip install ziglang"):
        library.compiler()
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    built = library.build("answer", [source(tmp_path, 1)], [tmp_path], library.SHARED)
    assert ctypes.CDLL(str(built)).answer() == 1
    monkeypatch.setenv("CC", "no-such-compiler")
    library.compiler.cache_clear()
    with pytest.raises(GyrocalError, match="no-such-compiler"):
        library.compiler()


@pytest.mark.wide
@pytest.mark.slow
def test_another_compiler_is_another_build(
    require_tool: Callable[[str], str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    clang = require_tool("clang")
    monkeypatch.setattr(library, "FLAGS", (*library.FLAGS, NOT_OPTIMISED))
    (tmp_path / "more.h").write_text("#define MORE 0\n")
    answer = [source(tmp_path, 1)], [tmp_path], library.SHARED
    by_cc = library.build("answer", *answer)
    monkeypatch.setenv("CC", clang)
    library.compiler.cache_clear()
    assert library.build("answer", *answer) != by_cc
    assert library.Core().exp(1.0) == np.float32(np.e)


@pytest.mark.wide
@pytest.mark.slow
def test_processes_that_build_at_once_agree(cache: Path) -> None:
    flags = f"library.FLAGS = (*library.FLAGS, {NOT_OPTIMISED!r})"
    code = f"from gyrocal.core import library; {flags}; print(library.Core().tanh(0.5).item())"
    running = [subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) for _ in range(2)]
    assert len({process.communicate(timeout=60)[0] for process in running}) == 1
    assert [process.returncode for process in running] == [0] * 2
    assert len(list(cache.iterdir())) == 1


@pytest.mark.wide
@pytest.mark.slow
def test_the_simulated_device_is_an_executable_of_the_headers_given(tmp_path: Path) -> None:
    shipped = library.build_sim()
    subprocess.run([shipped, "--help"], capture_output=True, timeout=10, check=False)
    (tmp_path / "weights.h").write_text((INCLUDE / "weights.h").read_text() + "/* another */\n")
    assert library.build_sim(tmp_path) != shipped
    (tmp_path / "weights.h").write_text("#error not mine\n")
    with pytest.raises(GyrocalError, match="not mine"):
        library.build_sim(tmp_path)


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: "",
        lambda text: text[: len(text) // 2],
        lambda text: text.replace("gc_net_fc2_code", "gc_net_gone", 1),
        lambda text: "\x7fELF",
    ],
)
def test_a_malformed_header_is_one_line_of_bad_input(damage: Callable[[str], str], tmp_path: Path) -> None:
    header = tmp_path / "weights.h"
    header.write_text(damage((INCLUDE / "weights.h").read_text()))
    with pytest.raises(InputError, match=r"weights\.h: not a network's header") as caught:
        networks.CoreNetwork(header)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="gyrocal export"):
        networks.CoreNetwork(tmp_path / "absent.h")


def test_a_network_header_says_what_it_is_for() -> None:
    net = networks.CoreNetwork()
    assert (net.name, net.rate_hz, net.table_dps, net.window, net.outputs) == ("paper", 145.0, 78.0, 290, 2)
    assert net.run(np.zeros((0, 290)), np.zeros((0, 290)), 78.0, -78.0).shape == (0, 2)


def damaged(built: Path) -> None:
    built.write_bytes(built.read_bytes()[:1000])


def swapped(built: Path) -> None:
    """A sound library of other code, moved to the place of the one that is wanted."""
    other = built.with_name("other.c")
    other.write_text("int answer(void) { return 666; }\n")
    subprocess.run(["cc", *library.SHARED, other, "-o", built], check=True)
    other.unlink()


def linked(built: Path) -> None:
    kept = built.rename(built.with_suffix(".kept"))
    built.symlink_to(kept)


def open_to_others(built: Path) -> None:
    built.chmod(0o777)


@pytest.mark.parametrize("attack", [damaged, swapped, linked, open_to_others])
def test_only_what_was_built_here_is_loaded_from_the_cache(
    attack: Callable[[Path], None], tmp_path: Path, cache: Path
) -> None:
    (tmp_path / "more.h").write_text("#define MORE 0\n")
    first = library.build("answer", [source(tmp_path, 1)], [tmp_path], library.SHARED)
    content = first.read_bytes()
    assert cache.stat().st_mode & 0o077 == 0
    attack(first)
    again = library.build("answer", [source(tmp_path, 1)], [tmp_path], library.SHARED)
    assert not again.is_symlink()
    assert again.read_bytes() == content
    assert ctypes.CDLL(str(again)).answer() == 1
    assert again.stat().st_mode & 0o077 == 0


def test_a_library_of_another_user_is_not_loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "more.h").write_text("#define MORE 0\n")
    first = library.build("answer", [source(tmp_path, 1)], [tmp_path], library.SHARED)
    stamp = first.stat().st_ino
    owner = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: owner + 1)
    assert library.build("answer", [source(tmp_path, 1)], [tmp_path], library.SHARED).stat().st_ino != stamp
