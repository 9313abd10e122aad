"""The project's address in the package's metadata, and the README with links that hold there.

The address stands in one place, ``[tool.hatch.metadata.hooks.custom]`` of pyproject.toml. While it is empty, the package has no
links to a repository, and ``make release`` refuses.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

LINK = re.compile(r"\]\((?!https?:|#|mailto:)([^)\s]+)\)")
IMAGE = re.compile(r"!(\[[^\]]*)\]\((?!https?:)([^)\s]+)\)")


def readme_for(text: str, repository: str, version: str) -> str:
    """The README with links into the repository at this version, and pictures from it, in place of relative ones."""
    if not repository:
        return text
    text = IMAGE.sub(rf"!\1]({repository}/raw/v{version}/\2)", text)
    return LINK.sub(rf"]({repository}/blob/v{version}/\1)", text)


def urls_of(repository: str) -> dict[str, str]:
    """The addresses that a package index shows; none while the repository has no address."""
    if not repository:
        return {}
    return {
        "Repository": repository, "Documentation": f"{repository}/blob/main/docs/api.md", "Issues": f"{repository}/issues",
        "Changelog": f"{repository}/blob/main/CHANGELOG.md",
    }  # fmt: skip


class CustomMetadataHook(MetadataHookInterface):
    """Called by hatchling for each build."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Fill in the fields that pyproject.toml calls dynamic."""
        repository = str(self.config.get("repository", "")).rstrip("/")
        readme = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {
            "content-type": "text/markdown", "text": readme_for(readme, repository, str(metadata["version"]))
        }  # fmt: skip
        metadata["urls"] = urls_of(repository)
