// The Earth under a local navigation frame: WGS-84 radii, gravity, rates (E-20 to E-22).
// numpy twin: tests/inertial/twins/navigation.py. The constants are those of inertial/constants.py.
#pragma once

#include "common/matrix.hpp"
#include "navigation/state.hpp"

namespace gyrofree::navigation {

constexpr double SEMI_MAJOR = 6378137.0;                 // m
constexpr double ECCENTRICITY2 = 6.69437999014e-3;       // first eccentricity squared
constexpr double FLATTENING = 1.0 / 298.257223563;
constexpr double EARTH_RATE = 7.292115e-5;               // rad/s
constexpr double GRAVITY_EQUATOR = 9.7803253359;         // m/s^2, normal gravity
constexpr double SOMIGLIANA = 0.00193185265241;
constexpr double GRAVITY_M = 0.00344978650684;           // omega^2 a^2 b / GM
constexpr double STANDARD_GRAVITY = 9.80665;             // m/s^2

struct Radii {
  double meridian;  // R_N, m
  double normal;    // R_E, m
};

struct Place {
  double latitude;   // rad
  double longitude;  // rad
  double height;     // m
};

Radii radii(double latitude);
double gravity(double latitude, double height);
Vector3 earth_rate_n(double latitude);
Vector3 transport_rate_n(double latitude, double height, const Vector3& v_n);
// Metres north, east, down of a place from an origin, along the arcs of the ellipsoid there.
Vector3 ned_between(const Place& origin, const Place& place);
// The Earth's terms for the interval that starts at a place (E-37).
LocalEarth local_earth(double latitude, double height);

inline Place place_of(const Nominal& x) { return {x.latitude, x.longitude, x.height}; }

}  // namespace gyrofree::navigation
