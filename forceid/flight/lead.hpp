// One step of a flight that is followed as it goes: written in numpy in estimation/live/turning.py, step for step the
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

// States, rotation, F, Q and rows behind the step. x (state,): theta, H and the chain of the moment, along axes; R
// (3, 3); F, Q (state, state): of the chain; J (2, 3, 3) and h (2, 3) before the step and after it; least: moment of
// inertia; SUBSTEP: rad; rows (3, state) read the moment, world axes. Of a load that turns with the body: own (3, 3),
// its axes there, n of its states, turn (3,) over the step, read (3, state) along axes of the body; else own is empty.
Five lead(Array x, Array R, Array F_given, Array Q_given, Array axes, Array J, Array h, double step, double least,
          double substep, Array rows, Array turn, Array own, Size states, Array read, double small) {
  using flight::rotation_rows;
  const Size n = x.shape(0);
  Out away({n}), F({n, n}), Q({n, n}), F_next({n, n}), Q_next({n, n}), rows_next({3, n});
  Out turns({2, 3, 3}), course({3, 2, 3}), J_({4, 1, 3, 3}), h_({4, 1, 3});
  std::copy(F_given.data(), F_given.data() + n * n, F.data());
  std::copy(Q_given.data(), Q_given.data() + n * n, Q.data());
  if (own.size()) {
    keep_to_body(F.data(), Q.data(), n, turn.data(), R.data(), own.data(), states, small);
    double pushed[3] = {}; // by states that stand in the body
    for (int i = 0; i < 3; ++i)
      for (Size j = 6; j < n; ++j) pushed[i] += F.data()[(3 + i) * n + j] * x.data()[j];
    lean(pushed, F.data() + 3 * n, n);
  }
  for (Size i = 0; i < n; ++i) {
    away.data()[i] = 0.0;
    for (Size j = 0; j < n; ++j) away.data()[i] += F.data()[i * n + j] * x.data()[j];
  }
  double along_axes[3][3], over[3][3], world[3][3] = {}; // H, and what the moment adds to Y and H
  for (int a = 0; a < 3; ++a) {
    along_axes[0][a] = x.data()[3 + a];
    along_axes[1][a] = away.data()[a] - step * along_axes[0][a];
    along_axes[2][a] = away.data()[3 + a] - along_axes[0][a];
  }
  for (int r = 0; r < 3; ++r)
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) world[r][a] += axes.data()[3 * a + b] * along_axes[r][b];
  double spin = 0.0, inside = 0.0;
  for (int a = 0; a < 3; ++a) {
    over[0][a] = world[0][a];
    over[1][a] = 6.0 * world[1][a] / (step * step) - 2.0 * world[2][a] / step;
    over[2][a] = 6.0 * world[2][a] / (step * step) - 12.0 * world[1][a] / (step * step * step);
    spin += world[0][a] * world[0][a];
    inside += h.data()[a] * h.data()[a];
  }
  for (int r = 0; r < 3; ++r)
    for (int twice = 0; twice < 2; ++twice) std::copy(over[r], over[r] + 3, course.data() + 6 * r + 3 * twice);
  for (int twice = 0; twice < 2; ++twice) std::copy(R.data(), R.data() + 9, turns.data() + 9 * twice);
  const auto cubic = [&](const Array &a, Out &out, int size) {
    std::fill(out.data(), out.data() + 2 * size, 0.0);
    for (int i = 0; i < size; ++i) {
      out.data()[2 * size + i] = (a.data()[size + i] - a.data()[i]) / step;
      out.data()[3 * size + i] = a.data()[i];
    }
  };
  cubic(J, J_, 9);
  cubic(h, h_, 3);
  const int substeps = 1 + static_cast<int>((std::sqrt(spin) + std::sqrt(inside)) / least * step / substep);
  const double *at = course.data();
  const Size kind = 0;
  const Buffer still(2 * n, 0.0);
  const auto [top, noise, turn_by] = rotation_rows(
      Array(&step, {1}), Array(turns.data(), {2, 3, 3}), Array(at, {2, 3}), Array(at + 6, {2, 3}),
      Array(at + 12, {2, 3}), Array(J_.data(), {4, 1, 3, 3}), Array(h_.data(), {4, 1, 3}), substeps,
      Array(F.data(), {1, n, n}), Array(Q.data(), {1, n, n}), Index(&kind, {1}), axes, Array(still.data(), {2, n}));
  std::copy(F.data(), F.data() + n * n, F_next.data());
  std::copy(Q.data(), Q.data() + n * n, Q_next.data());
  for (int i = 0; i < 3; ++i)
    for (Size j = 0; j < n; ++j) {
      F_next.data()[i * n + j] = top.data()[i * n + j];
      Q_next.data()[i * n + j] = Q_next.data()[j * n + i] = noise.data()[i * n + j];
    }
  std::fill(away.data(), away.data() + 3, 0.0);
  Out R_next = flight::turned(Array(turn_by.data(), {1, 3}), Array(R.data(), {1, 3, 3}));
  std::copy(rows.data(), rows.data() + 3 * n, rows_next.data());
  if (own.size()) {
    double pushed[3] = {};
    for (int i = 0; i < 3; ++i)
      for (Size j = 0; j < n; ++j) {
        for (int k = 0; k < 3; ++k) rows_next.data()[i * n + j] += R_next.data()[3 * i + k] * read.data()[k * n + j];
        pushed[i] += rows_next.data()[i * n + j] * away.data()[j];
      }
    lean(pushed, rows_next.data(), n);
  }
  return std::make_tuple(away, R_next, F_next, Q_next, rows_next);
}

} // namespace lead
} // namespace
