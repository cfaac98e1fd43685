"""wive.torch.intersect: gradients of distances and points to rays and vertices, on every backend."""

import numpy as np
import pytest
from support.meshes import sphere

import wive

torch = pytest.importorskip("torch")
intersect = pytest.importorskip("wive.torch").intersect

COUNT = 12


def scene_of(backend: str, precision: str = "float64") -> wive.Scene:
    vertices, faces = sphere(1)
    return wive.Scene(vertices.astype(precision), faces, backend=backend)


def rays_inside(count: int = COUNT, precision: str = "float64") -> list[torch.Tensor]:
    """Rays from inside a closed sphere: all hit, none near an edge."""
    random = np.random.default_rng(3)
    directions = random.standard_normal((count, 3))
    origins = 0.2 * random.standard_normal((count, 3))
    return [torch.tensor(rows.astype(precision), requires_grad=True) for rows in (origins, directions)]


def test_gradients_pass_gradcheck(backend: str) -> None:
    scene = scene_of(backend)
    vertices = torch.tensor(scene.vertices, requires_grad=True)

    def outputs(origins, directions, vertices):
        t, points, hits = intersect(scene, origins, directions, vertices=vertices)
        assert hits.mask.all()
        return t, points

    assert torch.autograd.gradcheck(outputs, (*rays_inside(), vertices))
    assert torch.autograd.gradgradcheck(outputs, (*rays_inside(4), vertices))


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_distances_and_points_are_those_of_the_scene(backend: str, precision: str) -> None:
    scene = scene_of(backend, precision)
    rays = rays_inside(200, precision)
    for vertices in (None, torch.tensor(scene.vertices)):
        t, points, hits = intersect(scene, *rays, vertices=vertices)
        assert t.dtype == points.dtype == getattr(torch, precision)
        tolerance = 1e-5 if precision == "float32" else 1e-13
        torch.testing.assert_close(t.detach(), hits.t, rtol=tolerance, atol=0, equal_nan=True)
        torch.testing.assert_close(
            points.detach().double(), hits.points(), rtol=0, atol=10 * tolerance, equal_nan=True
        )
        assert hits.prim.tolist() == scene.intersect(*(ray.detach() for ray in rays)).prim.tolist()
        assert t.requires_grad and points.requires_grad


def test_misses_get_no_gradient_whatever_their_numbers(backend: str) -> None:
    scene = scene_of(backend)
    origins, directions = rays_inside()
    with torch.no_grad():
        origins[0], origins[1] = np.nan, np.inf
        directions[2], directions[3] = 0, np.nan
        origins[4] = 5
        directions[4] = 5
    vertices = torch.tensor(scene.vertices, requires_grad=True)
    t, points, hits = intersect(scene, origins, directions, vertices=vertices)
    assert hits.mask.tolist() == [False] * 5 + [True] * (COUNT - 5)
    assert torch.isinf(t[:5]).all() and torch.isnan(points[:5]).all()
    (t[hits.mask].sum() + points[hits.mask].square().sum()).backward()
    for tensor in (origins, directions, vertices):
        assert torch.isfinite(tensor.grad).all() and tensor.grad.any()
    assert not origins.grad[:5].any() and not directions.grad[:5].any()


def test_rays_keep_their_shape_and_may_share_an_origin(backend: str) -> None:
    scene = scene_of(backend)
    origin = torch.zeros(3, dtype=torch.float64, requires_grad=True)
    directions = rays_inside()[1].detach().reshape(3, 4, 3)
    t, points, _ = intersect(scene, origin, directions, tmax=torch.full((3, 4), 9.0).double())
    assert t.shape == (3, 4) and points.shape == (3, 4, 3)
    t.sum().backward()
    assert origin.grad.shape == (3,) and origin.grad.any()


def test_a_scene_of_no_triangles_is_missed(backend: str) -> None:
    scene = wive.Scene(np.zeros((1, 3)), np.zeros((0, 3), np.int32), backend=backend)
    t, points, hits = intersect(scene, *rays_inside())
    assert torch.isinf(t).all() and torch.isnan(points).all() and not hits.mask.any()


@pytest.mark.parametrize(
    ("vertices", "error", "message"),
    [
        (torch.zeros(4, 3), ValueError, r"vertices must have shape \(\d+, 3\), as the scene's, got \(4, 3\)"),
        (lambda v: v.long(), TypeError, "vertices must be of a floating-point dtype, got torch.int64"),
        (lambda v: v.to("meta"), ValueError, "vertices must be on the device of the rays, cpu, got meta"),
    ],
)
def test_vertices_that_do_not_fit_are_refused(vertices, error, message) -> None:
    scene = scene_of("scalar")
    given = vertices(torch.tensor(scene.vertices)) if callable(vertices) else vertices
    with pytest.raises(error, match=message):
        intersect(scene, *rays_inside(), vertices=given)


def test_a_scene_is_fitted_to_measured_distances() -> None:
    """Gradient descent on the vertices brings a sphere to the size that was measured."""
    vertices, faces = sphere(1)
    origins = torch.zeros(3, dtype=torch.float64)
    directions = rays_inside(300)[1].detach()
    directions /= directions.norm(dim=1, keepdim=True)
    measured = intersect(wive.Scene(1.5 * vertices.astype(float), faces), origins, directions).t
    guess = torch.tensor(vertices.astype(float), requires_grad=True)
    scene = wive.Scene(guess.detach().numpy(), faces)
    losses = []
    for _ in range(60):
        t = intersect(scene, origins, directions, vertices=guess).t
        loss = (t - measured).square().mean()
        losses.append(loss.item())
        loss.backward()
        with torch.no_grad():
            guess -= 5 * guess.grad
            guess.grad.zero_()
        scene.refit(guess.detach().numpy().copy())
    assert losses[-1] < losses[0] / 1000


def lossy(scene: wive.Scene) -> list[tuple[str, str, object]]:
    """Calls that lose a gradient: the argument that asks for it, the method, the call."""
    rays = [ray.to(torch.float32) for ray in rays_inside()]
    still = [ray.detach() for ray in rays]
    hits = scene.intersect(*still)
    values = torch.ones(len(scene.vertices), requires_grad=True)
    return [
        ("origins", "intersect", lambda: scene.intersect(*rays)),
        ("directions", "intersect", lambda: scene.intersect(still[0], rays[1], stats=True)),
        ("tmax", "intersect", lambda: scene.intersect(*still, tmax=rays[0][:, 0])),
        ("origins", "intersect_all", lambda: scene.intersect_all(*rays)),
        ("points", "closest", lambda: scene.closest(rays[0])),
        ("points", "signed_distance", lambda: scene.signed_distance(rays[0])),
        ("vertex_values", "interpolate", lambda: hits.interpolate(values)),
        ("vertex_values", "interpolate", lambda: scene.closest(still[0]).interpolate(values)),
    ]  # fmt: skip


@pytest.mark.parametrize("number", range(8))
def test_a_gradient_that_a_query_would_lose_is_a_warning_at_the_callers_line(
    backend: str, number: int
) -> None:
    scene = scene_of(backend, "float32")
    name, method, call = lossy(scene)[number]
    with pytest.warns(
        UserWarning, match=f"^{name} requires gradients, which {method} does not carry: "
    ) as said:
        call()
    assert [warning.filename for warning in said] == [__file__]
    assert ("use wive.torch.intersect" in str(said[0].message)) == (method == "intersect")
    with torch.no_grad():  # an error in these tests, if it warned
        call()


def test_answers_that_have_no_gradient_are_given_without_a_warning(backend: str) -> None:
    scene, rays = scene_of(backend, "float32"), [ray.to(torch.float32) for ray in rays_inside()]
    assert scene.occluded(*rays).all()
    assert (scene.count(*rays) == 1).all()
    assert scene.contains(rays[0]).all()


@pytest.mark.parametrize("name", ["origins", "directions", "vertices"])
def test_arrays_of_another_library_are_refused_by_name(name: str) -> None:
    scene = scene_of("scalar")
    origins, directions = rays_inside()
    given = {"origins": origins, "directions": directions, "vertices": torch.tensor(scene.vertices)}
    given[name] = given[name].detach().numpy()
    with pytest.raises(TypeError) as error:
        intersect(scene, **given)
    assert str(error.value) == f"{name} must be a torch.Tensor, got ndarray: torch.as_tensor makes one"
