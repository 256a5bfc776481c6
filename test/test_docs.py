"""The documentation against the project: references, commands, and the numbers of thesis.md.

docs/thesis.md lists commands as `ctcbs ... --json    # LABEL`, and numbers in tables headed
"what | thesis | here | printed by | difference": `printed by` is a label and, in jq's language,
a path into what that command prints. Each number must be that one to the digits shown.
"""

import ast
import contextlib
import importlib.util
import io
import json
import re
import shlex
import signal
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from points import STRETCHED, figure_3_1, figure_4_1, parameters
from reference_vibration import K, eigenvalues_in_sines, largest_in_band

from ctcbs_ros.cli.main import main
from ctcbs_ros.kernels.galerkin import local_matrices
from ctcbs_ros.kernels.trajectory import N_THETA, cable_rhs
from ctcbs_ros.solver.stability import eigenvalues
from ctcbs_ros.solver.steady_state import steady_states

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = ("README.md", "docs/architecture.md", "docs/theory.md", "docs/thesis.md",
             "docs/orbit.md", "docs/telemetry.md", "docs/twin.md",
             "docs/validation.md")  # fmt: skip
THESIS = (ROOT / "docs" / "thesis.md").read_text(encoding="utf-8")
# Folders in which a document may leave out the way to a file.
ROOMS = [ROOT, ROOT / "ctcbs_ros", ROOT / "test", ROOT / "docs"]
HEADER = "| what | thesis | here | printed by | difference |"


def document(name):
    return (ROOT / name).read_text(encoding="utf-8")


# References.


def located(reference):
    """The files that a reference can mean."""
    if "/" in reference:
        return [room / reference for room in ROOMS if (room / reference).exists()]
    folders = [ROOT / "ctcbs_ros", ROOT / "test", ROOT / "docs", ROOT / "launch"]
    return [*ROOT.glob(reference), *(f for folder in folders for f in folder.rglob(reference))]


@cache
def defined(path):
    """Names that a Python file defines at its top, and those of its classes as Class.name."""
    names = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names.add(node.name)
        if isinstance(node, ast.ClassDef):
            fields = [n.target.id for n in node.body if isinstance(n, ast.AnnAssign)]
            methods = [n.name for n in node.body if isinstance(n, ast.FunctionDef)]
            names |= {f"{node.name}.{name}" for name in (*fields, *methods)}
        if isinstance(node, ast.Assign):
            names |= {n.id for target in node.targets for n in ast.walk(target)
                      if isinstance(n, ast.Name)}  # fmt: skip
    return names


@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_file_that_a_document_names_exists(name):
    text = document(name)
    named = set(re.findall(r"(?<![\w/.~-])(?:[\w]+/)*[\w.]+\.(?:py|md)\b", text))
    # Other files are the user's own, unless they lie in a folder of the project.
    named |= set(re.findall(r"(?<![\w/.~-])(?:config|docs|launch|msg_examples)/[\w./]+\w", text))
    folders = set(re.findall(r"`((?:\w+/)+)`", text)) - {"demo/"}
    assert named
    assert [reference for reference in sorted(named | folders) if not located(reference)] == []


@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_function_that_a_document_names_is_in_its_file(name):
    lost = []
    for reference, names in re.findall(r"`([\w/]+\.py): ([^`]+)`", document(name)):
        found = set().union(*(defined(path) for path in located(reference)))
        lost += [f"{reference}: {n}" for n in names.split(", ") if n not in found]
    tests = set().union(*(defined(path) for path in (ROOT / "test").glob("test_*.py")))
    files = {path.stem for path in (ROOT / "test").glob("test_*.py")}
    lost += set(re.findall(r"\btest_\w+", document(name))) - tests - files
    assert lost == []


def options(command):
    """The options that a subcommand has."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), pytest.raises(SystemExit) as ended:
        main([*command, "--help"])
    assert ended.value.code == 0, command
    return set(re.findall(r"--[a-z][a-z-]*", printed.getvalue()))


@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_command_that_a_document_names_has_the_options_named(name):
    for line in re.findall(r"(?:^ {4}|`)ctcbs ([a-z-]+ [^`\n]*)", document(name), re.MULTILINE):
        words = line.split("#")[0].split()
        command = words[:2] if words[0] == "table" else words[:1]
        assert set(re.findall(r"(?<!\S)\[?(--[a-z][a-z-]*)", line)) <= options(command), line


# Numbers.


def commands():
    """Commands of thesis.md by label, and whether they are slow."""
    found = re.findall(r"^ {4}ctcbs (.*?) +# (\S+)( slow)?$", THESIS, re.MULTILINE)
    assert len({label for _, label, _ in found}) == len(found)
    return {label: (shlex.split(command), bool(slow)) for command, label, slow in found}


def numbers():
    """Rows of the tables of numbers: what, here, label, path."""
    rows = []
    for table in THESIS.split(HEADER)[1:]:
        for line in table.splitlines()[2:]:
            if not line.startswith("|"):
                break
            cells = [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line)]
            what, _, here, printed_by, _ = cells[1:-1]
            label, path = re.fullmatch(r"(\S+) `(.+)`", printed_by).groups()
            rows.append((what, here, label, path))
    return rows


def selected(path, value):
    """What a path of jq's language takes out of a value; as much of it as thesis.md uses."""
    start, *functions = (part.strip() for part in path.split("|"))
    collected = start.startswith("[.")
    values = [value]
    for key, index in re.findall(r"\.(\w+)|\[(-?\d*)\]", start[1:-1] if collected else start):
        if key:
            values = [v[key] for v in values]
        elif index:
            values = [v[int(index)] for v in values]
        else:
            values = [w for v in values for w in v]
    result = values if collected else values[0]
    for function in functions:
        result = {"length": len, "all": all, "any": any, "min": min, "max": max}[function](result)
    return result


def agrees(here, value):
    """Whether a number or word of a table is the value, to the digits shown."""
    if here in ("true", "false", "null"):
        return value is {"true": True, "false": False, "null": None}[here]
    if isinstance(value, str):
        return here == value
    mantissa, _, exponent = here.partition("e")
    digits = len(mantissa.partition(".")[2])
    unit = 10.0 ** (int(exponent or 0) - digits)
    return value is not None and abs(value - float(here)) <= 0.5001 * unit


@cache
def printed(label):
    """What a command of thesis.md prints, as a value."""
    words, _ = commands()[label]
    output = io.StringIO()
    handler = signal.getsignal(signal.SIGTERM)
    try:
        with contextlib.redirect_stdout(output):
            assert main(words) == 0
    finally:
        signal.signal(signal.SIGTERM, handler)
    return json.loads(output.getvalue())


def rows(slow):
    return [pytest.param(*row, id=f"{row[2]}-{row[0]}") for row in numbers()
            if commands()[row[2]][1] == slow]  # fmt: skip


@pytest.mark.parametrize(("what", "here", "label", "path"), rows(slow=False))
def test_a_number_of_the_thesis_page_is_what_its_command_prints(what, here, label, path):
    value = selected(path, printed(label))
    assert agrees(here, value), f"{what}: {here} in docs/thesis.md, {value!r} printed"


@pytest.mark.slow
@pytest.mark.parametrize(("what", "here", "label", "path"), rows(slow=True))
def test_a_slow_number_of_the_thesis_page_is_what_its_command_prints(what, here, label, path):
    value = selected(path, printed(label))
    assert agrees(here, value), f"{what}: {here} in docs/thesis.md, {value!r} printed"


def test_every_command_of_the_thesis_page_is_used_and_every_label_has_a_command():
    assert {label for _, _, label, _ in numbers()} == set(commands())


def test_a_changed_digit_would_be_seen():
    assert agrees("6.158", 6.15765)
    assert not agrees("6.159", 6.15765)
    assert agrees("8.43e-3", 0.0084294)
    assert not agrees("8.44e-3", 0.0084294)
    assert not agrees("true", 1)
    assert selected("[.a[].b] | max", {"a": [{"b": 1}, {"b": 3}]}) == 3
    assert selected(".a[1].b", {"a": [{"b": 1}, {"b": 3}]}) == 3
    assert selected(".a | length", {"a": [{"b": 1}, {"b": 3}]}) == 2


def test_growth_rates_by_number_of_functions_are_those_of_the_theory_page():
    text = document("docs/theory.md")
    (state,) = steady_states(parameters(STRETCHED)).states
    said = re.search(
        r"(-[\d.]+) with 12 functions, (-[\d.]+) with 24 and (-[\d.]+) with 40", text
    ).groups()
    for functions, growth in zip((12, 24, 40), said, strict=True):
        assert agrees(growth, eigenvalues(state, functions).real.max())


def test_frequencies_by_the_bounce_mode_are_those_of_the_theory_page():
    text = document("docs/theory.md")
    for gamma, pattern in ((600.0, r"to ([\d.]+), ([\d.]+) and ([\d.]+), and the middle one"),
                           (6e4, r"\(([\d.]+) and ([\d.]+) for a stiff cable")):  # fmt: skip
        (state,) = steady_states(parameters({**STRETCHED, "gamma": gamma})).states
        values = eigenvalues(state, 24)
        slow = np.sort(values.imag[(values.real > -0.5) & (values.imag > 0.0)])
        for said, found in zip(re.search(pattern, text).groups(), slow, strict=False):
            assert agrees(said, found)


@pytest.mark.slow
def test_five_sines_give_the_edges_that_the_thesis_states():
    # Fig. 4.1, d_n 1.33, text: 1.8, 2.2, 2.8
    edges = re.search(r"d_n 1.33 are ([\d.]+), ([\d.]+) and ([\d.]+), as", THESIS).groups()

    def unstable(omega, d_n=1.33):
        point = figure_4_1(d_n, omega)
        (state,) = steady_states(parameters(point)).states
        values = eigenvalues_in_sines(point, state.end_mass_radius, 5, 600.0)
        return largest_in_band(values, 5.0).real > 0.0

    for edge, opens in zip(edges, (True, False, True), strict=True):
        assert unstable(float(edge) - 0.01) != opens
        assert unstable(float(edge) + 0.01) == opens
    # d_n 2: text 3.2
    assert not any(unstable(omega, 2.0) for omega in (3.2, 3.6, 4.0))


def picture():
    """docs/surface.py as a module."""
    spec = importlib.util.spec_from_file_location("surface", ROOT / "docs" / "surface.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_picture_s_surface_has_the_tow_radius_1_at_the_states_and_only_there():
    surface = picture()
    radii = [state.end_mass_radius for state in steady_states(surface.cable(1.0)).states]
    assert len(radii) == 3
    assert surface.tow_radii([1.0], radii) == pytest.approx(np.ones((3, 1)), abs=1e-6)
    between = np.sqrt(np.array(radii[:-1]) * radii[1:])
    assert np.sign(surface.tow_radii([1.0], between) - 1.0).ravel().tolist() == [1.0, -1.0]


def test_the_picture_is_drawn(tmp_path):
    picture().draw(tmp_path / "surface.png")
    assert (tmp_path / "surface.png").stat().st_size > 20_000


# Errata: the printed entry is wrong, the corrected one right.


def at_a_point():
    """Position, tangent, v_n and its Jacobian at a point of a cable, and the solver's matrices."""
    state = steady_states(parameters(figure_3_1(4.8))).states[1]
    position, force = (a[0] for a in state.cable([1.3]))
    t = force / np.linalg.norm(force)
    v_n = np.cross(t, np.cross(np.cross(K, position), t))
    speed = np.linalg.norm(v_n)
    jacobian = speed * np.eye(3) + np.outer(v_n, v_n) / speed
    matrices = np.empty((5, 3, 3))
    local_matrices(
        state.parameters.theta(state.end_mass_radius), 600.0, False, 0.0,
        np.concatenate([position, force]), *matrices,
    )  # fmt: skip
    return state, position, force, t, v_n, jacobian, matrices


def test_the_drag_of_2_11_to_2_13_is_right_with_its_erratum_and_wrong_as_printed():
    state, (px, py, pz), force, (tx, ty, tz), v_n, _, _ = at_a_point()
    theta = state.parameters.theta(state.end_mass_radius)
    dy = np.empty((1, 6))
    cable_rhs(theta, np.empty((0, N_THETA)), np.array([[px, py, pz, *force]]), dy)
    omega2, d_n, speed = theta[1] ** 2, theta[4], np.linalg.norm(v_n)
    turn = py * tx - ty * px
    # (2.14)
    assert speed == pytest.approx(np.hypot(tz * np.hypot(px, py), px * tx + py * ty), rel=1e-12)
    right = omega2 * np.array(
        [-px + d_n * speed * (-py + tx * turn), -py + d_n * speed * (px + ty * turn),
         1.0 / omega2 + d_n * speed * tz * turn]
    )  # fmt: skip
    printed_x = omega2 * (-px - d_n * speed * py - tx * turn)
    assert dy[0, 3:] == pytest.approx(right, rel=1e-12)
    assert abs(printed_x - dy[0, 3]) > 0.1 * abs(dy[0, 3])


def test_appendix_a_is_right_with_its_errata_and_wrong_as_printed():
    _, (x, y, _), _, (xs, ys, zs), v_n, jacobian, (rate, *_) = at_a_point()
    x_1, x_2, x_3 = v_n
    assert x_1 == pytest.approx(-y + xs * (y * xs - ys * x), rel=1e-12)
    assert x_2 == pytest.approx(x + ys * (y * xs - ys * x), rel=1e-12)
    assert x_3 == pytest.approx(zs * (y * xs - x * ys), rel=1e-12)
    as_printed = x + ys * (x * ys - xs * y)
    assert abs(as_printed - x_2) > 0.1 * abs(x_2)
    # J P: P takes out the part of a velocity along the cable
    t = np.array([xs, ys, zs])
    assert rate == pytest.approx(jacobian @ (np.eye(3) - np.outer(t, t)), rel=1e-10, abs=1e-12)


def test_appendix_b_is_right_with_its_erratum_and_wrong_as_printed():
    _, (x, y, _), _, (xs, ys, zs), _, jacobian, (rate, position, slope, _, _) = at_a_point()
    j1, j2, j3, j4, j5, j6 = jacobian[np.triu_indices(3)]
    D = [
        [-j2 * xs * ys + j1 * ys**2 + j1 * zs**2 - j3 * xs * zs,
         -j3 * ys * zs + j2 * zs**2 + j2 * xs**2 - j1 * ys * xs,
         -j2 * zs * ys + j3 * ys**2 + j3 * xs**2 - j1 * xs * zs],
        [-j4 * xs * ys + j2 * zs**2 + j2 * ys**2 - j5 * xs * zs,
         -j5 * ys * zs + j4 * xs**2 + j4 * zs**2 - j2 * xs * ys,
         -j4 * ys * zs + j5 * ys**2 + j5 * xs**2 - j2 * xs * zs],
        [-j5 * xs * ys + j3 * ys**2 + j3 * zs**2 - j6 * xs * zs,
         -j6 * ys * zs + j5 * xs**2 + j5 * zs**2 - j3 * ys * xs,
         -j3 * xs * zs + j6 * ys**2 + j6 * xs**2 - j5 * ys * zs],
    ]  # fmt: skip
    assert rate == pytest.approx(np.array(D), rel=1e-10, abs=1e-12)
    K_0 = [
        [j2 * xs**2 + j2 * zs**2 - j3 * ys * zs - j1 * ys * xs,
         -j1 * ys**2 - j1 * zs**2 + j2 * ys * xs + j3 * zs * xs, 0.0],
        [j4 * zs**2 + j4 * xs**2 - j2 * ys * xs - j5 * zs * ys,
         j5 * xs * zs - j2 * ys**2 - j2 * zs**2 + j4 * ys * xs, 0.0],
        [j5 * xs**2 + j5 * zs**2 - j6 * ys * zs - j3 * xs * ys,
         -j3 * zs**2 - j3 * ys**2 + j6 * zs * xs + j5 * xs * ys, 0.0],
    ]  # fmt: skip
    assert position == pytest.approx(np.array(K_0), rel=1e-10, abs=1e-12)
    K_s0 = [
        [2 * j2 * x * xs + j3 * y * zs - j1 * ys * x + j2 * y * ys,
         -2 * j1 * y * ys - j1 * x * xs + j2 * xs * y - j3 * x * zs,
         j3 * y * xs - 2 * j1 * y * zs - j3 * ys * x + 2 * j2 * x * zs],
        [-j2 * ys * x + j4 * y * ys + 2 * j4 * x * xs + j5 * y * zs,
         -j2 * x * xs + j4 * y * xs - j5 * zs * x - 2 * j2 * y * ys,
         2 * j4 * x * zs - j5 * x * ys + j5 * y * xs - 2 * j2 * zs * y],
        [-j3 * x * ys + j5 * y * ys + 2 * j5 * xs * x + j6 * y * zs,
         -j3 * x * xs - j6 * x * zs - 2 * j3 * ys * y + j5 * y * xs,
         -2 * j3 * y * zs + 2 * j5 * x * zs + j6 * (y * xs - x * ys)],
    ]  # fmt: skip
    assert slope == pytest.approx(np.array(K_s0), rel=1e-10, abs=1e-12)
    as_printed = 2 * j3 * y * zs + 2 * j5 * x * zs - 2 * j6 * ys * x + j6 * x * ys
    assert abs(as_printed - slope[2, 2]) > 0.1 * abs(slope[2, 2])
