"""Bodies with published mass and stiffness, assembled here so that no code is shared with the package."""

import numpy as np

# planar boomerang: three masses, two springs along the arms
BOOMERANG_MASS = np.array([0.03, 0.05, 0.04])
BOOMERANG = np.array([[0.0, 0.0], [0.3, 0.0], [0.3, -0.25]])
BOOMERANG_FORCE = np.array([0.4, -0.2, 0.1, 0.7, -0.3, 0.5])
BOOMERANG_DISPLACEMENT = np.array([0.001, -0.0005, 0.0014, 0.0003, -0.0002, 0.0009])


def boomerang_stiffness(hinge=0.0):
    strain = np.zeros((3, 6))
    strain[0, [0, 2]] = -1, 1
    strain[1, [3, 5]] = -1, 1
    t = []
    for d in (BOOMERANG[1] - BOOMERANG[0], BOOMERANG[2] - BOOMERANG[1]):
        t.append(np.array([-d[1], d[0]]) / (d @ d))
    strain[2] = np.concatenate([t[0], -t[0] - t[1], t[1]])
    return strain.T @ np.diag([2000.0, 1500.0, hinge]) @ strain


def boomerang_acceleration():
    inertial = BOOMERANG_FORCE - boomerang_stiffness() @ BOOMERANG_DISPLACEMENT
    return (inertial / np.repeat(BOOMERANG_MASS, 2)).reshape(3, 2)


# space truss, and the same lines as a welded frame
TRUSS = np.array(
    [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.1, 0.1, 1.0],
        [0.9, 0.1, 1.0],
        [0.9, 0.9, 1.1],
        [0.1, 0.9, 1.0],
        [0.5, 0.4, 2.0],
    ]
)
BARS = [[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 5], [2, 6], [3, 7], [4, 5], [5, 6], [6, 7], [7, 4]]
BARS += [[0, 5], [1, 6], [2, 7], [3, 4], [4, 6], [0, 2], [4, 8], [5, 8], [6, 8], [7, 8]]
RHO_A, EA = 1.08, 2.8e7


def assemble(position, bars, element, dof):
    total = np.zeros((len(position) * dof,) * 2)
    for i, j in bars:
        rows = np.r_[i * dof : (i + 1) * dof, j * dof : (j + 1) * dof]
        total[np.ix_(rows, rows)] += element(position[j] - position[i])
    return total


def truss_mass(position=TRUSS):
    def element(d):
        return RHO_A * np.linalg.norm(d) / 6 * np.kron([[2, 1], [1, 2]], np.eye(len(d)))

    return assemble(position, BARS, element, position.shape[1])


def bar_stiffness(d):
    n = d / np.linalg.norm(d)
    return EA / np.linalg.norm(d) * np.kron([[1, -1], [-1, 1]], np.outer(n, n))


def truss_stiffness(position=TRUSS):
    return assemble(position, BARS, bar_stiffness, 3)


def rods(position=TRUSS, about=(0.0, 0.0, 0.0)):
    """Mass, center and inertia about a point of the bars as thin rigid rods, in closed form."""
    m, first, J = 0.0, np.zeros(3), np.zeros((3, 3))
    for i, j in BARS:
        d = position[j] - position[i]
        length, r = np.linalg.norm(d), (position[i] + position[j]) / 2
        mass = RHO_A * length
        a = r - np.asarray(about)
        m, first = m + mass, first + mass * r
        J += mass / 12 * (d @ d * np.eye(3) - np.outer(d, d)) + mass * (a @ a * np.eye(3) - np.outer(a, a))
    return m, first / m, J


WIDTH, HEIGHT, DENSITY = 0.02, 0.03, 2700.0


def beam_mass(d):
    """Consistent Euler-Bernoulli mass of a welded beam, 12 dof; rotary inertia in torsion only."""
    length = np.linalg.norm(d)
    m = DENSITY * WIDTH * HEIGHT * length
    polar = DENSITY * (WIDTH * HEIGHT**3 + HEIGHT * WIDTH**3) / 12 * length
    local = np.zeros((12, 12))
    for pair, value in (([0, 6], m), ([3, 9], polar)):
        local[np.ix_(pair, pair)] += value / 6 * np.array([[2, 1], [1, 2]])
    for pair, s in (([1, 5, 7, 11], 1), ([2, 4, 8, 10], -1)):  # (v, theta_z) and (w, -theta_y)
        q = s * length
        local[np.ix_(pair, pair)] += (
            m
            / 420
            * np.array(
                [
                    [156, 22 * q, 54, -13 * q],
                    [22 * q, 4 * q * q, 13 * q, -3 * q * q],
                    [54, 13 * q, 156, -22 * q],
                    [-13 * q, -3 * q * q, -22 * q, 4 * q * q],
                ]
            )
        )
    e1 = d / length
    e2 = np.cross(np.eye(3)[np.argmin(np.abs(e1))], e1)
    e2 /= np.linalg.norm(e2)
    T = np.kron(np.eye(4), np.stack([e1, e2, np.cross(e1, e2)]))
    return T.T @ local @ T


def frame_mass(position=TRUSS):
    return assemble(position, BARS, beam_mass, 6)
