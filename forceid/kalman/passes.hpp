// The passes of the linear Gaussian estimators. Compiled once for each kind of processor, with registers of
// REGISTER doubles.
//
// Each pass is the same recursion as its namesake in passes.py, which says what it computes. Row-major
// doubles throughout. Sizes of states and channels are fixed at compile time where SIZES names them, and 0,
// known at run time, elsewhere; a covariance gains by that only while it is small.

namespace {
namespace passes {

using namespace lanes;
using strips::add_products, strips::Columns, strips::follow, strips::Memory;

constexpr Size BLOCK = 32;          // samples of a recursion that are gone through at once
constexpr Size SETTLES = 512;       // samples that room is made for until a covariance rests; more is made then
constexpr Size SEVERAL = 4;         // signals from which a step of all at once is quicker
constexpr int LAG = 8;              // samples between two looks at whether a covariance has come to rest
constexpr double REMAINING = 1e-12; // of a covariance, still to go by the rate at which it comes to rest
constexpr double ROUNDING = 1e-13;  // a change over LAG samples that rounding alone makes
constexpr double MOST = 0.99;       // of a variance that an update may take without Joseph's form
constexpr double LOG_2PI = 1.8378770664093454836;

// ---- small dense algebra; sizes are constants wherever the caller's are -------------------------------

// Written out where sizes are known when compiled, else one function for all: quicker to compile.
#define SHARED(SMALL, NAME, SIGNATURE, ARGUMENTS)                                                             \
  __attribute__((noinline)) void NAME##_of_any_size SIGNATURE { NAME##_here ARGUMENTS; }                      \
  INLINE void NAME SIGNATURE {                                                                                \
    if (__builtin_constant_p(SMALL) && (SMALL)) NAME##_here ARGUMENTS;                                        \
    else NAME##_of_any_size ARGUMENTS;                                                                        \
  }

// c (n, m) = a (n, k) b (k, m)
INLINE void multiply(const double *__restrict a, const double *__restrict b, double *__restrict c, int n, int k,
                     int m) {
  if (!__builtin_constant_p(n * k * m)) return strips::multiply(a, b, c, n, k, m);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < m; ++j) {
      double sum = 0.0;
      for (int l = 0; l < k; ++l) sum += a[i * k + l] * b[l * m + j];
      c[i * m + j] = sum;
    }
}

// four rows of a at a time: a write to each cache line for every four numbers, not for each
INLINE void transpose_here(const double *__restrict a, double *__restrict t, int n, int m) {
  int i = 0;
  for (; i + 4 <= n; i += 4, a += 4 * m)
    for (int j = 0; j < m; ++j)
      for (int s = 0; s < 4; ++s) t[j * n + i + s] = a[s * m + j];
  for (; i < n; ++i, a += m)
    for (int j = 0; j < m; ++j) t[j * n + i] = a[j];
}

SHARED(n * m <= 16, transpose, (const double *__restrict a, double *__restrict t, int n, int m), (a, t, n, m))

INLINE void symmetrize_here(double *a, int n) {
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < i; ++j) a[i * n + j] = a[j * n + i] = 0.5 * (a[i * n + j] + a[j * n + i]);
}

SHARED(n <= 4, symmetrize, (double *a, int n), (a, n))

// s = a p a^T of a symmetric p; a is sparse as a rule and goes first in both products
INLINE void sandwich(const double *a, const double *p, double *s, double *work, int n) {
  multiply(a, p, s, n, n, n);
  transpose(s, work, n, n);
  if (!__builtin_constant_p(n)) return strips::multiply_symmetric(a, work, s, n, n);
  multiply(a, work, s, n, n, n);
  symmetrize(s, n);
}

// Lower Cholesky factor in place, then its inverse w; false where a is not positive definite.
INLINE bool whitening(double *a, double *w, int m) {
  for (int j = 0; j < m; ++j) {
    double d = a[j * m + j];
    for (int l = 0; l < j; ++l) d -= a[j * m + l] * a[j * m + l];
    if (!(d > 0.0)) return false;
    d = a[j * m + j] = std::sqrt(d);
    for (int i = j + 1; i < m; ++i) {
      double s = a[i * m + j];
      for (int l = 0; l < j; ++l) s -= a[i * m + l] * a[j * m + l];
      a[i * m + j] = s / d;
    }
  }
  for (int j = 0; j < m; ++j) {
    for (int i = 0; i < j; ++i) w[i * m + j] = 0.0;
    w[j * m + j] = 1.0 / a[j * m + j];
    for (int i = j + 1; i < m; ++i) {
      double s = 0.0;
      for (int l = j; l < i; ++l) s -= a[i * m + l] * w[l * m + j];
      w[i * m + j] = s / a[i * m + i];
    }
  }
  return true;
}

// y -= f x
INLINE void subtract(double f, const double *__restrict x, double *__restrict y, int n) {
  for (int i = 0; i < n; ++i) y[i] -= f * x[i];
}

// x (n, m) = a^-1 x by elimination with row exchange; a is overwritten.
void solve(double *a, double *x, int n, int m) {
  for (int j = 0; j < n; ++j) {
    int pivot = j;
    for (int i = j + 1; i < n; ++i)
      if (std::fabs(a[i * n + j]) > std::fabs(a[pivot * n + j])) pivot = i;
    if (pivot != j) {
      for (int l = 0; l < n; ++l) std::swap(a[j * n + l], a[pivot * n + l]);
      for (int l = 0; l < m; ++l) std::swap(x[j * m + l], x[pivot * m + l]);
    }
    const double inverse = 1.0 / a[j * n + j];
    for (int i = j + 1; i < n; ++i) {
      const double f = a[i * n + j] * inverse;
      if (f == 0.0) continue;
      subtract(f, a + j * n + j + 1, a + i * n + j + 1, n - j - 1);
      subtract(f, x + j * m, x + i * m, m);
    }
  }
  for (int j = n - 1; j >= 0; --j) {
    double *__restrict row = x + j * m;
    for (int i = j + 1; i < n; ++i)
      if (a[j * n + i] != 0.0) subtract(a[j * n + i], x + i * m, row, m);
    const double inverse = 1.0 / a[j * n + j];
    for (int l = 0; l < m; ++l) row[l] *= inverse;
  }
}

// ---- models -------------------------------------------------------------------------------------------

// A matrix of each sample or step, or one for all: (1 or time, model or 1, ...). Or, of each kind of step and
// model, (kind, 1, ...): kind (time, model) says which; of no size where there are none.
struct Along {
  const double *data;
  Size time, model, size;
  const Size *kind = nullptr;
  explicit Along(const Array &a) : data(a.data()), time(a.shape(0)), model(a.shape(1)), size(1) {
    for (int i = 2; i < a.ndim(); ++i) size *= a.shape(i);
  }
  Along(const Array &a, const Index &kind_) : Along(a) {
    if (!kind_.size()) return;
    kind = kind_.data();
    time = kind_.shape(0);
    model = kind_.shape(1);
  }
  const double *at(Size k, Size j = 0) const {
    if (kind) return data + kind[k * model + j] * size;
    return data + ((time > 1 ? k : 0) * model + (model > 1 ? j : 0)) * size;
  }
  // whether lanes of models take the same at sample k as at the one before
  bool stays(Size k, const Size *models) const {
    if (!kind) return time == 1;
    for (int l = 0; l < LANES; ++l)
      if (kind[k * model + models[l]] != kind[(k - 1) * model + models[l]]) return false;
    return true;
  }
};

bool is_driven(const Along &u) {
  return u.time > 1 || std::any_of(u.data, u.data + u.size, [](double v) { return v != 0.0; });
}

// Whether a covariance that is looked at sample by sample has come to rest.
struct Rest {
  Buffer before;
  double change = 0.0;
  int since = 0;

  void restart() { since = -1; }

  bool reached(const double *P, int n) {
    if (since < 0) {
      before.assign(P, P + n * n);
      since = 0;
      change = 0.0;
      return false;
    }
    if (++since < LAG) return false;
    since = 0;
    double now = 0.0;
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j) {
        const double d = std::fabs(P[i * n + j] - before[i * n + j]);
        if (d > 0.0) now = std::max(now, d / std::sqrt(std::fabs(P[i * n + i] * P[j * n + j])));
      }
    before.assign(P, P + n * n);
    // no rate tells that while it still falls from a start as good as unknown
    const double ratio = change > 0.0 && change < 1.0 ? now / change : 1.0;
    change = now;
    return now < ROUNDING || (ratio < 1.0 && now * ratio < REMAINING * (1.0 - ratio));
  }
};

// One step of the covariance, prediction and update in Joseph's form.
template <int N, int M> struct Covariance {
  const int n, m;
  Buffer P_pred, P, K, W, H_s, H_t, R_s, S, W_t, PH, white, work, work2;
  int count = 0; // of the channels seen
  std::vector<int> channel;

  Covariance(int n_, int m_)
      : n(N ? N : n_), m(M ? M : m_), P_pred(n * n), P(n * n), K(n * m), W(m * m), H_s(m * n), H_t(n * m),
        R_s(m * m), S(m * m), W_t(m * m), PH(n * m), white(n * m), work(std::max(n, m) * std::max(n, m)),
        work2(std::max(n, m) * std::max(n, m)), channel(m) {}

  void predict(const double *F, const double *Q) {
    const int n = N ? N : this->n;
    sandwich(F, P.data(), P_pred.data(), work.data(), n);
    for (int i = 0; i < n * n; ++i) P_pred[i] += Q[i];
  }

  // inflated: of a single channel, the least innovation variance to be believed
  bool update(const double *H, const double *R, const unsigned char *seen, double inflated = 0.0) {
    count = 0;
    for (int c = 0; c < m; ++c)
      if (seen[c]) channel[count++] = c;
    std::fill(K.begin(), K.end(), 0.0);
    std::fill(W.begin(), W.end(), 0.0);
    if (count == 0) {
      P = P_pred;
      return true;
    }
    return count == M ? gain<M>(H, R, M, inflated) : gain<0>(H, R, count, inflated);
  }

  template <int C> bool gain(const double *H, const double *R, int c_, double inflated) {
    const int n = N ? N : this->n, m = M ? M : this->m, c = C ? C : c_;
    for (int i = 0; i < c; ++i) {
      std::memcpy(&H_s[i * n], H + channel[i] * n, n * sizeof(double));
      for (int j = 0; j < c; ++j) R_s[i * c + j] = R[channel[i] * m + channel[j]];
    }
    multiply(H_s.data(), P_pred.data(), H_t.data(), c, n, n); // what is sparse goes first
    transpose(H_t.data(), PH.data(), c, n);
    multiply(H_s.data(), PH.data(), S.data(), c, n, c);
    for (int i = 0; i < c * c; ++i) S[i] += R_s[i];
    if (inflated > S[0]) { // the sample is believed less: its noise grows by what is missing
      R_s[0] += inflated - S[0];
      S[0] = inflated;
    }
    if (!whitening(S.data(), work.data(), c)) return false;
    for (int i = 0; i < c; ++i)
      for (int j = 0; j < c; ++j) W[channel[i] * m + channel[j]] = work[i * c + j];
    // white = P H^T W^T, K = white W; the inverse of S is never formed
    transpose(work.data(), W_t.data(), c, c);
    multiply(PH.data(), W_t.data(), white.data(), n, c, c);
    multiply(white.data(), work.data(), work2.data(), n, c, c); // K of the channels seen
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < c; ++j) K[i * m + channel[j]] = work2[i * c + j];
    // P - white white^T is as good as Joseph's form until it takes most of a variance away
    double taken = 0.0;
    for (int i = 0; i < n; ++i) {
      double own = 0.0;
      for (int j = 0; j < c; ++j) own += white[i * c + j] * white[i * c + j];
      taken = std::max(taken, P_pred[i * n + i] > 0.0 ? own / P_pred[i * n + i] : 0.0);
    }
    if (taken > MOST) {
      joseph(c);
      return true;
    }
    transpose(white.data(), H_t.data(), n, c);
    multiply(white.data(), H_t.data(), P.data(), n, c, n);
    for (int i = 0; i < n * n; ++i) P[i] = P_pred[i] - P[i];
    return true;
  }

  // A P A^T + K R K^T with A = 1 - K H, without A: what takes as many products as there are channels, no more
  void joseph(int c) { // gain of the channels seen in work2
    const int n = N ? N : this->n;
    transpose(PH.data(), H_t.data(), n, c); // H P
    multiply(work2.data(), H_t.data(), P.data(), n, c, n);
    for (int i = 0; i < n * n; ++i) P[i] = P_pred[i] - P[i]; // A P
    transpose(P.data(), work.data(), n, n);
    multiply(H_s.data(), work.data(), H_t.data(), c, n, n);
    transpose(H_t.data(), PH.data(), c, n); // A P H^T
    multiply(work2.data(), R_s.data(), white.data(), n, c, c);
    for (int i = 0; i < n * c; ++i) PH[i] -= white[i];
    transpose(work2.data(), H_t.data(), n, c); // K^T
    multiply(PH.data(), H_t.data(), work.data(), n, c, n);
    for (int i = 0; i < n * n; ++i) P[i] -= work[i];
    symmetrize(P.data(), n);
  }
};

INLINE void row_times_here(const double *a, const double *x, double *y, int n, int m) { // y = a x
  for (int i = 0; i < n; ++i) {
    double s[4] = {};
    int j = 0;
    for (; j + 4 <= m; j += 4)
      for (int l = 0; l < 4; ++l) s[l] += a[i * m + j + l] * x[j + l];
    for (; j < m; ++j) s[0] += a[i * m + j] * x[j];
    y[i] = (s[0] + s[1]) + (s[2] + s[3]);
  }
}

SHARED(n * m <= 16, row_times, (const double *a, const double *x, double *y, int n, int m), (a, x, y, n, m))

// (1 - K H) F, the transition of the filtered state
void closed_loop(const double *F, const double *H, const double *K, double *A, int n, int m) {
  Buffer HF(m * n);
  multiply(H, F, HF.data(), m, n, n);
  multiply(K, HF.data(), A, n, m, n);
  for (int i = 0; i < n * n; ++i) A[i] = F[i] - A[i];
}

// Whether a covariance gains by sizes fixed at compile time: it does while it is small.
template <int N, int M> constexpr bool tiny = N > 0 && N <= 6 && M == 1;

// ---- the passes -----------------------------------------------------------------------------------------

void append(Buffer &all, const Buffer &more) { all.insert(all.end(), more.begin(), more.end()); }

// Returns (start, P_pred, P, K, W, failed sample or -1).
template <int N, int M>
Runs covariance_pass(Array F_, Array Q_, Array H_, Array R_, Array P0, Mask seen_, bool steady) {
  const Along F(F_), Q(Q_), H(H_), R(R_);
  const Size T = seen_.shape(0);
  const int m = static_cast<int>(seen_.shape(1)), n = static_cast<int>(P0.shape(0));
  Covariance<N, M> now(n, m);
  std::copy(P0.data(), P0.data() + n * n, now.P_pred.begin());
  std::vector<Size> start;
  Buffer P_pred, P, K, W;
  const Size expected = steady ? std::min(T, SETTLES) : T; // runs: one for every sample until it rests
  P_pred.reserve(expected * n * n), P.reserve(expected * n * n);
  K.reserve(expected * n * m), W.reserve(expected * m * m);
  Size failed = -1;
  {
    Rest rest;
    rest.restart();
    bool resting = false;
    for (Size k = 0; k < T; ++k) {
      const unsigned char *seen = seen_.data() + k * m;
      if (k > 0 && std::memcmp(seen, seen - m, m) != 0) {
        resting = false;
        rest.restart();
      }
      if (resting) continue;
      if (k > 0) now.predict(F.at(k - 1), Q.at(k - 1));
      if (!now.update(H.at(k), R.at(k), seen)) {
        failed = k;
        break;
      }
      start.push_back(k);
      append(P_pred, now.P_pred);
      append(P, now.P);
      append(K, now.K);
      append(W, now.W);
      if (steady && k > 0) resting = rest.reached(now.P.data(), n);
    }
  }
  const auto r = static_cast<Size>(start.size());
  return {Tensor<Size>(std::move(start), {r}), Out(std::move(P_pred), {r, n, n}), Out(std::move(P), {r, n, n}),
          Out(std::move(K), {r, n, m}), Out(std::move(W), {r, m, m}), failed};
}

// Rows of LANES signals, (lane, n) in memory, as one vector a column; and back.
INLINE void gather(const double *rows, Lanes *columns, int n) {
  for (int i = 0; i < n; ++i) {
    Lanes column;
    for (int l = 0; l < LANES; ++l) column[l] = rows[l * n + i];
    columns[i] = column;
  }
}

INLINE void scatter(const Lanes *columns, double *rows, int n) {
  for (int i = 0; i < n; ++i) {
    const Lanes column = columns[i];
    for (int l = 0; l < LANES; ++l) rows[l * n + i] = column[l];
  }
}

// sum += a row of a (., n) times x
INLINE void accumulate(Lanes &sum, const double *row, const Lanes *x, int n) {
  for (int j = 0; j < n; ++j) sum += x[j] * row[j];
}

// y <- A y + B v, a block of samples at a time; B v, which does not wait for y, goes first.
struct Path {
  const Columns &A;
  Memory y; // (1 + BLOCK, padded): where the block begins, then each of its samples

  explicit Path(const Columns &A_) : A(A_), y((1 + BLOCK) * A_.padded, 0.0) {}

  const double *at(Size k) const { return y.data() + k * A.padded; }
  void begin(const double *from) { std::copy(from, from + A.rows, y.begin()); }
  void resume(Size k) { std::copy(at(k), at(k) + A.padded, y.begin()); } // the next block behind sample k of this

  // through a block of inputs v, `apart` each from the next; push (block, state), if any, is added
  void go(const Columns &B, const double *v, Size apart, Size count, const double *push = nullptr, Size push_apart = 0) {
    double *next = y.data() + A.padded;
    std::fill(next, next + count * A.padded, 0.0);
    if (push)
      for (Size k = 0; k < count; ++k) std::copy(push + k * push_apart, push + k * push_apart + A.rows, next + k * A.padded);
    add_products(B, v, apart, next, count);
    follow(A, y.data(), count);
  }

  void put(Size from, Size count, double *out, Size apart) const { // samples of this block
    for (Size k = 0; k < count; ++k)
      for (int i = 0; i < A.rows; ++i) out[k * apart + i] = at(from + k)[i];
  }
};

INLINE double zero_if_missing(double z) { return z == z ? z : 0.0; }

// y (signals, n) = x (signals, m) a^T of a (n, m), by a^T: where there are several, all of them at once
INLINE void each_times(const double *a, const double *a_t, const double *x, double *y, Size signals, int n, int m) {
  if (signals >= SEVERAL) return multiply(x, a_t, y, static_cast<int>(signals), m, n);
  for (Size s = 0; s < signals; ++s) row_times(a, x + s * m, y + s * n, n, m);
}

// A run of mean_pass behind its first sample, for as many signals as fill lanes; returns how many.
Size means_in_lanes(const double *A, const double *B, const Along &u, bool driven, const double *z, double *x,
                           Size first, Size stop, Size signals, int n, int m) {
  const Size fleets = signals / LANES;
  const int inputs = driven ? m + n : m;
  Fleet X(fleets * n), next(n), push(n), Z(m);
  for (Size f = 0; f < fleets; ++f) gather(x + (first * signals + f * LANES) * n, &X[f * n], n);
  for (Size k = first + 1; k < stop; ++k) {
    if (driven) // the same for all signals
      for (int i = 0; i < n; ++i) {
        double sum = 0.0;
        for (int j = 0; j < n; ++j) sum += B[i * inputs + m + j] * u.at(k - 1)[j];
        push[i] = Lanes{} + sum;
      }
    for (Size f = 0; f < fleets; ++f) {
      gather(z + (k * signals + f * LANES) * m, Z.data(), m);
      for (int c = 0; c < m; ++c) Z[c] = Z[c] == Z[c] ? Z[c] : Lanes{};
      for (int i = 0; i < n; ++i) {
        Lanes sum = push[i], more = {};
        accumulate(sum, B + i * inputs, Z.data(), m);
        accumulate(more, A + i * n, &X[f * n], n);
        next[i] = sum + more;
      }
      std::copy(next.begin(), next.end(), X.begin() + f * n);
      scatter(next.data(), x + (k * signals + f * LANES) * n, n);
    }
  }
  return fleets * LANES;
}

// Filtered states x (time, signal, state) under the gains of covariance_pass.
Out mean_pass(Array F_, Array u_, Array H_, Index start_, Array K_, Array x0, Array z_) {
  const Along F(F_), u(u_), H(H_);
  const Size T = z_.shape(0), signals = z_.shape(1), runs = start_.shape(0);
  const int n = static_cast<int>(x0.shape(1)), m = static_cast<int>(z_.shape(2));
  const bool driven = is_driven(u);
  Out x_({T, signals, n});
  double *x = x_.data();
  const double *z = z_.data();
  const Size *start = start_.data();
  const int inputs = driven ? m + n : m; // of the recursion: the measurement, and the known input through 1 - K H
  Buffer pred(signals * n), e(signals * m), A(n * n), v(BLOCK * inputs), B(n * inputs), I_KH(n * n), F_t(n * n), K_t(m * n);
  if (signals >= SEVERAL) transpose(F.at(0), F_t.data(), n, n);
  for (Size r = 0; r < runs; ++r) {
    const Size first = start[r], stop = r + 1 < runs ? start[r + 1] : T;
    const double *K = K_.data() + r * n * m;
    // the first sample of a run in two steps: it may follow another gain
    double *now = x + first * signals * n;
    if (signals >= SEVERAL) {
      if (first > 0 && F.time > 1) transpose(F.at(first - 1), F_t.data(), n, n);
      transpose(K, K_t.data(), n, m);
    }
    if (first == 0) {
      std::copy(x0.data(), x0.data() + signals * n, pred.begin());
    } else {
      each_times(F.at(first - 1), F_t.data(), now - signals * n, pred.data(), signals, n, n);
      if (driven)
        for (Size i = 0; i < signals * n; ++i) pred[i] += u.at(first - 1)[i % n];
    }
    for (Size s = 0; s < signals; ++s) row_times(H.at(first), &pred[s * n], &e[s * m], m, n);
    for (Size i = 0; i < signals * m; ++i) e[i] = zero_if_missing(z[first * signals * m + i]) - e[i];
    each_times(K, K_t.data(), e.data(), now, signals, n, m);
    for (Size i = 0; i < signals * n; ++i) now[i] += pred[i];
    if (stop - first < 2) continue;
    closed_loop(F.at(0), H.at(0), K, A.data(), n, m);
    multiply(K, H.at(0), I_KH.data(), n, m, n);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < inputs; ++j)
        B[i * inputs + j] = j < m ? K[i * m + j] : (i == j - m) - I_KH[i * n + j - m];
    Size s = 0;
    if (signals >= LANES) s = means_in_lanes(A.data(), B.data(), u, driven, z, x, first, stop, signals, n, m);
    if (s == signals) continue;
    const Columns A_columns(A.data(), n, n), B_columns(B.data(), n, inputs);
    Path path(A_columns);
    for (; s < signals; ++s) {
      path.begin(x + (first * signals + s) * n);
      for (Size k = first + 1; k < stop; k += BLOCK) {
        const Size count = std::min(BLOCK, stop - k);
        for (Size i = 0; i < count; ++i) {
          double *row = &v[i * inputs];
          for (int c = 0; c < m; ++c) row[c] = zero_if_missing(z[((k + i) * signals + s) * m + c]);
          if (driven) std::copy(u.at(k + i - 1), u.at(k + i - 1) + n, row + m);
        }
        path.go(B_columns, v.data(), inputs, count);
        path.put(1, count, x + (k * signals + s) * n, signals * n);
        path.resume(count);
      }
    }
  }
  return x_;
}

// A run of adjoint_pass but for its first sample, for as many signals as fill lanes; returns how many.
Size adjoints_in_lanes(const double *A_t, const double *E, const double *HF, const double *P, const double *H,
                              const Along &u, bool driven, const double *z, const double *x, double *smoothed,
                              double *adjoint, Size first, Size stop, Size signals, int n, int m) {
  const Size fleets = signals / LANES;
  Fleet RT(fleets * n), now(n), before(n), next(n), Z(m);
  Buffer Hu(m, 0.0);
  for (Size f = 0; f < fleets; ++f) gather(adjoint + f * LANES * n, &RT[f * n], n);
  for (Size k = stop - 1; k > first; --k) {
    if (driven) row_times(H, u.at(k - 1), Hu.data(), m, n);
    for (Size f = 0; f < fleets; ++f) {
      const Size at = k * signals + f * LANES;
      Lanes *rt = &RT[f * n];
      gather(x + at * n, now.data(), n);
      gather(x + (at - signals) * n, before.data(), n);
      gather(z + at * m, Z.data(), m);
      for (int i = 0; i < n; ++i) accumulate(now[i], P + i * n, rt, n);
      scatter(now.data(), smoothed + at * n, n);
      for (int c = 0; c < m; ++c) {
        Lanes predicted = {};
        accumulate(predicted, HF + c * n, before.data(), n);
        Z[c] = (Z[c] == Z[c] ? Z[c] : Lanes{}) - Hu[c] - predicted;
      }
      for (int i = 0; i < n; ++i) {
        Lanes sum = {}, more = {};
        accumulate(sum, E + i * m, Z.data(), m);
        accumulate(more, A_t + i * n, rt, n);
        next[i] = sum + more;
      }
      std::copy(next.begin(), next.end(), rt);
    }
  }
  for (Size f = 0; f < fleets; ++f) scatter(&RT[f * n], adjoint + f * LANES * n, n);
  return fleets * LANES;
}

// Smoothed states (time, signal, state): x + P rt, with the adjoint rt of Bryson and Frazier.
Out adjoint_pass(Array F_, Array u_, Array H_, Index start_, Array P_, Array K_, Array W_, Array G_, Array z_,
                 Array x_) {
  const Along F(F_), u(u_), H(H_);
  const Size T = z_.shape(0), signals = z_.shape(1), runs = start_.shape(0);
  const int n = static_cast<int>(x_.shape(2)), m = static_cast<int>(z_.shape(2));
  const Size row = signals * n; // from a sample to the next
  const bool driven = is_driven(u);
  Out smoothed_({T, signals, n});
  double *smoothed = smoothed_.data();
  const double *x = x_.data(), *z = z_.data();
  const Size *start = start_.data();
  Buffer adjoint(signals * n, 0.0), pred(signals * n), e(m), g(m), S_inv(m * m), H_t(n * m), F_t(n * n), A(n * n),
      A_t(n * n), HF(m * n), Hu(m, 0.0), E(n * m), HS(n * m), back(signals * n), error(BLOCK * m), turned(n * n);
  if (F.time == 1) transpose(F.at(0), turned.data(), n, n);
  Memory predicted, told;
  for (Size r = runs; r-- > 0;) {
    const Size first = start[r], stop = r + 1 < runs ? start[r + 1] : T;
    const double *K = K_.data() + r * n * m, *W = W_.data() + r * m * m, *P = P_.data() + r * n * n;
    for (int i = 0; i < m; ++i)
      for (int j = 0; j < m; ++j) {
        double sum = 0.0;
        for (int l = 0; l < m; ++l) sum += W[l * m + i] * W[l * m + j];
        S_inv[i * m + j] = sum;
      }
    const bool steady = stop - first > 1;
    const bool given = r < G_.shape(0) && !std::isnan(G_.data()[r * n * n]);
    if (steady && given) { // Rauch, Tung and Striebel's gain is given: half the work
      Buffer I_GF(n * n), inverse(n * n), off(n);
      const double *G = G_.data() + r * n * n;
      multiply(G, F.at(0), I_GF.data(), n, n, n);
      for (int i = 0; i < n * n; ++i) I_GF[i] = (i % (n + 1) == 0) - I_GF[i];
      const Columns by_next(G, n, n), by_own(I_GF.data(), n, n);
      Path path(by_next);
      for (Size s = 0; s < signals; ++s) {
        double *rt = adjoint.data() + s * n, *last = smoothed + (stop - 1) * row + s * n;
        const double *own = x + (stop - 1) * row + s * n;
        row_times(P, rt, last, n, n);
        for (int i = 0; i < n; ++i) last[i] += own[i];
        path.begin(last);
        for (Size done = 1; done < stop - first; done += BLOCK) {
          const Size count = std::min(BLOCK, stop - first - done);
          path.go(by_own, own - done * row, -row, count);
          path.put(1, count, last - done * row, -row);
          path.resume(count);
        }
        for (int i = 0; i < n; ++i) off[i] = smoothed[first * row + s * n + i] - x[first * row + s * n + i];
        std::copy(P, P + n * n, inverse.begin());
        solve(inverse.data(), off.data(), n, 1);
        std::copy(off.begin(), off.end(), rt);
      }
    }
    const bool by_adjoint = steady && !given;
    Size in_lanes = 0; // signals whose run is done but for its first sample
    if (by_adjoint) {
      closed_loop(F.at(0), H.at(0), K, A.data(), n, m);
      transpose(A.data(), A_t.data(), n, n);
      transpose(H.at(0), H_t.data(), m, n);
      transpose(F.at(0), F_t.data(), n, n);
      multiply(H_t.data(), S_inv.data(), HS.data(), n, m, m);
      multiply(F_t.data(), HS.data(), E.data(), n, n, m);
      multiply(H.at(0), F.at(0), HF.data(), m, n, n);
      if (signals >= LANES)
        in_lanes = adjoints_in_lanes(A_t.data(), E.data(), HF.data(), P, H.at(0), u, driven, z, x, smoothed,
                                     adjoint.data(), first, stop, signals, n, m);
    }
    if (by_adjoint && in_lanes < signals) {
      const Columns back_step(A_t.data(), n, n), by_error(E.data(), n, m), gain(P, n, n), predicts(HF.data(), m, n);
      Path path(back_step);
      predicted.resize(BLOCK * predicts.padded);
      told.resize(BLOCK * gain.padded);
      for (Size s = in_lanes; s < signals; ++s) {
        double *rt = adjoint.data() + s * n;
        path.begin(rt);
        for (Size k = stop - 1; k > first; k -= BLOCK) { // samples k, k - 1, ...
          const Size count = std::min(BLOCK, k - first), at = k * row + s * n;
          std::fill(predicted.begin(), predicted.end(), 0.0);
          add_products(predicts, x + at - row, -row, predicted.data(), count);
          for (Size i = 0; i < count; ++i) {
            if (driven) row_times(H.at(0), u.at(k - i - 1), Hu.data(), m, n);
            for (int c = 0; c < m; ++c) // a channel that is missing has a zero column in E
              error[i * m + c] =
                  zero_if_missing(z[((k - i) * signals + s) * m + c]) - predicted[i * predicts.padded + c] - Hu[c];
          }
          path.go(by_error, error.data(), m, count);
          std::fill(told.begin(), told.end(), 0.0);
          add_products(gain, path.at(0), gain.padded, told.data(), count);
          for (Size i = 0; i < count; ++i)
            for (int j = 0; j < n; ++j) smoothed[at - i * row + j] = x[at - i * row + j] + told[i * gain.padded + j];
          path.resume(count);
        }
        path.put(0, 1, rt, 0);
      }
    }
    // the first sample of the run, and the step to it
    const Size k = first;
    each_times(P, P, adjoint.data(), smoothed + k * row, signals, n, n);
    for (Size i = 0; i < row; ++i) smoothed[k * row + i] += x[k * row + i];
    if (k == 0) continue;
    if (F.time > 1) transpose(F.at(k - 1), turned.data(), n, n);
    each_times(F.at(k - 1), turned.data(), x + (k - 1) * row, pred.data(), signals, n, n);
    for (Size i = 0; i < row; ++i) pred[i] += u.at(k - 1)[i % n];
    for (Size s = 0; s < signals; ++s) {
      double *rt = adjoint.data() + s * n;
      const Size at = k * signals + s;
      row_times(H.at(k), &pred[s * n], e.data(), m, n);
      // of a channel that is missing, S_inv and K are zero: it adds nothing
      for (int c = 0; c < m; ++c) e[c] = zero_if_missing(z[at * m + c]) - e[c];
      row_times(S_inv.data(), e.data(), g.data(), m, m);
      for (int c = 0; c < m; ++c)
        for (int i = 0; i < n; ++i) g[c] -= K[i * m + c] * rt[i];
      for (int c = 0; c < m; ++c)
        for (int i = 0; i < n; ++i) rt[i] += H.at(k)[c * n + i] * g[c];
    }
    each_times(turned.data(), F.at(k - 1), adjoint.data(), back.data(), signals, n, n);
    std::swap(adjoint, back);
  }
  return smoothed_;
}

// Information of later samples: (start, later), later holding from start to the next; failed sample or -1.
template <int N, int M>
Later information_pass(Array F_, Array Q_, Array H_, Array R_, Mask seen_, bool steady) {
  const Along F(F_), Q(Q_), H(H_), R(R_);
  const Size T = seen_.shape(0);
  const int m = M ? M : static_cast<int>(seen_.shape(1)), n = N ? N : static_cast<int>(F_.shape(3));
  std::vector<Size> last; // of each run, backwards
  Buffer later, now(n * n, 0.0), D(n * n), X(n * (n + m)), S(m * m), W(m * m), H_s(m * n), YH(n * m),
      told(n * n), F_t(n * n), work(n * std::max(n, m)), white(m * n);
  std::vector<int> channel(m);
  later.reserve((steady ? std::min(T, SETTLES) : T) * n * n);
  Size failed = -1;
  {
    Rest rest;
    rest.restart();
    bool resting = false;
    last.push_back(T - 1);
    append(later, now);
    for (Size k = T - 1; k > 0; --k) { // from what is told after sample k to what after k - 1
      const unsigned char *seen = seen_.data() + k * m;
      if (k < T - 1 && std::memcmp(seen, seen + m, m) != 0) {
        resting = false;
        rest.restart();
      }
      if (resting) continue;
      const double *Qk = Q.at(k - 1), *Fk = F.at(k - 1), *Rk = R.at(k);
      int c = 0;
      for (int i = 0; i < m; ++i)
        if (seen[i]) channel[c++] = i;
      for (int i = 0; i < c; ++i) std::memcpy(&H_s[i * n], H.at(k) + channel[i] * n, n * sizeof(double));
      // with Y = (1 + now Q)^-1: Y now, and Y H^T
      multiply(Qk, now.data(), work.data(), n, n, n);
      transpose(work.data(), D.data(), n, n);
      for (int i = 0; i < n; ++i) {
        D[i * n + i] += 1.0;
        std::memcpy(&X[i * (n + c)], &now[i * n], n * sizeof(double));
        for (int j = 0; j < c; ++j) X[i * (n + c) + n + j] = H_s[j * n + i];
      }
      solve(D.data(), X.data(), n, n + c);
      for (int i = 0; i < n; ++i) {
        std::memcpy(&told[i * n], &X[i * (n + c)], n * sizeof(double));
        for (int j = 0; j < c; ++j) YH[i * c + j] = X[i * (n + c) + n + j];
      }
      if (c) {
        multiply(Qk, YH.data(), work.data(), n, n, c);
        multiply(H_s.data(), work.data(), S.data(), c, n, c);
        for (int i = 0; i < c; ++i)
          for (int j = 0; j < c; ++j) S[i * c + j] += Rk[channel[i] * m + channel[j]];
        symmetrize(S.data(), c);
        if (!whitening(S.data(), W.data(), c)) {
          failed = k;
          break;
        }
        transpose(YH.data(), work.data(), n, c);
        multiply(W.data(), work.data(), white.data(), c, c, n);
        transpose(white.data(), YH.data(), c, n);
        multiply(YH.data(), white.data(), work.data(), n, c, n);
        for (int i = 0; i < n * n; ++i) told[i] += work[i];
      }
      symmetrize(told.data(), n);
      if (k == T - 1 || F.time > 1) transpose(Fk, F_t.data(), n, n);
      sandwich(F_t.data(), told.data(), now.data(), work.data(), n);
      last.push_back(k - 1);
      append(later, now);
      if (steady) resting = rest.reached(now.data(), n);
    }
  }
  const auto r = static_cast<Size>(last.size());
  return {Tensor<Size>(std::move(last), {r}), Out(std::move(later), {r, n, n}), failed};
}

// y -= f0 x0 + f1 x1 from column `first` on; columns before it may change as well
INLINE void subtract_two(double f0, const double *x0, double f1, const double *x1, double *y, int first, int n) {
  using strips::read, strips::write, strips::WIDE;
  int l = n;
  for (; l > first && l >= WIDE; l -= WIDE) {
    const int at = l - WIDE;
    write<WIDE>(y + at, read<WIDE>(y + at) - f0 * read<WIDE>(x0 + at) - f1 * read<WIDE>(x1 + at));
  }
  while (l-- > first) y[l] -= f0 * x0[l] + f1 * x1[l];
}

// Upper U with U^T U = P in place, by correlations; a pivot that is zero to rounding ends its row.
INLINE void semidefinite_root(double *P, double *size, double *none, int n) {
  for (int i = 0; i < n; ++i) size[i] = std::sqrt(std::max(P[i * n + i], 1e-300)), none[i] = 1.0 / size[i];
  for (int i = 0; i < n; ++i)
    for (int j = i; j < n; ++j) P[i * n + j] *= none[i] * none[j];
  const auto end = [&](double *row, int j) {
    const double pivot = row[j], inverse = pivot > 1e-15 ? 1.0 / std::sqrt(pivot) : 0.0;
    for (int l = j; l < n; ++l) row[l] *= inverse;
  };
  std::fill(none, none + n, 0.0);
  for (int j = 0; j < n; j += 2) { // two rows at a time go through all below
    double *one = P + j * n, *other = one + n;
    end(one, j);
    if (j + 1 == n) break;
    subtract_two(one[j + 1], one, 0.0, none, other, j + 1, n);
    end(other, j + 1);
    for (int i = j + 2; i < n; ++i) subtract_two(one[i], one, other[i], other, P + i * n, i, n);
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < i; ++j) P[i * n + j] = 0.0;
    for (int j = i; j < n; ++j) P[i * n + j] *= size[j];
  }
}

// (P^-1 + later)^-1 of each sample: C (1 + C^T later C)^-1 C^T, of C^T = U.
template <int N> Out combine(Array P_, Array later_) {
  const Size T = P_.shape(0);
  const int n = N ? N : static_cast<int>(P_.shape(1));
  Out out_({T, n, n});
  double *out = out_.data();
  Buffer U(n * n), known(n * n), work(n * n), size(n), none(n);
  for (Size k = 0; k < T; ++k) {
    std::copy(P_.data() + k * n * n, P_.data() + (k + 1) * n * n, U.begin());
    semidefinite_root(U.data(), size.data(), none.data(), n);
    sandwich(U.data(), later_.data() + k * n * n, known.data(), work.data(), n);
    for (int i = 0; i < n; ++i) known[i * n + i] += 1.0;
    semidefinite_root(known.data(), size.data(), none.data(), n);
    for (int j = 0; j < n; j += 2) { // U <- known^-T U
      double *one = &U[j * n], *other = one + n;
      const double *f = &known[j * n], *g = f + n;
      for (int l = 0; l < n; ++l) one[l] *= 1.0 / f[j];
      if (j + 1 == n) break;
      subtract_two(f[j + 1], one, 0.0, none.data(), other, 0, n);
      for (int l = 0; l < n; ++l) other[l] *= 1.0 / g[j + 1];
      for (int i = j + 2; i < n; ++i) subtract_two(f[i], one, g[i], other, &U[i * n], 0, n);
    }
    transpose(U.data(), work.data(), n, n);
    strips::multiply_symmetric(work.data(), U.data(), out + k * n * n, n, n);
  }
  return out_;
}

// A step of many models of one channel, one in each lane; zeros common to all cost nothing.
struct Models {
  const int N;
  Fleet Q, P, x, PH, K, work, y, A, Fv; // of P below the diagonal after a prediction, all of it after an update
  Lanes r;
  std::vector<char> held;
  Pattern in_F;
  std::vector<int> reads_at;
  Fleet h;

  explicit Models(int n)
      : N(n), Q(n * n), P(n * n), x(n), PH(n), K(n), work(n * n), y(n), A(n * n), held(n * n, 0),
        in_F(n, n, [](int, int) { return false; }), h(n) {}

  static Lanes load(const Along &a, Size k, const Size *model, Size entry) {
    Lanes lanes;
    for (int l = 0; l < LANES; ++l) lanes[l] = a.at(k, model[l])[entry];
    return lanes;
  }

  static bool any(const Lanes &a) {
    bool found = false;
    for (int l = 0; l < LANES; ++l) found |= a[l] != 0.0;
    return found;
  }

  void steps(const Along &F, const Along &Q_, Size k, const Size *model) {
    bool changed = false;
    for (int i = 0; i < N * N; ++i) {
      work[i] = load(F, k, model, i);
      Q[i] = load(Q_, k, model, i);
      const bool now = any(work[i]);
      changed |= now != static_cast<bool>(held[i]);
      held[i] = now;
    }
    if (changed) in_F = Pattern(N, N, [&](int i, int j) { return held[i * N + j] != 0; });
    Fv.resize(in_F.entry.size());
    for (std::size_t l = 0; l < Fv.size(); ++l) Fv[l] = work[in_F.entry[l]];
  }

  void reads(const Along &H, Size k, const Size *model) {
    reads_at.clear();
    for (int i = 0; i < N; ++i) {
      h[i] = load(H, k, model, i);
      if (any(h[i])) reads_at.push_back(i);
    }
  }

  void predict() {
    for (int i = 0; i < N; ++i) {
      Lanes sum = {};
      for (int l = in_F.begin[i]; l < in_F.begin[i + 1]; ++l) sum += Fv[l] * x[in_F.column[l]];
      y[i] = sum;
    }
    std::swap(x, y);
    congruence(in_F.begin.data(), in_F.column.data(), Fv.data(), P.data(), work.data(), N);
    for (int i = 0; i < N; ++i)
      for (int j = 0; j <= i; ++j) P[i * N + j] += Q[i * N + j];
  }

  // Returns e^2 / S; e and S go out by reference.
  Lanes update(const Lanes &z, double limit, Lanes &e, Lanes &S) {
    Lanes noise = r;
    e = z;
    S = r;
    std::fill(PH.begin(), PH.end(), Lanes{});
    for (const int l : reads_at) {
      for (int i = 0; i < l; ++i) PH[i] += P[l * N + i] * h[l];
      for (int i = l; i < N; ++i) PH[i] += P[i * N + l] * h[l];
    }
    for (const int l : reads_at) {
      e -= h[l] * x[l];
      S += h[l] * PH[l];
    }
    const Lanes least = (e / limit) * (e / limit);
    noise = least > S ? noise + (least - S) : noise; // the sample is believed less
    S = least > S ? least : S;
    const Lanes inverse = 1.0 / S;
    Lanes most = {};
    for (int i = 0; i < N; ++i) {
      K[i] = PH[i] * inverse;
      x[i] += K[i] * e;
      most = K[i] * PH[i] > MOST * P[i * N + i] ? all(1) : most;
    }
    if (any(most))
      joseph(noise);
    else
      for (int i = 0; i < N; ++i)
        for (int j = 0; j <= i; ++j) P[i * N + j] = P[j * N + i] = P[i * N + j] - K[i] * PH[j];
    return e * e * inverse;
  }

  void joseph(const Lanes &noise) {
    mirror();
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j) A[i * N + j] = (i == j ? 1.0 : 0.0) - K[i] * h[j];
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < N; ++j) {
        Lanes sum = {};
        for (int l = 0; l < N; ++l) sum += A[i * N + l] * P[l * N + j];
        work[i * N + j] = sum;
      }
    for (int i = 0; i < N; ++i)
      for (int j = 0; j <= i; ++j) {
        Lanes sum = K[i] * noise * K[j];
        for (int l = 0; l < N; ++l) sum += work[i * N + l] * A[j * N + l];
        P[i * N + j] = P[j * N + i] = sum;
      }
  }

  void mirror() {
    for (int i = 0; i < N; ++i)
      for (int j = 0; j < i; ++j) P[j * N + i] = P[i * N + j];
  }
};

// LANES models of one channel through a record: call(k, e, S) after every sample that is seen.
template <typename Call>
void through(const Along &F, const Along &Q, const Along &H, const Along &R, const Along &u, const double *x0,
             const double *P0, const Along &Z, const unsigned char *seen, Size T, double limit, const Size *model,
             int N, Call call) {
  Models now(N);
  const bool driven = is_driven(u);
  for (int l = 0; l < LANES; ++l) {
    for (int i = 0; i < N; ++i) now.x[i][l] = x0[model[l] * N + i];
    for (int i = 0; i < N * N; ++i) now.P[i][l] = P0[model[l] * N * N + i];
  }
  bool begun = false;
  for (Size k = 0; k < T; ++k) {
    if (k > 0) {
      if (k == 1 || !F.stays(k - 1, model) || !Q.stays(k - 1, model)) now.steps(F, Q, k - 1, model);
      now.predict();
      if (driven)
        for (int i = 0; i < N; ++i) now.x[i] += Models::load(u, k - 1, model, i);
    }
    if (!seen[k]) {
      now.mirror();
      continue;
    }
    if (!begun || H.time > 1) now.reads(H, k, model);
    if (!begun || R.time > 1) now.r = Models::load(R, k, model, 0);
    begun = true;
    Lanes e, S;
    const Lanes square = now.update(Models::load(Z, k, model, 0), limit, e, S);
    call(k, e, S, square);
  }
}

// call(model) with LANES of so many models at a time; the last of them again where they are no multiple.
template <typename Call> void in_fleets(Size models, Call call) {
  for (Size first = 0; first < models; first += LANES) {
    Size model[LANES];
    for (int l = 0; l < LANES; ++l) model[l] = std::min(first + l, models - 1);
    call(model);
  }
}

// Whitened innovations (time, model) of many models of one channel each; NaN where nothing is seen.
Out innovations(Array F_, Array Q_, Array H_, Array R_, Array u_, Array x0, Array P0, Array z_, Mask seen) {
  const Along F(F_), Q(Q_), H(H_), R(R_), u(u_), Z(z_);
  const Size T = z_.shape(0), models = x0.shape(0);
  Out white({T, models});
  std::fill(white.data(), white.data() + T * models, std::numeric_limits<double>::quiet_NaN());
  in_fleets(models, [&](const Size *model) {
    through(F, Q, H, R, u, x0.data(), P0.data(), Z, seen.data(), T, std::numeric_limits<double>::infinity(), model,
            static_cast<int>(x0.shape(1)), [&](Size k, const Lanes &e, const Lanes &S, const Lanes &) {
              for (int l = 0; l < LANES; ++l) white.data()[k * models + model[l]] = e[l] / std::sqrt(S[l]);
            });
  });
  return white;
}

// Log-likelihood of each of many models (model,); NaN where an innovation covariance loses its sign.
template <int N, int M>
Out log_likelihood(Array F_, Array Q_, Index kind, Array H_, Array R_, Array u_, Array x0, Array P0, Array z_,
                   Mask seen_, double limit, bool steady) {
  const Along F(F_, kind), Q(Q_, kind), H(H_), R(R_), u(u_), Z(z_);
  const Size T = z_.shape(0), models = x0.shape(0);
  const int n = N ? N : static_cast<int>(x0.shape(1)), m = M ? M : static_cast<int>(seen_.shape(1));
  Out total_({models});
  double *total = total_.data();
  if (m == 1) {
    if (models >= 4) {
      in_fleets(models, [&](const Size *model) {
        Lanes sum = {}, product = Lanes{} + 1.0;
        Size count = 0;
        const auto settle = [&] { // logarithms of a few innovation variances at a time
          for (int l = 0; l < LANES; ++l) sum[l] += std::log(product[l]);
          product = Lanes{} + 1.0;
        };
        through(F, Q, H, R, u, x0.data(), P0.data(), Z, seen_.data(), T, limit, model, n,
                [&](Size, const Lanes &, const Lanes &S, const Lanes &square) {
                  sum += square;
                  product *= S;
                  if (++count % 4 == 0) settle(); // four variances stay far from the ends of the exponent
                });
        settle();
        for (int l = 0; l < LANES; ++l) total[model[l]] = -0.5 * (sum[l] + count * LOG_2PI);
      });
      return total_;
    }
  }
  Buffer x(n), pred(n), e(m), white(m), A(n * n), HF(m * n), Hu(m, 0.0), v(BLOCK * m);
  Memory predicted, whites;
  for (Size j = 0; j < models; ++j) {
    Covariance<tiny<N, M> ? N : 0, tiny<N, M> ? M : 0> now(n, m);
    std::copy(P0.data() + j * n * n, P0.data() + (j + 1) * n * n, now.P_pred.begin());
    std::copy(x0.data() + j * n, x0.data() + (j + 1) * n, pred.begin());
    double sum = 0.0;
    Rest rest;
    rest.restart();
    for (Size k = 0; k < T; ++k) {
      const unsigned char *seen = seen_.data() + k * m;
      if (k > 0) {
        now.predict(F.at(k - 1, j), Q.at(k - 1, j));
        row_times(F.at(k - 1, j), x.data(), pred.data(), n, n);
        for (int i = 0; i < n; ++i) pred[i] += u.at(k - 1, j)[i];
        if (std::memcmp(seen, seen - m, m) != 0) rest.restart();
      }
      row_times(H.at(k, j), pred.data(), e.data(), m, n);
      for (int c = 0; c < m; ++c) e[c] = seen[c] ? Z.at(k, j)[c] - e[c] : 0.0;
      const double inflated = m == 1 ? (e[0] / limit) * (e[0] / limit) : 0.0;
      if (!now.update(H.at(k, j), R.at(k, j), seen, inflated)) {
        sum = std::numeric_limits<double>::quiet_NaN();
        break;
      }
      row_times(now.W.data(), e.data(), white.data(), m, m);
      double log_det = 0.0;
      for (int c = 0; c < m; ++c) {
        sum -= 0.5 * white[c] * white[c];
        if (seen[c]) log_det += std::log(now.W[c * m + c]) - 0.5 * LOG_2PI;
      }
      sum += log_det;
      row_times(now.K.data(), e.data(), x.data(), n, m);
      for (int i = 0; i < n; ++i) x[i] += pred[i];
      const bool wild = m == 1 && seen[0] && std::fabs(white[0]) >= 0.999999 * limit;
      if (wild) rest.restart();
      if (!steady || k == 0 || wild || !rest.reached(now.P.data(), n)) continue;
      // at rest: one recursion, until the channels seen change or a sample is wild
      closed_loop(F.at(0, j), H.at(0, j), now.K.data(), A.data(), n, m);
      multiply(H.at(0, j), F.at(0, j), HF.data(), m, n, n);
      const Columns step(A.data(), n, n), gain(now.K.data(), n, m), predicts(HF.data(), m, n), whitens(now.W.data(), m, m);
      Path path(step);
      path.begin(x.data());
      predicted.resize(BLOCK * predicts.padded);
      whites.resize(BLOCK * predicts.padded);
      const bool driven = is_driven(u);
      Size alike = k + 1; // samples that see what this one sees end before it
      while (alike < T && std::memcmp(seen, seen_.data() + alike * m, m) == 0) ++alike;
      for (bool tame = true; tame && k + 1 < alike;) {
        Size count = std::min(BLOCK, alike - k - 1);
        for (Size i = 0; i < count; ++i) {
          if (driven) row_times(H.at(0, j), u.at(k + i, j), Hu.data(), m, n);
          for (int c = 0; c < m; ++c) v[i * m + c] = (seen[c] ? Z.at(k + i + 1, j)[c] : 0.0) - Hu[c];
        }
        path.go(gain, v.data(), m, count, driven ? u.at(k, j) : nullptr, u.at(k + 1, j) - u.at(k, j));
        std::fill(predicted.begin(), predicted.end(), 0.0);
        std::fill(whites.begin(), whites.end(), 0.0);
        add_products(predicts, path.at(0), step.padded, predicted.data(), count);
        for (Size i = 0; i < count; ++i)
          for (int c = 0; c < m; ++c) v[i * m + c] = seen[c] ? v[i * m + c] - predicted[i * predicts.padded + c] : 0.0;
        add_products(whitens, v.data(), m, whites.data(), count);
        for (Size i = 0; i < count; ++i) {
          const double *white = &whites[i * predicts.padded];
          if (m == 1 && std::fabs(white[0]) > limit) {
            count = i;
            tame = false;
            break;
          }
          double square = 0.0;
          for (int c = 0; c < m; ++c) square += white[c] * white[c];
          sum += log_det - 0.5 * square;
        }
        path.resume(count);
        k += count;
      }
      path.put(0, 1, x.data(), 0);
      rest.restart();
    }
    total[j] = sum;
  }
  return total_;
}

// ---- sizes ------------------------------------------------------------------------------------------------

// call(N, M) with the sizes as constants where SIZES names them, with 0, 0 otherwise
template <typename Call> auto sized([[maybe_unused]] Size n, [[maybe_unused]] Size m, Call call) {
#define TRY(N, M)                                                                                             \
  if (n == N && m == M) return call(std::integral_constant<int, N>{}, std::integral_constant<int, M>{});
  SIZES(TRY)
#undef TRY
  return call(std::integral_constant<int, 0>{}, std::integral_constant<int, 0>{});
}

#ifdef BELOW // wider registers gain nothing where states are few
#define LEAVE(STATES, CHANNELS, NAME, ARGUMENTS)                                                              \
  if ((STATES) <= 4 && (CHANNELS) == 1) return BELOW.NAME ARGUMENTS
#else
#define LEAVE(STATES, CHANNELS, NAME, ARGUMENTS)
#endif

Runs covariances(Array F, Array Q, Array H, Array R, Array P0, Mask seen, bool steady) {
  LEAVE(F.shape(3), seen.shape(1), covariance_pass, (F, Q, H, R, P0, seen, steady));
  return sized(F.shape(3), seen.shape(1), [&](auto N, auto M) {
    constexpr bool fixed = tiny<N(), M()>;
    return covariance_pass<fixed ? N() : 0, fixed ? M() : 0>(F, Q, H, R, P0, seen, steady);
  });
}

Later information(Array F, Array Q, Array H, Array R, Mask seen, bool steady) {
  LEAVE(F.shape(3), seen.shape(1), information_pass, (F, Q, H, R, seen, steady));
  return sized(F.shape(3), seen.shape(1), [&](auto N, auto M) {
    constexpr bool fixed = tiny<N(), M()>;
    return information_pass<fixed ? N() : 0, fixed ? M() : 0>(F, Q, H, R, seen, steady);
  });
}

Out combined(Array P, Array later) {
#ifdef BELOW
  return BELOW.combine(P, later);
#else
  return sized(P.shape(1), 1, [&](auto N, auto M) { return combine<tiny<N(), M()> ? N() : 0>(P, later); });
#endif
}

Out means(Array F, Array u, Array H, Index start, Array K, Array x0, Array z) {
  LEAVE(F.shape(3), z.shape(2), mean_pass, (F, u, H, start, K, x0, z));
  return mean_pass(F, u, H, start, K, x0, z);
}

Out smoothed(Array F, Array u, Array H, Index start, Array P, Array K, Array W, Array G, Array z, Array x) {
  LEAVE(F.shape(3), z.shape(2), adjoint_pass, (F, u, H, start, P, K, W, G, z, x));
  return adjoint_pass(F, u, H, start, P, K, W, G, z, x);
}

Out likelihoods(Array F, Array Q, Index kind, Array H, Array R, Array u, Array x0, Array P0, Array z, Mask seen,
                double limit, bool steady) {
  LEAVE(F.shape(3), x0.shape(0) < 4 ? seen.shape(1) : 0, log_likelihood,
        (F, Q, kind, H, R, u, x0, P0, z, seen, limit, steady));
  return sized(F.shape(3), seen.shape(1), [&](auto N, auto M) {
    return log_likelihood<N(), M()>(F, Q, kind, H, R, u, x0, P0, z, seen, limit, steady);
  });
}

constexpr Passes table = {covariances, means, smoothed, information, combined, likelihoods, innovations};

} // namespace passes
} // namespace
