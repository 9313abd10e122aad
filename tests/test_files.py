"""What is written reads back before it replaces anything, nothing of others is deleted, and a file that was cut off opens."""

import json
import shutil
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gyrocal.cli import main
from gyrocal.error_model.formula import FormulaEffect
from gyrocal.error_model.model import Model, Term
from gyrocal.errors import InputError
from gyrocal.plausibility import check
from gyrocal.recording.session import Session
from gyrocal.simulation.simulate import simulate

STRANGE = st.text(st.sampled_from("#'\"\n\r\t\\ éx{}=[],") | st.characters(codec="utf-8"), max_size=30)


def formula(text: str) -> FormulaEffect | None:
    try:
        return FormulaEffect(text, "own")
    except InputError:
        return None


@settings(max_examples=150, deadline=None)
@given(STRANGE, STRANGE, st.sampled_from(["k*t", "k*sin(w*t); w=3", "a*rate+b", "k*exp(-t/tau); tau=5; each run"]))
def test_any_formula_that_is_one_reads_back(tmp_path_factory: pytest.TempPathFactory, name: str, tail: str, text: str) -> None:
    folder = tmp_path_factory.mktemp("model")
    path = folder / "model.toml"
    for whole in (text, f"{text} # {tail}", text.replace("*", "*\n") if tail else text, f"({text.split(';')[0]}\n)"):
        own = formula(whole)
        if own is None:
            continue
        values = dict.fromkeys(own.linear, 0.25) | dict.fromkeys(own.nonlinear, 3.0)
        model = Model(name, (*Model.builtin("default").terms, Term.of(own, "z", values)))
        model.save(path)
        read = Model.open(path)
        (term,) = [t for t in read.terms if t.effect_id == "own"]
        assert (term.effect.equation, term.values, read.name) == (whole, values, name)
    assert [p.name for p in folder.iterdir()] in ([], ["model.toml"])


@pytest.fixture(scope="module")
def added(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session and the model of an effect that was added to it."""
    folder = tmp_path_factory.mktemp("added")
    simulate(folder / "s", "paper", seed=1, scenarios=1, seconds=5.0)
    assert main(["add", "drift", str(folder / "s"), "--model", str(folder / "model.toml")]) == 0
    return folder


@pytest.mark.parametrize(
    "text",
    [
        'own: k*t #"""',
        pytest.param("own: k*t # a 'remark'", marks=pytest.mark.wide),
        pytest.param("own: k*(t\n+ 1)", marks=pytest.mark.wide),
    ],
)
@pytest.mark.usefixtures("measured_adds")
def test_add_keeps_the_model_file(added: Path, tmp_path: Path, text: str) -> None:
    model = shutil.copy(added / "model.toml", tmp_path)
    assert main(["add", text, str(added / "s"), "--model", model]) == 0
    assert Model.open(model).ids[-2:] == ["drift", "own"]


def test_a_model_that_would_not_read_back_leaves_the_file(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    Model.builtin("default").save(path)
    before = path.read_bytes()
    twice = Model("twice", (Term("bias", "z", {"bias_dps": 1.0}), Term("bias", "z", {"bias_dps": 2.0})))
    with pytest.raises(InputError):
        twice.save(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["model.toml"]


@pytest.mark.usefixtures("measured_adds")
def test_nothing_is_deleted_that_the_command_did_not_make(tmp_path: Path) -> None:
    (tmp_path / "s.partial").mkdir()
    names = ("s.partial/mine.txt", "s.truth.json.partial", "page.html.partial", "r.csv.partial", "model.toml.partial")
    for name in names:
        (tmp_path / name).write_text("mine")
    simulate(tmp_path / "s", "paper", seed=1, scenarios=1, seconds=2.0)
    session, model = str(tmp_path / "s"), str(tmp_path / "model.toml")
    options = ["--html", str(tmp_path / "page.html"), "--residuals", str(tmp_path / "r.csv")]
    assert main(["compare", session, *options]) == 0
    assert main(["add", "drift", session, "--model", model]) == 0
    assert [(tmp_path / name).read_text() for name in names] == ["mine"] * len(names)
    assert not [p for p in tmp_path.iterdir() if p.name.startswith(".")]


def test_a_file_named_as_the_truth_is_kept(tmp_path: Path) -> None:
    (tmp_path / "s.truth.json").write_text('{"mine": 1}')
    with pytest.raises(InputError, match="truth"):
        simulate(tmp_path / "s", scenarios=1, seconds=2.0)
    assert (tmp_path / "s.truth.json").read_text() == '{"mine": 1}'
    assert not (tmp_path / "s").exists()


def test_a_csv_cut_at_any_byte_of_its_end_opens(tmp_path: Path) -> None:
    """The rows before the cut are as they were; what was cut off is left out and told, unless it is whole."""
    whole, _ = simulate(tmp_path / "s", "paper", seed=1, scenarios=1, seconds=2.0)
    file = tmp_path / "s" / whole.runs[0].file
    content = file.read_bytes()
    rows = whole.runs[0].table
    last = len(content.rstrip().rsplit(b"\n", 1)[1]) + 1
    for cut in range(1, 2 * last):
        file.write_bytes(content[:-cut])
        run = Session.open(tmp_path / "s").runs[0]
        told = [w for w in check(Session.open(tmp_path / "s")) if w.code == "line_damaged"]
        sound = content[:-cut].count(b"\n") - 1
        assert sound <= len(run) <= sound + 1
        assert run.table[:sound].equals(rows[:sound])
        if len(run) > sound:  # a last row that lost its line's end and at most a few digits
            assert run.gyro_dps[-1] == pytest.approx(rows[["gx_dps", "gy_dps", "gz_dps"]].row(sound), abs=1e-9)
            assert abs(run.table["temp_c"][-1] - rows["temp_c"][sound]) < 2.0
            assert not told
        elif not content[:-cut].endswith(b"\n"):
            assert [w.file for w in told] == [whole.runs[0].file]
            assert not told[0].blocking


def test_a_short_row_in_the_middle_is_an_error(tmp_path: Path) -> None:
    whole, _ = simulate(tmp_path / "s", "paper", seed=1, scenarios=1, seconds=2.0)
    file = tmp_path / "s" / whole.runs[0].file
    lines = file.read_text().splitlines()
    lines[5] = lines[5].rsplit(",", 2)[0]
    file.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match="row 6"):
        Session.open(tmp_path / "s")


def test_an_import_leaves_out_an_unfinished_row(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [f"{i / 100},{0.01 * (i % 5)},{0.02 * (i % 3)},{0.01 * (i % 4)}" for i in range(300)]
    (tmp_path / "log.csv").write_text("t,x,y,z\n" + "\n".join(rows) + "\n3.0,0.0")
    maps = [w for m in ("t_s=t", "gx_dps=x", "gy_dps=y", "gz_dps=z") for w in ("--map", m)]
    assert main(["import", str(tmp_path / "log.csv"), str(tmp_path / "s"), *maps, "--rate", "0", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["rows"], told["runs"], told["repaired"]) == (300, 1, {"rows": 1})
    assert [w["code"] for w in told["warnings"]] == ["line_damaged"]


def test_a_link_of_others_is_not_taken_for_an_earlier_device(tmp_path: Path) -> None:
    from gyrocal.device.outlet import PtyOutlet

    (tmp_path / "mine.txt").write_text("mine")
    link = tmp_path / "port"
    link.symlink_to(tmp_path / "mine.txt")
    with pytest.raises(InputError, match="link"):
        PtyOutlet(link)
    assert link.read_text() == "mine"
    link.unlink()
    link.symlink_to("/dev/pts/none")
    outlet = PtyOutlet(link)
    link.unlink()
    link.symlink_to(tmp_path / "mine.txt")
    outlet.close()
    assert link.read_text() == "mine"
