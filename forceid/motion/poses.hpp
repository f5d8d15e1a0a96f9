// Poses of frames, eight at a time, one in each vector lane: `fitted` of pose.py, of frames that see the same
// markers. The rotation starts from the largest root of the quartic of Horn's matrix (Theobald 2005).
//
// Compiled once for each kind of processor, with registers of REGISTER doubles.

namespace {
namespace poses {

constexpr int LANES = REGISTER, NEWTON = 50, STEPS = 40; // of a quartic; of a pose, as ITERATIONS
constexpr double THOUSANDTH = 1e-3; // of a standard deviation: a last step beyond it has not arrived
typedef double Lanes __attribute__((vector_size(LANES * 8), may_alias));

INLINE Lanes gathered(const double *const *at, Size i) { // entry i of a frame in each lane
  Lanes out;
  for (int l = 0; l < LANES; ++l) out[l] = at[l][i];
  return out;
}

INLINE Lanes all(double v) { return Lanes{} + v; }
INLINE Lanes magnitude(const Lanes &a) { return a < 0.0 ? -a : a; }
INLINE Lanes root(const Lanes &a) {
  Lanes out;
  for (int l = 0; l < LANES; ++l) out[l] = std::sqrt(a[l]);
  return out;
}

// R (9) of the quaternion q (w, x, y, z), of any size.
INLINE void rotation(const Lanes *q, Lanes *R) {
  const Lanes s = 2.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const Lanes w = q[0], x = q[1], y = q[2], z = q[3];
  R[0] = 1.0 - s * (y * y + z * z), R[1] = s * (x * y - w * z), R[2] = s * (x * z + w * y);
  R[3] = s * (x * y + w * z), R[4] = 1.0 - s * (x * x + z * z), R[5] = s * (y * z - w * x);
  R[6] = s * (x * z - w * y), R[7] = s * (y * z + w * x), R[8] = 1.0 - s * (x * x + y * y);
}

// Quaternion that maximizes tr(R^T G): eigenvector of Horn's matrix to its largest eigenvalue, which is at most
// `bound`.
INLINE void largest(const Lanes *G, const Lanes &bound, Lanes *q) {
  Lanes K[16];
  K[0] = G[0] + G[4] + G[8], K[5] = G[0] - G[4] - G[8], K[10] = G[4] - G[0] - G[8], K[15] = G[8] - G[0] - G[4];
  K[1] = K[4] = G[7] - G[5], K[2] = K[8] = G[2] - G[6], K[3] = K[12] = G[3] - G[1];
  K[6] = K[9] = G[1] + G[3], K[7] = K[13] = G[2] + G[6], K[11] = K[14] = G[5] + G[7];
  const auto minor2 = [&](int a, int b, int i, int j) { // of rows a, b and columns i, j
    return K[4 * a + i] * K[4 * b + j] - K[4 * a + j] * K[4 * b + i];
  };
  Lanes c2 = {}, c0 = {};
  for (int i = 0; i < 9; ++i) c2 -= 2.0 * G[i] * G[i];
  const Lanes c1 = -8.0 * (G[0] * (G[4] * G[8] - G[5] * G[7]) - G[1] * (G[3] * G[8] - G[5] * G[6]) +
                           G[2] * (G[3] * G[7] - G[4] * G[6]));
  c0 = minor2(0, 1, 0, 1) * minor2(2, 3, 2, 3) - minor2(0, 1, 0, 2) * minor2(2, 3, 1, 3) +
       minor2(0, 1, 0, 3) * minor2(2, 3, 1, 2) + minor2(0, 1, 1, 2) * minor2(2, 3, 0, 3) -
       minor2(0, 1, 1, 3) * minor2(2, 3, 0, 2) + minor2(0, 1, 2, 3) * minor2(2, 3, 0, 1);
  Lanes x = bound;
  for (int k = 0; k < NEWTON; ++k) { // from above, where the quartic is convex
    const Lanes value = ((x * x + c2) * x + c1) * x + c0, slope = (4.0 * x * x + 2.0 * c2) * x + c1;
    const Lanes step = value / slope;
    x -= step;
    bool done = true;
    for (int l = 0; l < LANES; ++l) done &= !(std::fabs(step[l]) > 1e-11 * std::fabs(x[l]));
    if (done) break;
  }
  for (int i = 0; i < 4; ++i) K[5 * i] -= x;
  // every column of the adjugate is the eigenvector; the longest has the most digits
  Lanes longest = all(-1);
  for (int a = 0; a < 4; ++a) {
    int row[3];
    for (int i = 0, at = 0; i < 4; ++i)
      if (i != a) row[at++] = i;
    Lanes v[4], size = {};
    for (int b = 0; b < 4; ++b) {
      int c[3];
      for (int i = 0, at = 0; i < 4; ++i)
        if (i != b) c[at++] = i;
      v[b] = K[4 * row[0] + c[0]] * minor2(row[1], row[2], c[1], c[2]) -
             K[4 * row[0] + c[1]] * minor2(row[1], row[2], c[0], c[2]) +
             K[4 * row[0] + c[2]] * minor2(row[1], row[2], c[0], c[1]);
      if ((a + b) % 2) v[b] = -v[b];
      size += v[b] * v[b];
    }
    for (int b = 0; b < 4; ++b) q[b] = size > longest ? v[b] : q[b];
    longest = size > longest ? size : longest;
  }
}

// center, rotation, covariance, residual of `frames`, and whether each has arrived. nodes: those that these frames
// see, with shape (node, 3), shape begin (node, 3) and weight (node of nodes,) of the fit that begins, gain A (6, channel) and covariance C (6, 6).
Poses fitted(Array position_, Index frames_, Index nodes_, Array shape_, Array begin_, Array weight_, Array A_,
             Array C_) {
  const Size frames = frames_.shape(0), N = shape_.shape(0);
  const int k = static_cast<int>(nodes_.shape(0));
  Out center_({frames, 3}), R_({frames, 3, 3}), cov_({frames, 6, 6}), residual_({frames, N, 3}), arrived_({frames});
  double *center = center_.data(), *R_out = R_.data(), *cov = cov_.data(), *residual = residual_.data(),
         *arrived = arrived_.data();
  const double *position = position_.data(), *shape = shape_.data(), *begin = begin_.data(), *A = A_.data(), *C = C_.data();
  const Size *frame = frames_.data(), *node = nodes_.data();
  std::vector<double> w(weight_.data(), weight_.data() + k);
  double total = 0.0, mean[3] = {}, middle[3] = {}, spread = 0.0;
  for (int i = 0; i < k; ++i) {
    total += w[i];
    for (int a = 0; a < 3; ++a) mean[a] += w[i] * shape[3 * node[i] + a], middle[a] += w[i] * begin[3 * node[i] + a];
  }
  for (int a = 0; a < 3; ++a) mean[a] /= total, middle[a] /= total;
  for (int i = 0; i < k; ++i)
    for (int a = 0; a < 3; ++a) spread += w[i] * std::pow(begin[3 * node[i] + a] - middle[a], 2);
  std::vector<Lanes, Aligned<Lanes>> x(3 * k), e(3 * k);
  for (Size first = 0; first < frames; first += LANES) {
    const double *at[LANES];
    for (int l = 0; l < LANES; ++l) at[l] = position + frame[std::min(first + l, frames - 1)] * N * 3;
    Lanes c[3] = {}, G[9] = {}, R[9], q[4] = {}, bound = {}, last = {};
    for (int i = 0; i < k; ++i)
      for (int a = 0; a < 3; ++a) {
        const Size entry = 3 * node[i] + a;
        x[3 * i + a] = gathered(at, entry);
        c[a] += w[i] * x[3 * i + a];
      }
    for (int a = 0; a < 3; ++a) c[a] /= total;
    for (int i = 0; i < k; ++i)
      for (int a = 0; a < 3; ++a) {
        const Lanes rho = w[i] * (x[3 * i + a] - c[a]);
        bound += rho * (x[3 * i + a] - c[a]);
        for (int b = 0; b < 3; ++b) G[3 * a + b] += rho * (begin[3 * node[i] + b] - middle[b]);
      }
    largest(G, 0.5 * (bound + spread), q);
    rotation(q, R);
    for (int a = 0; a < 3; ++a) c[a] -= R[3 * a] * mean[0] + R[3 * a + 1] * mean[1] + R[3 * a + 2] * mean[2];
    const auto errors = [&] { // R^T (x - c) - shape
      for (int i = 0; i < k; ++i) {
        const Lanes r[3] = {x[3 * i] - c[0], x[3 * i + 1] - c[1], x[3 * i + 2] - c[2]};
        for (int b = 0; b < 3; ++b)
          e[3 * i + b] = R[b] * r[0] + R[3 + b] * r[1] + R[6 + b] * r[2] - shape[3 * node[i] + b];
      }
    };
    Lanes moving = all(1.0);
    for (int step = 0; step < STEPS; ++step) { // Newton: a body that is strained turns about the shape that it has
      errors();
      Lanes d[6] = {}, M[18] = {};
      for (int n = 0; n < k; ++n) {
        const Lanes *r = e.data() + 3 * n;
        for (int i = 0; i < 6; ++i) {
          const double *g = A + i * 3 * k + 3 * n;
          d[i] += g[0] * r[0] + g[1] * r[1] + g[2] * r[2];
          M[3 * i] += g[2] * r[1] - g[1] * r[2]; // e x lever
          M[3 * i + 1] += g[0] * r[2] - g[2] * r[0];
          M[3 * i + 2] += g[1] * r[0] - g[0] * r[1];
        }
      }
      Lanes *T = M + 9, w[3];
      for (int a = 0; a < 3; ++a) T[4 * a] += 1.0;
      const Lanes x0 = T[4] * T[8] - T[5] * T[7], x1 = T[5] * T[6] - T[3] * T[8], x2 = T[3] * T[7] - T[4] * T[6];
      const Lanes scale = moving / (T[0] * x0 + T[1] * x1 + T[2] * x2);
      w[0] = x0 * d[3] + (T[2] * T[7] - T[1] * T[8]) * d[4] + (T[1] * T[5] - T[2] * T[4]) * d[5];
      w[1] = x1 * d[3] + (T[0] * T[8] - T[2] * T[6]) * d[4] + (T[2] * T[3] - T[0] * T[5]) * d[5];
      w[2] = x2 * d[3] + (T[1] * T[6] - T[0] * T[7]) * d[4] + (T[0] * T[4] - T[1] * T[3]) * d[5];
      for (int a = 0; a < 3; ++a) d[3 + a] = scale * w[a];
      for (int a = 0; a < 3; ++a)
        d[a] = moving * d[a] - (M[3 * a] * d[3] + M[3 * a + 1] * d[4] + M[3 * a + 2] * d[5]);
      for (int a = 0; a < 3; ++a) c[a] += R[3 * a] * d[0] + R[3 * a + 1] * d[1] + R[3 * a + 2] * d[2];
      // R exp([d]x), by the quaternion of a small turn, to the fifth order
      const Lanes square = d[3] * d[3] + d[4] * d[4] + d[5] * d[5];
      const Lanes sine = 0.5 - square * (1.0 / 48 - square / 3840.0), cosine = 1.0 - square * (0.125 - square / 384.0);
      const Lanes turn[4] = {cosine, sine * d[3], sine * d[4], sine * d[5]};
      Lanes E[9], next[9];
      rotation(turn, E);
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) next[3 * a + b] = R[3 * a] * E[b] + R[3 * a + 1] * E[3 + b] + R[3 * a + 2] * E[6 + b];
      std::copy(next, next + 9, R);
      last = Lanes{};
      for (int i = 0; i < 6; ++i) {
        const Lanes part = d[i] * d[i] / C[7 * i];
        last = part > last ? part : last;
      }
      if (!step) continue;
      bool done = true;
      for (int l = 0; l < LANES; ++l) {
        moving[l] = last[l] > THOUSANDTH * THOUSANDTH;
        done &= !moving[l];
      }
      if (done) break;
    }
    errors();
    Lanes turned[36], turning[36];
    for (int p = 0; p < 2; ++p)
      for (int a = 0; a < 3; ++a)
        for (int j = 0; j < 6; ++j)
          turned[(3 * p + a) * 6 + j] =
              R[3 * a] * C[18 * p + j] + R[3 * a + 1] * C[18 * p + 6 + j] + R[3 * a + 2] * C[18 * p + 12 + j];
    for (int i = 0; i < 6; ++i)
      for (int p = 0; p < 2; ++p)
        for (int b = 0; b < 3; ++b)
          turning[6 * i + 3 * p + b] = turned[6 * i + 3 * p] * R[3 * b] + turned[6 * i + 3 * p + 1] * R[3 * b + 1] +
                                       turned[6 * i + 3 * p + 2] * R[3 * b + 2];
    for (int l = 0; l < LANES && first + l < frames; ++l) {
      const Size f = first + l;
      for (int i = 0; i < 3; ++i) center[3 * f + i] = c[i][l];
      for (int i = 0; i < 9; ++i) R_out[9 * f + i] = R[i][l];
      for (int i = 0; i < 36; ++i) cov[36 * f + i] = turning[i][l];
      arrived[f] = last[l] <= THOUSANDTH * THOUSANDTH;
      double *to = residual + f * N * 3;
      if (k == N) {
        for (int i = 0; i < 3 * k; ++i) to[i] = e[i][l];
      } else {
        for (Size i = 0; i < 3 * N; ++i) to[i] = std::nan("");
        for (int i = 0; i < k; ++i)
          for (int a = 0; a < 3; ++a) to[3 * node[i] + a] = e[3 * i + a][l];
      }
    }
  }
  return std::make_tuple(center_, R_, cov_, residual_, arrived_);
}

} // namespace poses
} // namespace
