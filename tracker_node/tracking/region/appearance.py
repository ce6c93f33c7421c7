"""Colors of the body's parts and of its surroundings by camera, and the background where it is known."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from ...camera.model import CameraModel
from ...camera.rig import Camera, CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import N_ROOT_DOF
from ...objective.lines.correspondences import Offsets, View
from ...objective.per_camera import bodies_seen
from ...observation.appearance import AT_ONCE
from ...observation.chamfer.observer import checked_backgrounds
from ...observation.region.background import NO_COLORS, RegionBackground
from ...observation.region.colors import RegionColors, color_classes, stated_densities, trust_stated_colors
from ...observation.region.silhouette import odds_table, packed
from ...render.occluders import Occluders
from ...render.shape_arrays import PLACES, bounding_spheres, shape_places
from ..config import BackgroundConfig, KeypointConfig, RegionConfig
from ..modality import Images, Persons


class RegionAppearance:
    """Learned from images in which the body's state is known.

    Parameters
    ----------
    rig, model, config, background : cameras, body, parameters.
    parallel : maps a function over cameras.
    occluders : what stands before the body.
    backgrounds : camera name -> BGR image, or list of images, of the background; cameras may be missing.
    keypoints : what silhouettes of a detector are worth.

    Attributes
    ----------
    classes : (n_shapes,) color class of every shape.
    """

    def __init__(
        self,
        rig: CameraRig,
        model: ArticulatedModel,
        config: RegionConfig,
        background: BackgroundConfig,
        parallel: Callable[[Callable, list], list],
        occluders: Occluders,
        backgrounds: Mapping[str, np.ndarray | list],
        keypoints: KeypointConfig | None = None,
    ):
        keypoints = keypoints or KeypointConfig()
        self._odds = odds_table(keypoints.silhouette_weight, keypoints.silhouette_limit)
        self._rig, self._model, self._config, self._background = rig, model, config, background
        self._parallel, self._occluders, self._images = parallel, occluders, dict(backgrounds)
        self.classes = color_classes(model)
        self._bounds = bounding_spheres(model)
        self._stated = stated_densities(model, self.classes)
        self.reset()

    def reset(self) -> None:
        """Only the colors that the model states, and the images of the background, are known."""
        self.forget_colors()
        self._rooms = [self._room(camera) for camera in self._rig]

    def forget_colors(self) -> None:
        """Only the colors that the model states are known."""
        self._colors = [RegionColors(self.classes, self._stated, self._config.color_prior) for _ in self._rig]

    def _room(self, camera: Camera) -> RegionBackground:
        lens, background = camera.model, self._background
        images = checked_backgrounds(camera.name, lens.width, lens.height, self._images.get(camera.name))
        return RegionBackground(images, background.sigma, background.learning_rate, background.body_margin_px)

    @property
    def known(self) -> list[bool]:
        """By camera: whether colors have been learned."""
        return [bool(colors.knows) for colors in self._colors]

    @property
    def colors(self) -> list[np.ndarray | None]:
        """By camera (n_classes, n_colors) densities of the body's colors; None where they are not known."""
        return [colors.body if colors.knows else None for colors in self._colors]

    def views(self, images: Images, persons: Persons = ()) -> list[View | None]:
        """What each camera shows.

        Parameters
        ----------
        images : by camera.
        persons : the body as a detector has found it, by camera; empty where no detector is used.

        Returns
        -------
        None without an image or without colors to compare it with; and for a camera in which the detector does not find the body
        that others see: something else stands there, whose contours are not the body's.
        """
        found: list[View | None] = []
        hidden = sum(person is not None for person in persons) >= 2
        for i, image in enumerate(images):
            colors, person = self._colors[i], persons[i] if persons else None
            if image is None or not colors.knows or (hidden and person is None):
                found.append(None)
                continue
            silhouette = packed(None if person is None else person.silhouette, image.shape[:2], self._odds)
            neighbors = self._occluders.neighbors[i]
            found.append(View(image, (colors.body, colors.scene), self._rooms[i].packed, silhouette, neighbors))
        return found

    def learn(
        self, images: Images, state: State, offsets: Offsets, rate: float, margin_px: int, weights: np.ndarray | None
    ) -> None:
        """Mix in the colors of these images.

        Parameters
        ----------
        images : by camera; None for one that does not learn.
        state : of the body in them.
        offsets : where the body is when each camera exposes.
        rate : weight of these images.
        margin_px : width around the body that is not learned as surroundings.
        weights : (n_shapes,) parts that are where ``state`` says; None: not known. With all of them the background is learned,
            too; with some, of a body with joints, without pixels of colors that the others may have.
        """
        bodies, around = bodies_seen(self._model, state, offsets), self._config.background_ring_px
        trusted = None if weights is None else np.asarray(weights > 0.5)
        # Beside limbs lies what is before or behind others: only of a rigid body is it likely to be its shadow
        rigid = self._model.n_dof == N_ROOT_DOF
        sure_px = self._config.margin_px if rigid else None
        in_place = trusted if self._config.learn_background else None  # parts beside which the background is learned
        if in_place is not None and not (in_place.all() if rigid else in_place.any()):
            in_place = None

        def learn(i: int) -> None:
            camera, places = self._rig.cameras[i], self._places(i, bodies[i])
            found = self._occluders.look(i, bodies[i], camera, around, _coarseness(places, around, camera.model))
            image = images[i]
            if found is not None and image is not None:
                region, labels, every = found.region, found.labels, found.every
                self._colors[i].learn(image, region, labels, rate, margin_px, around, trusted, sure_px, every, found.others)
                if in_place is not None:
                    everybody = self._occluders.with_neighbors(i, found)
                    doubted = NO_COLORS if in_place.all() else self._colors[i].as_likely_of(~in_place)
                    known = np.where(np.repeat(in_place, PLACES)[:, None], places, np.nan)
                    self._rooms[i].learn(image, everybody.region, everybody.labels, known, every, doubted)

        self._parallel(learn, [i for i, image in enumerate(images) if image is not None])

    def _places(self, i: int, body: Configuration) -> np.ndarray:
        """(`PLACES` n_shapes, 2) pixels of `shape_places`; not a number behind the camera."""
        pixels, ahead = self._rig.cameras[i].project(shape_places(body, self._bounds))
        return np.where(ahead[:, None], pixels, np.nan)

    def trust_stated(self) -> None:
        """Use the colors that the model states as far as the images agree with them."""
        trust_stated_colors(self._colors)


def _coarseness(places: np.ndarray, around_px: int, lens: CameraModel) -> int:
    """How many pixels a side may have one label, where a body with these places (n, 2) is so large that fewer pixels will do.

    Powers of two: for each the rays of a lens are found anew.
    """
    seen = np.clip(places[np.isfinite(places).all(axis=1)], 0.0, (lens.width, lens.height))
    if not len(seen):
        return 1
    return 1 << max(0, math.ceil(0.5 * math.log2(np.prod(np.ptp(seen, axis=0) + 2.0 * around_px) / AT_ONCE)))
