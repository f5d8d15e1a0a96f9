// Steps of a chain whose load keeps to axes of the body: see `fix_to_body` in priors/body_fixed.py.

namespace {
namespace body_fixed {

// block (3, 3), rows `apart` each from the next, = sum over axes a of d[a] times columns a of two matrices
INLINE void outer(const double *one, const double *other, const double *d, double *block, int apart) {
  for (int p = 0; p < 3; ++p)
    for (int q = 0; q < 3; ++q) {
      double sum = 0.0;
      for (int a = 0; a < 3; ++a) sum += one[3 * p + a] * d[a] * other[3 * q + a];
      block[p * apart + q] = sum;
    }
}

// F, Q (kind, state, state) of kinds of step, of which the first n states come in threes along the axes; which
// (step,): kind of each; early, mean (step, 3, 3): mean turns of the axes over a step, for Y and for H; at
// (step + 1, 3, 3): the axes at the samples. F and Q (step, state, state) in world axes; the rest is zero.
Two fixed(Array F_, Array Q_, Index which, Array early, Array mean, Array at, Size n) {
  const Size steps = which.shape(0);
  const int size = static_cast<int>(F_.shape(1)), nn = size * size, threes = static_cast<int>(n) / 3;
  Out F_out({steps, size, size}), Q_out({steps, size, size});
  std::vector<const double *> end(threes);
  for (Size k = 0; k < steps; ++k) {
    const double *F = F_.data() + which.data()[k] * nn, *Q = Q_.data() + which.data()[k] * nn;
    double *to_F = F_out.data() + k * nn, *to_Q = Q_out.data() + k * nn;
    std::fill(to_F, to_F + nn, 0.0);
    std::fill(to_Q, to_Q + nn, 0.0);
    for (int i = 0; i < threes; ++i)
      end[i] = i == 0 ? early.data() + 9 * k : i == 1 ? mean.data() + 9 * k : at.data() + 9 * (k + 1);
    for (int i = 0; i < threes; ++i)
      for (int j = 0; j < threes; ++j) {
        const int block = 3 * i * size + 3 * j;
        double d[3], noise[3];
        for (int a = 0; a < 3; ++a) d[a] = F[block + a * (size + 1)], noise[a] = Q[block + a * (size + 1)];
        if (i < 2 && j < 2) // Y and H go on as they are
          for (int a = 0; a < 3; ++a) to_F[block + a * (size + 1)] = d[a];
        else if (j >= 2 && (d[0] != 0.0 || d[1] != 0.0 || d[2] != 0.0))
          outer(end[i], at.data() + 9 * k, d, to_F + block, size);
        if (j < i || (noise[0] == 0.0 && noise[1] == 0.0 && noise[2] == 0.0)) continue;
        outer(end[i], end[j], noise, to_Q + block, size);
        for (int p = 0; p < 3; ++p)
          for (int q = 0; q < 3; ++q) to_Q[(3 * j + q) * size + 3 * i + p] = to_Q[block + p * size + q];
      }
  }
  return {F_out, Q_out};
}

} // namespace body_fixed
} // namespace
