// A flight's steps and its smoother, in lanes: stretches of one record side by side.
//
// Covariances of a turning body never come to rest, so the recursion over a long record is what costs. But a
// filter forgets how it began. A record is cut into LANES stretches, each begun some way before its part and
// run on some way past it; where two meet, they must agree, else one stretch is run from end to end. What is
// computed is the filter of linear.py about a reference, and Bryson and Frazier's adjoint of its states and
// covariances (1963). Row-major doubles.
//
// Compiled once for each kind of processor, with registers of REGISTER doubles.

namespace {
namespace flight {

using namespace lanes;

constexpr int BLOCK = 8; // samples between covariances that are kept on the way forward
constexpr double AGREES = 1e-8; // of a standard deviation, or of a variance: two stretches that meet
constexpr double ALIKE = 1e-5;  // pivot of an innovation covariance in units of its diagonal: no less
constexpr double LOST = 1e-6;   // of a variance that may be left of it, lest its digits go
constexpr double LOG_2PI = 1.8378770664093454836;

// Entries of a record at eight samples of their own.
struct Samples {
  const double *at[LANES];
  Samples(const double *data, Size stride, const Size *sample) {
    for (int l = 0; l < LANES; ++l) at[l] = data + sample[l] * stride;
  }
  INLINE Lanes operator[](Size i) const {
    Lanes v;
    for (int l = 0; l < LANES; ++l) v[l] = at[l][i];
    return v;
  }
};

template <typename Call> INLINE Lanes each(const Lanes &a, Call call) {
  Lanes out = {};
  for (int l = 0; l < LANES; ++l) out[l] = call(a[l]);
  return out;
}

INLINE Lanes root(const Lanes &a) {
  return each(a, [](double v) { return std::sqrt(v); });
}

INLINE bool any(const Lanes &truth) { // of a comparison, as 0 or 1
  for (int l = 0; l < LANES; ++l)
    if (truth[l] != 0.0) return true;
  return false;
}

// ---- rotations ------------------------------------------------------------------------------------------

struct Matrix {
  Lanes a[9];
};
struct Vector {
  Lanes a[3];
};

INLINE Matrix operator*(const Matrix &x, const Matrix &y) {
  Matrix z;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      z.a[3 * i + j] = x.a[3 * i] * y.a[j] + x.a[3 * i + 1] * y.a[3 + j] + x.a[3 * i + 2] * y.a[6 + j];
  return z;
}
INLINE Matrix operator*(const Matrix &x, const Lanes &s) {
  Matrix z;
  for (int i = 0; i < 9; ++i) z.a[i] = x.a[i] * s;
  return z;
}
INLINE Matrix operator+(const Matrix &x, const Matrix &y) {
  Matrix z;
  for (int i = 0; i < 9; ++i) z.a[i] = x.a[i] + y.a[i];
  return z;
}
INLINE Vector operator*(const Matrix &x, const Vector &v) {
  Vector z;
  for (int i = 0; i < 3; ++i) z.a[i] = x.a[3 * i] * v.a[0] + x.a[3 * i + 1] * v.a[1] + x.a[3 * i + 2] * v.a[2];
  return z;
}
INLINE Vector operator*(const Vector &v, const Lanes &s) { return {v.a[0] * s, v.a[1] * s, v.a[2] * s}; }
INLINE Vector operator+(const Vector &v, const Vector &w) {
  return {v.a[0] + w.a[0], v.a[1] + w.a[1], v.a[2] + w.a[2]};
}
INLINE Vector operator-(const Vector &v, const Vector &w) {
  return {v.a[0] - w.a[0], v.a[1] - w.a[1], v.a[2] - w.a[2]};
}
INLINE Vector cross(const Vector &v, const Vector &w) {
  return {v.a[1] * w.a[2] - v.a[2] * w.a[1], v.a[2] * w.a[0] - v.a[0] * w.a[2], v.a[0] * w.a[1] - v.a[1] * w.a[0]};
}
INLINE Lanes dot(const Vector &v, const Vector &w) { return v.a[0] * w.a[0] + v.a[1] * w.a[1] + v.a[2] * w.a[2]; }
INLINE Matrix transposed(const Matrix &x) {
  return {x.a[0], x.a[3], x.a[6], x.a[1], x.a[4], x.a[7], x.a[2], x.a[5], x.a[8]};
}
INLINE Matrix identity() { return {all(1), all(0), all(0), all(0), all(1), all(0), all(0), all(0), all(1)}; }
INLINE Matrix skew(const Vector &v) {
  return {all(0), -v.a[2], v.a[1], v.a[2], all(0), -v.a[0], -v.a[1], v.a[0], all(0)};
}
INLINE Matrix inverse(const Matrix &x) {
  const Lanes *a = x.a;
  Matrix z = {a[4] * a[8] - a[5] * a[7], a[2] * a[7] - a[1] * a[8], a[1] * a[5] - a[2] * a[4],
              a[5] * a[6] - a[3] * a[8], a[0] * a[8] - a[2] * a[6], a[2] * a[3] - a[0] * a[5],
              a[3] * a[7] - a[4] * a[6], a[1] * a[6] - a[0] * a[7], a[0] * a[4] - a[1] * a[3]};
  return z * (1.0 / (a[0] * z.a[0] + a[1] * z.a[3] + a[2] * z.a[6]));
}

// One over the factors by which a term of a series of sine or cosine shrinks: no division in the loop.
constexpr struct Series {
  double odd[10] = {}, even[10] = {};
  constexpr Series() {
    for (int k = 0; k < 10; ++k) odd[k] = 1.0 / ((2 * k + 2) * (2 * k + 3)), even[k] = 1.0 / ((2 * k + 3) * (2 * k + 4));
  }
} SERIES;

// Rotation matrix of a rotation vector, by Rodrigues; series up to a radian.
INLINE Matrix exponential(const Vector &phi) {
  const Lanes square = dot(phi, phi);
  Lanes s = {}, v = {};
  if (any(square > 1.0 ? all(1) : all(0))) {
    s = each(square, [](double q) { return q > 1e-16 ? std::sin(std::sqrt(q)) / std::sqrt(q) : 1.0; });
    v = each(square, [](double q) { return q > 1e-8 ? (1.0 - std::cos(std::sqrt(q))) / q : 0.5; });
  } else {
    // sum (-q)^k / (2k + 1)!, and of / (2k + 2)!
    for (int k = any(square > 0.0625 ? all(1) : all(0)) ? 9 : 5; k >= 0; --k) {
      s = 1.0 - s * square * SERIES.odd[k];
      v = 1.0 - v * square * SERIES.even[k];
    }
    v *= 0.5;
  }
  const Matrix X = skew(phi), XX = X * X;
  return identity() + X * s + XX * v;
}

void logarithm(const double *R, double *phi) { // by the quaternion, of any rotation
  const double t[4] = {R[0] + R[4] + R[8], R[0] - R[4] - R[8], R[4] - R[0] - R[8], R[8] - R[0] - R[4]};
  const int i = static_cast<int>(std::max_element(t, t + 4) - t);
  const double d[3] = {R[7] - R[5], R[2] - R[6], R[3] - R[1]};
  double w = 1.0 + t[i], q[3];
  if (i == 0) {
    std::copy(d, d + 3, q);
  } else {
    const int a = i - 1, b = i % 3, c = (i + 1) % 3;
    q[a] = w;
    q[b] = R[3 * b + a] + R[3 * a + b];
    q[c] = R[3 * c + a] + R[3 * a + c];
    w = d[a];
  }
  const double size = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
  double scale = size > 1e-200 ? 2.0 * std::atan2(size, std::fabs(w)) / size : 2.0 / std::fabs(w);
  if (w < 0.0) scale = -scale;
  for (int j = 0; j < 3; ++j) phi[j] = scale * q[j];
}

// Rotation vector of a rotation matrix; below a twentieth of a radian by the series of the arc sine.
INLINE Vector logarithm(const Matrix &R) {
  Vector s = {0.5 * (R.a[7] - R.a[5]), 0.5 * (R.a[2] - R.a[6]), 0.5 * (R.a[3] - R.a[1])};
  const Lanes square = dot(s, s), trace = R.a[0] + R.a[4] + R.a[8];
  if (!any((square > 0.0025) | (trace < 2.0) ? all(1) : all(0))) {
    constexpr double c[] = {1.0, 1.0 / 6, 3.0 / 40, 5.0 / 112, 35.0 / 1152, 63.0 / 2816, 231.0 / 13312};
    Lanes f = all(c[6]);
    for (int k = 5; k >= 0; --k) f = f * square + c[k];
    return s * f;
  }
  for (int l = 0; l < LANES; ++l) {
    double one[9], phi[3];
    for (int i = 0; i < 9; ++i) one[i] = R.a[i][l];
    logarithm(one, phi);
    for (int i = 0; i < 3; ++i) s.a[i][l] = phi[i];
  }
  return s;
}

INLINE Matrix matrix(const Samples &s) {
  Matrix z;
  for (int i = 0; i < 9; ++i) z.a[i] = s[i];
  return z;
}
INLINE Vector vector(const Samples &s) { return {s[0], s[1], s[2]}; }

INLINE void put(const Lanes *a, int count, double *data, Size stride, Size first, int lanes) {
  for (int l = 0; l < lanes; ++l)
    for (int i = 0; i < count; ++i) data[(first + l) * stride + i] = a[i][l];
}

// Rate of the rotation vector of a body that turns at omega.
INLINE Vector bend(const Vector &phi, const Vector &omega) {
  const Vector c = cross(phi, omega);
  return omega - c * all(0.5) + cross(phi, c) * all(1.0 / 12);
}

// Where a flight is linearized: rotation, momentum, moment and its rate, world axes; inertia and h as cubics
// (power, step or 1, .) in the time since a sample, highest power first.
struct Course {
  Array step, R, H, T, dT, J, h;
  int substeps;

  Size steps() const { return step.shape(0); }

  // powers of a cubic in s, at eight steps
  template <int COUNT> INLINE void cubic(const Array &c, const Size *k, const Lanes &s, Lanes *out) const {
    const Size pieces = c.shape(1), stride = COUNT * pieces;
    Size piece[LANES];
    for (int l = 0; l < LANES; ++l) piece[l] = pieces > 1 ? k[l] : 0;
    const Samples at(c.data(), COUNT, piece);
    for (int i = 0; i < COUNT; ++i) {
      if (pieces == 1) out[i] = all(c.data()[3 * stride + i]); // one for all stands still
      else out[i] = ((at[i] * s + at[stride + i]) * s + at[2 * stride + i]) * s + at[3 * stride + i];
    }
  }

  // The turn of eight steps: R, d theta / d theta, and by what grows over the step as 1, s and s^2.
  INLINE void turn(const Size *k, Matrix &turned, Matrix &by_theta, Matrix *by_H) const {
    const Vector H0 = vector(Samples(H.data(), 3, k)), T0 = vector(Samples(T.data(), 3, k)),
                 dT0 = vector(Samples(dT.data(), 3, k));
    const Lanes whole = Samples(step.data(), 1, k)[0], g = whole / static_cast<double>(substeps);
    turned = matrix(Samples(R.data(), 9, k));
    by_theta = identity();
    for (int i = 0; i < 3; ++i) by_H[i] = identity() * all(0);
    const auto momentum = [&](const Lanes &s) { return H0 + T0 * s + dT0 * (0.5 * s * s); };
    const auto inertia_inverse = [&](const Lanes &s) {
      Matrix J_s;
      cubic<9>(J, k, s, J_s.a);
      return inverse(J_s);
    };
    const auto omega = [&](const Matrix &R_s, const Matrix &inv, const Lanes &s) {
      Vector h_s;
      cubic<3>(h, k, s, h_s.a);
      return R_s * (inv * (transposed(R_s) * momentum(s) - h_s));
    };
    for (int i = 0; i < substeps; ++i) {
      const Lanes s = g * static_cast<double>(i), middle = s + 0.5 * g;
      const Matrix inv = inertia_inverse(middle);
      const Vector k1 = omega(turned, inertia_inverse(s), s);
      const Vector half = k1 * (0.5 * g);
      const Vector k2 = bend(half, omega(exponential(half) * turned, inv, middle));
      const Vector again = k2 * (0.5 * g);
      const Matrix R_mid = exponential(again) * turned;
      const Vector k3 = bend(again, omega(R_mid, inv, middle)), last = k3 * g;
      const Vector k4 = bend(last, omega(exponential(last) * turned, inertia_inverse(s + g), s + g));
      turned = exponential((k1 + (k2 + k3) * all(2) + k4) * (g / 6.0)) * turned;
      const Matrix J_inv = R_mid * inv * transposed(R_mid), a = J_inv * skew(momentum(middle)) * g, aa = a * a;
      const Matrix forward = identity() + a + aa * all(0.5) + aa * a * all(1.0 / 6);
      const Matrix pushed = (identity() + a * all(0.5) + aa * all(0.125)) * J_inv;
      const Lanes grown[3] = {g, g * middle, g * (middle * middle + g * g / 12.0)};
      by_theta = forward * by_theta;
      for (int p = 0; p < 3; ++p) by_H[p] = forward * by_H[p] + pushed * grown[p];
    }
  }
};

template <typename Call> void in_eights(Size count, Call call) {
  for (Size first = 0; first < count; first += LANES) {
    Size k[LANES];
    for (int l = 0; l < LANES; ++l) k[l] = std::min(first + l, count - 1);
    call(first, k, static_cast<int>(std::min<Size>(LANES, count - first)));
  }
}

Three turn(Array step, Array R, Array H, Array T, Array dT, Array J, Array h, int substeps) {
  const Course course{step, R, H, T, dT, J, h, substeps};
  const Size steps = course.steps();
  Out turned_({steps, 3, 3}), by_theta_({steps, 3, 3}),
      by_H_({3, steps, 3, 3});
  double *turned = turned_.data(), *by_theta = by_theta_.data(), *by_H = by_H_.data();
  {
    in_eights(steps, [&](Size first, const Size *k, int lanes) {
      Matrix R_end, theta, by[3];
      course.turn(k, R_end, theta, by);
      put(R_end.a, 9, turned, 9, first, lanes);
      put(theta.a, 9, by_theta, 9, first, lanes);
      for (int p = 0; p < 3; ++p) put(by[p].a, 9, by_H + p * steps * 9, 9, first, lanes);
    });
  }
  return std::make_tuple(turned_, by_theta_, by_H_);
}

// Rows of theta in F and in Q of each step, and in its known input; chain F, Q (kind, state, state) of kinds
// of step, `which` kind each is; axes of the chain; chain (time, state) of the reference.
Three rotation_rows(Array step, Array R, Array H, Array T, Array dT, Array J, Array h, int substeps, Array F_,
                        Array Q_, Index which_, Array axes_, Array chain_) {
  const Course course{step, R, H, T, dT, J, h, substeps};
  const Size steps = course.steps(), kinds = F_.shape(0);
  const int n = static_cast<int>(F_.shape(1));
  Out top_({steps, 3, n}), noise_({steps, 3, n}), push_({steps, 3});
  double *top = top_.data(), *noise = noise_.data(), *push = push_.data();
  const double *F = F_.data(), *Q = Q_.data();
  const Size *which = which_.data();
  std::vector<char> in_F(n * n, 0), in_Q(n * n, 0);
  for (Size i = 0; i < kinds * n * n; ++i) {
    in_F[i % (n * n)] |= F[i] != 0.0;
    in_Q[i % (n * n)] |= Q[i] != 0.0;
  }
  Matrix axes;
  for (int i = 0; i < 9; ++i) axes.a[i] = all(axes_.data()[i]);
  {
    Fleet out(3 * n), spread(3 * n), F_k(n * n), Q_k(n * n);
    in_eights(steps, [&](Size first, const Size *k, int lanes) {
      Matrix R_end, theta, by[3];
      course.turn(k, R_end, theta, by);
      const Lanes s = Samples(course.step.data(), 1, k)[0], inv = 1.0 / s;
      const Matrix by_Y = (by[1] + by[2] * -inv) * (6.0 * inv * inv) * axes;
      const Matrix by_momentum = (by[2] * (3.0 * inv) + by[1] * all(-2)) * inv * axes, start = by[0] * axes;
      Size kind[LANES], next[LANES];
      for (int l = 0; l < LANES; ++l) {
        kind[l] = which[k[l]];
        next[l] = k[l] + 1;
      }
      if (first == 0 || kinds > 1) {
        const Samples F_at(F, n * n, kind), Q_at(Q, n * n, kind);
        for (int i = 0; i < 6 * n; ++i) {
          if (in_F[i]) F_k[i] = F_at[i];
          if (in_Q[i]) Q_k[i] = Q_at[i];
        }
      }
      const auto led = [&](const Fleet &a, const std::vector<char> &held, int i, int j) {
        Lanes sum = {};
        for (int l = 0; l < 3; ++l) {
          if (held[l * n + j]) sum += by_Y.a[3 * i + l] * a[l * n + j];
          if (held[(l + 3) * n + j]) sum += by_momentum.a[3 * i + l] * a[(l + 3) * n + j];
        }
        return sum;
      };
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < n; ++j) {
          out[i * n + j] = j < 3 ? theta.a[3 * i + j] : j < 6 ? start.a[3 * i + j - 3] : led(F_k, in_F, i, j);
          spread[i * n + j] = led(Q_k, in_Q, i, j);
        }
      put(out.data(), 3 * n, top, 3 * n, first, lanes);
      const Samples chain(chain_.data(), n, k);
      Vector u = logarithm(R_end * transposed(matrix(Samples(course.R.data(), 9, next))));
      for (int j = 0; j < n; ++j) {
        const Lanes about = chain[j];
        for (int i = 0; i < 3; ++i) u.a[i] -= out[i * n + j] * about;
      }
      put(u.a, 3, push, 3, first, lanes);
      Lanes square[9];
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
          square[3 * i + j] = Lanes{};
          for (int l = 0; l < 3; ++l)
            square[3 * i + j] += spread[i * n + l] * by_Y.a[3 * j + l] + spread[i * n + 3 + l] * by_momentum.a[3 * j + l];
        }
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) spread[i * n + j] = square[3 * i + j];
      put(spread.data(), 3 * n, noise, 3 * n, first, lanes);
    });
  }
  return std::make_tuple(top_, noise_, push_);
}

// ---- the smoother ---------------------------------------------------------------------------------------

INLINE void transpose(const Lanes *a, Lanes *t, int n) {
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) t[j * n + i] = a[i * n + j];
}

// A model of a flight: the matrices of its kinds of steps, and those rows of each step that turn with the body.
struct Chain {
  Array F, Q, u;           // (kind, state, state), (kind, state)
  Index which;             // (step,) kind
  Array top, noise, push;  // rows of theta: (step, 3, states behind theta's first), and (step, 3)
  Array H, R, z;           // (channel, state), (time, channel, channel), (time, channel)
  Array read;              // (12, state): wrench, then pose
  int n, m, theta;         // sizes; first state of theta

  Size time() const { return z.shape(0); }
};

// What is kept of one sample of every lane between the way forward and back.
struct Kept {
  Fleet P, x, white, L, e, seen, F; // packed, states, (state, channel), (channel, channel), ..., by F's pattern
};

struct Smoother {
  const Chain &c;
  const int n, m;
  const int turning; // states from theta on
  const Size kinds;
  Pattern in_F, in_Ft, in_H, in_read;
  std::vector<int> to_F, measured; // entry of F's pattern of each of F^T's; states that channels read
  Fleet P, x, A, Fv, Q, u, PH, S, white, e, seen;
  std::vector<double> Hv, readv;
  double weakest = 1.0, kept_least = 1.0; // pivot of S in units of its diagonal; part of a variance that was left

  static bool held(const Array &a, Size kinds, Size size, Size i) {
    for (Size k = 0; k < kinds; ++k)
      if (a.data()[k * size + i] != 0.0) return true;
    return false;
  }

  explicit Smoother(const Chain &chain)
      : c(chain), n(chain.n), m(chain.m), turning(chain.n - chain.theta), kinds(chain.F.shape(0)),
        in_F(n, n, [&](int i, int j) { return (is_top(i) && j >= c.theta) || held(c.F, kinds, n * n, i * n + j); }),
        in_Ft(n, n, [&](int i, int j) { return (is_top(j) && i >= c.theta) || held(c.F, kinds, n * n, j * n + i); }),
        in_H(m, n, [&](int i, int j) { return c.H.data()[i * n + j] != 0.0; }),
        in_read(12, n, [&](int i, int j) { return c.read.data()[i * n + j] != 0.0; }), P(n * n), x(n), A(n * n),
        Fv(in_F.column.size()), Q(n * n), u(n), PH(n * m), S(m * m), white(n * m), e(m), seen(m) {
    std::vector<int> where(n * n, -1);
    for (size_t l = 0; l < in_F.entry.size(); ++l) where[in_F.entry[l]] = static_cast<int>(l);
    for (int entry : in_Ft.entry) to_F.push_back(where[(entry % n) * n + entry / n]);
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < m; ++i)
        if (c.H.data()[i * n + j] != 0.0) {
          measured.push_back(j);
          break;
        }
    for (int entry : in_H.entry) Hv.push_back(c.H.data()[entry]);
    for (int entry : in_read.entry) readv.push_back(c.read.data()[entry]);
  }

  bool is_top(int i) const { return i >= c.theta && i < c.theta + 3; }

  // F, Q and u of the steps to the samples f
  INLINE void load_step(const Size *f, bool first) {
    Size k[LANES], kind[LANES];
    for (int l = 0; l < LANES; ++l) {
      k[l] = f[l] - 1;
      kind[l] = c.which.data()[k[l]];
    }
    if (first || kinds > 1) {
      const Samples F_k(c.F.data(), n * n, kind), Q_k(c.Q.data(), n * n, kind), u_k(c.u.data(), n, kind);
      for (size_t l = 0; l < Fv.size(); ++l) Fv[l] = F_k[in_F.entry[l]];
      for (int i = 0; i < n * n; ++i) Q[i] = Q_k[i];
      for (int i = 0; i < n; ++i) u[i] = u_k[i];
    }
    if (turning == 0) return;
    const Samples top(c.top.data(), 3 * turning, k), noise(c.noise.data(), 3 * turning, k), push(c.push.data(), 3, k);
    for (int i = 0; i < 3; ++i) {
      const int row = c.theta + i;
      Lanes *values = &Fv[in_F.begin[row + 1] - turning]; // behind theta all are held
      for (int j = 0; j < turning; ++j) values[j] = top[i * turning + j];
      for (int j = 0; j < turning; ++j) {
        const Lanes q = noise[i * turning + j];
        if (j >= 3) Q[(c.theta + j) * n + row] = q; // only the lower half is read
        else Q[row * n + c.theta + j] = q;
      }
      u[row] = push[i];
    }
  }

  INLINE void predict() {
    for (int i = 0; i < n; ++i) {
      Lanes sum = u[i];
      for (int l = in_F.begin[i]; l < in_F.begin[i + 1]; ++l) sum += Fv[l] * x[in_F.column[l]];
      A[i] = sum;
    }
    std::copy(A.begin(), A.begin() + n, x.begin());
    congruence(in_F.begin.data(), in_F.column.data(), Fv.data(), P.data(), A.data(), n);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j) P[i * n + j] = P[j * n + i] = P[i * n + j] + Q[i * n + j];
  }

  // The update at samples f; S becomes its Cholesky factor, with one over the diagonal in place of it.
  INLINE void update(const Size *f, bool watch) {
    const Samples z(c.z.data(), m, f), R(c.R.data(), m * m, f);
    for (int i = 0; i < m; ++i) {
      const Lanes zi = z[i];
      seen[i] = zi == zi ? all(1) : all(0);
      e[i] = zi == zi ? zi : all(0);
      Lanes predicted = {};
      for (int l = in_H.begin[i]; l < in_H.begin[i + 1]; ++l) predicted += Hv[l] * x[in_H.column[l]];
      e[i] -= seen[i] * predicted;
      for (int j = 0; j < n; ++j) {
        Lanes sum = {};
        for (int l = in_H.begin[i]; l < in_H.begin[i + 1]; ++l) sum += Hv[l] * P[in_H.column[l] * n + j];
        PH[j * m + i] = sum * seen[i];
      }
    }
    for (int i = 0; i < m; ++i)
      for (int j = 0; j <= i; ++j) {
        Lanes sum = R[i * m + j] * seen[i];
        for (int l = in_H.begin[i]; l < in_H.begin[i + 1]; ++l) sum += Hv[l] * PH[in_H.column[l] * m + j];
        S[i * m + j] = i == j ? sum * seen[i] + (1.0 - seen[i]) : sum * seen[i] * seen[j];
      }
    Lanes least = all(1);
    for (int j = 0; j < m; ++j) {
      Lanes d = S[j * m + j];
      const Lanes size = d;
      for (int l = 0; l < j; ++l) d -= S[j * m + l] * S[j * m + l];
      const Lanes part = d / size;
      least = part < least ? part : least;
      d = 1.0 / root(d);
      for (int i = j + 1; i < m; ++i) {
        Lanes sum = S[i * m + j];
        for (int l = 0; l < j; ++l) sum -= S[i * m + l] * S[j * m + l];
        S[i * m + j] = sum * d;
      }
      S[j * m + j] = d;
    }
    for (int i = 0; i < m; ++i) {
      for (int l = 0; l < i; ++l) e[i] -= S[i * m + l] * e[l];
      e[i] *= S[i * m + i];
    }
    spread(least, watch);
    if (watch)
      for (int l = 0; l < LANES; ++l)
        if (!(least[l] > weakest)) weakest = least[l];
  }

  // white = P H^T L^-T, x += white e, P -= white white^T
  INLINE void spread(Lanes &least, bool watch) {
    Lanes w[6];
    for (int i = 0; i < n; ++i) {
      for (int a = 0; a < m; ++a) {
        Lanes sum = PH[i * m + a];
        for (int l = 0; l < a; ++l) sum -= w[l] * S[a * m + l];
        w[a] = sum * S[a * m + a];
      }
      for (int a = 0; a < m; ++a) {
        white[i * m + a] = w[a];
        x[i] += w[a] * e[a];
      }
      const Lanes before = P[i * n + i];
      for (int j = 0; j <= i; ++j) {
        Lanes sum = P[i * n + j];
        for (int a = 0; a < m; ++a) sum -= w[a] * white[j * m + a];
        P[i * n + j] = P[j * n + i] = sum;
      }
      if (watch) {
        const Lanes part = before > 0.0 ? P[i * n + i] / before * (ALIKE / LOST) : all(1);
        least = part < least ? part : least;
      }
    }
  }

  void pack(Fleet &out) const {
    out.resize(n * (n + 1) / 2);
    Lanes *to = out.data();
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j) *to++ = P[i * n + j];
  }

  void unpack(const Fleet &in, Fleet &full) const {
    const Lanes *from = in.data();
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j) full[i * n + j] = full[j * n + i] = *from++;
  }
};

// Lanes `a` of one state and those of the next lane of another, in units of its deviations: largest difference.
double apart(const Fleet &P, const Fleet &x, const Fleet &P_next, const Fleet &x_next, int n, int lanes) {
  double worst = 0.0;
  for (int l = 0; l + 1 < lanes; ++l)
    for (int i = 0; i < n; ++i) {
      const double var = P[i * (i + 1) / 2 + i][l];
      worst = std::max(worst, (x[i][l] - x_next[i][l + 1]) * (x[i][l] - x_next[i][l + 1]) / (var + 1e-300));
      for (int j = 0; j <= i; ++j) {
        const double other = P[j * (j + 1) / 2 + j][l], d = P[i * (i + 1) / 2 + j][l] - P_next[i * (i + 1) / 2 + j][l + 1];
        if (d != 0.0) worst = std::max(worst, d * d / (var * other + 1e-300));
      }
    }
  return std::sqrt(worst);
}

enum Mode { STATES, SMOOTHED, FILTERED };

// The way back: what later samples add, as Bryson and Frazier's adjoint r of states and Later of covariances.
struct Adjoint {
  const int n, m;
  Fleet r, Later, g, U, G, Z, A, Ft;
  std::vector<int> every;

  explicit Adjoint(const Smoother &s)
      : n(int(s.n)), m(int(s.m)), r(n), Later(n * n), g(n + m), U(n * m), G(m * m), Z(m * m), A(n * n) {}

  // through the update of a sample and the step to it: r <- F^T (r + H^T L^-T (e - white^T r)), and so Later
  template <bool COVARIANCES> INLINE void back(const Smoother &s, const Kept &k) {
    const Lanes *L = k.L.data(), *white = k.white.data();
    for (int a = 0; a < m; ++a) {
      Lanes sum = k.e[a];
      for (int i = 0; i < n; ++i) sum -= white[i * m + a] * r[i];
      g[a] = sum;
    }
    for (int a = m - 1; a >= 0; --a) {
      for (int b = a + 1; b < m; ++b) g[a] -= L[b * m + a] * g[b];
      g[a] *= L[a * m + a];
    }
    for (int a = 0; a < m; ++a)
      for (int l = s.in_H.begin[a]; l < s.in_H.begin[a + 1]; ++l) r[s.in_H.column[l]] += s.Hv[l] * (g[a] * k.seen[a]);
    if (COVARIANCES) told(s, k);
    for (int i = 0; i < n; ++i) {
      Lanes sum = {};
      for (int l = s.in_Ft.begin[i]; l < s.in_Ft.begin[i + 1]; ++l) sum += k.F[s.to_F[l]] * r[s.in_Ft.column[l]];
      g[i] = sum;
    }
    std::copy(g.begin(), g.begin() + n, r.begin());
    if (!COVARIANCES) return;
    Ft.resize(s.to_F.size());
    for (size_t l = 0; l < s.to_F.size(); ++l) Ft[l] = k.F[s.to_F[l]];
    congruence(s.in_Ft.begin.data(), s.in_Ft.column.data(), Ft.data(), Later.data(), A.data(), n);
    mirror(Later.data(), n);
  }

  // Later <- (1 - K H)^T Later (1 - K H) + H^T S^-1 H, with K = white L^-1, S = L L^T
  INLINE void told(const Smoother &s, const Kept &k) {
    const Lanes *L = k.L.data(), *white = k.white.data();
    every.resize(n);
    for (int i = 0; i < n; ++i) every[i] = i;
    for (int i = 0; i < n; ++i) multiply_row(&Later[i * n], every.data(), n, white, m, &U[i * m], m);
    for (int a = 0; a < m; ++a)
      for (int b = 0; b <= a; ++b) {
        Lanes sum = a == b ? k.seen[a] : Lanes{};
        for (int l = 0; l < n; ++l) sum += white[l * m + a] * U[l * m + b];
        G[a * m + b] = G[b * m + a] = sum;
      }
    const auto times_inverse = [&](Lanes *y) { // y L^-1 of a row
      for (int a = m - 1; a >= 0; --a) {
        for (int b = a + 1; b < m; ++b) y[a] -= y[b] * L[b * m + a];
        y[a] *= L[a * m + a];
      }
    };
    for (int i = 0; i < n; ++i) times_inverse(&U[i * m]);
    for (int a = 0; a < m; ++a) times_inverse(&G[a * m]);
    transpose(G.data(), Z.data(), m);
    for (int a = 0; a < m; ++a) times_inverse(&Z[a * m]);
    // rows and columns of the states that channels read
    for (int a = 0; a < m; ++a)
      for (int l = s.in_H.begin[a]; l < s.in_H.begin[a + 1]; ++l) {
        const int j = s.in_H.column[l];
        const double h = s.Hv[l];
        for (int i = 0; i < n; ++i) {
          const Lanes d = h * U[i * m + a];
          Later[i * n + j] -= d;
          Later[j * n + i] -= d;
        }
        for (int b = 0; b < m; ++b)
          for (int q = s.in_H.begin[b]; q < s.in_H.begin[b + 1]; ++q)
            Later[j * n + s.in_H.column[q]] += h * s.Hv[q] * Z[a * m + b];
      }
  }
};

Smoothed smooth(Array F, Array Q, Array u, Index which, Array top, Array noise, Array push, Array H, Array R, Array z,
                 Array read, int theta, Array P0, Array x0, Size first, Size warm, bool cut, int mode) {
  const int n = static_cast<int>(F.shape(1)), m = static_cast<int>(z.shape(1));
  if (m > 6) throw std::invalid_argument("more than six channels");
  const Size T = z.shape(0), left_over = T - first;
  const Chain c{F, Q, u, which, top, noise, push, H, R, z, read, n, m, theta};
  Out x_({T, n}), wrench_({T, 6, 6}), pose_({T, 6, 6}), white_({T, m}),
      r_({n}), Later_({n, n});
  double *x = x_.data(), *white = white_.data(), *r = r_.data(), *Later = Later_.data();
  double *cov[2] = {wrench_.data(), pose_.data()};
  double log_likelihood = 0.0, meet = 0.0, left = 1.0, weakest = 1.0;
  {
    const Size D = cut ? (left_over - 2 * warm) / LANES : 0, J = left_over - (LANES - 1) * D;
    const int lanes = cut ? LANES : 1;
    Size start[LANES], begin[LANES], end[LANES];
    for (int l = 0; l < LANES; ++l) start[l] = first + l * D;
    for (int l = 0; l < LANES; ++l) {
      begin[l] = l == 0 ? first : l < lanes ? start[l] + warm : T;
      end[l] = l == lanes - 1 ? T : l < lanes ? start[l + 1] + warm : 0;
    }
    Smoother s(c);
    for (int i = 0; i < n * n; ++i) s.P[i] = all(P0.data()[i]);
    for (int i = 0; i < n; ++i)
      for (int l = 0; l < LANES; ++l) s.x[i][l] = x0.data()[l * n + i];
    const auto mine = [&](int l, Size f) { return f >= begin[l] && f < end[l]; };
    const auto samples = [&](Size j, Size *f) {
      for (int l = 0; l < LANES; ++l) f[l] = start[l] + j;
    };
    std::vector<Kept> marks((J + BLOCK - 1) / BLOCK);
    Fleet rp(12 * n), V(12 * n);
    std::vector<int> every(n);
    for (int i = 0; i < n; ++i) every[i] = i;
    // of a covariance read out: P seen through `read`, less what later samples take
    const auto put_covariance = [&](const Fleet &full, const Fleet *later, const Size *f) {
      for (int i = 0; i < 12; ++i) {
        const int from = s.in_read.begin[i], count = s.in_read.begin[i + 1] - from;
        for (int j = 0; j < n; ++j) {
          Lanes sum = {};
          for (int l = from; l < from + count; ++l) sum += s.readv[l] * full[s.in_read.column[l] * n + j];
          rp[i * n + j] = sum;
        }
        if (later) multiply_row(&rp[i * n], every.data(), n, later->data(), n, &V[i * n], n);
      }
      for (int part = 0; part < 2; ++part) {
        Lanes out[36], share = all(1);
        for (int i = 0; i < 6; ++i)
          for (int j = 0; j <= i; ++j) {
            const int a = 6 * part + i, b = 6 * part + j;
            Lanes before = {}, taken = {};
            for (int l = s.in_read.begin[b]; l < s.in_read.begin[b + 1]; ++l)
              before += s.readv[l] * rp[a * n + s.in_read.column[l]];
            if (later)
              for (int l = 0; l < n; ++l) taken += V[a * n + l] * rp[b * n + l];
            out[6 * i + j] = out[6 * j + i] = before - taken;
            if (i == j) share = before > 0.0 && (before - taken) / before < share ? (before - taken) / before : share;
          }
        for (int l = 0; l < lanes; ++l)
          if (mine(l, f[l])) {
            for (int i = 0; i < 36; ++i) cov[part][f[l] * 36 + i] = out[i][l];
            left = std::min(left, share[l]);
          }
      }
    };
    Kept begun, ended;
    Size f[LANES];
    for (Size j = 0; j < J; ++j) {
      samples(j, f);
      if (j % BLOCK == 0 && mode != FILTERED) {
        s.pack(marks[j / BLOCK].P);
        marks[j / BLOCK].x = s.x;
      }
      s.load_step(f, j == 0);
      s.predict();
      s.update(f, true);
      for (int l = 0; l < lanes; ++l)
        if (mine(l, f[l]))
          for (int a = 0; a < m; ++a) {
            white[f[l] * m + a] = s.seen[a][l] != 0.0 ? s.e[a][l] : std::nan("");
            log_likelihood += s.seen[a][l] != 0.0
                                  ? std::log(s.S[a * m + a][l]) - 0.5 * (s.e[a][l] * s.e[a][l] + LOG_2PI)
                                  : 0.0;
          }
      if (mode == FILTERED) {
        for (int l = 0; l < lanes; ++l)
          if (mine(l, f[l]))
            for (int i = 0; i < n; ++i) x[f[l] * n + i] = s.x[i][l];
        put_covariance(s.P, nullptr, f);
      }
      if (cut && j == warm - 1) s.pack(begun.P), begun.x = s.x;
      if (cut && j == D + warm - 1) s.pack(ended.P), ended.x = s.x;
    }
    weakest = s.weakest;
    if (cut) meet = apart(ended.P, ended.x, begun.P, begun.x, n, lanes);
    if (mode != FILTERED && weakest > ALIKE && meet < AGREES) {
      Adjoint back(s);
      std::vector<Kept> block(BLOCK);
      Fleet full(n * n), state(n), r_begun, r_ended;
      Fleet Later_begun, Later_ended;
      for (Size b = static_cast<Size>(marks.size()); b-- > 0;) {
        const Size from = b * BLOCK, to = std::min(J, from + BLOCK);
        s.unpack(marks[b].P, s.P);
        s.x = marks[b].x;
        for (Size j = from; j < to; ++j) {
          samples(j, f);
          s.load_step(f, false);
          s.predict();
          s.update(f, false);
          Kept &k = block[j - from];
          s.pack(k.P);
          k.x = s.x, k.white = s.white, k.L = s.S, k.e = s.e, k.seen = s.seen, k.F = s.Fv;
        }
        for (Size j = to; j-- > from;) {
          samples(j, f);
          const Kept &k = block[j - from];
          if (cut && j == D + warm - 1) r_ended = back.r, Later_ended = back.Later;
          s.unpack(k.P, full);
          for (int i = 0; i < n; ++i) {
            Lanes sum = k.x[i];
            for (int l = 0; l < n; ++l) sum += full[i * n + l] * back.r[l];
            state[i] = sum;
          }
          for (int l = 0; l < lanes; ++l)
            if (mine(l, f[l]))
              for (int i = 0; i < n; ++i) x[f[l] * n + i] = state[i][l];
          if (mode == SMOOTHED) {
            put_covariance(full, &back.Later, f);
            back.back<true>(s, k);
          } else {
            back.back<false>(s, k);
          }
          if (cut && j == warm) r_begun = back.r, Later_begun = back.Later;
        }
      }
      for (int i = 0; i < n; ++i) {
        r[i] = back.r[i][0];
        for (int j = 0; j < n; ++j) Later[i * n + j] = back.Later[i * n + j][0];
      }
      if (cut)
        for (int l = 0; l + 1 < lanes; ++l)
          for (int i = 0; i < n; ++i) {
            const double size = std::sqrt(ended.P[i * (i + 1) / 2 + i][l]);
            meet = std::max(meet, size * std::fabs(r_ended[i][l] - r_begun[i][l + 1]));
            for (int j = 0; j <= i; ++j)
              meet = std::max(meet, size * std::sqrt(ended.P[j * (j + 1) / 2 + j][l]) *
                                        std::fabs(Later_ended[i * n + j][l] - Later_begun[i * n + j][l + 1]));
          }
    }
  }
  const char *found = !(weakest > ALIKE && left > LOST) ? "ill" : !(meet < AGREES) ? "apart" : "";
  return std::make_tuple(found, x_, wrench_, pose_, white_, log_likelihood, r_, Later_, meet);
}

// Rotation vectors (time, 3) of A B^T, and rotations (time, 3, 3) exp(phi) R.
Out between(Array A, Array B) {
  const Size T = A.shape(0);
  Out out({T, 3});
  double *phi = out.data();
  in_eights(T, [&](Size first, const Size *k, int lanes) {
    const Vector v = logarithm(matrix(Samples(A.data(), 9, k)) * transposed(matrix(Samples(B.data(), 9, k))));
    put(v.a, 3, phi, 3, first, lanes);
  });
  return out;
}

Out turned(Array phi, Array R) {
  const Size T = R.shape(0);
  Out out({T, 3, 3});
  double *data = out.data();
  in_eights(T, [&](Size first, const Size *k, int lanes) {
    const Matrix z = exponential(vector(Samples(phi.data(), 3, k))) * matrix(Samples(R.data(), 9, k));
    put(z.a, 9, data, 9, first, lanes);
  });
  return out;
}

constexpr Flights table = {LANES, turn, rotation_rows, smooth, between, turned};

} // namespace flight
} // namespace
