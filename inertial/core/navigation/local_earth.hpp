// The Earth's terms at the start of an interval (E-117).
#pragma once

#include "common/earth.hpp"
#include "navigation/state.hpp"

namespace gyrofree::navigation {

LocalEarth local_earth(double latitude, double height);

inline earth::Place place_of(const Nominal& x) { return {x.latitude, x.longitude, x.height}; }

}  // namespace gyrofree::navigation
