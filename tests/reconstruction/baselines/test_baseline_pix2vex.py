"""The smooth renderer's derivatives and limits, and a sphere found again from its pictures."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("trimesh")
pytest.importorskip("cv2")

from reconstruction.baselines.pix2vex import Level, Pix2VexSettings, pix2vex, sphere  # noqa: E402
from reconstruction.baselines.soft_render import Softness, render  # noqa: E402
from reconstruction.stereo.view import View  # noqa: E402
from reconstruction.surface.analytic import mesh_distance  # noqa: E402


def camera(azimuth, focal=90.0, size=64, distance=3.0):
    a = np.radians(azimuth)
    forward, right = np.array([np.sin(a), np.cos(a), 0.0]), np.array([np.cos(a), -np.sin(a), 0.0])
    r = np.stack([right, [0.0, 0.0, -1.0], forward])
    k = np.array([[focal, 0, (size - 1) / 2], [0, focal, (size - 1) / 2], [0, 0, 1.0]])
    return k @ np.column_stack([r, distance * r @ forward])


def disc(view_camera, radius, size=64):
    """Mask of a sphere about the origin: rays nearer to it than its radius."""
    view = View.of("v", np.zeros((size, size, 3), np.float32), view_camera)
    rays = view.grid_rays()
    rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    away = np.linalg.norm(np.cross(np.broadcast_to(-view.centre, rays.shape), rays), axis=-1)
    return away < radius


@pytest.mark.parametrize("closed", [False, True])
def test_derivatives_are_those_of_finite_differences(closed):
    ball = sphere(np.zeros(3), np.array([0.5, 0.4, 0.6]), 0)
    generator = torch.Generator().manual_seed(3)
    x = torch.tensor(ball.vertices) + 0.03 * torch.rand((len(ball.vertices), 3), generator=generator, dtype=torch.float64)
    colours = torch.rand((len(ball.faces), 3), generator=generator, dtype=torch.float64)
    faces, at = torch.tensor(np.array(ball.faces)), torch.tensor(camera(20, focal=9.0, size=8))

    def both(vertices, paint):
        return render(vertices, faces, paint, at, (8, 8), Softness(1.3, 0.2), closed)

    assert torch.autograd.gradcheck(both, (x.requires_grad_(True), colours.requires_grad_(True)), eps=1e-6, atol=1e-6)


def test_a_hard_edge_covers_what_the_sphere_covers():
    ball = sphere(np.zeros(3), np.full(3, 0.6), 3)
    at = camera(0)
    grey = torch.full((len(ball.faces), 3), 0.5)
    args = torch.tensor(ball.vertices, dtype=torch.float32), torch.tensor(np.array(ball.faces)), grey, torch.tensor(at).float()
    truth = disc(at, 0.6).sum()
    hard, soft = (float(render(*args, (64, 64), Softness(edge, 0.02), True)[1].sum()) for edge in (0.01, 1.0))
    assert hard == pytest.approx(truth, rel=0.02)
    assert abs(soft - truth) > abs(hard - truth)


def test_the_nearer_of_two_triangles_is_seen():
    x = torch.tensor([[-1.0, 0, -1], [1, 0, -1], [0, 0, 1], [-1, 0.5, -1], [1, 0.5, -1], [0, 0.5, 1]])
    faces = torch.tensor([[0, 1, 2], [3, 4, 5]])
    paint = torch.tensor([[1.0, 0, 0], [0, 1.0, 0]])
    picture, coverage = render(x, faces, paint, torch.tensor(camera(0)).float(), (64, 64), Softness(0.1, 0.05))
    assert picture[32, 32, 0] > 0.99 and picture[32, 32, 1] < 0.01 and coverage[32, 32] > 0.99
    assert coverage[2, 2] < 0.01


def views(radius=0.6):
    found = []
    for azimuth in range(0, 360, 60):
        at = camera(azimuth)
        found.append(View.of(f"v{azimuth}", np.full((64, 64, 3), 0.5, np.float32), at, disc(at, radius)))
    return found


def test_a_sphere_is_found_again_from_a_smaller_one():
    start = sphere(np.array([0.1, 0.0, 0.05]), np.full(3, 0.4), 2)
    levels = (Level(12, 0.3, 60, 1e-2), Level(24, 0.3, 60, 1e-2), Level(48, 0.3, 60, 5e-3))
    made = pix2vex(views(), start, Pix2VexSettings(levels=levels, seconds=300))
    truth = sphere(np.zeros(3), np.full(3, 0.6), 3).vertices
    assert made.facts["overlap"] > 0.85 and len(made.mesh.faces) == len(start.faces)
    assert mesh_distance(truth, made.mesh).mean() < 0.4 * mesh_distance(truth, start).mean()


def test_it_stops_when_its_time_is_over_and_says_what_it_did():
    made = pix2vex(views(), settings=Pix2VexSettings(seconds=0.5))
    assert made.facts["seconds"] < 10 and 0 < made.facts["steps"] < 360
    assert np.isfinite(mesh_distance(made.mesh.vertices, made.mesh)).all()
