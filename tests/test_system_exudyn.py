"""Cross-check against Exudyn (J. Gerstmayr, BSD licence), a multibody code with a planar ANCF cable of its own.

Needs the extra `crosscheck`; skipped without it. A straight unstretched cable, pinned at both ends, with a mass at
midspan: both are let go under gravity. Same mesh, same polynomials, but another strain: Exudyn has the engineering
strain |r'| - 1 where ours has (r'·r' - 1)/2, which makes N = EA e (1 + 3/2 e + …) instead of EA e, and its curvature is
divided by |r'|². With a strain e the relative difference is of the order of e, and falls with it: measured 0.90 e at
38 kg (e = 8.2e-4), 0.97 e at 12 kg, 0.86 e at 3.8 kg.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.cable.assembly import add_inertia, constrain_vector, element_work, internal_force
from fmus.cable.statics import mesh_model

exudyn = pytest.importorskip("exudyn", reason="Exudyn is not installed: pip install -e '.[crosscheck]'")

LENGTH, EA, EI, DENSITY, DAMPING, GRAVITY = 10.0, 2.111e7, 337.8, 0.707, 0.005, 9.8
N_ELEMENTS, STOP = 10, 0.4


def ours(mass, times):
    """Height of the mass (m) over time with our element, integrated by SciPy's Radau."""
    model = mesh_model(
        span=LENGTH, level_difference=0.0, unstretched_length=LENGTH, n_elements=N_ELEMENTS, grading=1.0,
        grading_position=-1.0, ea=EA, ei=EI, damping=DAMPING, density=DENSITY, gravity=GRAVITY, clamped=False,
    )  # fmt: skip
    n, work = model.weight.size, element_work()
    middle = 6 * (N_ELEMENTS // 2)
    matrix = np.zeros((n, n))
    for i in range(n):
        column, unit = np.zeros(n), np.eye(n)[i]
        add_inertia(model, unit, column, work)
        matrix[:, i] = column
    matrix[middle : middle + 3, middle : middle + 3] += mass * np.eye(3)
    held = [0, 1, 2, n - 6, n - 5, n - 4]
    matrix[held], matrix[:, held] = 0.0, 0.0
    matrix[held, held] = 1.0
    inverse = np.linalg.inv(matrix)
    weight = model.weight.copy()
    weight[middle + 2] -= mass * GRAVITY

    def rates(t, y):
        force = np.zeros(n)
        internal_force(model, y[:n], y[n:], force, work)
        load = weight - force
        constrain_vector(model, load)
        return np.concatenate([y[n:], inverse @ load])

    start = np.zeros(2 * n)
    start[:n].reshape(-1, 6)[:, 1], start[:n].reshape(-1, 6)[:, 4] = model.s, 1.0
    found = solve_ivp(rates, (0.0, STOP), start, "Radau", times, rtol=1e-6, atol=1e-8)
    assert found.success
    return found.y[middle + 2]


def exudyns(mass, times, step):
    """The same with Exudyn, generalised-alpha."""
    from exudyn.beams import GenerateStraightLineANCFCable2D
    from exudyn.utilities import (
        Cable2D,
        CoordinateConstraint,
        Force,
        MarkerNodeCoordinate,
        MarkerNodePosition,
        MassPoint2D,
        NodePoint2D,
        SensorNode,
    )

    container = exudyn.SystemContainer()
    system = container.AddSystem()
    template = Cable2D(
        physicsMassPerLength=DENSITY, physicsBendingStiffness=EI, physicsAxialStiffness=EA,
        physicsBendingDamping=DAMPING * EI, physicsAxialDamping=DAMPING * EA, useReducedOrderIntegration=0,
    )  # fmt: skip
    nodes = GenerateStraightLineANCFCable2D(
        mbs=system, positionOfNode0=[0, 0, 0], positionOfNode1=[LENGTH, 0, 0], numberOfElements=N_ELEMENTS,
        cableTemplate=template, massProportionalLoad=[0, -GRAVITY, 0],
        fixedConstraintsNode0=[1, 1, 0, 0], fixedConstraintsNode1=[1, 1, 0, 0],
    )[0]  # fmt: skip
    point = system.AddNode(NodePoint2D(referenceCoordinates=[LENGTH / 2, 0]))
    system.AddObject(MassPoint2D(physicsMass=mass, nodeNumber=point))
    marker = system.AddMarker(MarkerNodePosition(nodeNumber=point))
    system.AddLoad(Force(markerNumber=marker, loadVector=[0, -mass * GRAVITY, 0]))
    for i in range(2):
        markers = [
            system.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=i))
            for node in (nodes[N_ELEMENTS // 2], point)
        ]
        system.AddObject(CoordinateConstraint(markerNumbers=markers))
    sensor = system.AddSensor(
        SensorNode(nodeNumber=point, storeInternal=True, outputVariableType=exudyn.OutputVariableType.Displacement)
    )
    system.Assemble()
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.numberOfSteps = round(STOP / step)
    settings.timeIntegration.endTime = STOP
    settings.timeIntegration.newton.relativeTolerance = 1e-8
    settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = times[1] - times[0]
    settings.timeIntegration.verboseMode = 0
    system.SolveDynamic(settings)
    rows = system.GetSensorStoredData(sensor)
    return np.interp(times, rows[:, 0], rows[:, 2])


@pytest.mark.parametrize("mass", [38.0, 3.8])
def test_cable_with_a_mass_at_midspan(mass):
    """The difference is that of the strain measures, up to the time integration's error, taken from half the step."""
    times = np.linspace(0.0, STOP, 201)
    here, coarse, there = ours(mass, times), exudyns(mass, times, 1e-4), exudyns(mass, times, 5e-5)
    scale = np.max(np.abs(here))
    integration = np.max(np.abs(there - coarse))
    strain = 0.5 * (scale / (LENGTH / 2)) ** 2  # of two straight halves
    difference = np.max(np.abs(here - there))
    assert integration < 1e-2 * difference
    assert 0.5 * strain * scale < difference < strain * scale
