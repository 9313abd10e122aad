"""What each verb prints with ``--json`` holds to its schema, and a schema that changed has another version.

``python tests/test_json_schemas.py`` records the schemas of now, once their versions were raised.
"""

import hashlib
import json
import re
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jsonschema
import pytest

from answers import check
from gyrocal.cli import command_modules, main
from gyrocal.device.monitor import Monitor
from gyrocal.device.wire import decode, encode
from gyrocal.json_schemas import ANSWERS, schema
from gyrocal.recording.session import Session

RECORDED = Path(__file__).with_name("json_schemas.json")
PROTOCOL = Path(str(files("gyrocal_firmware"))) / "lib" / "gyrocal_core" / "PROTOCOL.md"
SWING = Path(__file__).resolve().parents[1] / "docs" / "examples" / "swing.csv.gz"
MODEL = str(files("gyrocal") / "data" / "table2" / "model.toml")
NAMES_OF_TAGS = {
    "HEL": "Hello", "RUN": "RunEvent", "CAL": "Result", "STA": "State", "TST": "SelfTest", "ERR": "Failure",
}  # fmt: skip
pytestmark = pytest.mark.usefixtures("known_answers")


def fingerprint(verb: str) -> str:
    return hashlib.sha256(json.dumps(schema(verb), sort_keys=True).encode()).hexdigest()[:16]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("answers")


@pytest.fixture(scope="module")
def session(place: Path) -> str:
    words = ["--scenarios", "3", "--seconds", "6", "--effect", "table_ripple:amplitude_1=0.003"]
    assert main(["simulate", str(place / "s"), *words]) == 0
    return str(place / "s")


@pytest.fixture(scope="module")
def held(place: Path) -> str:
    assert main(["simulate", str(place / "held"), "--campaign", "hands", "--scenarios", "16"]) == 0
    return str(place / "held")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_every_verb_with_an_answer_has_a_schema() -> None:
    assert set(ANSWERS) | {"workbench", "schema"} == set(command_modules())
    for verb, (_, version) in ANSWERS.items():
        jsonschema.Draft202012Validator.check_schema(schema(verb))
        assert schema(verb)["$id"] == f"urn:gyrocal:{verb}:{version}"


def test_a_schema_that_changed_has_another_version() -> None:
    kept = json.loads(RECORDED.read_text(encoding="utf-8"))
    for verb, (_, version) in ANSWERS.items():
        same = kept[verb] == [version, fingerprint(verb)]
        assert same or kept[verb][0] != version, f"{verb}: raise its version in json_schemas.py, and record it anew"
    assert set(kept) == set(ANSWERS)


@pytest.mark.parametrize(
    "words",
    [
        "simulate new --scenarios 1 --seconds 4", "compare SESSION", "diagnose SESSION", "explain SESSION",
        "add table_ripple SESSION",
        "calibrate SESSION --method baseline,cnn --seconds 4", "plan SESSION --measure scale --minutes 2",
        "compare SESSION --model MODEL --as-is", "apply SESSION --model MODEL -o corrected",
        "apply SWING --model MODEL --yes -o a.csv",
        "import SWING new --yes", "info SESSION", "info MODEL", "info SWING",
        "info ABOVE", "info TRUTH", "effects", "allan SESSION", "version",
        "plot SESSION s.png", "firmware project", "verify --windows 12", "export --model MODEL --format json",
        "export --model MODEL", "compare HELD", "diagnose HELD", "explain HELD", "calibrate HELD", "add g_sensitivity HELD",
    ],
)  # fmt: skip
def test_answers_hold_to_their_schema(words: str, session: str, held: str, capsys: pytest.CaptureFixture[str]) -> None:
    given = {"SESSION": session, "HELD": held, "MODEL": MODEL, "SWING": str(SWING), "ABOVE": str(Path(session).parent),
             "TRUTH": f"{session}.truth.json"}  # fmt: skip
    said = [given.get(word, word) for word in words.split()]
    capsys.readouterr()
    assert main([*said, "--json"]) == 0
    check(said[0], json.loads(capsys.readouterr().out))


def test_answers_of_devices_hold_to_their_schema(session: str, capsys: pytest.CaptureFixture[str]) -> None:
    from gyrocal.device.simulated import SimulatedDevice

    def asked(*words: str) -> str:
        with SimulatedDevice([Session.open(session)], "max") as device:
            assert main([*words, "--port", device.port, "--json"]) == 0
        return capsys.readouterr().out

    recorded = json.loads(asked("record", "recorded", "--follow"))
    assert {"baseline", "cnn"} == {result["method"] for result in recorded["results"]}
    check("record", recorded)
    events = [json.loads(line) for line in asked("monitor").splitlines()]
    for event in events:
        check("monitor", event)
    assert {"hello", "sample", "run", "result", "state", "ack", "end"} <= {event["event"] for event in events}


@pytest.mark.parametrize(
    ("tag", "fields"),
    [
        ("TST", {"passed": 1, "x_dps": 400.5, "y_dps": None, "z_dps": 400, "least_dps": 150, "most_dps": 700}),
        ("TST", {"passed": 0, "x_dps": 1, "least_x_dps": 44.1, "most_dps": None, "rest_x_dps": 0.5, "rest_most_dps": 20}),
        ("ERR", {"code": -23, "name": "recording", "advice": "a_run_is_going_on:_send_stop_first"}),
        ("HEL", {"proto": 1, "fw": "0.2.0", "sensor": "LSM6DSO", "cal": None, "net": "paper"}),
        ("ACK", {"cmd": "set", "table_dps": "none"}),
    ],
)
def test_an_event_of_each_sentence_holds_to_the_schema(tag: str, fields: dict[str, Any]) -> None:
    monitor = Monitor(SimpleNamespace(answered=True, reader=SimpleNamespace(restarts=0)))  # type: ignore[arg-type]
    check("monitor", monitor._other(decode(encode(tag, 0, 5, 0, fields))))


def test_an_event_has_the_fields_that_the_protocol_lists() -> None:
    """The table of the protocol's sentences and the types of ``monitor`` name the same fields."""
    rows = [line.split("|") for line in PROTOCOL.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    told = {row[1].strip(): re.sub(r"\([^()]*\)", "", row[3]).partition(";")[0].split(",") for row in rows}
    for tag, name in NAMES_OF_TAGS.items():
        fields = {part.replace("and at the end", "").split("=")[0].strip() for part in told[tag]}
        assert fields | {"event", "t_us", "imu"} == set(schema("monitor")["$defs"][name]["properties"]), tag


def test_the_answer_on_a_fleet_holds_to_its_schema(session: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("a", "b"):
        assert main(["simulate", f"boards/{name}", "--scenarios", "2", "--seconds", "5", "--sensor", name.encode().hex()]) == 0
    capsys.readouterr()
    assert main(["fleet", "fit", "boards", "--workers", "0", "-o", "result", "--json"]) == 0
    check("fleet", json.loads(capsys.readouterr().out))


def test_the_answer_on_a_history_holds_to_its_schema(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for number, day in enumerate(("2026-01-05", "2026-06-05")):
        assert main(["simulate", f"months/{number}", "--scenarios", "2", "--seconds", "4", "--seed", str(number)]) == 0
        header = tmp_path / "months" / str(number) / "session.toml"
        header.write_text(f'board = "b"\nmade_on = {day}\n' + header.read_text())
    capsys.readouterr()
    assert main(["calibrate", "months", "--history", "--json"]) == 0
    check("calibrate", json.loads(capsys.readouterr().out))


def test_a_schema_refuses_what_lacks_a_key(session: str, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["calibrate", session, "--method", "baseline", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    del answer["estimates"][0]["trusted"]
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(answer, schema("calibrate"))


def test_the_verb_prints_schemas(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", "compare"]) == 0
    assert json.loads(capsys.readouterr().out) == schema("compare")
    assert main(["schema"]) == 0
    assert set(json.loads(capsys.readouterr().out)) == set(ANSWERS)
    assert main(["schema", "compar"]) == 2
    assert "did you mean compare?" in capsys.readouterr().err


if __name__ == "__main__":
    found = {verb: [version, fingerprint(verb)] for verb, (_, version) in ANSWERS.items()}
    RECORDED.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
