#include "navigation/earth.hpp"

#include <cmath>

#include "common/elementary.hpp"

namespace gyrofree::navigation {
namespace {

constexpr double PI = 3.14159265358979311600;
constexpr double LATITUDE_STEP = 1e-4;  // rad, of the differences below
constexpr double HEIGHT_STEP = 1.0;     // m

}  // namespace

// (E-20)
Radii radii(double latitude) {
  const double s = elementary::sin(latitude);
  const double root = std::sqrt(1.0 - ECCENTRICITY2 * s * s);
  return {SEMI_MAJOR * (1.0 - ECCENTRICITY2) / (root * root * root), SEMI_MAJOR / root};
}

// (E-21), along +D
double gravity(double latitude, double height) {
  const double s = elementary::sin(latitude);
  const double s2 = s * s;
  const double surface = GRAVITY_EQUATOR * (1.0 + SOMIGLIANA * s2) / std::sqrt(1.0 - ECCENTRICITY2 * s2);
  const double h = height / SEMI_MAJOR;
  return surface * (1.0 - 2.0 * h * (1.0 + FLATTENING + GRAVITY_M - 2.0 * FLATTENING * s2) + 3.0 * h * h);
}

// (E-22)
Vector3 earth_rate_n(double latitude) {
  return {EARTH_RATE * elementary::cos(latitude), 0.0, -EARTH_RATE * elementary::sin(latitude)};
}

// n turns against the Earth because the vehicle moves over it (E-22).
Vector3 transport_rate_n(double latitude, double height, const Vector3& v_n) {
  const auto [meridian, normal] = radii(latitude);
  return {v_n[EAST] / (normal + height), -v_n[NORTH] / (meridian + height),
          -v_n[EAST] * elementary::tan(latitude) / (normal + height)};
}

Vector3 ned_between(const Place& origin, const Place& place) {
  const auto [meridian, normal] = radii(origin.latitude);
  double east = place.longitude - origin.longitude;  // over the antimeridian too
  east -= 2.0 * PI * std::floor((east + PI) / (2.0 * PI));
  return {(place.latitude - origin.latitude) * (meridian + origin.height),
          east * (normal + origin.height) * elementary::cos(origin.latitude), origin.height - place.height};
}

LocalEarth local_earth(double latitude, double height) {
  const auto here = radii(latitude);
  const auto north = radii(latitude + LATITUDE_STEP), south = radii(latitude - LATITUDE_STEP);
  LocalEarth e;
  e.latitude = latitude;
  e.height = height;
  e.sine = elementary::sin(latitude);
  e.cosine = elementary::cos(latitude);
  e.tangent = e.sine / e.cosine;
  e.inverse_n = 1.0 / (here.meridian + height);
  e.inverse_e = 1.0 / (here.normal + height);
  e.gravity = gravity(latitude, height);
  e.gravity_by_height =
      (gravity(latitude, height + HEIGHT_STEP) - gravity(latitude, height - HEIGHT_STEP)) / (2.0 * HEIGHT_STEP);
  e.gravity_by_latitude =
      (gravity(latitude + LATITUDE_STEP, height) - gravity(latitude - LATITUDE_STEP, height)) /
      (2.0 * LATITUDE_STEP);
  e.n_by_latitude = (north.meridian - south.meridian) / (2.0 * LATITUDE_STEP);
  e.e_by_latitude = (north.normal - south.normal) / (2.0 * LATITUDE_STEP);
  return e;
}

}  // namespace gyrofree::navigation
