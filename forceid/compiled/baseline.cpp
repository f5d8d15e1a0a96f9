// Kernels for every processor.

#include "standard.hpp"

#define REGISTER 2
#define SIZES(X)
#include "../kalman/lanes.hpp"
#include "../kalman/strips.hpp"
#include "../kalman/passes.hpp"
#include "../kalman/fixed_lag.hpp"
#include "../kalman/steps.hpp"
#include "../kalman/whitening.hpp"
#include "../kalman/shocks.hpp"
#include "../flight/flight.hpp"
#include "../flight/spectra.hpp"
#include "../flight/body_fixed.hpp"
#include "../flight/lead.hpp"
#include "../motion/poses.hpp"
#include "../flight/look.hpp"
#include "twofold.hpp"
#include "../motion/kabsch.hpp"
#include "../principal/folded.hpp"
#include "../pseudorigid/polar.hpp"
#include "../pseudorigid/splitting.hpp"

const Kernels baseline_kernels = {
    passes::table, flight::table, {folded::sums, poses::fitted, kabsch::turned, polar::polar, polar::bipolar_factors, splitting::steps},
    {fixed_lag::follow}, {::steps::discretized}, {spectra::misfit, spectra::slopes, spectra::scoring_step}, {whitening::whitened}, {body_fixed::fixed}, {lead::along, lead::onward, look::look}, {shocks::seen}};
