"""A picture of what a file holds, written to a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.files import replacing
from gyrocal.present.notebook import VIEWS
from gyrocal.recording.header import folder_of
from gyrocal.recording.import_options import Options
from gyrocal.recording.importer import read_recording
from gyrocal.recording.mapped import is_log
from gyrocal.recording.session import Session


def drawable(source: Path) -> Session | Model:
    """The session or the model of a file or folder; the readings of a log, its columns guessed, are a session too."""
    path = folder_of(source)
    if not is_log(path):
        return Session.open(path)
    if path.suffix == ".toml":
        return Model.open(path)
    session = read_recording(path, Options(needs_rate=False)).session
    return session if len(session.runs) > 1 else session.with_runs(replace(run, file=path.name) for run in session.runs)


def draw(source: Path, out: Path) -> None:
    """Draw a session, a model file or a log into ``out``. Raises InputError for a name that is no picture's."""
    shown = drawable(source)
    figure = VIEWS[type(shown)].figure(shown)
    forms = figure.canvas.get_supported_filetypes()
    if out.suffix[1:].lower() not in forms:
        raise InputError(f"{out}: give a picture's name, that ends in .{', .'.join(forms)}")
    try:
        with replacing(out) as partial:
            figure.savefig(partial, format=out.suffix[1:].lower(), dpi=120)
    except OSError as error:
        raise InputError(f"{out}: {error.strerror}") from None
