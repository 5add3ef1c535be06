"""What garments, drapers and bodies have to hold to."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from mocapflow.assets import Body, GarmentMesh
from mocapflow.data import NO_CLOTH, Past, Pose, PoseBatch
from mocapflow.dressing.guards import body_of, drape_of, mesh_of, velocity_of
from mocapflow.dressing.roles import BodyModel, Draper, Garment
from mocapflow.geometry import kinematics
from mocapflow.records import F64
from mocapflow.registry import load_registry
from mocapflow.scene import Scene
from mocapflow.testing import scenes
from mocapflow.testing.bodies import tiny_body
from mocapflow.testing.component import Conformance
from mocapflow.testing.same import assert_pure

REACH = 0.1  # m from a pin to the skin that holds it


class GarmentConformance(Conformance):
    """A garment, sewn on the body of `make_body`."""

    role = "garment"
    garment: Garment

    def make_body(self) -> Body:
        """Return the body it is sewn on."""
        return tiny_body()

    def sewn(self) -> GarmentMesh:
        """Return the garment on the body, looked at as in a run; it is sewn twice, to see that it is pure."""
        return assert_pure(mesh_of, self.garment, self.make_body())  # type: ignore[no-any-return]

    def test_every_vertex_lies_on_one_strand(self) -> None:
        """Strands are what is draped; after a -1 no vertex follows."""
        mesh = self.sewn()
        used = mesh.strands >= 0
        assert (np.diff(used.astype(int), axis=1) <= 0).all(), "a vertex follows after a -1"
        often = np.bincount(mesh.strands[used], minlength=len(mesh.vertices))
        odd = int((often != 1).argmax())
        assert often[odd] == 1, f"vertex {odd} lies on {often[odd]} strands"

    def test_faces_are_not_degenerate(self) -> None:
        """Every face has an area, every vertex belongs to a face, no edge has more than two faces."""
        mesh = self.sewn()
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
        assert (np.linalg.norm(np.cross(b - a, c - a), axis=1) > 2e-10).all(), "a face has no area"
        assert len(np.unique(mesh.faces)) == len(mesh.vertices), "a vertex belongs to no face"
        pairs = np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), axis=1)
        assert np.unique(pairs, axis=0, return_counts=True)[1].max() <= 2, "an edge has more than two faces"

    def test_pins_lie_on_the_body(self) -> None:
        """A pinned vertex is near the skin that holds it, and pinned once."""
        mesh, body = self.sewn(), self.make_body()
        away = np.linalg.norm(mesh.vertices[mesh.pinned] - body.vertices[mesh.pinned_to], axis=1)
        assert len(np.unique(mesh.pinned)) == len(mesh.pinned)
        said = f"a pin is {away.max():.3f} m from vertex {mesh.pinned_to[away.argmax()]}, the skin that holds it"
        assert away.max() < REACH, f"{said}; at most {REACH} m: begin nearer to the body"

    def test_each_parameter_has_a_range(self) -> None:
        """No parameter is fixed."""
        low, high = self.sewn().parameter_bounds.T
        assert (low < high).all()

    def test_installed_drapers_lay_it(self) -> None:
        """Every draper of the installed plugins, with its default settings, lays it on the body near rest."""
        scene = Scene(cameras=(), body=self.make_body(), garment=self.sewn())
        for draper in _installed():
            drape_of(draper, *_batch(scene), Past(), scene)


class DraperConformance(Conformance):
    """A draper, on a tube of cloth hung on the tiny body."""

    role = "draper"
    draper: Draper

    def make_scene(self) -> Scene:
        """Return a clothed scene."""
        return scenes.tiny_scene(clothed=True)

    def test_it_drapes_a_batch(self) -> None:
        """B poses give (B, W, 3) finite vertices, the same as one by one, and nothing is changed."""
        scene = self.make_scene()
        poses, parameters = _batch(scene)
        draped = assert_pure(drape_of, self.draper, poses, parameters, Past(), scene)
        for row in range(3):
            one = PoseBatch(root=poses.root[row : row + 1].copy(), angles=poses.angles[row : row + 1].copy())
            alone = self.draper.drape(one, parameters[row : row + 1], Past(), scene)
            np.testing.assert_allclose(alone[0], draped[row], atol=1e-9)

    def test_cloth_goes_where_the_person_goes(self) -> None:
        """Shifting the person shifts the cloth."""
        scene = self.make_scene()
        poses, parameters = _batch(scene)
        shift = np.array([0.31, -0.17, 0.05])
        root = poses.root.copy()
        root[:, :3, 3] += shift
        here = self.draper.drape(poses, parameters, Past(), scene)
        there = self.draper.drape(PoseBatch(root=root, angles=poses.angles), parameters, Past(), scene)
        np.testing.assert_allclose(there, here + shift, atol=1e-6)

    def test_velocities(self) -> None:
        """Velocities are (M, 3, 6 + D + Q); a shift of the root moves every vertex along."""
        scene = self.make_scene()
        pose = scenes.tiny_pose(scene, 1)
        assert scene.garment is not None
        vertices = np.arange(0, len(scene.garment.vertices), 7, dtype=np.int32)
        parameters = scene.garment.parameter_bounds.mean(axis=1)
        velocity = assert_pure(velocity_of, self.draper, pose, parameters, vertices, Past(), scene)
        np.testing.assert_allclose(velocity[:, :, 3:6], np.broadcast_to(np.eye(3), (len(vertices), 3, 3)), atol=1e-4)


class BodyConformance(Conformance):
    """A body; `recording` is the folder it is loaded for."""

    role = "body"
    body: BodyModel
    recording: Path

    def test_the_chain_is_in_order(self) -> None:
        """The root comes first, screws are unit twists, rest lies within the limits."""
        body = body_of(self.body, self.recording)
        assert body.parents[0] == -1
        np.testing.assert_allclose(np.linalg.norm(body.twists[:, :3], axis=1), 1, atol=1e-9)
        pitch = (body.twists[:, :3] * body.twists[:, 3:]).sum(axis=1)
        np.testing.assert_allclose(pitch, 0, atol=1e-9)
        assert (body.limits[:, 0] < body.limits[:, 1]).all()
        assert len(body.screw_names) == len(set(body.screw_names)) == len(body.twists)

    def test_the_skin(self) -> None:
        """Weights sum to one, and at rest the posed skin is the mesh."""
        body = body_of(self.body, self.recording)
        np.testing.assert_allclose(body.skin_weight.sum(axis=1), 1, atol=1e-9)
        assert (body.skin_weight >= 0).all()
        rest = Pose(root=np.eye(4), angles=np.zeros(len(body.twists)))
        joints, _ = kinematics.chain(body, rest)
        posed = Scene(cameras=(), body=body).surface(rest, NO_CLOTH).vertices
        np.testing.assert_allclose(posed, body.vertices, atol=1e-9)
        np.testing.assert_allclose(joints, np.broadcast_to(np.eye(4), joints.shape), atol=1e-12)

    def test_it_names_the_files_it_reads(self) -> None:
        """The files exist: their content is part of the cache key."""
        for path in self.body.inputs(self.recording):
            assert path.exists()


def _installed() -> Iterator[Draper]:
    """Yield the drapers of all plugins, but for those that have no defaults or lack a library that they need."""
    for classes in load_registry().provided("draper").values():
        for cls in classes:
            try:
                draper = cls()
            except ValidationError:
                continue
            assert isinstance(draper, Draper)
            yield draper


def _batch(scene: Scene) -> tuple[PoseBatch, F64]:
    poses = [scenes.tiny_pose(scene, seed) for seed in range(3)]
    batch = PoseBatch(root=np.stack([p.root for p in poses]), angles=np.stack([p.angles for p in poses]))
    assert scene.garment is not None
    low, high = scene.garment.parameter_bounds.T
    share = np.random.default_rng(0).uniform(0.2, 0.8, (3, len(low)))
    return batch, low + share * (high - low)
