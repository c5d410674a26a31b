// Parts of the rate estimators' bindings.
#pragma once

#include "common/python.hpp"

namespace gyrofree::rate {

void bind_rate_constants(nb::module_& m);  // classes whose attributes Python sets
void bind_rate_kernels(nb::module_& m);    // single equations, for those who compare them with their twins

}  // namespace gyrofree::rate
