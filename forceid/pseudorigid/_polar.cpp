// polar.hpp, compiled for every kind of processor that gains by it.

#include "../processor.hpp"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>

namespace py = pybind11;

namespace {

using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Size = py::ssize_t;

} // namespace

#define ARCH baseline
#define REGISTER 2
#include "polar.hpp"
#undef ARCH
#undef REGISTER

#if DISPATCHES
#pragma GCC push_options
V3
#define ARCH v3
#define REGISTER 4
#include "polar.hpp"
#undef ARCH
#undef REGISTER
#pragma GCC pop_options
#else
namespace v3 = baseline;
#endif

PYBIND11_MODULE(_polar, module) {
  module.doc() = "Polar and bipolar factors, compiled";
  const bool wide = processor() != "baseline";
  module.def("polar", wide ? v3::polar : baseline::polar);
  module.def("bipolar", wide ? v3::bipolar_factors : baseline::bipolar_factors);
}
