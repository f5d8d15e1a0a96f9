// The one unit that knows Python: kernels for the processor at hand, as functions of numpy arrays.

#include "kernels.hpp"
#include "processor.hpp"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

namespace py = pybind11;

namespace pybind11::detail {

// Read: whatever numpy makes an array of. Written: an array that is as it has to be. Returned: without a copy.
template <typename T> struct type_caster<Tensor<T>> {
  using Bare = std::remove_const_t<T>;
  using Numpy = array_t<Bare, array::c_style | (std::is_const_v<T> ? array::forcecast : 0)>;
  PYBIND11_TYPE_CASTER(Tensor<T>, const_name("numpy.ndarray"));

  bool load(handle from, bool) {
    if (!std::is_const_v<T> && !Numpy::check_(from)) return false;
    held = Numpy::ensure(from);
    if (!held) return false;
    T *data;
    if constexpr (std::is_const_v<T>) data = held.data();
    else data = held.mutable_data();
    value = Tensor<T>(data, {held.shape(), held.shape() + held.ndim()});
    return true;
  }

  static handle cast(Tensor<T> from, return_value_policy, handle) {
    const auto kept = new Tensor<T>(std::move(from));
    const capsule owner(kept, [](void *p) { delete static_cast<Tensor<T> *>(p); });
    return Numpy(kept->shape(), kept->data(), owner).release();
  }

private:
  Numpy held; // as long as the call takes
};

} // namespace pybind11::detail

PYBIND11_MODULE(_engine, module) {
  module.doc() = "Kernels of kalman, motion and pseudorigid, compiled";
  const std::string arch = processor();
#if DISPATCHES
  const Kernels &chosen = arch == "baseline" ? baseline_kernels : v3_kernels;
  const Passes &passes = arch == "v4" ? v4_passes : chosen.passes;
#else
  const Kernels &chosen = baseline_kernels;
  const Passes &passes = chosen.passes;
#endif
  const Flights &flights = chosen.flights;
  const Bodies &bodies = chosen.bodies;
  const auto def = [&](const char *name, auto function) {
    module.def(name, function, py::call_guard<py::gil_scoped_release>());
  };
  module.attr("arch") = arch;
#ifdef __clang__
  module.attr("compiler") = "clang " __clang_version__;
#else
  module.attr("compiler") = "gcc " __VERSION__;
#endif
  def("covariance_pass", passes.covariance_pass);
  def("mean_pass", passes.mean_pass);
  def("adjoint_pass", passes.adjoint_pass);
  def("information_pass", passes.information_pass);
  def("combine", passes.combine);
  def("log_likelihood", passes.log_likelihood);
  def("innovations", passes.innovations);
  module.attr("lanes") = flights.lanes;
  def("turn", flights.turn);
  def("rotation_rows", flights.rotation_rows);
  def("smooth", flights.smooth);
  def("between", flights.between);
  def("turned", flights.turned);
  def("sums", bodies.sums);
  def("fitted", bodies.fitted);
  def("kabsch", bodies.turned);
  def("polar", bodies.polar);
  def("bipolar", bodies.bipolar);
  def("steps", bodies.steps);
  def("follow", chosen.lags.follow);
  def("discretized", chosen.steps.discretized);
  def("misfit", chosen.spectra.misfit);
  def("slopes", chosen.spectra.slopes);
  def("scoring_step", chosen.spectra.scoring_step);
  def("whitened", chosen.whitening.whitened);
  def("fixed_to_body", chosen.body_fixed.fixed);
  def("along", chosen.leads.along);
  def("onward", chosen.leads.onward);
  def("look", chosen.leads.look);
  def("shocks", chosen.shocks.seen);
}
