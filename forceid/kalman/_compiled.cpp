// The passes of the linear Gaussian estimators, compiled for every kind of processor that gains by it.

#include "../processor.hpp"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>
#include <vector>

namespace py = pybind11;

namespace {

using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Mask = py::array_t<unsigned char, py::array::c_style | py::array::forcecast>;
using Starts = py::array_t<py::ssize_t, py::array::c_style | py::array::forcecast>;
using Buffer = std::vector<double>;

} // namespace

#define CHANNEL(X)                                                                                            \
  X(1, 1) X(2, 1) X(3, 1) X(4, 1) X(5, 1) X(6, 1)
#define FEW(X) X(6, 2) X(9, 3)
#define MANY(X) X(12, 6) X(30, 30)

#if !DISPATCHES

#define SIZES(X) CHANNEL(X) FEW(X) MANY(X)
#define ARCH baseline
#define REGISTER 2
#include "passes.hpp"

#else

#define SIZES(X)
#define ARCH baseline
#define REGISTER 2
#include "passes.hpp"
#undef ARCH
#undef REGISTER
#undef SIZES

#pragma GCC push_options
V3
#define SIZES(X) CHANNEL(X) FEW(X) MANY(X)
#define ARCH v3
#define REGISTER 4
#include "passes.hpp"
#undef ARCH
#undef REGISTER
#undef SIZES
#pragma GCC pop_options

#pragma GCC push_options
V4
#define SIZES(X) MANY(X)
#define ARCH v4
#define REGISTER 8
#define BELOW v3
#include "passes.hpp"
#undef BELOW
#undef ARCH
#undef REGISTER
#undef SIZES
#pragma GCC pop_options

#endif

namespace {

struct Passes {
  decltype(&baseline::covariances) covariances;
  decltype(&baseline::information) information;
  decltype(&baseline::combined) combined;
  decltype(&baseline::means) means;
  decltype(&baseline::smoothed) smoothed;
  decltype(&baseline::likelihoods) likelihoods;
};

Passes passes(const std::string &arch) {
#if DISPATCHES
  if (arch == "v4")
    return {v3::covariances, v3::information, v3::combined, v4::means, v4::smoothed, v4::likelihoods};
  if (arch == "v3") return {v3::covariances, v3::information, v3::combined, v3::means, v3::smoothed, v3::likelihoods};
#endif
  return {baseline::covariances, baseline::information, baseline::combined,
          baseline::means,       baseline::smoothed,    baseline::likelihoods};
}

} // namespace

PYBIND11_MODULE(_compiled, module) {
  module.doc() = "The passes of passes.py, compiled";
  const std::string arch = processor();
  const Passes chosen = passes(arch);
  module.attr("arch") = arch;
  module.def("covariance_pass", chosen.covariances);
  module.def("mean_pass", chosen.means);
  module.def("adjoint_pass", chosen.smoothed);
  module.def("information_pass", chosen.information);
  module.def("combine", chosen.combined);
  module.def("log_likelihood", chosen.likelihoods);
}
