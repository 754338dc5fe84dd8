"""`Fit`: what was found, and how well it is known."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from greybox import _core
from greybox.bootstrap import Bootstrap
from greybox.checks import names as names_of
from greybox.checks import number, shown, text, whole
from greybox.errors import Error, FitWarning, RecordWarning, warn
from greybox.estimate import Estimate
from greybox.frames import Array, Kind, joined
from greybox.model import Equations
from greybox.parameters import Parameter
from greybox.process_noise import ProcessNoise
from greybox.profile import Profile
from greybox.progress import Progress
from greybox.records import Record, filled, framed, is_path, kind_of
from greybox.report import Report
from greybox.signals import distinct, named, near

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Fit"]


class Fit(Estimate):
    """The result of :func:`greybox.fit`. Printed, it is a table with the verdict above; in a notebook, with a plot.

    It can be pickled; the records are kept with it.
    """

    def __init__(
        self,
        equations: Equations,
        records: list[_core.Record],
        declared: list[Parameter],
        options: Mapping[str, Any],
        kind: Kind,
        estimate: _core.Estimate,
        problem: _core.Problem | None,
        what: Record,
        files: list[Path],
    ) -> None:
        self._equations = equations
        self._records = records
        self._declared = declared
        self._options = dict(options)
        self._kind = kind
        self._estimate = estimate
        self._made = problem
        self._what = what
        self._files = files

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_made": None}

    @property
    def _problem(self) -> _core.Problem:
        if self._made is None:
            self._made = _core.Problem(self._equations.core, self._records, self._declared, self._options)
        return self._made

    def predict(self, data: Any = None, /, **said: Any) -> Any:
        """Predict the outputs of a record.

        Parameters
        ----------
        data : frame or Record, optional
            Another record; free initial states are estimated from its outputs, the parameters stay. Without it, the records of the
            fit with their estimated initial states.
        **said
            Of a bare frame: `time`, `sample_time`, `columns`, `hold`, `initial`, as in :class:`Record`; but for `initial`, those of the fit
            where they are left out.

        Returns
        -------
        frame
            Of the kind that was handed over: ``t`` and the outputs; of several records, ``record`` before. Of a filter, NaN where nothing was
            measured: :meth:`filtered` has the states there.
        """
        return self._predicted(data, said, lambda record, predicted, errors: predicted)

    def residuals(self, data: Any = None, /, **said: Any) -> Any:
        """Give measured less predicted outputs, as :meth:`predict` does the predictions; NaN where nothing was measured."""
        return self._predicted(data, said, lambda record, predicted, errors: errors)

    def to_dataframe(self, data: Any = None, /, **said: Any) -> Any:
        """Give time, inputs, outputs, and for each output its prediction and residual: ``id``, ``id_predicted``, ``id_residual``.

        A frame of the caller's kind, a row for each sample. The arguments are those of :meth:`predict`.

        Raises
        ------
        Error
            If two columns would have one name, such as that of an input ``id_predicted``.
        """
        return self._predicted(data, said, self._all)

    def _all(self, record: _core.Record, predicted: dict[str, Array], errors: dict[str, Array]) -> dict[str, Array]:
        return joined(
            [
                *zip(named(self._equations.inputs, "inputs"), record.inputs(), strict=True),
                *zip(predicted, record.outputs(), strict=True),
                *((f"{name}_predicted", column) for name, column in predicted.items()),
                *((f"{name}_residual", column) for name, column in errors.items()),
            ]
        )

    def filtered(self, data: Any = None, /, **said: Any) -> Any:
        """Give the states of a record after each sample's measurements, by the fit's Kalman filter.

        The arguments are those of :meth:`predict`.

        Returns
        -------
        frame
            Of the caller's kind: ``t``, and of each state the mean, ``id``, and its standard deviation, ``id_deviation``; of several
            records, ``record`` before.

        Raises
        ------
        Error
            If the predictor is not ``"kalman"``.
        """
        return self._states(data, said, False)

    def smoothed(self, data: Any = None, /, **said: Any) -> Any:
        """Give the states of a record by all its measurements, before each sample and after it, as :meth:`filtered` otherwise.

        The parameters and estimated initial states count as known.
        """
        return self._states(data, said, True)

    def _states(self, data: Any, said: Mapping[str, Any], smoothed: bool) -> Any:
        states = list(named(self._equations.states, "states"))
        data = _framed(data)
        cores = self._asked(data, said)
        parts: list[dict[str, Array]] = []
        for k, core in enumerate(cores):
            means, deviations = self._problem.states(self._estimate, core, k if data is None else None, smoothed)
            spreads = ((f"{name}_deviation", one) for name, one in zip(states, deviations, strict=True))
            parts.append(joined([*zip(states, means, strict=True), *spreads]))
        return self._as(data)(_stacked(cores, parts))

    def _asked(self, data: Any, said: Mapping[str, Any]) -> list[_core.Record]:
        if said and (data is None or isinstance(data, Record)):
            of = "the records of the fit" if data is None else "a Record"
            raise Error(f"{next(iter(said))} is said of {of}, which {'are' if data is None else 'is'} as before; hand over a bare frame")
        if data is None:
            return self._records
        record = data if isinstance(data, Record) else Record(data, **said)
        core = filled(record, replace(self._what, initial=None)).core(self._equations, "record", outputs=False)
        is_other = is_path(record.data) and record.name is None and Path(record.data).resolve() not in self._files
        if is_other and any(one.per_experiment for one in self._declared) and core.name in [one.name for one in self._records]:
            text = f"{record.data} is no file of the fit, and takes the own parameters of its record `{core.name}`, whose name it has"
            warn(RecordWarning(f"{text}; say so by gb.Record(..., name={core.name!r}), or give it another name"))
        return [core]

    def _as(self, data: Any) -> Kind:
        """Give what makes a frame of the kind of these data, or of the fit's."""
        return self._kind if data is None else kind_of(data.data if isinstance(data, Record) else data)

    def _predicted(self, data: Any, said: Mapping[str, Any], chosen: Any, kind: Kind | None = None) -> Any:
        outputs = list(named(self._equations.outputs, "outputs"))
        data = _framed(data)
        cores = self._asked(data, said)
        parts: list[dict[str, Array]] = []
        for k, core in enumerate(cores):
            predicted, errors, _ = self._problem.predict(self._estimate, core, k if data is None else None)
            parts.append(chosen(core, dict(zip(outputs, predicted, strict=True)), dict(zip(outputs, errors, strict=True))))
        return (kind or self._as(data))(_stacked(cores, parts))

    def bands(self, probability: float = 0.95) -> Any:
        """Give how far from the prediction the outputs of the fit's records may be with this probability.

        Returns
        -------
        frame
            Of the caller's kind: ``t``, and of each output half the width of the band of the model alone, ``id_confidence``, and of a new
            measurement, ``id_prediction``; of several records, ``record`` before.
        """

        def columns(k: int) -> dict[str, Array]:
            confidence, prediction = self._problem.bands(self._estimate, k, number("probability", probability))
            names = named(self._equations.outputs, "outputs")
            named_ = {f"{name}_confidence": one for name, one in zip(names, confidence, strict=True)}
            return named_ | {f"{name}_prediction": one for name, one in zip(names, prediction, strict=True)}

        return self._kind(_stacked(self._records, [columns(k) for k in range(len(self._records))]))

    # Diagnoses.
    def profile(self, name: str, probability: float = 0.95) -> Profile:
        """Compute the profile of an unknown: how the cost rises as it is moved and all others are fitted again.

        Its interval follows the curvature of the model, and ends on one side only where the data say no more.

        Raises
        ------
        Error
            If no unknown has the name.
        """
        if text("name", name) not in self.unknowns:
            raise Error(f"there is no unknown `{name}`; the fit has: {near(name, self.unknowns)}")
        probability = number("probability", probability)
        return Profile(name, probability, self._kind, self._problem.profile(self._estimate, name, probability))

    def process_noise(self) -> ProcessNoise:
        """Test whether the plant is disturbed: fit again without process noise, and compare the likelihoods.

        Levels of noise cannot be negative, so that the p-value is by a mixture of chi-squared distributions (Chernoff 1954; Self and Liang
        1987); of several levels whose estimates are correlated it is an approximation, and of short records it is conservative.

        Raises
        ------
        Error
            If the predictor is no filter, the model has no diffusion whose levels are free, or the fit without does not converge.
        """
        return ProcessNoise(*self._problem.process_noise(self._estimate))

    def bootstrap(self, count: int = 1000, *, blocks: int | None = None, seed: int = 1, progress: bool = False) -> Bootstrap:
        """Refit records that are made of the prediction and resampled residuals: intervals that ask for no normal distribution.

        Parameters
        ----------
        count : int
            How many refits: twenty at least, some thousand for the ends of intervals.
        blocks : int, optional
            Resample blocks of so many residuals in a row, for colored ones: several times as long as they are correlated; zero takes
            the cube root of the samples. Without it, single residuals.
        seed : int
            Of the draws: the same seed gives the same numbers.
        progress : bool
            Show how many refits are done (needs tqdm).

        Raises
        ------
        Error
            If blocks are longer than half of a record, or fewer than twenty refits ended; of a filter or a horizon, whose errors are also those of a
            disturbed plant (take :meth:`profile`).

        Warns
        -----
        FitWarning
            If the time limit of the fit ended it after fewer refits, or single residuals were drawn though they are colored. Ctrl-C ends it without
            a result.
        """
        count, seed = whole("count", count, 1), whole("seed", seed, 0, 2**64 - 1)
        blocks = None if blocks is None else whole("blocks", blocks, 0)
        with Progress(progress, "bootstrap", count) as shown:
            found = self._problem.bootstrap(self._estimate, blocks, count, seed, shown)
        made = Bootstrap(self.unknowns, [row[2] for row in self._estimate.unknowns], seed, self._kind, found)
        if made.tried < count:
            text = f"the time limit ended the bootstrap after {made.tried} of {count} refits: the intervals are of these"
            warn(FitWarning("bootstrap_ended", "usable", text))
        if made.colored:
            text = "the errors are colored, and single residuals were drawn: the intervals are too narrow; draw blocks=0 or more"
            warn(FitWarning("colored_errors", "usable_with_care", text))
        return made

    def report(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        title: str | None = None,
        profiles: Iterable[str] = (),
        bootstrap: Bootstrap | None = None,
    ) -> Report:
        """Make the report: residuals and their tests, identifiability, predictions with bands, all that was set.

        Parameters
        ----------
        path : path, optional
            Write it there, as ``.html``, ``.md``, ``.json`` or ``.txt``; whole or not at all.
        title : str, optional
            The heading.
        profiles : names
            Unknowns whose profiles it has, too.
        bootstrap : Bootstrap, optional
            Refits that it shows, too.

        Raises
        ------
        Error
            If the path has another ending, or cannot be written to.
        """
        if bootstrap is not None and not isinstance(bootstrap, Bootstrap):
            raise Error(f"bootstrap is {shown(bootstrap)}; give what fit.bootstrap() returns")
        drawn = None if bootstrap is None else bootstrap.to_json()
        profiled = [self.profile(name).to_json() for name in names_of("profiles", profiles)]
        report = Report(self._problem.report(self._estimate).extended(text("title", title), profiled, drawn))
        if path is not None:
            report.save(path)
        return report

    def plot(self) -> Figure:
        """Plot measured and predicted outputs, and the inputs, over time (needs matplotlib)."""
        from greybox import plots

        return plots.response(self._plain(), self._equations)

    def plot_residuals(self) -> Figure:
        """Plot the residuals over time, their autocorrelation and their distribution (needs matplotlib)."""
        from greybox import plots

        return plots.residuals(self._plain(), self._equations)

    def _plain(self) -> dict[str, Any]:
        found: dict[str, Any] = self._predicted(None, {}, self._all, dict)
        return found

    def __str__(self) -> str:
        return str(self._estimate)

    __repr__ = __str__

    def _repr_html_(self) -> str:
        from greybox import notebook

        pictures = self._problem.report(self._estimate).pictures()
        return notebook.shown(self, pictures[0][1] if pictures else "")


def _framed(data: Any) -> Any:
    """Give data that are opened once; nothing and records as they are."""
    return data if data is None or isinstance(data, Record) else framed(data)


def _stacked(records: list[_core.Record], parts: list[dict[str, Array]]) -> dict[str, Any]:
    """Give the columns of all records, one below the other, with the time, and with the record's name where there are several."""
    names = distinct([core.name for core in records])
    labels = [("record", np.repeat(names, [len(core) for core in records]))] if len(records) > 1 else []
    columns = ((name, np.concatenate([part[name] for part in parts])) for name in parts[0])
    return joined([*labels, ("t", np.concatenate([core.time() for core in records])), *columns])
