// Loads as a filter that knows nothing of them sees them: see `whitened_lines` in building/line_search.py.

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

// White errors (time, m, root * direction * 2) of loads that begin at rest, in the loop that a filter closes: the error
// d of its states becomes F (d - K H d) + push. F (1 or time - 1, n, n), H (1 or time, m, n), K (time, n, m), W (time,
// m, m). A load pushes states 0 to 2 by move (1 or time - 1, 3, direction) times moved (time - 1, root * 2), and states
// 3 to 5 by turn (3, direction) times pushed (time - 1, root * 2).
Out whitened(Array F_, Array H_, Array K_, Array W_, Array move, Array turn, Array moved, Array pushed) {
  const Sparse F(F_), H(H_), K(K_), W(W_);
  const Size T = K.time, m = H.rows, n = F.rows, loads = moved.shape(1), columns = turn.shape(1) * loads;
  const Size directions = turn.shape(1), steps = move.shape(0);
  Out out({T, m, columns});
  strips::Memory d(n * BLOCK), next(n * BLOCK), error(m * BLOCK), white(m * BLOCK);
  for (Size first = 0; first < columns; first += BLOCK) {
    const Size width = std::min<Size>(BLOCK, columns - first);
    std::fill(d.begin(), d.end(), 0.0);
    for (Size k = 0; k < T; ++k) {
      std::fill(error.begin(), error.end(), 0.0);
      std::fill(white.begin(), white.end(), 0.0);
      H.add(k, d.data(), error.data(), 1.0);
      W.add(k, error.data(), white.data(), 1.0);
      for (Size c = 0; c < m; ++c)
        std::copy(&white[c * BLOCK], &white[c * BLOCK] + width, out.data() + (k * m + c) * columns + first);
      if (k + 1 == T) break;
      K.add(k, error.data(), d.data(), -1.0);
      std::fill(next.begin(), next.end(), 0.0);
      F.add(k, d.data(), next.data(), 1.0);
      const double *by = move.data() + (steps > 1 ? k : 0) * 3 * directions;
      for (Size i = 0; i < 3; ++i)
        for (Size c = 0; c < width; ++c) {
          const Size pair = (first + c) / 2, direction = pair % directions;
          const Size load = k * loads + pair / directions * 2 + (first + c) % 2;
          next[i * BLOCK + c] += by[i * directions + direction] * moved.data()[load];
          next[(3 + i) * BLOCK + c] += turn.data()[i * directions + direction] * pushed.data()[load];
        }
      std::swap(d, next);
    }
  }
  return out;
}

} // namespace whitening
} // namespace
