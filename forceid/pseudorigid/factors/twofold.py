"""Polar and bipolar factors in numpy, with the few sums that need it in twice the digits.

A twofold number is an unrounded sum, high + low. Products are split after Dekker and sums kept after Knuth;
rounding the skew part of L^T F once would cost eps s1 / (s2 + s3) of the rotation, s the singular values.
The arithmetic is that of polar.hpp. Source: pseudo-rigid bodies 2.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from forceid.records import Array

DEKKER = 2.0**27 + 1
JACOBI_ROUNDS = 8
ARRIVED = 1e-9  # rad: a step so short leaves its square, and less
Twofold = tuple[Array, Array]


def exact_factors(F: Array) -> tuple[Array, Array, Array, Array]:
    """Polar rotation Q of F (n, 3, 3), D and R of F = Q R^T D R, and a number with the sign of det F > 0."""
    with np.errstate(invalid="ignore"):  # what is not finite has no det > 0
        power = np.ldexp(1.0, np.frexp(np.abs(F).max((1, 2), initial=0.0))[1])[:, None, None]
        f = np.asarray(F / power)
        det = exact_determinant(f)
    fit = np.where((det > 0)[:, None, None], f, np.eye(3))
    L, D, R = np.linalg.svd(fit)
    flip = np.linalg.det(R) < 0  # both factors alike, as det F > 0
    R[flip, 2] *= -1
    L[:, :, 2] *= np.sign(np.linalg.det(L))[:, None]  # also where rounding had the sign of a tiny D wrong
    D[:, 2] = exact_determinant(fit) / (D[:, 0] * D[:, 1])
    return improved(fit, L @ R), D * power[:, 0], R, det


def improved(F: Array, Q: Array) -> Array:
    """The polar rotation of F (n, 3, 3), from rotations near it, by Newton's rule on its quaternion."""
    q = Rotation.from_matrix(Q).as_quat(scalar_first=True)
    moving = np.arange(len(F))
    for _ in range(JACOBI_ROUNDS):
        w, x, y, z = q[moving].T
        skew, A = turned_back(q[moving], F[moving])
        S = 0.5 * (A + A.swapaxes(1, 2))
        inertia = np.trace(S, axis1=1, axis2=2)[:, None, None] * np.eye(3) - S
        a, b, c = 0.5 * np.linalg.solve(inertia, skew[..., None])[..., 0].T
        change = [-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a]
        q[moving] += np.stack(change, 1)
        moving = moving[a * a + b * b + c * c > ARRIVED**2]
        if not len(moving):
            break
    return np.asarray(Rotation.from_quat(q, scalar_first=True).as_matrix())


def exact_determinant(F: Array) -> Array:
    """Determinants (n,) of F (n, 3, 3), exact but for the last rounding unless they cancel to 1e-30."""
    a, b, c = (F[:, i].T for i in range(3))
    total = (np.zeros(len(F)), np.zeros(len(F)))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        minor = add_twofold(two_product(b[j], c[k]), negative(two_product(b[k], c[j])))
        total = add_twofold(total, scale_twofold(minor, a[i]))
    return np.asarray(total[0] + total[1])


def turned_back(q: Array, F: Array) -> tuple[Array, Array]:
    """vee(A - A^T) (n, 3), rounded once at the end, and A (n, 3, 3) = |q|^2 Q^T F."""
    N = rotation_of_length(q)
    high = np.stack([entry[0] for entry in N], 1).reshape(-1, 3, 3)

    def entry(i: int, j: int) -> Twofold:
        parts = [scale_twofold(N[3 * k + i], F[:, k, j]) for k in range(3)]
        return add_twofold(add_twofold(parts[0], parts[1]), parts[2])

    differences = [add_twofold(entry(j, i), negative(entry(i, j))) for i, j in ((1, 2), (2, 0), (0, 1))]
    return np.stack([d[0] + d[1] for d in differences], 1), high.swapaxes(1, 2) @ F


def rotation_of_length(q: Array) -> list[Twofold]:
    """|q|^2 Q of quaternions q (n, 4), row by row: a rotation but for its length, however q was rounded."""
    w, x, y, z = q.T
    ww, xx, yy, zz = (two_product(v, v) for v in (w, x, y, z))
    wx, wy, wz = (two_product(w, v) for v in (x, y, z))
    xy, xz, yz = two_product(x, y), two_product(x, z), two_product(y, z)

    def diagonal(own: Twofold, one: Twofold, two: Twofold) -> Twofold:
        return add_twofold(add_twofold(ww, own), negative(add_twofold(one, two)))

    def twice(one: Twofold, two: Twofold) -> Twofold:
        total = add_twofold(one, two)
        return 2 * total[0], 2 * total[1]

    return [
        diagonal(xx, yy, zz), twice(xy, negative(wz)), twice(xz, wy),
        twice(xy, wz), diagonal(yy, xx, zz), twice(yz, negative(wx)),
        twice(xz, negative(wy)), twice(yz, wx), diagonal(zz, xx, yy),
    ]  # fmt: skip


def two_product(a: Array, b: Array) -> Twofold:
    """The exact product (Dekker 1971)."""
    one, two = DEKKER * a, DEKKER * b
    a1, b1 = one - (one - a), two - (two - b)
    a2, b2 = a - a1, b - b1
    ab = a * b
    return ab, a2 * b2 - (((ab - a1 * b1) - a2 * b1) - a1 * b2)


def add_twofold(a: Twofold, b: Twofold) -> Twofold:
    """The sum; that of the high parts is exact (Knuth)."""
    s = a[0] + b[0]
    back = s - a[0]
    return s, (a[0] - (s - back)) + (b[0] - back) + (a[1] + b[1])


def scale_twofold(a: Twofold, b: Array) -> Twofold:
    """A twofold number times a plain one."""
    ab, low = two_product(a[0], b)
    return ab, low + a[1] * b


def negative(a: Twofold) -> Twofold:
    """The number with its sign changed."""
    return -a[0], -a[1]
