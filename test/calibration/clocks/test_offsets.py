"""Clocks of free-running cameras: signals whose truth is known, pictures of moving spheres, and a real recording."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tracker_node.calibration import balancing
from tracker_node.calibration.clocks.motion import N_PLANES, MotionMeter, MotionProfiles, plane_numbers, small_size
from tracker_node.calibration.clocks.offsets import ClockFit, ClockOptions, Clocks, estimate_clocks
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import CalibrationError
from tracker_node.loaders.images.source import open_camera_source
from tracker_node.loaders.rig.rig_yaml import build_rig
from tracker_node.synthesis.scenes.scene import looking_at

LENS = CameraModel(320, 240, np.array([[300.0, 0.0, 160.0], [0.0, 300.0, 120.0], [0.0, 0.0, 1.0]]))
RATE_HZ = 60.0


def ring(n=3) -> CameraRig:
    angles = 2.0 * np.pi * np.arange(n) / n + 0.2
    centers = [np.array([3.0 * np.cos(a), 3.0 * np.sin(a), 0.7 + 0.6 * (i % 2)]) for i, a in enumerate(angles)]
    return CameraRig(tuple(Camera(f"cam{i}", LENS, looking_at(c, np.array([0.0, 0.0, 1.0]))) for i, c in enumerate(centers)))


def places(t: float) -> np.ndarray:
    """(5, 3) centers of spheres that move without repeating themselves."""
    k = np.arange(5)[:, None]
    phase = np.array([0.3, 1.7, 4.1]) + 1.3 * k
    return [0.0, 0.0, 1.0] + 0.5 * np.sin(2.0 * np.pi * (0.45 + 0.11 * k + [0.0, 0.07, 0.19]) * t + phase)


def picture(camera: Camera, t: float) -> np.ndarray:
    """Spheres of 8 cm as discs with soft edges, before gray."""
    image = np.full((LENS.height, LENS.width, 3), 90, np.uint8)
    pixels, _ = camera.project(places(t))
    for i, (point, pixel) in enumerate(zip(places(t), pixels, strict=True)):
        radius = 300.0 * 0.08 / np.linalg.norm(point - camera.center)
        center = tuple(round(16 * float(v)) for v in pixel)
        cv2.circle(image, center, round(16 * float(radius)), (250 - 40 * i, 30 + 50 * i, 128), -1, cv2.LINE_AA, shift=4)
    return image


def film(camera: Camera, offset_s: float, n=100, rate_hz=RATE_HZ):
    """(stamp, image): what is stamped t shows the time t + offset."""
    for i in range(n):
        yield round(1e9 * i / rate_hz), picture(camera, i / rate_hz + offset_s)


def motions(rig, films):
    names = rig.names
    return [MotionMeter(c.name, [n for n in names if n != c.name], rig).measure(f) for c, f in zip(rig, films, strict=True)]


def test_a_point_lies_in_the_same_plane_for_both_cameras():
    a, b = ring(2)
    size = (LENS.width, LENS.height)
    numbers = [plane_numbers(x, y, size, size).reshape(LENS.height, LENS.width) for x, y in ((a, b), (b, a))]
    points = np.random.default_rng(1).uniform([-0.5, -0.5, 0.6], [0.5, 0.5, 1.4], (200, 3))
    seen = []
    for camera, planes in zip((a, b), numbers, strict=True):
        pixels = np.rint(camera.project(points)[0]).astype(int)
        seen.append(planes[pixels[:, 1], pixels[:, 0]])
    assert np.abs(seen[0] - seen[1]).max() <= 1  # a point between two pixels may fall on either side of a border
    assert np.mean(seen[0] == seen[1]) > 0.7 and len(set(seen[0])) > N_PLANES // 4
    assert small_size(1080, 1920) == (180, 320) and small_size(64, 48) == (64, 48)


@pytest.mark.parametrize("late_s", [0.1234, -0.0071])
def test_an_offset_is_found_below_the_image_period(late_s):
    rig = ring()
    clocks = estimate_clocks(motions(rig, [film(c, late_s if i == 1 else 0.0) for i, c in enumerate(rig)]))
    for i, (name, clock) in enumerate(clocks.cameras.items()):
        assert clock.offset_s == pytest.approx(late_s if i == 1 else 0.0, abs=0.002), name
        assert 0.0 < clock.offset_sigma_s < 0.002 and clock.correlation > 0.7 and clock.runner_up < 0.8
    assert clocks.covariance_s2.shape == (3, 3) and np.all(np.linalg.eigvalsh(clocks.covariance_s2) > -1e-12)


def test_cameras_of_different_rates_and_lost_images():
    rig = ring()
    films = [film(rig.cameras[0], 0.0), film(rig.cameras[1], 0.05, n=50, rate_hz=30.0), list(film(rig.cameras[2], 0.0))]
    del films[2][40:43], films[2][70]
    clocks = estimate_clocks(motions(rig, films))
    assert [c.offset_s for c in clocks.cameras.values()] == pytest.approx([0.0, 0.05, 0.0], abs=0.003)


def noise_profiles(offset_s, drift, seconds=90.0, rate_hz=30.0, seed=3, name=("a", "b", "c"), which=0):
    """Profiles read off band-limited curves: ``profile(time shown)``, plus noise of their own."""
    rng = np.random.default_rng(seed)
    frequencies, phases = rng.uniform(0.1, 4.0, (40, 30)), rng.uniform(0.0, 6.3, (40, 30))
    times = np.arange(0.0, seconds, 1.0 / rate_hz)
    shown = times + offset_s + drift * (times - 0.5 * seconds)
    values = np.sin(2.0 * np.pi * frequencies * shown[:, None, None] + phases).sum(axis=2)
    values = values + 3.0 * np.random.default_rng(seed + 1 + which).standard_normal(values.shape)
    return MotionProfiles(name[which], times, {n: values for n in name if n != name[which]}, times[0], times[-1])


def test_drift_is_found_and_goes_into_the_rig():
    truth = [(0.0, 0.0), (-0.6121, 150e-6), (0.0, 0.0)]
    found = estimate_clocks([noise_profiles(*t, which=i) for i, t in enumerate(truth)])
    for (offset_s, drift), clock in zip(truth, found.cameras.values(), strict=True):
        assert (
            clock.offset_s == pytest.approx(offset_s, abs=max(4.0 * clock.offset_sigma_s, 1e-9)) and clock.offset_sigma_s < 0.001
        )
        assert clock.drift == pytest.approx(drift, abs=4.0 * clock.drift_sigma) and clock.drift_sigma < 30e-6
    offset_s, ppm = found.corrected("b", first_s=0.0, offset_s=0.25, drift_ppm=20.0)
    clock = found.cameras["b"]
    assert ppm == pytest.approx(20.0 + 1e6 * clock.drift, rel=1e-3)
    # at the middle, the new offset and drift of own time add what has been found to the old ones
    own = found.middle_s / (1.0 + 20e-6)
    assert offset_s + 1e-6 * ppm * own == pytest.approx(0.25 + 20e-6 * own + clock.offset_s, abs=1e-7)
    without = estimate_clocks([noise_profiles(t[0], 0.0, which=i) for i, t in enumerate(truth)], ClockOptions(drift=False))
    assert all(c.drift == 0.0 and c.drift_sigma == 0.0 for c in without.cameras.values())


def test_what_one_camera_alone_sees_widens_the_sigma():
    """Of people seen from several sides every camera has motion of its own; noise of images passes, and costs nothing more."""
    def sigma(own):
        films = []
        for which in range(3):
            film = noise_profiles(0.0, 0.0, seconds=8.0, which=which)
            rng = np.random.default_rng(50 + which)
            frequencies, phases = rng.uniform(0.1, 2.0, (40, 5)), rng.uniform(0.0, 6.3, (40, 5))
            alone = own * np.sin(2.0 * np.pi * frequencies * film.times_s[:, None, None] + phases).sum(axis=2)
            films.append(replace(film, profiles={name: values + alone for name, values in film.profiles.items()}))
        return estimate_clocks(films).cameras["b"].offset_sigma_s

    assert sigma(0.0) < 0.003 < 0.006 < sigma(1.5) < 0.05


def test_motion_that_repeats_itself_is_refused_unless_the_clock_is_known_better():
    films = []
    for which in range(3):
        film = noise_profiles(0.0, 0.0, seconds=8.0, which=which)
        steps = np.sin(2.0 * np.pi * film.times_s[:, None] / 0.8 + np.linspace(0.0, 6.0, 40))
        noise = 0.2 * np.random.default_rng(which).standard_normal(steps.shape)
        films.append(replace(film, profiles=dict.fromkeys(film.profiles, steps + noise)))
    with pytest.raises(CalibrationError, match=r"repeats itself.*max-offset"):
        estimate_clocks(films)
    assert estimate_clocks(films, ClockOptions(max_offset_s=0.3)).cameras["b"].offset_s == pytest.approx(0.0, abs=0.003)


def test_errors_are_as_large_as_the_covariance_says():
    """Mean of squared errors over their variance, 24 recordings: 1 where sigmas are right."""
    ratios = []
    for seed in range(24):
        late = 0.2 + 0.013 * seed
        found = estimate_clocks(
            [noise_profiles(late if i == 1 else 0.0, 0.0, seconds=8.0, seed=100 * seed, which=i) for i in range(3)]
        )
        clock = found.cameras["b"]
        ratios.append(((clock.offset_s - late) / clock.offset_sigma_s) ** 2)
    assert 0.3 < np.mean(ratios) < 3.0


def test_what_cannot_be_told_is_refused():
    rig = ring()
    films = [film(rig.cameras[0], 0.0), film(rig.cameras[1], 0.0), film(rig.cameras[2], 233.33)]
    with pytest.raises(CalibrationError, match=r"'cam2': its motion agrees with no other camera's.* a clap \(--by sound\)"):
        estimate_clocks(motions(rig, films))
    with pytest.raises(CalibrationError, match=r"camera 'cam0': has 12 images; at least 20"):
        motions(rig, [film(c, 0.0, n=12) for c in rig])
    still = [(i * 10**7, picture(rig.cameras[0], 0.0)) for i in range(30)]
    with pytest.raises(CalibrationError, match="camera 'cam0': nothing moves in its images"):
        motions(rig, [still, *films[1:]])
    later = replace(noise_profiles(0.0, 0.0, which=1), times_s=noise_profiles(0.0, 0.0, which=1).times_s + 1000.0)
    with pytest.raises(CalibrationError, match="camera 'b'"):
        estimate_clocks([noise_profiles(0.0, 0.0), later, noise_profiles(0.0, 0.0, which=2)])


def test_a_shift_of_real_images(shared_data):
    """The Balancing clip's cameras are triggered together: stamps of one are moved, some of its images are
    lost, and the other's exposure changes in between."""
    folder = shared_data / "pose2sim_balancing"
    whole = build_rig(balancing.rig_file(balancing.named_rig(folder / "Pose2Sim_cameras.toml"), "videos"), folder)
    rig = whole.subset(["cam02", "cam04"])
    films = [list(open_camera_source(c)) for c in rig]
    shifted = [(stamp + 271_300_000, image) for i, (stamp, image) in enumerate(films[1]) if i not in (30, 31, 60)]
    brighter = [(stamp, cv2.add(image, np.full(4, 12.0)) if i > 50 else image) for i, (stamp, image) in enumerate(films[0])]
    first, second = estimate_clocks(motions(rig, [brighter, shifted])).cameras.values()
    assert second.offset_s - first.offset_s == pytest.approx(-0.2713, abs=0.012)


def test_metrics_are_in_milliseconds_and_millionths():
    clocks = Clocks(
        {"left": ClockFit(0.01, 0.002, 3e-5, 1e-6, 0.9, 0.5), "right": ClockFit(-0.01, 0.003, 0.0, 0.0, 0.8, 0.85)},
        5.0, np.array([[4e-6, -2e-6], [-2e-6, 9e-6]]), 1.5,
    )  # fmt: skip
    assert clocks.metrics() == pytest.approx({
        "time.misfit": 1.5, "time.right.covariance_left_ms2": -2.0,
        "time.left.offset_ms": 10.0, "time.left.offset_sigma_ms": 2.0, "time.left.drift_ppm": 30.0,
        "time.left.drift_sigma_ppm": 1.0, "time.left.correlation": 0.9, "time.left.runner_up": 0.5,
        "time.right.offset_ms": -10.0, "time.right.offset_sigma_ms": 3.0, "time.right.drift_ppm": 0.0,
        "time.right.drift_sigma_ppm": 0.0, "time.right.correlation": 0.8, "time.right.runner_up": 0.85,
    })  # fmt: skip
