"""A filter as an estimator of scikit-learn: a level that walks at random and is measured with noise, one column for each recording.

    from sklearn.model_selection import cross_val_score
    cross_val_score(Level(), samples[:, None])

`fit` learns the variances of both noises by maximum likelihood, `transform` smooths with them, and `score` is ln p of a sample on average.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from sklearn.base import BaseEstimator, TransformerMixin

from kalmems import filters


class Level(TransformerMixin, BaseEstimator):
    """A level in the unit of the samples; `prior_sd` is how far the first one may be from zero."""

    def __init__(self, prior_sd: float = 100.0) -> None:
        self.prior_sd = prior_sd

    def _model(self, q: float, r: float) -> dict[str, Any]:
        return {"F": 1, "H": 1, "Q": q, "R": r, "x0": 0, "P0": self.prior_sd**2}

    def fit(self, X: np.ndarray, y: object = None) -> Level:
        z = np.asarray(X)[:, 0]
        start = max(float(np.nanvar(np.diff(z))) / 3, 1e-12)
        self.fit_ = filters.fit(self._model, {"q": start, "r": start}, z, positive=("q", "r"))
        return self

    def _filtered(self, X: np.ndarray) -> filters.Filtered:
        return filters.kalman(np.asarray(X)[:, 0], **self._model(**self.fit_.values), smooth=True)

    def transform(self, X: np.ndarray) -> np.ndarray:
        smoothed = self._filtered(X).smoothed
        assert smoothed is not None
        return smoothed.x

    def score(self, X: np.ndarray, y: object = None) -> float:
        return float(np.nanmean(self._filtered(X).log_likelihood))
