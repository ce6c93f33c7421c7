"""The table of people's lengths from a file of them."""

from pathlib import Path

import numpy as np
import pytest

from benchmark.clothed._fit import _ENDS, main, proportions
from benchmark.clothed.person._write_bodies import LENGTHS, draw_phenotype
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model

HEADER = ",".join(LENGTHS)


def people(n: int, scatter: float) -> np.ndarray:
    """(n, 7) meters: like the default body, but for arms that are longer in small people, and thighs that vary alone."""
    model, rng = human_model(), np.random.default_rng(2)
    places = dict(zip(model.landmark_names, Configuration(model, State.neutral(model)).landmarks_world, strict=True))
    places |= {name: 0.5 * (places[f"left_{name}"] + places[f"right_{name}"]) for name in ("shoulder", "hip")}
    default = np.array([np.linalg.norm(places[one] - places[other]) for one, other in LENGTHS.values()])
    size = rng.normal(0.0, 0.2, n)
    logarithms = np.tile(size[:, None], (1, 7))
    logarithms[:, 0] += -0.1 - 0.3 * size
    logarithms[:, 5] += 0.05 + scatter * rng.normal(size=n)
    return default * np.exp(logarithms)


def test_means_slopes_and_covariance_are_found() -> None:
    means, slopes, covariance = proportions(people(2000, 0.04))
    np.testing.assert_allclose(means, [-0.1, 0.0, 0.0, 0.0, 0.0, 0.05, 0.0], atol=0.003)
    np.testing.assert_allclose(slopes, [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], atol=0.01)
    assert covariance[5, 5] == pytest.approx(0.04**2, rel=0.1)
    covariance[5, 5] = 0.0
    assert np.abs(covariance).max() < 1e-8


def test_a_file_is_printed_as_the_module_has_it(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch) -> None:
    np.savetxt(tmp_path / "lengths.csv", people(50, 0.0), delimiter=",", header=HEADER, comments="")
    monkeypatch.setattr("sys.argv", ["_fit", "--lengths", str(tmp_path / "lengths.csv")])
    main()
    found: dict = {"np": np}
    exec(capsys.readouterr().out, found)
    np.testing.assert_allclose(found["_MEANS"], [-0.1, 0.0, 0.0, 0.0, 0.0, 0.05, 0.0], atol=6e-4)
    assert found["_COVARIANCE"].shape == (7, 7)


def test_both_programs_mean_the_same_lengths() -> None:
    """They share nothing but a file: one runs in an environment of its own."""
    assert tuple(LENGTHS.values()) == _ENDS


def test_people_are_drawn_alike() -> None:
    drawn = [draw_phenotype(np.random.default_rng(1)) for _ in range(2)]
    many = [draw_phenotype(rng) for rng in [np.random.default_rng(1)] for _ in range(400)]
    assert drawn[0] == drawn[1] == many[0] != many[1]
    assert 0.15 < np.mean([each["age"] < 0.5 for each in many]) < 0.35
    assert all(0.2 <= each["height"] <= 0.8 and each["gender"] in (0.0, 1.0) for each in many)
