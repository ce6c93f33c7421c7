"""How well a score tells two kinds apart: receiver operating characteristic, its area, and its picture."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tracker_node.render.palette import CYCLE, GRAY


@dataclass(frozen=True, eq=False)
class Roc:
    """Shares of negatives and of positives whose score is at least each of ``thresholds`` (descending; the first is infinite)."""

    thresholds: np.ndarray
    false_rates: np.ndarray
    true_rates: np.ndarray
    n_positives: int
    n_negatives: int

    @property
    def area(self) -> float:
        """Chance that a positive scores higher than a negative; a tie counts half. Nan where there are none of one kind."""
        if not (self.n_positives and self.n_negatives):
            return float("nan")
        return float(np.trapezoid(self.true_rates, self.false_rates))

    def at(self, threshold: float) -> tuple[float, float]:
        """(false rate, true rate) of calling positive what scores at least ``threshold``."""
        i = int(np.searchsorted(-self.thresholds, -threshold, side="right")) - 1
        return float(self.false_rates[i]), float(self.true_rates[i])


def roc(scores: np.ndarray, positives: np.ndarray) -> Roc:
    """Of ``scores`` (n,), where high means positive, and what is (n,) bool."""
    order = np.argsort(-scores, kind="stable")
    scores, positives = scores[order], positives[order]
    last = np.flatnonzero(np.append(np.diff(scores) != 0.0, True))  # of each score, so that ties are passed in one step
    true, false = np.cumsum(positives)[last], np.cumsum(~positives)[last]
    n_true, n_false = int(positives.sum()), int((~positives).sum())
    return Roc(
        np.concatenate([[np.inf], scores[last]]),
        np.concatenate([[0.0], false / max(n_false, 1)]),
        np.concatenate([[0.0], true / max(n_true, 1)]),
        n_true,
        n_false,
    )  # fmt: skip


def roc_picture(curves: Mapping[str, Roc], threshold: float) -> bytes:
    """PNG of the curves, the whole and the corner that matters, with the point of ``threshold`` marked on each."""
    figure = Figure(figsize=(9.5, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    whole, corner = figure.subplots(1, 2)
    for ax in (whole, corner):
        for i, (name, curve) in enumerate(curves.items()):
            color = CYCLE[i % len(CYCLE)]
            counts = f"{curve.n_positives} of {curve.n_positives + curve.n_negatives}"
            ax.plot(
                curve.false_rates, curve.true_rates, color=color, lw=1.6, drawstyle="steps-post",
                label=f"{name}: area {curve.area:.4f} ({counts} lost)",
            )  # fmt: skip
            ax.plot(*curve.at(threshold), "o", color=color, ms=5)
        ax.grid(color="#e3e3e3", lw=0.7)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
        ax.tick_params(labelsize=8)
        ax.set_xlabel("share of the sound that is called lost")
    whole.plot([0, 1], [0, 1], color=GRAY, lw=0.8, ls="--")
    whole.set_ylabel("share of the lost that is called lost")
    whole.legend(loc="lower right", frameon=False, fontsize=8)
    corner.set_xlim(-0.002, 0.1)
    corner.set_ylim(0.8, 1.004)
    corner.set_title("the corner; dots: the tracker's own threshold", fontsize=9)
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return stream.getvalue()
