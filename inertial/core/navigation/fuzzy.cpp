#include "navigation/fuzzy.hpp"

#include <algorithm>

namespace gyrofree::navigation {
namespace {

constexpr double LEAST_FIXES = 2.0, MOST_FIXES = 10.0;
constexpr int SMALL = 0, MEDIUM = 1, HIGH = 2, SETS = 3;

double between_0_and_1(double v) { return std::min(1.0, std::max(0.0, v)); }

}  // namespace

Vector3 membership(double value, const Vector3& points) {
  Vector3 out;
  out[SMALL] = between_0_and_1((points[MEDIUM] - value) / (points[MEDIUM] - points[SMALL]));
  out[HIGH] = between_0_and_1((value - points[MEDIUM]) / (points[HIGH] - points[MEDIUM]));
  out[MEDIUM] = 1.0 - out[SMALL] - out[HIGH];
  return out;
}

double crisp_horizon(double force, double rate, const FuzzyRules& rules) {
  const Vector3 a = membership(force, rules.force), b = membership(rate, rules.rate);
  double total = 0.0, weight = 0.0;
  for (int i = 0; i < SETS; ++i)
    for (int j = 0; j < SETS; ++j) {
      const double w = rules.minimum ? std::min(a(i), b(j)) : a(i) * b(j);
      weight += w;
      total += w * rules.table(i, j);
    }
  return 1.0 + total / weight;
}

int whole_horizon(double crisp) {
  return static_cast<int>(std::min(MOST_FIXES, std::max(LEAST_FIXES, std::floor(crisp + 0.5))));
}

}  // namespace gyrofree::navigation
