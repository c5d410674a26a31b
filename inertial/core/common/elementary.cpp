// Series on small intervals after an exact reduction of the argument. Coefficients are 1/n!, 1/n.
#include "common/elementary.hpp"

#include <cmath>
#include <cstdint>
#include <limits>

namespace gyrofree::elementary {
namespace {

constexpr double PI = 3.14159265358979311600;       // rad, upper part
constexpr double HALF_PI = 1.57079632679489655800;  // rad, upper part
constexpr double HALF_PI_REST = 6.12323399573676603587e-17;
constexpr double TWO_OVER_PI = 0.63661977236758138243;
// pi/2 in four parts; the first three have zeros at their ends, so that k times them is exact
constexpr double HALF_PI_1 = 0x1.921fb5p+0;
constexpr double HALF_PI_2 = 0x1.110b46p-26;
constexpr double HALF_PI_3 = 0x1.1a6263p-54;
constexpr double HALF_PI_4 = 0x1.8a2e03707344ap-81;
constexpr double LN2_HIGH = 0x1.62e42fefap-1;  // k times it is exact for |k| < 2^16
constexpr double LN2_LOW = 0x1.cf79abc9e3b3ap-40;

struct Reduced {
  double r;    // within +-pi/4
  int quadrant;  // modulo 4
};

Reduced reduce(double x) {
  if (std::fabs(x) > 1e8) x = std::fmod(x, 2.0 * PI);  // such angles have no meaning left here
  const double k = std::floor(x * TWO_OVER_PI + 0.5);
  double r = ((x - k * HALF_PI_1) - k * HALF_PI_2) - k * HALF_PI_3;
  r -= k * HALF_PI_4;
  return {r, static_cast<int>(static_cast<std::int64_t>(k) & 3)};
}

double sine_series(double r) {
  const double s = r * r;
  double sum = 1.0 / 355687428096000.0;  // 1/17!
  sum = -1.0 / 1307674368000.0 + s * sum;
  sum = 1.0 / 6227020800.0 + s * sum;
  sum = -1.0 / 39916800.0 + s * sum;
  sum = 1.0 / 362880.0 + s * sum;
  sum = -1.0 / 5040.0 + s * sum;
  sum = 1.0 / 120.0 + s * sum;
  sum = -1.0 / 6.0 + s * sum;
  return r + r * (s * sum);
}

double cosine_series(double r) {
  const double s = r * r;
  double sum = 1.0 / 20922789888000.0;  // 1/16!
  sum = -1.0 / 87178291200.0 + s * sum;
  sum = 1.0 / 479001600.0 + s * sum;
  sum = -1.0 / 3628800.0 + s * sum;
  sum = 1.0 / 40320.0 + s * sum;
  sum = -1.0 / 720.0 + s * sum;
  sum = 1.0 / 24.0 + s * sum;
  const double half = 0.5 * s;
  const double first = 1.0 - half;
  return first + (((1.0 - first) - half) + s * (s * sum));
}

double bounded(double x) { return x > 1.0 ? 1.0 : (x < -1.0 ? -1.0 : x); }

// atan(k/8), k = 0 to 8
constexpr double EIGHTHS[9] = {0.0,
                               0.12435499454676143503,
                               0.24497866312686415417,
                               0.35877067027057222040,
                               0.46364760900080611621,
                               0.55859931534356243597,
                               0.64350110879328438680,
                               0.71882999962162450541,
                               0.78539816339744830962};

// 0 <= x <= 1
double atan_of_part(double x) {
  const int k = static_cast<int>(x * 8.0 + 0.5);
  const double c = 0.125 * k;
  const double t = (x - c) / (1.0 + x * c);
  const double s = t * t;
  double sum = 1.0 / 17.0;
  for (int n = 15; n >= 3; n -= 2) sum = 1.0 / n - s * sum;
  return EIGHTHS[k] + (t - t * (s * sum));
}

}  // namespace

double sin(double x) {
  if (!std::isfinite(x)) return std::numeric_limits<double>::quiet_NaN();
  const auto [r, quadrant] = reduce(x);
  const double value = quadrant & 1 ? cosine_series(r) : sine_series(r);
  return quadrant & 2 ? -value : value;
}

double cos(double x) {
  if (!std::isfinite(x)) return std::numeric_limits<double>::quiet_NaN();
  const auto [r, quadrant] = reduce(x);
  const double value = quadrant & 1 ? sine_series(r) : cosine_series(r);
  return (quadrant == 1 || quadrant == 2) ? -value : value;
}

double tan(double x) { return sin(x) / cos(x); }

double atan(double x) {
  if (std::isnan(x)) return x;
  const double size = std::fabs(x);
  const double value = size <= 1.0 ? atan_of_part(size) : (HALF_PI - atan_of_part(1.0 / size)) + HALF_PI_REST;
  return std::copysign(value, x);
}

double atan2(double y, double x) {
  if (std::isnan(x) || std::isnan(y)) return x + y;
  if (y == 0.0) return std::signbit(x) ? std::copysign(PI, y) : y;
  double value = 0.0;
  const double a = std::fabs(y);
  const double b = std::fabs(x);
  if (std::isinf(a) && std::isinf(b)) {
    value = 0.5 * HALF_PI;
  } else if (a <= b) {
    value = atan_of_part(a / b);
  } else {
    value = (HALF_PI - atan_of_part(b / a)) + HALF_PI_REST;
  }
  if (std::signbit(x)) value = (PI - value) + 2.0 * HALF_PI_REST;
  return std::copysign(value, y);
}

double asin(double x) {
  const double s = bounded(x);
  return atan2(s, std::sqrt((1.0 - s) * (1.0 + s)));
}

double acos(double x) {
  const double c = bounded(x);
  return atan2(std::sqrt((1.0 - c) * (1.0 + c)), c);
}

double exp(double x) {
  if (std::isnan(x)) return x;
  if (x > 709.782712893384) return std::numeric_limits<double>::infinity();
  if (x < -745.2) return 0.0;
  const double k = std::floor(x / 0.69314718055994530942 + 0.5);
  const double high = x - k * LN2_HIGH;
  const double low = k * LN2_LOW;
  const double r = high - low;
  double sum = 1.0 / 6227020800.0;  // 1/13!
  constexpr double inverse[] = {1.0 / 479001600.0, 1.0 / 39916800.0, 1.0 / 3628800.0, 1.0 / 362880.0,
                                1.0 / 40320.0,     1.0 / 5040.0,     1.0 / 720.0,     1.0 / 120.0,
                                1.0 / 24.0,        1.0 / 6.0,        1.0 / 2.0};
  for (const double term : inverse) sum = term + r * sum;
  const double tail = ((high - r) - low) + r * r * sum;
  return std::ldexp(1.0 + (r + tail), static_cast<int>(k));
}

double log(double x) {
  if (std::isnan(x) || x < 0.0) return std::numeric_limits<double>::quiet_NaN();
  if (x == 0.0) return -std::numeric_limits<double>::infinity();
  if (std::isinf(x)) return x;
  int k = 0;
  double m = std::frexp(x, &k);  // [1/2, 1)
  if (m < 0.70710678118654752440) {
    m *= 2.0;
    --k;
  }
  const double f = m - 1.0;  // exact
  const double s = f / (2.0 + f);
  const double z = s * s;
  double sum = 1.0 / 25.0;
  for (int n = 23; n >= 3; n -= 2) sum = 1.0 / n + z * sum;
  const double half = 0.5 * f * f;
  // log(1 + f) = f - half + s (half + 2 z sum)
  const double rest = s * (half + 2.0 * z * sum);
  return k * LN2_HIGH - ((half - (rest + k * LN2_LOW)) - f);
}

double pow(double base, double exponent) { return exp(exponent * log(base)); }

}  // namespace gyrofree::elementary
