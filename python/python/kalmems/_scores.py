"""How the likelihood of a linear system depends on its matrices: exact derivatives, from one run of the filter and its smoother.

With r and N of what the samples from k on say of the predicted state (de Jong 1988; Koopman and Shephard 1992), which is
∂ln p/∂x⁻ = r and ∂ln p/∂P⁻ = Λ = (r·rᵀ − N)/2 of the prediction, all derivatives by matrices follow sample by sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Numbers: TypeAlias = NDArray[np.float64]

SOUND = 1e9
"""Condition numbers of predicted covariances up to which r and N follow from the smoothed state; otherwise they are computed backwards."""


def scores(filtered: Any, z: Numbers, parts: Mapping[str, Numbers], u: Numbers | None) -> dict[str, Numbers]:
    """∂ln p/∂ each of F, H, Q, R, x0, P0 and B, summed over the samples for a matrix that is one for all, and per sample otherwise."""
    motion, sensor, noise = parts["F"], parts["H"], parts["R"]
    x0, p0, x, p = parts["x0"], parts["P0"], filtered.x, filtered.P
    driven = 0.0 if u is None or "B" not in parts else (parts["B"] @ u[..., None])[..., 0][:-1]
    there = ~np.isnan(z)
    rows = sensor * there[:, :, None]
    # What is predicted, of the first sample what is known before.
    before = _of_steps(motion, len(z))
    ahead = np.concatenate([x0[None], (before @ x[:-1, :, None])[..., 0] + driven])
    spread = np.concatenate([p0[None], before @ p[:-1] @ before.transpose(0, 2, 1) + _of_steps(parts["Q"], len(z))])
    both = there[:, :, None] & there[:, None, :]
    s = rows @ spread @ rows.transpose(0, 2, 1) + np.where(both, noise, 0.0)
    s = s + np.eye(z.shape[1]) * ~there[:, None, :]
    inverse = np.asarray(np.linalg.inv(s), dtype=np.float64)
    left = np.where(there, z - (sensor @ ahead[..., None])[..., 0], 0.0)
    gain = (spread @ rows.transpose(0, 2, 1) @ inverse) * filtered.taken[:, None, None]
    white = (inverse @ left[..., None])[..., 0]
    moved = np.eye(len(x0)) - gain @ rows
    own = (rows.transpose(0, 2, 1) @ white[..., None])[..., 0]
    is_rejected = ~filtered.taken & there.any(axis=1)
    after, of_after = _backwards(filtered, (ahead, spread), _Steps(before, moved, rows, inverse, own, is_rejected))
    back = moved.transpose(0, 2, 1)
    r = own + (back @ after[..., None])[..., 0]
    n = rows.transpose(0, 2, 1) @ inverse @ rows + back @ of_after @ moved + is_rejected[:, None, None] * crossed(after, own)
    curved = 0.5 * (r[:, :, None] * r[:, None, :] - n)
    y = white - (gain.transpose(0, 2, 1) @ after[..., None])[..., 0]
    d = inverse + gain.transpose(0, 2, 1) @ of_after @ gain
    m = inverse @ rows - gain.transpose(0, 2, 1) @ of_after @ moved
    by_motion = r[1:, :, None] * x[:-1, None, :] + 2 * curved[1:] @ before @ p[:-1]
    along = np.where(is_rejected[:, None], own, r)
    by_sensor = y[:, :, None] * ahead[:, None, :] + (y[:, :, None] * along[:, None, :] - m) @ spread
    found = {
        "F": _of_each(by_motion, motion),
        "Q": _of_each(curved[1:], parts["Q"]),
        "H": _of_each(by_sensor * there[:, :, None], sensor),
        "R": _of_each(0.5 * (y[:, :, None] * y[:, None, :] - d) * both, noise),
        "x0": r[0],
        "P0": curved[0],
    }
    if "B" in parts and u is not None:
        found["B"] = _of_each(r[1:, :, None] * u[:-1, None, :], parts["B"])
    return found


def crossed(a: Numbers, b: Numbers) -> Numbers:
    """a·bᵀ + b·aᵀ of each: a rejected sample has a likelihood of its own, whose product with that of the later samples is none of both."""
    return np.asarray(a[..., :, None] * b[..., None, :] + b[..., :, None] * a[..., None, :])


def _of_steps(matrix: Numbers, count: int) -> Numbers:
    """That of each step; as views where it is one for all."""
    return matrix[:-1] if matrix.ndim == 3 else np.broadcast_to(matrix, (count - 1, *matrix.shape))


def _of_each(found: Numbers, matrix: Numbers) -> Numbers:
    """The sum, or, of a matrix for each sample, one of each: the last step leads to no sample."""
    if matrix.ndim < 3:
        return np.asarray(found.sum(axis=0))
    return np.concatenate([found, np.zeros((len(matrix) - len(found), *found.shape[1:]))])


@dataclass
class _Steps:
    """Of each sample F that leads to the next, 1 − K·H, H, S⁻¹ and Hᵀ·S⁻¹·v, and whether it is rejected."""

    before: Numbers
    moved: Numbers
    rows: Numbers
    inverse: Numbers
    own: Numbers
    is_rejected: NDArray[np.bool_]


def _backwards(filtered: Any, predicted: tuple[Numbers, Numbers], steps: _Steps) -> tuple[Numbers, Numbers]:
    """What the samples after k say of the state after k's update: the derivative of ln p by its mean, and minus the second one."""
    ahead, spread = predicted
    before = steps.before
    after, of_after = np.zeros_like(ahead), np.zeros_like(spread)
    # A sample that is rejected has no part in the smoothed state.
    unspread = None if steps.is_rejected.any() else _inverse(spread[1:])
    if unspread is not None:
        # x̂ = x⁻ + P⁻·r and P̂ = P⁻ − P⁻·N·P⁻ of the smoother.
        r = (unspread @ (filtered.smoothed.x - ahead)[1:, :, None])[..., 0]
        n = unspread @ (spread - filtered.smoothed.P)[1:] @ unspread
        after[:-1] = (before.transpose(0, 2, 1) @ r[..., None])[..., 0]
        of_after[:-1] = before.transpose(0, 2, 1) @ n @ before
        return after, of_after
    for k in range(len(ahead) - 1, 0, -1):
        h, back = steps.rows[k], steps.moved[k]
        r = steps.own[k] + back.T @ after[k]
        n = h.T @ steps.inverse[k] @ h + back.T @ of_after[k] @ back
        if steps.is_rejected[k]:
            n = n + crossed(after[k], steps.own[k])
        after[k - 1], of_after[k - 1] = before[k - 1].T @ r, before[k - 1].T @ n @ before[k - 1]
    return after, of_after


def _inverse(all_of: Numbers) -> Numbers | None:
    """The inverses of covariances; none if one of them is all but singular."""
    try:
        found = np.linalg.inv(all_of)
    except np.linalg.LinAlgError:
        return None
    conditions = np.linalg.norm(all_of, axis=(1, 2)) * np.linalg.norm(found, axis=(1, 2))
    return np.asarray(found, dtype=np.float64) if np.all(conditions < SOUND) else None
