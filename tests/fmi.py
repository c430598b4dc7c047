"""One FMU instance behind FMPy, by variable name: what the tests of the FMUs drive."""

from __future__ import annotations

import fmpy
from fmpy.fmi2 import FMU2Slave, defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE


class Instance:
    """An instantiated FMU.

    Parameters
    ----------
    folder : of the unzipped FMU
    parameters : set before initialisation mode

    `messages` collects (status, text) of everything the FMU logs.
    """

    def __init__(self, folder, **parameters):
        self.description = fmpy.read_model_description(folder)
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.messages: list[tuple[int, str]] = []
        self._callbacks = fmi2CallbackFunctions()
        self._callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
        self._callbacks.allocateMemory = defaultCallbacks.allocateMemory
        self._callbacks.freeMemory = defaultCallbacks.freeMemory
        identifier = self.description.coSimulation.modelIdentifier
        self.fmu = FMU2Slave(guid=self.description.guid, unzipDirectory=folder, modelIdentifier=identifier)
        self.fmu.instantiate(callbacks=self._callbacks, loggingOn=True)
        self.fmu.setupExperiment(startTime=0.0)
        self.set(**parameters)

    def _log(self, environment, name, status, category, message):
        self.messages.append((status, message.decode()))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.fmu.freeInstance()

    def initialize(self) -> Instance:
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def set(self, **values):
        for name, value in values.items():
            variable = self.variables[name]
            getattr(self.fmu, "set" + variable.type)([variable.valueReference], [value])

    def get(self, name: str):
        variable = self.variables[name]
        return getattr(self.fmu, "get" + variable.type)([variable.valueReference])[0]

    def names(self, causality: str) -> list[str]:
        return [v.name for v in self.variables.values() if v.causality == causality]

    def outputs(self) -> dict[str, object]:
        return {name: self.get(name) for name in self.names("output")}

    def run(self, t: float, h: float, n: int) -> list[dict[str, object]]:
        """Take `n` steps of length `h` from `t`; return the outputs after each."""
        rows = []
        for i in range(n):
            self.fmu.doStep(t + i * h, h)
            rows.append(self.outputs())
        return rows
