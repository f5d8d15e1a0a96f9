// What a shock to states behind each sample changes in all later innovations: see `drawn_anew` in
// estimation/loads/pieces/character.py.

namespace {
namespace shocks {

using strips::multiply;

// The adjoint r (time, state) of a filter, and of its covariance N (time, state, state) the blocks (time, 3, k, k) of
// the states from `first` to `stop` that come in threes. F (1 or time - 1, n, n), H (1 or time, m, n), `run` (time,)
// each sample's of K (run, n, m) and W (run, m, m), innovations v (time, m), those seen (time,).
Two seen(Array F_, Array H_, Index run, Array K_, Array W_, Array v, Mask seen_, Size first, Size stop) {
  const Size T = v.shape(0), k = (stop - first) / 3;
  const int n = static_cast<int>(F_.shape(2)), m = static_cast<int>(v.shape(1)), nn = n * n;
  Out r_({T, n}), blocks({T, 3, k, k});
  Buffer r(n, 0.0), next(n), N(nn, 0.0), HF(m * n), rows(m * n), L(nn), L_t(nn), work(nn), rows_t(m * n);
  const auto put = [&](Size t) {
    std::copy(r.begin(), r.end(), r_.data() + t * n);
    double *out = blocks.data() + t * 3 * k * k;
    for (Size axis = 0; axis < 3; ++axis)
      for (Size i = first + axis; i < stop; i += 3)
        for (Size j = first + axis; j < stop; j += 3) *out++ = N[i * n + j];
  };
  put(T - 1);
  for (Size t = T - 2; t >= 0; --t) {
    const double *F = F_.data() + (F_.shape(0) > 1 ? t : 0) * nn;
    std::copy(F, F + nn, L.begin());
    std::fill(rows.begin(), rows.end(), 0.0);
    if (seen_.data()[t + 1]) {
      const Size own = run.data()[t + 1];
      multiply(H_.data() + (H_.shape(0) > 1 ? t + 1 : 0) * m * n, F, HF.data(), m, n, n);
      multiply(W_.data() + own * m * m, HF.data(), rows.data(), m, m, n);
      multiply(K_.data() + own * n * m, HF.data(), work.data(), n, m, n);
      for (int i = 0; i < nn; ++i) L[i] -= work[i];
    }
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) L_t[j * n + i] = L[i * n + j];
    for (int i = 0; i < m; ++i)
      for (int j = 0; j < n; ++j) rows_t[j * m + i] = rows[i * n + j];
    const double *e = v.data() + (t + 1) * m;
    for (int j = 0; j < n; ++j) {
      double sum = 0.0;
      for (int i = 0; i < n; ++i) sum += L_t[j * n + i] * r[i];
      for (int i = 0; i < m; ++i) sum += rows_t[j * m + i] * e[i];
      next[j] = sum;
    }
    std::swap(r, next);
    multiply(N.data(), L.data(), work.data(), n, n, n);
    multiply(L_t.data(), work.data(), N.data(), n, n, n);
    multiply(rows_t.data(), rows.data(), work.data(), n, m, n);
    for (int i = 0; i < nn; ++i) N[i] += work[i];
    put(t);
  }
  return {r_, blocks};
}

} // namespace shocks
} // namespace
