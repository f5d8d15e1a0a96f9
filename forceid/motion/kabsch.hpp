// The turn of every frame that brings a shape nearest to its markers, a frame in each vector lane: `fit_rotation`.
//
// The largest root of the quartic of Horn's matrix, then Newton's steps of S = R^T G to the turn after which it is
// symmetric. Where markers lie so thin that rounding of G costs a hundred eps of the turn, the skew part of S is
// summed from the markers, whose distances from the turned shape are taken in twice the digits.
//
// Compiled once for each kind of processor, with registers of REGISTER doubles.

UNCONTRACTED

namespace {
namespace kabsch {

using twofold::Lanes, twofold::LANES;

// vee(S - S^T) = sum w arm x (R^T rho - arm), arm and rho from the means: what these err by alike adds up to nothing.
__attribute__((noinline)) void skew_part(const double *X, int N, const Lanes *x, const Lanes *w, const Lanes *c,
                                         const Lanes *mean, const Lanes *R, Lanes *slope) {
  using twofold::Twofold;
  const auto apart = [](const Lanes &a, const Lanes &b) { return Twofold{a, Lanes{}} - Twofold{b, Lanes{}}; };
  for (int a = 0; a < 3; ++a) slope[a] = Lanes{};
  for (int n = 0; n < N; ++n) {
    Twofold arm[3], rho[3];
    Lanes e[3], lever[3];
    for (int a = 0; a < 3; ++a) {
      arm[a] = apart(twofold::all(X[3 * n + a]), mean[a]);
      rho[a] = apart(x[3 * n + a], c[a]);
      lever[a] = w[n] * arm[a].high;
    }
    for (int b = 0; b < 3; ++b)
      e[b] = rounded(rho[0] * R[b] + rho[1] * R[3 + b] + (rho[2] * R[6 + b] - arm[b]));
    for (int a = 0; a < 3; ++a) {
      const int i = (a + 1) % 3, j = (a + 2) % 3;
      slope[a] += lever[i] * e[j] - lever[j] * e[i];
    }
  }
}

} // namespace kabsch
} // namespace

CONTRACTED

namespace {
namespace kabsch {

constexpr int PLAIN = 3, CAREFUL = 2; // steps
constexpr double ARRIVED = 1e-20;     // rad^2: a last step, of steps whose error goes by its square
constexpr double THIN = 1e-2;         // of G of size one: the product of the sums of two of its singular values

// R exp([theta]x) for R of S = R^T G: theta = (tr S I - sym S)^-1 slope. The length of theta / 2 squared, and the
// determinant.
INLINE Lanes stepped(const Lanes *S, const Lanes *slope, Lanes *R, Lanes &det) {
  const Lanes trace = S[0] + S[4] + S[8], d = trace - S[0], e = trace - S[4], f = trace - S[8];
  const Lanes g = -0.5 * (S[1] + S[3]), h = -0.5 * (S[2] + S[6]), k = -0.5 * (S[5] + S[7]);
  const Lanes c11 = e * f - k * k, c12 = h * k - g * f, c13 = g * k - h * e;
  const Lanes c22 = d * f - h * h, c23 = g * h - d * k, c33 = d * e - g * g;
  det = d * c11 + g * c12 + h * c13;
  const Lanes half = 0.5 / det;
  const Lanes turn[4] = {poses::all(1.0), half * (c11 * slope[0] + c12 * slope[1] + c13 * slope[2]),
                         half * (c12 * slope[0] + c22 * slope[1] + c23 * slope[2]),
                         half * (c13 * slope[0] + c23 * slope[1] + c33 * slope[2])};
  Lanes E[9], next[9];
  poses::rotation(turn, E);
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b) next[3 * a + b] = R[3 * a] * E[b] + R[3 * a + 1] * E[3 + b] + R[3 * a + 2] * E[6 + b];
  std::copy(next, next + 9, R);
  return turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3];
}

// Center (frame, 3) and rotation (frame, 3, 3) of position (frame, node, 3), NaN = not seen, shape (node, 3) and
// weight (node,), and whether each has arrived.
Three turned(Array position_, Array shape_, Array weight_) {
  const Size frames = position_.shape(0);
  const int N = static_cast<int>(shape_.shape(0));
  Out center_({frames, 3}), R_({frames, 3, 3}), arrived_({frames});
  const double *X = shape_.data(), *weight = weight_.data();
  std::vector<Lanes, Aligned<Lanes>> x(3 * N), w(N);
  for (Size first = 0; first < frames; first += LANES) {
    const double *at[LANES];
    for (int l = 0; l < LANES; ++l) at[l] = position_.data() + std::min(first + l, frames - 1) * N * 3;
    Lanes total = {}, c[3] = {}, mean[3] = {}, G[9] = {}, R[9], q[4] = {}, size = {}, last = {}, det = {};
    for (int n = 0; n < N; ++n) {
      Lanes *const own = x.data() + 3 * n, lost = {};
      for (int a = 0; a < 3; ++a) {
        own[a] = poses::gathered(at, 3 * n + a);
        lost += own[a] - own[a]; // NaN where it is not finite
      }
      w[n] = lost == 0.0 ? poses::all(weight[n]) : Lanes{};
      total += w[n];
      for (int a = 0; a < 3; ++a) {
        own[a] = w[n] > 0.0 ? own[a] : Lanes{};
        c[a] += w[n] * own[a];
        mean[a] += w[n] * X[3 * n + a];
      }
    }
    total = total > 1e-300 ? total : poses::all(1e-300);
    for (int a = 0; a < 3; ++a) c[a] /= total, mean[a] /= total;
    for (int n = 0; n < N; ++n)
      for (int a = 0; a < 3; ++a) {
        const Lanes rho = w[n] * (x[3 * n + a] - c[a]);
        for (int b = 0; b < 3; ++b) G[3 * a + b] += rho * (X[3 * n + b] - mean[b]);
      }
    for (int i = 0; i < 9; ++i) size += G[i] * G[i];
    size = poses::root(size);
    for (int i = 0; i < 9; ++i) G[i] /= size;
    poses::largest(G, poses::all(1.7320508075688774), q);
    poses::rotation(q, R);
    bool thin = false;
    for (int step = 0, steps = PLAIN; step < steps; ++step) {
      Lanes S[9] = {}, slope[3];
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b)
          for (int i = 0; i < 3; ++i) S[3 * a + b] += R[3 * i + a] * G[3 * i + b];
      slope[0] = S[7] - S[5], slope[1] = S[2] - S[6], slope[2] = S[3] - S[1];
      if (thin) {
        skew_part(X, N, x.data(), w.data(), c, mean, R, slope);
        for (Lanes &part : slope) part /= size;
      }
      last = stepped(S, slope, R, det);
      bool arrived = true;
      for (int l = 0; l < LANES; ++l) arrived &= last[l] < ARRIVED;
      if (thin || !(arrived || step + 1 == PLAIN)) continue;
      for (int l = 0; l < LANES; ++l) thin |= det[l] < THIN;
      if (!thin) break;
      steps = step + 1 + CAREFUL;
    }
    for (int a = 0; a < 3; ++a) c[a] -= R[3 * a] * mean[0] + R[3 * a + 1] * mean[1] + R[3 * a + 2] * mean[2];
    for (int l = 0; l < LANES && first + l < frames; ++l) {
      for (int i = 0; i < 3; ++i) center_.data()[3 * (first + l) + i] = c[i][l];
      for (int i = 0; i < 9; ++i) R_.data()[9 * (first + l) + i] = R[i][l];
      arrived_.data()[first + l] = last[l] < ARRIVED;
    }
  }
  return {center_, R_, arrived_};
}

} // namespace kabsch
} // namespace
