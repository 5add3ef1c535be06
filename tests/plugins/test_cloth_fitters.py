"""Forces and thickness found again from silhouettes."""

from dataclasses import replace

import numpy as np
import pytest
from drape_bodies import skirted
from mocapflow_draping import samples
from mocapflow_draping.kinematic import Kinematic
from mocapflow_draping.sampled_forces import SampledForces
from mocapflow_draping.take_up import TakeUp, lowest
from mocapflow_garments.cylinder import Cylinder
from mocapflow_twist.gauss_newton import GaussNewton, Task
from mocapflow_twist.normal_equations import Equations

from mocapflow.data import REMEMBERED, Estimate, Frame, Moment, Past, Pose, Segmentation, Silhouette, Turn
from mocapflow.geometry.misfit import bilinear, misfit, unclipped
from mocapflow.geometry.outfits import together
from mocapflow.geometry.sewing import THICKNESS, with_take_up
from mocapflow.geometry.silhouettes import model_distance
from mocapflow.model import ClothedModel
from mocapflow.testing.views import SIZE, tiny_camera

STEP = np.radians(10.0)  # between the amounts that are tried first
TURN = Turn(index=0)
STANDING = Pose(root=np.eye(4), angles=np.zeros(4))


@pytest.fixture(scope="module")
def model():
    """A skirt on legs of capsules before four cameras."""
    cameras = tuple(tiny_camera(index, 2 * np.pi * (index + 0.3) / 4) for index in range(4))
    return ClothedModel(scene=replace(skirted(), cameras=cameras), draper=Kinematic(sweeps=0))


def parameters(model, **values):
    return np.array([values.get(name, 0.0) for name in model.scene.garment.parameter_names])


def seen(model, truth):
    """Return the silhouettes of the person whose garment hangs by the true parameters."""
    surface = model.surface(STANDING, model.drape(STANDING, truth, Past()))
    found = [
        Silhouette(camera=index, layer="person", distance=model_distance(surface, camera, 12.0))
        for index, camera in enumerate(model.scene.cameras)
    ]
    return Segmentation(silhouettes=tuple(found))


def fitted(fitter, model, truth, start, past=None, time=0.0, turn=TURN):
    blank = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    frame = Frame(index=0, time=time, images=(blank,) * 4, usable=np.ones(4, bool))
    estimate = Estimate(pose=STANDING, parameters=start, covariance=np.eye(10 + len(start)), observed=np.ones(4))
    return fitter.fit(frame, seen(model, truth), estimate, model, past or Past(), turn)


def later(model):
    """Return what a frame after the first ones knows."""
    calm = model.drape(STANDING, parameters(model), Past())
    return Past(moments=tuple(Moment(time=index / 30, pose=STANDING, cloth=calm) for index in range(REMEMBERED)))


@pytest.fixture(params=[SampledForces(), GaussNewton()], ids=lambda fitter: fitter.name)
def fitter(request):
    return request.param


@pytest.mark.long
@pytest.mark.parametrize("azimuth_deg", [10.0, 155.0, 280.0])
def test_a_known_wind_is_recovered_within_one_sampling_step(fitter, model, azimuth_deg):
    """T-SYS2."""
    azimuth = np.radians(azimuth_deg)
    truth = parameters(model, wind_cos_rad=0.3 * np.cos(azimuth), wind_sin_rad=0.3 * np.sin(azimuth))
    found = fitted(fitter, model, truth, parameters(model)).parameters
    cos, sin = (found[model.scene.garment.parameter_names.index(f"wind_{part}_rad")] for part in ("cos", "sin"))
    turned = np.degrees(np.abs(np.angle(np.exp(1j * (np.arctan2(sin, cos) - azimuth)))))
    assert turned < 360 / 8 / 2
    assert abs(np.hypot(cos, sin) - 0.3) < STEP


def test_a_garment_without_parameters_stays_as_it_is_draped(fitter, model):
    plain = replace(model.scene.garment, parameter_names=(), parameter_bounds=np.empty((0, 2)))
    model = ClothedModel(scene=replace(model.scene, garment=plain), draper=model.draper)
    draped = model.drape(STANDING, np.empty(0), Past()).vertices
    assert np.array_equal(fitted(fitter, model, np.empty(0), np.empty(0)).vertices, draped)


def test_forces_are_held_about_none_as_firmly_as_asked(model):
    """A wind of 17 degrees: held to 6 degrees it is found to two thirds, to 2 to less than half, to 0.3 not at all."""
    truth, forces = parameters(model, wind_cos_rad=0.3), sum(samples.forces(model.scene.garment), [])
    loose, firm, fast = (
        np.degrees(np.linalg.norm(fitted(fitter, model, truth, parameters(model)).parameters[forces]))
        for fitter in (SampledForces(force_sd_deg=deviation) for deviation in (6.0, 2.0, 0.3))
    )
    assert 10 < loose < 17 and 4 < firm < 0.7 * loose and fast < 1


def test_thickness_is_measured_in_the_first_frame_and_kept(model):
    """T-CL7."""
    truth, nothing = parameters(model, thickness_m=0.006), parameters(model)
    thickness = model.scene.garment.parameter_names.index("thickness_m")
    assert abs(fitted(SampledForces(), model, truth, nothing).parameters[thickness] - 0.006) <= 0.002
    assert fitted(SampledForces(), model, truth, nothing, later(model)).parameters[thickness] == 0
    calm = model.drape(STANDING, nothing, Past())
    second, third = (
        fitted(SampledForces(), model, truth, nothing, lived(model, calm, *times)) for times in ([0.0], [0.0, 0.1])
    )
    assert second.parameters[thickness] > 0.004 and third.parameters[thickness] == 0


def test_no_other_forces_are_tried_than_asked_for(model):
    fitter = SampledForces(directions=2, amounts_deg=(12.0,), rounds=0, force_sd_deg=90.0)
    truth = parameters(model, wind_cos_rad=0.2, wind_sin_rad=0.2)
    found = np.degrees(fitted(fitter, model, truth, parameters(model)).parameters[1:6])
    assert found[model.scene.garment.parameter_names.index("wind_cos_rad") - 1] == pytest.approx(12)
    assert all(np.isclose(found, 0) | np.isclose(np.abs(found), 12))


def test_a_search_that_was_led_astray_comes_back_to_calm_cloth(model):
    start = parameters(model, flare_rad=0.4, wind_cos_rad=0.5)
    assert not fitted(SampledForces(), model, parameters(model), start, later(model)).parameters.any()


def test_forces_that_were_estimated_are_held_about_none_too(model):
    start = parameters(model, wind_cos_rad=0.3)
    column = model.scene.garment.parameter_names.index("wind_cos_rad")
    assert fitted(SampledForces(force_sd_deg=2.0), model, start, start, later(model)).parameters[column] < 0.25


def test_the_take_up_fitter_measures_the_thickness_in_the_first_frames_but_the_very_first(model):
    """T-CL7: the mean of both, and kept from then on."""
    column, past = model.scene.garment.parameter_names.index("thickness_m"), Past()
    found, thick = parameters(model), []
    for index, truth in enumerate([0.006, 0.008, 0.004, 0.0]):
        cloth = fitted(TakeUp(), model, parameters(model, thickness_m=truth), found, past, index / 30)
        past, found = past.after(Moment(time=index / 30, pose=STANDING, cloth=cloth), {}), cloth.parameters
        thick.append(found[column])
    assert thick[0] == 0
    assert abs(thick[1] - 0.008) < 0.001 and abs(thick[2] - 0.006) < 0.001
    assert thick[3] == thick[2]


def test_later_frames_follow_a_force_step_by_step(fitter, model):
    column = model.scene.garment.parameter_names.index("flare_rad")
    found = parameters(model)
    for _ in range(4):
        found = fitted(fitter, model, parameters(model, flare_rad=0.12), found, later(model)).parameters
    assert abs(found[column] - 0.12) < np.radians(2.5)


def test_a_force_that_its_bounds_fix_stays_and_the_others_are_found(model):
    garment = model.scene.garment
    column, fixed = garment.parameter_names.index("flare_rad"), garment.parameter_names.index("wind_cos_rad")
    bounds = garment.parameter_bounds.copy()
    bounds[fixed] = 0.0
    tied = replace(model, scene=replace(model.scene, garment=replace(garment, parameter_bounds=bounds)))
    found = fitted(GaussNewton(), tied, parameters(tied, flare_rad=0.12), parameters(tied)).parameters
    assert found[fixed] == 0
    assert 0.05 < found[column] < 0.12


def lived(model, cloth, *times):
    """Return a past of moments in which the cloth hung as it does."""
    past = Past()
    for time in times:
        past = past.after(Moment(time=time, pose=STANDING, cloth=cloth), {})
    return past


@pytest.mark.parametrize("amount", [0.0, 0.06, 0.12])
def test_the_take_up_is_found_at_once_in_the_second_frame(model, amount):
    column, start = model.scene.garment.parameter_names.index("take_up"), parameters(model, flare_rad=0.3)
    truth = parameters(model, take_up=amount, flare_rad=0.3)
    found = fitted(TakeUp(), model, truth, start, lived(model, model.drape(STANDING, start, Past()), 0.0), 1 / 30)
    assert abs(found.parameters[column] - amount) < 0.01
    np.testing.assert_array_equal(np.delete(found.parameters, column), np.delete(truth, column))


def test_the_take_up_is_followed_in_a_few_steps_where_the_hem_stands_out(model):
    column, found = model.scene.garment.parameter_names.index("take_up"), parameters(model, flare_rad=0.3)
    truth = parameters(model, take_up=0.06, flare_rad=0.3)
    past = lived(model, model.drape(STANDING, found, Past()), -0.2, -0.1)
    for index in range(10):
        cloth = fitted(TakeUp(), model, truth, found, past, index / 10)
        past, found = past.after(Moment(time=index / 10, pose=STANDING, cloth=cloth), {}), cloth.parameters
    assert abs(found[column] - 0.06) < 0.01
    np.testing.assert_array_equal(np.delete(found, column), np.delete(truth, column))


def test_a_hem_that_hardly_shows_moves_little_in_one_step(model):
    column, start = model.scene.garment.parameter_names.index("take_up"), parameters(model)
    past = lived(model, model.drape(STANDING, start, Past()), -0.1, 0.0)
    found = fitted(TakeUp(), model, parameters(model, take_up=0.06), start, past, 0.1)
    assert 0 < found.parameters[column] < 0.01
    longer = fitted(TakeUp(), model, parameters(model, take_up=0.06), start, past, 1.0)
    assert longer.parameters[column] > 5 * found.parameters[column]  # in ten times the time it may change more


def test_a_hem_that_hardly_shows_stays_near_the_frame_before_whatever_is_estimated(model):
    column, truth = model.scene.garment.parameter_names.index("take_up"), parameters(model, take_up=0.06)
    past = lived(model, model.drape(STANDING, truth, Past()), -0.1, 0.0)
    assert fitted(TakeUp(), model, truth, parameters(model), past, 0.1).parameters[column] > 0.02


@pytest.mark.parametrize("highest", [0.0, 0.012])
def test_a_take_up_of_narrow_bounds_is_found_within_them(model, highest):
    garment = model.scene.garment
    column, bounds = garment.parameter_names.index("take_up"), garment.parameter_bounds.copy()
    bounds[column, 1] = highest
    tied = replace(model, scene=replace(model.scene, garment=replace(garment, parameter_bounds=bounds)))
    start, truth = parameters(tied, flare_rad=0.3), parameters(model, take_up=0.06, flare_rad=0.3)
    found = fitted(TakeUp(), tied, truth, start, lived(tied, tied.drape(STANDING, start, Past()), 0.0), 1 / 30)
    assert found.parameters[column] == pytest.approx(highest, abs=0.002)


def test_a_step_is_as_long_whenever_the_frame_before_it_was(model):
    truth, start = parameters(model, take_up=0.06, flare_rad=0.3), parameters(model, flare_rad=0.3)
    cloth = model.drape(STANDING, start, Past())
    pasts = [lived(model, cloth, time - 1 / 30, time) for time in (0.0, 0.1 - 1 / 30)]
    far, near = (fitted(TakeUp(), model, truth, start, past, 0.1).parameters for past in pasts)
    assert np.any(far != start)
    np.testing.assert_array_equal(far, near)


def test_the_take_up_steps_every_tenth_of_a_second(model):
    truth, start = parameters(model, take_up=0.06, flare_rad=0.3), parameters(model, flare_rad=0.3)
    cloth, stepped = model.drape(STANDING, start, Past()), []
    for frame in range(1, 31):
        past = lived(model, cloth, (frame - 2) / 30, (frame - 1) / 30)
        found = fitted(TakeUp(), model, truth, start, past, frame / 30)
        stepped.extend([frame] if np.any(found.parameters != start) else [])
    assert stepped == list(range(3, 31, 3))


@pytest.mark.parametrize("fitter", [SampledForces(), GaussNewton(), TakeUp()], ids=lambda fitter: fitter.name)
def test_a_garment_that_no_view_shows_hangs_as_it_is_estimated(fitter, model):
    start = parameters(model, take_up=0.06, flare_rad=0.3)
    unseen = Estimate(pose=STANDING, parameters=start, covariance=np.eye(10 + len(start)), observed=np.ones(4))
    frame = Frame(index=3, time=0.1, images=(), usable=np.zeros(4, bool))
    kept = fitter.fit(frame, Segmentation(silhouettes=()), unseen, model, later(model), TURN)
    np.testing.assert_array_equal(kept.parameters, start)


def test_nothing_is_taken_up_while_the_person_is_being_found_nor_twice_in_a_frame(model):
    truth, start = parameters(model, take_up=0.06, flare_rad=0.3), parameters(model, flare_rad=0.3)
    np.testing.assert_array_equal(fitted(TakeUp(), model, truth, start).parameters, start)
    past = lived(model, model.drape(STANDING, start, Past()), 0.0)
    again = fitted(TakeUp(), model, truth, start, past, 1 / 30, turn=Turn(index=1))
    np.testing.assert_array_equal(again.parameters, start)


@pytest.fixture(scope="module")
def dressed_twice(model):
    """The same skirt, and a tube on the right leg that shows below its hem."""
    tube = Cylinder(joint="hip_r", start=0.9, upper_circumference_m=0.7, lower_circumference_m=0.9, length_m=0.5)
    tube = tube.sew(model.scene.body)
    names, bounds = with_take_up((tube.parameter_names, tube.parameter_bounds))
    worn = together("both", [model.scene.garment, replace(tube, parameter_names=names, parameter_bounds=bounds)])
    return replace(model, scene=replace(model.scene, garment=worn))


def test_each_garment_is_fitted_by_its_own_parameters(dressed_twice):
    model = dressed_twice
    start = parameters(model, **{"skirt.flare_rad": 0.3})
    truth = start + parameters(model, **{"skirt.take_up": 0.12, "cylinder_hip_r.take_up": 0.06})
    found = fitted(TakeUp(), model, truth, start, lived(model, model.drape(STANDING, start, Past()), 0.0), 1 / 30)
    columns = model.scene.garment.columns("take_up")
    np.testing.assert_allclose(found.parameters[columns], [0.12, 0.06], atol=0.01)
    np.testing.assert_array_equal(np.delete(found.parameters, columns), np.delete(truth, columns))


def test_the_forces_of_each_garment_are_found(fitter, dressed_twice):
    model = dressed_twice
    truth = parameters(model, **{"skirt.flare_rad": 0.12, "cylinder_hip_r.flare_rad": 0.4})
    found = parameters(model)
    for _ in range(4):
        found = fitted(fitter, model, truth, found, later(model)).parameters
    column = model.scene.garment.parameter_names.index
    assert abs(found[column("skirt.flare_rad")] - 0.12) < np.radians(2.5)
    assert found[column("cylinder_hip_r.flare_rad")] > 0.1
    assert not found[model.scene.garment.columns("thickness_m", "take_up")].any()


def test_values_of_a_parabola_tell_where_it_is_lowest():
    places, more = np.array([0.01, 0.02, 0.03]), 0.01 * np.arange(16)
    for where in (0.025, 0.104, 0.15):
        assert lowest(more, (more - where) ** 2) == pytest.approx(where)
    assert lowest(places, (places - 0.025) ** 2) == pytest.approx(0.025)
    assert lowest(places, (places - 0.9) ** 2) == pytest.approx(0.04)  # no farther than two steps
    assert lowest(places, -((places - 0.018) ** 2)) == 0.03


def test_forces_that_gain_nothing_are_left_alone(model):
    truth = parameters(model, flare_rad=0.1)
    np.testing.assert_array_equal(fitted(SampledForces(), model, truth, truth, later(model)).parameters, truth)
    calm = parameters(model)
    most = fitted(SampledForces(least_gain=0.99), model, truth, calm, later(model)).parameters
    assert np.any(fitted(SampledForces(), model, truth, calm, later(model)).parameters) and not np.any(most)


def test_a_garment_without_forces_hangs_as_it_does(fitter, model):
    garment = model.scene.garment
    thick = replace(garment, parameter_names=(THICKNESS,), parameter_bounds=garment.parameter_bounds[:1])
    plain = replace(model, scene=replace(model.scene, garment=thick))
    found = fitted(fitter, plain, np.array([0.004]), np.array([0.004]), later(plain))
    assert found.parameters == pytest.approx([0.004])


def test_the_misfit_grows_with_the_distance_between_outlines(model):
    segmentation = seen(model, parameters(model))
    errors = []
    for flare in (0.0, 0.05, 0.1, 0.2):
        surface = model.surface(STANDING, model.drape(STANDING, parameters(model, flare_rad=flare), Past()))
        errors.append(misfit(surface, segmentation, model.scene.cameras, 4.0))
    assert (np.diff(errors, axis=0) > 0).all()
    assert errors[0].sum() < 0.1 * errors[1].sum()  # a view that sees strands along a thigh tells little


def test_views_without_a_silhouette_have_no_misfit(model):
    surface = model.surface(STANDING, model.drape(STANDING, parameters(model), Past()))
    two = Segmentation(silhouettes=seen(model, parameters(model, flare_rad=0.1)).silhouettes[1:3])
    error = misfit(surface, two, model.scene.cameras, 4.0)
    assert error[[0, 3]].tolist() == [0, 0] and (error[1:3] > 0).all()


def test_a_field_is_linear_between_its_pixels_and_ends_at_the_edge():
    y, x = np.mgrid[:4, :6]
    inner, outer = np.array([[1.25, 2.5], [4.9, 0.1]]), np.array([[9.0, 1.5], [-3.0, 2.0], [2.0, 7.0], [4.0, -1.0]])
    np.testing.assert_allclose(bilinear(2.0 * x + 3.0 * y, inner), inner @ [2.0, 3.0])
    np.testing.assert_allclose(bilinear(2.0 * x + 3.0 * y, outer), outer.clip(0, [5, 3]) @ [2.0, 3.0], atol=0.01)


def test_far_errors_count_by_their_distance_and_near_ones_by_their_square(model):
    segmentation = seen(model, parameters(model))
    surface = model.surface(STANDING, model.drape(STANDING, parameters(model, flare_rad=0.2), Past()))
    cameras = model.scene.cameras
    square = misfit(surface, segmentation, cameras, 4.0)
    np.testing.assert_allclose(misfit(surface, segmentation, cameras, 4.0, np.full(4, 100.0)), square)
    bent = [misfit(surface, segmentation, cameras, 4.0, np.full(4, bend)) for bend in (0.01, 0.02)]
    np.testing.assert_allclose(bent[1], 2 * bent[0], rtol=0.01)


def test_distances_go_on_beyond_their_band(model):
    near = seen(model, parameters(model))
    far = unclipped(near)
    surface = model.surface(STANDING, model.drape(STANDING, parameters(model), Past()))
    for clipped, whole, camera in zip(near.silhouettes, far.silhouettes, model.scene.cameras, strict=True):
        within = np.abs(clipped.distance) < 10
        np.testing.assert_array_equal(whole.distance[within], clipped.distance[within])
        true = model_distance(surface, camera, 40.0)
        np.testing.assert_allclose(np.clip(whole.distance, -40, 40), true, atol=1.5)
    empty = replace(near.silhouettes[0], distance=np.full(near.silhouettes[0].distance.shape, -12, np.float32))
    assert (unclipped(Segmentation(silhouettes=(empty,))).silhouettes[0].distance == -12).all()


def test_samples_cover_every_force(model):
    garment = model.scene.garment
    assert [[garment.parameter_names[c] for c in columns] for columns in samples.forces(garment)] == [
        ["flare_rad"], ["wind_cos_rad", "wind_sin_rad"], ["two_cos_rad", "two_sin_rad"],
    ]  # fmt: skip
    values = samples.in_all_directions(2, 8, np.radians([5.0, 10.0, 20.0]))
    assert values.shape == (25, 2) and not values[0].any()
    ways = np.exp(1j * np.pi / 4 * np.arange(8))  # every 45 degrees, by each amount
    expected = np.radians([5.0, 10.0, 20.0])[:, None] * ways
    np.testing.assert_allclose(values[1:] @ [1, 1j], expected.ravel(), atol=1e-12)
    assert samples.in_all_directions(1, 8, np.array([0.1, 0.2])).tolist() == [[0.0], [0.1], [0.2], [-0.1], [-0.2]]
    beside = samples.neighbours(garment, parameters(model), [2, 3], 0.1)
    np.testing.assert_array_equal(beside[:, 2:4], 0.1 * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]]))
    assert (np.delete(beside, [2, 3], axis=1) == 0).all()


def task_of(fitter, model, start, truth=None):
    """What Gauss-Newton is asked for at some parameters, if the garment hangs by the true ones."""
    surface = model.surface(STANDING, model.drape(STANDING, start, Past()))
    estimate = Estimate(pose=STANDING, parameters=start, covariance=np.eye(10 + len(start)), observed=np.ones(4))
    segmentation = seen(model, parameters(model) if truth is None else truth)
    return Task(fitter, segmentation, estimate, model, model.scene.garment, Past(), surface)


def test_a_parameter_costs_by_its_way_from_calm_in_deviations_of_its_range(model):
    garment = model.scene.garment
    column, bounds = garment.parameter_names.index("flare_rad"), garment.parameter_bounds.copy()
    bounds[column] = [0.1, 0.5]  # calm is what is nearest to none
    narrow = replace(model, scene=replace(model.scene, garment=replace(garment, parameter_bounds=bounds)))
    start = parameters(narrow, flare_rad=0.3)
    task = task_of(GaussNewton(cloth_sd=0.25, sigma_px=1e6), narrow, start)  # the outline hardly counts
    cloth = narrow.drape(STANDING, start, Past())
    assert task.energy(cloth) == pytest.approx(0.5 * 2**2, abs=1e-6)  # 0.2 off, by 0.25 of 0.4
    equations = task.equations(cloth)
    assert equations.energy == pytest.approx(2, abs=1e-6)
    assert equations.gradient[column] == pytest.approx(2 / 0.1, rel=1e-6)
    assert equations.hessian[column, column] == pytest.approx(1 / 0.1**2, rel=1e-6)


def test_the_outline_costs_by_its_error_and_length_however_densely_it_is_looked_at(model):
    start, truth = parameters(model), parameters(model, flare_rad=0.15)
    cloth = model.drape(STANDING, start, Past())
    cost = {
        (sigma, spacing): task_of(GaussNewton(sigma_px=sigma, spacing_px=spacing), model, start, truth).energy(cloth)
        for sigma, spacing in ((1.0, 4.0), (2.0, 4.0), (1.0, 2.0))
    }
    assert cost[1.0, 4.0] == pytest.approx(4 * cost[2.0, 4.0])
    assert cost[1.0, 2.0] == pytest.approx(cost[1.0, 4.0], rel=0.1)
    apart = task_of(GaussNewton(sigma_px=1.0, correlation_px=30.0), model, start, truth).energy(cloth)
    assert cost[1.0, 4.0] == pytest.approx(2 * apart)


def test_a_force_leaves_the_bound_at_which_it_stands(model):
    garment = model.scene.garment
    column, bounds = garment.parameter_names.index("flare_rad"), garment.parameter_bounds.copy()
    bounds[column] = [0.0, 0.5]
    tied = replace(model, scene=replace(model.scene, garment=replace(garment, parameter_bounds=bounds)))
    task, cloth = task_of(GaussNewton(), tied, parameters(tied)), tied.drape(STANDING, parameters(tied), Past())
    for slope, step in ((-0.1, 0.1), (0.1, 0.0)):  # inwards is downhill, or outwards
        equations = Equations(np.eye(len(bounds)), slope * np.eye(len(bounds))[column], 0.0)
        assert task.moved(cloth, equations, 0.0).parameters[column] == pytest.approx(step)


def test_the_slope_that_gauss_newton_follows_is_the_energys(model):
    truth, start = parameters(model, flare_rad=0.1, wind_cos_rad=0.1), parameters(model, thickness_m=0.005)
    task, cloth = task_of(GaussNewton(spacing_px=1.0), model, start, truth), model.drape(STANDING, start, Past())
    slope = task.equations(cloth).gradient[1:6]  # without thickness and take-up
    steps = np.radians(4.0) * np.eye(len(start))[1:6]
    ends = [[task.energy(model.drape(STANDING, start + k * step, Past())) for step in steps] for k in (-1, 1)]
    risen = np.diff(ends, axis=0)[0]  # a drape jumps where contacts change: the direction is what counts
    assert slope @ risen / np.linalg.norm(slope) / np.linalg.norm(risen) > 0.9
