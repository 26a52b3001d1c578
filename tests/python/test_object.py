"""Meshes made objects. Oracles: closed forms of volume, inertia and distance; surfaces that this file spoils; the test's own samples; runs of scenes."""
import subprocess
import sys

import numpy as np
import pytest

import handsim as hs

try:
    import trimesh
except ImportError:
    trimesh = None
needs_trimesh = pytest.mark.skipif(trimesh is None, reason="trimesh is not installed (pip install trimesh)")
BOX = [(0, 0, 0), (0, 0, 1), (0, 1, 0), (0, 1, 1), (1, 0, 0), (1, 0, 1), (1, 1, 0), (1, 1, 1)]
SIDES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]


@pytest.fixture(scope="module")
def tools():
    pytest.importorskip("coacd", reason="coacd is not installed (pip install coacd)")
    pytest.importorskip("fast_simplification", reason="fast-simplification is not installed (pip install fast-simplification)")


def box(edges, at=(0, 0, 0)):
    return np.array(BOX, dtype=float) * edges + at, np.array(SIDES)


def torus(large, small, around, across):
    """Points on the surface itself."""
    u, v = 2 * np.pi * np.arange(around) / around, 2 * np.pi * np.arange(across) / across
    ring = large + small * np.cos(v)
    points = np.stack([np.outer(np.cos(u), ring), np.outer(np.sin(u), ring), np.tile(small * np.sin(v), (around, 1))], axis=2).reshape(-1, 3)
    i, k = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b, c, d = (((i + x) % around * across + (k + y) % across).reshape(-1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return points, np.vstack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def lathe(profile, around):
    """A closed surface around z; the profile begins and ends on the axis."""
    found = trimesh.creation.revolve(np.array(profile), sections=around)
    return np.array(found.vertices), np.array(found.faces)


MUG = [(0, 0), (0.04, 0), (0.04, 0.08), (0.036, 0.08), (0.036, 0.005), (0, 0.005)]


def below(points, hulls):
    """Height of each point above the highest plane of each hull: below 0 within it."""
    rows = []
    for vertices, faces in hulls:
        a, b, c = np.moveaxis(vertices[faces], 1, 0)
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        rows.append((points @ normal.T - np.einsum("ij,ij->i", normal, a)).max(axis=1))
    return np.array(rows)


@needs_trimesh
def test_sphere_and_cylinder_have_their_closed_forms():
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.03)
    found = hs.Object(ball.vertices, ball.faces, mass=0.2)
    np.testing.assert_allclose(found.moments, 0.4 * 0.2 * 0.03**2, rtol=1e-3)
    assert len(found.hulls) == 1
    corners, radius, length = 256, 0.02, 0.1
    rod = trimesh.creation.cylinder(radius=radius, height=length, sections=corners)
    found = hs.Object(rod.vertices, rod.faces, density=1000)
    # Of a prism on a regular polygon, exactly.
    area = corners / 2 * radius**2 * np.sin(2 * np.pi / corners)
    polar = radius**2 * (2 + np.cos(2 * np.pi / corners)) / 6
    assert found.mass == pytest.approx(1000 * area * length, rel=1e-9)
    np.testing.assert_allclose(np.sort(found.moments), np.sort([found.mass * polar, *[found.mass * (polar / 2 + length**2 / 12)] * 2]), rtol=1e-6)


def test_an_l_has_its_closed_form_and_its_error_is_that_of_own_samples(tools):
    outline = [(0, 0), (60, 0), (60, 20), (20, 20), (20, 80), (0, 80)]
    points = np.array([(*p, z) for z in (0, 30) for p in outline], dtype=float) / 1000
    base = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)])
    walls = [(i, (i + 1) % 6, 6 + i) for i in range(6)] + [((i + 1) % 6, 6 + (i + 1) % 6, 6 + i) for i in range(6)]
    found = hs.Object(points, np.vstack([base[:, ::-1], base + 6, walls]), mass=0.5, error=0.0005)
    parts = [(0.06 * 0.02, np.array([0.03, 0.01]), (0.06, 0.02)), (0.02 * 0.06, np.array([0.01, 0.05]), (0.02, 0.06))]
    area = sum(part[0] for part in parts)
    centre = sum(part[0] * part[1] for part in parts) / area
    np.testing.assert_allclose(found.centre, [*centre, 0.015], atol=1e-12)
    polar = sum(a * ((x**2 + y**2) / 12 + ((at - centre)**2).sum()) for a, at, (x, y) in parts) / area
    assert found.inertia[2, 2] == pytest.approx(0.5 * polar, rel=1e-9)
    assert found.error <= 0.0005 and 2 <= len(found.hulls) <= 8
    # The notch is empty deeper than the error, and the arms are full.
    grid = np.stack(np.meshgrid(np.linspace(0.0005, 0.0595, 60), np.linspace(0.0005, 0.0795, 80), [0.015], indexing="ij"), axis=-1).reshape(-1, 3)
    depth = below(grid, found.hulls).min(axis=0)
    notch = (grid[:, 0] > 0.0205) & (grid[:, 1] > 0.0205)
    arms = (grid[:, 0] < 0.0195) & (grid[:, 1] > 0.0005) | (grid[:, 1] < 0.0195)
    assert (depth[notch] > 0).all() and (depth[arms] < 0.0005).all()


def test_a_torus_has_its_closed_form_and_the_error_told(tools):
    large, small = 0.04, 0.01
    found = hs.Object(*torus(large, small, 96, 48), mass=0.1, error=0.0015)
    np.testing.assert_allclose(np.sort(found.moments), 0.1 * np.array([large**2 / 2 + 5 / 8 * small**2] * 2 + [large**2 + 3 / 4 * small**2]), rtol=5e-3)
    assert found.error <= 0.0015
    # How far corners of hulls and points on their faces stand off the torus itself.
    rng = np.random.default_rng(7)
    out = []
    for i, (vertices, faces) in enumerate(found.hulls):
        weights = rng.dirichlet([1, 1, 1], (len(faces), 60))
        points = np.einsum("fsk,fkx->fsx", weights, vertices[faces]).reshape(-1, 3)
        others = [each for k, each in enumerate(found.hulls) if k != i]
        points = points[below(points, others).min(axis=0) > 0.3 * 0.0015]
        out.append(np.hypot(np.hypot(points[:, 0], points[:, 1]) - large, points[:, 2]) - small)
    own = np.concatenate(out).max()
    assert own <= found.summary()["added"] + 1e-4
    assert own >= 0.5 * found.summary()["added"]


@needs_trimesh
def test_a_mug_stays_hollow(tools, tmp_path):
    found = hs.Object(*lathe(MUG, 64), mass=0.3, error=0.002)
    assert found.error <= 0.002
    inside = np.array([[x, y, z] for x in (-0.02, 0, 0.02) for y in (-0.02, 0, 0.02) for z in (0.01, 0.04, 0.079)])
    assert (below(inside, found.hulls) > 0.001).all()
    # A ball that is dropped into it comes to lie on the bottom.
    scene = hs.load({"objects": [{"name": "mug", "file": found, "position": [0, 0, 0]},
                                 {"name": "ball", "shape": "sphere", "radius": 0.02, "mass": 0.01, "position": [0, 0, 0.07]}],
                     "ground": {"height": 0}, "duration": 0.6, "solver": {"engine": "articulated", "step": 0.001}})
    row = scene.run(frames=0).trajectory
    assert row["ball.z"][-1] == pytest.approx(0.025, abs=0.003)


def test_a_written_object_has_the_mass_and_inertia_of_the_mesh_on_both_engines(tools, tmp_path):
    found = hs.Object(*torus(0.04, 0.01, 48, 24), mass=0.1, error=0.002, material="wood")
    path = found.write(tmp_path / "ring.yaml")
    for engine in ("ode", "articulated"):
        scene = hs.load({"objects": [{"name": "ring", "file": path, "position": [0, 0, 0.03]}], "ground": {"height": 0}, "duration": 0.5}, engine=engine)
        body = scene._model.bodies[1]
        assert body.mass == pytest.approx(0.1)
        np.testing.assert_allclose(body.inertia, found.inertia, rtol=1e-6, atol=1e-12)
        assert scene.run(frames=0).trajectory["ring.z"][-1] == pytest.approx(0.01, abs=0.0025)
    half = hs.load({"objects": [{"name": "ring", "file": path, "mass": 0.05, "position": [0, 0, 0.03]}], "duration": 0.1})
    np.testing.assert_allclose(half._model.bodies[1].inertia, found.inertia / 2, rtol=1e-6, atol=1e-12)


# Oracle: the mesh itself, scaled before it is read; a box has closed forms.
@needs_trimesh
def test_a_thicker_object_is_that_of_the_scaled_mesh():
    edges = np.array([0.03, 0.1, 0.02])
    points, faces = box(edges, at=(0.01, 0.02, 0.03))
    thin, thick = hs.Object(points, faces, density=900), hs.Object(points, faces, density=900).thicker(1.5)
    wide = edges * [1.5, 1, 1.5]
    other = hs.Object(*box(wide, at=np.array([0.01, 0.02, 0.03]) + (edges - wide) / 2), density=900)
    assert thick.mass == pytest.approx(other.mass) and thick.mass == pytest.approx(900 * wide.prod()) and thin.mass == pytest.approx(900 * edges.prod())
    np.testing.assert_allclose(thick.inertia, other.inertia, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(thick.centre, other.centre, atol=1e-12)
    np.testing.assert_allclose(np.ptp(thick.hulls[0][0], axis=0), wide, atol=1e-12)
    np.testing.assert_allclose(thick.axes @ np.diag(thick.moments) @ thick.axes.T, thick.inertia, atol=1e-12)
    with pytest.raises(hs.Error, match="factor: got 0, need 0.1 to 10"):
        thin.thicker(0)


@needs_trimesh
def test_the_command_writes_an_object_in_several_sizes(tmp_path):
    trimesh.Trimesh(*box((30, 100, 20)), process=False).export(tmp_path / "handle.stl")
    words = [sys.executable, "-m", "handsim", "object", tmp_path / "handle.stl", "--unit", "mm", "--mass", "100g"]
    done = subprocess.run([*words, "--sizes", "0.8", "1.25", "--out", tmp_path / "handle.yaml"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    masses = {name: hs.load({"objects": [{"name": "a", "file": tmp_path / f"{name}.yaml", "position": [0, 0, 1]}], "duration": 0.1})._model.bodies[1].mass
              for name in ("handle", "handle_080", "handle_125")}
    assert masses == pytest.approx({"handle": 0.1, "handle_080": 0.064, "handle_125": 0.15625})
    done = subprocess.run([*words, "--sizes", "0", "thick"], capture_output=True, text=True)
    assert done.returncode == 2 and "--sizes: got 0, need" in done.stderr and "--sizes: got thick, need" in done.stderr and "--sizes: got no --out" in done.stderr


@needs_trimesh
def test_a_grasp_of_a_mesh_holds():
    can = trimesh.creation.cylinder(radius=0.033, height=0.1016, sections=64)
    found = hs.Object(can.vertices, can.faces, mass=0.2, error=0.001)
    result = hs.load("grasp_power_can", {"objects.0.file": found}, engine="articulated").run(frames=0)
    assert result.passed, result.verdicts


@needs_trimesh
@pytest.mark.parametrize("ending", ["stl", "stl_ascii", "obj", "ply", "glb"])
def test_formats_give_the_same_body(ending, tmp_path):
    mesh = trimesh.Trimesh(*box((30, 40, 50)), process=False)
    path = tmp_path / f"box.{ending.partition('_')[0]}"
    mesh.export(path, file_type=ending)
    found = hs.Object(path, unit="mm", mass=0.3)
    assert found.volume == pytest.approx(30e-3 * 40e-3 * 50e-3, rel=1e-6) and found.error < 1e-6


@needs_trimesh
def test_repairs_are_told():
    points, faces = box((0.03, 0.04, 0.05))
    found = hs.Object(points, faces[:, ::-1], mass=0.1)
    assert found.volume > 0 and any("inside out" in note for note in found.notes)
    mixed = faces.copy()
    mixed[3] = mixed[3][::-1]
    assert any("normals of 1 triangles" in note for note in hs.Object(points, mixed, mass=0.1).notes)
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.03)
    holed = hs.Object(ball.vertices, ball.faces[1:], mass=0.1, fill=0.005)
    assert any("was filled (3 edges)" in note and " mm" in note for note in holed.notes)
    chip = box((0.0002, 0.0002, 0.0002), (0.1, 0, 0))
    both = np.vstack([points, chip[0]]), np.vstack([faces, chip[1] + 8])
    assert any("0.2 x 0.2 x 0.2 mm" in note and "dropped" in note for note in hs.Object(*both, mass=0.1, drop=0.001).notes)
    hollow = box((0.01, 0.01, 0.01), (0.01, 0.01, 0.01))
    found = hs.Object(np.vstack([points, hollow[0]]), np.vstack([faces, hollow[1] + 8]), mass=0.1)
    assert found.volume == pytest.approx(0.03 * 0.04 * 0.05 - 1e-6) and any("cavity of 10 x 10 x 10 mm" in note for note in found.notes)


BAD = {
    "open": (lambda p, f: (p, f[2:]), {}, "an open mesh: a hole of 0 x 40 x 50 mm"),
    "huge": (lambda p, f: (p * 5000, f), {}, "a mesh of 250 m in m, need 0.001 to 10 m: --unit mm (0.25 m)"),
    "flat": (lambda p, f: (p * [1, 1, 0], f), {}, "a flat mesh of 30 x 40 x 0 mm"),
    "empty": (lambda p, f: (p, f[:0]), {}, "no face"),
    "two parts": (lambda p, f: (np.vstack([p, p + 0.1]), np.vstack([f, f + 8])), {}, "2 parts that do not touch: 30 x 40 x 50 mm"),
    "crossing": (lambda p, f: (np.vstack([p, p + 0.011]), np.vstack([f, f + 8])), {}, "a surface that crosses itself near ["),
    "nan": (lambda p, f: (np.where(p == 0.05, np.nan, p), f), {}, "not finite"),
    "index": (lambda p, f: (p, f + 5), {}, "no index of a vertex"),
    "no mass": (lambda p, f: (p, f), {"mass": None}, "neither a mass nor a density"),
    "zero mass": (lambda p, f: (p, f), {"mass": 0}, "mass: got 0, need"),
    "material": (lambda p, f: (p, f), {"material": "cheese"}, "material: got cheese, need one of foam"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_meshes_have_their_reason(name):
    change, options, message = BAD[name]
    with pytest.raises(hs.Error) as error:
        hs.Object(*change(*box((0.03, 0.04, 0.05))), **{"mass": 0.1, **options})
    assert error.value.kind == "input" and message in str(error.value) and error.value.problems


def command(*words):
    return subprocess.run([sys.executable, "-m", "handsim", "object", *map(str, words)], capture_output=True, text=True)


@needs_trimesh
def test_the_command_writes_an_object_and_keeps_what_is_the_users(tmp_path):
    mesh = tmp_path / "box.stl"
    trimesh.Trimesh(*box((30, 40, 50)), process=False).export(mesh)
    out = tmp_path / "box.yaml"
    done = command(mesh, "--unit", "mm", "--mass", "200g", "--out", out)
    assert done.returncode == 0, done.stderr
    assert "error" in done.stdout and len(list((tmp_path / "box_hulls").iterdir())) == 1
    assert hs.load({"objects": [{"name": "box", "file": out, "position": [0, 0, 0]}], "duration": 0.1}).masses[1] == pytest.approx(0.2)
    trimesh.Trimesh(*box((30, 40, 60)), process=False).export(mesh)
    assert command(mesh, "--unit", "mm", "--mass", "200g", "--out", out).returncode == 0
    assert len(list((tmp_path / "box_hulls").iterdir())) == 1
    out.write_text("mine")
    done = command(mesh, "--unit", "mm", "--mass", "200g", "--out", out)
    assert done.returncode == 2 and out.read_text() == "mine"
    for words, message in (((mesh, "--mass", "200g"), "unit: got nothing"), ((mesh, "--unit", "mm", "--mass", "200 mm"), "--mass: got 200 mm"),
                           ((mesh, "--unit", "m", "--mass", "1kg"), f"{mesh}: unit: got a mesh of 60 m"),
                           ((tmp_path / "no.stl", "--unit", "mm", "--mass", "1kg"), "no file of this name"),
                           ((out, "--unit", "mm", "--mass", "1kg"), "a name that ends in .yaml")):
        done = command(*words)
        assert done.returncode == 2 and message in done.stderr, done.stderr


@pytest.mark.parametrize("module, source, message", [
    ("trimesh", "'ring.stl', unit='mm'", "trimesh: got no Python module trimesh, need it, for meshes: pip install trimesh, or pip install 'handsim[object]'"),
    ("coacd", "*ring", "coacd: got no Python module coacd, need it, for objects that are not convex: pip install coacd, or pip install 'handsim[object]'"),
])
def test_a_library_that_is_missing_is_named(module, source, message, tmp_path):
    points, faces = torus(0.04, 0.01, 24, 12)
    script = f"""
import sys
sys.modules[{module!r}] = None  # as if it were not installed
import numpy as np
import handsim as hs
ring = np.array({points.tolist()}), np.array({faces.tolist()})
try:
    hs.Object({source}, mass=0.1)
except hs.Error as error:
    print(error.kind, error)
"""
    (tmp_path / "ring.stl").write_text("solid ring\nendsolid ring\n")
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=tmp_path)
    assert done.stdout.strip() == f"input {message}", done.stderr


def test_many_triangles_are_simplified_with_the_error_told(tools):
    found = hs.Object(*torus(0.04, 0.01, 500, 200), mass=0.1, error=0.002)
    assert len(found.faces) == 200_000 and found.error <= 0.002
    assert sum(len(faces) for _, faces in found.hulls) < 10_000


def test_a_full_disk_leaves_nothing(tmp_path):
    """The limit comes after the hull: SciPy's Qhull has a file of its own."""
    script = f"""
import resource, signal, sys
import handsim as hs
found = hs.Object({np.array(BOX).tolist()}, {SIDES}, mass=1)
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), int(sys.argv[1])))
try:
    found.write({str(tmp_path / 'a.yaml')!r})
except hs.Error as error:
    sys.exit(error.kind)
"""
    for limit in (0, 200):  # no file at all; the hull, and not the object file
        done = subprocess.run([sys.executable, "-c", script, str(limit)], capture_output=True, text=True)
        assert done.stderr.strip() == "output" and not list(tmp_path.iterdir()), (limit, done.stderr)
