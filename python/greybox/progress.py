"""A line of progress, by tqdm."""

from __future__ import annotations

from typing import Any

from greybox.errors import Error


class Progress:
    """Shows how far work is, if it is asked for; a context that gives what the compiled library calls."""

    def __init__(self, wanted: bool, what: str, total: int | None = None) -> None:
        self._wanted, self._what, self._total = wanted, what, total
        self._bar: Any = None

    def __enter__(self) -> Any:
        if not self._wanted:
            return None
        try:
            from tqdm.auto import tqdm
        except ImportError:
            raise Error("progress is shown by tqdm, which is not installed: pip install tqdm") from None
        self._bar = tqdm(total=self._total, desc=self._what, unit=" iterations" if self._total is None else " records")
        return self._show

    def _show(self, done: int, cost: float) -> None:
        self._bar.update(done - self._bar.n)
        if self._total is None:
            self._bar.set_postfix_str(f"cost {cost:.6g}", refresh=False)

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()
