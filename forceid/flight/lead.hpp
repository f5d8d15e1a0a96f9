// One step of a flight that is followed as it goes: written in numpy in estimation/live/turning.py and loads.py, step for step the
// same. Row-major doubles.

namespace {
namespace lead {

INLINE void cross(const double *a, const double *B, double *out) { // [a]x B (3, 3)
  for (int j = 0; j < 3; ++j) {
    out[j] = a[1] * B[6 + j] - a[2] * B[3 + j];
    out[3 + j] = a[2] * B[j] - a[0] * B[6 + j];
    out[6 + j] = a[0] * B[3 + j] - a[1] * B[j];
  }
}

// rows (3) of a (size apart) from column `from` up to n: block (3, 3) times what is there
INLINE void times(const double *block, double *a, Size size, Size from, Size n) {
  for (Size j = from; j < n; ++j) {
    const double x = a[j], y = a[size + j], z = a[2 * size + j];
    for (int i = 0; i < 3; ++i) a[i * size + j] = block[3 * i] * x + block[3 * i + 1] * y + block[3 * i + 2] * z;
  }
}

// F and Q (size, size) of a load, n states of which turn with a body that stands as R (3, 3), by the rotation vector
// turn (3,) over the step; `small` rad: a turn that bends nothing.
void keep_to_body(double *F, double *Q, Size size, const double *turn, const double *R, const double *own, Size n,
                  double small) {
  double at[9] = {}, once[9], twice[9], early[9], mean[9];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) at[3 * i + j] += R[3 * i + k] * own[3 * k + j];
  const double by = std::sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]);
  double a = 1.0 / 2, b = 1.0 / 6, c = 1.0 / 12;
  if (by > small) {
    a = (1 - std::cos(by)) / (by * by), b = (by - std::sin(by)) / (by * by * by);
    c = (1 - 2 * a) / (by * by);
  }
  cross(turn, at, once);
  cross(turn, once, twice);
  for (int i = 0; i < 9; ++i) {
    early[i] = at[i] + 2 * b * once[i] + c * twice[i];
    mean[i] = at[i] + a * once[i] + b * twice[i];
  }
  times(early, F, size, 6, n);
  times(mean, F + 3 * size, size, 6, n);
  times(early, Q, size, 0, n);
  times(mean, Q + 3 * size, size, 0, n);
  for (Size i = 0; i < n; ++i) { // from the right
    double *row = Q + i * size, left[6];
    for (int p = 0; p < 6; ++p) {
      const double *block = p < 3 ? early + 3 * p : mean + 3 * (p - 3), *old = row + (p < 3 ? 0 : 3);
      left[p] = block[0] * old[0] + block[1] * old[1] + block[2] * old[2];
    }
    std::copy(left, left + 6, row);
  }
}

Two along(Array F, Array Q, Array turn, Array R, Array own, Size n, double small) {
  const Size size = F.shape(0);
  Out F_next({size, size}), Q_next({size, size});
  std::copy(F.data(), F.data() + size * size, F_next.data());
  std::copy(Q.data(), Q.data() + size * size, Q_next.data());
  keep_to_body(F_next.data(), Q_next.data(), size, turn.data(), R.data(), own.data(), n, small);
  return {F_next, Q_next};
}

// -[v]x into the first three columns of three rows, `size` apart
INLINE void lean(const double *v, double *rows, Size size) {
  const double z[9] = {0.0, v[2], -v[1], -v[2], 0.0, v[0], v[1], -v[0], 0.0};
  for (int i = 0; i < 3; ++i) std::copy(z + 3 * i, z + 3 * i + 3, rows + i * size);
}

// What a step leads to: states and rotation, F and Q (state, state) with the rotation error, and the rows (3, state)
// that read the moment behind it.
struct Led {
  Buffer x, F, Q, rows;
  double R[9];
};

// a (3, 3) B (3, 3) C (3, 3)^T
INLINE void turned_both(const double *a, const double *B, const double *C, double *out) {
  double half[9];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      half[3 * i + j] = a[3 * i] * B[j] + a[3 * i + 1] * B[3 + j] + a[3 * i + 2] * B[6 + j];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      out[3 * i + j] = half[3 * i] * C[3 * j] + half[3 * i + 1] * C[3 * j + 1] + half[3 * i + 2] * C[3 * j + 2];
}

// x (state,): theta, H and the chain of the moment, along axes (3, 3); R (3, 3); F, Q (state, state): of the chain; J
// (3, 3) and h (3,) half way; least: moment of inertia; substep: rad; rows (3, state) read the moment, world axes. Of a
// load that turns with the body by the rotation vector turn (3,): own (3, 3), its axes there, n of its states, read
// (3, state) along axes of the body; else own is empty.
Led lead(const Array &x, const double *R, const Array &F_given, const Array &Q_given, const double *axes,
         const double *J, const double *h, double step, double least, double substep, const Array &rows,
         const double *turn, const Array &own, Size states, const Array &read, double small) {
  using namespace flight;
  const Size n = x.shape(0);
  Led led{Buffer(n), Buffer(F_given.data(), F_given.data() + n * n), Buffer(Q_given.data(), Q_given.data() + n * n),
          Buffer(rows.data(), rows.data() + 3 * n), {}};
  double *away = led.x.data(), *F = led.F.data(), *Q = led.Q.data();
  if (own.size()) {
    keep_to_body(F, Q, n, turn, R, own.data(), states, small);
    double pushed[3] = {}; // by states that stand in the body
    for (int i = 0; i < 3; ++i)
      for (Size j = 6; j < n; ++j) pushed[i] += F[(3 + i) * n + j] * x.data()[j];
    lean(pushed, F + 3 * n, n);
  }
  for (Size i = 0; i < n; ++i)
    for (Size j = 0; j < n; ++j) away[i] += F[i * n + j] * x.data()[j];
  double along_axes[3][3], over[3][3], world[3][3] = {}; // H, and what the moment adds to Y and H
  for (int a = 0; a < 3; ++a) {
    along_axes[0][a] = x.data()[3 + a];
    along_axes[1][a] = away[a] - step * along_axes[0][a];
    along_axes[2][a] = away[3 + a] - along_axes[0][a];
  }
  for (int r = 0; r < 3; ++r)
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) world[r][a] += axes[3 * a + b] * along_axes[r][b];
  double spin = 0.0, inside = 0.0, still[12 * 4] = {};
  for (int a = 0; a < 3; ++a) {
    over[0][a] = world[0][a];
    over[1][a] = 6.0 * world[1][a] / (step * step) - 2.0 * world[2][a] / step;
    over[2][a] = 6.0 * world[2][a] / (step * step) - 12.0 * world[1][a] / (step * step * step);
    spin += world[0][a] * world[0][a];
    inside += h[a] * h[a];
  }
  std::copy(J, J + 9, still + 27); // cubics of which the last number is not zero alone
  std::copy(h, h + 3, still + 45);
  const int substeps = 1 + static_cast<int>((std::sqrt(spin) + std::sqrt(inside)) / least * step / substep);
  const Course course{Array(&step, {1}), Array(R, {1, 3, 3}), Array(over[0], {1, 3}), Array(over[1], {1, 3}),
                      Array(over[2], {1, 3}), Array(still, {4, 1, 3, 3}), Array(still + 36, {4, 1, 3}), substeps};
  const Size alone[LANES] = {};
  Matrix end, theta, by[3], stood;
  course.turn(alone, end, theta, by);
  for (int i = 0; i < 9; ++i) {
    led.R[i] = end.a[i][0];
    stood.a[i] = all(axes[i]);
  }
  const Lanes inverse_step = all(1.0 / step);
  const Matrix by_Y = (by[1] + by[2] * -inverse_step) * (6.0 * inverse_step * inverse_step) * stood;
  const Matrix by_momentum = (by[2] * (3.0 * inverse_step) + by[1] * all(-2)) * inverse_step * stood;
  const Matrix start = by[0] * stood;
  double both[18]; // (3, 6)
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      both[6 * i + j] = by_Y.a[3 * i + j][0];
      both[6 * i + 3 + j] = by_momentum.a[3 * i + j][0];
    }
  Buffer top(3 * n, 0.0), noise(3 * n, 0.0);
  for (int i = 0; i < 3; ++i)
    for (int l = 0; l < 6; ++l)
      for (Size j = 0; j < n; ++j) {
        top[i * n + j] += both[6 * i + l] * F[l * n + j];
        noise[i * n + j] += both[6 * i + l] * Q[l * n + j];
      }
  for (int i = 0; i < 3; ++i) {
    double square[3] = {};
    for (int j = 0; j < 3; ++j) {
      top[i * n + j] = theta.a[3 * i + j][0];
      top[i * n + 3 + j] = start.a[3 * i + j][0];
      for (int l = 0; l < 6; ++l) square[j] += noise[i * n + l] * both[6 * j + l];
    }
    std::copy(square, square + 3, noise.data() + i * n);
  }
  for (int i = 0; i < 3; ++i)
    for (Size j = 0; j < n; ++j) {
      F[i * n + j] = top[i * n + j];
      Q[i * n + j] = Q[j * n + i] = noise[i * n + j];
    }
  std::fill(away, away + 3, 0.0);
  if (own.size()) {
    double pushed[3] = {};
    for (int i = 0; i < 3; ++i)
      for (Size j = 0; j < n; ++j) {
        for (int k = 0; k < 3; ++k) led.rows[i * n + j] += led.R[3 * i + k] * read.data()[k * n + j];
        pushed[i] += led.rows[i * n + j] * away[j];
      }
    lean(pushed, led.rows.data(), n);
  }
  return led;
}

// One frame more of a moment that is followed (see kalman/fixed_lag.hpp), and the rotation behind it: that which the
// step leads to, and then by what the frame shows. now: J and h before the step, then: after it; turns: whether some
// load keeps to the body; seen (3, 3): the rotation that the frame shows, with cov (3, 3), body axes, empty for none.
// Returned beside what is followed: R (3, 3), noise of the frame (3, 3), world axes, and what turned the body (3,).
Onward onward(Array P, Array gain, Array noise_before, Array y, Array C, Array var, Array x, Array R_, Array F, Array Q,
              Array axes, Array J_now, Array h_now, Array J_then, Array h_then, double step, double least,
              double substep, Array rows, Array own, Size states, Array read, double small, bool turns, Array seen,
              Array cov, double most) {
  using namespace flight;
  const Size n = x.shape(0);
  const double *R = R_.data();
  Out R_next({3, 3}), noise({3, 3}), turn_({3});
  double J[9], h[3], *turn = turn_.data(), *at = R_next.data();
  for (int i = 0; i < 9; ++i) J[i] = 0.5 * (J_now.data()[i] + J_then.data()[i]);
  for (int i = 0; i < 3; ++i) h[i] = 0.5 * (h_now.data()[i] + h_then.data()[i]);
  std::fill(turn, turn + 3, 0.0);
  if (turns) { // at the spin before the step
    double H[3] = {}, body[3], spin[3], inverse[9];
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) H[a] += axes.data()[3 * a + b] * x.data()[3 + b];
    for (int a = 0; a < 3; ++a) body[a] = R[a] * H[0] + R[3 + a] * H[1] + R[6 + a] * H[2] - h_now.data()[a];
    fixed_lag::invert(J_now.data(), inverse);
    for (int a = 0; a < 3; ++a)
      spin[a] = inverse[3 * a] * body[0] + inverse[3 * a + 1] * body[1] + inverse[3 * a + 2] * body[2];
    for (int a = 0; a < 3; ++a) turn[a] = step * (R[3 * a] * spin[0] + R[3 * a + 1] * spin[1] + R[3 * a + 2] * spin[2]);
  }
  const Led led = lead(x, R, F, Q, axes.data(), J, h, step, least, substep, rows, turn, own, states, read, small);
  const bool shown = seen.size() > 0;
  double off[3] = {};
  if (shown) {
    double apart[9] = {};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        for (int k = 0; k < 3; ++k) apart[3 * i + j] += seen.data()[3 * i + k] * led.R[3 * j + k];
    logarithm(apart, off);
    turned_both(seen.data(), cov.data(), seen.data(), noise.data());
  } else {
    std::copy(noise_before.data(), noise_before.data() + 9, noise.data());
  }
  auto [x_next, P_next, K, y_next, C_next, var_next, far] = fixed_lag::follow(
      P, gain, noise_before, y, C, var, Array(led.F.data(), {n, n}), Array(led.Q.data(), {n, n}),
      Array(led.x.data(), {n}), Array(led.rows.data(), {3, n}), Array(off, {shown ? 3 : 0}),
      Array(noise.data(), {3, 3}), most);
  std::copy(led.R, led.R + 9, at);
  if (K.size()) { // the reference takes the error
    const Size alone[LANES] = {};
    const Matrix R_seen = exponential(vector(Samples(x_next.data(), 3, alone))) * matrix(Samples(led.R, 9, alone));
    for (int i = 0; i < 9; ++i) at[i] = R_seen.a[i][0];
    std::fill(x_next.data(), x_next.data() + 3, 0.0);
  }
  return std::make_tuple(x_next, P_next, K, y_next, C_next, var_next, far, R_next, noise, turn_);
}

} // namespace lead
} // namespace
