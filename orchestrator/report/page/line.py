"""The line over time: nodes with slopes, between which a cubic Hermite is the shape of its elements."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

FRAME = 0.02
"""s between two shapes: the eye sees no more."""
GRAIN = 2.0**-20
"""m, and without unit of slopes: to what shapes are rounded. That compresses better, and nobody sees a micrometre."""


@dataclass(frozen=True)
class Line:
    """Shapes of a line.

    Attributes
    ----------
    s : (m,) m, unstretched arc length of the nodes
    time : (k,) s
    position : (k, m, 3) m
    slope : (k, m, 3), dr/ds
    exact : whether these are the nodes of the mesh; else points between which a smooth curve is drawn
    """

    s: np.ndarray
    time: np.ndarray
    position: np.ndarray
    slope: np.ndarray
    exact: bool

    def arrays(self, prefix: str = "") -> dict[str, np.ndarray]:
        """Return the arrays of a page, by name."""
        shapes = {"position": self.position, "slope": self.slope}
        rounded = {name: (GRAIN * np.round(values / GRAIN)).astype(np.float32) for name, values in shapes.items()}
        named = {"s": self.s.astype(float), "time": self.time.astype(float), **rounded}
        return {f"{prefix}line.{name}": values for name, values in named.items()}


def line_of(fields: Mapping[str, np.ndarray], every: float = FRAME) -> Line | None:
    """Return the shapes of a line from ``fields.h5``, one in `every` seconds; None where there are none.

    A line from elsewhere, or of an old run, is known at equidistant points alone: its slopes are then those of Akima's curve
    through them, which does not swing beside a kink.
    """
    if "position" not in fields or len(fields["time"]) == 0:
        return None
    rows = frames(fields["time"], every)
    time = fields["time"][rows]
    if "node_position" in fields:
        position, slope = fields["node_position"][rows], fields["node_slope"][rows]
        return Line(fields["node_arc_length"], time, position, slope, exact=True)
    s, position = fields["arc_length"], fields["position"][rows]
    return Line(s, time, position, _slopes(s, position), exact=False)


def frames(time: np.ndarray, every: float) -> np.ndarray:
    """Return the rows of a time (n,) that are nearest to multiples of `every`, each once; first and last among them."""
    if len(time) < 2:
        return np.arange(len(time))
    wanted = np.arange(time[0], time[-1] + 0.5 * every, every)
    after = np.clip(np.searchsorted(time, wanted), 1, len(time) - 1)
    before_is_nearer = wanted - time[after - 1] < time[after] - wanted
    return np.unique(np.concatenate([[0], after - before_is_nearer, [len(time) - 1]]))


def _slopes(s: np.ndarray, position: np.ndarray) -> np.ndarray:
    from scipy.interpolate import Akima1DInterpolator

    derivative = Akima1DInterpolator(s, position, axis=1).derivative()
    return np.asarray(derivative(s))
