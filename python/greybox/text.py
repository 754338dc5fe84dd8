"""Models that are read from files."""

from __future__ import annotations

import os
from typing import Any

from greybox import _core
from greybox._core import Parameter
from greybox.checks import number
from greybox.checks import path as path_of
from greybox.errors import ModelWarning, warn
from greybox.model import Equations
from greybox.signals import named

__all__ = ["TextModel", "load"]


class TextModel(Equations):
    """A model that was read from a file: its equations, and what the file declares of parameters, holds, initial states and noise.

    What is said to :func:`greybox.fit` goes before what the file says.
    """

    def __init__(self, file: _core.TextModel) -> None:
        super().__init__(file.equations)
        self.file = file

    @property
    def declared(self) -> dict[str, Parameter]:
        """The declarations of the parameters."""
        return dict(zip(named(self.parameters, "parameters"), self.file.declared, strict=True))

    def defaults(self) -> dict[str, Any]:
        """Give the options that the file says."""
        levels = zip(named(self.outputs, "outputs"), self.file.noise, strict=True)
        noise = {name: level for name, level in levels if level is not None}
        return {"noise": noise or None, "integrator": self.file.integrator, "predictor": self.file.predictor}

    def prepared(self, record: _core.Record) -> _core.Record:
        """Give a record with the holds and the initial state of the file."""
        return self.file.prepare(record)

    def to_toml(self) -> str:
        """Give the model as a file."""
        return self.file.to_toml()

    def __reduce__(self) -> tuple[Any, ...]:
        return (_named, (self.file.name, self.file.to_toml()))


def _named(name: str, text: str) -> TextModel:
    return TextModel(_core.TextModel.named(name, text))


def load(path: str | os.PathLike[str], **constants: float) -> TextModel:
    """Read a model file (TOML), as the command ``greybox`` does.

    Parameters
    ----------
    path : path
        The file.
    **constants : float
        Other values for some of its constants: ``gb.load("pmsm.toml", np=4)``.

    Returns
    -------
    TextModel
        ``gb.fit(gb.load("pmsm.toml"), frame)`` needs no declarations: those of the file hold, and ``rs=gb.free(0.5)`` goes before.

    Raises
    ------
    Error
        With line, column and remedy of each mistake in the file.

    Warns
    -----
    ModelWarning
        Of units that do not fit, and of quantities that are not used.
    """
    file = _core.TextModel.read(path_of("path", path), [(name, number(f"constant `{name}`", value)) for name, value in constants.items()])
    for remark in file.warnings:
        warn(ModelWarning(remark))
    return TextModel(file)
