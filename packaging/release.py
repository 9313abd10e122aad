"""Check and build a release: ``make release``. It uploads nothing.

It refuses while the project has no address (``[tool.hatch.metadata.hooks.custom]`` of pyproject.toml), while the changelog
has no section for the version, and while CITATION.cff names another one. Then it builds sdist and wheel, checks what the wheel
holds, and writes the recipe for conda-forge beside them.
"""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WANTED = (
    "gyrocal/py.typed", "gyrocal/data/gyrocal.int8.onnx", "gyrocal/data/table2/model.toml", "gyrocal/commands/compare.py",
    "gyrocal_export/commands/export.py", "gyrocal_firmware/lib/gyrocal_core/gc_device.c",
)  # fmt: skip
PLACED = re.compile(r"@([A-Z0-9]+)@")


class Refused(Exception):
    """What has to be done before there can be a release."""


def project(root: Path = ROOT) -> dict[str, object]:
    """The content of pyproject.toml."""
    return tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))


def repository_of(content: dict[str, object]) -> str:
    """The project's address. Raises Refused while it is empty or no address."""
    hook = content["tool"]["hatch"]["metadata"]["hooks"]["custom"]  # type: ignore[index]
    address = str(hook["repository"]).rstrip("/")
    if not re.fullmatch(r"https://\S+\.\S+", address):
        where = "pyproject.toml: [tool.hatch.metadata.hooks.custom] repository"
        raise Refused(f"{where} is empty; write the repository's https address")
    return address


def check_texts(version: str, root: Path = ROOT) -> None:
    """Raise Refused unless changelog and citation are of this version."""
    if not re.search(rf"^## {re.escape(version)}\b", (root / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE):
        raise Refused(f"CHANGELOG.md: no section '## {version}'; cut it from '## Unreleased'")
    citation = (root / "CITATION.cff").read_text(encoding="utf-8")
    if f"\nversion: {version}\n" not in citation or "\ndate-released:" not in citation:
        raise Refused(f"CITATION.cff: write version: {version} and date-released: YYYY-MM-DD")


def check_wheel(wheel: Path) -> list[str]:
    """The names in a wheel. Raises Refused if a file that it needs is missing, or one is in it that is for developers."""
    names = zipfile.ZipFile(wheel).namelist()
    missing = [name for name in WANTED if name not in names]
    foreign = [name for name in names if name.startswith(("tests/", "docs/", "benchmarks/")) or "__pycache__" in name]
    if missing or foreign:
        lacks, has = ", ".join(missing) or "nothing", ", ".join(foreign[:3]) or "nothing"
        raise Refused(f"{wheel.name}: it lacks {lacks}, and holds {has} too much")
    return names


def recipe(version: str, repository: str, sdist: Path, content: dict[str, object], root: Path = ROOT) -> str:
    """The recipe for conda-forge of an sdist that lies beside the release of the repository."""
    about = content["project"]
    digest = hashlib.sha256(sdist.read_bytes()).hexdigest()
    values = {
        "VERSION": version, "URL": f"{repository}/releases/download/v{version}/{sdist.name}", "SHA256": digest,
        "RUN": "\n".join(f"    - {name.replace('>=', ' >=')}" for name in about["dependencies"]),  # type: ignore[index]
        "SUMMARY": about["description"], "REPOSITORY": repository,  # type: ignore[index]
    }  # fmt: skip
    return PLACED.sub(lambda found: str(values[found[1]]), (root / "packaging" / "recipe.yaml.in").read_text(encoding="utf-8"))


def main() -> int:
    """Check, build, and say what there is to upload."""
    try:
        content = project()
        version = str(content["project"]["version"])  # type: ignore[index]
        repository = repository_of(content)
        check_texts(version)
        dist = ROOT / "dist"
        for old in dist.glob("gyrocal-*"):
            old.unlink()
        subprocess.run([sys.executable, "-m", "hatchling", "build", "-d", str(dist)], cwd=ROOT, check=True)
        (wheel,), (sdist,) = dist.glob("gyrocal-*.whl"), dist.glob("gyrocal-*.tar.gz")
        names = check_wheel(wheel)
        (dist / "recipe.yaml").write_text(recipe(version, repository, sdist, content), encoding="utf-8")
    except Refused as reason:
        print(f"release: {reason}", file=sys.stderr)
        return 2
    print(f"{wheel.name}: {len(names)} files\n{sdist.name}\nrecipe.yaml\nTag it v{version}, and upload these three.")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
