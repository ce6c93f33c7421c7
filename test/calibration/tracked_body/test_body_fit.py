import numpy as np
import pytest

from helpers.bodies.person_pictures import CONFIG, GROUPS, pictures
from tracker_node.calibration.tracked_body.body_fit import BodyFitOptions, fit_body
from tracker_node.calibration.tracked_body.lines import RegionEvidence, SilhouetteEvidence, joined
from tracker_node.calibration.tracked_body.solver import BodyMotion, Estimate, Problem, SharedPrior, shared_covariance, solve
from tracker_node.errors import TrackerError
from tracker_node.model.shape_parameters import ShapeSpace
from tracker_node.objective.shape_jacobian import N_CAMERA, line_residuals

OPTIONS = BodyFitOptions(groups=GROUPS, rounds=2, pose_rounds=2, config=CONFIG)


@pytest.fixture(scope="module")
def fits():
    """By kind of evidence: a person of known size, found from another one in poses that are somewhat off."""
    world, rng = pictures(), np.random.default_rng(1)
    off = [state.retract(0.01 * rng.normal(size=world.given.n_dof)) for state in world.states]
    silhouettes = SilhouetteEvidence(world.sets, CONFIG, world.backgrounds)
    return {
        name: fit_body(world.given, world.rig, world.sets, off, OPTIONS, evidence=evidence)
        for name, evidence in (("silhouette", silhouettes), ("region", RegionEvidence(world.sets, CONFIG)))
    }


@pytest.mark.parametrize("kind", ("silhouette", "region"))
def test_lengths_and_girths_of_a_person_are_found(fits, kind):
    assert fits[kind].model.clothed and not pictures().given.clothed
    errors = {p.name: abs(p.value - s) for p, s in zip(fits[kind].report.parameters, pictures().s, strict=True)}
    limbs = ("thigh", "shank", "upper_arm", "forearm", "foot")
    assert max(errors[f"length {name}"] for name in limbs) < 0.02
    assert max(errors[f"girth {name}"] for name in (*limbs, "pelvis", "abdomen", "torso", "head")) < 0.03


@pytest.mark.parametrize("kind", ("silhouette", "region"))
def test_a_parameter_is_as_far_off_as_its_sigma_says(fits, kind):
    off = [(p.value - s) / p.sigma for p, s in zip(fits[kind].report.parameters, pictures().s, strict=True)]
    assert np.sqrt(np.mean(np.square(off))) < 2.0
    assert all(p.sigma <= p.prior_sigma for p in fits[kind].report.parameters)


def test_the_report_compares_with_the_given_body_in_fitted_poses(fits):
    report = fits["silhouette"].report
    assert report.overall[1].rms_px < 0.8 * report.overall[0].rms_px
    assert set(report.cameras) == set(pictures().rig.names)
    assert sum(after.count for _, after in report.cameras.values()) == report.overall[1].count


def test_the_arrow_is_solved_as_the_whole_system_would_be():
    """Schur complement and back-substitution against the stacked least-squares problem, by finite differences."""
    world = pictures()
    space = ShapeSpace(world.given, groups=("length",))
    evidence = SilhouetteEvidence(world.sets[:2], CONFIG, world.backgrounds)
    states = [[state] * len(world.rig) for state in world.states[:2]]
    evidence.look(world.given, world.rig, states, 3.0)
    lines = [evidence.lines(k, world.given, world.rig, states[k]) for k in range(2)]
    n_dof, n_shape = world.given.n_dof, len(space)
    motions = [BodyMotion(np.zeros(n_dof), np.zeros(len(world.rig)))] * 2
    prior = SharedPrior(space.sigmas, np.zeros((len(world.rig), N_CAMERA)))
    problem = Problem(space, world.rig, motions, [[], []], prior)
    start = Estimate(world.states[:2], np.zeros(n_shape), np.zeros((len(world.rig), N_CAMERA)))

    def residuals(x):
        model = space.body(x[:n_shape])
        parts = [x[:n_shape] / space.sigmas]
        for k, own in enumerate(lines):
            moved = start.states[k].retract(x[n_shape + k * n_dof : n_shape + (k + 1) * n_dof])
            r = line_residuals(own, model, world.rig, [moved] * len(world.rig))[0]
            # Weights of the robust kernel are those at the start
            parts.append(r * np.sqrt(problem.weights(at_start[k], own.variances, 1e4)[1]))
        return np.concatenate(parts)

    at_start = [line_residuals(own, world.given, world.rig, states[k])[0] for k, own in enumerate(lines)]
    n = n_shape + 2 * n_dof
    J = np.stack([(residuals(1e-6 * e) - residuals(-1e-6 * e)) / 2e-6 for e in np.eye(n)], axis=1)
    covariance = np.linalg.inv(J.T @ J + 1e-6 * np.eye(n))[:n_shape, :n_shape]
    assert np.allclose(shared_covariance(problem, lines, start, 1e4)[0], covariance, rtol=2e-3, atol=1e-9)
    found = solve(problem, lines, start, 1e4, max_iterations=1, damping=1e-9).found
    step = np.linalg.solve(J.T @ J + 1e-6 * np.eye(n), -J.T @ residuals(np.zeros(n)))
    assert np.allclose(found.s, step[:n_shape], atol=1e-3 * np.abs(step[:n_shape]).max())


def test_images_that_do_not_show_the_body_are_refused():
    world = pictures()
    away = world.states[0].retract(np.r_[[0.0, 0.0, 40.0], np.zeros(world.given.n_dof - 3)])
    with pytest.raises(TrackerError, match="hardly seen"):
        evidence = RegionEvidence(world.sets[:1], CONFIG, world.backgrounds)
        fit_body(world.given, world.rig, world.sets[:1], [away], OPTIONS, evidence=evidence)
    with pytest.raises(ValueError, match="a state each"):
        fit_body(world.given, world.rig, world.sets, world.states[:1])


def test_no_lines_of_no_cameras():
    assert len(joined([])) == 0
