// Kicks and drifts of Mooney-Rivlin bodies with diagonal second moment, eight bodies at a time, one in each vector lane.
//
// W = a I1 + b I2 + c J^2 - d log J. A body stays in registers and first-level cache through all its steps; sums of F
// and V are compensated as in numpy. Bodies whose det F is not positive and finite are parked at F = I, V = 0, and told.
//
// Compiled once for each kind of processor, with registers of REGISTER doubles.

namespace {
namespace splitting {

constexpr int LANES = REGISTER;
typedef double Lanes __attribute__((vector_size(LANES * 8), may_alias));
typedef std::int64_t Bits __attribute__((vector_size(LANES * 8), may_alias));

struct Law { // constants of the material, and 1/e of E = diag(e)
  double a, b, c, d, over[3];
  bool volumetric;
};

INLINE Lanes determinant(const Lanes *F) {
  return F[0] * (F[4] * F[8] - F[5] * F[7]) + F[1] * (F[5] * F[6] - F[3] * F[8]) + F[2] * (F[3] * F[7] - F[4] * F[6]);
}

// F'' = -dW/dF E^-1
INLINE void acceleration(const Law &law, const Lanes *F, Lanes *A) {
  if (law.b != 0.0) { // 2 (a + b I1 - b F F^T) F
    const double k = -2.0 * law.b;
    Lanes B[9];
    for (int i = 0; i < 3; ++i)
      for (int j = i; j < 3; ++j)
        B[3 * i + j] = B[3 * j + i] = F[3 * i] * F[3 * j] + F[3 * i + 1] * F[3 * j + 1] + F[3 * i + 2] * F[3 * j + 2];
    const Lanes first = 2.0 * law.a - k * (B[0] + B[4] + B[8]);
    for (int i = 0; i < 9; ++i) B[i] *= k;
    for (int i = 0; i < 9; i += 4) B[i] += first;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) A[3 * i + j] = B[3 * i] * F[j] + B[3 * i + 1] * F[3 + j] + B[3 * i + 2] * F[6 + j];
  } else {
    for (int i = 0; i < 9; ++i) A[i] = 2.0 * law.a * F[i];
  }
  if (law.volumetric) {
    Lanes C[9];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const int m = 3 * ((i + 1) % 3), n = 3 * ((i + 2) % 3), p = (j + 1) % 3, q = (j + 2) % 3;
        C[3 * i + j] = F[m + p] * F[n + q] - F[m + q] * F[n + p];
      }
    const Lanes J = F[0] * C[0] + F[1] * C[1] + F[2] * C[2];
    const Lanes slope = 2.0 * law.c * J - law.d / J;
    for (int i = 0; i < 9; ++i) A[i] += slope * C[i];
  }
  for (int i = 0; i < 9; ++i) A[i] *= -law.over[i % 3];
}

INLINE void add(Lanes *x, Lanes *low, double factor, const Lanes *rate) {
  for (int i = 0; i < 9; ++i) {
    const Lanes change = factor * rate[i] + low[i], total = x[i] + change;
    low[i] = (x[i] - total) + change;
    x[i] = total;
  }
}

// Park the lanes that left det F > 0; those already parked may do as they like.
INLINE void guard(Lanes *F, Lanes *V, Lanes *F_low, Lanes *V_low, Bits &stopped) {
  const Lanes J = determinant(F);
  const Bits out = ~((J > 0.0) & (J - J == 0.0));
  std::int64_t any = 0;
  for (int l = 0; l < LANES; ++l) any |= out[l];
  if (!any) return;
  stopped |= out;
  const Lanes zero = {};
  for (int i = 0; i < 9; ++i) {
    F[i] = out ? zero + (i % 4 == 0 ? 1.0 : 0.0) : F[i];
    V[i] = out ? zero : V[i];
    F_low[i] = out ? zero : F_low[i];
    V_low[i] = out ? zero : V_low[i];
  }
}

void load(const double *from, Size bodies, Size at, int count, Lanes *to, bool identity) {
  for (int i = 0; i < 9; ++i) {
    to[i] = Lanes{} + (identity && i % 4 == 0 ? 1.0 : 0.0);
    for (int l = 0; l < count; ++l) to[i][l] = from[i * bodies + at + l];
  }
}

void save(double *to, Size bodies, Size at, int count, const Lanes *from) {
  for (int i = 0; i < 9; ++i)
    for (int l = 0; l < count; ++l) to[i * bodies + at + l] = from[i][l];
}

// Steps in place on F, V and their low parts (3, 3, body); stopped (body,) int8 is set where a body was parked.
void steps(Out F, Out V, Out F_low, Out V_low, Tensor<std::int8_t> stopped,
           Array kick_, Array drift_, Size n, double a, double b, double c,
           double d, bool volumetric, Array over_) {
  const double *kick = kick_.data(), *drift = drift_.data(), *over = over_.data();
  const Size stages = drift_.size();
  const Size bodies = F.shape(2);
  for (const auto &X : {F, V, F_low, V_low})
    if (X.ndim() != 3 || X.size() != 9 * bodies) throw std::invalid_argument("expected (3, 3, body)");
  if (stopped.size() != bodies || over_.size() != 3 || kick_.size() != stages + 1)
    throw std::invalid_argument("lengths do not fit");
  const Law law{a, b, c, d, {over[0], over[1], over[2]}, volumetric};
  double *f = F.data(), *v = V.data(), *fl = F_low.data(), *vl = V_low.data();
  std::int8_t *gone = stopped.data();
  for (Size at = 0; at < bodies; at += LANES) {
    const int count = int(std::min<Size>(LANES, bodies - at));
    Lanes x[9], y[9], xl[9], yl[9], push[9];
    load(f, bodies, at, count, x, true);
    load(v, bodies, at, count, y, false);
    load(fl, bodies, at, count, xl, false);
    load(vl, bodies, at, count, yl, false);
    Bits out = {};
    acceleration(law, x, push);
    for (Size step = 0; step < n; ++step) {
      for (Size i = 0; i < stages; ++i) {
        // the last kick of a step and the first of the next are one
        add(y, yl, i == 0 && step > 0 ? kick[0] + kick[stages] : kick[i], push);
        add(x, xl, drift[i], y);
        guard(x, y, xl, yl, out);
        acceleration(law, x, push);
      }
    }
    if (n > 0) add(y, yl, kick[stages], push);
    save(f, bodies, at, count, x);
    save(v, bodies, at, count, y);
    save(fl, bodies, at, count, xl);
    save(vl, bodies, at, count, yl);
    for (int l = 0; l < count; ++l)
      if (out[l]) gone[at + l] = 1;
  }
}

} // namespace splitting
} // namespace
