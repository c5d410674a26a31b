// The Earth under a local navigation frame: WGS-84 radii, gravity, rates, places near by (E-100 to E-102
// of docs/equations-ins.md). numpy twin, with the same bits: inertial/earth.py.
#pragma once

#include "common/elementary.hpp"
#include "common/matrix.hpp"

namespace gyrofree::earth {

// WGS-84; sources in inertial/constants.py.
constexpr double SEMI_MAJOR_AXIS = 6378137.0;          // m
constexpr double FLATTENING = 1.0 / 298.257223563;
constexpr double ECCENTRICITY2 = 6.69437999014e-3;     // first eccentricity squared
constexpr double RATE = 7.292115e-5;                   // rad/s
constexpr double GRAVITY_EQUATOR = 9.7803253359;       // m/s^2
constexpr double GRAVITY_FORMULA = 0.00193185265241;   // k of Somigliana's formula
constexpr double GRAVITY_RATIO = 0.00344978650684;     // omega^2 a^2 b / GM

constexpr double STANDARD_GRAVITY = 9.80665;          // m/s^2, what data sheets mean by g

// Latitude and longitude, rad; ellipsoidal height, m.
struct Place {
  double latitude = 0.0;
  double longitude = 0.0;
  double height = 0.0;
};

struct Radii {
  double north = 0.0;  // R_N, m, of the meridian
  double east = 0.0;   // R_E, m, of the prime vertical
};

// Radii of curvature (E-100).
inline Radii radii(double latitude) {
  const double s = elementary::sin(latitude);
  const double root = std::sqrt(1.0 - ECCENTRICITY2 * s * s);
  return {SEMI_MAJOR_AXIS * (1.0 - ECCENTRICITY2) / (root * root * root), SEMI_MAJOR_AXIS / root};
}

// Magnitude of normal gravity at a height, m/s^2, along +D (E-101).
inline double gravity(double latitude, double height) {
  const double s = elementary::sin(latitude);
  const double s2 = s * s;
  const double surface = GRAVITY_EQUATOR * (1.0 + GRAVITY_FORMULA * s2) / std::sqrt(1.0 - ECCENTRICITY2 * s2);
  const double part = height / SEMI_MAJOR_AXIS;
  const double slope = 1.0 + FLATTENING + GRAVITY_RATIO - 2.0 * FLATTENING * s2;
  return surface * (1.0 - 2.0 * part * slope + 3.0 * part * part);
}

// omega_ie_n, rad/s (E-102).
inline Vector3 earth_rate(double latitude) {
  return {RATE * elementary::cos(latitude), 0.0, -RATE * elementary::sin(latitude)};
}

// omega_en_n, rad/s: n turns against the Earth because the vehicle moves over it (E-102).
inline Vector3 transport_rate(double latitude, double height, double v_north, double v_east) {
  const Radii r = radii(latitude);
  return {v_east / (r.east + height), -v_north / (r.north + height),
          -v_east * elementary::tan(latitude) / (r.east + height)};
}

// Metres north, east and down of a place from an origin, along the arcs of the ellipsoid at the
// origin's height, over the antimeridian too.
inline Vector3 ned_between(const Place& origin, const Place& place) {
  constexpr double PI = 3.14159265358979311600;
  const Radii r = radii(origin.latitude);
  double turn = std::fmod(place.longitude - origin.longitude + PI, 2.0 * PI);
  if (turn < 0.0) turn += 2.0 * PI;
  return {(place.latitude - origin.latitude) * (r.north + origin.height),
          (turn - PI) * (r.east + origin.height) * elementary::cos(origin.latitude),
          origin.height - place.height};
}

}  // namespace gyrofree::earth
