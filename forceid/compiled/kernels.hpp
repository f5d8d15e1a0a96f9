// What is compiled once for each kind of processor: one table of functions for each.

#pragma once

#include "array.hpp"

#include <cstdint>
#include <tuple>

using Two = std::tuple<Out, Out>;
using Three = std::tuple<Out, Out, Out>;
using Four = std::tuple<Out, Out, Out, Out>;
using Five = std::tuple<Out, Out, Out, Out, Out>;
using Poses = std::tuple<Out, Out, Out, Out, Out>;
using Runs = std::tuple<Tensor<Size>, Out, Out, Out, Out, Size>;
using Later = std::tuple<Tensor<Size>, Out, Size>;
using Followed = std::tuple<Out, Out, Out, Out, Out, Out, double>;
using Onward = std::tuple<Out, Out, Out, Out, Out, Out, double, Out, Out, Out>;
using Looked = std::tuple<Out, Out, Out, Out, Out, bool>;
using Smoothed = std::tuple<const char *, Out, Out, Out, Out, double, Out, Out, double>;

// kalman/passes.hpp
struct Passes {
  Runs (*covariance_pass)(Array F, Array Q, Array H, Array R, Array P0, Mask seen, bool steady);
  Out (*mean_pass)(Array F, Array u, Array H, Index start, Array K, Array x0, Array z);
  Out (*adjoint_pass)(Array F, Array u, Array H, Index start, Array P, Array K, Array W, Array G, Array z, Array x);
  Later (*information_pass)(Array F, Array Q, Array H, Array R, Mask seen, bool steady);
  Out (*combine)(Array P, Array later);
  Out (*log_likelihood)(Array F, Array Q, Index kind, Array H, Array R, Array u, Array x0, Array P0, Array z,
                        Mask seen, double limit, bool steady);
  Out (*innovations)(Array F, Array Q, Array H, Array R, Array u, Array x0, Array P0, Array z, Mask seen);
};

// flight/flight.hpp
struct Flights {
  int lanes;
  Three (*turn)(Array step, Array R, Array H, Array T, Array dT, Array J, Array h, int substeps);
  Three (*rotation_rows)(Array step, Array R, Array H, Array T, Array dT, Array J, Array h, int substeps, Array F,
                         Array Q, Index which, Array axes, Array chain);
  Smoothed (*smooth)(Array F, Array Q, Array u, Index which, Array top, Array noise, Array push, Array H, Array R,
                     Array z, Array read, int theta, Array P0, Array x0, Size first, Size warm, bool cut, int mode);
  Out (*between)(Array A, Array B);
  Out (*turned)(Array phi, Array R);
};

// principal/folded.hpp, motion/poses.hpp and kabsch.hpp, pseudorigid/polar.hpp and splitting.hpp
struct Bodies {
  void (*sums)(Array A, Array W, Out out);
  Poses (*fitted)(Array position, Index frames, Index nodes, Array shape, Array begin, Array weight, Array A,
                  Array C);
  Three (*turned)(Array position, Array shape, Array weight);
  Three (*polar)(Array F);
  Four (*bipolar)(Array F);
  void (*steps)(Out F, Out V, Out F_low, Out V_low, Tensor<std::int8_t> stopped, Array kick, Array drift, Size n,
                double a, double b, double c, double d, bool volumetric, Array over);
};

// kalman/fixed_lag.hpp
struct Lags {
  Followed (*follow)(Array P, Array gain, Array R, Array y, Array C, Array var, Array F, Array Q, Array x, Array rows,
                     Array z, Array noise, double most);
};

// kalman/steps.hpp
struct Steps {
  Two (*discretized)(Array A, Array Qc, Array step, Index process);
};

// kalman/whitening.hpp
struct Whitening {
  Out (*whitened)(Array F, Array H, Array K, Array W, Array move, Array turn, Array moved, Array pushed);
};

// flight/spectra.hpp
struct Spectra {
  Three (*misfit)(Array rows, Array power, Array density, Array count, Array moves);
  Three (*slopes)(double gain, Array w, Array count, Array noise, Array power, Array total, Array x, Index order,
                  Array unit);
  Out (*scoring_step)(Array slope, Array bend, Array down, Array up, Array share, double ridge);
};

// flight/body_fixed.hpp
struct BodyFixed {
  Two (*fixed)(Array F, Array Q, Index which, Array early, Array mean, Array at, Size n);
};

// flight/lead.hpp and look.hpp
struct Leads {
  Two (*along)(Array F, Array Q, Array turn, Array R, Array own, Size n, double small);
  Onward (*onward)(Array P, Array gain, Array noise_before, Array y, Array C, Array var, Array x, Array R, Array F,
                   Array Q, Array axes, Array J_now, Array h_now, Array J_then, Array h_then, double step,
                   double least, double substep, Array rows, Array own, Size states, Array read, double small,
                   bool turns, Array seen, Array cov, double most);
  Looked (*look)(Array position, Index nodes, Array shape, Array weight, Array A, Array C, Array share, Array x,
                 Array onward, Array gain, Array leak, Array inertia, Array momentum, Array inside, Size each);
};

// kalman/shocks.hpp
struct Shocks {
  Two (*seen)(Array F, Array H, Index run, Array K, Array W, Array v, Mask seen, Size first, Size stop);
};

struct Kernels {
  Passes passes;
  Flights flights;
  Bodies bodies;
  Lags lags;
  Steps steps;
  Spectra spectra;
  Whitening whitening;
  BodyFixed body_fixed;
  Leads leads;
  Shocks shocks;
};

extern const Kernels baseline_kernels, v3_kernels; // v3: AVX2 with FMA
extern const Passes v4_passes;                     // AVX-512, by which the others gain nothing more
