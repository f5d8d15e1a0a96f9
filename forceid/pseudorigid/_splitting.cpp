// splitting.hpp, compiled for every kind of processor that gains by it.

#include "../processor.hpp"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

namespace py = pybind11;

namespace {

using Array = py::array_t<double, py::array::c_style>;
using Size = py::ssize_t;

} // namespace

#define ARCH baseline
#define REGISTER 2
#include "splitting.hpp"
#undef ARCH
#undef REGISTER

#if DISPATCHES
#pragma GCC push_options
V3
#define ARCH v3
#define REGISTER 4
#include "splitting.hpp"
#undef ARCH
#undef REGISTER
#pragma GCC pop_options
#else
namespace v3 = baseline;
#endif

PYBIND11_MODULE(_splitting, module) {
  module.doc() = "Kicks and drifts of many Mooney-Rivlin bodies";
  const bool wide = processor() != "baseline";
  module.def("steps", wide ? v3::steps : baseline::steps);
}
