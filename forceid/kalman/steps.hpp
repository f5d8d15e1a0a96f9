// F and Q of a step of x' = A x + w, of many processes side by side: see `discretize` in building/process.py.

namespace {
namespace steps {

using namespace lanes;

constexpr double SHORT = 0.125; // turns of the fastest rate over a step that a Taylor series takes
constexpr int TERMS = 40;       // of it, at most; ten or so count
constexpr int POWERS = 4;       // squarings of a matrix whose rows tell its fastest rate: to a fifth
constexpr int SWEEPS = 4;       // of the balancing of a matrix: each brings rows and columns to like sizes

// At least the largest modulus of an eigenvalue of a (n, n), and little more: by the rows of a power of it,
// balanced. a and work (n, n) are overwritten.
double fastest(double *a, double *work, int n) {
  for (int sweep = 0; sweep < SWEEPS + n; ++sweep) // isolated states go first, one after the other
    for (int i = 0; i < n; ++i) {
      double row = 0.0, column = 0.0;
      for (int j = 0; j < n; ++j)
        if (j != i) row += std::fabs(a[i * n + j]), column += std::fabs(a[j * n + i]);
      if (row == 0.0 && column == 0.0) continue;
      const double f = row == 0.0 || column == 0.0 ? 0.0 : std::sqrt(column / row);
      for (int j = 0; j < n; ++j)
        if (j != i) a[i * n + j] *= f, a[j * n + i] *= f == 0.0 ? 0.0 : 1.0 / f;
    }
  const auto size = [&] {
    double most = 0.0;
    for (int i = 0; i < n; ++i) {
      double row = 0.0;
      for (int j = 0; j < n; ++j) row += std::fabs(a[i * n + j]);
      most = std::max(most, row);
    }
    return most;
  };
  const double unit = size();
  if (unit == 0.0) return 0.0;
  for (int i = 0; i < n * n; ++i) a[i] /= unit;
  for (int power = 0; power < POWERS; ++power) {
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        double sum = 0.0;
        for (int l = 0; l < n; ++l) sum += a[i * n + l] * a[l * n + j];
        work[i * n + j] = sum;
      }
    std::copy(work, work + n * n, a);
  }
  return unit * std::pow(size(), std::ldexp(1.0, -POWERS));
}

// c = a b, all (n, n)
INLINE void multiply(const Lanes *a, const Lanes *b, Lanes *c, int n) {
  for (int i = 0; i < n; ++i) {
    int j = 0;
    for (; j + 4 <= n; j += 4) {
      Lanes sum[4] = {};
      for (int l = 0; l < n; ++l)
        for (int s = 0; s < 4; ++s) sum[s] += a[i * n + l] * b[l * n + j + s];
      for (int s = 0; s < 4; ++s) c[i * n + j + s] = sum[s];
    }
    for (; j < n; ++j) {
      Lanes sum = {};
      for (int l = 0; l < n; ++l) sum += a[i * n + l] * b[l * n + j];
      c[i * n + j] = sum;
    }
  }
}

// A and Qc (process, n, n); of each step (step,): its process (step,) -> F and Q (step, n, n)
Two discretized(Array A_, Array Qc_, Array step_, Index process_) {
  const Size count = step_.shape(0);
  const int n = static_cast<int>(A_.shape(1)), nn = n * n;
  Out F_({count, n, n}), Q_({count, n, n});
  Buffer balanced(nn), work(nn);
  Fleet A(nn), F(nn), Q(nn), dF(nn), dQ(nn), half(nn), turned(nn);
  Buffer rate(A_.shape(0));
  for (std::size_t k = 0; k < rate.size(); ++k) {
    balanced.assign(A_.data() + k * nn, A_.data() + (k + 1) * nn);
    rate[k] = fastest(balanced.data(), work.data(), n);
  }
  for (Size first = 0; first < count; first += LANES) {
    int doublings[LANES], most = 0;
    for (int l = 0; l < LANES; ++l) {
      const Size at = std::min(first + l, count - 1);
      const Size k = process_.data()[at];
      const double *a = A_.data() + k * nn, *q = Qc_.data() + k * nn, step = step_.data()[at];
      const double turn = rate[k] * step / SHORT;
      doublings[l] = turn > 1.0 ? static_cast<int>(std::ceil(std::log2(turn))) : 0;
      most = std::max(most, doublings[l]);
      const double h = std::ldexp(step, -doublings[l]);
      for (int i = 0; i < nn; ++i) A[i][l] = a[i] * h, dQ[i][l] = q[i] * h;
    }
    const Pattern in_A(n, n, [&](int i, int j) {
      bool held = false;
      for (int l = 0; l < LANES; ++l) held |= A[i * n + j][l] != 0.0;
      return held;
    });
    for (int i = 0; i < nn; ++i) dF[i] = all(i % (n + 1) == 0), F[i] = dF[i], Q[i] = dQ[i];
    for (int k = 1; k < TERMS; ++k) {
      bool moved = false;
      for (const bool noise : {false, true}) {
        const Fleet &d = noise ? dQ : dF;
        for (int i = 0; i < n; ++i)
          for (int j = 0; j < n; ++j) {
            Lanes sum = {};
            for (int l = in_A.begin[i]; l < in_A.begin[i + 1]; ++l)
              sum += A[in_A.entry[l]] * d[in_A.column[l] * n + j];
            half[i * n + j] = sum / all(noise ? k + 1 : k);
          }
        for (int i = 0; i < n; ++i)
          for (int j = 0; j < n; ++j) {
            const int at = i * n + j;
            (noise ? dQ : dF)[at] = noise ? half[at] + half[j * n + i] : half[at];
          }
        for (int i = 0; i < nn; ++i) {
          Lanes &sum = (noise ? Q : F)[i];
          const Lanes before = sum;
          sum += (noise ? dQ : dF)[i];
          for (int l = 0; l < LANES; ++l) moved |= before[l] != sum[l];
        }
      }
      if (!moved) break;
    }
    for (int k = 0; k < most; ++k) { // a step that is done waits for longer ones
      multiply(F.data(), Q.data(), half.data(), n);
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) turned[j * n + i] = F[i * n + j];
      multiply(half.data(), turned.data(), dQ.data(), n);
      multiply(F.data(), F.data(), dF.data(), n);
      for (int l = 0; l < LANES; ++l)
        if (doublings[l] > k)
          for (int i = 0; i < nn; ++i) F[i][l] = dF[i][l], Q[i][l] += dQ[i][l];
    }
    for (int l = 0; l < LANES && first + l < count; ++l)
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const Size at = (first + l) * nn + i * n + j;
          F_.data()[at] = F[i * n + j][l];
          Q_.data()[at] = 0.5 * (Q[i * n + j][l] + Q[j * n + i][l]);
        }
  }
  return {F_, Q_};
}

} // namespace steps
} // namespace
