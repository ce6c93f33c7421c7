"""Every parameter of the tracker, once: default, unit, range and meaning.

The same frozen dataclasses drive the node (parameters are declared from them), the offline run and the tests. What the images are
compared by is chosen with `TrackerConfig.modalities`; parameters of modalities that are not in use are none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

from ..errors import FileFormatError
from .estimate import GRAY_LEVELS, PX
from .parameters import built, named, nested, parameter, value_of
from .renamed import flat, refuse_renamed

REGION, CHAMFER, KEYPOINTS, COLOR, TEXTURE, COLOR_OVER_BACKGROUND = MODALITIES = (
    "region", "chamfer", "keypoints", "color", "texture", "color_over_background",
)  # fmt: skip
CONTOURS, COLORS = (REGION, CHAMFER), (COLOR, TEXTURE, COLOR_OVER_BACKGROUND)
GEOMETRIC = (*CONTOURS, KEYPOINTS)  # residuals in pixels over their standard deviations
# Tags of parameters that belong to no single modality.
ALONE, MIXED, JOINT = "colors alone", "colors with contours", "colors with contours in one problem"
POINTS_BESIDE = "keypoints with region"
FREE_BASE, FIXED_BASE, FLOOR = SWITCHED = "motion.base: free", "motion.base: fixed", "floor.enabled: True"
_DECIDING = ("modalities", "combination", "motion.base", "floor.enabled")  # which parameters there are


@dataclass(frozen=True)
class SynchronizerConfig:
    """How images become image sets."""

    image_period_s: float = parameter(1 / 30, "nominal time between two images of a camera", "s", 1e-4, 60.0)
    tolerance: float = parameter(0.4, "largest spread of stamps in a set, as a fraction of the image period", "1", 0.0, 0.9)
    queue_s: float = parameter(1.0, "how long an image waits for its partners", "s", 0.0, 60.0)
    min_cameras: int = parameter(
        2, "smallest number of cameras in a set, when others are silent or drop an image; 0 means all", "", 0, 64
    )


@dataclass(frozen=True)
class BackgroundConfig:
    """What each pixel shows when the body is not there: given as images, or learned."""

    sigma: float = parameter(4.0, "least standard deviation of a background pixel", "gray levels", 0.5, 100)
    shadow: float = parameter(
        0.4, "darkest shadow, as a fraction of the background's brightness; 1 switches shadows off", "1", 0.1, 1.0
    )
    learning_rate: float = parameter(
        0.05,
        "fraction of the newest image in the background model, where the body is not; 0 keeps given backgrounds as they are",
        "1",
        0,
        1,
    )
    body_margin_px: int = parameter(12, "width around the fitted body that is not learned as background", "px", 1, 200)


@dataclass(frozen=True)
class RegionConfig:
    """Correspondence lines along contour normals, and the colors on either side."""

    samples_per_line: int = parameter(12, "contour samples per generator line", "", 2, 1000)
    half_length: int = parameter(10, "places on either side of the contour where it may be, per scale", "", 2, 20)
    scales: str = parameter(
        "6 2 1",
        "pixels from place to place on the lines, from coarse to fine; less on small bodies. Of three or more the first is tried"
        " only where a limb is in doubt, on bodies with limbs and without points",
        "px", 0.25, 100,
    )  # fmt: skip
    first_scales: str = parameter("6 4 3 2 2 1 1", "the same on the first image set after a start or a reset", "px", 0.25, 100)
    wide_scales: str = parameter(
        "10 10 8 8 6 6 4 4 3 2 1", "then tried as well, and kept where more of the outline is found", "px", 0.25, 100
    )
    repeats: int = parameter(2, "steps more on the finest scale, at most, while the body still moves", "", 0, 100)
    max_log_ratio: float = parameter(2.0, "log-likelihood ratio of a pixel's color is clipped to this", "1", 0.1, 20)
    pixel_independence: float = parameter(1.0, "fraction of a line's pixels that are independent of each other", "1", 0.01, 10)
    model_sigma_px: float = parameter(
        2.0, "how far the body's contour may be from the model's, at first and at most", "px", 0.0, 100
    )
    least_sigma_px: float = parameter(0.2, "the least that it is taken for", "px", 0.0, 100)
    sigma_rate: float = parameter(0.3, "weight of the newest image set in what it is taken for; 0 keeps it", "1", 0.0, 1.0)
    robust_sigmas: float = parameter(3.0, "scale of the robust kernel, in standard deviations of a line", "1", 0.1, 1000)
    correlation: float = parameter(4.0, "how many neighboring lines count as one, beside priors", "lines", 1, 1000)
    color_rate: float = parameter(0.05, "weight of the newest image in the color histograms", "1", 0, 1)
    color_prior: float = parameter(
        0.3, "weight of the model's stated color in a part's, where the images bear it out; 0: learned colors only", "1", 0, 1
    )
    learn_every: int = parameter(4, "image sets between two lessons of a camera; the cameras take turns", "", 1, 1000)
    learn_background: bool = parameter(
        True, "learn what each pixel shows when the body is not there: for cameras that stand still"
    )
    margin_px: int = parameter(4, "width around the fitted body that is not learned as surroundings", "px", 0, 200)
    background_ring_px: int = parameter(40, "surroundings are what lies within this of the body", "px", 4, 1000)
    inlier_px: float = parameter(
        2.5, "a contour found within this bears out a body of up to 450 pixels; a larger one in proportion", "px", 0.1, 1000
    )
    covariance_scale: float = parameter(
        0.21, "times region.correlation: how much of the spread of correspondence lines (its square) is an error of the state",
        "1", 1e-3, 1e3,
    )  # fmt: skip
    line_correlation_px: float = parameter(4.0, "how far along a contour the errors of lines are alike", "px", 0.01, 1000)
    body_shift_px: float = parameter(
        0.05, "by how much all contours are off alike, in all images (light falls from one side)", "px", 0, 100
    )


@dataclass(frozen=True)
class ChamferConfig:
    """Distances of contour samples to silhouettes and edges (Knossow et al.), fitted by Levenberg-Marquardt."""

    silhouette: str = parameter(
        "both", "background: the images of the background alone; both: them (or what shows around the body) and colors",
        choices=("background", "both"),
    )  # fmt: skip
    distances: str = parameter(
        "split",
        "split: outline against the signed silhouette distance, inner contours against edges; sum: the paper's sum of both;"
        " silhouette, edges: one of the two alone, to compare",
        choices=("split", "sum", "silhouette", "edges"),
    )  # fmt: skip
    threshold: float = parameter(0.0, "log-odds above which a pixel is body", "1", -20, 20)
    smoothing_px: int = parameter(
        1, "width of the median filter of the silhouette; 1: none", "px", choices=tuple(range(1, 33, 2))
    )
    color_rate: float = parameter(0.05, "weight of the newest image in the color histograms", "1", 0, 1)
    learn_every: int = parameter(3, "image sets between two lessons of a camera; the cameras take turns", "", 1, 1000)
    reach_px: int = parameter(40, "silhouettes farther than this from the predicted body are not processed", "px", 4, 1000)
    truncation_px: float = parameter(40.0, "distances to the silhouette are truncated here", "px", 2, 1000)
    edge_truncation_px: float = parameter(16.0, "distances to edges are truncated here", "px", 2, 1000)
    boundary_step_px: int = parameter(4, "distance between the points taken from the silhouette's boundary", "px", 1, 100)
    refine_boundary: bool = parameter(True, "find the silhouette's boundary to a fraction of a pixel")
    canny_low: float = parameter(40.0, "lower hysteresis threshold of the edge detector", "gray levels", 0, 1000)
    canny_high: float = parameter(100.0, "upper hysteresis threshold of the edge detector", "gray levels", 0, 1000)
    margin_px: int = parameter(24, "border around the predicted body that is processed", "px", 4, 1000)
    max_iterations: int = parameter(6, "iterations per image set", "", 1, 200)
    first_iterations: int = parameter(30, "iterations on the first image set after a start or a reset", "", 1, 1000)
    tolerance: float = parameter(2e-2, "stop when the cost falls by less than this fraction", "1", 0, 1)
    robust_scale_px: float = parameter(8.0, "scale of the robust kernel", "px", 0.1, 1000)
    fine_robust_scale_px: float = parameter(3.0, "scale of the robust kernel in the fine iterations", "px", 0.1, 1000)
    samples_per_line: int = parameter(25, "contour samples per generator line", "", 2, 1000)
    sliding: bool = parameter(True, "include the sliding of the contour generator in the Jacobian")
    inner_weight: float = parameter(0.5, "weight of contours within the body's outline", "1", 0, 10)
    min_alignment: float = parameter(0.6, "least cosine between an image boundary's normal and the contour's", "1", 0, 1)
    boundary_weight: float = parameter(
        1.0, "weight of the attraction of boundary points to the nearest outline, in the coarse iterations", "1", 0, 10
    )
    boundary_scale_px: float = parameter(30.0, "scale of the robust kernel of that attraction", "px", 0.1, 1000)
    coarse_iterations: int = parameter(3, "how many of max_iterations are coarse (the boundary attracts from afar)", "", 0, 200)
    degraded_residual_px: float = parameter(6.0, "rms residual above which the status is DEGRADED", "px", 0, 1000)
    lost_residual_px: float = parameter(15.0, "rms residual above which the status is LOST", "px", 0, 1000)
    agreement_px: float = parameter(1.5, "outline and silhouette agree where they are closer than this", "px", 0.0, 1000)
    agreement_m: float = parameter(0.03, "and than what this is in pixels, at the body, added to it", "m", 0.0, 10)
    degraded_agreement: float = parameter(
        0.62, "fraction of outline and silhouette that agree in the median camera, below which the status is DEGRADED", "1", 0, 1
    )
    lost_agreement: float = parameter(
        0.4, "the same for LOST; a single camera below it is named, and the status DEGRADED", "1", 0, 1
    )
    residual_sigma_px: float = parameter(
        1.5, "least standard deviation of one contour sample, for the covariance", "px", 0.01, 100
    )
    correlation: float = parameter(8.0, "how many neighboring samples share one error, for the covariance", "samples", 1, 1000)


@dataclass(frozen=True)
class KeypointConfig:
    """Points and silhouettes that a detector finds of people."""

    covariance_scale: float = parameter(1.0, "factor of the covariances that the detector states", "1", 0.0, 1e4)
    sigma_fraction: float = parameter(
        0.006, "least standard deviation of a point, as a fraction of the person's size in the image", "1", 1e-4, 1.0
    )
    outlier_fraction: float = parameter(0.02, "fraction of the surest points that are anywhere at all", "1", 1e-4, 0.5)
    offset_scale: float = parameter(1.0, "factor of the spread of offsets between points and landmarks", "1", 1e-3, 100.0)
    wobble_m: float = parameter(0.02, "how far points move on the body with its pose, as a standard deviation", "m", 0.0, 1.0)
    least_offset_sigma_m: float = parameter(0.005, "least standard deviation of an offset", "m", 1e-5, 1.0)
    correlation_sets: float = parameter(10.0, "how many image sets in a row share one error of a point", "image sets", 1.0, 1e4)
    surface_scale: float = parameter(
        1.0, "factor of the spread of surfaces beside the body's shapes, which contours follow while points hold the joints", "1",
        1e-3, 100.0, of=(POINTS_BESIDE,),
    )  # fmt: skip
    surface_wobble_m: float = parameter(
        0.01, "how far surfaces move on the body with its pose", "m", 1e-4, 1.0, of=(POINTS_BESIDE,)
    )
    depth_weight: float = parameter(
        0.3, "factor of what a detector guesses of depths, with errors that last for some image sets; 0: none", "1", 0.0, 10.0
    )  # fmt: skip
    error_scale: float = parameter(
        2.0, "squared errors of joints over what fits say of them, on rendered people in clothes: covariances are so much larger",
        "1", 0.1, 100.0,
    )  # fmt: skip
    silhouette_weight: float = parameter(
        0.5, "factor of the log odds of the detector's silhouettes, beside contours; 0: they are not used", "1", 0.0, 10.0,
        of=(POINTS_BESIDE,),
    )  # fmt: skip
    silhouette_limit: float = parameter(2.0, "largest log odds of a silhouette's pixel", "1", 0.0, 20.0, of=(POINTS_BESIDE,))


@dataclass(frozen=True)
class MotionConfig:
    """Prediction between image sets, and the priors that go with it.

    The noise is that of a white acceleration, the memory how long a velocity lasts: see `tracking.motion.dynamics`.
    """

    base: str = parameter(
        "free", "fixed: the root does not move, and its place is estimated ever better, as of an arm on a table",
        choices=("free", "fixed"), of=GEOMETRIC,
    )  # fmt: skip
    base_position_sigma_m: float = parameter(
        0.005, "how well the initial state knows where a fixed base is, as a standard deviation", "m", 1e-6, 1e3, of=(FIXED_BASE,)
    )
    base_angle_sigma_deg: float = parameter(0.5, "and how it is turned", "deg", 1e-4, 1e3, of=(FIXED_BASE,))
    joint_state_sigma_deg: float = parameter(
        0.5, "how exactly joints are where the robot's own joint states say, where there are some; 0.01: just there", "deg",
        1e-4, 1e3, of=GEOMETRIC,
    )  # fmt: skip
    joint_state_sigma_m: float = parameter(0.001, "the same of joints that slide", "m", 1e-6, 1e3, of=GEOMETRIC)
    root_position_noise: float = parameter(4.0, "white acceleration of the root", "m/s^1.5", 1e-6, 1e6, of=(FREE_BASE,))
    root_angle_noise: float = parameter(16.0, "white angular acceleration of the root", "rad/s^1.5", 1e-6, 1e6, of=(FREE_BASE,))
    joint_noise: float = parameter(25.0, "white acceleration of joint angles", "rad/s^1.5", 1e-6, 1e6, of=GEOMETRIC)
    root_position_time_constant_s: float = parameter(
        0.5, "how long a velocity of the root lasts", "s", 1e-3, 1e3, of=(FREE_BASE,)
    )
    root_angle_time_constant_s: float = parameter(
        0.3, "how long an angular velocity of the root lasts", "s", 1e-3, 1e3, of=(FREE_BASE,)
    )
    joint_time_constant_s: float = parameter(0.2, "how long a velocity of a joint angle lasts", "s", 1e-3, 1e3, of=GEOMETRIC)
    smoother_noise: float = parameter(
        0.4, "fraction of the noise that motions have; the rest is there so that kicks are not held back, and left out in"
        " smoothing", "1", 1e-3, 1e3, of=GEOMETRIC,
    )  # fmt: skip
    velocity_gain: float = parameter(
        0.8,
        "how fast the velocity follows the measured one, in engines that do not tell how sure they are",
        "1",
        0.0,
        1.0,
        of=(ALONE,),
    )
    velocity_decay: float = parameter(
        0.9, "fraction of a joint velocity kept in the prediction by such engines; of any velocity, by a lost body", "1", 0.0, 1.0
    )
    stay_position: float = parameter(
        0.0, "weight of the prior at the root position given, on the first image set", "px^2/m^2", 0.0, 1e12, of=GEOMETRIC
    )
    stay_angle: float = parameter(
        200.0, "weight of the prior at the angles given, on the first image set", "px^2/rad^2", 0.0, 1e12, of=GEOMETRIC
    )
    neutral_angle: float = parameter(
        1.0, "multiplies the stiffness of the model's axes (prior at their neutral angles)", "px^2", 0.0, 1e12, of=GEOMETRIC
    )


@dataclass(frozen=True)
class CollisionConfig:
    """Parts of the body that may not pass through each other."""

    enabled: bool = parameter(True, "keep parts that are not neighbors from running into each other")
    sigma_m: float = parameter(0.02, "how deep they may get into each other, as a standard deviation", "m", 1e-4, 10.0)


@dataclass(frozen=True)
class FloorConfig:
    """The floor that the body stands on: a level plane of the world, whose z axis points up."""

    enabled: bool = parameter(
        False, "no part is in the floor, and the lowest is on it, unless that is well above it: tells one camera how far away the"
        " body is",
    )  # fmt: skip
    height_m: float = parameter(0.0, "z of the floor in the world", "m", -1e3, 1e3, of=(FLOOR,))
    sigma_m: float = parameter(0.03, "how exactly parts are on it, as a standard deviation", "m", 1e-4, 10.0, of=(FLOOR,))


@dataclass(frozen=True)
class StatusConfig:
    """When a limb is LOST, by the outline that the images show of it."""

    limb_lost: float = parameter(0.5, "a limb that is elsewhere with this probability is LOST", "1", 0, 1)
    limb_degraded: float = parameter(0.2, "and DEGRADED with this one", "1", 0, 1)
    limb_loss: float = parameter(0.01, "probability that a limb gets lost between two image sets", "1", 1e-6, 1)
    limb_recovery: float = parameter(0.1, "and that a lost one gets where it belongs", "1", 0, 1)
    evidence_limit: float = parameter(5.0, "one image set cannot change the log odds of lost by more than this", "1", 0.1, 100)


@dataclass(frozen=True)
class LimbSearchConfig:
    """How a lost limb is searched."""

    poses: int = parameter(400, "poses in which a lost limb is searched, in one image set; 0: it is not", "", 0, 100000)
    fits: int = parameter(5, "and how many of them are fitted", "", 1, 100)
    interval_sets: int = parameter(
        4, "image sets from one search for a limb or a body to the next, once two of them have failed; 1: none left out",
        "", 1, 10**6,
    )  # fmt: skip
    seed: int = parameter(0, "of the random ones", "", 0, 2**31 - 1)


@dataclass(frozen=True)
class InitializationConfig:
    """How a body is detected where no initial state is given, or after it has been lost altogether."""

    min_cameras: int = parameter(
        2, "smallest number of cameras with an image to search a start in; of a smaller rig, all", "", 1, 64
    )
    enabled: bool = parameter(True, "detect the body; without, an initial state is waited for")
    after_lost_sets: int = parameter(
        15, "image sets, LOST or with a limb lost since it was found, after which all images are searched", "", 1, 10**9
    )
    interval_sets: int = parameter(12, "image sets between two searches, as long as nothing is found", "", 0, 100000)
    watch_sets: int = parameter(18, "image sets to watch what moves in, where there are no images of the background", "", 2, 1000)
    size_px: int = parameter(80, "height of the body in the small images that a start is searched in", "px", 16, 1000)
    hypotheses: int = parameter(48, "poses, of all that are tried, that are fitted to the silhouettes", "", 4, 1000)
    candidates: int = parameter(8, "starts that the engine tries", "", 1, 64)
    repaired_candidates: int = parameter(4, "of these, whose doubtful limbs are searched elsewhere", "", 0, 64)
    tracked_candidates: int = parameter(4, "starts that are tracked side by side, where none is clearly the best", "", 1, 16)
    tracked_sets: int = parameter(6, "image sets after which the best of these is taken", "", 1, 1000)
    min_score: float = parameter(0.35, "least fraction of what stands out from the scene that a start covers", "1", 0.0, 1.0)
    seed: int = parameter(0, "of the random poses; the same seed, the same start", "", 0, 2**31 - 1)


@dataclass(frozen=True)
class JointConfig:
    """Colors and contours in one least-squares problem (`combination: joint`)."""

    passes: int = parameter(2, "times that the points are chosen anew whose colors are compared", "", 1, 100)
    iterations: int = parameter(3, "iterations in each pass", "", 1, 1000)
    color_scale: float = parameter(4.7, "how much less the colors' information counts than that of the contours", "1", 1e-3, 1e3)


@dataclass(frozen=True)
class SelfCheckConfig:
    """Which camera the others contradict: by its place, or by the time of its images."""

    enabled: bool = parameter(True, "compare the cameras, and leave out those that repeat an image or do not show the body")
    window_s: float = parameter(2.0, "how far back they are compared", "s", 0.1, 3600.0)
    angle_deg: float = parameter(0.3, "a camera is named that has been turned by more than this", "deg", 0.0, 180.0)
    delay_images: float = parameter(0.5, "or whose images are late, or early, by more than this", "1", 0.0, 1000.0)
    sigmas: float = parameter(5.0, "and by more than so many standard deviations", "1", 0.0, 1000.0)


@dataclass(frozen=True)
class _ByColors:
    """What all that goes by colors has in common: when it counts, and how a lost body is searched."""

    degraded_agreement: float = parameter(
        0.5, "fraction of the difference from surroundings that the fit explains, below which the status is DEGRADED", "1", 0, 1
    )
    lost_agreement: float = parameter(
        0.4, "the same for LOST; a single camera or part below it is named, and the status DEGRADED", "1", 0, 1
    )
    search_angle_deg: float = parameter(35.0, "and turned by up to this; a lost limb, in each of its joints", "deg", 0, 180)
    search_states: int = parameter(1000, "states tried a round of that search; 0: a lost body is not searched", "", 0, 10**6)
    seed: int = parameter(0, "of that search", "", 0, 2**31 - 1)
    residual_sigma: float = parameter(3.0, "least standard deviation of a color, for the covariance", "gray levels", 0.01, 255)
    correlation: float = parameter(30.0, "how many neighboring pixels share one error, for the covariance", "pixels", 1, 10000)


@dataclass(frozen=True)
class TextureConfig(_ByColors):
    """Textures on the faces of boxes, in each camera's own brightness and contrast."""

    search_radius: float = parameter(0.35, "a lost body is searched this far around where it is expected", "m", 0, 10)
    correlation: float = parameter(60.0, "how many neighboring points share one error, for the covariance", "points", 1, 10000)


@dataclass(frozen=True)
class ColorOverBackgroundConfig(_ByColors):
    """Parts of one color over images of the background: the whole image is explained."""

    normalized_weight: float = parameter(0.5, "weight of the normalized part in a blend", "1", 0, 1)
    robust_scale: float = parameter(50.0, "scale of the robust kernel on the finest level", "gray levels", 0.1, 1000)
    reach_px: int = parameter(64, "images farther than this from the predicted body are not processed", "px", 4, 10000)
    learn_colors: bool = parameter(False, "take the parts' colors from the first image set instead of the model")
    color_rate: float = parameter(0.0, "weight of the newest image in the parts' colors; 0 keeps them fixed", "1", 0, 1)
    stay_position: float = parameter(0.0, "weight of the prior at the predicted root position", "gray levels^2/m^2", 0.0, 1e15)
    stay_angle: float = parameter(1e7, "weight of the prior at the predicted angles", "gray levels^2/rad^2", 0.0, 1e15)
    neutral_angle: float = parameter(
        1e3, "multiplies the stiffness of the model's axes (prior at their neutral angles)", "gray levels^2", 0.0, 1e15
    )
    min_pixels: int = parameter(200, "a body that covers less of the images, of all cameras, is LOST", "pixels", 1, 10**9)
    few_pixels: int = parameter(1000, "and one that covers less than this is DEGRADED", "pixels", 1, 10**9)


@dataclass(frozen=True)
class ColorConfig(ColorOverBackgroundConfig):
    """Colors of the parts, pixel by pixel (Trewartha, Yeadon & Knight): what is compared, and how it is searched."""

    representation: str = parameter(
        "blend", "raw: RGB; normalized: each pixel divided by its intensity, so that white light cancels; blend: both, weighted",
        choices=("raw", "normalized", "blend"),
    )  # fmt: skip
    fit_gain: bool = parameter(
        True, "compare raw colors in the gain of each camera, and within a fifth of each channel, that suits best: exposures and"
        " white balances need not be known; points of learned colors are in the light of the images already",
    )  # fmt: skip
    optimizer: str = parameter(
        "alignment",
        "alignment: Levenberg-Marquardt on an image pyramid; stepping: downhill, with the V-algorithm; simplex: Nelder-Mead",
        choices=("alignment", "stepping", "simplex"),
    )
    levels: int = parameter(4, "levels of the image pyramid", "", 1, 8)
    hierarchical: bool = parameter(True, "root first, then from proximal to distal parts, then all together")
    schedule: str = parameter(
        "tracking",
        "loops of the stepping optimizer: tracking (20, 10, 5 mm; 4, 2, 1 degrees), or those of the paper (50, 30, 20, 10, 10 mm;"
        " 5, 3, 2, 1, 1 degrees), with two finer ones, or with fewer columns at first",
        choices=("tracking", "five_loops", "seven_loops", "decimated"),
    )
    passes: int = parameter(
        2, "times that the alignment decides, on each level of the pyramid, which points are seen", "", 1, 100
    )
    first_passes: int = parameter(6, "the same on the first image set after a start or a reset", "", 1, 1000)
    iterations: int = parameter(2, "iterations of the alignment in each pass", "", 1, 1000)
    search_radius: float = parameter(0.35, "a lost body is searched this far around where it is expected", "m", 0, 10)


@dataclass(frozen=True)
class TrackerConfig:
    """The tracker's parameters.

    Attributes
    ----------
    modalities : what images are compared by; those of `CONTOURS` may be added to each other, and to one of `COLORS`.
    """

    modalities: tuple[str, ...] = parameter(
        (REGION,),
        "what images are compared by. region: where colors change along the contour's normals; chamfer: distances to silhouettes"
        " and edges; keypoints: points and silhouettes of a detector of people; color: the colors of the parts; texture: textures"
        " on the faces of boxes; color_over_background: parts of one color over images of the background",
        choices=MODALITIES,
    )
    combination: str = parameter(
        "joint", "colors and contours. joint: in one least-squares problem; sequential: contours from where colors have led",
        choices=("joint", "sequential"), of=(MIXED,),
    )  # fmt: skip
    synchronizer: SynchronizerConfig = field(default_factory=SynchronizerConfig)
    background: BackgroundConfig = field(default_factory=BackgroundConfig, metadata={"of": CONTOURS})
    region: RegionConfig = field(default_factory=RegionConfig, metadata={"of": (REGION,)})
    chamfer: ChamferConfig = field(default_factory=ChamferConfig, metadata={"of": (CHAMFER,)})
    keypoints: KeypointConfig = field(default_factory=KeypointConfig, metadata={"of": (KEYPOINTS,)})
    color: ColorConfig = field(default_factory=ColorConfig, metadata={"of": (COLOR,)})
    texture: TextureConfig = field(default_factory=TextureConfig, metadata={"of": (TEXTURE,)})
    color_over_background: ColorOverBackgroundConfig = field(
        default_factory=ColorOverBackgroundConfig, metadata={"of": (COLOR_OVER_BACKGROUND,)}
    )
    joint: JointConfig = field(default_factory=JointConfig, metadata={"of": (JOINT,)})
    motion: MotionConfig = field(default_factory=MotionConfig)
    collision: CollisionConfig = field(default_factory=CollisionConfig, metadata={"of": GEOMETRIC})
    floor: FloorConfig = field(default_factory=FloorConfig, metadata={"of": GEOMETRIC})
    status: StatusConfig = field(default_factory=StatusConfig, metadata={"of": (REGION,)})
    limb_search: LimbSearchConfig = field(default_factory=LimbSearchConfig, metadata={"of": (REGION,)})
    initialization: InitializationConfig = field(default_factory=InitializationConfig)
    self_check: SelfCheckConfig = field(default_factory=SelfCheckConfig, metadata={"of": GEOMETRIC})
    threads: int = parameter(2, "worker threads; sums are in fixed order whatever their number", "", 1, 64)

    @property
    def contours(self) -> tuple[str, ...]:
        """The modalities in use that go by contours."""
        return tuple(name for name in CONTOURS if name in self.modalities)

    @property
    def colors(self) -> str | None:
        """The modality in use that goes by colors, if any."""
        return next((name for name in COLORS if name in self.modalities), None)

    @property
    def is_joint(self) -> bool:
        """Whether colors and contours are fitted together."""
        return bool(self.contours) and self.colors is not None and self.combination == "joint"

    @property
    def residual_unit(self) -> str:
        """Unit of the residuals of estimates."""
        return GRAY_LEVELS if self.colors and not self.contours else PX

    @property
    def tags(self) -> frozenset[str]:
        """What parameters may belong to (`describe`) and holds here."""
        mixed = bool(self.contours) and self.colors is not None
        more = {MIXED} if mixed else {ALONE} if self.colors else set()
        if set(GEOMETRIC) & set(self.modalities):
            more |= {f"motion.base: {self.motion.base}", f"floor.enabled: {self.floor.enabled}"}
        more |= {POINTS_BESIDE} if {REGION, KEYPOINTS} <= set(self.modalities) else set()
        return frozenset(self.modalities) | more | ({JOINT} if self.is_joint and self.colors == COLOR else set())


def checked_combination(config: TrackerConfig, source: str) -> TrackerConfig:
    """Check that the modalities of a configuration go together.

    Parameters
    ----------
    config : the configuration.
    source : names the file, or what stands for it, in errors.

    Returns
    -------
    The configuration itself.

    Raises
    ------
    FileFormatError : its modalities do not go together.
    """
    names, expected = config.modalities, f"one or more of {', '.join(MODALITIES)}, each once"
    if not names or len(set(names)) != len(names):
        raise FileFormatError(source, "modalities", expected, list(names))
    if sum(name in COLORS for name in names) > 1:
        raise FileFormatError(source, "modalities", f"at most one of {', '.join(COLORS)}", list(names))
    if KEYPOINTS in names and set(names) - {REGION, KEYPOINTS}:
        raise FileFormatError(source, "modalities", "keypoints alone, or with region", list(names))
    if config.is_joint and config.colors not in (COLOR, TEXTURE):
        expected = f"sequential with the modality {config.colors}: only color and texture are fitted jointly with contours"
        raise FileFormatError(source, "combination", expected, config.combination)
    return config


def flatten(config: TrackerConfig) -> dict[str, Any]:
    """``{"region.repeats": 2, ...}`` of the parameters in use, lists for tuples, as files and ROS have them."""
    values = {name: value_of(config, name) for name in describe(config)}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}


def describe(config: TrackerConfig | None = None) -> dict[str, dict[str, Any]]:
    """Dotted name -> {default, doc, unit, low, high, choices, of} of every parameter; of those in use in ``config``."""
    return {
        name: dict(entry)
        for name, entry in _everything().items()
        if config is None or not entry["of"] or config.tags & set(entry["of"])
    }


@cache
def _everything() -> dict[str, dict[str, Any]]:
    """As of `describe`: not to be changed."""
    return {name: {"default": f.default, **f.metadata, "of": of} for name, f, of in named(TrackerConfig)}


def from_dict(values: dict[str, Any], source: str = "tracker config") -> TrackerConfig:
    """Configuration from a mapping; unknown keys, wrong types and values out of range are refused.

    Parameters
    ----------
    values : nested, or by dotted names.
    source : names the file, or what stands for it, in errors.

    Returns
    -------
    With defaults where nothing is given.

    Raises
    ------
    FileFormatError : naming ``source`` and the field; for a parameter that has no effect the modalities that it belongs to, for
        one of an earlier version its present name.
    """
    refuse_renamed(values, source)
    tree = nested(values, source)
    config = checked_combination(built(TrackerConfig, tree, source), source)
    for name in flat(tree):
        refuse_unused(config, name, value_of(config, name), source)
    return config


def refuse_unused(config: TrackerConfig, name: str, value: Any, source: str) -> None:
    """Refuse a parameter of another modality than those in use.

    Parameters
    ----------
    config : has the modalities in use.
    name, value : dotted name, and what was given.
    source : names the file, or what stands for it, in errors.

    Raises
    ------
    FileFormatError : naming what it belongs to.
    """
    of = _everything()[name]["of"]
    if of and not config.tags & set(of):
        wanted, there = f"modalities with {' or '.join(of)}", f"[{', '.join(config.modalities)}]"
        if set(of) <= set(SWITCHED) and set(GEOMETRIC) & config.tags:
            wanted, there = of[0], value_of(config, of[0].partition(":")[0])
        expected = f"{wanted}, to which it belongs, instead of {there}"
        raise FileFormatError(source, name, expected, value)


def chosen(config: TrackerConfig, values: Mapping[str, Any], source: str) -> TrackerConfig:
    """A configuration with other modalities, another base, or a floor.

    Parameters
    ----------
    config : has all else.
    values : by dotted names; those that decide which others are parameters count.
    source : names the file, or what stands for it, in errors.

    Returns
    -------
    With the modalities, their combination, the base and the floor among ``values``.

    Raises
    ------
    FileFormatError : there are no such modalities, or they do not go together.
    """
    given = {name: values.get(name, value_of(config, name)) for name in _DECIDING}
    made = built(TrackerConfig, nested(given, source), source)
    if MIXED not in made.tags:
        made = replace(made, combination=TrackerConfig().combination)
    motion, floor = replace(config.motion, base=made.motion.base), replace(config.floor, enabled=made.floor.enabled)
    made = replace(config, modalities=made.modalities, combination=made.combination, motion=motion, floor=floor)
    return checked_combination(made, source)


def updated(config: TrackerConfig, values: Mapping[str, Any], source: str) -> TrackerConfig:
    """A configuration with other values; what belongs to modalities no longer in use has its default again.

    Parameters
    ----------
    config : has all else.
    values : by dotted names.
    source : names the file, or what stands for it, in errors.

    Returns
    -------
    The new configuration.

    Raises
    ------
    FileFormatError : as from `from_dict`.
    """
    refuse_renamed(values, source)
    base = chosen(config, values, source)
    return from_dict({**flatten(base), **values}, source)
