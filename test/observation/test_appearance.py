"""What counts as body and what as scene, on pictures made for the question."""

import numpy as np
import pytest

from tracker_node.observation.appearance import ColorModel, SceneModel, body_log_odds

HEIGHT, WIDTH, WHOLE = 60, 80, (0, 0, 80, 60)
SHIRT, WALL = (40, 60, 200), (150, 160, 140)
BODY = (slice(20, 50), slice(30, 50))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(6)


def picture(rng, color=SHIRT, brightness=1.0, noise=3.0) -> np.ndarray:
    """A wall, a little uneven, with a body before it (``color`` None: without)."""
    image = np.empty((HEIGHT, WIDTH, 3))
    image[:] = np.array(WALL) * (0.8 + 0.4 * np.arange(WIDTH)[None, :, None] / WIDTH) * brightness
    if color is not None:
        image[BODY] = color
    return np.clip(image + rng.normal(0.0, noise, image.shape), 0, 255).astype(np.uint8)


def labels(part: int = 1) -> np.ndarray:
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[BODY] = part
    return mask


def learnt(image: np.ndarray, body: np.ndarray | None = None) -> ColorModel:
    colors, body = ColorModel(), labels() if body is None else body
    colors.learn(image, body, body == 0, 1.0)
    return colors


def shares(odds: np.ndarray) -> tuple[float, float]:
    """Of the body that is taken for body, and of the surroundings that are."""
    inside = labels() > 0
    return float((odds[inside] > 0).mean()), float((odds[~inside] > 0).mean())


def test_a_plate_and_the_colors_tell_the_body(rng):
    scene = SceneModel.from_images([picture(rng, None) for _ in range(5)])
    image = picture(rng)
    seen, wrong = shares(body_log_odds(image, WHOLE, scene, learnt(image)))
    assert seen > 0.99 and wrong < 0.005


def test_colors_alone_tell_it_where_no_empty_scene_is_known(rng):
    image = picture(rng)
    for scene in (None, SceneModel(HEIGHT, WIDTH)):
        seen, wrong = shares(body_log_odds(image, WHOLE, scene, learnt(image)))
        assert seen > 0.99 and wrong < 0.02


def test_a_shadow_is_scene_as_far_as_shadows_may_be_dark(rng):
    scene, colors = SceneModel.from_images([picture(rng, None)]), learnt(picture(rng))
    dark = picture(rng, None, brightness=0.6, noise=1.5)
    assert (body_log_odds(dark, WHOLE, scene, colors, shadow=0.4) > 0).mean() < 0.01
    known_body = learnt(np.where(labels()[..., None] > 0, dark, picture(rng)))
    strict = body_log_odds(dark, WHOLE, scene, known_body, shadow=0.9)
    tolerant = body_log_odds(dark, WHOLE, scene, known_body, shadow=0.4)
    assert (tolerant > 0).mean() < (strict > 0).mean()


def test_a_body_in_the_color_of_a_shadow_is_not_lost_once_it_is_learnt(rng):
    """Dark gray trousers before a gray wall: shadow by the plate, body by its narrow color."""
    trousers = tuple(0.55 * np.array(WALL))
    scene = SceneModel.from_images([picture(rng, None)])
    image = picture(rng, trousers, noise=1.5)
    seen, wrong = shares(body_log_odds(image, WHOLE, scene, learnt(image), shadow=0.4))
    assert seen > 0.9 and wrong < 0.01
    unknown, _ = shares(body_log_odds(image, WHOLE, scene, learnt(picture(rng)), shadow=0.4))
    assert unknown < 0.1


def test_a_small_part_in_a_color_of_its_own_counts_as_much_as_the_trunk(rng):
    image = picture(rng)
    image[22:26, 32:38] = (30, 200, 220)
    parts = labels()
    parts[22:26, 32:38] = 2
    odds = body_log_odds(image, WHOLE, None, learnt(image, parts))
    assert odds[22:26, 32:38].min() > 0
    together = body_log_odds(image, WHOLE, None, learnt(image, labels()))
    assert odds[22:26, 32:38].mean() > together[22:26, 32:38].mean()


def test_too_few_pixels_teach_nothing(rng):
    image, few = picture(rng), np.zeros((HEIGHT, WIDTH), np.uint8)
    few[30, 35:45] = 1
    colors = ColorModel()
    before = colors.log_body.copy()
    colors.learn(image, few, np.zeros((HEIGHT, WIDTH), bool), 1.0)
    np.testing.assert_array_equal(colors.log_body, before)
    assert (body_log_odds(image, WHOLE, None, colors) == 0).all()  # even odds, rather than all scene


def test_colors_follow_a_changing_light_at_the_given_rate(rng):
    colors = learnt(picture(rng))
    brighter = tuple(1.25 * np.array(SHIRT))
    first = shares(body_log_odds(picture(rng, brighter), WHOLE, None, colors))[0]
    for _ in range(30):
        image = picture(rng, brighter)
        colors.learn(image, labels(), labels() == 0, 0.1)
    after = shares(body_log_odds(picture(rng, brighter), WHOLE, None, colors))[0]
    assert after > 0.98 >= first


def test_a_ghost_of_the_plate_is_replaced_by_the_first_image(rng):
    """The still of the empty scene shows a person who has gone since, beside the body."""
    background = picture(rng, None)
    background[10:40, 5:20] = (20, 20, 30)
    scene = SceneModel.from_images([background])
    image = picture(rng)
    colors = learnt(image)
    ghost = (slice(12, 38), slice(7, 18))
    assert (body_log_odds(image, WHOLE, scene, ColorModel())[ghost] > 0).mean() > 0.9  # without colors, all that differs
    scene.learn_first(image, labels())
    assert (body_log_odds(image, WHOLE, scene, colors)[ghost] > 0).mean() < 0.01
    np.testing.assert_array_equal(scene.mean[12:38, 7:18], image[12:38, 7:18])
    untouched = labels() > 0
    np.testing.assert_array_equal(scene.mean[untouched], background[untouched].astype(np.float32))
    assert shares(body_log_odds(image, WHOLE, scene, colors))[0] > 0.99


def test_the_scene_is_learnt_where_the_body_is_not(rng):
    scene = SceneModel(HEIGHT, WIDTH)
    image = picture(rng)
    scene.learn_first(image, labels())
    around = labels() == 0
    np.testing.assert_array_equal(scene.mean[around], image[around].astype(np.float32))
    assert np.abs(scene.mean[BODY] - image[BODY]).min() > 20  # not the shirt
    moved = picture(rng, None)
    for _ in range(3):
        scene.update(moved, np.zeros((40, 35), np.uint8), 0.5, (25, 15, 60, 55))
    assert scene.known.all()
    assert np.abs(scene.mean[BODY] - moved[BODY]).mean() < 4.0


def test_one_plate_has_the_least_variance_and_many_their_own(rng):
    assert (SceneModel.from_images([picture(rng, None)], sigma=5.0).variance == 25.0).all()
    noisy = SceneModel.from_images([picture(rng, None, noise=12.0) for _ in range(40)], sigma=5.0)
    assert np.median(noisy.variance) == pytest.approx(144.0, rel=0.1)
