"""The free rigid body, U = I: the limit of an affine body that does not stretch, in closed form.

J = tr(E) I - E is the usual inertia tensor, J w' = J w x w, L' = L [w]x. The rates are Jacobi elliptic
functions of time; the rotation needs one more angle, about the angular momentum, whose rate is a smooth
function of dn. Source: pseudo-rigid bodies, sections 4 and 12.5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipkm1, elliprf

from forceid.errors import DataError
from forceid.principal import cross, cross_matrix
from forceid.pseudorigid.validation import instants, matrix, real_vector, rotation_matrix
from forceid.records import Array

HARMONICS = 7.0  # in units of K/K', the decay of the series: exp(-2 pi 7), below rounding
SERIES_TOGETHER = 4096  # samples of the series at once
SEPARATRIX = 1e-4  # of 1 - m: nearer, ellipj, which is told m, loses digits of cn and dn, below 1e-10 all


@dataclass(frozen=True)
class RigidMotion:
    """omega (time, 3) rad/s, body axes, and rotation L (time, 3, 3), body to world, at time (time,) s."""

    time: Array
    omega: Array
    L: Array


@dataclass(frozen=True)
class EllipticTurn:
    """Principal rates (A cn, B sn, C dn) of phase start + rate t; J (3,) is monotone, up or down.

    coefficients (3,): A, B, C; m: parameter, not modulus; m1 = 1 - m, without its cancellation.
    """

    J: Array
    coefficients: Array
    rate: float
    start: float
    m: float
    m1: float


def free_rotation(inertia: Array, omega0: Array, time: Array, L0: Array | None = None) -> RigidMotion:
    """Motion of a free rigid body in closed form.

    inertia (3, 3) kg m^2, symmetric positive definite, any axes; omega0 (3,) rad/s, body axes, at time 0;
    time (time,) s; L0 (3, 3) rotation at time 0, I if not given. DataError if one of them is none. Near
    a turn about the middle axis the motion is exact for the numbers given, and as sensitive to them as the
    body is. Source: pseudo-rigid bodies, section 4; Landau and Lifshitz, Mechanics, section 37.

    >>> motion = free_rotation(np.diag([2.0, 3, 4]), np.array([1.0, 0, 1]), np.array([0.0, 1.0]))
    >>> motion.omega[1].round(9)
    array([0.84595645, 0.61574637, 0.92618635])
    """
    J, axes = principal_moments(matrix(inertia, "inertia"))
    L0 = np.eye(3) if L0 is None else rotation_matrix(L0, "L0")
    omega0, time = real_vector(omega0, "omega0"), instants(time, rising=False)
    w0 = axes.T @ omega0
    if not ((J - J[[1, 2, 0]]) * w0 * w0[[1, 2, 0]]).any():  # no torque: steady, stable or not
        turned = Rotation.from_rotvec(time[:, None] * omega0).as_matrix()
        return RigidMotion(time, np.broadcast_to(omega0, (len(time), 3)).copy(), L0 @ turned)
    if J[2] * (J[2] - J[1]) * w0[2] ** 2 < J[0] * (J[1] - J[0]) * w0[0] ** 2:  # circles the smallest axis
        turn = np.array([[0.0, 0, 1], [0, -1, 0], [1, 0, 0]])
        J, axes, w0 = J[::-1], axes @ turn, turn @ w0
    body = elliptic_turn(J, w0)
    w, angle = rates_and_angle(body, time)
    n, n0 = unit(J * w), unit(J * w0)
    sense = np.sign(n0[2])
    spin = Rotation.from_rotvec(sense * angle[:, None] * np.array([0.0, 0, 1])).as_matrix()
    inside = tilt(n0, sense) @ spin @ np.swapaxes(tilt(n, sense), -1, -2)
    return RigidMotion(time, w @ axes.T, L0 @ axes @ inside @ axes.T)


def principal_moments(inertia: Array) -> tuple[Array, Array]:
    """Principal moments (3,), rising, and axes (3, 3), a rotation. DataError if inertia is none."""
    symmetric = np.allclose(inertia, np.transpose(inertia), rtol=1e-12)
    if not symmetric or not (np.linalg.eigvalsh(inertia) > 0).all():
        raise DataError(
            "is not a symmetric positive definite (3, 3) matrix", "inertia", "give tr(E) I - E of a body"
        )
    J, axes = np.linalg.eigh(inertia)
    return J, axes * np.linalg.det(axes)


def elliptic_turn(J: Array, w0: Array) -> EllipticTurn:
    """Amplitudes, parameter and phase of rates that start at w0 (3,), of axes J (3,), circling the last.

    J rises, or falls: what is said of the largest moment then holds of the smallest. Differences of the
    invariants 2T and h^2 are formed without cancellation.
    """
    J1, J2, J3 = J
    low = J1 * (J3 - J1) * w0[0] ** 2 + J2 * (J3 - J2) * w0[1] ** 2  # 2T J3 - h^2
    high = J2 * (J2 - J1) * w0[1] ** 2 + J3 * (J3 - J1) * w0[2] ** 2  # h^2 - 2T J1
    gap = J3 * (J3 - J2) * w0[2] ** 2 - J1 * (J2 - J1) * w0[0] ** 2  # h^2 - 2T J2
    A = np.copysign(np.sqrt(low / (J1 * (J3 - J1))), w0[0])
    C = np.copysign(np.sqrt(high / (J3 * (J3 - J1))), w0[2])
    B = np.copysign(np.sqrt(low / (J2 * (J3 - J2))), (J3 - J1) * A * C)
    m1 = max((J3 - J1) * gap / ((J3 - J2) * high), 1e-300)  # 0, on the separatrix, has an endless period
    m = min((J2 - J1) * low / ((J3 - J2) * high), 1.0)
    sn, cn = unit(np.array([w0[1] / B, w0[0] / A])) if low != 0 else (0.0, 1.0)  # A has the sign of w0[0]
    start = float(sn * elliprf(cn * cn, cn * cn + m1 * sn * sn, 1.0))
    rate = float(np.sqrt((J3 - J2) * high / (J1 * J2 * J3)))
    return EllipticTurn(J, np.array([A, B, C]), rate, start, float(m), float(m1))


def rates_and_angle(body: EllipticTurn, time: Array) -> tuple[Array, Array]:
    """Principal rates (time, 3), and the angle (time,) from time 0 about the angular momentum.

    Angle: what turns besides the shortest rotation of the last axis to the unit momentum n; its rate
    (2T/h + w_3)/(1 + n_3), w_3 with the sign of C, is never singular. As a function of dn it is even and
    periodic in the phase, so it is integrated as a cosine series: nothing cancels where the phase goes
    slowly, as the precession less the azimuth of n would.
    """
    A, B, C = body.coefficients
    h = np.sqrt(((body.J * body.coefficients)[[0, 2]] ** 2).sum())
    twice = float((body.J * body.coefficients**2)[[0, 2]].sum())
    period = 2 * float(ellipkm1(body.m1))
    count = int(HARMONICS * period / float(ellipkm1(body.m))) + 8
    even = abs(C) * elliptic(np.linspace(0, period, 2 * count, endpoint=False), body.m, body.m1)[2]
    series = np.fft.rfft((twice / h + even) / (1 + body.J[2] * even / h)).real[:count] / count
    n = 2 * np.pi / period * np.arange(1, count)
    passed = body.rate * time
    half = 0.5 * np.remainder(passed, period)  # the same sines, of arguments that are not large
    waves = [
        np.sin(np.outer(x, n)) * np.cos(np.outer(body.start + x, n)) @ (2 * series[1:] / n)
        for x in np.array_split(half, len(half) // SERIES_TOGETHER + 1)
    ]
    sn, cn, dn = elliptic(body.start + passed, body.m, body.m1)
    return np.stack([A * cn, B * sn, C * dn], -1), 0.5 * series[0] * time + np.concatenate(waves) / body.rate


def elliptic(tau: Array, m: float, m1: float) -> tuple[Array, Array, Array]:
    """sn, cn and dn of tau (...,). m1 = 1 - m."""
    half = 2 * ellipkm1(m1)
    turns = np.round(tau / half)
    sn, cn, dn = (ellipj(tau - turns * half, m) if m1 > SEPARATRIX else landen(tau - turns * half, m1))[:3]
    sign = np.where(turns % 2 == 0, 1.0, -1.0)
    return sign * sn, sign * cn, np.asarray(dn)


def landen(tau: Array, m1: float) -> tuple[Array, Array, Array, Array]:
    """`ellipj` near m = 1, from m1 = 1 - m > 0 and |tau| <= K, by the descending Landen transformation.

    cn and dn come with all their digits also where they are small: from a quarter period on.
    """
    steps = [(1.0, float(np.sqrt(m1)), float(np.sqrt(1 - m1)))]
    while steps[-1][2] > 1e-16 * steps[-1][0]:
        a, b, c = steps[-1]
        mean = (a + b) / 2
        steps.append((mean, float(np.sqrt(a * b)), c * c / (4 * mean)))  # (a - b)/2 would stay at rounding
    quarter = ellipkm1(m1)
    far = np.abs(tau) > quarter / 2
    am = 2.0 ** (len(steps) - 1) * steps[-1][0] * np.where(far, quarter - np.abs(tau), np.abs(tau))
    for a, b, c in steps[:0:-1]:
        sn, cn = np.sin(am), np.cos(am)
        am = (am + np.arctan2(c * sn, np.hypot(a * cn, b * sn))) / 2
    sn, cn, k1 = np.sin(am), np.cos(am), np.sqrt(m1)
    dn = np.sqrt(cn * cn + m1 * sn * sn)
    sn, cn, dn = np.where(far, [cn / dn, k1 * sn / dn, k1 / dn], [sn, cn, dn])
    sign = np.sign(tau)
    return sign * sn, cn, dn, sign * np.arctan2(sn, cn)


def tilt(n: Array, sense: float) -> Array:
    """Shortest rotation (..., 3, 3) of sense e_3 to the unit vector n (..., 3), never opposite to it."""
    e = np.array([0.0, 0, sense])
    turn = cross_matrix(cross(e, n))
    return np.asarray(np.eye(3) + turn + turn @ turn / (1 + sense * n[..., 2])[..., None, None])


def unit(v: Array) -> Array:
    """Direction of v (..., 3), of length 1."""
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))
