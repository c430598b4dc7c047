"""Cross-check against mechaphlowers (RTE, MPL 2.0), which computes overhead lines in France: a catenary without bending.

Needs the extra `crosscheck`; skipped without it. A span between two anchors, each with an insulator chain of 1 cm, the
shortest there is; ours spans from the end of one chain to that of the other, as mechaphlowers has them.

Three conventions differ, each by about the strain, 4e-4 to 1e-3. There the weight is that of a metre of the *stretched*
line, here of the unstretched one. There the strains of heat and stress add up on the length at 0 °C, L0 (1 + α θ + T/EA);
here the line that grew by α (θ - θ0) is stretched. And our strain is (λ² - 1)/2. Ours is given what theirs says, by the
strain of the mean tension; what is left, of tension and sag, is held to 1e-4.
"""

import logging

import numpy as np
import pytest

from fmus.cable.assembly import Model, element_work, internal_force, interpolate
from fmus.cable.mesh import nodes
from fmus.cable.ports import add_load
from fmus.cable.statics import equilibrium, mesh_model
from fmus.cable.stringing import Stringing, horizontal_tension
from orchestrator.catalogue.conductor_spec import load_conductor

mechaphlowers = pytest.importorskip(
    "mechaphlowers", reason="mechaphlowers is not installed: pip install -e '.[crosscheck]'"
)
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")
logging.getLogger("mechaphlowers").setLevel(logging.CRITICAL)

SPAN, STRUNG = 300.0, 15.0
GRAVITY = 9.81
"""m/s², theirs."""
THEIR_ICE = 6000.0 / GRAVITY
"""kg/m³, which they give as weight."""
CASES = [(name, level) for name in ("jl_g1a_240_30", "drake", "aster_228") for level in (0.0, 20.0)]
SHARE = 0.2
"""Of the rated strength: the tension at which the lines are strung."""


class Line:
    """A conductor of the catalogue in a span, with both programs."""

    def __init__(self, name: str, level: float):
        spec = load_conductor(name)
        assert spec.rated_strength is not None and spec.thermal_expansion is not None
        self.area, self.ea = spec.metallic_area.value, spec.youngs_modulus.value * spec.metallic_area.value
        self.density, self.diameter = spec.linear_density.value, spec.diameter.value
        self.expansion, self.tension = spec.thermal_expansion.value, SHARE * spec.rated_strength.value
        self.weight = self.density * GRAVITY
        self.engine = self._engine(level)
        self.engine.solve_adjustment()
        self.theirs(STRUNG)
        self.strung = self.ours(self.tension).length_for_tension(self.tension)

    def _engine(self, level: float):
        import pandas as pd
        from mechaphlowers.data.catalog import sample_cable_catalog
        from mechaphlowers.entities.arrays import CableArray, SectionArray

        rows, mm2 = sample_cable_catalog.get(["ASTER600"]).reset_index(), 1e6 * self.area
        modulus = self.ea / mm2  # MPa
        given = {"section": mm2, "section_conductor": mm2, "young_modulus": modulus, "a1": modulus}
        given |= {
            "linear_mass": self.density,
            "diameter": 1e3 * self.diameter,
            "dilatation_coefficient": self.expansion,
        }
        for key, value in given.items():
            rows[key] = float(value)
        cable = CableArray(rows)
        cable.add_units(sample_cable_catalog.units_dict)
        assert float(cable.data.linear_weight.iloc[0]) == pytest.approx(self.weight, rel=1e-12)
        ends = {"suspension": False, "crossarm_length": 0.0, "insulator_length": 0.01, "line_angle": 0.0}
        ends |= {"insulator_mass": 0.0}
        towers = pd.DataFrame([{"name": "left"} | ends, {"name": "right"} | ends])
        towers["conductor_attachment_altitude"] = [30.0, 30.0 + level]
        towers["span_length"] = [SPAN, np.nan]
        towers["load_mass"], towers["load_position"] = [0.0, np.nan], [0.0, np.nan]
        section = SectionArray(towers)
        section.sagging_parameter, section.sagging_temperature = self.tension / self.weight, STRUNG
        return mechaphlowers.BalanceEngine(cable_array=cable, section_array=section)

    def theirs(self, temperature: float, **more: float) -> float:
        """Solve mechaphlowers' state; return its horizontal tension, N."""
        self.engine.solve_change_state(new_temperature=temperature, **more)
        model = self.engine.balance_model
        return float(model.span_model.parameter[0]) * self.weight * float(model.cable_loads.load_coefficient[0])

    @property
    def between(self) -> tuple[float, float]:
        """Span and level difference (m) between the ends of the chains, as they hang now."""
        model = self.engine.balance_model
        return float(model.a[0]), float(model.b[0])

    def ours(self, tension: float, ice: float = 0.0) -> Stringing:
        """Return our line there, 60 equal elements, with the weight that it has in theirs under a horizontal tension."""
        shares = nodes(1.0, 60)
        return Stringing(lambda length: self.model(shares * length, tension, ice), *self.between)

    def model(self, s: np.ndarray, tension: float, ice: float = 0.0) -> Model:
        """Return our line with nodes at the arc lengths `s`, m, and hardly any bending."""
        span, level = self.between
        bare = self.density + np.pi * ice * THEIR_ICE * (self.diameter + ice)
        return mesh_model(
            s, span=span, level_difference=level, ea=self.ea, ei=1e-3, damping=0.0,
            density=bare * (1.0 + self.strain(tension)), gravity=GRAVITY, clamped=False,
        )  # fmt: skip

    def length(self, tension: float, temperature: float) -> float:
        """Return our unstretched length (m) at a temperature, with their rule for the strains of heat and stress."""
        then, now = self.strain(self.tension), self.strain(tension)
        heat = self.expansion * np.array([STRUNG, temperature])
        grown = (1.0 + heat[1] + now) / (1.0 + heat[0] + then)  # the stretched length, theirs
        by_stress, by_heat = stretch(now) / stretch(then), 1.0 + heat[1] - heat[0]
        most = max(then, now)
        assert grown / by_stress == pytest.approx(by_heat, abs=2.0 * most * abs(heat).max() + 3.0 * most**2)
        return self.strung * grown / by_stress

    def strain(self, tension: float) -> float:
        """Return the engineering strain of the mean tension, H s/l of the shallow line of chord s, to the square of the sag."""
        span, level = self.between
        return tension * np.hypot(span, level) / span / self.ea


@pytest.fixture(scope="module", params=CASES, ids=lambda case: f"{case[0]} {case[1]:g} m")
def line(request: pytest.FixtureRequest) -> Line:
    return Line(*request.param)


def supports(model: Model, q: np.ndarray) -> tuple[float, float]:
    """Return the vertical forces (N) of both supports on the line."""
    force = np.zeros(q.size)
    internal_force(model, q, np.zeros(q.size), force, element_work())
    return float(force[2] - model.weight[2]), float(force[-4] - model.weight[-4])


def held_against(line: Line, theirs: float, model: Model, q: np.ndarray) -> None:
    """Compare horizontal tension, and the vertical forces of both supports: the slopes there."""
    balance = line.engine.balance_model
    assert horizontal_tension(model, q) == pytest.approx(theirs, rel=1e-4)
    both = -float(balance.Tv_g[0]), -float(balance.Tv_d[0])
    assert supports(model, q) == pytest.approx(both, abs=1e-4 * sum(both))


def test_strung(line: Line):
    theirs = line.theirs(STRUNG)
    assert theirs == pytest.approx(line.tension, rel=1e-6)
    held_against(line, theirs, *line.ours(theirs).rest(line.length(theirs, STRUNG)))


def test_with_ice(line: Line):
    """They take the weight of ice of 600 kg/m³, ours is given the same."""
    theirs = line.theirs(STRUNG, ice_thickness=0.01)
    held_against(line, theirs, *line.ours(theirs, ice=0.01).rest(line.length(theirs, STRUNG)))


@pytest.mark.parametrize(("mass", "at"), [(38.0, 30.0), (38.0, 150.0), (100.0, 100.0)])
def test_with_a_point_load(line: Line, mass: float, at: float):
    """Also the sag under the load, which is at a share of the line's length."""
    line.engine.set_loads(np.array([at]), np.array([mass]))
    try:
        theirs, model_of_load = line.theirs(STRUNG), line.engine.balance_model.load_model
        s, point = line.length(theirs, STRUNG) * at / SPAN, np.zeros(6)
        model = line.model(nodes(line.length(theirs, STRUNG), 120, 100.0, s), theirs)
        straight, load = np.zeros(model.weight.size), np.zeros(model.weight.size)
        straight[4::6] = 1.0
        add_load(model, straight, s, np.array([0.0, 0.0, -mass * GRAVITY]), np.zeros(3), np.zeros(8), load)
        q = equilibrium(model, *line.between, load)
        held_against(line, theirs, model, q)
        interpolate(model, q, s, np.zeros(8), point)
        (x,), (z,) = model_of_load.x_i, model_of_load.z_i
        chord = line.between[1] / line.between[0]
        assert point[1] == pytest.approx(x, abs=1e-4 * point[1])
        assert chord * point[1] - point[2] == pytest.approx(chord * x - z, rel=1e-4)
    finally:
        line.engine.set_loads(np.array([0.0]), np.array([0.0]))


@pytest.mark.parametrize("temperature", [-20.0, 0.0, 40.0, 75.0])
def test_change_of_state(line: Line, temperature: float):
    theirs = line.theirs(temperature)
    held_against(line, theirs, *line.ours(theirs).rest(line.length(theirs, temperature)))


def stretch(strain: float) -> float:
    """Return our stretch λ under the tension that strains by `strain` there: λ (λ² - 1)/2 = strain."""
    return 1.0 + strain - 1.5 * strain**2
