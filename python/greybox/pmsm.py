"""Models of permanent magnet synchronous motors that ship with the library."""

from __future__ import annotations

from greybox import _core
from greybox.checks import whole
from greybox.model import Equations

__all__ = ["surface"]


def surface(*, pole_pairs: int) -> Equations:
    """Give a motor with surface magnets, in the frame of its rotor.

    ``Ls did/dt = ud - Rs id + we Ls iq``, ``Ls diq/dt = uq - Rs iq - we Ls id - sqrt(2/3) Ke w``, with ``we = np w``.

    Inputs ``ud``, ``uq`` (V) and ``w`` (rad/s), states and outputs ``id`` and ``iq`` (A, phase peak), parameters ``rs`` (ohm), ``ls``
    (H) and ``ke`` (V s/rad, line-to-line rms).

    Raises
    ------
    Error
        If there is not at least one pair of poles.
    """
    return Equations(_core.surface(whole("pole_pairs", pole_pairs, 1)))
