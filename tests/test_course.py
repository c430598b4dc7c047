"""Inputs over time in the engine: their means and slopes, and FMUs that follow them under every master."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp

from orchestrator.catalogue.library import module_fmu
from orchestrator.coupling import Course, Fmu, Graph, GraphError, InputError, SubStepped, read_courses, simulate
from orchestrator.coupling.masters import MASTERS
from tests.fmus import fmu

TIMES = st.lists(st.floats(0.0, 10.0), min_size=1, max_size=8).map(sorted)


@st.composite
def courses(draw):
    time = draw(TIMES)
    value = draw(st.lists(st.floats(-5.0, 5.0), min_size=len(time), max_size=len(time)))
    return Course(time, value, draw(st.sampled_from(["linear", "step"])))


@given(courses(), st.floats(-1.0, 11.0), st.floats(0.01, 3.0))
def test_mean_and_slope_are_the_projection_on_linear_functions(course, t, h):
    """Against adaptive quadrature between the kinks."""
    middle = t + 0.5 * h
    edges = [t, *course.kinks(t, t + h), t + h]
    assume(min(np.diff(edges)) > 1e-9)  # quadrature of what is shorter is not to be trusted
    integral = moment = 0.0
    for a, b in pairwise(edges):
        # straight in between: ends that jump are taken from inside
        first, last = course.after(a), course.before(b)
        line = lambda tau, a=a, b=b, x=first, y=last: x + (y - x) * (tau - a) / (b - a)  # noqa: E731
        integral += quad(line, a, b, epsabs=1e-11)[0]
        moment += quad(lambda tau, line=line: line(tau) * (tau - middle), a, b, epsabs=1e-11)[0]
    mean, slope = course.over(t, h)
    assert mean == pytest.approx(integral / h, abs=1e-9)
    assert slope == pytest.approx(12.0 * moment / h**3, abs=1e-9 / h**2)


@given(st.floats(-1e3, 1e3), st.floats(0.0, 5.0), st.floats(1e-4, 1.0))
def test_a_constant_is_itself_to_the_last_bit(value, t, h):
    for course in (
        Course([0.0], [value]),
        Course([0.0, 1.0, 2.0], [value] * 3),
        Course([1.0, 2.0], [value] * 2, "step"),
    ):
        if not course.kinks(t, t + h):
            assert course.over(t, h) == (value, 0.0)
        assert course.after(t) == course.before(t) == value


def test_before_the_first_and_after_the_last_it_is_held():
    course = Course([1.0, 2.0], [3.0, 5.0])
    assert [course.after(t) for t in (0.0, 1.0, 1.5, 2.0, 9.0)] == [3.0, 3.0, 4.0, 5.0, 5.0]


def test_steps_and_jumps():
    """A step at 1 s, as a table of steps and as two entries of one time."""
    for course in (Course([0.0, 1.0], [3.0, 5.0], "step"), Course([0.0, 1.0, 1.0], [3.0, 3.0, 5.0])):
        assert (course.before(1.0), course.after(1.0)) == (3.0, 5.0)
        assert course.over(0.5, 1.0)[0] == 4.0
        assert course.over(0.0, 1.0) == (3.0, 0.0) and course.over(1.0, 1.0) == (5.0, 0.0)


@pytest.mark.parametrize(
    ("time", "value", "said"),
    [
        ([], [], "is empty"),
        ([0.0, 1.0], [1.0], "2 times and 1 values"),
        ([0.0, 2.0, 1.0], [1.0, 2.0, 3.0], r"time\[3\] = 1 s is before time\[2\] = 2 s"),
        ([0.0, math.nan], [1.0, 2.0], r"time\[2\] = nan is not a finite number"),
        ([0.0, 1.0], [math.inf, 2.0], r"value\[1\] = inf is not a finite number"),
    ],
)
def test_bad_tables_are_refused(time, value, said):
    with pytest.raises(ValueError, match=said):
        Course(time, value)


# -- files -------------------------------------------------------------------------------------------------------


def test_a_file_in_the_format_of_fmpy(tmp_path):
    path = tmp_path / "in.csv"
    path.write_text('"time","thrust","torque.x"\n0,372.4,0\n1,0,0\n1,5,2\n', encoding="utf-8")
    found = read_courses(path)
    assert found["thrust"].after(0.5) == pytest.approx(186.2, rel=1e-15)
    assert (found["torque.x"].before(1.0), found["torque.x"].after(1.0)) == (0.0, 2.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "first line must be a header"),
        ("t,u\n0,1\n", "first line must be a header"),
        ("time,u,u\n0,1,2\n", "two columns have one name"),
        ("time,u\n0,one\n", "line 2: could not convert string to float"),
        ("time,u\n0,1\n1\n", "line 3: 1 numbers for 2 columns"),
        ("time,u\n", "is empty"),
        ("time,u\n1,1\n0,1\n", "is before"),
    ],
)
def test_bad_files_are_refused(tmp_path, text, said):
    path = tmp_path / "in.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        read_courses(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_courses(tmp_path / "none.csv")


# -- FMUs that follow courses ------------------------------------------------------------------------------------

FORCE = Course([0.0, 0.33, 0.33, 0.7, 2.0], [1.0, 4.0, -2.0, 3.0, 0.0])
"""A force with kinks and a jump, none at a communication point."""
K, D, STOP = 10.0, 0.1, 2.0


def oscillator(name="a", steps=1, **parameters):
    one = Fmu(module_fmu("oscillator"), name) if steps == 1 else SubStepped(module_fmu("oscillator"), name, steps)
    one.set_parameters({"stiffness": K, "damping": D, **parameters})
    return one


def exact(course, times):
    """Position of one mass under the course, integrated from kink to kink."""
    found, y, t = {0.0: 0.0}, np.zeros(2), 0.0
    for end in sorted({*course.kinks(0.0, STOP), *times[1:]}):
        force = (course.after(t), (course.before(end) - course.after(t)) / (end - t))
        run = solve_ivp(
            lambda s, x, f=force, t=t: (x[1], f[0] + f[1] * (s - t) - K * x[0] - D * x[1]),
            (t, end), y, "DOP853", rtol=1e-12, atol=1e-14,
        )  # fmt: skip
        y, t = run.y[:, -1], end
        found[end] = y[0]
    return np.array([found[one] for one in times])


def followed(master, H, course=FORCE, steps=1, connected=True):
    """Position of a mass that follows a course, beside a second mass that a weak spring of no stiffness ties to it."""
    parts = {"a": oscillator("a", steps), "b": oscillator("b")}
    links = ["a.position -> b.neighbour.position", "a.velocity -> b.neighbour.velocity"] if connected else []
    links += ["b.position -> a.neighbour.position"] if connected else []
    with Graph(parts, links, inputs={"a.force": course}) as graph:
        log = simulate(graph, MASTERS[master](graph), 0.0, STOP, H, ["a.position"])
    log.raise_error()
    return log.time, log.signal("a.position")


def test_the_log_has_the_course_at_the_communication_points():
    """Not the mean that the FMU was given; a jump belongs to the point that it lies at. By default, and if it is asked for."""
    steps = Course([0.0, 0.3], [1.0, 5.0], "step")
    for record in (None, ["b.position", "a.force", "a.position"]):
        with Graph({"a": oscillator(), "b": oscillator("b")}, [], inputs={"a.force": steps}) as graph:
            log = simulate(graph, "jacobi", 0.0, 0.5, 0.1, record)
        np.testing.assert_array_equal(log.signal("a.force"), [1.0, 1.0, 1.0, 5.0, 5.0, 5.0])
        assert log.units["a.force"] == "N" and "b.force" not in log.signals
        assert log.signal("a.position")[-1] > log.signal("b.position")[-1] == 0.0


USABLE = [name for name in MASTERS if name not in ("interface_jacobian", "reduced_interface")]


@pytest.mark.parametrize("master", USABLE)
def test_every_master_gives_the_means_of_the_course(master):
    """The oscillator is exact for forces that are linear within a step. Of a force with a jump J its projection has the right
    mean and first moment, so that place and speed at the end of the step are wrong through the spring alone, by less than
    k J h⁴/24 in the place."""
    time, x = followed(master, 0.05)
    error = np.max(np.abs(x - exact(FORCE, time.tolist())))
    assert error < K * 6.0 * 0.05**4 / 24.0


@pytest.mark.parametrize("steps", [1, 3])
def test_smooth_courses_have_order_4_and_none_where_they_are_straight(steps):
    straight = Course([0.0, 2.0], [1.0, -3.0])
    time, x = followed("jacobi", 0.1, straight, steps, connected=False)
    assert np.max(np.abs(x - exact(straight, time.tolist()))) < 1e-10
    grid = np.linspace(0.0, STOP, 4001)
    wave, errors = Course(grid, np.sin(9.0 * grid)), []
    truth = solve_ivp(
        lambda t, y: (y[1], math.sin(9.0 * t) - K * y[0] - D * y[1]), (0.0, STOP), [0.0, 0.0], "DOP853", rtol=1e-12, atol=1e-14
    ).y[0, -1]  # fmt: skip
    for H in (0.2, 0.1):
        errors.append(abs(followed("jacobi", H, wave, connected=False)[1][-1] - truth))
    if steps == 1:
        assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.3)


def test_sub_divided_and_adaptive_steps_take_their_own_means():
    """Steps that fit the error make the same motion from short steps; a course that ends within a macro step is seen."""
    parts = {"a": oscillator("a"), "b": oscillator("b", coupling_stiffness=50.0)}
    links = ["a.position -> b.neighbour.position", "b.neighbour.force -> a.force", "a.velocity -> b.neighbour.velocity"]
    results = []
    for H, options in ((0.2, {"local_tolerance": 1e-8, "max_depth": 12}), (0.002, {})):
        parts = {"a": oscillator("a"), "b": oscillator("b", coupling_stiffness=50.0)}
        with Graph(parts, links, inputs={"b.force": FORCE}) as graph:
            master = MASTERS["iqn_ils"](graph, tolerance=1e-9, **options)
            results.append(simulate(graph, master, 0.0, STOP, H, ["b.position"]).signal("b.position")[-1])
    assert results[0] == pytest.approx(results[1], abs=2e-5)


def test_an_fmu_without_an_input_for_the_slope_gets_the_means_and_says_so():
    one = fmu("plant", "p")
    name = next(n for n, p in one.ports.items() if p.causality == "input" and p.kind == "real")
    with Graph({"p": one}, [], inputs={f"p.{name}": Course([0.0, 1.0], [0.0, 1.0])}) as graph:
        driven = graph.components["p"].driven
        assert driven.without_slope == [name] and f"p.{name}" not in graph.unfed


def test_integers_flags_and_discrete_inputs_go_in_steps():
    """They are what the course is at the start of a step, and stay so until the next communication point."""
    steps = Course([0.0, 0.15, 0.3 + 1e-16], [0.0, 1.0, 0.0], "step")  # 3 * 0.1 is the last bit beyond 0.3
    inputs = {f"o.{name}": steps for name in ("count_in", "flag_in", "held_in")}
    with Graph({"o": fmu("odd", "o")}, [], inputs=inputs) as graph:
        seen = []
        simulate(
            graph,
            "jacobi",
            0.0,
            0.5,
            0.1,
            on_step=lambda _: seen.append([graph.components["o"].read(n) for n in ("count_in", "flag_in", "held_in")]),
        )
    assert seen == [[0, False, 0.0], [0, False, 0.0], [1, True, 1.0], [0, False, 0.0], [0, False, 0.0]]
    for name, course, said in (
        ("count_in", Course([0.0], [1.0]), "can only go in steps"),
        ("flag_in", Course([0.0], [2.0], "step"), "its values must be such"),
        ("count_in", Course([0.0], [0.5], "step"), "its values must be such"),
        ("heard", Course([0.0], [1.0], "step"), "is a string|is no input"),
    ):
        with pytest.raises(GraphError, match=said):
            Graph({"o": fmu("odd", "o")}, [], inputs={f"o.{name}": course})


def test_outputs_that_depend_on_the_input_show_its_value_at_the_instant():
    """y = 2 u without a step, x the integral of u: one is the course, the other has its mean."""
    ramp = Course([0.0, 1.0], [0.0, 3.0])
    one = fmu("odd", "o", gain=2.0)
    with Graph({"o": one}, [], inputs={"o.u": ramp}) as graph:
        log = simulate(graph, "jacobi", 0.0, 1.0, 0.25, ["o.y", "o.x"])
    np.testing.assert_allclose(log.signal("o.y"), 6000.0 * log.time, rtol=1e-14)  # mm
    np.testing.assert_allclose(log.signal("o.x"), 1.5 * log.time**2, rtol=1e-14)


def test_what_nothing_feeds_is_no_longer_named():
    with Graph({"a": oscillator()}, []) as graph:
        assert "a.force" in graph.unfed
    with Graph({"a": oscillator()}, [], inputs={"a.force": FORCE}) as graph:
        assert not {"a.force", "a.force_rate"} & set(graph.unfed)


@pytest.mark.parametrize(
    ("signal", "said"),
    [
        ("c.force", "no component 'c'"),
        ("a.forse", "no variable forse; did you mean force"),
        ("a.position", "is no input but output"),
        ("a.mass", "is no input but a fixed parameter"),
        ("a.neighbour.position", "follows a table and is fed by b.position"),
    ],
)
def test_what_cannot_follow_is_refused(signal, said):
    parts = {"a": oscillator("a"), "b": oscillator("b")}
    with pytest.raises(GraphError, match=said):
        Graph(parts, ["b.position -> a.neighbour.position"], inputs={signal: FORCE})
    for one in parts.values():
        one.close()
