// Signals sent through the gains of a filter: see `whiten` in building/lines.py.

namespace {
namespace whitening {

using strips::Vector, strips::read, strips::write, strips::WIDE;

constexpr int BLOCK = 4 * WIDE; // columns gone through at once: a state of dozens stays near

// The entries that are not zero, row by row, of one matrix (rows, columns) or one a time.
struct Sparse {
  Size time;
  int rows;
  std::vector<int> begin, column;
  Buffer value;
  explicit Sparse(const Array &a) : time(a.shape(0)), rows(static_cast<int>(a.shape(1))), begin(1, 0) {
    const double *at = a.data();
    for (Size i = 0; i < time * rows; ++i) {
      for (int j = 0; j < a.shape(2); ++j, ++at)
        if (*at != 0.0) column.push_back(j), value.push_back(*at);
      begin.push_back(static_cast<int>(column.size()));
    }
  }
  // y (rows, BLOCK) += sign * this x (columns, BLOCK)
  void add(Size k, const double *x, double *y, double sign) const {
    const int *own = begin.data() + (time > 1 ? k : 0) * rows;
    for (int i = 0; i < rows; ++i, y += BLOCK) {
      Vector<WIDE> sum[4];
      for (int s = 0; s < 4; ++s) sum[s] = read<WIDE>(y + s * WIDE);
      for (int l = own[i]; l < own[i + 1]; ++l)
        for (int s = 0; s < 4; ++s) sum[s] += (sign * value[l]) * read<WIDE>(x + column[l] * BLOCK + s * WIDE);
      for (int s = 0; s < 4; ++s) write<WIDE>(y + s * WIDE, sum[s]);
    }
  }
};

// F (1 or time - 1, n, n), H (1 or time, m, n), K (time, n, m), W (time, m, m), signal (time, m, column) -> as that
Out whitened(Array F_, Array H_, Array K_, Array W_, Array signal) {
  const Sparse F(F_), H(H_), K(K_), W(W_);
  const Size T = signal.shape(0), m = signal.shape(1), columns = signal.shape(2), n = F.rows;
  Out out({T, m, columns});
  strips::Memory x(n * BLOCK), next(n * BLOCK), error(m * BLOCK), white(m * BLOCK);
  for (Size first = 0; first < columns; first += BLOCK) {
    const Size width = std::min<Size>(BLOCK, columns - first);
    std::fill(x.begin(), x.end(), 0.0);
    std::fill(error.begin(), error.end(), 0.0);
    for (Size k = 0; k < T; ++k) {
      const Size at = k * m * columns + first;
      for (Size c = 0; c < m; ++c) std::copy(signal.data() + at + c * columns, signal.data() + at + c * columns + width, &error[c * BLOCK]);
      H.add(k, x.data(), error.data(), -1.0);
      std::fill(white.begin(), white.end(), 0.0);
      W.add(k, error.data(), white.data(), 1.0);
      for (Size c = 0; c < m; ++c) std::copy(&white[c * BLOCK], &white[c * BLOCK] + width, out.data() + at + c * columns);
      if (k + 1 == T) break;
      K.add(k, error.data(), x.data(), 1.0);
      std::fill(next.begin(), next.end(), 0.0);
      F.add(k, x.data(), next.data(), 1.0);
      std::swap(x, next);
    }
  }
  return out;
}

} // namespace whitening
} // namespace
