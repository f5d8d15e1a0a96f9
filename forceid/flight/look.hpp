// What one frame shows of a body that swings: written in numpy in estimation/live/sight.py, step for step the same.
// Row-major doubles.

namespace {
namespace look {

// y (rows,) += A (rows, m) x
INLINE void add(const double *A, const double *x, double *y, Size rows, Size m) {
  for (Size i = 0; i < rows; ++i) {
    double sum = 0.0;
    for (Size j = 0; j < m; ++j) sum += A[i * m + j] * x[j];
    y[i] += sum;
  }
}

// Center (3,), rotation (3, 3), states of the amplitudes, inertia J (3, 3) and momentum h (3,) that they make, and
// whether the pose arrived. position (node, 3); the fit of the pose as of motion/poses.hpp; share (node,) of the mass,
// empty for none; of the states x (state,) of the amplitudes, `each` of a mode: onward (state, state), gain (state,
// channel), leak (6, state); inertia (mode + 1, mode + 1, 3, 3), momentum (mode + 1, mode, 3), inside (3,).
Looked look(Array position, Index nodes, Array shape, Array weight, Array A, Array C, Array share, Array x_, Array onward,
            Array gain, Array leak, Array inertia, Array momentum, Array inside, Size each) {
  const Size frame = 0, N = position.shape(0), k = nodes.shape(0), states = x_.size(), m = momentum.shape(1);
  const auto [center, R_, cov, residual, arrived] =
      poses::fitted(Array(position.data(), {1, N, 3}), Index(&frame, {1}), nodes, shape, shape, weight, A, C);
  Out mean({3}), R_next({3, 3}), x({states}), J({3, 3}), h({3});
  double off[6] = {}, *c = mean.data(), *R = R_.data();
  std::fill(x.data(), x.data() + states, 0.0);
  if (states) {
    Buffer left(3 * k);
    for (Size i = 0; i < k; ++i) std::copy_n(residual.data() + 3 * nodes.data()[i], 3, left.data() + 3 * i);
    add(onward.data(), x_.data(), x.data(), states, states);
    add(gain.data(), left.data(), x.data(), states, 3 * k);
    add(leak.data(), x.data(), off, 6, states);
  }
  if (share.size()) {
    std::fill(c, c + 3, 0.0);
    for (Size i = 0; i < N; ++i)
      if (const double part = share.data()[i]; part != 0.0)
        for (int a = 0; a < 3; ++a) c[a] += part * position.data()[3 * i + a];
  } else {
    std::copy_n(center.data(), 3, c);
    add(R, off, c, 3, 3);
  }
  std::copy_n(R, 9, R_next.data());
  if (states) {
    using namespace flight;
    double by[3] = {};
    add(R, off + 3, by, 3, 3);
    const Size alone[LANES] = {};
    const Matrix turned = exponential(vector(Samples(by, 3, alone))) * matrix(Samples(R, 9, alone));
    for (int i = 0; i < 9; ++i) R_next.data()[i] = turned.a[i][0];
  }
  Buffer a(m + 1, 1.0);
  for (Size i = 0; i < m; ++i) a[i + 1] = x.data()[i * each];
  std::fill(J.data(), J.data() + 9, 0.0);
  std::copy_n(inside.data(), 3, h.data());
  for (Size i = 0; i <= m; ++i) {
    for (Size j = 0; j <= m; ++j)
      for (int e = 0; e < 9; ++e) J.data()[e] += a[i] * a[j] * inertia.data()[9 * ((m + 1) * i + j) + e];
    for (Size j = 0; j < m; ++j)
      for (int e = 0; e < 3; ++e) h.data()[e] += a[i] * x.data()[j * each + 1] * momentum.data()[3 * (m * i + j) + e];
  }
  return std::make_tuple(mean, R_next, x, J, h, arrived.data()[0] == 1.0);
}

} // namespace look
} // namespace
