"""A model written for another program, as ``gyrocal export --model`` does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gyrocal.calibration import header
from gyrocal.calibration.targets.base import Rendered, render
from gyrocal.error_model.model import Model
from gyrocal.errors import InputError
from gyrocal.files import replace_text
from gyrocal.recording.session import AXES

HEADER = "header"


@dataclass(frozen=True)
class Exported:
    """The file that was written, what its program cannot hold, with the reason by id, and further files."""

    file: Path
    left: Mapping[str, str]
    more: tuple[Path, ...] = ()


def export(model: Model, out: str | Path, form: str = HEADER, *, axis: str = "z", **options: Any) -> Exported:
    """Write a model's file into the folder ``out``.

    Args:
        model: a model with fitted values.
        out: the folder, which is made if it is not there.
        form: ``header`` for the device's calibration.h, or one of :func:`gyrocal.calibration.targets.targets`.
        axis: the sensor's axis that calibration.h is for.
        options: ``rate_hz``, ``device_id``, ``index``, ``add_to`` and ``noise_factor`` of
            :func:`gyrocal.calibration.targets.base.render`.

    Raises:
        InputError: an unknown form or axis, what the form needs and is not given, a model that it cannot hold, or a folder that
            cannot be written.
    """
    if axis not in AXES:
        raise InputError(f"axis is {axis!r}, not x, y or z")
    if form == HEADER:
        if options:
            raise InputError(f"{', '.join(options)}: not for --format {HEADER}; leave it out")
        rendered = Rendered("calibration.h", header.render(model, axis), {})
    else:
        rendered = render(form, model, **options)
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in rendered.files.items():
            replace_text(folder / name, text)
    except OSError as error:
        raise InputError(f"{folder / rendered.file}: {error.strerror}") from None
    return Exported(folder / rendered.file, dict(rendered.left), tuple(folder / name for name in rendered.more))
