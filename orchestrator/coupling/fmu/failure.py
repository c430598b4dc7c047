"""The failure of an FMU while a run is going on."""

from __future__ import annotations

from orchestrator.coupling.fmu.binding import DISCARD

NOT_FINITE, TIMEOUT, CRASHED = 5, 6, 7
"""Failures beside the FMI statuses: an output is not finite, no answer in time, the FMU's own process has ended."""


class FmuError(Exception):
    """An FMU failed.

    Attributes
    ----------
    component : name of the instance
    time : s, start of the step that failed
    status : 2 discard, 3 error, 4 fatal (FMI); 5 an output is not finite, 6 no answer in time, 7 its process has ended
    message : what happened, with the FMU's own last message
    """

    def __init__(self, component: str, time: float, status: int, message: str):
        super().__init__(f"{component}, t = {time:.9g} s: {message}")
        self.component, self.time, self.status, self.message = component, time, status, message

    @property
    def recoverable(self) -> bool:
        """Whether a shorter step may help."""
        return self.status in (DISCARD, NOT_FINITE)


class FmuEnd(Exception):
    """An FMU asks for the end of the simulation; nothing has failed.

    Attributes
    ----------
    component : name of the instance
    time : s, up to which the run has come
    """

    def __init__(self, component: str, time: float):
        super().__init__(f"{component} asks for the end of the simulation at t = {time:.9g} s")
        self.component, self.time = component, time
