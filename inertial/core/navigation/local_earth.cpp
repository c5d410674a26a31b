#include "navigation/local_earth.hpp"

#include "common/elementary.hpp"

namespace gyrofree::navigation {
namespace {

constexpr double LATITUDE_STEP = 1e-4;  // rad, of the differences below
constexpr double HEIGHT_STEP = 1.0;     // m

}  // namespace

LocalEarth local_earth(double latitude, double height) {
  const auto here = earth::radii(latitude);
  const auto north = earth::radii(latitude + LATITUDE_STEP), south = earth::radii(latitude - LATITUDE_STEP);
  LocalEarth e;
  e.latitude = latitude;
  e.height = height;
  e.sine = elementary::sin(latitude);
  e.cosine = elementary::cos(latitude);
  e.tangent = e.sine / e.cosine;
  e.inverse_n = 1.0 / (here.north + height);
  e.inverse_e = 1.0 / (here.east + height);
  e.gravity = earth::gravity(latitude, height);
  e.gravity_by_height =
      (earth::gravity(latitude, height + HEIGHT_STEP) - earth::gravity(latitude, height - HEIGHT_STEP)) / (2.0 * HEIGHT_STEP);
  e.gravity_by_latitude =
      (earth::gravity(latitude + LATITUDE_STEP, height) - earth::gravity(latitude - LATITUDE_STEP, height)) /
      (2.0 * LATITUDE_STEP);
  e.n_by_latitude = (north.north - south.north) / (2.0 * LATITUDE_STEP);
  e.e_by_latitude = (north.east - south.east) / (2.0 * LATITUDE_STEP);
  return e;
}

}  // namespace gyrofree::navigation
