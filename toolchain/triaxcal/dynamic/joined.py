"""Several blocks of samples as one: the attitude errors between them are eliminated.

What a block says of (beta before, beta after, p) does not depend on what the filter knows. So one
elimination is done for many groups of blocks at once, and the filter takes one step for a group.
"""

from __future__ import annotations

import numpy as np

from triaxcal.model.types import FloatArray


def joined_blocks(rows: FloatArray, size: int) -> tuple[FloatArray, float]:
    """Equations of groups of `size` consecutive blocks.

    Parameters
    ----------
    rows : array, shape (groups * size, 3 + m, 7 + n)
        As `RootFilter.run` takes them.

    Returns
    -------
    rows : array, shape (groups, 3 + size * m, 7 + n)
        Of the same form.
    log_root : float
        Sum of log |R_ii| of the unknowns that were eliminated.
    """
    _, height, width = rows.shape
    each = rows.reshape(-1, size, height, width)
    groups, m = len(each), height - 3
    made = np.zeros((groups, 3 + size * m, width))
    if groups == 0:
        return made, 0.0
    # The first blocks: beta after is made triangular; beta before is a column as those of p.
    right = np.concatenate([each[:, 0, :, :3], each[:, 0, :, 6:]], axis=2)
    Q, R = np.linalg.qr(each[:, 0, :, 3:6], mode="complete")
    turned = Q.swapaxes(1, 2) @ right
    left = np.zeros((groups, 3 + height, 6))
    right = np.zeros((groups, 3 + height, width - 3))
    log_root = 0.0
    for k in range(1, size):
        _keep(made, turned[:, 3:], k - 1)
        left[:, :3, :3], left[:, 3:] = R[:, -m - 3 : -m, -3:], each[:, k, :, :6]
        right[:, :3], right[:, 3:, 3:] = turned[:, :3], each[:, k, :, 6:]
        Q, R = np.linalg.qr(left, mode="complete")
        turned = Q[:, :, 3:].swapaxes(1, 2) @ right
        log_root += float(np.log(np.abs(R[:, [0, 1, 2], [0, 1, 2]])).sum())
    _keep(made, turned[:, 3:], size - 1)
    made[:, :3, :3], made[:, :3, 6:] = turned[:, :3, :3], turned[:, :3, 3:]
    made[:, :3, 3:6] = R[:, -m - 3 : -m, -3:]
    return made, log_root


def _keep(made: FloatArray, turned: FloatArray, k: int) -> None:
    """Rows of step k that no attitude error is left in but the group's first."""
    m = turned.shape[1]
    place = slice(3 + k * m, 3 + (k + 1) * m)
    made[:, place, :3], made[:, place, 6:] = turned[:, :, :3], turned[:, :, 3:]
