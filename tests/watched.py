"""A user with an empty home, whose commands run under strace: the files that they leave, and the addresses that they use."""

import ipaddress
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path

MAKES = re.compile(r"\b(?:creat|mkdir|mkdirat|rename|renameat|renameat2|link|linkat|symlink|symlinkat)\(|\bO_CREAT\b")
QUOTED = re.compile(r'"((?:[^"\\]|\\.)*)"')
SOCKET = re.compile(r"\bsocket\((AF_\w+), [\w|]+, (\w+)")
SENDS = re.compile(r"\b(?:bind|connect|sendto|sendmsg|sendmmsg)\(")
ADDRESS = re.compile(r'(?:inet_addr\("|inet_pton\(AF_INET6, ")([^"]+)"')
RESOLVER = re.compile(r"sin6?_port=htons\(53\)|systemd/resolve")
HARMLESS = {("AF_UNIX", "0"), ("AF_UNIX", "IPPROTO_IP"), ("AF_NETLINK", "NETLINK_ROUTE")}
"""Families and protocols that stay on this machine: sockets of the file system, and the kernel's list of interfaces."""
TRACE = "trace=network,open,openat,creat,mkdir,mkdirat,rename,renameat,renameat2,link,linkat,symlink,symlinkat"
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS"), "1")
"""The workers share the processors: more threads than those wait for each other."""
OF_THE_SYSTEM = re.compile(r"/proc/|/dev/(?!shm/)|.*/__pycache__(?:/|$)")
"""Where a name stands for a device, or for what Python compiled beside a module."""

CORE = ("HOME/.cache/gyrocal/*",)
"""The device's C core, compiled once and kept."""
FONTS = ("HOME/.cache/matplotlib/fontlist-*.json", "HOME/.config/matplotlib")
"""Matplotlib's list of this machine's fonts, which takes seconds to make, and its empty folder of settings."""


@dataclass
class Watched:
    """Command lines in a new home. ``root`` is an empty folder.

    Attributes:
        home, temporary, work: the folders HOME and TMPDIR, and the current one.
    """

    root: Path
    home: Path = field(init=False)
    temporary: Path = field(init=False)
    work: Path = field(init=False)
    _brought: set[str] = field(default_factory=set)
    _traces: list[Path] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.home, self.temporary, self.work = (self.root / name for name in ("home", "tmp", "work"))
        for folder in (self.home, self.temporary, self.work):
            folder.mkdir()

    def bring(self, folder: Path) -> None:
        """Copy what ``folder`` holds into the current folder, before anything is started."""
        shutil.copytree(folder, self.work, dirs_exist_ok=True)
        self._brought = set(os.listdir(self.work))

    def start(self, *command: str) -> subprocess.Popen[str]:
        """Start a command with nothing of this process's environment but its paths, and with one thread for each process."""
        trace = self.root / f"trace{len(self._traces)}"
        self._traces.append(trace)
        kept = {name: os.environ[name] for name in ("PATH", "PYTHONPATH") if name in os.environ}
        places = {"HOME": str(self.home), "TMPDIR": str(self.temporary), "LANG": "C.UTF-8"}
        strace = ["strace", "-f", "-qq", "--seccomp-bpf", "-s", "0", "-e", "signal=none", "-e", TRACE, "-o", str(trace)]
        return subprocess.Popen(
            [*strace, *command], cwd=self.work, env=kept | places | ONE_THREAD, text=True, start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip

    def gyrocal(self, *words: str) -> subprocess.Popen[str]:
        """Start ``gyrocal`` with these words."""
        return self.start(sys.executable, "-m", "gyrocal", *words)

    def _calls(self) -> list[str]:
        return [line for trace in self._traces for line in trace.read_text(errors="replace").splitlines()]

    def left(self) -> set[str]:
        """Files and empty folders that are there now and were not before, anywhere but in the current folder."""
        named = (QUOTED.findall(call) for call in self._calls() if MAKES.search(call))
        made = {self.work / name for names in named for name in names if not OF_THE_SYSTEM.match(name)}
        made |= {path for folder in (self.home, self.temporary) for path in folder.rglob("*")}
        made -= {self.home, self.temporary}
        outside = (path for path in made if path.exists() and not path.is_relative_to(self.work))
        return {self._told(path) for path in outside if not path.is_dir() or not any(path.iterdir())}

    def _told(self, path: Path) -> str:
        for name, folder in (("HOME", self.home), ("TMPDIR", self.temporary)):
            if path.is_relative_to(folder):
                return f"{name}/{path.relative_to(folder)}"
        return str(path)

    def sockets(self) -> set[str]:
        """Families and protocols of the sockets that can reach beyond this machine."""
        opened = (SOCKET.search(call) for call in self._calls())
        return {f"{one[1]} {one[2]}" for one in opened if one and (one[1], one[2]) not in HARMLESS}

    def elsewhere(self) -> set[str]:
        """The calls that name an address beyond this machine, or ask somebody for one."""
        return {call for call in self._calls() if SENDS.search(call) and (RESOLVER.search(call) or _leaves(call))}

    def check(self, makes: Sequence[str] = (), keeps: Sequence[str] = (), *, serves: bool = False) -> None:
        """Fail unless all that was started kept to itself.

        Args:
            makes: the names that are new in the current folder.
            keeps: patterns of what may be left elsewhere.
            serves: True if connections of this machine with itself are allowed.
        """
        elsewhere, sockets = self.elsewhere(), self.sockets()
        left = {path for path in self.left() if not any(fnmatch(path, allowed) for allowed in keeps)}
        new = set(os.listdir(self.work)) - self._brought
        assert not elsewhere, f"addresses beyond this machine: {elsewhere}"
        assert not left, f"left behind: {left}"
        assert new == set(makes), f"in the current folder: {new}"
        allowed = {"AF_INET", "AF_INET6"} if serves else set()
        assert {socket.partition(" ")[0] for socket in sockets} <= allowed, f"sockets: {sockets}"


def _leaves(call: str) -> bool:
    return any(not ipaddress.ip_address(text.removeprefix("::ffff:")).is_loopback for text in ADDRESS.findall(call))
