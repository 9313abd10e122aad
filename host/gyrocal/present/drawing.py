"""A picture of what a file holds, written to a file."""

from __future__ import annotations

from pathlib import Path

from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.files import replacing
from gyrocal.present.notebook import VIEWS
from gyrocal.recording.header import folder_of
from gyrocal.recording.session import Session


def draw(source: Path, out: Path) -> None:
    """Draw a session or a model file into ``out``. Raises InputError for another source, or a name that is no picture's."""
    folder = folder_of(source)
    shown = Model.open(source) if folder.suffix == ".toml" else Session.open(folder)
    figure = VIEWS[type(shown)].figure(shown)
    forms = figure.canvas.get_supported_filetypes()
    if out.suffix[1:].lower() not in forms:
        raise InputError(f"{out}: give a picture's name, that ends in .{', .'.join(forms)}")
    try:
        with replacing(out) as partial:
            figure.savefig(partial, format=out.suffix[1:].lower(), dpi=120)
    except OSError as error:
        raise InputError(f"{out}: {error.strerror}") from None
