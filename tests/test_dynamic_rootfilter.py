"""The square-root filter against dense least squares and against the textbook Kalman filter."""

from __future__ import annotations

import numpy as np

from triaxcal.dynamic.rootfilter import GROUP, GROUPS_MIN, RootFilter

N, BLOCKS = 5, 9
PRIOR, ATTITUDE = np.full(N, 2.0), np.array([1.0, 2.0, 3.0])


def rows(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((BLOCKS, 9, 7 + N))


def dense(made: np.ndarray, mean: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """All betas and p at once, their covariance and the sum of squared residuals."""
    width = 3 * (len(made) + 1) + N
    A, z = [np.zeros((N + 3, width))], [np.concatenate([mean / PRIOR, np.zeros(3)])]
    A[0][:N, -N:] = np.diag(1 / PRIOR)
    A[0][N:, :3] = np.diag(1 / ATTITUDE)
    for k, block in enumerate(made):
        part = np.zeros((len(block), width))
        part[:, 3 * k : 3 * k + 6] = block[:, :6]
        part[:, -N:] = block[:, 6:-1]
        A.append(part)
        z.append(block[:, -1])
    whole, right = np.concatenate(A), np.concatenate(z)
    x, residual, _, _ = np.linalg.lstsq(whole, right, rcond=None)
    last = np.r_[3 * len(made) : 3 * len(made) + 3 + N]
    return x[last], np.linalg.inv(whole.T @ whole)[np.ix_(last, last)], float(residual[0])


def ready(mean: np.ndarray) -> RootFilter:
    made = RootFilter.of_prior(PRIOR, mean)
    made.restart_attitude(ATTITUDE)
    return made


def test_equals_least_squares_whatever_the_pieces() -> None:
    made, mean = rows(1), np.arange(N) / 3
    x, covariance, residual = dense(made, mean)
    for cut in (1, 4, BLOCKS):
        found = ready(mean)
        found.run(made[:cut], np.full(cut, 6))
        found.fold()
        if cut < BLOCKS:
            found.run(made[cut:], np.full(BLOCKS - cut, 6))
        beta, p = found.estimate()
        root = found.root_covariance()
        # Condition numbers are of order ten: rounding is some 1e-15.
        np.testing.assert_allclose(np.concatenate([beta, p]), x, rtol=0, atol=1e-12)
        np.testing.assert_allclose(root @ root.T, covariance, rtol=0, atol=1e-12)
        assert abs(found.chi_square - residual) < 1e-10
        assert found.freedom == 6 * BLOCKS


def test_a_shift_moves_the_origin_and_nothing_else() -> None:
    made = rows(2)
    plain, shifted = ready(np.zeros(N)), ready(np.zeros(N))
    for found in (plain, shifted):
        found.run(made, np.full(BLOCKS, 6))
    d_beta, d_p = np.array([0.1, -0.2, 0.3]), np.linspace(-1, 1, N)
    shifted.shift(d_beta, d_p)
    beta, p = shifted.estimate()
    np.testing.assert_allclose(beta + d_beta, plain.estimate()[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(p + d_p, plain.estimate()[1], rtol=0, atol=1e-12)


def test_forgetting_leaves_the_others_as_they_were() -> None:
    made = rows(3)
    found = ready(np.zeros(N))
    found.run(made, np.full(BLOCKS, 6))
    _, before = found.estimate()
    root = found.root_covariance()
    variance = (root @ root.T)[3:, 3:]
    columns = np.array([1, 3])
    found.diffuse(columns, np.full(2, np.inf))
    found.add_prior(columns, np.array([7.0, 5.0]), np.array([0.5, -0.5]))
    _, after = found.estimate()
    root = found.root_covariance()
    others = [0, 2, 4]
    np.testing.assert_allclose(after[others], before[others], rtol=0, atol=1e-12)
    np.testing.assert_allclose(after[columns], [0.5, -0.5], rtol=0, atol=1e-12)
    now = (root @ root.T)[3:, 3:]
    np.testing.assert_allclose(
        now[np.ix_(others, others)], variance[np.ix_(others, others)], atol=1e-12
    )
    np.testing.assert_allclose(np.diag(now)[columns], [49.0, 25.0], rtol=1e-12)


def test_a_walk_adds_its_variance() -> None:
    found = ready(np.zeros(N))
    found.run(rows(4), np.full(BLOCKS, 6))
    root = found.root_covariance()
    before = np.diag(root @ root.T)[3:]
    found.diffuse(np.array([2]), np.array([0.3]))
    root = found.root_covariance()
    after = np.diag(root @ root.T)[3:]
    np.testing.assert_allclose(after - before, [0, 0, 0.09, 0, 0], rtol=0, atol=1e-12)


def test_equals_the_textbook_filter() -> None:
    """Covariance form, predict and update, on a transition and a measurement of beta."""
    rng = np.random.default_rng(5)
    found = ready(np.zeros(N))
    x, P = np.zeros(3 + N), np.diag(np.concatenate([ATTITUDE, PRIOR]) ** 2)
    innovations = 0.0
    for _ in range(BLOCKS):
        F = np.eye(3 + N)
        F[:3, :3] += 0.1 * rng.standard_normal((3, 3))
        F[:3, 3:] = rng.standard_normal((3, N))
        H = rng.standard_normal((3, 3 + N))
        y, q, r = rng.standard_normal(3), 0.4, 0.7
        block = np.zeros((1, 6, 7 + N))
        block[0, :3, :3], block[0, :3, 3:6], block[0, :3, 6:-1] = F[:3, :3], -np.eye(3), F[:3, 3:]
        block[0, :3] /= q
        block[0, 3:, 3:6], block[0, 3:, 6:-1], block[0, 3:, -1] = H[:, :3], H[:, 3:], y
        block[0, 3:] /= r
        found.run(block, np.array([3]))
        Q = np.zeros((3 + N, 3 + N))
        Q[:3, :3] = q**2 * np.eye(3)
        x, P = F @ x, F @ P @ F.T + Q
        S = H @ P @ H.T + r**2 * np.eye(3)
        innovation = y - H @ x
        innovations += float(innovation @ np.linalg.solve(S, innovation))
        K = P @ H.T @ np.linalg.inv(S)
        x, P = x + K @ innovation, P - K @ S @ K.T
    beta, p = found.estimate()
    root = found.root_covariance()
    np.testing.assert_allclose(np.concatenate([beta, p]), x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(root @ root.T, P, rtol=0, atol=1e-9)
    # The filter has folded in all that no beta is left in: the last block's beta has three rows
    # of its own, which are met exactly.
    assert abs(found.chi_square - innovations) < 1e-9


def test_joined_blocks_say_the_same() -> None:
    """Groups of blocks, eliminated side by side, against all unknowns at once."""
    made, mean = np.random.default_rng(5).standard_normal((40, 9, 7 + N)), np.arange(N) / 3
    assert len(made) >= GROUP * GROUPS_MIN
    x, covariance, residual = dense(made, mean)
    found = ready(mean)
    found.run(made, np.full(40, 6))
    beta, p = found.estimate()
    root = found.root_covariance()
    np.testing.assert_allclose(np.concatenate([beta, p]), x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(root @ root.T, covariance, rtol=0, atol=1e-12)
    assert abs(found.chi_square - residual) < 1e-9
    assert found.freedom == 240


def test_the_root_of_the_determinant_is_that_of_all_unknowns() -> None:
    """Of the information matrix of every beta and p, whatever was joined."""
    made = np.random.default_rng(6).standard_normal((40, 9, 7 + N))
    found = ready(np.zeros(N))
    found.run(made, np.full(40, 6))
    found.fold()
    left = np.concatenate([np.diag(found.R_bb), np.diag(found.R_pp)])
    # The attitude's prior is counted off: it is put in as noise is.
    whole = found.log_root + np.log(np.abs(left)).sum() - np.log(ATTITUDE).sum()
    width = 3 * 41 + N
    A = np.zeros((40 * 9 + 3 + N, width))
    A[:N, -N:], A[N : N + 3, :3] = np.diag(1 / PRIOR), np.diag(1 / ATTITUDE)
    for k, block in enumerate(made):
        A[N + 3 + 9 * k :][:9, 3 * k : 3 * k + 6] = block[:, :6]
        A[N + 3 + 9 * k :][:9, -N:] = block[:, 6:-1]
    assert abs(whole - np.linalg.slogdet(A.T @ A)[1] / 2) < 1e-9


def test_states_that_decay_and_are_driven() -> None:
    """x becomes a x + w: mean a x, variance a^2 P + q; what is known of the others stays."""
    found = ready(np.zeros(N))
    found.run(rows(7), np.full(BLOCKS, 6))
    _, before = found.estimate()
    root = found.root_covariance()
    P = (root @ root.T)[3:, 3:]
    columns, factor, sd = np.array([1, 3]), np.array([0.5, 0.9]), np.array([0.2, 0.3])
    found.diffuse(columns, sd, factor)
    F, q = np.eye(N), np.zeros(N)
    F[columns, columns], q[columns] = factor, sd**2
    root = found.root_covariance()
    np.testing.assert_allclose((root @ root.T)[3:, 3:], F @ P @ F.T + np.diag(q), atol=1e-12)
    np.testing.assert_allclose(found.estimate()[1], F @ before, rtol=0, atol=1e-12)
