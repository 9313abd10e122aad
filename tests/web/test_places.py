"""What the page may read and write, and what an upload may not do."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import pytest

from gyrocal.errors import InputError
from gyrocal.simulation.simulate import simulate
from gyrocal.web.state.places import Places


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("work") / "mine"
    simulate(folder, scenarios=1, seconds=2)
    return folder


def zipped(files: dict[str, bytes | str]) -> io.BytesIO:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in files.items():
            packed.writestr(name, content)
    out.seek(0)
    return out


def contents(session: Path, top: str = "") -> dict[str, bytes | str]:
    return {f"{top}{p.name}": p.read_bytes() for p in session.iterdir()}


def test_what_lies_outside_is_not_there(tmp_path: Path, session: Path) -> None:
    places = Places([tmp_path])
    for path in ("..", "../x", "/etc", str(session)):
        with pytest.raises(InputError, match="outside"):
            places.inside(path)
    (tmp_path / "link").symlink_to(session)
    with pytest.raises(InputError, match="outside"):
        places.session("link")
    assert places.sessions() == []
    assert Places([tmp_path, session]).session(session) == session.resolve()


def test_a_session_cannot_name_files_outside_of_it(tmp_path: Path, session: Path) -> None:
    places = Places([tmp_path])
    bad = tmp_path / "bad"
    bad.mkdir()
    text = (session / "session.toml").read_text()
    for name in ("../000_up.csv", "/etc/passwd"):
        (bad / "session.toml").write_text(text.replace("000_up.csv", name, 1))
        with pytest.raises(InputError, match="outside the session"):
            places.session("bad")
    (bad / "session.toml").write_text(text)
    (bad / "000_up.csv").symlink_to(session / "000_up.csv")
    with pytest.raises(InputError, match="outside the session"):
        places.session("bad")


def test_new_folders_have_plain_names(tmp_path: Path) -> None:
    places = Places([tmp_path])
    (tmp_path / "there").mkdir()
    for name in ("../x", "a/b", "", ".hidden", "/abs", "there", "a\0b", "x" * 200):
        with pytest.raises(InputError):
            places.new(name)
    assert places.new("new-1").parent == tmp_path.resolve()
    assert places.free("there").name == "there-2"
    assert places.free("../../etc/passwd").parent == tmp_path.resolve()


def test_sessions_are_found_and_named(session: Path) -> None:
    places = Places([session.parent])
    assert places.sessions() == [session.resolve()]
    assert places.name(session.resolve()) == "mine"


@pytest.mark.parametrize("top", ["", "mine/", "a/b/"])
def test_an_upload_is_a_session(tmp_path: Path, session: Path, top: str) -> None:
    from gyrocal.recording.session import Session

    folder = Places([tmp_path]).unpack(zipped(contents(session, top)), "mine.zip")
    assert folder == tmp_path.resolve() / "mine"
    assert len(Session.open(folder).runs) == 2
    assert not list(tmp_path.glob(".*"))


def test_an_upload_is_data_and_nothing_of_it_is_run(tmp_path: Path, session: Path) -> None:
    files = contents(session) | {
        "effects/evil.py": "raise SystemExit",
        "evil.py": "1/0",
        "run.sh": "rm -rf /",
        "model.toml": "x",
    }
    folder = Places([tmp_path]).unpack(zipped(files), "mine.zip")
    assert {p.name for p in folder.rglob("*")} == {p.name for p in session.iterdir() if p.suffix in (".csv", ".toml")}


@pytest.mark.parametrize("name", ["../out.csv", "/tmp/out.csv", "x/../../out.csv", "a\\..\\out.csv"])
def test_an_upload_stays_in_its_folder(tmp_path: Path, session: Path, name: str) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    with pytest.raises(InputError, match="points outside"):
        Places([inner]).unpack(zipped(contents(session) | {name: "t_s\n"}), "mine.zip")
    assert list(inner.iterdir()) == []
    assert [p.name for p in tmp_path.iterdir()] == ["inner"]


def test_an_upload_holds_no_links(tmp_path: Path, session: Path) -> None:
    out = zipped({k: v for k, v in contents(session).items() if k != "000_up.csv"})
    with zipfile.ZipFile(out, "a") as packed:
        link = zipfile.ZipInfo("000_up.csv")
        link.external_attr = 0o120777 << 16
        packed.writestr(link, "/etc/passwd")
    out.seek(0)
    with pytest.raises(InputError, match="outside"):
        Places([tmp_path]).unpack(out, "mine.zip")


def test_an_upload_is_no_bomb_and_no_rubbish(tmp_path: Path, session: Path) -> None:
    places = Places([tmp_path])
    with pytest.raises(InputError, match="too large"):
        places.unpack(zipped(contents(session) | {"big.csv": b"0" * 30_000_000}), "mine.zip")
    with pytest.raises(InputError, match=r"no session\.toml"):
        places.unpack(zipped({"a.csv": "x"}), "mine.zip")
    with pytest.raises(InputError, match="cannot be unpacked"):
        places.unpack(io.BytesIO(b"no zip"), "mine.zip")
    assert list(tmp_path.iterdir()) == []
