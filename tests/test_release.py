"""What a release needs: one address, texts of its version, a whole wheel, a recipe and workflows that can be read."""

import importlib.util
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
ADDRESS = "https://git.example/team/gyrocal"


def loaded(path: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


release, hook, verbs = loaded("packaging/release.py"), loaded("hatch_build.py"), loaded("packaging/verbs.py")


def content(repository: str = "") -> dict[str, Any]:
    found = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    found["tool"]["hatch"]["metadata"]["hooks"]["custom"]["repository"] = repository
    return found


@pytest.mark.parametrize("address", ["", "  ", "TODO", "http://x.y"])
def test_there_is_no_release_without_an_address(address: str) -> None:
    with pytest.raises(release.Refused, match=r"repository is empty"):
        release.repository_of(content(address))
    assert release.repository_of(content(ADDRESS + "/")) == ADDRESS


def test_make_release_refuses_now() -> None:
    """The address is not known yet. Once it is, this test goes."""
    done = subprocess.run([sys.executable, ROOT / "packaging" / "release.py"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("release: pyproject.toml: [tool.hatch.metadata.hooks.custom] repository is empty")


def test_the_address_stands_in_one_place() -> None:
    lines = (ROOT / "pyproject.toml").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if line.startswith("repository")] == ['repository = ""']
    assert hook.urls_of("") == {}
    assert hook.urls_of(ADDRESS)["Issues"] == f"{ADDRESS}/issues"


def test_texts_must_be_of_the_version(tmp_path: Path) -> None:
    (tmp_path / "CHANGELOG.md").write_text("# Changelog\n\n## 0.2.0\n")
    (tmp_path / "CITATION.cff").write_text("title: gyrocal\nversion: 0.2.0\ndate-released: 2030-01-01\n")
    release.check_texts("0.2.0", tmp_path)
    with pytest.raises(release.Refused, match=r"no section '## 0.2.1'"):
        release.check_texts("0.2.1", tmp_path)
    (tmp_path / "CITATION.cff").write_text("title: gyrocal\nversion: 0.1.0\n")
    with pytest.raises(release.Refused, match="date-released"):
        release.check_texts("0.2.0", tmp_path)


def test_links_of_the_readme_hold_on_an_index() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert hook.readme_for(text, "", "1.0") == text
    absolute = hook.readme_for(text, ADDRESS, "1.0")
    targets = re.findall(r"\]\(([^)\s]+)\)", absolute)
    assert targets
    for target in targets:
        assert re.match(r"https?:|#|mailto:", target), target
        if target.startswith(ADDRESS):
            place, _, path = target.removeprefix(f"{ADDRESS}/").partition("/v1.0/")
            assert place == ("raw" if path.endswith(".png") else "blob"), target
            assert (ROOT / path.partition("#")[0]).exists(), target


def test_the_wheel_is_whole(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    names = release.check_wheel(wheel)
    commands = {Path(name).stem.rstrip("_") for name in names if re.fullmatch(r"gyrocal/commands/[a-z]\w*\.py", name)}
    assert commands == {p.stem.rstrip("_") for p in (ROOT / "host" / "gyrocal" / "commands").glob("[a-z]*.py")}
    with zipfile.ZipFile(tmp_path / "gyrocal-bad.whl", "w") as bad:
        bad.writestr("tests/test_x.py", "")
    with pytest.raises(release.Refused, match=r"gyrocal/py.typed.*tests/test_x.py"):
        release.check_wheel(tmp_path / "gyrocal-bad.whl")


def test_the_recipe_has_the_project_s_own_facts(tmp_path: Path) -> None:
    sdist = tmp_path / "gyrocal-0.2.0.tar.gz"
    sdist.write_bytes(b"source")
    made = yaml.safe_load(release.recipe("0.2.0", ADDRESS, sdist, content(ADDRESS)))
    assert made["context"]["version"] == "0.2.0"
    assert made["source"]["url"] == f"{ADDRESS}/releases/download/v0.2.0/gyrocal-0.2.0.tar.gz"
    assert made["source"]["sha256"] == "41cf6794ba4200b839c53531555f0f3998df4cbb01a4d5cb0b94e3ca5e23947d"
    needed = [name.replace(" ", "") for name in made["requirements"]["run"]]
    project = content()["project"]
    assert needed == [f"python{project['requires-python']}", *project["dependencies"]]


@pytest.mark.parametrize("workflow", ["test", "release"])
def test_workflows_can_be_read(workflow: str) -> None:
    read = yaml.safe_load((ROOT / ".github" / "workflows" / f"{workflow}.yml").read_text(encoding="utf-8"))
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for job in read["jobs"].values():
        assert job["runs-on"]
        for step in job["steps"]:
            assert {"uses", "run"} & set(step)
            for target in re.findall(r"^make (\w+)", step.get("run", "")):
                assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
            for script in re.findall(r"python (packaging/\S+)", step.get("run", "")):
                assert (ROOT / script).is_file()


def test_the_verbs_are_tried_on_the_systems_that_people_have() -> None:
    read = yaml.safe_load((ROOT / ".github" / "workflows" / "test.yml").read_text(encoding="utf-8"))
    systems = " ".join(read["jobs"]["verbs"]["strategy"]["matrix"]["system"])
    assert all(name in systems for name in ("ubuntu", "arm", "macos", "windows"))


def test_the_verbs_that_every_system_is_tried_with_exist() -> None:
    from gyrocal.cli import command_modules

    asked = {words.split()[0] for words in verbs.STEPS}
    need_more = {"benchmark", "demo", "device", "doctor", "keep", "monitor", "record", "train", "verify", "wifi", "workbench"}
    assert asked | need_more == set(command_modules())
    assert not asked & need_more


def test_the_image_copies_what_there_is() -> None:
    lines = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()
    copied = [word for line in lines if line.startswith("COPY ") for word in line.split()[1:-1]]
    assert copied
    assert all((ROOT / name).exists() for name in copied)
    project = content()["project"]
    (installed,) = re.findall(r"/source\[([a-z,]+)\]", "\n".join(lines))
    assert set(installed.split(",")) <= set(project["optional-dependencies"])
